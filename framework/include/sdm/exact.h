/* The exact engine: signed distance from points and grids to a triangle mesh; NEGATIVE INSIDE, mm.
   A mesh that overlaps itself is taken as the union of what it encloses: surface inside the union
   does not count. Inside is where the winding number is at least 1 on a closed mesh (the directions
   of the triangles of every edge cancel), above 1/2 on any other. So
   - a part of opposite orientation within a solid is a cavity, a part of the same orientation
   counts once with the solid;
   - a closed mesh that is inside out as a whole is turned, and so is a part around which or in
   which the number would be below 0 and that meets no other part: a body that is inside out beside
   others, or nested in a cavity. Cavities are not. Parts that meet others stay as they are: one
   that is inside out takes away what it overlaps and is not solid itself;
   - a face given twice counts as one, a face and its back enclose nothing; where only such sheets
   are given (zero thickness) no point is inside and distances are to the sheets;
   - parts and gaps of the union thinner than 128 roundings (2^-52) of the largest coordinate, tips
   of needles among them, count or not, as it happens; the distance is then that to the next part,
   whatever union_error_mm says. As near to surface inside the union either sign is right;
   - on an open, one-sided or mixed mesh nothing is turned; a flat sheet or a Moebius strip has no
   inside, a cup ends about where its opening is seen under half of the sphere. The sign then
   changes away from the surface, too. */
#ifndef SDM_EXACT_H
#define SDM_EXACT_H

#include "sdm/grid.h"
#include "sdm/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum sdm_sign_method {
    SDM_SIGN_AUTO = 0,  /* crossings on closed meshes, winding otherwise */
    SDM_SIGN_CROSSINGS, /* signed crossings along a ray: the integer winding number; closed meshes
                           only */
    SDM_SIGN_PSEUDONORMAL, /* angle-weighted pseudo-normal (Baerentzen and Aanaes 2005); only
                              manifold meshes without overlap and without degenerate triangles */
    SDM_SIGN_WINDING       /* generalised winding number > 1/2 (Jacobson et al. 2013); any mesh */
} sdm_sign_method;

typedef struct sdm_exact_opts {
    sdm_sign_method sign;
    bool keep_overlap;   /* true: distance to every triangle, also those inside the union (signs are
                            the union's) */
    int n_threads;       /* 0: the OpenMP default; the result is the same bits for every value */
    size_t memory_limit; /* bytes the engine may take beside the output; 0: no limit */
    bool (*cancelled)(
        void *user); /* asked now and then; true stops with SDM_E_CANCELLED; may be NULL */
    void *user;
} sdm_exact_opts;

typedef struct sdm_exact_report {
    sdm_audit audit;
    sdm_sign_method sign;  /* the method used */
    bool turned;           /* the mesh was inside out and has been turned */
    bool unioned;          /* inner surface was removed */
    size_t n_tri_used;     /* triangles after the union */
    double union_error_mm; /* bound on the error by removing inner surface, see above for thin
                              parts; 0 without */
    double ms_build;       /* audit, union, tree */
    size_t parts_turned;   /* closed parts among others that were inside out and have been turned */
} sdm_exact_report;

/* A prepared mesh. Immutable after creation: any number of threads may query it. */
typedef struct sdm_exact sdm_exact;

/* Audits the mesh, chooses the sign method, removes inner surface and builds the tree. The mesh is
   not needed afterwards. opts may be NULL. SDM_E_MESH, SDM_E_NOMEM, SDM_E_ARG (a sign method that
   does not fit the mesh), SDM_E_CANCELLED. */
SDM_API sdm_status sdm_exact_create(const sdm_mesh *mesh, const sdm_exact_opts *opts,
                                    sdm_exact **out, sdm_error *err);
SDM_API void sdm_exact_free(sdm_exact *e);
SDM_API const sdm_exact_report *sdm_exact_get_report(const sdm_exact *e);

/* The used surface (union boundary) as a mesh owned by e. */
SDM_API const sdm_mesh *sdm_exact_surface(const sdm_exact *e);
/* [sdm_exact_surface()->n_tri] triangle of the given mesh that each triangle of the surface is a
 * part of, owned by e. */
SDM_API const uint32_t *sdm_exact_source(const sdm_exact *e);

/* values[nz][ny][nx] = signed distance at the voxel centres, mm, written; the same bits for any
 * number of threads. */
SDM_API sdm_status sdm_exact_map(const sdm_exact *e, const sdm_grid *grid, float *values,
                                 sdm_error *err);

