/* Reverse mode, block by block: the adjoint of the map becomes adjoints of where the voxels lie in
   the templates, of stations and of corners. */
#include <string.h>

#include "template_adjoints.h"

enum { BLOCK = SDM_TEMPLATE_STEP, VOXELS = SDM_TEMPLATE_BLOCK_VOXELS, PLANE = BLOCK * BLOCK };

// s->given = the adjoint of the map in a block. Returns whether any of it is not 0.
static bool load_block(const reverse_work *s, const template_block *b)
{
    const size_t nx = (size_t)s->w.grid->n[0], ny = (size_t)s->w.grid->n[1];
    const float *from = s->adjoint + BLOCK * ((b->at[2] * ny + b->at[1]) * nx + b->at[0]);
    int any = 0;
    if (b->n[0] * b->n[1] * b->n[2] < VOXELS) memset(s->given, 0, VOXELS * sizeof *s->given);
    for (size_t z = 0; z < b->n[2]; z++)
        for (size_t y = 0; y < b->n[1]; y++) {
            const float *line = from + (z * ny + y) * nx;
            float *to = s->given + BLOCK * (BLOCK * z + y);
            if (b->n[0] == BLOCK)
                memcpy(to, line, BLOCK * sizeof *to);
            else
                memcpy(to, line, b->n[0] * sizeof *to);
        }
    for (size_t v = 0; v < VOXELS; v++) any |= s->given[v] != 0;
    return any;
}

// Sums of an adjoint over a block, and of its products with the voxel's index in the block.
typedef struct moments {
    double all, by[3];
} moments;

static moments moments_of(const float *v)
{
    float plane[PLANE], plane_z[PLANE], line[BLOCK], line_y[BLOCK], line_z[BLOCK];
    for (size_t i = 0; i < PLANE; i++) {
        const float second = v[PLANE + i], third = v[2 * PLANE + i], fourth = v[3 * PLANE + i];
        plane[i] = v[i] + second + (third + fourth);
        plane_z[i] = second + 2 * third + 3 * fourth;
    }
    for (size_t i = 0; i < BLOCK; i++) {
        const float *p = plane + i, *z = plane_z + i;
        line[i] = p[0] + p[BLOCK] + (p[2 * BLOCK] + p[3 * BLOCK]);
        line_y[i] = p[BLOCK] + 2 * p[2 * BLOCK] + 3 * p[3 * BLOCK];
        line_z[i] = z[0] + z[BLOCK] + (z[2 * BLOCK] + z[3 * BLOCK]);
    }
    return (moments){.all = (double)(line[0] + line[1] + (line[2] + line[3])),
                     .by = {(double)(line[1] + 2 * line[2] + 3 * line[3]),
                            (double)(line_y[0] + line_y[1] + (line_y[2] + line_y[3])),
                            (double)(line_z[0] + line_z[1] + (line_z[2] + line_z[3]))}};
}

// Adds the adjoints s->row of a block to those of a part without a warp.
static void add_affine(const reverse_work *s, size_t c, const template_block *b)
{
    part_adjoint *part = &s->part[c];
    for (int i = 0; i < 3; i++) {
        const moments sum = moments_of(s->row[i]);
        part->from[i] += sum.all;
        for (int a = 0; a < 3; a++)
            part->by[a][i] += sum.by[a] + (double)(BLOCK * b->at[a]) * sum.all;
    }
    for (int i = 0; i < 6 && !s->w.part[c].rigid; i++)
        part->metric[i] += moments_of(s->row[3 + i]).all;
}

// The same for a part with a warp.
static void add_warped(const reverse_work *s, size_t c, const template_block *b)
{
    const part_adjoint *part = &s->part[c];
    const template_network *k = s->w.k;
    const size_t line = k->stations[0], plane = line * k->stations[1],
                 first = plane * b->at[2] + line * b->at[1] + b->at[0];
    s->w.kernels->expand_back(&k->expansion, (const float *const *)s->row, line, plane,
                              part->points + 4 * first,
                              part->station + 8 * (first + plane + line + 1));
}

// Adds s->exact, the adjoint of the distances to part c in a block as far as they are computed
// exactly, after sdm_template_block_slopes().
static void add_exact(reverse_work *s, size_t c, const template_block *b)
{
    const template_work *w = &s->w;
    for (int a = 0; a < (w->part[c].rigid ? 3 : 9); a++)
        for (size_t v = 0; v < VOXELS; v++) s->row[a][v] = s->exact[v] * s->slope[a][v];
    if (w->part[c].warped)
        add_warped(s, c, b);
    else
        add_affine(s, c, b);
    if (w->correction && c == 0)
        w->kernels->correct_back(&w->correction_at, VOXELS, (const float *const *)w->row.u,
                                 s->exact, s->correction);
}

// Adds s->interpolated, the adjoint of the interpolated distances to part c in a block.
static void add_interpolated(const reverse_work *s, size_t c, const template_block *b)
{
    const template_work *w = &s->w;
    const size_t line = 4 * (w->blocks[0] + 1), plane = line * (w->blocks[1] + 1);
    w->kernels->block_back(s->interpolated, line, plane,
                           s->part[c].corner + 4 * sdm_template_corner_at(w, 0, b));
}

// s->exact = the adjoint of the map in the voxels in which part c is the nearest, else 0.
static void mask_block(const reverse_work *s, size_t c)
{
    uint8_t nearest[VOXELS]; // local: stores to other arrays cannot change it, so loops vectorise
    float kept[VOXELS];
    memcpy(nearest, s->nearest, sizeof nearest);
    for (size_t v = 0; v < VOXELS; v++) kept[v] = nearest[v] == (uint8_t)c ? s->given[v] : 0;
    memcpy(s->exact, kept, sizeof kept);
}

// Adds the voxels of a block in which part c is the nearest.
static void block_back(reverse_work *s, size_t c, const template_block *b)
{
    template_work *w = &s->w;
    float far[VOXELS];
    const float share = w->part[c].warped ? sdm_template_far(w, c, b, far) : 0;
    mask_block(s, c);
    if (share == 1) {
        memcpy(s->interpolated, s->exact, VOXELS * sizeof *s->exact);
        add_interpolated(s, c, b);
        return;
    }
    sdm_template_block_slopes(w, c, b, share > 0, &s->rows, &s->far, s->slope);
    if (share > 0) {
        sdm_template_blend_slope_back(w, share, far, w->row.value, s->exact, s->interpolated);
        add_interpolated(s, c, b);
    }
    add_exact(s, c, b);
}

// s->nearest[64] = for each voxel of the block, the number of the part whose distance is smallest.
static void find_nearest(reverse_work *s, const template_block *b)
{
    if (s->w.k->n_parts > 1) {
        sdm_template_values(&s->w, b, s->value, s->nearest);
        return;
    }
    memset(s->nearest, 0, VOXELS);
    s->w.loaded = SIZE_MAX; // the row holds another block
}

void sdm_template_blocks_back(reverse_work *s)
{
    template_work *w = &s->w;
    template_block b = sdm_template_first_block(w);
    do {
        if (!load_block(s, &b)) continue;
        find_nearest(s, &b);
        for (size_t c = 0; c < w->k->n_parts; c++)
            if (memchr(s->nearest, (int)c, VOXELS)) block_back(s, c, &b);
    } while (sdm_template_next_block(w, &b));
}
