/* The parts of a mesh: which way out each one is, what the exact engine makes of it, and the volume
 * of the solid that they form together.
 *
 * A part is a set of triangles connected by edges; parts that are closed by themselves and share
 * edges, such as a box on a plate with a common edge, are told apart. The orientation follows from
 * the signed volume: positive when the triangles run counter-clockwise seen from outside. exact.h
 * has the rules of the engine; in short, a closed part that is inside out is
 * - turned, if the mesh is closed and the part meets no other part and does not lie in a solid;
 * - a cavity, if it meets no other part and lies in a solid;
 * - not turned, if it meets another part or the mesh is open: it then subtracts its volume from the
 *   parts that it overlaps, and is not solid itself. This may be wanted (a drilled hole), but is
 *   mostly a mistake: a handle whose triangles run the wrong way vanishes. */
#pragma once

#include "sdm/exact.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What the exact engine makes of a part. */
typedef enum sdm_part_state {
    SDM_PART_SOLID = 0,  /* it is solid */
    SDM_PART_CAVITY,     /* it is a cavity of a solid */
    SDM_PART_INSIDE_OUT, /* inside out: it subtracts its volume and is not solid itself */
    SDM_PART_FLAT,       /* closed, but its volume is 0 to rounding: it encloses nothing */
    SDM_PART_OPEN        /* it has open or badly oriented edges */
} sdm_part_state;

/* Of so many parts it is known which of them meet. */
enum { SDM_PART_MEETS = 32 };

typedef struct sdm_part {
    size_t n_tri, first_tri;      /* number of triangles; lowest index of one */
    size_t first_vert, last_vert; /* lowest and highest index of a vertex */
    size_t
        open_edges; /* edges on which not as many triangles run in one direction as in the other */
    double open_at[3]; /* middle of the first of them, mm */
    size_t met; /* pairs of a triangle of this part and a triangle of another that meet or share an
                   edge */
    uint32_t meets; /* bit k: it meets part k, for the first SDM_PART_MEETS parts */
    size_t group; /* lowest index of the parts that such pairs connect with it; a cavity belongs to
                     the part around it */
    size_t crossed;        /* pairs of triangles of this part that meet */
    size_t overlaps;       /* those of them that share no vertex: as sdm_audit.self_intersections */
    double volume, area;   /* signed, mm^3, as given; mm^2 */
    double min[3], max[3]; /* bounding box, mm */
    bool turned;           /* the engine reverses its triangles, alone or with the whole mesh */
    sdm_part_state state;
    /* thickness, mm: of chords through the union, from points of this part's surface against the
     * normal, to walls that are nearly parallel. A fiftieth of the surface may be thinner. Where
     * hardly any walls are parallel, the median of all chords. Where another part takes over,
     * chords go on through it. NaN:
     * the mesh is open, the part is not solid or lies inside others, or it is not one of the first
     * 1000 parts. */
    double thick;
    /* over a fiftieth of the surface of a solid part has the opposite wall in the same place, with
     * nothing between: these chords do not count for the thickness */
    bool doubled;
    /* share of the area, of a solid part that meets itself, that faces the wrong way: an outline
     * that crosses itself, or a wall thicker than the part is wide. What lies behind it counts as
     * outside, also where another part is solid. 0 in an open mesh and for parts after the first
     * 1000 */
    double folded;
    /* share of the area in triangles that pass through others of this part; triangles that touch or
     * share a vertex do not count */
    double crossing;
    /* some bits of `meets`. meets_outside: the two parts meet along a curve that no further part
     * covers. meets_partly: they do not, but further parts cover only pieces of a curve. In the
     * other cases further parts cover all places at which they meet. Only of a closed mesh, and if
     * SDM_AUDIT_MEETINGS asks for it; else 0 */
    uint32_t meets_outside, meets_partly;
} sdm_part;

/* A larger share is a mistake; tubes that bend sharply have a smaller one: of the ducts whose
 * section is free up to 0.0125. */
#define SDM_PART_FOLDED_MIN 0.015
/* A larger share of `crossing` is a mistake, such as the outline of a fillet whose angle is taken
 * for rad. Turns of a spiral that overlap, and bends sharper than their radius, cross in a smaller
 * one: of the ducts up to 0.3. */
#define SDM_PART_CROSSING_MAX 0.4

/* The share of the surface that faces the wrong way or passes through the part itself; 0: both are
 * within the limits above. */
static inline double sdm_part_tangle(const sdm_part *p)
{
    const double most = p->folded > p->crossing ? p->folded : p->crossing;
    return p->folded > SDM_PART_FOLDED_MIN || p->crossing > SDM_PART_CROSSING_MAX ? most : 0;
}

/* Stands for the part of a triangle that belongs to none, because it repeats a vertex. */
#define SDM_NO_PART UINT32_MAX

