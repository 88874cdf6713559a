/* Writes all numbers that a page shows as JSON: the scripts of the page draw from it, and other
 * programs can read it. */
#include <stdio.h>

#include "page.h"
#include "report/json_values.h"

static void add_still(const cli_still *s, sdm_json *j)
{
    sdm_json_open(j, "at_default", '{');
    sdm_json_real(j, "volume_mm3", s->volume);
    sdm_json_real(j, "area_mm2", s->area);
    sdm_json_reals(j, "min", s->min, 3);
    sdm_json_reals(j, "max", s->max, 3);
    sdm_json_bool(j, "cut", s->cut);
    sdm_json_uint(j, "vertices", s->n_vert);
    sdm_json_uint(j, "triangles", s->n_tri);
    sdm_json_open(j, "slices", '[');
    for (int a = 0; a < 3; a++) sdm_json_int(j, NULL, s->slice[a]);
    sdm_json_close(j, ']');
    sdm_json_close(j, '}');
}

/* Adds the result of the fit, as it is in its file, and what the bytes of the page mean. */
static void add_fit(const cli_page_fit *f, sdm_json *j)
{
    sdm_json_open(j, "fit_data", '{');
    sdm_json_real(j, "map_step_mm", f->map_step);
    sdm_json_real(j, "sd_step_mm", f->sd_step);
    if (f->image) {
        sdm_json_grid(j, "image", &f->image_grid, false);
        sdm_json_real(j, "low", f->low);
        sdm_json_real(j, "high", f->high);
    }
    sdm_json_close(j, '}');
    sdm_text_add(&j->text, ", \"fit\": %s", f->text);
}

void cli_page_figures(const cli_page *page, sdm_json *j)
{
    const sdm_model_info *m = page->info;
    char checksum[32];
    snprintf(checksum, sizeof checksum, "%016llx", (unsigned long long)m->checksum);
    sdm_json_open(j, NULL, '{');
    sdm_json_text(j, "program", "sdmgen " SDM_VERSION_TEXT);
    sdm_json_text(j, "shape", m->shape);
    if (page->summary) sdm_json_text(j, "summary", page->summary);
    sdm_json_bool(j, "live", page->model);
    sdm_json_open(j, "network", '{');
    sdm_json_text(j, "kind", m->kind);
    sdm_json_text(j, "trained_by", m->version);
    sdm_json_text(j, "checksum", checksum);
    sdm_json_uint(j, "seed", m->seed);
    sdm_json_real(j, "train_seconds", m->train_seconds);
    sdm_json_int(j, "train_maps", m->train_samples);
    sdm_json_uint(j, "file_bytes", m->file_bytes);
    sdm_json_real(j, "multiply_adds", m->macs);
    sdm_json_close(j, '}');
    sdm_json_grid(j, "grid", &m->grid, true);
    cli_json_model_params(j, m, page->of_shape);
    sdm_json_open(j, "accuracy", '{');
    sdm_json_int(j, "shapes", m->accuracy.samples);
    cli_json_accuracy(j, &m->accuracy);
    sdm_json_close(j, '}');
    add_still(page->still, j);
    if (page->fit) add_fit(page->fit, j);
    if (page->metrics) cli_page_history(page->metrics, j);
    sdm_json_close(j, '}');
}
