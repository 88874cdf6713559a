/* Follows one parameter of a shape over its range and finds where the mesh jumps. */
#include "survey_line.h"

#include <math.h>
#include <string.h>

enum { STEPS = 32, HALVINGS = 20 };

/* Lies beyond what is left of two steps after the halvings, as a share of the range. */
#define BESIDE 1e-7

/* Four meshes: three neighbours on the line, and a place for a further one. */
typedef struct line {
    const shape_family *family;
    size_t param;
    double p[SHAPE_PARAMS_MAX];
    sdm_mesh mesh[4];
} line;

static double line_value(const line *l, int step)
{
    const double min = l->family->min[l->param], max = l->family->max[l->param];
    return step == STEPS ? max : min + (max - min) * step / STEPS;
}

static sdm_status line_mesh(line *l, double value, sdm_mesh *out, sdm_error *err)
{
    l->p[l->param] = value;
    return sdm_instance_mesh(l->family->shape, l->p, out, err);
}

static sdm_survey_break compare(const sdm_mesh *a, const sdm_mesh *b)
{
    if (a->n_vert != b->n_vert || a->n_tri != b->n_tri) return SDM_BREAK_SIZES;
    return memcmp(a->tri, b->tri, 3 * a->n_tri * sizeof *a->tri) ? SDM_BREAK_TRIANGLES
                                                                 : SDM_BREAK_NONE;
}

/* Largest second difference a - 2 b + c of a vertex, mm. */
static double second_difference(const sdm_mesh *a, const sdm_mesh *b, const sdm_mesh *c,
                                size_t *vertex)
{
    double most = 0;
    for (size_t v = 0; v < a->n_vert; v++) {
        double sum = 0;
        for (size_t i = 3 * v; i < 3 * v + 3; i++) {
            const double d = a->vert[i] - 2 * b->vert[i] + c->vert[i];
            sum += d * d;
        }
        if (sum > most) {
            most = sum;
            *vertex = v;
        }
    }
    return sqrt(most);
}

static double moved(const double a[3], const double b[3])
{
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
                (a[2] - b[2]) * (a[2] - b[2]));
}

static void swap(sdm_mesh *a, sdm_mesh *b)
{
    const sdm_mesh keep = *a;
    *a = *b;
    *b = keep;
}

/* Halves the interval from `low` (mesh a) to `high` (mesh b), between which sizes or triangles
 * differ. */
static sdm_status find_change(line *l, double low, double high, sdm_mesh *a, sdm_mesh *b,
                              sdm_survey_jump *out, sdm_error *err)
{
    for (int i = 0; i < HALVINGS; i++) {
        const double middle = 0.5 * (low + high);
        const sdm_status s = line_mesh(l, middle, &l->mesh[3], err);
        if (s) return s;
        if (compare(a, &l->mesh[3])) {
            high = middle;
            swap(b, &l->mesh[3]);
        } else {
            low = middle;
        }
    }
    *out = (sdm_survey_jump){.kind = compare(a, b), .value = high};
    return SDM_OK;
}

/* Halves the interval low .. high and follows the half in which `vertex` moves farther. Smooth
 * motion shrinks with the interval, a jump stays. Sets *value and *mm of what is left. */
static sdm_status find_jump(line *l, double low, double high, size_t vertex, double *value,
                            double *mm, sdm_error *err)
{
    double x[3][3]; // positions of the vertex at low, high and the middle
    const double at[2] = {low, high};
    sdm_status s = SDM_OK;
    for (int i = 0; i < 2 && !s; i++) {
        s = line_mesh(l, at[i], &l->mesh[3], err);
        if (!s) memcpy(x[i], l->mesh[3].vert + 3 * vertex, sizeof x[i]);
    }
    for (int i = 0; i < HALVINGS && !s; i++) {
        const double middle = 0.5 * (low + high);
        s = line_mesh(l, middle, &l->mesh[3], err);
        if (s || l->mesh[3].n_vert <= vertex) break;
        memcpy(x[2], l->mesh[3].vert + 3 * vertex, sizeof x[2]);
        const int moves = moved(x[0], x[2]) > moved(x[2], x[1]); // the end that moves inwards
        memcpy(x[moves], x[2], sizeof x[2]);
        *(moves ? &high : &low) = middle;
    }
    *value = 0.5 * (low + high);
    *mm = moved(x[0], x[1]);
    return s;
}

