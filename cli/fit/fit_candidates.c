/* fit --find: searches the whole image, fits the shape at the best places, and takes the best fit.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit_command.h"
#include "report/json_values.h"
#include "report/terminal.h"
#include "sdm/memory.h"

enum { CANDIDATES = 4 };

/* The part of the image that a fit at a place sees: a box about the place, half diagonals of the
 * shape's map wide. */
#define BOX_DIAGONALS 0.75

static double diagonal(const sdm_grid *g)
{
    double square = 0;
    for (int a = 0; a < 3; a++) square += pow((double)g->n[a] * g->spacing[a], 2);
    return sqrt(square);
}

/* *out = a target of its own: a copy of the voxels of f->target near a place; *values: its memory.
 */
static sdm_status crop(const cli_fit *f, const double place[3], sdm_fit_target *out, float **values,
                       sdm_error *err)
{
    const sdm_grid *g = &f->target.grid,
                   *map = f->model ? &sdm_model_get_info(f->model)->grid : &f->source.grid;
    const double half = BOX_DIAGONALS * diagonal(map) + 2 * f->opts.margin;
    double middle[3], first[3];
    int64_t from[3];
    sdm_grid_index(g, place, middle);
    *out = f->target;
    for (int a = 0; a < 3; a++) {
        const double voxels = ceil(half / g->spacing[a]), last = (double)g->n[a] - 1;
        from[a] = (int64_t)fmin(fmax(rint(middle[a]) - voxels, 0), last);
        const int64_t to = (int64_t)fmax(fmin(rint(middle[a]) + voxels, last), (double)from[a]);
        out->grid.n[a] = to - from[a] + 1;
        first[a] = (double)from[a];
    }
    sdm_grid_world(g, first, out->grid.origin);
    const int64_t *n = out->grid.n;
    const sdm_status s = SDM_ALLOC(values, sdm_grid_count(&out->grid), "part of the image", err);
    for (int64_t k = 0; k < n[2] && !s; k++)
        for (int64_t j = 0; j < n[1]; j++)
            memcpy(*values + (k * n[1] + j) * n[0],
                   f->target.values + ((k + from[2]) * g->n[1] + j + from[1]) * g->n[0] + from[0],
                   (size_t)n[0] * sizeof **values);
    out->values = *values;
    return s;
}

/* Fits the shape at one place. */
static sdm_status fit_candidate(cli_fit *f, const sdm_fit_candidate *start, cli_candidate *c,
                                sdm_error *err)
{
    const sdm_fit_target whole = f->target;
    sdm_fit_target part;
    float *values = NULL;
    sdm_status s = start->source == (size_t)f->other_side ? SDM_OK : cli_fit_swap_side(f, err);
    double centre[3];
    if (!s) s = sdm_fit_centre(&f->source, f->start, centre, err);
    if (s) return s;
    c->score = start->score;
    sdm_pose_apply(&start->pose, centre, c->place);
    f->opts.start_pose = start->pose;
    s = crop(f, c->place, &part, &values, err);
    if (!s) {
        f->target = part;
        s = cli_fit_run(f, err);
    }
    f->target = whole;
    sdm_free(values);
    c->result = f->result;
    c->doubt = f->doubt;
    c->better = f->better;
    c->other_side = f->other_side;
    memcpy(c->side, f->side, sizeof c->side);
    f->result = (sdm_fit_result){0};
    f->doubt = (sdm_error){0};
    return s;
}

/* Accepted fits first, then by evidence or, where there is none, by score. */
static int better(const void *a, const void *b)
{
    const cli_candidate *x = a, *y = b;
    if (!x->doubt.status != !y->doubt.status) return x->doubt.status ? 1 : -1;
    const double u = x->result.evidence, v = y->result.evidence;
    if (!isnan(u) && !isnan(v) && u != v) return u < v ? 1 : -1;
    return (x->score < y->score) - (x->score > y->score);
}

/* Makes the best candidate the result of the fit. */
static sdm_status take_best(cli_fit *f, sdm_error *err)
{
    qsort(f->candidates, f->n_candidates, sizeof *f->candidates, better);
    cli_candidate *c = &f->candidates[0];
    const sdm_status s = c->other_side == f->other_side ? SDM_OK : cli_fit_swap_side(f, err);
    if (s) return s;
    size_t accepted = 0;
    for (size_t i = 0; i < f->n_candidates; i++) accepted += !f->candidates[i].doubt.status;
    if (accepted > 1)
        cli_notice("%zu places show the shape: the result is the first of them; --region selects "
                   "another",
                   accepted);
    f->result = c->result;
    f->better = c->better;
    memcpy(f->side, c->side, sizeof f->side);
    f->doubt = c->doubt;
    if (f->doubt.status == SDM_E_QUALITY)
        (void)sdm_fail(&f->doubt, SDM_E_QUALITY, "none of %zu candidates is accepted; the best: %s",
                       f->n_candidates, c->doubt.text);
    return SDM_OK;
}

