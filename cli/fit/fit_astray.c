/* Whether a fit that is not trustworthy began away from its labels or points, or in another frame.
 */
#include <math.h>
#include <stdio.h>

#include "fit_command.h"
#include "measure/median.h"
#include "sdm/internal/fit_finding.h"
#include "sdm/internal/vec3.h"
#include "sdm/memory.h"

/* The start is far from the data beyond this multiple of their size, the median distance of the
 * points or voxels from their middle. */
#define FAR 1.5
/* The data are in another frame than the start, RAS instead of LPS, if the other signs of x and y
 * bring both so near to each other: the distance falls below this share of what it was. */
#define NEARER 0.5
/* Points are off the surface of the start shape where their distance from it exceeds this share of
 * their size. */
#define OFF 0.1
/* A start that turns about a place nearer to the z axis than this share of the size of the points
 * may be turned by half a turn. */
#define ON_AXIS 0.2
/* Points that are compared with the start shape; of more, every second, third ... one. */
#define POINTS_MAX 2000

/* Sorts the list and returns the value that this share of it does not exceed; 0: it is empty. */
static double quantile(double *list, size_t n, double share)
{
    cli_sort(list, n);
    return n ? list[(size_t)(share * (double)(n - 1))] : 0;
}

/* Points of the surface, or the middles of the voxels with the label. */
typedef struct cloud {
    double *x; /* [n][3] mm, LPS */
    size_t n;
    double middle[3], size; /* lower medians: of each coordinate; of the distances from there */
} cloud;

static sdm_status read_cloud(const cli_fit *f, cloud *c, sdm_error *err)
{
    const sdm_grid *g = &f->target.grid;
    const bool points = f->target.kind == SDM_FIT_POINTS;
    const size_t all = points ? f->target.n_points : sdm_grid_count(g);
    size_t used = 0, seen = 0;
    for (size_t v = 0; v < all; v++) used += points || f->mask[v] > 0;
    const size_t step = used / POINTS_MAX + 1;
    double *list = NULL;
    sdm_status s = SDM_ALLOC(&c->x, 3 * used, "points", err);
    if (!s) s = SDM_ALLOC(&list, used, "points", err);
    for (size_t v = 0; v < all && !s; v++) {
        if ((!points && !(f->mask[v] > 0)) || seen++ % step) continue;
        const size_t nx = points ? 1 : (size_t)g->n[0], ny = points ? 1 : (size_t)g->n[1];
        const double index[3] = {(double)(v % nx), (double)(v / nx % ny), (double)(v / nx / ny)};
        double *x = c->x + 3 * c->n++;
        if (!points) sdm_grid_world(g, index, x);
        for (size_t a = 0; a < 3 && points; a++) x[a] = f->target.points[3 * v + a];
    }
    for (size_t a = 0; a < 3 && !s; a++) {
        for (size_t i = 0; i < c->n; i++) list[i] = c->x[3 * i + a];
        c->middle[a] = quantile(list, c->n, 0.5);
    }
    for (size_t i = 0; i < c->n && !s; i++) list[i] = sqrt(v3_dist2(c->x + 3 * i, c->middle));
    if (!s) c->size = quantile(list, c->n, 0.5);
    sdm_free(list);
    return s;
}

/* Distance (mm) of the point y of the shape's frame from the surface, by the nearest voxel of its
 * map on g; beyond the grid the way to its border counts, too. */
static double surface_distance(const sdm_grid *g, const float *map, const double y[3])
{
    double index[3], at[3];
    sdm_grid_index(g, y, index);
    for (int a = 0; a < 3; a++) index[a] = fmin(fmax(round(index[a]), 0), (double)g->n[a] - 1);
    sdm_grid_world(g, index, at);
    const double beyond = sqrt(v3_dist2(y, at)),
                 d = fabs((double)map[sdm_grid_voxel(g, (int64_t)index[0], (int64_t)index[1],
                                                     (int64_t)index[2])]);
    return beyond > g->spacing[0] + g->spacing[1] + g->spacing[2] ? d + beyond : d;
}

/* off[2] = the upper quartile of the distances of the points from the surface of the start shape,
 * as they are and with x and y of the other sign. Where the fit began at their middle, it would
 * begin at the other one. */
