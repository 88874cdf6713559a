/* Computes the base of boxes of voxels, the rounded winding number of the strips: by one evaluation
 * at the centre if the gradient bound covers the box, otherwise the box is split in two. */
#include "row_base.h"

#include <math.h>
#include <stdbool.h>

// error of the winding number allowed for each chain of edges: for boxes, for single voxels
#define COARSE 4e-3
#define FINE 1e-6

/* Voxels lo .. hi (both included) along the three axes of the rows. */
typedef struct box {
    int64_t lo[3], hi[3];
} box;

typedef struct base_job {
    sdm_strips strips;
    const sdm_rows *rows;
    const sdm_grid *grid;
    const sdm_row_tile *tile;
    int32_t *base;
} base_job;

/* May the strip of a boundary edge separate rows of the box? (A strip is parallel to the rows, so
 * it never separates voxels of one row.) vert[2]: ends of the edge. */
static bool strip_meets_box(const base_job *t, const uint32_t vert[2], const box *b)
{
    const double *u = &t->rows->across[3 * (size_t)vert[0]],
                 *v = &t->rows->across[3 * (size_t)vert[1]];
    double half[3], middle[3];
    for (int a = 0; a < 3; a++) {
        const double slack = 1e-6 + 1e-12 * (fabs(u[a]) + fabs(v[a]));
        half[a] = 0.5 * (double)(b->hi[a] - b->lo[a]) + slack;
        middle[a] = 0.5 * (double)(b->hi[a] + b->lo[a]);
        if (u[a] < middle[a] - half[a] && v[a] < middle[a] - half[a]) return false;
        if (a > 0 && u[a] > middle[a] + half[a] && v[a] > middle[a] + half[a]) return false;
    }
    const double dy = v[1] - u[1], dz = v[2] - u[2];
    const double off = dy * (middle[2] - u[2]) - dz * (middle[1] - u[1]);
    return !(fabs(off) > (fabs(dy) * half[2] + fabs(dz) * half[1]) * (1 + 1e-9));
}

static bool box_cut_by_strips(const base_job *t, const box *b)
{
    if (b->lo[1] == b->hi[1] && b->lo[2] == b->hi[2]) return false;
    const sdm_boundary *edges = t->strips.boundary;
    for (size_t i = 0; i + 1 < 2 * edges->n; i++)
        if (edges->chain[i].n == 1 && strip_meets_box(t, edges->chain[i].vert, b)) return true;
    return false;
}

static void box_write(const base_job *t, const box *b, int32_t value)
{
    const int64_t n0 = t->tile->i1 - t->tile->i0, n1 = t->tile->j1 - t->tile->j0;
    for (int64_t k = b->lo[2]; k <= b->hi[2]; k++) {
        for (int64_t j = b->lo[1]; j <= b->hi[1]; j++) {
            int32_t *row = t->base + ((k - t->tile->k0) * n1 + j - t->tile->j0) * n0;
            for (int64_t i = b->lo[0]; i <= b->hi[0]; i++) row[i - t->tile->i0] = value;
        }
    }
}

/* Length (mm) of the longest side of the box among axes `axis` .. 2; *split = its axis. */
static double box_longest_axis(const base_job *t, const box *b, int axis, int *split)
{
    double most = -1;
    for (int a = axis; a < 3; a++) {
        const double length = (double)(b->hi[a] - b->lo[a]) * t->grid->spacing[t->rows->axis[a]];
        if (length > most) {
            most = length;
            *split = a;
        }
    }
    return most;
}

/* Writes the base of the whole box if one evaluation at its centre suffices. *reach: in: skip the
 * evaluation (return false) for boxes with a larger half diagonal; out: radius around the centre in
 * which the evaluated base is valid. */
static bool box_settled(const base_job *t, const box *b, double *reach)
{
    double at[3], index[3], x[3], half2 = 0;
    for (int a = 0; a < 3; a++) {
        const double half =
            0.5 * (double)(b->hi[a] - b->lo[a]) * t->grid->spacing[t->rows->axis[a]];
        at[a] = index[t->rows->axis[a]] = 0.5 * (double)(b->lo[a] + b->hi[a]);
        half2 += half * half;
    }
    // the margin covers directions that are orthonormal to only 1e-6
    const double half = sqrt(half2) * (1 + 1e-5);
    if (half > *reach) return false;
    sdm_grid_world(t->grid, index, x);
    sdm_strips_winding s = sdm_strips_evaluate(&t->strips, x, &at[1], half2 > 0 ? COARSE : FINE);
    if (!(half2 > 0) && fabs(fabs(s.winding - floor(s.winding)) - 0.5) <= s.error + 1e-9)
        s = sdm_strips_evaluate(&t->strips, x, &at[1], 0);
    const double whole = floor(s.winding + 0.5),
                 room = 0.5 - fabs(s.winding - whole) - s.error - 1e-9;
    *reach = room > 0 ? sdm_strips_reach(&s, room) : 0;
    if (half2 > 0 && !(*reach > half)) return false;
    // a winding number of exactly 1/2 means outside
    box_write(t, b, (int32_t)(s.winding + 0.5 > whole ? whole : whole - 1));
    return true;
}

/* Fills the base of box b, recursively. hope: estimated radius in which the base is constant around
 * the centre; boxes with a larger half diagonal are split without an evaluation. */
static void box_settle(const base_job *t, box b, double hope)
{
    int split = 0;
    double length;
    // split between rows first if a strip separates them: such a box can never be settled as a
    // whole
    if (box_cut_by_strips(t, &b))
        length = box_longest_axis(t, &b, 1, &split);
    else if (box_settled(t, &b, &hope))
        return;
    else
        length = box_longest_axis(t, &b, 0, &split);
    // estimate for the children: the radius changes about as much as the centre moves
    hope += 0.3 * length;
    box rest = b;
    b.hi[split] = (b.lo[split] + b.hi[split]) / 2;
    rest.lo[split] = b.hi[split] + 1;
    box_settle(t, b, hope);
    box_settle(t, rest, hope);
}

void sdm_row_base_fill(const sdm_boundary *b, const sdm_rows *rows, const sdm_grid *g,
                       const sdm_row_tile *tile, int32_t *base)
{
    base_job t = {
        .strips = {.boundary = b, .across = rows->across, .orientation = rows->orientation},
        .rows = rows,
        .grid = g,
        .tile = tile,
        .base = base};
    double length2 = 0;
    for (int c = 0; c < 3; c++) {
        for (int k = 0; k < 2; k++)
            t.strips.step[k][c] = g->dir[3 * c + rows->axis[1 + k]] * g->spacing[rows->axis[1 + k]];
        t.strips.d[c] = -g->dir[3 * c + rows->axis[0]];
        length2 += t.strips.d[c] * t.strips.d[c];
    }
    for (int c = 0; c < 3; c++) t.strips.d[c] /= sqrt(length2);
    box_settle(&t,
               (box){{tile->i0, tile->j0, tile->k0}, {tile->i1 - 1, tile->j1 - 1, tile->k1 - 1}},
               INFINITY);
}
