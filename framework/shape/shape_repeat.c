/* Makes meshes again, one after the other or on many threads at once, and compares their bits. */
#include <string.h>

#include "sdm/internal/clock.h"
#include "sdm/memory.h"
#include "shape_internal.h"

/* What mesh() finds where it must not read: in memory that it has not written, and behind the last
 * parameter. As a double FILL is NaN, OTHER_FILL about 32.5. */
enum { FILL = 0xff, OTHER_FILL = 0x40 };
/* Of sdm_repeat_find(). */
enum { THREADS = 4, SHAPES = 8, SHAPES_BRIEF = 4, TRIANGLES = 200000 };
static const double SECONDS_BRIEF = 0.1;
#define BEHIND 0.5

/* A call of mesh() with other memory around it. */
typedef struct trial {
    const sdm_instance *shape;
    sdm_mesh mesh[2]; /* at two addresses, of which copies may be on the stack: FILL, OTHER_FILL */
    double p[2 * SHAPE_PARAMS_MAX]; /* the parameters, then values that mesh() must not read */
} trial;

/* Checksum of the mesh at p[n_params]; 0: it cannot be made. */
static uint64_t make(trial *t, const double *p, int fill)
{
    memcpy(t->p, p, t->shape->n_params * sizeof *p);
    sdm_mesh *m = &t->mesh[fill == OTHER_FILL];
    return sdm_instance_mesh_filled(t->shape, t->p, fill, m, NULL) ? 0 : sdm_mesh_checksum(m);
}

static void set_behind(trial *t, double value)
{
    for (size_t i = t->shape->n_params; i < 2 * SHAPE_PARAMS_MAX; i++) t->p[i] = value;
}

static void count(sdm_repeat *out, sdm_repeat_cause cause, size_t shape)
{
    if (!out->unlike++) out->first = shape;
    out->cause = cause;
}

/* Makes all meshes again and counts those that are unlike the first ones. */
static void count_unlike(trial *t, const double *p, size_t n, const uint64_t *first, int fill,
                         sdm_repeat_cause cause, sdm_repeat *out)
{
    for (size_t i = 0; i < n; i++)
        if (make(t, p + i * t->shape->n_params, fill) != first[i]) count(out, cause, i);
}

/* Does mesh() read behind the last parameter? Then out->param is the index of the first value. */
static void read_behind(trial *t, const double *p, size_t n, const uint64_t *first, sdm_repeat *out)
{
    // a mesh that fails with both of the first two values may be made with the third
    static const double others[] = {1.5, 8};
    double other = BEHIND;
    for (size_t i = 0; i < sizeof others / sizeof *others && !out->unlike; i++) {
        other = others[i];
        set_behind(t, other);
        count_unlike(t, p, n, first, FILL, SDM_REPEAT_BEHIND, out);
    }
    set_behind(t, BEHIND);
    if (!out->unlike) return;
    for (out->param = t->shape->n_params; out->param < 2 * SHAPE_PARAMS_MAX - 1; out->param++) {
        t->p[out->param] = other;
        const uint64_t now = make(t, p + out->first * t->shape->n_params, FILL);
        t->p[out->param] = BEHIND;
        if (now != first[out->first]) return;
    }
}

/* Does the mesh depend on the calls before? */
static void read_history(trial *t, const double *p, size_t n, const uint64_t *first,
                         sdm_repeat *out)
{
    for (size_t i = n; i-- > 0;) {
        const double *at = p + i * t->shape->n_params;
        const bool after_other = make(t, at, FILL) != first[i],
                   after_same = make(t, at, FILL) != first[i];
        if (!after_other && !after_same) continue;
        count(out, SDM_REPEAT_HISTORY, i);
        out->first = i;
    }
}

static void again(const sdm_instance *s, const double *p, uint64_t first, sdm_mesh *mesh,
                  bool *unlike)
{
    if ((sdm_instance_mesh(s, p, mesh, NULL) ? 0 : sdm_mesh_checksum(mesh)) == first) return;
#pragma omp atomic write
    *unlike = true;
}

/* Every thread makes all meshes, each thread another one at first. */
static void repeat_at_once(const sdm_instance *s, const double *p, size_t n, int n_threads,
                           double seconds, const uint64_t *first, bool *unlike)
{
    const double until = sdm_clock() + seconds;
#pragma omp parallel for num_threads(n_threads) schedule(static, 1)
    for (int thread = 0; thread < n_threads; thread++) {
        sdm_mesh mesh = {0};
        do
            for (size_t k = 0; k < n; k++) {
                const size_t i = (k + (size_t)thread) % n;
                again(s, p + i * s->n_params, first[i], &mesh, &unlike[i]);
            }
        while (sdm_clock() < until);
        sdm_mesh_dispose(&mesh);
    }
}

