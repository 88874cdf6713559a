/* Looks for poles along one parameter: peaks of the motion of the vertices that grow the nearer one
 * looks. */
#include "survey_pole.h"

#include <math.h>
#include <string.h>

/* STEPS_PER_TURN: eight from a pole of tan() to the next. PEAKS: some of those that are looked at
 * may be none. */
enum { STEPS_PER_TURN = 16, STEPS_MAX = 1024, PEAKS = 4, CUTS = 32 };
static const double QUARTER = 1.5707963267948966;
/* A vertex that moves so many times the size of the shape is at a pole. */
static const double FAR = 1000;

typedef struct walk {
    const shape_family *family;
    size_t param;
    double p[SHAPE_PARAMS_MAX];
    sdm_mesh first, mesh; /* first: at the lowest value */
} walk;

static double size_of(const sdm_mesh *m)
{
    double low[3], high[3], most = 0;
    for (size_t i = 0; i < 3 * m->n_vert; i++) {
        low[i % 3] = i < 3 ? m->vert[i] : fmin(low[i % 3], m->vert[i]);
        high[i % 3] = i < 3 ? m->vert[i] : fmax(high[i % 3], m->vert[i]);
    }
    for (int d = 0; d < 3 && m->n_vert; d++) most = fmax(most, high[d] - low[d]);
    return most;
}

/* *moved = the largest change of a coordinate from the first mesh to the one at `value`; NaN: not
 * known. */
static sdm_status look_at(walk *w, double value, double *moved, sdm_error *err)
{
    *moved = NAN;
    w->p[w->param] = value;
    const sdm_status s = sdm_instance_mesh(w->family->shape, w->p, &w->mesh, err);
    if (s || w->mesh.n_vert != w->first.n_vert) return s == SDM_E_NOMEM ? s : SDM_OK;
    *moved = 0;
    for (size_t i = 0; i < 3 * w->mesh.n_vert; i++)
        *moved = fmax(*moved, fabs(w->mesh.vert[i] - w->first.vert[i]));
    return SDM_OK;
}

/* Narrows low .. high around the peak between them by the golden section. *at = its place; NaN: it
 * does not reach `far`. */
static sdm_status climb(walk *w, double low, double high, double far, double *at, sdm_error *err)
{
    static const double GOLDEN = 0.6180339887498949;
    double x[2] = {high - GOLDEN * (high - low), low + GOLDEN * (high - low)}, moved[2];
    *at = NAN;
    sdm_status s = look_at(w, x[0], &moved[0], err);
    if (!s) s = look_at(w, x[1], &moved[1], err);
    for (int i = 0; i < CUTS && !s; i++) {
        const int to = moved[1] > moved[0]; // the end to which the peak is nearer
        *(to ? &low : &high) = x[!to];
        x[!to] = x[to];
        moved[!to] = moved[to];
        x[to] = to ? low + GOLDEN * (high - low) : high - GOLDEN * (high - low);
        s = look_at(w, x[to], &moved[to], err);
    }
    if (!s && fmax(moved[0], moved[1]) > far) *at = 0.5 * (low + high);
    return s;
}

/* Walks over the range and looks at the first peaks. */
static sdm_status find_poles(walk *w, double min, double max, double pole[2], size_t *n,
                             sdm_error *err)
{
    const size_t steps =
        (size_t)fmin(STEPS_MAX, ceil(STEPS_PER_TURN * (max - min) / (4 * QUARTER)));
    const double step = (max - min) / (double)steps, far = FAR * size_of(&w->first);
    double moved[3] = {0, 0, 0};
    sdm_status s = SDM_OK;
    for (size_t i = 1, peaks = 0; i <= steps && peaks < PEAKS && *n < 2 && !s; i++) {
        moved[0] = moved[1];
        moved[1] = moved[2];
        s = look_at(w, fmin(min + step * (double)i, max), &moved[2], err);
        if (isnan(moved[2])) break;
        if (i < 2 || !(moved[1] >= moved[0] && moved[1] > moved[2])) continue;
        double at;
        if (!s) s = climb(w, min + step * (double)(i - 2), min + step * (double)i, far, &at, err);
        if (!s && isfinite(at)) pole[(*n)++] = at;
        peaks++;
    }
    return s;
}

sdm_status sdm_survey_poles(const shape_family *f, const double *p, size_t k, double pole[2],
                            size_t *n, sdm_error *err)
{
    const char *unit = f->shape->params[k].unit;
    const double min = f->min[k], max = f->max[k];
    walk w = {.family = f, .param = k};
    *n = 0;
    if (!strcmp(unit, "mm") || !strcmp(unit, "sd") || !(max - min > 2 * QUARTER)) return SDM_OK;
    memcpy(w.p, p, f->shape->n_params * sizeof *p);
    w.p[k] = min;
    sdm_status s = sdm_instance_mesh(f->shape, w.p, &w.first, err);
    if (!s) s = find_poles(&w, min, max, pole, n, err);
    const double apart = *n == 2 ? (pole[1] - pole[0]) / QUARTER : 0;
    if (!(apart > 0.5 && fabs(apart - nearbyint(apart)) < 1e-3))
        *n = 0;
    else
        *n += (size_t)((max - pole[1]) / (pole[1] - pole[0]));
    sdm_mesh_dispose(&w.first);
    sdm_mesh_dispose(&w.mesh);
    return s == SDM_E_NOMEM ? s : SDM_OK;
}
