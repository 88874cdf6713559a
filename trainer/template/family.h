/* The meshes of a shape over its parameters: which vertices move together. All lengths in mm. */
#pragma once

#include "sdm/internal/pod.h"
#include "sdm/registry.h"

/* A shape with parameters in a box, and its mesh at the default parameters. */
typedef struct family {
    const sdm_instance *shape;
    size_t n_params;
    const double *min, *max;              /* [n_params] */
    const sdm_distribution *distribution; /* [n_params] */
    uint64_t seed;
    int n_threads;
    double until;        /* sdm_clock() after which no more meshes are made; 0: no limit */
    sdm_mesh base;       /* at the default parameters */
    size_t n_components; /* sets of triangles that are connected through vertices */
    uint32_t *place;     /* [n_vert] first vertex at the same place */
    uint32_t *component; /* [n_vert] component of each vertex; UINT32_MAX: in no triangle */
} family;

/* Fills *f: the mesh at the defaults (moved into min .. max) and its components. Vertices at the
   same place count as one. shape, n_params, min, max,
   distribution, seed and n_threads must be set. Call
   trainer_family_dispose() also after an error. */
sdm_status trainer_family_create(family *f, sdm_error *err);
void trainer_family_dispose(family *f);

/* Random parameters from this index on are for tests: no design uses them. */
#define TRAINER_FAMILY_UNUSED ((size_t)1 << 20)

/* p[n_params] = random parameters number `index`. */
void trainer_family_params(const family *f, size_t index, double *p);

/* *mesh = the mesh at p. SDM_E_UNSUPPORTED: it does not have as many vertices as the base mesh and
   the same triangles, so that its vertices do not correspond to those of the base mesh.
   SDM_E_CANCELLED: it is later than f->until. */
sdm_status trainer_family_mesh(const family *f, const double *p, sdm_mesh *mesh, sdm_error *err);
