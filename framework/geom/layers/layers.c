/* Layers of a map: closest point, normal, triangle and derivatives, computed voxel by voxel. */
#include "layers.h"

#include <stdatomic.h>

#include "memory/cancel.h"
#include "sdm/internal/threads.h"
#include "sdm/internal/vec3.h"

void sdm_distance_gradient(const sdm_nearest *surface, double rounding, uint32_t slot,
                           const double x[3], const double q[3], double d, double n[3])
{
    double r[3];
    v3_sub(x, q, r);
    const double length = copysign(v3_norm(r), d);
    const bool on_surface = !(fabs(d) > rounding) || length == 0;
    for (int i = 0; i < 3; i++) n[i] = on_surface ? surface->frames[slot].n[i] : r[i] / length;
}

static void voxel_fill_derivative(const sdm_layers_job *job, const sdm_vertex_gradient *g,
                                  size_t voxel, size_t n_voxel)
{
    const size_t n_vert = job->sheets.mesh->n_vert;
    for (size_t k = 0; k < job->n_velocity; k++)
        job->derivative[n_voxel * k + voxel] =
            (float)sdm_vertex_gradient_along(g, job->velocity + 3 * n_vert * k);
}

static void voxel_fill(const sdm_layers_job *job, const double x[3], size_t voxel, size_t n_voxel)
{
    const sdm_nearest *surface = job->sheets.surface;
    const sdm_exact_layers *out = job->out;
    uint32_t slot = job->slot[voxel];
    int feature = SDM_FACE;
    double d = 0, q[3] = {NAN, NAN, NAN}, n[3] = {NAN, NAN, NAN};
    if (slot != SDM_NONE) {
        d = copysign(sqrt(sdm_nearest_feature(surface, x, &slot)), (double)job->values[voxel]);
        (void)sdm_frame_closest(&surface->frames[slot], x, q, &feature);
        sdm_distance_gradient(surface, job->rounding, slot, x, q, d, n);
    }
    if (out->triangle)
        out->triangle[voxel] = slot == SDM_NONE ? SDM_NONE : surface->tree.order[slot];
    for (size_t a = 0; a < 3; a++) {
        if (out->closest) out->closest[3 * voxel + a] = (float)q[a];
        if (out->normal) out->normal[3 * voxel + a] = (float)n[a];
    }
    if (!job->derivative) return;
    sdm_vertex_gradient g = {.n = 0};
    if (slot != SDM_NONE)
        sdm_vertex_gradient_find(&job->sheets, surface->tree.order[slot], feature, q, n, d < 0, &g);
    voxel_fill_derivative(job, &g, voxel, n_voxel);
}

bool sdm_layers_wanted(const sdm_layers_job *job)
{
    return job->out->triangle || job->out->closest || job->out->normal || job->derivative;
}

sdm_status sdm_layers_fill(const sdm_layers_job *job, const sdm_grid *g, sdm_error *err)
{
    const int n_threads = sdm_threads(job->opts->n_threads);
    (void)n_threads; // unused without OpenMP
    const int64_t n_rows = g->n[1] * g->n[2];
    const size_t n_voxel = sdm_grid_count(g);
    atomic_bool stop = false;
#pragma omp parallel for schedule(dynamic, 4) num_threads(n_threads)
    for (int64_t row = 0; row < n_rows; row++) {
        if (!atomic_load(&stop) && sdm_cancelled(job->opts)) atomic_store(&stop, true);
        for (int64_t i = 0; i < g->n[0] && !atomic_load(&stop); i++) {
            double x[3];
            sdm_grid_world(
                g, (const double[3]){(double)i, (double)(row % g->n[1]), (double)(row / g->n[1])},
                x);
            voxel_fill(job, x, (size_t)(row * g->n[0] + i), n_voxel);
        }
    }
    return atomic_load(&stop) ? sdm_fail(err, SDM_E_CANCELLED, "map stopped on request") : SDM_OK;
}
