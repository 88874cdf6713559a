/* Counts how often vertices turn back along one parameter. */
#include "survey_swing.h"

#include <math.h>
#include <string.h>

#include "sdm/internal/mesh_box.h"
#include "sdm/memory.h"

/* FOLLOWED: vertices, spread over the mesh. */
enum { STEPS_PER_TURN = 16, STEPS_MAX = 1024, FOLLOWED = 64 };
static const double TURN = 6.283185307179586;

/* A coordinate of a vertex. */
typedef struct path {
    double last;  /* its value */
    double way;   /* the way since it turned back last, mm, with its sign */
    double moved; /* the whole way, mm */
    size_t swings;
} path;

static bool is_candidate(const shape_family *f, size_t k)
{
    const char *unit = f->shape->params[k].unit;
    return strcmp(unit, "mm") != 0 && strcmp(unit, "sd") != 0 && f->max[k] - f->min[k] > 2 * TURN;
}

/* Moves the path on; ways below `small` are rounding errors. */
static void path_go(path *a, double to, double small)
{
    const double step = to - a->last;
    a->last = to;
    a->moved += fabs(step);
    if (step * a->way < 0 && fabs(step) > small) {
        a->swings++;
        a->way = 0;
    }
    if (fabs(step) > small) a->way += step;
}

static double size_of(const sdm_mesh *m)
{
    sdm_box b = SDM_BOX_EMPTY;
    double most = 0;
    sdm_box_add_mesh(&b, m);
    for (int d = 0; d < 3; d++) most = fmax(most, b.max[d] - b.min[d]);
    return most;
}

/* Index in vert[] of followed coordinate i of a mesh with n_vert vertices. */
static size_t coordinate(size_t i, size_t n_vert)
{
    const size_t n = n_vert < FOLLOWED ? n_vert : FOLLOWED;
    return 3 * (i / 3 % n * n_vert / n) + i % 3;
}

sdm_status sdm_survey_swings(const shape_family *f, const double *p, size_t k, size_t *swings,
                             sdm_error *err)
{
    path paths[3 * FOLLOWED] = {{0}};
    double at[SHAPE_PARAMS_MAX], size = 0;
    sdm_mesh m = {0};
    size_t n_vert = 0;
    sdm_status s = SDM_OK;
    *swings = 0;
    if (!is_candidate(f, k)) return SDM_OK;
    memcpy(at, p, f->shape->n_params * sizeof *p);
    const double width = f->max[k] - f->min[k], turns = width / TURN;
    const size_t steps = (size_t)fmin(STEPS_MAX, ceil(STEPS_PER_TURN * turns));
    bool same = true;
    for (size_t step = 0; step <= steps && !s && same; step++) {
        at[k] = step == steps ? f->max[k] : f->min[k] + width * (double)step / (double)steps;
        s = sdm_instance_mesh(f->shape, at, &m, err);
        same = !s && (!step || m.n_vert == n_vert);
        if (same && !step) {
            n_vert = m.n_vert;
            size = size_of(&m);
        }
        for (size_t i = 0; i < 3 * FOLLOWED && same; i++) {
            const double to = m.vert[coordinate(i, n_vert)];
            if (!step) paths[i].last = to;
            path_go(&paths[i], to, 1e-6 * size);
        }
    }
    for (size_t i = 0; i < 3 * FOLLOWED && same && !s; i++)
        if (paths[i].moved > 0.05 * size && paths[i].swings > *swings) *swings = paths[i].swings;
    if ((double)*swings < 1.5 * turns || (double)*swings > 3 * turns + 2) *swings = 0;
    sdm_mesh_dispose(&m);
    return s == SDM_E_NOMEM ? s : SDM_OK;
}
