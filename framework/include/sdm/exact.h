/* The exact engine: signed distance, mm, NEGATIVE INSIDE, from points and grids to a triangle mesh.
 *
 * A mesh is closed when on every edge as many triangles run in one direction as in the other. A
 * point is inside when its winding number is >= 1 (closed mesh) or > 1/2 (any other mesh). A mesh
 * that overlaps itself therefore counts as the union of the volumes that it encloses, and surface
 * inside the union is ignored. A "part" is a set of triangles connected by edges. In particular:
 * - A part of opposite orientation inside a solid is a cavity; a part of the same orientation
 *   inside a solid changes nothing.
 * - A closed mesh that is inside out as a whole is turned: all its triangles are reversed. So is a
 *   part that meets no other part and has a winding number < 0 around or in it: a body that is
 *   inside out beside other bodies, or within a cavity. Cavities are not turned. Parts that meet
 *   others are never turned: if such a part is inside out, it subtracts its volume from the others
 *   and is not solid itself.
 * - A triangle given twice counts once. Two triangles back to back enclose nothing; if a mesh
 *   consists only of such sheets (zero thickness), no point is inside and distances are to the
 *   sheets.
 * - Parts and gaps of the union thinner than 128 * 2^-52 * (largest abs(coordinate)), the tips of
 *   needles among them, may be kept or lost. The distance is then to the next remaining surface,
 *   and union_error_mm does not cover this. Within the same distance of surface inside the union
 *   either sign may result.
 * - An open, one-sided or inconsistently oriented mesh is never turned. A flat sheet or a Moebius
 *   strip has no inside; the inside of a cup ends about where its opening fills half of the field
 *   of view (solid angle 2 pi), so the sign changes away from the surface, too. */
#ifndef SDM_EXACT_H
#define SDM_EXACT_H

#include "sdm/blocks.h"
#include "sdm/grid.h"
#include "sdm/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum sdm_sign_method {
    /* SDM_SIGN_CROSSINGS on closed meshes, SDM_SIGN_WINDING otherwise */
    SDM_SIGN_AUTO = 0,
    /* integer winding number from signed ray crossings; closed meshes only */
    SDM_SIGN_CROSSINGS,
    /* angle-weighted pseudonormal (Baerentzen and Aanaes 2005); only manifold meshes without
     * overlap and without degenerate triangles */
    SDM_SIGN_PSEUDONORMAL,
    /* generalised winding number > 1/2 (Jacobson et al. 2013); any mesh */
    SDM_SIGN_WINDING
} sdm_sign_method;

/* Zero-initialised: the defaults. */
typedef struct sdm_exact_opts {
    sdm_sign_method sign;
    /* true: distances are to every triangle, also to those inside the union; signs are still those
     * of the union */
    bool keep_overlap;
    int n_threads;       /* 0: the OpenMP default; results are the same bits for every value */
    size_t memory_limit; /* bytes that the engine may allocate besides the output; 0: no limit */
    /* Called repeatedly with `user`, only in the thread that called the library; returns true to
     * stop the call with SDM_E_CANCELLED. May be NULL. */
    bool (*cancelled)(void *user);
    void *user;
} sdm_exact_opts;

typedef struct sdm_exact_report {
    sdm_audit audit;      /* of the given mesh, before any turn */
    sdm_sign_method sign; /* the method in use, not AUTO */
    bool turned;          /* the whole mesh was inside out and was turned */
    bool unioned;         /* surface inside the union was removed */
    size_t n_tri_used;    /* triangles of sdm_exact_surface() */
    /* bound in mm on the error of distances that the removal of inner surface causes; 0 when none
     * was removed. It does not cover thin parts, see the head of this file. */
    double union_error_mm;
    double ms_build;     /* time of sdm_exact_create() in milliseconds */
    size_t parts_turned; /* parts that were inside out and were turned, apart from `turned` */
} sdm_exact_report;

/* A prepared mesh. Immutable after creation: any number of threads may query it. */
typedef struct sdm_exact sdm_exact;

/* Audits the mesh, selects the sign method, removes surface inside the union and builds the search
 * tree. Free *out with sdm_exact_free(). The mesh is copied and may be freed after the call. opts
 * may be NULL: the defaults. Errors: SDM_E_MESH (see sdm_mesh_audit()), SDM_E_ARG (NULL, or a sign
 * method that does not suit the mesh), SDM_E_NOMEM, SDM_E_CANCELLED. */
