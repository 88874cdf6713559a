/* Finds where a part of a shape turns inside out, by meshes between a shape in which it is right
 * and one in which it is not. */
#include "part_turns.h"

#include <math.h>
#include <string.h>

#include "report/report_audit.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/config.h"

/* Shapes that are looked through for one in which the part is right; halvings of a range; steps to
 * the end of a range. */
enum { TRIED = 64, HALVINGS = 16, STEPS = 32 };

/* A volume that goes through 0 is smaller than this share of itself after the halvings. */
#define SMALL 0.01

/* Where parameter `only` goes from that of the shape in which the part is inside out: to that of
 * another shape, and to the ends of the surveyed range. */
enum { GOALS = 3 };

/* The shapes on the line from one in which the part is inside out (at 0) to another one (at 1). */
typedef struct line {
    const sdm_instance *shape;
    size_t n_params, n_parts, part;
    const double *wrong, *right; /* [n_params] */
    size_t only; /* the parameter that changes along the line; n_params: all of them */
    double end;  /* time of the clock, s: what is not needed is left out then */
} line;

/* The volume of the part at `at`, and the mesh in *mesh, which the caller disposes of. NaN: the
 * mesh has not as many parts, or there is none. */
static double measure(const line *l, double at, sdm_mesh *mesh)
{
    const sdm_param *params = sdm_instance_params(l->shape, NULL);
    double p[SDM_MAX_PARAMS], volume = NAN;
    sdm_part_audit audit = {0};
    for (size_t k = 0; k < l->n_params; k++) {
        const bool moves = l->only == l->n_params || l->only == k;
        p[k] = l->wrong[k] + (moves ? at * (l->right[k] - l->wrong[k]) : 0);
        // rounding may lead beyond
        p[k] = fmin(fmax(p[k], params[k].min), params[k].max);
    }
    if (!sdm_instance_mesh(l->shape, p, mesh, NULL) &&
        !sdm_part_audit_make(mesh, 0, NULL, &audit, NULL) && audit.n == l->n_parts)
        volume = audit.part[l->part].volume;
    sdm_part_audit_dispose(&audit);
    return volume;
}

static bool is_right(const line *l, double at)
{
    sdm_mesh mesh = {0};
    const double volume = measure(l, at, &mesh);
    sdm_mesh_dispose(&mesh);
    return volume > 0;
}

/* Narrows down where the part turns over, between a place where it is not right and one where it
 * is. */
static void halve(const line *l, double *bad, double *good)
{
    for (int i = 0; i < HALVINGS; i++) {
        const double middle = 0.5 * (*bad + *good);
        *(is_right(l, middle) ? good : bad) = middle;
    }
}

/* A part without thickness may be none. */
static double volume_or_0(double volume) { return isnan(volume) ? 0 : fabs(volume); }

/* Why the part turns over between two places that lie close together. */
static cli_turn_cause find_cause(const line *l, double bad, double good)
{
    sdm_mesh here = {0}, there = {0}, whole = {0};
    const double a = volume_or_0(measure(l, bad, &here)), b = volume_or_0(measure(l, good, &there)),
                 all = fabs(measure(l, 0, &whole));
    const bool same = here.tri && there.tri && here.n_tri == there.n_tri &&
                      !memcmp(here.tri, there.tri, 3 * here.n_tri * sizeof *here.tri);
    sdm_mesh_dispose(&here);
    sdm_mesh_dispose(&there);
    sdm_mesh_dispose(&whole);
    if (a + b <= SMALL * all) return CLI_TURN_LENGTH;
    return same ? CLI_TURN_VERTICES : CLI_TURN_ORDER;
}

/* The surveyed range of parameter k. */
static void find_range(const sdm_shape_survey *f, size_t k, double range[2])
{
    range[0] = range[1] = f->p[k];
    for (size_t i = 1; i < f->n; i++) {
        range[0] = fmin(range[0], f->p[i * f->n_params + k]);
        range[1] = fmax(range[1], f->p[i * f->n_params + k]);
    }
}

/* The value of the parameter at which the part turns back beyond `bad`, away from the other end of
 * the line; NaN: none was found up to the end of the surveyed range. */
static double find_back(const line *l, const sdm_shape_survey *f, double bad)
{
    const double from = l->wrong[l->only], across = l->right[l->only] - from;
    double range[2], before = bad;
    find_range(f, l->only, range);
    const double end = (range[across < 0] - from) / across;
    for (int i = 1; i <= STEPS; i++) {
        double at = bad + (end - bad) * i / STEPS;
        if (is_right(l, at)) {
            halve(l, &before, &at);
            return from + 0.5 * (before + at) * across;
        }
        before = at;
    }
    return NAN;
}

