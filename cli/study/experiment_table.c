/* Writes the table of an experiment as Markdown, CSV and JSON. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "experiment_fit_table.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/table.h"

static const char *state_name(cli_experiment_state state)
{
    static const char *const NAMES[] = {"not done", "done", "not available", "failed"};
    return NAMES[state];
}

void cli_experiment_set_errors(cli_experiment_result *out, const cli_eval *e)
{
    out->figure[SDM_FIGURE_MSE] = e->mse_mm2;
    out->figure[SDM_FIGURE_RMSE] = e->rmse_mm;
    out->figure[SDM_FIGURE_RMSE_NEAR] = e->rmse_near_mm;
    out->figure[SDM_FIGURE_MAX] = e->max_abs_mm;
    out->figure[SDM_FIGURE_DICE] = e->dice;
    out->figure[SDM_FIGURE_SURFACE_MEAN] = e->surface_mean_mm;
    out->figure[SDM_FIGURE_SURFACE_MAX] = e->surface_hausdorff_mm;
    out->figure[SDM_FIGURE_SHAPES] = (double)e->n;
}

/* Columns of the table: figures that some row has, measured (own) or published (reference). */
typedef struct columns {
    bool own[SDM_N_FIGURES], reference[SDM_N_FIGURES];
} columns;

/* Returns the published figure f of the row; NaN: there is none. */
static double reference_figure(const cli_experiment_result *r, int f)
{
    return r->row->reference ? r->row->reference->value[f] : NAN;
}

static columns find_columns(const cli_experiment_run *run)
{
    columns c = {.own = {false}};
    for (size_t i = 0; i < run->e->n_rows; i++)
        for (int f = 0; f < SDM_N_FIGURES; f++) {
            c.reference[f] |= isfinite(reference_figure(&run->results[i], f));
            c.own[f] |= isfinite(run->results[i].figure[f]) ||
                        isfinite(reference_figure(&run->results[i], f));
        }
    return c;
}

/* ---- Markdown ---- */

/* Adds the head of a column, "MSE, mm^2 (source) |"; source NULL: measured here. */
static void add_head(sdm_text *t, const sdm_figure_info *info, const char *source)
{
    sdm_text_add(t, " %s%s%s", info->title, *info->unit ? ", " : "", info->unit);
    if (source) sdm_text_add(t, " (%s)", source);
    sdm_text_add(t, " |");
}

static void add_markdown_table(const cli_experiment_run *run, const columns *c, sdm_text *t)
{
    size_t n = 0;
    sdm_text_add(t, "| method |");
    for (int f = 0; f < SDM_N_FIGURES; f++) {
        const sdm_figure_info *info = sdm_figure_get_info((sdm_figure)f);
        if (c->own[f]) add_head(t, info, NULL);
        if (c->reference[f]) add_head(t, info, run->e->experiment.reference);
        n += (size_t)c->own[f] + (size_t)c->reference[f];
    }
    sdm_text_add(t, "\n");
    sdm_markdown_rule(t, 1, n);
    for (size_t i = 0; i < run->e->n_rows; i++) {
        const cli_experiment_result *r = &run->results[i];
        sdm_text_add(t, "| ");
        sdm_markdown_text(t, r->row->title);
        if (r->state != CLI_EXPERIMENT_DONE) sdm_text_add(t, " (%s)", state_name(r->state));
        sdm_text_add(t, " |");
        for (int f = 0; f < SDM_N_FIGURES; f++) {
            if (c->own[f]) sdm_markdown_plain(t, r->figure[f]);
            if (c->reference[f]) sdm_markdown_plain(t, reference_figure(r, f));
        }
        sdm_text_add(t, "\n");
    }
}

static void add_markdown(const cli_experiment_run *run, const columns *c, sdm_text *t)
{
    // title and tables
    char machine[256];
    cli_experiment_describe_machine(machine, sizeof machine);
    sdm_text_add(t, "# %s\n\n", run->e->experiment.title);
    add_markdown_table(run, c, t);
    cli_experiment_fit_markdown(run, t);
    sdm_text_add(t,
                 "\nsdmgen " SDM_VERSION_TEXT
                 "; %s; seed %llu. Times: one core. Errors: differences from exact maps of random "
                 "shapes that no network was trained on.\n\n",
                 machine, (unsigned long long)run->e->experiment.seed);
    // notes of the rows
    for (size_t i = 0; i < run->e->n_rows; i++) {
        const cli_experiment_result *r = &run->results[i];
        const sdm_experiment_reference *reference = r->row->reference;
        sdm_text_add(t, "- ");
        sdm_markdown_text(t, r->row->title);
        sdm_text_add(t, ": %s: ", state_name(r->state));
        sdm_markdown_text(t, r->note);
        sdm_text_add(t, "\n");
        if (!reference || !*reference->source) continue;
        sdm_text_add(t, "  - %s: ", run->e->experiment.reference);
        sdm_markdown_text(t, reference->source);
        sdm_text_add(t, "\n");
    }
    // pictures
    if (!run->e->experiment.pictures) return;
    sdm_text_add(t, "\n");
    for (size_t i = 0; i < run->e->n_rows; i++) {
        const sdm_experiment_row *row = run->results[i].row;
        if (run->results[i].state != CLI_EXPERIMENT_DONE || row->method->fit) continue;
        sdm_text_add(t, "![slices](%s/slices.png) ![surfaces](%s/surfaces.png)\n", row->folder,
                     row->folder);
    }
}