/* Turns the sign of the voxels inside: gives distances of another origin, all >= 0, the signs of
   the engine. Threads and errors as sdm_exact_map(). */
SDM_API sdm_status sdm_exact_sign(const sdm_exact *e, const sdm_grid *grid, float *values,
                                  sdm_error *err);

/* What sdm_exact_certify() has found. */
typedef struct sdm_sign_certificate {
    sdm_sign_method method; /* the map's */
    const char *compared; /* what its signs were compared with, a constant text: "crossings along y
                             and z", ... */
    size_t voxels;        /* of the map */
    size_t checked; /* voxels compared: all, or a sample where the boundary of an open mesh is very
                       long */
    size_t wrong;   /* of these, voxels where not everything agrees */
    size_t below_zero; /* voxels with a winding number below -1/2: part of the mesh is inside out
                          there */
    int64_t first_wrong[3]; /* index (i, j, k) of the first voxel that is wrong; -1 without one */
} sdm_sign_certificate;

/* Finds the signs of a map made by sdm_exact_map(e, grid) again in ways independent of it and
   compares: signed crossings along the other axes of the grid, on an open mesh together with its
   boundary, or sums of solid angles at a sample of the voxels. Voxels on the surface to rounding,
   and those with a winding number of 1/2 to 1e-9, count as right, NaN as wrong. Threads and errors
   as sdm_exact_map(). */
SDM_API sdm_status sdm_exact_certify(const sdm_exact *e, const sdm_grid *grid, const float *values,
                                     sdm_sign_certificate *out, sdm_error *err);

/* What is known of every voxel; NULL: not wanted. As sdm_exact_point() gives it at the voxel
   centre, rounded; where several triangles are equally near, one of them. */
typedef struct sdm_exact_layers {
    float *values;      /* [nz][ny][nx] signed distance, mm: what sdm_exact_map() gives */
    float *closest;     /* [nz][ny][nx][3] nearest surface point, mm */
    float *normal;      /* [nz][ny][nx][3] unit vector along the gradient of the signed distance */
    uint32_t *triangle; /* [nz][ny][nx] nearest triangle, an index in sdm_exact_surface() */
    double band_mm; /* > 0: narrow band, at a cost in proportion to it: distances from band_mm on
                       become +-band_mm, there triangle is UINT32_MAX, closest and normal are NaN,
                       derivatives 0; 0: the whole map */
} sdm_exact_layers;

/* The map with layers, in arrays of the caller; the same bits for any number of threads. Errors as
 * sdm_exact_map(). */
SDM_API sdm_status sdm_exact_map_layers(const sdm_exact *e, const sdm_grid *grid,
                                        const sdm_exact_layers *layers, sdm_error *err);

/* Derivative of the map as the vertices of the given mesh move: derivative[n][nz][ny][nx], mm per
   unit of the n motions, from velocity[n][n_vert][3] = d(vertex)/d(parameter). With x* the nearest
   surface point and n the gradient of the distance it is -n . v(x*), v interpolated on the triangle
   of x*; where sheets of a union cross at x*, each counts with its share of n. The distance has no
   derivative where several surface points are equally near (medial axis): there it is that of the
   one taken, one-sided. A sign that changes away from the surface (open meshes) counts as fixed.
   layers may be NULL. Threads and errors as above. */
SDM_API sdm_status sdm_exact_map_derivative(const sdm_exact *e, const sdm_grid *grid,
                                            const double *velocity, size_t n,
                                            const sdm_exact_layers *layers, float *derivative,
                                            sdm_error *err);

/* Signed distance at one point; every pointer may be NULL. closest[3]: nearest surface point;
   normal[3]: unit vector along the gradient of the signed distance (the outward normal of the
   nearest triangle where the point lies on the surface); triangle: index in sdm_exact_surface().
   NaN, triangle without meaning, for a point with a coordinate that is not finite or beyond
   +-1e150. [any thread] */
SDM_API double sdm_exact_point(const sdm_exact *e, const double x[3], double closest[3],
                               double normal[3], uint32_t *triangle);

/* Distance without its sign, the same bits: on open meshes, where a sign is a sum over the
   boundary, much cheaper. NaN as above. [any thread] */
SDM_API double sdm_exact_distance(const sdm_exact *e, const double x[3]);

SDM_API const char *
sdm_sign_method_name(sdm_sign_method m); /* "auto", "crossings", "pseudonormal", "winding" */

#ifdef __cplusplus
}
#endif
#endif
