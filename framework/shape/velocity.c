/* Derivatives of the vertices with respect to the parameters. */
#include <math.h>
#include <string.h>

#include "sdm/memory.h"
#include "shape_internal.h"

/* Step of the finite differences as a fraction of the parameter's range. For coordinates of a few
 * mm the truncation and rounding errors of a central difference are then about equal. */
#define STEP_FRACTION 1e-5

static sdm_status velocity_by_callback(const sdm_instance *s, const double *p, size_t n_vert,
                                       double *velocity, sdm_error *err)
{
    host_call call;
    sdm_host_call_begin(&call, NULL, false);
    sdm_callback_begin(s, "velocity", p);
    const int failed = s->shape->velocity(s->self, &call.host, s->options, p, n_vert, velocity);
    sdm_callback_end();
    sdm_status status =
        failed ? sdm_host_call_failed(&call, "velocity", failed, SDM_E_PLUGIN, err) : SDM_OK;
    sdm_host_call_end(&call);
    for (size_t i = 0; !status && i < 3 * n_vert * s->n_params; i++)
        if (!isfinite(velocity[i]))
            status = sdm_fail(err, SDM_E_PLUGIN,
                              "velocity of vertex %zu with respect to '%s' is not finite",
                              i / 3 % n_vert, s->params[i / (3 * n_vert)].name);
    return status ? sdm_instance_fail_at(s, p, status, err) : SDM_OK;
}

/* Adds weight * (vertices at p with p[k] = value) to sum[n_vert][3]. */
static sdm_status moved_vertices_add(const sdm_instance *s, const double *p, size_t k, double value,
                                     double weight, size_t n_vert, sdm_mesh *mesh, double *sum,
                                     sdm_error *err)
{
    double moved[SHAPE_PARAMS_MAX];
    memcpy(moved, p, s->n_params * sizeof *moved);
    moved[k] = value;
    const sdm_status status = sdm_instance_mesh(s, moved, mesh, err);
    if (status) return status;
    if (mesh->n_vert != n_vert)
        return sdm_fail(err, SDM_E_PLUGIN,
                        "shape '%s': the mesh has %zu vertices, velocities of %zu were asked for: "
                        "the number must not "
                        "depend on the parameters",
                        s->shape->name, mesh->n_vert, n_vert);
    for (size_t i = 0; i < 3 * n_vert; i++) sum[i] += weight * mesh->vert[i];
    return SDM_OK;
}

/* Central differences, or at the end of a range one-sided ones of second order with the parameter
   at p, p + h and p + 2 h. The weights are computed from these values after rounding. */
sdm_status sdm_velocity_by_differences(const sdm_instance *s, const double *p, size_t n_vert,
                                       double *velocity, sdm_error *err)
{
    sdm_mesh mesh = {0};
    sdm_status status = SDM_OK;
    for (size_t k = 0; k < s->n_params && !status; k++) {
        const sdm_param *q = &s->params[k];
        const double step = STEP_FRACTION * (q->max - q->min),
                     h = p[k] + step > q->max ? -step : step;
        double *v = velocity + 3 * n_vert * k, value[3] = {p[k] - h, p[k] + h, p[k] + 2 * h},
               weight[3];
        const bool within = value[0] >= q->min && value[0] <= q->max;
        if (within) {
            weight[1] = 1 / (value[1] - value[0]);
            weight[0] = -weight[1];
        } else {
            const double a = value[1] - p[k], b = value[2] - p[k];
            value[0] = p[k];
            weight[0] = -(a + b) / (a * b);
            weight[1] = b / (a * (b - a));
            weight[2] = -a / (b * (b - a));
        }
        memset(v, 0, 3 * n_vert * sizeof *v);
        for (int i = 0; i < (within ? 2 : 3) && !status; i++)
            status = moved_vertices_add(s, p, k, value[i], weight[i], n_vert, &mesh, v, err);
    }
    sdm_mesh_dispose(&mesh);
    return status;
}

sdm_status sdm_instance_velocity(const sdm_instance *s, const double *p, size_t n_vert,
                                 double *velocity, sdm_error *err)
{
    const sdm_status status = sdm_instance_check(s, p, err);
    if (status) return status;
    if (!velocity || n_vert == 0)
        return sdm_fail(
            err, SDM_E_ARG,
            "the address of the velocities must not be NULL, and the number of vertices not 0");
    return s->shape->velocity ? velocity_by_callback(s, p, n_vert, velocity, err)
                              : sdm_velocity_by_differences(s, p, n_vert, velocity, err);
}
