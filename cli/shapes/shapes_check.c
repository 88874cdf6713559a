/* sdmgen shapes check: surveys a family of shapes and prints what spoils maps, derivatives and
 * trainings. */
#include "shapes_command.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "inputs/config_shape.h"
#include "inputs/setup.h"
#include "part_moves.h"
#include "report/files.h"
#include "report/json_values.h"
#include "report/progress_bar.h"
#include "report/report_audit.h"
#include "report/terminal.h"
#include "sdm/internal/shape_box.h"
#include "sdm/internal/train.h"
#include "sdm/memory.h"
#include "sdm/picture.h"
#include "survey/report_survey.h"

enum { SAMPLES = 128, SECONDS = 60, DRAWN = 9, TITLE_MAX = 200 };

typedef struct check {
    const cli_args *args;
    sdm_registry *registry;
    sdm_config *config; /* NULL: a shape without a configuration */
    sdm_instance *shape;
    cli_survey survey; /* of `shape` */
    double range[SDM_MAX_PARAMS][2];
    sdm_distribution distribution[SDM_MAX_PARAMS];
    sdm_survey_opts opts;
    cli_progress bar;
    bool table;         /* the table of moves was printed */
    unsigned told;      /* sum of the stages printed */
    sdm_status printed; /* by print_stage(); its message */
    sdm_error why;
} check;

static void show_progress(void *user, const char *what, double share)
{
    check *c = user;
    cli_progress_show(&c->bar, what, share, NULL);
}

/* ---- the shape ---- */

/* Ranges, distributions and grid of the configuration. */
static sdm_status open_config(check *c, sdm_error *err)
{
    cli_args args = *c->args; // without the word "check"
    args.files.items++;
    args.files.n--;
    double min[SDM_MAX_PARAMS], max[SDM_MAX_PARAMS];
    size_t n = 0;
    if (args.options.n > 0)
        return sdm_fail(err, SDM_E_ARG,
                        "shapes check: -O belongs to NAME; a configuration has shape.options");
    sdm_status s = cli_open_config(&args, &c->config, &c->registry, &c->shape, err);
    if (!s) s = cli_check_memory(c->config, c->shape, err);
    if (!s) sdm_instance_params(c->shape, &n);
    if (!s) s = sdm_train_ranges(c->config, c->shape, min, max, err);
    if (!s) s = sdm_train_distributions(c->config, c->shape, min, max, c->distribution, err);
    if (s) return s;
    for (size_t i = 0; i < n; i++) {
        c->range[i][0] = min[i];
        c->range[i][1] = max[i];
    }
    c->opts.range = (const double(*)[2])c->range;
    c->opts.distribution = c->distribution;
    c->opts.grid = c->survey.grid = &c->config->grid;
    c->survey.config = c->config;
    c->opts.grid_fitted = c->config->grid_fitted;
    c->opts.seed = c->config->seed;
    return SDM_OK;
}

static sdm_status open_shape(check *c, sdm_error *err)
{
    const cli_args *args = c->args;
    const char *name = args->files.n > 1 ? args->files.items[1] : NULL;
    c->opts = (sdm_survey_opts){.samples = args->samples >= 0 ? (size_t)args->samples : SAMPLES,
                                .seed = args->seed >= 0 ? (uint64_t)args->seed : 1,
                                .n_threads = (int)args->threads,
                                .seconds = args->samples >= 0 ? 0 : SECONDS,
                                .cancelled = cli_interrupted,
                                .progress = show_progress,
                                .user = c};
    if (name && cli_ends_with_any(name, ".yaml .yml")) return open_config(c, err);
    if (args->files.n > 2)
        return sdm_fail(err, SDM_E_ARG, "shapes check: unexpected argument '%s'",
                        args->files.items[2]);
    sdm_status s = cli_open_registry(args, &c->registry, err);
    if (!s && !name) s = cli_only_shape(args, c->registry, "check NAME|CONFIG", &name, err);
    return s ? s : cli_create_shape(c->registry, name, &args->options, &c->shape, err);
}

/* ---- output ---- */

static const char *weight_name(sdm_status weight)
{
    return weight ? cli_verdict_name(weight) : "note";
}

static void print_line(void *user, sdm_status weight, const char *line)
{
    (void)user;
    printf("%-8s %s\n", weight_name(weight), line);
}

static void add_line(void *user, sdm_status weight, const char *line)
{
    sdm_json *json = user;
    sdm_json_open(json, NULL, '{');
    sdm_json_text(json, "weight", weight_name(weight));
    sdm_json_text(json, "text", line);
    sdm_json_close(json, '}');
}

