/* Samples the meshes of a shape and finds the components of its mesh. */
#include "family.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "data/streams.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/same_triangles.h"
#include "sdm/internal/sampling.h"
#include "sdm/internal/train.h"
#include "sdm/memory.h"

typedef struct place {
    double x[3];
    uint32_t vertex;
} place;

static int compare_places(const void *a, const void *b)
{
    const place *p = a, *q = b;
    for (int i = 0; i < 3; i++)
        if (p->x[i] != q->x[i]) return p->x[i] < q->x[i] ? -1 : 1;
    return p->vertex < q->vertex ? -1 : p->vertex > q->vertex;
}

// root of the set of vertex v; shortens the path
static uint32_t find_root(uint32_t *parent, uint32_t v)
{
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
}

static void join(uint32_t *parent, uint32_t a, uint32_t b)
{
    a = find_root(parent, a), b = find_root(parent, b);
    // the lower number becomes the root, so that components are ordered by their first vertex
    if (a < b) parent[b] = a;
    if (b < a) parent[a] = b;
}

// Sets place, component and n_components.
static sdm_status find_components(family *f, sdm_error *err)
{
    const sdm_mesh *m = &f->base;
    place *places = NULL;
    uint32_t *parent = f->component;
    sdm_status s = SDM_ALLOC(&places, m->n_vert, "components", err);
    if (s) return s;
    for (size_t v = 0; v < m->n_vert; v++) {
        parent[v] = (uint32_t)v;
        memcpy(places[v].x, m->vert + 3 * v, sizeof places[v].x);
        places[v].vertex = (uint32_t)v;
    }
    // vertices at the same place, then the corners of each triangle
    qsort(places, m->n_vert, sizeof *places, compare_places);
    for (size_t v = 0; v < m->n_vert; v++) {
        const place *p = &places[v];
        const bool again = v && !memcmp(p->x, p[-1].x, sizeof p->x);
        f->place[p->vertex] = again ? f->place[p[-1].vertex] : p->vertex;
        join(parent, f->place[p->vertex], p->vertex);
    }
    for (size_t t = 0; t < m->n_tri; t++) {
        join(parent, m->tri[3 * t], m->tri[3 * t + 1]);
        join(parent, m->tri[3 * t], m->tri[3 * t + 2]);
    }
    // number the sets that have a triangle, in the order of their first vertices
    uint32_t *number = NULL;
    if ((s = SDM_ALLOC(&number, m->n_vert, "components", err))) {
        sdm_free(places);
        return s;
    }
    for (size_t t = 0; t < m->n_tri; t++) number[find_root(parent, m->tri[3 * t])] = 1;
    f->n_components = 0;
    for (size_t v = 0; v < m->n_vert; v++)
        if (number[v]) number[v] = (uint32_t)f->n_components++ + 1;
    for (size_t v = 0; v < m->n_vert; v++)
        places[v].vertex = number[find_root(parent, (uint32_t)v)] - 1;
    for (size_t v = 0; v < m->n_vert; v++) parent[v] = places[v].vertex;
    sdm_free(number);
    sdm_free(places);
    return SDM_OK;
}

sdm_status trainer_family_create(family *f, sdm_error *err)
{
    size_t n;
    const sdm_param *params = sdm_instance_params(f->shape, &n);
    double p[SDM_POD_MAX_PARAMS];
    for (size_t i = 0; i < f->n_params; i++) p[i] = fmin(fmax(params[i].def, f->min[i]), f->max[i]);
    sdm_status s = sdm_instance_mesh(f->shape, p, &f->base, err);
    if (!s) s = SDM_ALLOC(&f->place, f->base.n_vert, "components", err);
    if (!s) s = SDM_ALLOC(&f->component, f->base.n_vert, "components", err);
    return s ? s : find_components(f, err);
}

void trainer_family_dispose(family *f)
{
    sdm_mesh_dispose(&f->base);
    sdm_free(f->component);
    sdm_free(f->place);
    f->component = f->place = NULL;
}

void trainer_family_params(const family *f, size_t index, double *p)
{
    sdm_sample_params(f->seed, STREAM_FAMILY, index, f->min, f->max, f->distribution, f->n_params,
                      p);
}

sdm_status trainer_family_mesh(const family *f, const double *p, sdm_mesh *mesh, sdm_error *err)
{
    if (f->until > 0 && sdm_clock() > f->until)
        return sdm_fail(err, SDM_E_CANCELLED, "the design of the template takes too long");
    const sdm_status s = sdm_instance_mesh(f->shape, p, mesh, err);
    if (s) return s;
    if (sdm_mesh_same_triangles(mesh, &f->base)) return SDM_OK;
    return sdm_fail(err, SDM_E_UNSUPPORTED,
                    "shape '%s': the numbers of vertices or the triangles depend on the "
                    "parameters, so vertices do not correspond",
                    sdm_instance_shape(f->shape)->name);
}