/* Zero-initialise; sdm_part_audit_dispose() frees. */
typedef struct sdm_part_audit {
    sdm_audit mesh; /* of the whole mesh as given */
    bool turned;    /* the mesh as a whole is inside out, so the engine turns all of it */
    sdm_part *part; /* [n], by their lowest triangle; triangles that repeat a vertex have no part */
    size_t n;
    uint32_t *part_of; /* [mesh.n_tri] index of the part of a triangle, or SDM_NO_PART */
    /* vertices of no triangle, and the indices of the first run of them: with a wrong offset of
     * vertex indices the triangles of a part use vertices of another one and leave out its own */
    size_t unused, unused_first, unused_last;
    size_t inside_out; /* parts of this state */
    size_t bodies;     /* groups of parts with a solid part: what does not meet is counted apart */
    /* volume, mm^3, and area, mm^2, of the union, as the engine measures it: overlaps count once.
     * NaN: not asked for, or the mesh is open. */
    double union_volume, union_area;
} sdm_part_audit;

/* What an audit measures besides edges, contacts and orientations. */
enum {
    SDM_AUDIT_WALLS = 1,   /* sdm_part.thick, doubled, folded; else NaN, false, 0 */
    SDM_AUDIT_UNION = 2,   /* the union, which takes much longer where triangles meet */
    SDM_AUDIT_MEETINGS = 4 /* sdm_part.meets_outside, meets_partly */
};

/* Audits the mesh and its parts. what: a sum of SDM_AUDIT_... In an open mesh, where the engine
 * turns nothing, a part in the box of another closed part is taken for a cavity. stop: its
 * memory_limit and `cancelled` count; NULL: none. Errors as sdm_mesh_audit(), also SDM_E_CANCELLED.
 * [any thread] */
sdm_status sdm_part_audit_make(const sdm_mesh *m, unsigned what, const sdm_exact_opts *stop,
                               sdm_part_audit *out, sdm_error *err);
void sdm_part_audit_dispose(sdm_part_audit *a);

/* Sets out->unused, unused_first and unused_last alone, which takes little time. SDM_E_NOMEM. */
sdm_status sdm_part_audit_unused(const sdm_mesh *m, sdm_part_audit *out, sdm_error *err);

/* Adds the area of triangle t, mm^2, to *area, and to *volume the signed volume, mm^3, of the
 * tetrahedron of the triangle and the point `apex`: over a closed mesh these sum up to its volume.
 */
void sdm_triangle_add(const sdm_mesh *m, size_t t, const double apex[3], double *area,
                      double *volume);

/* *volume (mm^3) and *area (mm^2) = the sums over all triangles of the mesh; overlaps count twice.
 */
void sdm_mesh_sums(const sdm_mesh *m, double *volume, double *area);

/* Volume, mm^3, of the union of part `index` alone: what it winds around more than once counts
 * once. stop: as for the audit. NaN: the part is open, memory is short, it was stopped, or the part
 * is the only one and the audit is without the union. [any thread] */
double sdm_part_filled(const sdm_mesh *m, const sdm_part_audit *a, size_t index,
                       const sdm_exact_opts *stop);

/* The smallest distance, mm, between the surfaces of the group of part `index` and those of all
 * other parts; negative: the group lies inside one of them. NaN: there is no other group, numbers
 * of its vertices lie among those of another one, or the engine refuses one side. [any thread] */
double sdm_part_gap(const sdm_mesh *m, const sdm_part_audit *a, size_t index);

/* Whether the bounding box of part a lies within that of part b. */
bool sdm_part_is_within(const sdm_part *a, const sdm_part *b);

/* Index of the smallest solid part whose box holds that of part `index`; a->n: there is none. */
size_t sdm_part_around(const sdm_part_audit *a, size_t index);

/* Index of the part with the smallest thickness; a->n: none is known. */
size_t sdm_part_audit_thinnest(const sdm_part_audit *a);

/* Its thickness, mm; NaN: none is known. */
double sdm_part_audit_thickness(const sdm_part_audit *a);

/* Is a part so thin that it is missing or broken in the surface of a map with voxels of this size
 * (mm)? A tube along an axis of the grid passes between the voxel centres if it is thinner than
 * sqrt(2) voxels. false if the thickness is NaN. */
static inline bool sdm_too_thin(double thick, double voxel) { return thick < 1.4142 * voxel; }

/* Is it so thin that no grid of the whole shape shows it? Such a grid would have over 2^18 times
 * the voxels. Mostly a length of the shape is in another unit than mm. */
static inline bool sdm_hopelessly_thin(double thick, double voxel) { return 32 * thick < voxel; }

/* Orients the parts of the mesh: reverses those that the engine would turn and those of the state
 * SDM_PART_INSIDE_OUT, so that every closed part is solid or a cavity. *n = number of parts
 * reversed. Errors as sdm_mesh_audit(); the mesh is then unchanged. */
sdm_status sdm_mesh_turn_parts(sdm_mesh *m, size_t *n, sdm_error *err);

#ifdef __cplusplus
}
#endif