/* Prints what a stage has found, so that it can be read while the next one runs. */
static void print_stage(void *user, sdm_survey_stage stage)
{
    check *c = user;
    const sdm_shape_survey *f = &c->survey.found;
    if (c->args->json) return;
    cli_progress_clear(&c->bar);
    if (stage == SDM_SURVEY_MESHES) {
        printf("%s: the default shape, %zu corners of the ranges, %zu random shapes\n",
               sdm_instance_shape(c->survey.shape)->name, f->n_corners, f->n_samples);
        if (f->n_vert)
            printf("mesh     %zu vertices, %zu triangles, %.3g ms\n", f->n_vert, f->n_tri,
                   f->ms_mesh);
    }
    if (!c->printed) c->printed = cli_survey_tell(&c->survey, stage, print_line, NULL, &c->why);
    c->told |= stage;
    (void)fflush(stdout);
}

static sdm_status print_rest(const check *c, const cli_part_moves *moves, sdm_error *err)
{
    const sdm_shape_survey *f = &c->survey.found;
    if (c->printed) {
        *err = c->why;
        return c->printed;
    }
    char low[32], high[32];
    if (f->volume[0] <= f->volume[1])
        printf("volume   %s .. %s mm^3, of the union\n", cli_number(f->volume[0], 6, low),
               cli_number(f->volume[1], 6, high));
    if (!(f->low[0] <= f->high[0]))
        printf("box      not known: no mesh was made\n");
    else
        printf("box      %.4g %.4g %.4g .. %.4g %.4g %.4g mm\n", f->low[0], f->low[1], f->low[2],
               f->high[0], f->high[1], f->high[2]);
    cli_part_moves_print(moves, sdm_instance_params(c->survey.shape, NULL));
    if (f->has_velocity)
        printf("velocity differs from differences of meshes by %.2g at most (relative)\n",
               f->velocity_error);
    return cli_survey_tell(&c->survey, CLI_ALL_STAGES & ~c->told, print_line, NULL, err);
}

static void add_count(sdm_json *j, const check *c, const char *key, const sdm_survey_count *count)
{
    const sdm_shape_survey *f = &c->survey.found;
    size_t n;
    const sdm_param *params = sdm_instance_params(c->survey.shape, &n);
    sdm_json_open(j, key, '{');
    sdm_json_int(j, "shapes", (int64_t)count->shapes);
    if (count->shapes) {
        sdm_json_real(j, "most", count->amount);
        cli_json_params(j, "at", params, n, f->p + count->worst * n);
    }
    sdm_json_close(j, '}');
}

static void add_jumps(sdm_json *j, const check *c)
{
    static const char *const names[] = {[SDM_BREAK_JUMP] = "jump",
                                        [SDM_BREAK_SIZES] = "sizes",
                                        [SDM_BREAK_TRIANGLES] = "triangles",
                                        [SDM_BREAK_STATE] = "state"};
    const sdm_shape_survey *f = &c->survey.found;
    size_t n;
    const sdm_param *params = sdm_instance_params(c->survey.shape, &n);
    sdm_json_open(j, "jumps", '[');
    for (size_t k = 0; k < n && f->jump; k++) {
        if (f->jump[k].kind == SDM_BREAK_NONE) continue;
        sdm_json_open(j, NULL, '{');
        sdm_json_text(j, "kind", names[f->jump[k].kind]);
        sdm_json_text(j, "parameter", params[k].name);
        sdm_json_real(j, "value", f->jump[k].value);
        sdm_json_int(j, "vertex", (int64_t)f->jump[k].vertex);
        sdm_json_real(j, "mm", f->jump[k].mm);
        cli_json_params(j, "at", params, n, f->p + f->jump[k].shape * n);
        sdm_json_close(j, '}');
    }
    sdm_json_close(j, ']');
}

