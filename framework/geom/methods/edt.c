/* Method "edt": linear-time exact Euclidean distance transform (Maurer, Qi, Raghavan 2003), here
   with seeds finer than the voxels: the points where the lines of voxel centres along x, y and z
   cross the surface. Three transforms, one for each direction of lines, the nearest seed of all
   counts. Approximate: the surface between the seeds is not seen. */
#include <math.h>
#include <stdio.h>

#include "edt_seeds.h"
#include "sdm/internal/envelope.h"
#include "sdm/memory.h"

/* Lines next to each other that are worked on together, for the cache. */
enum { BUNDLE = 16 };

typedef struct job {
    sdm_run *run;
    sdm_seeds seeds[3];
    float *work;       /* [nz][ny][nx] squared distance to the seeds of the lines along `first` */
    double *line;      /* [n_threads][4 * longest line]: see scratch() */
    int64_t longest;   /* voxels of the longest line */
    int first, axis;   /* direction of the seeds' lines, of this pass */
    int64_t n, stride; /* of the lines along axis */
} job;

static void set_axis(job *j, int axis)
{
    const int64_t *n = j->run->grid->n;
    j->axis = axis;
    j->n = n[axis];
    j->stride = axis == 0 ? 1 : axis == 1 ? n[0] : n[0] * n[1];
}

/* Parts of a pass: bundles of lines. */
static int64_t n_bundles(const job *j)
{
    const int64_t lines = (int64_t)sdm_grid_count(j->run->grid) / j->n;
    return j->stride == 1 ? lines : lines / j->stride * ((j->stride + BUNDLE - 1) / BUNDLE);
}

/* First voxel of the bundle, its lines, and the number of its first line. */
static int64_t bundle(const job *j, int64_t part, int64_t *lines, int64_t *line)
{
    if (j->stride == 1) {
        *lines = 1;
        *line = part;
        return part * j->n;
    }
    const int64_t a_plane = (j->stride + BUNDLE - 1) / BUNDLE;
    const int64_t plane = part / a_plane, from = part % a_plane * BUNDLE;
    *lines = j->stride - from < BUNDLE ? j->stride - from : BUNDLE;
    *line = plane * j->stride + from;
    return plane * j->stride * j->n + from;
}

static double *scratch(const job *j, int thread)
{
    return j->line + (size_t)thread * 4 * (size_t)j->longest;
}

/* Squared distances to the seeds of the same line. */
static void along_seeds(void *arg, int64_t part, int thread)
{
    job *j = arg;
    const sdm_seeds *s = &j->seeds[j->axis];
    double *before = scratch(j, thread),
           *after = before + j->n; // nearest seed of each voxel on either side
    const double spacing = j->run->grid->spacing[j->axis], last = (double)(j->n - 1);
    int64_t lines, line;
    const int64_t voxel = bundle(j, part, &lines, &line);
    for (int64_t l = 0; l < lines; l++) {
        for (int64_t i = 0; i < j->n; i++) {
            before[i] = -INFINITY;
            after[i] = INFINITY;
        }
        for (uint32_t k = s->first[line + l]; k < s->first[line + l + 1]; k++) {
            const double x = s->at[k], up = ceil(x), down = floor(x);
            if (up <= last)
                before[up > 0 ? (int64_t)up : 0] = sdm_greater(before[up > 0 ? (int64_t)up : 0], x);
            if (down >= 0)
                after[down < last ? (int64_t)down : j->n - 1] =
                    sdm_lesser(after[down < last ? (int64_t)down : j->n - 1], x);
        }
        for (int64_t i = 1; i < j->n; i++) before[i] = sdm_greater(before[i], before[i - 1]);
        for (int64_t i = j->n - 2; i >= 0; i--) after[i] = sdm_lesser(after[i], after[i + 1]);
        float *out = j->work + voxel + l;
        for (int64_t i = 0; i < j->n; i++) {
            const double d = spacing * sdm_lesser((double)i - before[i], after[i] - (double)i);
            out[i * j->stride] = (float)(d * d);
        }
    }
}

/* Squared distances to seeds of other lines; the last pass of the three keeps the nearest of all
 * directions. */