/* ---- CSV ---- */

static void add_csv(const cli_experiment_run *run, const columns *c, sdm_text *t)
{
    sdm_text_add(t, "method,state,loaded,samples");
    for (int f = 0; f < SDM_N_FIGURES; f++) {
        const char *key = sdm_figure_get_info((sdm_figure)f)->key;
        sdm_text_add(t, ",%s", key);
        if (c->reference[f]) sdm_text_add(t, ",reference_%s", key);
    }
    sdm_text_add(t, ",note,source\n");
    for (size_t i = 0; i < run->e->n_rows; i++) {
        const cli_experiment_result *r = &run->results[i];
        sdm_csv_text(t, r->row->title);
        sdm_text_add(t, ",%s,%s,%lld", state_name(r->state), r->loaded ? "true" : "false",
                     (long long)r->row->samples);
        for (int f = 0; f < SDM_N_FIGURES; f++) {

            sdm_csv_real(t, r->figure[f]);
            if (c->reference[f]) sdm_csv_real(t, reference_figure(r, f));
        }
        sdm_text_add(t, ",");
        sdm_csv_text(t, r->note);
        sdm_text_add(t, ",");
        sdm_csv_text(t, r->row->reference ? r->row->reference->source : "");
        sdm_text_add(t, "\n");
    }
}

/* ---- JSON ---- */

static void add_json_row(const cli_experiment_run *run, const cli_experiment_result *r, sdm_json *j)
{
    const sdm_experiment_reference *reference = r->row->reference;
    sdm_json_open(j, NULL, '{');
    sdm_json_text(j, "method", r->row->title);
    sdm_json_text(j, "state", state_name(r->state));
    sdm_json_text(j, *r->row->method->engine ? "engine" : "network",
                  *r->row->method->engine ? r->row->method->engine : r->row->method->network);
    sdm_json_text(j, "folder", r->row->folder);
    sdm_json_text(j, "grid", r->grid);
    sdm_json_bool(j, "loaded", r->loaded);
    sdm_json_int(j, "samples", r->row->samples);
    for (int f = 0; f < SDM_N_FIGURES; f++)
        sdm_json_real(j, sdm_figure_get_info((sdm_figure)f)->key, r->figure[f]);
    if (reference) {
        sdm_json_open(j, "reference", '{');
        for (int f = 0; f < SDM_N_FIGURES; f++)
            if (isfinite(reference->value[f]))
                sdm_json_real(j, sdm_figure_get_info((sdm_figure)f)->key, reference->value[f]);
        sdm_json_text(j, "source", reference->source);
        sdm_json_close(j, '}');
    }
    cli_experiment_fit_json(run, r, j);
    sdm_json_text(j, "note", r->note);
    sdm_json_close(j, '}');
}

static void add_json(const cli_experiment_run *run, sdm_json *j)
{
    char machine[256];
    cli_experiment_describe_machine(machine, sizeof machine);
    sdm_json_open(j, NULL, '{');
    sdm_json_text(j, "title", run->e->experiment.title);
    sdm_json_text(j, "config", run->e->file);
    sdm_json_text(j, "folder", run->folder);
    sdm_json_text(j, "version", SDM_VERSION_TEXT);
    sdm_json_text(j, "machine", machine);
    sdm_json_uint(j, "seed", run->e->experiment.seed);
    sdm_json_real(j, "seconds", sdm_clock() - run->start);
    sdm_json_open(j, "rows", '[');
    for (size_t i = 0; i < run->e->n_rows; i++) add_json_row(run, &run->results[i], j);
    sdm_json_close(j, ']');
    sdm_json_close(j, '}');
}

sdm_status cli_experiment_write_tables(const cli_experiment_run *run, sdm_text *markdown,
                                       sdm_json *json, sdm_error *err)
{
    const columns c = find_columns(run);
    sdm_text csv = {0};
    add_markdown(run, &c, markdown);
    add_csv(run, &c, &csv);
    add_json(run, json);
    sdm_status s = cli_experiment_write_file(run, "table.md", markdown, err);
    if (!s) s = cli_experiment_write_file(run, "table.csv", &csv, err);
    if (!s) s = cli_experiment_write_file(run, "table.json", &json->text, err);
    if (!s) s = cli_experiment_fit_write(run, err);
    sdm_text_dispose(&csv);
    return s;
}
