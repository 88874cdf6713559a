/* How far a group of parts of a mesh lies from the other parts. The points of two surfaces that are
   nearest to each other are found from many points of the one surface by projections from each
   surface to the other in turn (Cheney and Goldstein 1959). */
#include <math.h>
#include <string.h>

#include "sdm/exact.h"
#include "sdm/internal/part_audit.h"
#include "sdm/memory.h"

enum { STEPS = 200 }; // projections

// true if the vertices of another part have numbers among those of a part of the group
static bool is_mixed(const sdm_part_audit *a, size_t group)
{
    for (size_t k = 0; k < a->n; k++) {
        const sdm_part *p = &a->part[k];
        if (p->group != group) continue;
        for (size_t i = 0; i < a->n; i++)
            if (a->part[i].group != group && a->part[i].first_vert <= p->last_vert &&
                a->part[i].last_vert >= p->first_vert)
                return true;
    }
    return false;
}

// true if the vertex belongs to a part of the group
static bool has_vertex(const sdm_part_audit *a, size_t group, uint32_t v)
{
    for (size_t k = 0; k < a->n; k++)
        if (a->part[k].group == group && v >= a->part[k].first_vert && v <= a->part[k].last_vert)
            return true;
    return false;
}

// the triangles of one group, or of all others; the vertices of the rest stay, unused
static sdm_status triangles_of(const sdm_mesh *mesh, const sdm_part_audit *a, size_t group,
                               bool own, sdm_mesh *out)
{
    const sdm_status s = sdm_mesh_copy(mesh, out, NULL);
    if (s) return s;
    out->n_tri = 0;
    for (size_t t = 0; t < mesh->n_tri; t++) {
        const uint32_t *corner = mesh->tri + 3 * t;
        if (has_vertex(a, group, corner[0]) != own) continue;
        for (int k = 0; k < 3; k++) out->tri[3 * out->n_tri + (size_t)k] = corner[k];
        out->n_tri++;
    }
    return SDM_OK;
}

// a point of the surface of `own` that is near to that of `others`: the nearest one of the corners,
// the middles of the edges and of the triangles
static double near_point(const sdm_mesh *own, const sdm_exact *others, double x[3])
{
    static const double at[7][3] = {{1, 0, 0},
                                    {0, 1, 0},
                                    {0, 0, 1},
                                    {0.5, 0.5, 0},
                                    {0, 0.5, 0.5},
                                    {0.5, 0, 0.5},
                                    {1. / 3, 1. / 3, 1. / 3}};
    double least = INFINITY;
    for (size_t t = 0; t < own->n_tri; t++)
        for (int k = 0; k < 7; k++) {
            double p[3] = {0};
            for (size_t c = 0; c < 3; c++)
                for (size_t a = 0; a < 3; a++)
                    p[a] += at[k][c] * own->vert[3 * (size_t)own->tri[3 * t + c] + a];
            const double d = sdm_exact_distance(others, p);
            if (d < least) least = d, memcpy(x, p, sizeof p);
        }
    return least;
}

double sdm_part_gap(const sdm_mesh *m, const sdm_part_audit *a, size_t index)
{
    const size_t group = a->part[index].group;
    const sdm_exact_opts opts = {.keep_overlap = true, .n_threads = 1};
    sdm_mesh mesh[2] = {{0}};
    sdm_exact *engine[2] = {NULL};
    double x[3], least = NAN, side = NAN;
    if (a->n < 2 || is_mixed(a, group)) return NAN;
    sdm_status s = SDM_OK;
    for (int own = 0; own < 2 && !s; own++) {
        s = triangles_of(m, a, group, own, &mesh[own]);
        if (!s) s = sdm_exact_create(&mesh[own], &opts, &engine[own], NULL);
    }
    if (!s) least = near_point(&mesh[1], engine[0], x);
    for (int i = 0; i < STEPS && !s; i++) {
        double nearest[3];
        const double d = sdm_exact_point(engine[i % 2], x, nearest, NULL, NULL);
        if (!i) side = d; // of a point of this group from the others
        memcpy(x, nearest, sizeof nearest);
        least = fmin(least, fabs(d));
    }
    for (int own = 0; own < 2; own++) {
        sdm_exact_free(engine[own]);
        sdm_mesh_dispose(&mesh[own]);
    }
    return copysign(least, side);
}
