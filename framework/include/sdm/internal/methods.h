/* The methods for signed distance maps side by side: the exact engine, brute force, and those of
   the literature, each an entry of one table with the same contract. Values are mm, NEGATIVE
   INSIDE. */
#ifndef SDM_METHODS_H
#define SDM_METHODS_H

#include "sdm/exact.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sdm_method_opts {
    /* Surface and sign, threads, memory_limit, cancelled; memory_limit counts for the engine that
       prepares the surface and for what the method adds each by itself. */
    sdm_exact_opts exact;
    double max_error_mm; /* "octree" alone: largest error allowed; 0: a twentieth of the smallest
                            spacing */
    double band_mm; /* "exact": > 0: narrow band, see sdm_exact_layers; others make the whole map
                       all the same */
    /* Called by the calling thread with the share done, 0 .. 1; may be NULL; the same user as
     * cancelled has. */
    void (*progress)(void *user, double share);
} sdm_method_opts;

typedef struct sdm_method_report {
    double ms_prepare; /* what depends on the mesh alone: the engine's surface, cells */
    double ms_map;     /* everything else */
    size_t bytes;      /* most that the method held beside the values, the mesh and the engine
                          (sdm_exact) */
    /* |value - distance| is at most this: proved, to rounding of float; 0: exact. The distance is
       to the surface of the engine, whose own bound is exact.union_error_mm. NaN: no bound is
       known. */
    double error_bound_mm;
    sdm_exact_report exact; /* what the engine found; "naive": audit, sign and n_tri_used alone */
    char note[160];         /* one line on this run; may be empty */
} sdm_method_report;

typedef struct sdm_method {
    const char *name;      /* "edt" */
    const char *summary;   /* one line */
    const char *reference; /* author and year */
    bool exact;            /* false: approximate, see sdm_method_report.error_bound_mm */

    /* values[nz][ny][nx] = signed distance at the voxel centres, mm, written; the same bits for any
       number of threads. opts and report may be NULL; the report is written on success. All but
       "naive" measure to the surface and take the sign of sdm_exact_create(); "naive" counts every
       triangle of the mesh as it is and takes its sign from the winding number. SDM_E_ARG,
       SDM_E_MESH, SDM_E_NOMEM (memory_limit too), SDM_E_CANCELLED. [any thread] */
    sdm_status (*map)(const sdm_mesh *mesh, const sdm_grid *grid, const sdm_method_opts *opts,
                      float *values, sdm_method_report *report, sdm_error *err);
} sdm_method;

/* The table: entries 0 .. sdm_method_count() - 1, constant; "exact" is the first. NULL beyond its
 * end. [any thread] */
size_t sdm_method_count(void);
const sdm_method *sdm_method_at(size_t i);

/* The entry of that name; NULL, with the names there are in *err, when there is none. [any thread]
 */
const sdm_method *sdm_method_find(const char *name, sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
