/* Finds the side of a surface on which the regions of its edges and corners lie. */
#include "feature_side.h"

#include <math.h>
#include <string.h>

#include "sdm/internal/heap.h"
#include "sdm/internal/vec3.h"

// Height over longest edge below which the normal of a face is not used.
#define NARROW 1e-6
// Sine of an angle below which two directions count as one.
#define FLAT 1e-3

// Smallest height of an edge over a plane through its end, relative to its length and the number of
// faces at the corner, that is not due to rounding.
#define LOW 1e-9
// Value of sdm_features.side of an edge of which only one face is known so far.
#define HALF_KNOWN 3

/* What is known of a corner. `axis`: sum of the unit normals of its faces; lowest, highest: range
   of the heights of its edges along the axis; area: twice the signed area of the polygon in which
   the faces meet a plane perpendicular to the axis. */
typedef struct corner_state {
    double axis[3], lowest, highest, area;
    bool unknown;
} corner_state;

/* Unit vectors along edges 0, 1 and 2 of a triangle, in its orientation. */
static void edge_directions(const sdm_frame *f, double out[3][3])
{
    const int turn = (int)f->rotation;
    const double x[3] = {1, f->e1x, f->e2x}, y[3] = {0, f->e1y, f->e2y};
    for (int k = 0; k < 3; k++) // the frame counts edges from the longest one
        for (int i = 0; i < 3; i++) out[(k + turn) % 3][i] = x[k] * f->u[i] + y[k] * f->v[i];
}

/* Side of the region of an edge between two faces; u, v: unit vectors along the edge in the
   orientations of the faces. */
static int edge_side(const sdm_frame *f, const double u[3], const sdm_frame *g, const double v[3])
{
    // heights above one face of the direction from the edge into the other one
    double into_f[3], into_g[3];
    v3_cross(f->n, u, into_f);
    v3_cross(g->n, v, into_g);
    const double over_f = v3_dot(f->n, into_g), over_g = v3_dot(g->n, into_f);
    if (fabs(over_f) < FLAT && fabs(over_g) < FLAT && v3_dot(f->n, g->n) > 0)
        return SDM_SIDE_OF_OWNER;
    if (over_f < -FLAT / 2 && over_g < -FLAT / 2) return SDM_SIDE_OUTSIDE;
    return over_f > FLAT / 2 && over_g > FLAT / 2 ? SDM_SIDE_INSIDE : SDM_SIDE_UNKNOWN;
}

/* Adds the edges of the face in this slot. other[edge - edge_base]: 3 * slot + number of the edge
   in its first face. */
static void face_add_edges(const sdm_nearest *n, uint32_t slot, bool narrow, uint32_t *other,
                           int8_t *sides, const double along[3][3])
{
    const sdm_features *f = &n->features;
    for (uint32_t k = 0; k < 3; k++) {
        const uint32_t edge = f->of_slot[slot][k];
        int8_t *side = &sides[edge];
        uint32_t *first = &other[edge - f->edge_base];
        if (*first == SDM_NONE) {
            *side = narrow ? SDM_SIDE_UNKNOWN : HALF_KNOWN;
            *first = 3 * slot + k;
            continue;
        }
        double before[3][3];
        const sdm_frame *g = &n->frames[*first / 3];
        edge_directions(g, before);
        // a third face finds the side known already
        *side = *side == HALF_KNOWN && !narrow
                    ? (int8_t)edge_side(g, before[*first % 3], &n->frames[slot], along[k])
                    : SDM_SIDE_UNKNOWN;
    }
}

/* Adds the angle of a face at a corner, between the unit vectors a and b along its edges,
   counter-clockwise seen from outside. */
static void corner_add(corner_state *c, const double a[3], const double b[3])
{
    double normal[3];
    const double height_a = v3_dot(a, c->axis), height_b = v3_dot(b, c->axis);
    c->lowest = height_a < c->lowest ? height_a : c->lowest;
    c->highest = height_a > c->highest ? height_a : c->highest;
    v3_cross(a, b, normal);
    c->area += v3_dot(normal, c->axis) / (height_a * height_b);
}

/* The region of a corner is a convex cone that meets the faces at its tip only. If all edges lie on
   one side of a plane through the corner, the region lies on the other side: outside of the solid
   if the edges enclose a part of the solid (their polygon runs counter-clockwise), inside if they
   enclose a part of the space around it. */
static int corner_side(const corner_state *c)
{
    const bool below = c->highest<-LOW, above = c->lowest> LOW;
    if (c->unknown || !(below || above) || c->area == 0) return SDM_SIDE_UNKNOWN;
    return (c->area > 0) == below ? SDM_SIDE_OUTSIDE : SDM_SIDE_INSIDE;
}

sdm_status sdm_feature_sides_find(const sdm_nearest *n, int8_t *side, sdm_error *err)
{
    const sdm_features *f = &n->features;
    const uint32_t n_slot = f->edge_base, n_edge = f->corner_base - n_slot,
                   n_corner = f->end - f->corner_base;
    corner_state *corner = NULL;
    uint32_t *other = NULL;
    sdm_status s = sdm_alloc_unset((void **)&other, n_edge, sizeof *other, "sides of edges", err);
    if (!s)
        s = sdm_alloc_unset((void **)&corner, n_corner, sizeof *corner, "sides of corners", err);
    if (s) {
        sdm_free(other);
        return s;
    }
    memset(other, 0xff, n_edge * sizeof *other);
    for (uint32_t i = 0; i < n_corner; i++)
        corner[i] = (corner_state){.lowest = INFINITY, .highest = -INFINITY};
    // faces and edges; axes of the corners
    for (uint32_t slot = 0; slot < n_slot; slot++) {
        const sdm_frame *frame = &n->frames[slot];
        const bool narrow =
            frame->flat != 0 || !(sdm_frame_height(frame) > NARROW * frame->half[0]);
        double along[3][3];
        side[slot] = narrow ? SDM_SIDE_UNKNOWN : SDM_SIDE_OF_OWNER;
        edge_directions(frame, along);
        face_add_edges(n, slot, narrow, other, side, (const double(*)[3])along);
        for (int k = 0; k < 3; k++) {
            corner_state *c = &corner[f->of_slot[slot][3 + k] - f->corner_base];
            c->unknown |= narrow;
            for (int i = 0; i < 3; i++) c->axis[i] += frame->n[i];
        }
    }
    for (uint32_t i = n_slot; i < f->corner_base; i++)
        if (side[i] == HALF_KNOWN) side[i] = SDM_SIDE_UNKNOWN;
    // corners; that of an edge with unknown side is not closed for certain
    for (uint32_t slot = 0; slot < n_slot; slot++) {
        const uint32_t *of = f->of_slot[slot];
        double along[3][3];
        edge_directions(&n->frames[slot], along);
        for (int k = 0; k < 3; k++) {
            const double *in = along[(k + 2) % 3], back[3] = {-in[0], -in[1], -in[2]};
            corner_state *c = &corner[of[3 + k] - f->corner_base];
            corner_add(c, along[k], back);
            c->unknown |= !side[of[k]] || !side[of[(k + 2) % 3]];
        }
    }
    for (uint32_t i = 0; i < n_corner; i++)
        side[f->corner_base + i] = (int8_t)corner_side(&corner[i]);
    sdm_free(corner);
    sdm_free(other);
    return SDM_OK;
}