static sdm_status start_distances(const cli_fit *f, const cloud *c, bool at_middle, double off[2],
                                  sdm_error *err)
{
    const sdm_grid *g =
        f->source.model ? &sdm_model_get_info(f->source.model)->grid : &f->source.grid;
    const sdm_pose own = {{0, 0, 0}, {0, 0, 0}};
    float *map = NULL;
    double *list = NULL;
    sdm_status s = SDM_ALLOC(&map, sdm_grid_count(g), "distance map", err);
    if (!s) s = SDM_ALLOC(&list, c->n, "points", err);
    if (!s) s = sdm_fit_map(&f->source, f->start, &own, g, f->opts.n_threads, map, err);
    for (int negated = 0; negated < 2 && !s; negated++) {
        for (size_t i = 0; i < c->n; i++) {
            double x[3], y[3];
            for (size_t a = 0; a < 3; a++) {
                const double sign = negated && a < 2 ? -1 : 1;
                x[a] = sign * c->x[3 * i + a];
                if (at_middle) x[a] -= (sign - 1) * c->middle[a];
            }
            sdm_pose_apply_inverse(&f->opts.start_pose, x, y);
            list[i] = surface_distance(g, map, y);
        }
        off[negated] = quantile(list, c->n, 0.75);
    }
    sdm_free(map);
    sdm_free(list);
    return s;
}

/* 1 + 2 cos(angle) of the turn from one rotation to the other. */
static double likeness_of_turns(const sdm_pose *a, const sdm_pose *b)
{
    double x[9], y[9], trace = 0;
    sdm_pose_matrix(a, x);
    sdm_pose_matrix(b, y);
    for (int i = 0; i < 9; i++) trace += x[i] * y[i];
    return trace;
}

/* Whether the fit found has made half a turn about z by itself, so that its place is the other one.
 */
static bool has_turned(const cli_fit *f)
{
    const sdm_pose half = {{0, 0, acos(-1)}, {0, 0, 0}},
                   other = sdm_pose_compose(&half, &f->opts.start_pose);
    return f->found && likeness_of_turns(&f->result.pose, &other) >
                           likeness_of_turns(&f->result.pose, &f->opts.start_pose);
}

/* Whether a fit to turned points explains them better than the fit found explains the points.
 * Points that are too far from a fit are not among those that it uses. */
static bool explains_more(const cli_fit *f, const sdm_fit_result *turned)
{
    const sdm_fit_result *r = &f->result;
    if (!f->found || turned->n_used > r->n_used) return true;
    return turned->n_used == r->n_used &&
           turned->log_likelihood >
               r->log_likelihood + SDM_FIT_PREFERRED * fmax(r->noise_factor, 1);
}

/* text[size] = how well both explain the points; empty: no fit was found. */
static void tell_both(const cli_fit *f, const sdm_fit_result *turned, char *text, size_t size)
{
    const sdm_fit_result *r = &f->result;
    if (f->found && turned->point_sd < r->point_sd)
        snprintf(text, size, " (they scatter by %.3g mm about it, not by %.3g mm)",
                 turned->point_sd, r->point_sd);
    else if (f->found)
        snprintf(text, size, " (log-likelihood %.4g, not %.4g)", turned->log_likelihood,
                 r->log_likelihood);
}

/* *passes = the fit from the same start lies on the points with half a turn of them about it, which
 * changes the signs of x and y, and explains them better than the fit found. text[size]: both. */
static sdm_status fit_turned(const cli_fit *f, const double start[3], bool *passes, char *text,
                             size_t size, sdm_error *err)
{
    const size_t n = f->target.n_points;
    sdm_fit_target turned = f->target;
    sdm_fit_opts opts = f->opts;
    sdm_fit_result r = {0};
    double *x = NULL;
    opts.progress = NULL;
    sdm_status s = SDM_ALLOC(&x, 3 * n, "points", err);
    for (size_t i = 0; i < 3 * n && !s; i++)
        x[i] = i % 3 < 2 ? 2 * start[i % 3] - f->target.points[i] : f->target.points[i];
    turned.points = x;
    if (!s) s = sdm_fit(&f->source, &turned, &opts, &r, err);
    const sdm_fit_finding *residuals = sdm_fit_finding_of(&r.verdict, SDM_FIT_CHECK_RESIDUALS);
    *passes = !s && !(residuals && residuals->grade != SDM_FIT_PASSED) && explains_more(f, &r);
    if (*passes) tell_both(f, &r, text, size);
    sdm_fit_dispose(&r);
    sdm_free(x);
    return s == SDM_E_NOMEM || s == SDM_E_CANCELLED ? s : SDM_OK;
}

/* text[size] = what to do about points that half a turn about z takes to the shape. To change the
 * signs of x and y is to turn by half a turn: where `either`, the start may be turned as well. */
