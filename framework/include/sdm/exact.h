/* The exact engine: signed distance from points and grids to a triangle mesh; NEGATIVE INSIDE, mm.
   A mesh that overlaps itself is taken as the union of what it encloses: surface inside the union does not count. */
#ifndef SDM_EXACT_H
#define SDM_EXACT_H

#include "sdm/grid.h"
#include "sdm/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum sdm_sign_method {
    SDM_SIGN_AUTO = 0,  /* crossings on closed meshes, winding otherwise */
    SDM_SIGN_CROSSINGS, /* signed crossings along a ray: the integer winding number; closed meshes only */
    SDM_SIGN_PSEUDONORMAL, /* angle-weighted pseudo-normal (Baerentzen and Aanaes 2005); manifold meshes without overlap only */
    SDM_SIGN_WINDING /* generalised winding number > 1/2 (Jacobson et al. 2013); any mesh */
} sdm_sign_method;

typedef struct sdm_exact_opts {
    sdm_sign_method sign;
    bool keep_overlap;   /* true: distance to every triangle, also those inside the union (signs are the union's) */
    int n_threads;       /* 0: the OpenMP default; the result is the same bits for every value */
    size_t memory_limit; /* bytes the engine may take beside the output; 0: no limit */
    bool (*cancelled)(void *user); /* asked now and then; true stops with SDM_E_CANCELLED; may be NULL */
    void *user;
} sdm_exact_opts;

typedef struct sdm_exact_report {
    sdm_audit audit;
    sdm_sign_method sign;  /* the method used */
    bool turned;           /* the mesh was inside out and has been turned */
    bool unioned;          /* inner surface was removed */
    size_t n_tri_used;     /* triangles after the union */
    double union_error_mm; /* bound on the distance error due to removing the inner surface; 0 without a union */
    double ms_build;       /* audit, union, tree */
} sdm_exact_report;

/* A prepared mesh. Immutable after creation: any number of threads may query it. */
typedef struct sdm_exact sdm_exact;

/* Audits the mesh, chooses the sign method, removes inner surface and builds the tree. The mesh is not needed afterwards.
   opts may be NULL. SDM_E_MESH, SDM_E_NOMEM, SDM_E_ARG (a sign method that does not fit the mesh). */
SDM_API sdm_status sdm_exact_create(const sdm_mesh *mesh, const sdm_exact_opts *opts, sdm_exact **out, sdm_error *err);
SDM_API void sdm_exact_free(sdm_exact *e);
SDM_API const sdm_exact_report *sdm_exact_get_report(const sdm_exact *e);

/* The used surface (union boundary) as a mesh owned by e. */
SDM_API const sdm_mesh *sdm_exact_surface(const sdm_exact *e);

/* values[nz][ny][nx] = signed distance at the voxel centres, mm, written; the same bits for any number of threads. */
SDM_API sdm_status sdm_exact_map(const sdm_exact *e, const sdm_grid *grid, float *values, sdm_error *err);

/* Signed distance at one point; every pointer may be NULL. closest[3]: nearest surface point; normal[3]: unit vector along
   the gradient of the signed distance (the outward normal of the nearest triangle where the point lies on the surface);
   triangle: index in sdm_exact_surface(). NaN for a point that is not finite. [any thread] */
SDM_API double sdm_exact_point(const sdm_exact *e, const double x[3], double closest[3], double normal[3],
                               uint32_t *triangle);

/* Oracle and "naive" baseline, O(voxels * triangles) in double as VTK's class and the paper do it, without any tree: distance to
   the nearest of all triangles of the mesh as it is, sign by the winding number over all triangles > 1/2. Threaded over voxels. */
SDM_API sdm_status sdm_naive_map(const sdm_mesh *mesh, const sdm_grid *grid, int n_threads, float *values,
                                 sdm_error *err);
SDM_API double sdm_naive_point(const sdm_mesh *mesh, const double x[3]);

SDM_API const char *sdm_sign_method_name(sdm_sign_method m); /* "auto", "crossings", "pseudonormal", "winding" */

#ifdef __cplusplus
}
#endif
#endif
