/* Table of all methods that compute signed distance maps: the exact engine, brute force and methods
 * of the literature. All have the same interface. Values are in mm, NEGATIVE INSIDE. */
#pragma once

#include "sdm/exact.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sdm_method_opts {
    /* Options of the engine (sign, overlap, cancelled ...), also used by the method itself.
     * memory_limit applies twice: to the engine that prepares the surface, and to the memory that
     * the method adds. */
    sdm_exact_opts exact;
    /* "octree" only: largest error allowed, mm; 0: 1/20 of the smallest voxel spacing */
    double max_error_mm;
    /* "exact" only: > 0 computes a narrow band, see sdm_exact_layers.band_mm; other methods ignore
     * it and compute the whole map */
    double band_mm;
    /* Called in the thread that called map(), with exact.user and the fraction of the work that is
     * done (0 .. 1); may be NULL. */
    void (*progress)(void *user, double share);
} sdm_method_opts;

typedef struct sdm_method_report {
    /* time in milliseconds for the steps that depend only on the mesh, for example the engine's
     * surface */
    double ms_prepare;
    double ms_map; /* time in milliseconds for all other steps */
    /* peak memory of the method in bytes, without the values, the mesh and the engine
     * (sdm_exact) */
    size_t bytes;
    /* Proved bound: abs(value - distance) <= error_bound_mm, up to rounding to float. 0: exact;
     * NaN: no bound is known. The distance is to the engine's surface, whose own error bound is
     * exact.union_error_mm. */
    double error_bound_mm;
    /* report of the engine; "naive" fills only audit, sign and n_tri_used */
    sdm_exact_report exact;
    char note[160]; /* remark on this run, one line; may be empty */
} sdm_method_report;

typedef struct sdm_method {
    const char *name;      /* for example "edt" */
    const char *summary;   /* one line */
    const char *reference; /* author and year */
    bool exact;            /* false: approximate, see sdm_method_report.error_bound_mm */

    /* Writes values[nz][ny][nx], the signed distance at the voxel centres in mm; the same bits for
     * any number of threads. opts and report may be NULL; *report is written on success. All
     * methods but "naive" use the surface and the sign of sdm_exact_create(); "naive" uses every
     * triangle of the mesh as it is, and the sign of the winding number. SDM_E_ARG, SDM_E_MESH,
     * SDM_E_NOMEM (also when memory_limit is exceeded), SDM_E_CANCELLED. [any thread] */
    sdm_status (*map)(const sdm_mesh *mesh, const sdm_grid *grid, const sdm_method_opts *opts,
                      float *values, sdm_method_report *report, sdm_error *err);
} sdm_method;

/* The number of methods, and method i, 0 <= i < sdm_method_count() (NULL for a larger i). The table
 * is constant; "exact" is the first method. [any thread] */
size_t sdm_method_count(void);
const sdm_method *sdm_method_at(size_t i);

/* The method with this name. NULL if there is none; *err then lists the valid names. [any
 * thread] */
const sdm_method *sdm_method_find(const char *name, sdm_error *err);

#ifdef __cplusplus
}
#endif
