/* How far a part of a mesh lies from the other parts. */
#include <math.h>

#include "sdm/exact.h"
#include "sdm/internal/part_audit.h"
#include "sdm/memory.h"

// true if the vertices of another part have numbers among those of part `index`
static bool is_mixed(const sdm_part_audit *a, size_t index)
{
    const sdm_part *p = &a->part[index];
    for (size_t i = 0; i < a->n; i++)
        if (i != index && a->part[i].first_vert <= p->last_vert &&
            a->part[i].last_vert >= p->first_vert)
            return true;
    return false;
}

// the triangles of all parts but one; vertices of that one stay, unused
static sdm_status others_of(const sdm_mesh *mesh, const sdm_part *part, sdm_mesh *out)
{
    const sdm_status s = sdm_mesh_copy(mesh, out, NULL);
    if (s) return s;
    out->n_tri = 0;
    for (size_t t = 0; t < mesh->n_tri; t++) {
        const uint32_t *corner = mesh->tri + 3 * t;
        if (corner[0] >= part->first_vert && corner[0] <= part->last_vert) continue;
        for (int k = 0; k < 3; k++) out->tri[3 * out->n_tri + (size_t)k] = corner[k];
        out->n_tri++;
    }
    return SDM_OK;
}

double sdm_part_gap(const sdm_mesh *m, const sdm_part_audit *a, size_t index)
{
    const sdm_part *part = &a->part[index];
    const size_t n = part->last_vert - part->first_vert + 1;
    sdm_mesh others = {0};
    sdm_exact *engine = NULL;
    double *distance = NULL, least = NAN;
    if (a->n < 2 || is_mixed(a, index)) return NAN;
    sdm_status s = others_of(m, part, &others);
    if (!s) s = sdm_exact_create(&others, NULL, &engine, NULL);
    if (!s) s = SDM_ALLOC(&distance, n, "distances", NULL);
    if (!s)
        s = sdm_exact_points(engine, m->vert + 3 * part->first_vert, n,
                             &(sdm_exact_at){.distance = distance}, NULL);
    for (size_t i = 0; i < n && !s; i++) least = fmin(least, fabs(distance[i]));
    sdm_free(distance);
    sdm_exact_free(engine);
    sdm_mesh_dispose(&others);
    return least;
}