static sdm_status print_json(const check *c, const cli_part_moves *moves, sdm_error *err)
{
    const sdm_shape_survey *f = &c->survey.found;
    const sdm_status verdict = sdm_shape_survey_verdict(f);
    const struct {
        const char *key;
        const sdm_survey_count *count;
    } counts[] = {{"failed", &f->failed},
                  {"open", &f->open},
                  {"unused", &f->unused},
                  {"inside_out", &f->inside_out},
                  {"turned", &f->turned},
                  {"folded", &f->folded},
                  {"resized", &f->resized},
                  {"rewired", &f->rewired},
                  {"overlaps", &f->overlaps},
                  {"degenerate", &f->degenerate},
                  {"duplicate", &f->duplicate},
                  {"cut", &f->cut},
                  {"thin", &f->thin},
                  {"apart", &f->apart},
                  {"flat", &f->flat},
                  {"wound", &f->wound},
                  {"tiny", &f->tiny}};
    sdm_json j = {0};
    sdm_json_open(&j, NULL, '{');
    sdm_json_text(&j, "shape", sdm_instance_shape(c->survey.shape)->name);
    sdm_json_text(&j, "verdict", cli_verdict_name(verdict));
    sdm_json_int(&j, "shapes", (int64_t)f->n);
    sdm_json_int(&j, "corners", (int64_t)f->n_corners);
    sdm_json_int(&j, "samples", (int64_t)f->n_samples);
    sdm_json_int(&j, "untested", (int64_t)f->untested);
    sdm_json_int(&j, "vertices", (int64_t)f->n_vert);
    sdm_json_int(&j, "triangles", (int64_t)f->n_tri);
    sdm_json_real(&j, "ms_mesh", f->ms_mesh);
    sdm_json_reals(&j, "union_volume_mm3", f->volume, 2);
    sdm_json_reals(&j, "union_area_mm2", f->area, 2);
    sdm_json_reals(&j, "min", f->low, 3);
    sdm_json_reals(&j, "max", f->high, 3);
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++)
        add_count(&j, c, counts[i].key, counts[i].count);
    if (c->survey.grid) {
        sdm_json_grid(&j, "grid", c->survey.grid, true);
        sdm_json_reals(&j, "beyond_mm", &f->beyond[0][0], 6);
    }
    add_jumps(&j, c);
    cli_part_moves_json(moves, sdm_instance_params(c->survey.shape, NULL), &j);
    if (f->has_velocity) sdm_json_real(&j, "velocity_error", f->velocity_error);
    sdm_json_int(&j, "unlike", (int64_t)f->repeat.unlike);
    sdm_json_open(&j, "findings", '[');
    const sdm_status s = cli_survey_tell(&c->survey, CLI_ALL_STAGES, add_line, &j, err);
    sdm_json_close(&j, ']');
    sdm_json_close(&j, '}');
    if (!s) return cli_print_json(&j, err);
    sdm_json_dispose(&j);
    return s;
}

/* Writes the first parameters of shape `index`, as many as there is room for. */
static const char *title_of(const check *c, size_t index, char title[TITLE_MAX])
{
    const sdm_shape_survey *f = &c->survey.found;
    const sdm_param *params = sdm_instance_params(c->shape, NULL);
    size_t n = 0;
    for (size_t i = 0; i < f->n_params; i++) {
        char word[TITLE_MAX];
        const int length =
            snprintf(word, sizeof word, "%s=%.3g ", params[i].name, f->p[index * f->n_params + i]);
        if (n + (size_t)length + 4 > TITLE_MAX) {
            strcpy(title + n, "...");
            break;
        }
        strcpy(title + n, word);
        n += (size_t)length;
    }
    return title;
}

/* Draws the default shape and the first samples. If the grid cuts shapes, what lies beyond it is
 * coloured, and the last one is the shape that is cut most. */
static sdm_status draw(const check *c, const char *path, sdm_error *err)
{
    const sdm_shape_survey *f = &c->survey.found;
    const bool colour = f->cut.shapes > 0;
    sdm_picture_surface surface[DRAWN];
    sdm_mesh mesh[DRAWN] = {{0}};
    double *beyond[DRAWN] = {0};
    char title[DRAWN][TITLE_MAX] = {""};
    size_t n = 0;
    sdm_status s = SDM_OK;
    for (size_t i = 0; i < f->n && n < DRAWN && !s; i++) {
        const size_t shape = !i ? 0 : colour && n == DRAWN - 1 ? f->cut.worst : f->n_corners + i;
        if (shape >= f->n ||
            sdm_instance_mesh(c->survey.shape, f->p + shape * f->n_params, &mesh[n], NULL))
            continue;
        if (colour) s = SDM_ALLOC(&beyond[n], mesh[n].n_vert, "distances beyond the grid", err);
        if (!s && colour)
            for (size_t v = 0; v < mesh[n].n_vert; v++)
                beyond[n][v] = sdm_grid_beyond(c->survey.grid, mesh[n].vert + 3 * v, NULL);
        surface[n] = (sdm_picture_surface){title_of(c, shape, title[n]), &mesh[n], beyond[n]};
        n++;
    }
    if (!s && !n) s = sdm_fail(err, SDM_E_MESH, "%s: no shape can be made", path);
    if (!s) s = sdm_picture_gallery(path, surface, n, "beyond the grid", err);
    for (size_t i = 0; i < DRAWN; i++) {
        sdm_mesh_dispose(&mesh[i]);
        sdm_free(beyond[i]);
    }
    return s;
}

