/* Counts how often vertices turn back along one parameter, looks whether they come back to the same
 * place after each step of 2 pi / 57.3, as cos() and sin() do of an angle that mesh() converts from
 * rad to degrees, and measures by how much a degree turns the surface. */
#include "survey_swing.h"

#include <math.h>
#include <string.h>

#include "sdm/internal/mesh_box.h"
#include "sdm/internal/mesh_turn.h"
#include "sdm/internal/shape_survey.h"
#include "sdm/internal/vec3.h"
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

/* SPIN_STEPS: in a period; SPIN_ALL: in the one and a half that are looked at. */
enum { SPIN_STEPS = 16, SPIN_ALL = 24 };

/* A vertex has returned if it is no farther from its first place than this share of the length of
 * its way. With a factor of 57.2 or 57.4 in place of 57.296 it is farther. */
static const double BACK = 0.005;
/* Vertices count that move by this share of the size of the shape. */
static const double FAR = 0.01;
static const double SPINNING = 0.25;

/* The vertices that are followed, and where they are at each step. */
typedef struct spin {
    size_t vertex[FOLLOWED], n;
    double x[SPIN_ALL + 1][FOLLOWED][3];
} spin;

static double distance(const double a[3], const double b[3]) { return sqrt(v3_dist2(a, b)); }

/* Makes the mesh where parameter k is `periods` above its lowest value. *same: it has n_vert
 * vertices. SDM_E_NOMEM. */
static sdm_status mesh_after(const shape_family *f, double *p, size_t k, double periods,
                             size_t n_vert, sdm_mesh *m, bool *same, sdm_error *err)
{
    p[k] = f->min[k] + periods * SDM_SURVEY_SPIN;
    const sdm_status s = sdm_instance_mesh(f->shape, p, m, err);
    *same = !s && m->n_vert == n_vert;
    return s == SDM_E_NOMEM ? s : SDM_OK;
}

/* Chooses vertices that move and are back after a period, if these are a share SPINNING of those
 * that move: of a twisted bar some vertices come back after any change of the twist. m: meshes at
 * 0, 1/3 and 1 period. */
static void choose_spinning(const sdm_mesh m[3], double size, spin *out)
{
    size_t moved = 0, back = 0;
    for (size_t v = 0; v < m[0].n_vert; v++) {
        const double *x = m[0].vert + 3 * v, way = distance(m[1].vert + 3 * v, x);
        if (!(way > FAR * size)) continue;
        moved++;
        if (!(distance(m[2].vert + 3 * v, x) <= BACK * way)) continue;
        back++;
        if (out->n < FOLLOWED) out->vertex[out->n++] = v;
    }
    if ((double)back < SPINNING * (double)moved) out->n = 0;
}

/* Does followed vertex i move without jumps, and is it in the same place after every period? */
static bool is_spinning(const spin *s, size_t i, double size)
{
    double span = 0, step = 0, miss = 0;
    for (int k = 0; k <= SPIN_ALL; k++) {
        span = fmax(span, distance(s->x[k][i], s->x[0][i]));
        if (k) step = fmax(step, distance(s->x[k][i], s->x[k - 1][i]));
        if (k >= SPIN_STEPS) miss = fmax(miss, distance(s->x[k][i], s->x[k - SPIN_STEPS][i]));
    }
    return span > FAR * size && step < 0.5 * span && miss <= BACK * span;
}

static sdm_status follow_spins(const shape_family *f, double *p, size_t k, size_t n_vert,
                               double size, spin *spins, bool *found, size_t *vertex,
                               sdm_error *err)
{
    sdm_mesh m = {0};
    sdm_status s = SDM_OK;
    bool same = true;
    for (int step = 0; step <= SPIN_ALL && !s && same; step++) {
        s = mesh_after(f, p, k, (double)step / SPIN_STEPS, n_vert, &m, &same, err);
        for (size_t i = 0; i < spins->n && !s && same; i++)
            memcpy(spins->x[step][i], m.vert + 3 * spins->vertex[i], sizeof spins->x[step][i]);
    }
    for (size_t i = spins->n; i-- > 0 && !s && same;)
        if (is_spinning(spins, i, size)) *found = true, *vertex = spins->vertex[i];
    sdm_mesh_dispose(&m);
    return s;
}

sdm_status sdm_survey_spins(const shape_family *f, const double *p, size_t k, bool *found,
                            size_t *vertex, sdm_error *err)
{
    static const double AT[3] = {0, 1.0 / 3, 1};
    double at[SHAPE_PARAMS_MAX];
    sdm_mesh m[3] = {{0}};
    spin spins = {.n = 0};
    sdm_status s = SDM_OK;
    bool same = true;
    *found = false;
    if (strcmp(f->shape->params[k].unit, "rad") != 0 ||
        f->max[k] - f->min[k] < (double)SPIN_ALL / SPIN_STEPS * SDM_SURVEY_SPIN)
        return SDM_OK;
    memcpy(at, p, f->shape->n_params * sizeof *p);
    for (int i = 0; i < 3 && !s && same; i++) {
        s = mesh_after(f, at, k, AT[i], m[0].n_vert, &m[i], &same, err);
        same = !s && m[i].n_vert && m[i].n_vert == m[0].n_vert;
    }
    const double size = same ? size_of(&m[0]) : 0;
    if (same) choose_spinning(m, size, &spins);
    if (!s && spins.n) s = follow_spins(f, at, k, m[0].n_vert, size, &spins, found, vertex, err);
    for (int i = 0; i < 3; i++) sdm_mesh_dispose(&m[i]);
    return s;
}

/* Does parameter k turn a quarter of the turning surface by so many degrees per unit, beside two
 * values? m[2]: scratch. */
static sdm_status turns_by(const shape_family *f, double *p, size_t k, double degrees,
                           sdm_mesh m[2], bool *found, size_t *vertex, sdm_error *err)
{
    static const double AT[2] = {0.3, 0.7};
    const double width = f->max[k] - f->min[k], step = fmin(0.01 * width, 1);
    const double angle = degrees * step / SDM_SURVEY_DEGREES;
    sdm_status s = SDM_OK;
    *found = true;
    for (int i = 0; i < 2 && *found && !s; i++) {
        for (int side = 0; side < 2 && !s; side++) {
            p[k] = f->min[k] + AT[i] * width + side * step;
            s = sdm_instance_mesh(f->shape, p, &m[side], err);
        }
        *found = !s && sdm_mesh_turned(&m[0], &m[1], angle, vertex) >= SPINNING;
    }
    return s == SDM_E_NOMEM ? s : SDM_OK;
}

sdm_status sdm_survey_turns(const shape_family *f, const double *p, size_t k, double *degrees,
                            size_t *vertex, sdm_error *err)
{
    static const double SHARES[] = {1, 0.5, 2};
    double at[SHAPE_PARAMS_MAX];
    sdm_mesh m[2] = {{0}};
    sdm_status s = SDM_OK;
    *degrees = 0;
    memcpy(at, p, f->shape->n_params * sizeof *p);
    for (size_t i = 0; i < 6 && !(*degrees > 0) && !s; i++) {
        const double factor = i < 3 ? SDM_SURVEY_DEGREES : 1 / SDM_SURVEY_DEGREES;
        bool found;
        s = turns_by(f, at, k, factor * SHARES[i % 3], m, &found, vertex, err);
        if (found && !s) *degrees = factor * SHARES[i % 3];
    }
    for (int i = 0; i < 2; i++) sdm_mesh_dispose(&m[i]);
    return s;
}