SDM_API sdm_status sdm_exact_create(const sdm_mesh *mesh, const sdm_exact_opts *opts,
                                    sdm_exact **out, sdm_error *err);
SDM_API void sdm_exact_free(sdm_exact *e);

/* The report of the preparation, owned by e. */
SDM_API const sdm_exact_report *sdm_exact_get_report(const sdm_exact *e);

/* The mesh to which distances are measured (the boundary of the union), owned by e. */
SDM_API const sdm_mesh *sdm_exact_surface(const sdm_exact *e);
/* Array source[sdm_exact_surface()->n_tri], owned by e: triangle t of the surface is triangle
 * source[t] of the given mesh, or a piece of it. */
SDM_API const uint32_t *sdm_exact_source(const sdm_exact *e);

/* values[nz][ny][nx] = signed distance, mm, at the voxel centres; the same bits for any number of
 * threads. SDM_E_ARG (NULL or an invalid grid), SDM_E_NOMEM, SDM_E_CANCELLED. */
SDM_API sdm_status sdm_exact_map(const sdm_exact *e, const sdm_grid *grid, float *values,
                                 sdm_error *err);

/* Negates values[nz][ny][nx] at the voxels inside the mesh, so that unsigned distances (all >= 0)
 * from another source get the signs of the engine. Threads and errors as sdm_exact_map(). */
SDM_API sdm_status sdm_exact_sign(const sdm_exact *e, const sdm_grid *grid, float *values,
                                  sdm_error *err);

/* Result of sdm_exact_certify(). */
typedef struct sdm_sign_certificate {
    sdm_sign_method method; /* sign method of the map */
    /* the independent method used for comparison, a constant string: "crossings along y and z", ...
     */
    const char *compared;
    size_t voxels; /* number of voxels of the map */
    /* number of voxels compared: all, or a sample if the boundary of an open mesh is very long */
    size_t checked;
    size_t wrong; /* number of compared voxels at which the methods disagree */
    /* number of voxels with a winding number < -1/2: there a part of the mesh is inside out */
    size_t below_zero;
    int64_t first_wrong[3]; /* index (i, j, k) of the first wrong voxel; -1 if there is none */
} sdm_sign_certificate;

/* Checks the signs of values[nz][ny][nx], a map made by sdm_exact_map(e, grid), against independent
 * methods: signed crossings along the other axes of the grid (on an open mesh with a term for its
 * boundary), or sums of solid angles at a sample of the voxels. Voxels on the surface to rounding,
 * and those with abs(winding number - 1/2) <= 1e-9, count as right; NaN counts as wrong. Threads
 * and errors as sdm_exact_map(). */
SDM_API sdm_status sdm_exact_certify(const sdm_exact *e, const sdm_grid *grid, const float *values,
                                     sdm_sign_certificate *out, sdm_error *err);

/* Output arrays with one element per voxel, allocated by the caller; NULL: not wanted. The values
 * are those of sdm_exact_point() at the voxel centre, rounded to float. If several triangles are
 * equally near, one of them is taken. */
typedef struct sdm_exact_layers {
    float *values;      /* [nz][ny][nx] signed distance, mm, as by sdm_exact_map() */
    float *closest;     /* [nz][ny][nx][3] nearest surface point, mm */
    float *normal;      /* [nz][ny][nx][3] unit vector along the gradient of the signed distance */
    uint32_t *triangle; /* [nz][ny][nx] nearest triangle, an index in sdm_exact_surface() */
    /* 0: the whole map. > 0: narrow band, mm; the cost is proportional to its width. Where
     * abs(distance) >= band_mm the distance becomes +-band_mm, `triangle` UINT32_MAX, `closest` and
     * `normal` NaN, and derivatives 0. */
    double band_mm;
} sdm_exact_layers;

/* Fills the layers; the same bits for any number of threads. Errors as sdm_exact_map(); SDM_E_ARG
 * also for a negative band_mm. */
SDM_API sdm_status sdm_exact_map_layers(const sdm_exact *e, const sdm_grid *grid,
                                        const sdm_exact_layers *layers, sdm_error *err);