/* ---- the command ---- */

/* Tests that were left out, in the words of the verdict. */
static void add_left(const check *c, sdm_text *text)
{
    sdm_text left = {0};
    cli_survey_untested(&c->survey, &left);
    if (left.data)
        sdm_text_add(text, "; not tested %s: %s",
                     c->survey.found.cancelled ? "before the interrupt" : "for want of time",
                     left.data);
    text->failed = text->failed || left.failed;
    sdm_text_dispose(&left);
}

/* "as far as tested", if tests were left out. */
static const char *reach(const sdm_text *left) { return left->data ? ", as far as tested" : ""; }

static sdm_status give_verdict(const check *c, const sdm_text *left, sdm_error *err)
{
    const sdm_status verdict = sdm_shape_survey_verdict(&c->survey.found);
    const char *name = sdm_instance_shape(c->survey.shape)->name;
    const sdm_survey_count *apart = &c->survey.found.apart;
    if (verdict && sdm_survey_mend_first(&c->survey.found))
        return sdm_fail(err, verdict,
                        "%s: maps or trainings would suffer: mend what is marked '%s', and check "
                        "again",
                        name, cli_verdict_name(cli_survey_cause(&c->survey)));
    if (verdict == SDM_E_MESH)
        return sdm_fail(err, verdict, "%s: meshes are broken%s: mend what is marked 'broken' first",
                        name, reach(left));
    if (verdict == SDM_E_QUALITY)
        return sdm_fail(err, verdict,
                        "%s: maps or trainings would suffer%s: mend what is marked 'warning'", name,
                        reach(left));
    if (c->args->json) return SDM_OK;
    if (apart->shapes)
        printf("%zu of %zu shapes have groups of parts that meet no other part (the note above "
               "names one): if they are meant to be apart, the shape can be trained; else let them "
               "overlap%s\n",
               apart->shapes, c->survey.found.n - c->survey.found.untested,
               left->data ? left->data : "");
    else
        printf(
            "%s: the shape can be trained%s%s%s\n", left->data ? "fine as far as tested" : "fine",
            c->survey.grid ? "" : "; give a configuration to compare it with a grid",
            c->table ? "; read the table 'moves': does each parameter move the right parts?" : "",
            left->data ? left->data : "");
    return SDM_OK;
}

/* The verdict, or after an interrupt the word that it is not final. */
static sdm_status end(const check *c, sdm_error *err)
{
    sdm_text left = {0};
    add_left(c, &left);
    sdm_status s;
    if (left.failed)
        s = sdm_fail(err, SDM_E_NOMEM, "out of memory for the verdict");
    else if (c->survey.found.cancelled)
        s = sdm_fail(err, SDM_E_CANCELLED, "interrupted: these are the findings as far as tested%s",
                     left.data ? left.data : "");
    else
        s = give_verdict(c, &left, err);
    sdm_text_dispose(&left);
    return s;
}

sdm_status cli_shapes_check(const cli_args *args, sdm_error *err)
{
    check c = {.args = args};
    sdm_status s = SDM_OK;
    for (size_t i = 0; i < args->outputs.n && !s; i++)
        s = sdm_picture_check(args->outputs.items[i], err);
    if (s == SDM_E_UNSUPPORTED) s = SDM_E_ARG;
    if (!s) s = cli_check_files(args, NULL, err);
    if (!s) s = open_shape(&c, err);
    c.survey.shape = c.shape;
    c.opts.known = print_stage;
    c.opts.mend_first = true;
    if (!s) c.opts.process = cli_other_process(args, c.registry, c.shape);
    cli_progress_start(&c.bar);
    if (!s) s = sdm_shape_survey_make(c.shape, &c.opts, &c.survey.found, err);
    cli_progress_end(&c.bar, !s);
    cli_part_moves moves;
    if (!s) s = cli_part_moves_make(c.shape, c.opts.range, &moves, err);
    c.table = !s && moves.n_parts && !args->json;
    if (!s) {
        s = args->json ? print_json(&c, &moves, err) : print_rest(&c, &moves, err);
        for (size_t i = 0; i < args->outputs.n && !s; i++)
            s = draw(&c, args->outputs.items[i], err);
        if (!s) s = end(&c, err);
    }
    sdm_shape_survey_dispose(&c.survey.found);
    sdm_instance_free(c.shape);
    sdm_registry_free(c.registry);
    sdm_free(c.config);
    return s;
}
