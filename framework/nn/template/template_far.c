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

void sdm_template_interpolate(const template_work *w, const float *corner, float *value)
{
    const size_t line = 4 * (w->blocks[0] + 1), plane = line * (w->blocks[1] + 1);
    sdm_template_kernels()->block(corner, line, plane, value);
}

// Share of the interpolated distance in a voxel for which it is `value`; voxels: 1 / (edge of a
// voxel, mm).
static float share_of(float value, float voxels)
{
    const float share = fabsf(value) * voxels - SDM_TEMPLATE_FAR_VOXELS;
    return share > 0 ? share < 1 ? share : 1 : 0;
}

// 1 / (longest edge of a voxel, mm)
static float voxels_per_mm(const template_work *w)
{
    const double *s = w->grid->spacing;
    return (float)(1 / fmax(s[0], fmax(s[1], s[2])));
}

template_way sdm_template_far(const template_work *w, size_t c, const template_block *b,
                              float *value)
{
    const part_state *part = &w->part[c];
    if (!part->warped && !(part->rigid && sdm_template_place(w, c, b) != TEMPLATE_WITHIN))
        return TEMPLATE_EXACT;
    sdm_template_interpolate(w, w->corner + 4 * sdm_template_corner_at(w, c, b), value);
    if (isnan(value[0])) return TEMPLATE_EXACT; // every value is a sum with terms of all corners
    if (part->rigid) return TEMPLATE_INTERPOLATED;
    const float voxels = voxels_per_mm(w), from = SDM_TEMPLATE_FAR_VOXELS, to = from + 1;
    int32_t begun = 0, full = 0; // of the type of the comparisons, so that the loop is vectorised
    for (size_t v = 0; v < VOXELS; v++) {
        const float distance = fabsf(value[v]) * voxels;
        begun += distance > from;
        full += distance >= to;
    }
    return full == VOXELS ? TEMPLATE_INTERPOLATED : begun ? TEMPLATE_BLENDED : TEMPLATE_EXACT;
}

void sdm_template_blend(const template_work *w, const float *far, const float *exact, float *value)
{
    const float voxels = voxels_per_mm(w);
    for (size_t v = 0; v < VOXELS; v++)
        value[v] = exact[v] + share_of(far[v], voxels) * (far[v] - exact[v]);
}

void sdm_template_blend_slope(const template_work *w, const float *far, const float *exact,
                              const float *far_slope, float *slope)
{
    const float voxels = voxels_per_mm(w);
    for (size_t v = 0; v < VOXELS; v++) {
        const float share = share_of(far[v], voxels), change = far_slope[v] - slope[v];
        slope[v] += share * change;
        if (share > 0 && share < 1)
            slope[v] += copysignf(voxels, far[v]) * far_slope[v] * (far[v] - exact[v]);
    }
}
