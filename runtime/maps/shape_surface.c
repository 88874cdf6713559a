/* The surface of a shape: mesh, velocities of its vertices, exact engine. */
#include "shape_surface.h"

#include <math.h>
#include <string.h>

#include "sdm/internal/heap.h"
#include "sdm/internal/vec3.h"

void sdm_shape_surface_dispose(shape_surface *s)
{
    sdm_exact_free(s->engine);
    sdm_mesh_dispose(&s->mesh);
    sdm_free(s->velocity);
    *s = (shape_surface){0};
}

sdm_status sdm_shape_surface_make(const sdm_instance *shape, const double *params, bool derivatives,
                                  const sdm_exact_opts *opts, shape_surface *surface,
                                  sdm_error *err)
{
    size_t count;
    sdm_shape_surface_dispose(surface);
    (void)sdm_instance_params(shape, &surface->n_params);
    sdm_status s = sdm_instance_mesh(shape, params, &surface->mesh, err);
    if (!s && derivatives) {
        s = sdm_mul(3 * surface->mesh.n_vert, surface->n_params, &count, err);
        if (!s) s = SDM_ALLOC(&surface->velocity, count, "velocities of the vertices", err);
        if (!s)
            s = sdm_instance_velocity(shape, params, surface->mesh.n_vert, surface->velocity, err);
    }
    if (!s) s = sdm_exact_create(&surface->mesh, opts, &surface->engine, err);
    if (s) sdm_shape_surface_dispose(surface);
    return s;
}

// barycentric coordinates of the point of triangle abc next to x
static void barycentric(const double *a, const double *b, const double *c, const double x[3],
                        double weight[3])
{
    double ab[3], ac[3], ax[3];
    v3_sub(b, a, ab);
    v3_sub(c, a, ac);
    v3_sub(x, a, ax);
    const double bb = v3_dot(ab, ab), bc = v3_dot(ab, ac), cc = v3_dot(ac, ac), xb = v3_dot(ax, ab),
                 xc = v3_dot(ax, ac), det = bb * cc - bc * bc;
    weight[1] = det > 0 ? (cc * xb - bc * xc) / det : bb > 0 ? xb / bb : 0;
    weight[2] = det > 0 ? (bb * xc - bc * xb) / det : 0;
    weight[0] = 1 - weight[1] - weight[2];
}

void sdm_shape_surface_derivatives(const shape_surface *s, uint32_t triangle,
                                   const double closest[3], const double gradient[3], double *by)
{
    const uint32_t *t = s->mesh.tri + 3 * (size_t)sdm_exact_source(s->engine)[triangle];
    double weight[3];
    barycentric(s->mesh.vert + 3 * (size_t)t[0], s->mesh.vert + 3 * (size_t)t[1],
                s->mesh.vert + 3 * (size_t)t[2], closest, weight);
    for (size_t k = 0; k < s->n_params; k++) {
        const double *velocity = s->velocity + 3 * s->mesh.n_vert * k;
        by[k] = 0;
        for (int i = 0; i < 3; i++)
            by[k] -= weight[i] * v3_dot(gradient, velocity + 3 * (size_t)t[i]);
    }
}

// normal of a triangle whose length is its area
static double area_normal(const double *vert, const uint32_t *t, double normal[3])
{
    v3_triangle_normal(vert + 3 * (size_t)t[0], vert + 3 * (size_t)t[1], vert + 3 * (size_t)t[2],
                       normal);
    for (int i = 0; i < 3; i++) normal[i] *= 0.5;
    return v3_norm(normal);
}

void sdm_shape_surface_area(const shape_surface *s, double *area, double *gradient)
{
    const sdm_mesh *used = sdm_exact_surface(s->engine);
    const uint32_t *source = sdm_exact_source(s->engine);
    *area = 0;
    memset(gradient, 0, s->n_params * sizeof *gradient);
    for (size_t i = 0; i < used->n_tri; i++) {
        const uint32_t *t = s->mesh.tri + 3 * (size_t)source[i];
        double normal[3], ignored[3];
        const double part = area_normal(used->vert, used->tri + 3 * i, ignored),
                     whole = area_normal(s->mesh.vert, t, normal);
        *area += part;
        if (!(whole > 0)) continue;
        // the area changes by the velocity of each corner along the normal x the opposite edge
        for (int corner = 0; corner < 3; corner++) {
            double edge[3], by[3];
            v3_sub(s->mesh.vert + 3 * (size_t)t[(corner + 2) % 3],
                   s->mesh.vert + 3 * (size_t)t[(corner + 1) % 3], edge);
            v3_cross(normal, edge, by);
            for (size_t k = 0; k < s->n_params; k++)
                gradient[k] += 0.5 * part / (whole * whole) *
                               v3_dot(by, s->velocity + 3 * (s->mesh.n_vert * k + t[corner]));
        }
    }
}
