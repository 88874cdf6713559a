/* Writes all numbers that a page shows as JSON: the scripts of the page draw from it, and other
 * programs can read it. */
#include <math.h>
#include <stdio.h>

#include "page.h"
#include "report/json_values.h"
#include "sdm/internal/mesh_measures.h"

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

static void add_measure(const sdm_measure *m, bool of_mesh, double value, sdm_json *j)
{
    sdm_json_open(j, NULL, '{');
    sdm_json_text(j, "name", m->name);
    sdm_json_text(j, "unit", m->unit);
    sdm_json_text(j, "help", m->help);
    sdm_json_bool(j, "of_depth", m->of_depth);
    sdm_json_bool(j, "of_mesh", of_mesh);
    sdm_json_real(j, "value", value);
    sdm_json_close(j, '}');
}

/* Adds all measures of the shape, its own first; those of a depth have no value. */
static void add_measures(const sdm_instance *shape, const sdm_measures *got, sdm_json *j)
{
    const sdm_shape *t = sdm_instance_shape(shape);
    size_t next = 0;
    sdm_json_open(j, "measures", '[');
    for (size_t i = 0; i < t->n_measures; i++)
        add_measure(&t->measures[i], false, t->measures[i].of_depth ? NAN : got->at[next++].value,
                    j);
    for (size_t i = 0; i < SDM_MESH_MEASURES; i++)
        add_measure(&sdm_mesh_measures[i], true, got->at[next++].value, j);
    sdm_json_close(j, ']');
}

static void add_counts(const char *key, const uint64_t counts[CLI_PAGE_BINS], sdm_json *j)
{
    sdm_json_open(j, key, '[');
    for (int i = 0; i < CLI_PAGE_BINS; i++) sdm_json_uint(j, NULL, counts[i]);
    sdm_json_close(j, ']');
}

static void add_errors(const cli_page_errors *e, sdm_json *j)
{
    sdm_json_open(j, "errors", '{');
    sdm_json_uint(j, "shapes", e->shapes);
    sdm_json_real(j, "near_mm", e->near_mm);
    sdm_json_real(j, "first_edge_mm", e->first_edge);
    sdm_json_int(j, "bins_per_decade", CLI_PAGE_BINS_PER_DECADE);
    add_counts("voxels", e->voxels, j);
    add_counts("near", e->near, j);
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
    size_t n;
    char checksum[32];
    snprintf(checksum, sizeof checksum, "%016llx", (unsigned long long)m->checksum);
    sdm_json_open(j, NULL, '{');
    sdm_json_text(j, "program", "sdmgen " SDM_VERSION_TEXT);
    sdm_json_text(j, "shape", m->shape);
    if (page->shape) sdm_json_text(j, "summary", sdm_instance_shape(page->shape)->summary);
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
    cli_json_model_params(j, m, page->shape ? sdm_instance_params(page->shape, &n) : NULL);
    sdm_json_open(j, "accuracy", '{');
    sdm_json_int(j, "shapes", m->accuracy.samples);
    cli_json_accuracy(j, &m->accuracy);
    sdm_json_close(j, '}');
    if (page->errors->shapes) add_errors(page->errors, j);
    add_still(page->still, j);
    if (page->measures->n) add_measures(page->shape, page->measures, j);
    if (page->fit) add_fit(page->fit, j);
    if (page->metrics) cli_page_history(page->metrics, j);
    sdm_json_close(j, '}');
}