sdm_status cli_fit_find(cli_fit *f, sdm_error *err)
{
    const size_t most =
        f->args->fit.candidates ? (size_t)f->args->fit.candidates : (size_t)CANDIDATES;
    sdm_fit_candidate *starts = NULL;
    sdm_fit_source sides[2] = {f->source, f->source};
    const bool open = strcmp(f->args->fit.mirror, "no") != 0 && cli_fit_side_is_open(f);
    sdm_status s = SDM_OK;
    if (open) {
        s = cli_fit_swap_side(f, err);
        sides[1] = f->source;
        if (!s) s = cli_fit_swap_side(f, err);
    }
    if (!s) s = SDM_ALLOC(&starts, most, "candidates", err);
    if (!s) s = SDM_ALLOC(&f->candidates, most, "candidates", err);
    size_t n = 0;
    if (!s) s = sdm_fit_find(sides, open ? 2 : 1, &f->target, &f->opts, most, starts, &n, err);
    if (!s && !n)
        s = sdm_fail(err, SDM_E_QUALITY,
                     "no place in the image looks like the shape: check --inside, --outside and "
                     "the start parameters");
    f->n_candidates = s ? 0 : n;
    for (size_t i = 0; i < n && !s; i++) {
        f->candidate = i + 1;
        s = fit_candidate(f, &starts[i], &f->candidates[i], err);
        const sdm_error *d = &f->candidates[i].doubt;
        if (!s && d->status && d->status != SDM_E_QUALITY && d->status != SDM_E_ARG)
            s = sdm_fail(err, d->status, "%s", d->text);
    }
    f->candidate = 0;
    if (!s) s = take_best(f, err);
    sdm_free(starts);
    return s;
}

void cli_fit_print_candidates(const cli_fit *f)
{
    if (!f->n_candidates) return;
    printf("candidates: %zu places (LPS, mm), the best first\n", f->n_candidates);
    for (size_t i = 0; i < f->n_candidates; i++) {
        const cli_candidate *c = &f->candidates[i];
        printf("  %8.2f %8.2f %8.2f  score %.3f", c->place[0], c->place[1], c->place[2], c->score);
        if (*c->side) printf("  %s=%s", f->mirror, c->side);
        if (!isnan(c->result.evidence) && c->result.n_params)
            printf("  evidence %.4g", c->result.evidence);
        printf("  %s%s%s\n",
               c->doubt.status ? "FAILED" : cli_fit_grade_name(c->result.verdict.grade),
               c->doubt.status ? ": " : "", c->doubt.status ? c->doubt.text : "");
    }
}

void cli_fit_json_candidates(const cli_fit *f, sdm_json *j)
{
    if (!f->n_candidates) return;
    sdm_json_open(j, "candidates", '[');
    for (size_t i = 0; i < f->n_candidates; i++) {
        const cli_candidate *c = &f->candidates[i];
        const sdm_fit_result *r = &c->result;
        sdm_json_open(j, NULL, '{');
        sdm_json_reals(j, "place_mm", c->place, 3);
        sdm_json_real(j, "score", c->score);
        if (*c->side) sdm_json_text(j, f->mirror, c->side);
        sdm_json_bool(j, "trusted", !c->doubt.status);
        if (c->doubt.status) sdm_json_text(j, "doubt", c->doubt.text);
        sdm_json_text(j, "verdict",
                      cli_fit_grade_name(c->doubt.status ? SDM_FIT_FAILED : r->verdict.grade));
        if (r->params) {
            if (f->target.kind == SDM_FIT_IMAGE) sdm_json_real(j, "evidence", r->evidence);
            cli_json_params(j, "parameters", f->params, f->n_params, r->params);
            sdm_json_reals(j, "rotation_rad", r->pose.rotation, 3);
            sdm_json_reals(j, "translation_mm", r->pose.translation, 3);
        }
        sdm_json_close(j, '}');
    }
    sdm_json_close(j, ']');
}

/* The result of the first candidate belongs to f->result. */
void cli_fit_candidates_dispose(cli_fit *f)
{
    for (size_t i = 0; i < f->n_candidates; i++)
        if (f->candidates[i].result.params != f->result.params)
            sdm_fit_dispose(&f->candidates[i].result);
    sdm_free(f->candidates);
}
