/* Method "edt": exact Euclidean distance transform in linear time (Maurer, Qi, Raghavan 2003) of
 * seeds finer than the voxels: the points where grid lines (lines through voxel centres) along x, y
 * and z cross the surface. There are three transforms, one for each direction of grid lines; a
 * voxel gets the smallest of the three distances. The result is approximate, because the surface
 * between the seeds is ignored. */
#include <math.h>
#include <stdio.h>

#include "edt_seeds.h"
#include "sdm/internal/envelope.h"
#include "sdm/memory.h"

/* Number of neighbouring lines that one thread transforms together, so that it uses whole cache
 * lines. */
enum { BUNDLE = 16 };

typedef struct edt_job {
    sdm_run *run;
    sdm_seeds seeds[3];
    /* [nz][ny][nx] squared distance to the nearest seed on lines along axis `first`, mm^2 */
    float *work;
    /* [n_threads][4 * longest] scratch memory, see line_scratch() */
    double *line;
    int64_t longest; /* largest number of voxels along an axis */
    /* first: axis of the seeds' grid lines; axis: axis of the lines of the current pass */
    int first, axis;
    /* n: number of voxels of a line along `axis`; stride: distance in `work` between neighbouring
     * voxels of the line */
    int64_t n, stride;
} edt_job;

static void edt_set_axis(edt_job *j, int axis)
{
    const int64_t *n = j->run->grid->n;
    j->axis = axis;
    j->n = n[axis];
    j->stride = axis == 0 ? 1 : axis == 1 ? n[0] : n[0] * n[1];
}

/* Number of parts of a pass: a part is a bundle of up to BUNDLE neighbouring lines. */
static int64_t bundle_count(const edt_job *j)
{
    const int64_t lines = (int64_t)sdm_grid_count(j->run->grid) / j->n;
    return j->stride == 1 ? lines : lines / j->stride * ((j->stride + BUNDLE - 1) / BUNDLE);
}

/* Returns the index of the first voxel of bundle `part`; *lines = number of its lines, *line =
 * number of its first line (numbered as in sdm_seeds). */
static int64_t bundle_first_voxel(const edt_job *j, int64_t part, int64_t *lines, int64_t *line)
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

static double *line_scratch(const edt_job *j, int thread)
{
    return j->line + (size_t)thread * 4 * (size_t)j->longest;
}

/* First pass of a transform: squared distance of every voxel to the nearest seed on its own
 * line. */
static void edt_along_seeds(void *arg, int64_t part, int thread)
{
    edt_job *j = arg;
    const sdm_seeds *s = &j->seeds[j->axis];
    // [n] coordinate of the nearest seed on either side of each voxel
    double *before = line_scratch(j, thread), *after = before + j->n;
    const double spacing = j->run->grid->spacing[j->axis], last = (double)(j->n - 1);
    int64_t lines, line;
    const int64_t voxel = bundle_first_voxel(j, part, &lines, &line);
    for (int64_t l = 0; l < lines; l++) {
        for (int64_t i = 0; i < j->n; i++) {
            before[i] = -INFINITY;
            after[i] = INFINITY;
        }
        // store each seed at the voxels next to it, then propagate along the line
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

/* Second and third pass of a transform: replaces the value of each voxel by the minimum, over the
 * voxels of its line, of (value + squared distance between the voxels). The third pass then takes
 * the minimum with the distances of the earlier transforms, in run->values. */
static void edt_across_seeds(void *arg, int64_t part, int thread)
{
    edt_job *j = arg;
    double *f = line_scratch(j, thread), *rest = f + j->longest;
    const int last_axis = j->first == 2 ? 1 : 2;
    int64_t lines, line;
    const int64_t voxel = bundle_first_voxel(j, part, &lines, &line);
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

static sdm_status edt_transform(edt_job *j, sdm_error *err)
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
        // passes of a transform: the axis of the seeds' lines first, then the two other axes
        const int other = stage % 3 == 0   ? j->first
                          : stage % 3 == 1 ? j->first == 0
                          : j->first == 2  ? 1
                                           : 2;
        edt_set_axis(j, other);
        s = sdm_run_parts(run, bundle_count(j), stage % 3 ? edt_across_seeds : edt_along_seeds, j,
                          stage, 10, err);
    }
    return s;
}

static sdm_status edt_distances(edt_job *j, sdm_error *err)
{
    sdm_run *run = j->run;
    const sdm_mesh *m = run->surface;
    double *index = NULL;
    sdm_status s = sdm_run_reserve(run, 3 * m->n_vert, sizeof *index, err);
    if (!s) s = SDM_ALLOC(&index, 3 * m->n_vert, "vertices in the grid", err);
    for (size_t v = 0; v < m->n_vert && !s; v++)
        sdm_grid_index(run->grid, &m->vert[3 * v], &index[3 * v]);
    for (int a = 0; a < 3 && !s; a++) s = sdm_seeds_build(run, index, a, &j->seeds[a], err);
    if (!s) s = edt_transform(j, err);
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

static sdm_status edt_map(const sdm_mesh *mesh, const sdm_grid *grid, const sdm_method_opts *opts,
                          float *values, sdm_method_report *report, sdm_error *err)
{
    sdm_run run;
    edt_job j = {.run = &run};
    sdm_status s = sdm_run_begin(&run, mesh, grid, opts, values, err);
    for (int a = 0; a < 3 && !s; a++)
        if (grid->n[a] > j.longest) j.longest = grid->n[a];
    if (!s) s = edt_distances(&j, err);
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
    "Maurer, Qi, Raghavan 2003", false, edt_map};