/* *out = the narrow band of the map in blocks of 8 x 8 x 8 voxels: its values and signs are those
 * of sdm_exact_map_layers() with this band_mm (mm, > 0, rounded to float), the same bits; voxels
 * far from the surface cost neither time nor memory. Only for closed meshes with the sign method
 * crossings, whose sign changes at the surface only. Free *out with sdm_blocks_dispose(). The same
 * bits for any number of threads. SDM_E_ARG (NULL, an invalid grid or band, another sign method),
 * SDM_E_NOMEM, SDM_E_CANCELLED. */
SDM_API sdm_status sdm_exact_map_blocks(const sdm_exact *e, const sdm_grid *grid, double band_mm,
                                        sdm_blocks *out, sdm_error *err);

/* Derivatives of the map with respect to n parameters that move the vertices of the given mesh.
 * velocity[n][n_vert][3] = d(vertex)/d(parameter), mm per unit of the parameter;
 * derivative[n][nz][ny][nx] = d(distance)/d(parameter) in the same unit. With x* the nearest
 * surface point, g the gradient of the signed distance and v the velocity, interpolated linearly on
 * the triangle of x*, the derivative is -g . v(x*). Where several sheets of a union cross at x*, g
 * is split into multiples of their normals and each sheet moves its own share. On the medial axis,
 * where several surface points are equally near and the distance has no derivative, it is the
 * one-sided derivative for the point taken. Where the sign changes away from the surface (open
 * meshes), that change counts as fixed. layers may be NULL. Threads and errors as
 * sdm_exact_map_layers(). */
SDM_API sdm_status sdm_exact_map_derivative(const sdm_exact *e, const sdm_grid *grid,
                                            const double *velocity, size_t n,
                                            const sdm_exact_layers *layers, float *derivative,
                                            sdm_error *err);

/* Returns the signed distance, mm, at the point x; every output pointer may be NULL. closest[3] =
 * nearest surface point; normal[3] = unit vector along the gradient of the signed distance (for a
 * point on the surface, the outward normal of the nearest triangle); *triangle = nearest triangle,
 * an index in sdm_exact_surface(). If a coordinate is not finite or abs(coordinate) > 1e150, all
 * results are NaN and *triangle has no meaning. [any thread] */
SDM_API double sdm_exact_point(const sdm_exact *e, const double x[3], double closest[3],
                               double normal[3], uint32_t *triangle);

/* Output arrays of sdm_exact_points() with one element per point, allocated by the caller; NULL:
 * not wanted. */
typedef struct sdm_exact_at {
    double *distance;   /* [n] signed distance, mm */
    double *gradient;   /* [n][3] unit vector along the gradient of the signed distance */
    double *closest;    /* [n][3] nearest surface point, mm */
    uint32_t *triangle; /* [n] nearest triangle, an index in sdm_exact_surface() */
} sdm_exact_at;

/* Answers of sdm_exact_point(), the same bits, for the points x[n][3], mm, in any order: many
 * points at once are an order of magnitude cheaper. The points are sorted along a space-filling
 * curve and computed in blocks of neighbours on all threads (n_threads of the options). An answer
 * is a function of its own point: the distance is the smallest one in double precision over all
 * faces, edges and corners, so it depends neither on the other points, nor on their order, the
 * number of threads or the instruction set. At a point that is the centre of a voxel, bit for bit,
 * the distance rounded to float is the value of sdm_exact_map(). A point with a coordinate that is
 * not finite or above 1e150 in size has the answer NaN, and UINT32_MAX for the triangle. Memory: 16
 * bytes per point, at most 64 MiB, and a few bytes per triangle and thread. SDM_E_ARG (NULL),
 * SDM_E_NOMEM, SDM_E_CANCELLED; the output is incomplete then. [any thread] */
SDM_API sdm_status sdm_exact_points(const sdm_exact *e, const double *x, size_t n,
                                    const sdm_exact_at *out, sdm_error *err);

/* Returns the absolute value of sdm_exact_point(), the same bits. Much cheaper on open meshes,
 * where the sign is a sum over the boundary. NaN as above. [any thread] */
SDM_API double sdm_exact_distance(const sdm_exact *e, const double x[3]);

/* Name of the sign method: "auto", "crossings", "pseudonormal" or "winding"; "unknown" for any
 * other value. [any thread] */
SDM_API const char *sdm_sign_method_name(sdm_sign_method m);

#ifdef __cplusplus
}
#endif
#endif