static void across_seeds(void *arg, int64_t part, int thread)
{
    job *j = arg;
    double *f = scratch(j, thread), *rest = f + j->longest;
    const int last_axis = j->first == 2 ? 1 : 2;
    int64_t lines, line;
    const int64_t voxel = bundle(j, part, &lines, &line);
    for (int64_t l = 0; l < lines; l++) {
        float *at = j->work + voxel + l, *values = j->run->values + voxel + l;
        for (int64_t i = 0; i < j->n; i++) f[i] = (double)at[i * j->stride];
        sdm_lower_envelope(f, j->n, j->run->grid->spacing[j->axis], rest);
        if (j->axis != last_axis)
            for (int64_t i = 0; i < j->n; i++) at[i * j->stride] = (float)f[i];
        else
            for (int64_t i = 0; i < j->n; i++)
                values[i * j->stride] =
                    (float)sdm_lesser((double)values[i * j->stride], sqrt(f[i]));
    }
}

static sdm_status transform(job *j, sdm_error *err)
{
    sdm_run *run = j->run;
    const size_t n = sdm_grid_count(run->grid), scratch_size = 4 * (size_t)j->longest;
    sdm_status s = sdm_run_reserve(run, n, sizeof *j->work, err);
    if (!s) s = sdm_run_reserve(run, (size_t)run->n_threads * scratch_size, sizeof *j->line, err);
    if (!s) s = SDM_ALLOC(&j->work, n, "squared distances", err);
    if (!s)
        s = SDM_ALLOC(&j->line, (size_t)run->n_threads * scratch_size, "lines of the transform",
                      err);
    for (size_t i = 0; i < n && !s; i++) run->values[i] = INFINITY;
    for (int stage = 0; stage < 9 && !s; stage++) {
        j->first = stage / 3;
        // the lines of the seeds first, then the two other directions
        const int other = stage % 3 == 0   ? j->first
                          : stage % 3 == 1 ? j->first == 0
                          : j->first == 2  ? 1
                                           : 2;
        set_axis(j, other);
        s = sdm_run_parts(run, n_bundles(j), stage % 3 ? across_seeds : along_seeds, j, stage, 10,
                          err);
    }
    return s;
}

static sdm_status distances(job *j, sdm_error *err)
{
    sdm_run *run = j->run;
    const sdm_mesh *m = run->surface;
    double *index = NULL;
    sdm_status s = sdm_run_reserve(run, 3 * m->n_vert, sizeof *index, err);
    if (!s) s = SDM_ALLOC(&index, 3 * m->n_vert, "vertices in the grid", err);
    for (size_t v = 0; v < m->n_vert && !s; v++)
        sdm_grid_index(run->grid, &m->vert[3 * v], &index[3 * v]);
    for (int a = 0; a < 3 && !s; a++) s = sdm_seeds_build(run, index, a, &j->seeds[a], err);
    if (!s) s = transform(j, err);
    double *bound = &run->report.error_bound_mm;
    if (!s) s = sdm_seeds_bound(run, index, j->seeds, run->values, bound, err);
    if (!s && *bound == INFINITY)
        s = sdm_fail(err, SDM_E_ARG,
                     "no line of voxel centres of the %lld x %lld x %lld grid crosses the surface: "
                     "method edt needs a "
                     "grid that holds it with voxels smaller than its parts; or use method exact",
                     (long long)run->grid->n[0], (long long)run->grid->n[1],
                     (long long)run->grid->n[2]);
    sdm_free(index);
    return s;
}

static sdm_status map(const sdm_mesh *mesh, const sdm_grid *grid, const sdm_method_opts *opts,
                      float *values, sdm_method_report *report, sdm_error *err)
{
    sdm_run run;
    job j = {.run = &run};
    sdm_status s = sdm_run_begin(&run, mesh, grid, opts, values, err);
    for (int a = 0; a < 3 && !s; a++)
        if (grid->n[a] > j.longest) j.longest = grid->n[a];
    if (!s) s = distances(&j, err);
    if (!s) s = sdm_run_sign(&run, err);
    if (!s)
        snprintf(
            run.report.note, sizeof run.report.note,
            "distance to %zu points of the surface on lines of the grid, never below the true one",
            j.seeds[0].n + j.seeds[1].n + j.seeds[2].n);
    for (int a = 0; a < 3; a++) sdm_seeds_dispose(&j.seeds[a]);
    sdm_free(j.work);
    sdm_free(j.line);
    return sdm_run_end(&run, report, s);
}

const sdm_method sdm_method_edt = {
    "edt", "Euclidean distance transform of the surface's crossings with the grid's lines",
    "Maurer, Qi, Raghavan 2003", false, map};