/* Adds parameter l->only to *out if it turns the part back by itself. */
static void find_turn(const line *l, const sdm_shape_survey *f, cli_part_turn *out)
{
    const size_t k = l->only;
    const double from = l->wrong[k];
    double range[2], goal[SDM_MAX_PARAMS];
    find_range(f, k, range);
    const double to[GOALS] = {l->right[k], range[0], range[1]};
    memcpy(goal, l->wrong, l->n_params * sizeof *goal);
    line one = *l;
    one.right = goal;
    for (int i = 0; i < GOALS; i++) {
        goal[k] = to[i];
        if (goal[k] == from || !is_right(&one, 1)) continue;
        double bad = 0, good = 1;
        halve(&one, &bad, &good);
        if (!out->n) out->cause = find_cause(&one, bad, good);
        out->by[out->n++] = (cli_turn_param){.param = k,
                                             .value = from + 0.5 * (bad + good) * (to[i] - from),
                                             .above = to[i] < from,
                                             .back = find_back(&one, f, bad),
                                             .safe = NAN};
        return;
    }
}

/* The volume of the part where parameter k of p[] has the value, and the others are as they are. */
static double volume_at(const line *l, double *p, size_t k, double value)
{
    const double keep = p[k];
    sdm_mesh mesh = {0};
    line one = *l;
    one.wrong = p;
    p[k] = value;
    const double volume = measure(&one, 0, &mesh);
    sdm_mesh_dispose(&mesh);
    p[k] = keep;
    return volume;
}

/* Moves worst[], the shape in which the part is inside out, to the ends of the ranges at which it
 * is farthest from being right. false: the part turns back somewhere, or it takes too long. */
static bool find_worst(const line *l, const sdm_shape_survey *f, const cli_part_turn *turn,
                       double worst[SDM_MAX_PARAMS])
{
    bool turns[SDM_MAX_PARAMS] = {false};
    double range[2];
    for (size_t i = 0; i < turn->n; i++) {
        if (isfinite(turn->by[i].back)) return false;
        find_range(f, turn->by[i].param, range);
        worst[turn->by[i].param] = range[turn->by[i].above];
        turns[turn->by[i].param] = true;
    }
    for (size_t k = 0; k < l->n_params; k++) {
        if (sdm_clock() > l->end) return false;
        if (turns[k]) continue;
        find_range(f, k, range);
        double least = volume_at(l, worst, k, worst[k]);
        for (int end = 0; end < 2; end++) {
            const double volume = volume_at(l, worst, k, range[end]);
            if (!(volume < least)) continue;
            least = volume;
            worst[k] = range[end];
        }
    }
    return true;
}

/* Finds out->by[i].safe of all, from the worst corner of the ranges. */
static void find_safe(const line *l, const sdm_shape_survey *f, cli_part_turn *out)
{
    double worst[SDM_MAX_PARAMS], goal[SDM_MAX_PARAMS];
    memcpy(worst, l->wrong, l->n_params * sizeof *worst);
    if (!find_worst(l, f, out, worst)) return;
    memcpy(goal, worst, l->n_params * sizeof *goal);
    for (size_t i = 0; i < out->n; i++) {
        cli_turn_param *by = &out->by[i];
        double range[2], bad = 0, good = 1;
        line one = *l;
        find_range(f, by->param, range);
        one.only = by->param;
        one.wrong = worst;
        one.right = goal;
        goal[by->param] = range[!by->above];
        if (is_right(&one, 1) && !is_right(&one, 0)) {
            halve(&one, &bad, &good);
            by->safe = worst[by->param] + good * (goal[by->param] - worst[by->param]);
        }
        goal[by->param] = worst[by->param];
    }
}

bool cli_find_part_turn(const sdm_instance *shape, const sdm_shape_survey *found, size_t wrong,
                        const sdm_part_audit *audit, double end, cli_part_turn *out)
{
    const size_t n = found->n_params, most = found->n < TRIED ? found->n : TRIED;
    *out = (cli_part_turn){0};
    while (out->part < audit->n && !cli_part_inside_out(audit, out->part)) out->part++;
    if (out->part == audit->n || n > SDM_MAX_PARAMS) return false;
    line l = {shape, n, audit->n, out->part, found->p + wrong * n, found->p, n, end};
    while (out->right < most && !is_right(&l, 1)) l.right = found->p + ++out->right * n;
    if (out->right == most) return false;
    for (l.only = 0; l.only < n && out->n < sizeof out->by / sizeof *out->by; l.only++) {
        if (out->n && sdm_clock() > end) break;
        find_turn(&l, found, out);
    }
    if (out->n && out->cause == CLI_TURN_LENGTH) find_safe(&l, found, out);
    if (out->n) return true;
    double bad = 0, good = 1;
    l.only = n;
    halve(&l, &bad, &good);
    out->cause = find_cause(&l, bad, good);
    return true;
}
