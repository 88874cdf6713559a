/* Blocks that are interpolated between their corners: how far they must be from the surface. */
#include <math.h>

#include "template_work.h"

enum { VOXELS = SDM_TEMPLATE_BLOCK_VOXELS };

size_t sdm_template_corner_at(const template_work *w, size_t c, const template_block *b)
{
    const size_t *n = w->blocks;
    return ((c * (n[2] + 1) + b->at[2]) * (n[1] + 1) + b->at[1]) * (n[0] + 1) + b->at[0];
}

size_t sdm_template_corner_step(const template_work *w, size_t i)
{
    const size_t line = w->blocks[0] + 1;
    return (i & 1) + (i >> 1 & 1) * line + (i >> 2) * line * (w->blocks[1] + 1);
}

float sdm_template_interpolate(const template_work *w, const float *corner, float *value)
{
    const size_t line = 4 * (w->blocks[0] + 1), plane = line * (w->blocks[1] + 1);
    return w->kernels->block(corner, line, plane, value);
}

// 1 / (longest edge of a voxel, mm)
static float voxels_per_mm(const template_work *w)
{
    const double *s = w->grid->spacing;
    return (float)(1 / fmax(s[0], fmax(s[1], s[2])));
}

// The voxel of a block in which a distance is smallest.
static size_t least_voxel(const float *value)
{
    size_t least = 0;
    for (size_t v = 1; v < VOXELS; v++)
        if (fabsf(value[v]) < fabsf(value[least])) least = v;
    return least;
}

float sdm_template_far(const template_work *w, size_t c, const template_block *b, float *value)
{
    const part_state *part = &w->part[c];
    if (!part->warped && !(part->rigid && !sdm_template_is_within(w, c, b))) return 0;
    const float *corner = w->corner + 4 * sdm_template_corner_at(w, c, b);
    // the first voxel of the block is its first corner
    if (part->warped && fabsf(*corner) * voxels_per_mm(w) <= SDM_TEMPLATE_FAR_VOXELS) return 0;
    const float smallest = sdm_template_interpolate(w, corner, value);
    if (isnan(value[0])) return 0; // every value is a sum with terms of all corners
    if (part->rigid) return 1;
    const float from = SDM_TEMPLATE_FAR_VOXELS, least = smallest * voxels_per_mm(w);
    return least <= from ? 0 : least >= from + 1 ? 1 : least - from;
}

void sdm_template_blend(float share, const float *far, const float *exact, float *value)
{
    for (size_t v = 0; v < VOXELS; v++) value[v] = exact[v] + share * (far[v] - exact[v]);
}

void sdm_template_blend_slope(const template_work *w, float share, const float *far,
                              const float *exact, const float *far_slope, float *slope)
{
    const size_t least = least_voxel(far);
    const float share_slope = copysignf(voxels_per_mm(w), far[least]) * far_slope[least];
    for (size_t v = 0; v < VOXELS; v++)
        slope[v] += share * (far_slope[v] - slope[v]) + share_slope * (far[v] - exact[v]);
}

void sdm_template_blend_slope_back(const template_work *w, float share, const float *far,
                                   const float *exact, float *adjoint, float *far_adjoint)
{
    const size_t least = least_voxel(far);
    double by_share = 0;
    for (size_t v = 0; v < VOXELS; v++) {
        by_share += (double)(adjoint[v] * (far[v] - exact[v]));
        far_adjoint[v] = share * adjoint[v];
        adjoint[v] -= far_adjoint[v];
    }
    far_adjoint[least] += copysignf(voxels_per_mm(w), far[least]) * (float)by_share;
}