const char *sdm_repeat_advice(sdm_repeat_cause cause)
{
    switch (cause) {
    case SDM_REPEAT_HISTORY:
        return "mesh() keeps something from one call to the next: no static or global variables "
               "that it writes, no random numbers, no clock, no files";
    case SDM_REPEAT_BEHIND:
        return "mesh() reads more parameters than the shape has: is a row missing in the table, "
               "or .n_params smaller than the table? SDM_PARAMS(TABLE) in place of .params and "
               ".n_params counts the rows";
    case SDM_REPEAT_UNSET:
        return "mesh() reads memory that it has not written: set every variable, row and array "
               "first (the compiler names many of them with -O2 -Wall, valgrind the rest)";
    case SDM_REPEAT_THREADS:
        return "mesh() writes a static or global variable or array, which threads share: make it "
               "local to mesh(), or use --isolate, which gives every thread a process";
    case SDM_REPEAT_PROCESS:
        return "a static or global variable keeps what the first call of mesh() set: let mesh() "
               "compute it anew in every call";
    case SDM_REPEAT_BESIDE:
    case SDM_REPEAT_OPTION:
        return "a static variable or a cache in mesh() is the usual cause: let mesh() compute "
               "everything anew in every call";
    default:
        return "mesh() must depend on its arguments alone";
    }
}

sdm_status sdm_shape_repeat(const sdm_instance *s, const double *p, size_t n, sdm_repeat *out,
                            sdm_error *err)
{
    *out = (sdm_repeat){0};
    if (sdm_is_isolated(s)) return sdm_isolated_repeat(s, p, n, 1, out, err);
    uint64_t *first = NULL;
    trial t = {.shape = s};
    const sdm_status status = SDM_ALLOC(&first, n, "checksums of meshes", err);
    set_behind(&t, BEHIND);
    for (size_t i = 0; i < n && !status; i++) first[i] = make(&t, p + i * s->n_params, FILL);
    // what depends on the calls before would count as a fault of the other kinds, too
    if (!status) read_history(&t, p, n, first, out);
    if (!status && !out->unlike) read_behind(&t, p, n, first, out);
    // does mesh() use memory that it has not written?
    if (!status && !out->unlike) count_unlike(&t, p, n, first, OTHER_FILL, SDM_REPEAT_UNSET, out);
    for (int i = 0; i < 2; i++) sdm_mesh_dispose(&t.mesh[i]);
    sdm_free(first);
    return status;
}

sdm_status sdm_shape_repeat_at_once(const sdm_instance *s, const double *p, size_t n, int n_threads,
                                    double seconds, sdm_repeat *out, sdm_error *err)
{
    *out = (sdm_repeat){0};
    if (sdm_is_isolated(s)) return sdm_isolated_repeat(s, p, n, n_threads, out, err);
    uint64_t *first = NULL;
    bool *unlike = NULL;
    sdm_mesh mesh = {0};
    sdm_status status = SDM_ALLOC(&first, n, "checksums of meshes", err);
    if (!status) status = SDM_ALLOC(&unlike, n, "repeated meshes", err);
    for (size_t i = 0; i < n && !status; i++)
        first[i] =
            sdm_instance_mesh(s, p + i * s->n_params, &mesh, NULL) ? 0 : sdm_mesh_checksum(&mesh);
    sdm_mesh_dispose(&mesh);
    if (!status) repeat_at_once(s, p, n, n_threads, seconds, first, unlike);
    for (size_t i = 0; i < n && !status; i++)
        if (unlike[i]) count(out, SDM_REPEAT_THREADS, i);
    sdm_free(first);
    sdm_free(unlike);
    return status;
}

/* Number of shapes: fewer if the mesh at p has many triangles. */
static size_t choose_shapes(const sdm_instance *shape, const double *p, size_t n, bool brief)
{
    sdm_mesh mesh = {0};
    size_t most = brief ? SHAPES_BRIEF : SHAPES;
    if (!sdm_instance_mesh(shape, p, &mesh, NULL) && mesh.n_tri * most > TRIANGLES)
        most = TRIANGLES / mesh.n_tri;
    sdm_mesh_dispose(&mesh);
    if (most < 1) most = 1;
    return n < most ? n : most;
}

sdm_status sdm_repeat_find(const sdm_instance *shape, const double *p, size_t n, bool brief,
                           sdm_repeat *out, sdm_error *err)
{
    const size_t all = n;
    n = choose_shapes(shape, p, n, brief);
    const sdm_status s = sdm_shape_repeat(shape, p, n, out, err);
    if (s == SDM_E_PLUGIN) return SDM_OK;
    if (!s && (!out->unlike || out->cause == SDM_REPEAT_HISTORY)) {
        sdm_repeat beside;
        sdm_shape_repeat_beside(shape, p, all, brief, &beside);
        if (beside.cause == SDM_REPEAT_BESIDE || !out->unlike) *out = beside;
    }
    if (s || out->unlike || sdm_is_isolated(shape)) return s;
    return sdm_shape_repeat_at_once(shape, p, n, THREADS,
                                    brief ? SECONDS_BRIEF : SHAPE_REPEAT_SECONDS, out, err);
}