static sdm_status follow(line *l, double size, sdm_survey_jump *out, sdm_error *err)
{
    double worst = 0;
    size_t vertex = 0;
    int at = 0;
    sdm_mesh *const m = l->mesh;
    for (int i = 0; i <= STEPS; i++) {
        // m[0], m[1], m[2]: the meshes at steps i - 2, i - 1, i
        swap(&m[0], &m[1]);
        swap(&m[1], &m[2]);
        const sdm_status s = line_mesh(l, line_value(l, i), &m[2], err);
        if (s) return s;
        if (i > 0 && compare(&m[1], &m[2]))
            return find_change(l, line_value(l, i - 1), line_value(l, i), &m[1], &m[2], out, err);
        size_t v = 0;
        const double d = i > 1 ? second_difference(&m[0], &m[1], &m[2], &v) : 0;
        if (d > worst) {
            worst = d;
            vertex = v;
            at = i;
        }
    }
    if (!(worst > 1e-5 * size)) return SDM_OK;
    double value, mm;
    const sdm_status s =
        find_jump(l, line_value(l, at - 2), line_value(l, at), vertex, &value, &mm, err);
    if (!s && mm > 0.5 * worst && mm > 1e-5 * size)
        *out =
            (sdm_survey_jump){.kind = SDM_BREAK_JUMP, .value = value, .vertex = vertex, .mm = mm};
    return s;
}

sdm_status sdm_survey_line(const shape_family *f, const double *p, size_t k, double size,
                           sdm_survey_jump *out, sdm_error *err)
{
    line l = {.family = f, .param = k};
    *out = (sdm_survey_jump){.kind = SDM_BREAK_NONE};
    memcpy(l.p, p, f->shape->n_params * sizeof *p);
    sdm_status s = follow(&l, size, out, err);
    for (int i = 0; i < 4; i++) sdm_mesh_dispose(&l.mesh[i]);
    // shapes that cannot be made are counted elsewhere
    return s == SDM_E_PLUGIN ? SDM_OK : s;
}

sdm_status sdm_survey_line_again(const shape_family *f, const double *p, size_t k,
                                 const double *other, double value, bool *same, sdm_error *err)
{
    enum { MIN, MAX, BELOW, ABOVE, PLACES, OTHER = PLACES };
    static const int order[] = {MIN, BELOW, ABOVE, MAX, ABOVE, BELOW, OTHER, ABOVE, OTHER, BELOW};
    const double min = f->min[k], max = f->max[k], step = BESIDE * (max - min),
                 at[PLACES] = {min, max, fmax(min, value - step), fmin(max, value + step)};
    uint64_t first[PLACES] = {0};
    bool made[PLACES] = {false};
    line l = {.family = f, .param = k};
    sdm_status s = SDM_OK;
    *same = true;
    for (size_t i = 0; i < sizeof order / sizeof *order && *same && !s; i++) {
        const int place = order[i];
        memcpy(l.p, place == OTHER ? other : p, f->shape->n_params * sizeof *p);
        s = line_mesh(&l, place == OTHER ? other[k] : at[place], &l.mesh[0], err);
        const uint64_t sum = s ? 0 : sdm_mesh_checksum(&l.mesh[0]);
        if (s == SDM_E_PLUGIN) s = SDM_OK; // a mesh that fails at times is unlike
        if (place != BELOW && place != ABOVE) continue;
        *same = !made[place] || sum == first[place];
        made[place] = true;
        first[place] = sum;
    }
    sdm_mesh_dispose(&l.mesh[0]);
    return s;
}
