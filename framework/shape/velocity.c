/* Derivatives of the vertices with respect to the parameters. */
#include <math.h>
#include <string.h>

#include "sdm/memory.h"
#include "shape_internal.h"

/* Truncation and rounding error of a central difference are about equal there, for coordinates of some mm. */
#define STEP_SHARE 1e-5

static sdm_status by_callback(const sdm_instance *s, const double *p, size_t n_vert, double *velocity, sdm_error *err)
{
    host_call call;
    sdm_host_call_begin(&call, NULL, false);
    const int failed = s->shape->velocity(s->self, &call.host, s->options, p, n_vert, velocity);
    sdm_status status = failed ? sdm_host_call_failed(&call, "velocity", failed, SDM_E_PLUGIN, err) : SDM_OK;
    sdm_host_call_end(&call);
    for (size_t i = 0; !status && i < 3 * n_vert * s->n_params; i++)
        if (!isfinite(velocity[i]))
            status = sdm_fail(err, SDM_E_PLUGIN, "velocity of vertex %zu with respect to '%s' is not finite",
                              i / 3 % n_vert, s->params[i / (3 * n_vert)].name);
    return status ? sdm_instance_fail_at(s, p, status, err) : SDM_OK;
}

// adds weight * vertices at p with parameter k moved by h
static sdm_status add_moved(const sdm_instance *s, const double *p, size_t k, double h, double weight, size_t n_vert,
                            sdm_mesh *mesh, double *sum, sdm_error *err)
{
    double moved[SHAPE_PARAMS_MAX];
    memcpy(moved, p, s->n_params * sizeof *moved);
    moved[k] += h;
    const sdm_status status = sdm_instance_mesh(s, moved, mesh, err);
    if (status) return status;
    if (mesh->n_vert != n_vert)
        return sdm_fail(err, SDM_E_PLUGIN,
                        "shape '%s': the mesh has %zu vertices, velocities of %zu were asked for: the number must not "
                        "depend on the parameters",
                        s->shape->name, mesh->n_vert, n_vert);
    for (size_t i = 0; i < 3 * n_vert; i++) sum[i] += weight * mesh->vert[i];
    return SDM_OK;
}

// of second order in both forms: (f(h) - f(-h)) / 2h inside, (-3 f(0) + 4 f(h) - f(2h)) / 2h at an end of the range
static sdm_status by_differences(const sdm_instance *s, const double *p, size_t n_vert, double *velocity,
                                 sdm_error *err)
{
    sdm_mesh mesh = {0};
    sdm_status status = SDM_OK;
    for (size_t k = 0; k < s->n_params && !status; k++) {
        const sdm_param *q = &s->params[k];
        double h = STEP_SHARE * (q->max - q->min), *v = velocity + 3 * n_vert * k;
        memset(v, 0, 3 * n_vert * sizeof *v);
        if (p[k] - h >= q->min && p[k] + h <= q->max) {
            status = add_moved(s, p, k, -h, -0.5 / h, n_vert, &mesh, v, err);
            if (!status) status = add_moved(s, p, k, h, 0.5 / h, n_vert, &mesh, v, err);
            continue;
        }
        if (p[k] + h > q->max) h = -h;
        const double moves[3] = {0, h, 2 * h}, weights[3] = {-1.5 / h, 2 / h, -0.5 / h};
        for (int i = 0; i < 3 && !status; i++) status = add_moved(s, p, k, moves[i], weights[i], n_vert, &mesh, v, err);
    }
    sdm_mesh_dispose(&mesh);
    return status;
}

sdm_status sdm_instance_velocity(const sdm_instance *s, const double *p, size_t n_vert, double *velocity,
                                 sdm_error *err)
{
    const sdm_status status = sdm_instance_check(s, p, err);
    if (status) return status;
    if (!velocity || n_vert == 0)
        return sdm_fail(err, SDM_E_ARG, "a place for the velocities of at least one vertex is needed");
    return s->shape->velocity ? by_callback(s, p, n_vert, velocity, err) : by_differences(s, p, n_vert, velocity, err);
}