static void advise_frame(const cli_fit *f, bool either, char *text, size_t size)
{
    const bool ras = f->args->fit.ras;
    const sdm_pose half = {{0, 0, acos(-1)}, {0, 0, 0}};
    char mend[120];
    if (!either) {
        snprintf(text, size, "%s",
                 ras ? "are they LPS? Leave --ras out" : "are they RAS? --ras converts them");
        return;
    }
    const sdm_pose other = sdm_pose_compose(&half, &f->opts.start_pose);
    double r[3]; // rounded, and no negative zero
    for (int a = 0; a < 3; a++) r[a] = round(1e4 * other.rotation[a]) / 1e4 + 0;
    if (f->args->fit.start_points)
        snprintf(mend, sizeof mend, "check the pairs of --start-points");
    else
        snprintf(mend, sizeof mend, "%s--rotation %.4g,%.4g,%.4g turns it back",
                 isnan(f->args->pose.translation[0]) ? "leave --rotation out, or " : "", r[0], r[1],
                 r[2]);
    snprintf(text, size,
             "either the start is turned by half a turn about z (%s), or the points are %s (%s)",
             mend, ras ? "LPS" : "RAS", ras ? "leave --ras out" : "--ras converts them");
}

/* Points without a search over rotations: half a turn about z, from RAS to LPS or of the start, may
 * be missing. The start shape shows it where its parameters are about right; else, or where the fit
 * found has turned by itself, a second fit does. --ras does not change a start that --translation
 * or --start-points gives. */
static sdm_status check_frame(const cli_fit *f, const cloud *c, const double start[3], bool placed,
                              char *text, size_t size, sdm_error *err)
{
    double off[2];
    bool passes = false;
    char advice[400], both[100] = "";
    if (f->target.kind != SDM_FIT_POINTS || f->opts.turns != SDM_FIT_TURNS_NONE) return SDM_OK;
    sdm_status s = start_distances(f, c, !placed, off, err);
    const bool shown = !s && off[0] > OFF * c->size && off[1] < NEARER * off[0] && !has_turned(f);
    if (!s && !shown && f->doubt.status == SDM_E_QUALITY && isnan(f->args->pose.translation[0]) &&
        !f->args->fit.start_points)
        s = fit_turned(f, start, &passes, both, sizeof both, err);
    if (!shown && !passes) return s;
    // a start that turns about a given place, away from the z axis, is right where it is
    const double *at = isnan(f->args->pose.translation[0]) ? start : f->opts.start_pose.translation;
    advise_frame(f, !placed || passes || hypot(at[0], at[1]) < ON_AXIS * c->size, advice,
                 sizeof advice);
    if (passes)
        snprintf(text, size, "; with x and y of the other sign the fit lies on the points%s: %s",
                 both, advice);
    else
        snprintf(text, size,
                 "; with x and y of the other sign most points lie within %.2g mm of the shape at "
                 "the start, not %.2g mm: %s",
                 off[1], off[0], advice);
    return s;
}

sdm_status cli_fit_astray(const cli_fit *f, char *text, size_t size, sdm_error *err)
{
    const cli_fit_args *a = &f->args->fit;
    const bool placed =
        !isnan(a->start_centre[0]) || !isnan(f->args->pose.translation[0]) || a->start_points;
    const char *kind = cli_fit_kind(f);
    cloud c = {0};
    double start[3];
    *text = '\0';
    if (f->target.kind == SDM_FIT_IMAGE || a->find || f->opts.keep_pose) return SDM_OK;
    sdm_status s = read_cloud(f, &c, err);
    sdm_pose_apply(&f->opts.start_pose, f->pivot, start);
    const double negated[3] = {-start[0], -start[1], start[2]},
                 off = s ? 0 : sqrt(v3_dist2(start, c.middle));
    if (!s && placed && off > FAR * c.size && sqrt(v3_dist2(negated, c.middle)) < NEARER * off)
        snprintf(text, size,
                 "; the fit began %.3g mm from the middle of the %s; with x and y of the other "
                 "sign the start is near it: one of both is RAS, the other LPS%s",
                 off, kind,
                 f->points                   ? ""
                 : a->ras                    ? ": leave --ras out"
                 : isnan(a->start_centre[0]) ? ""
                                             : ": --ras converts --start-centre");
    else if (!s && placed && off > FAR * c.size)
        snprintf(text, size,
                 "; the fit began %.3g mm from the middle of the %s, which is at %.4g, %.4g, %.4g "
                 "mm (LPS): without %s it begins there",
                 off, kind, c.middle[0], c.middle[1], c.middle[2],
                 a->start_points             ? "--start-points"
                 : isnan(a->start_centre[0]) ? "--translation"
                                             : "--start-centre");
    else if (!s)
        s = check_frame(f, &c, start, placed, text, size, err);
    sdm_free(c.x);
    return s;
}
