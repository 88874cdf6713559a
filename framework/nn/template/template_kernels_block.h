/* The kernels of blocks far from the surface: their corners at the stations of a warp, and the
   interpolation between corners. Included by template_kernels_simd.h. */
#pragma once

static void separate(size_t n, const float *from, size_t stride, float *const *to)
{
    typedef float four __attribute__((vector_size(16), aligned(4)));
    size_t i = 0;
    for (; i + 4 <= n; i += 4, from += 4 * stride) {
        const four a = *(const four *)from, b = *(const four *)(from + stride),
                   c = *(const four *)(from + 2 * stride), d = *(const four *)(from + 3 * stride);
        const four ab[2] = {__builtin_shufflevector(a, b, 0, 4, 1, 5),
                            __builtin_shufflevector(a, b, 2, 6, 3, 7)},
                   cd[2] = {__builtin_shufflevector(c, d, 0, 4, 1, 5),
                            __builtin_shufflevector(c, d, 2, 6, 3, 7)};
        EACH(h, 2)
        {
            *(four *)(to[2 * h] + i) = __builtin_shufflevector(ab[h], cd[h], 0, 1, 4, 5);
            *(four *)(to[2 * h + 1] + i) = __builtin_shufflevector(ab[h], cd[h], 2, 3, 6, 7);
        }
    }
    for (; i < n; i++, from += stride) EACH(c, 4) to[c][i] = from[c];
}

static void corners(const template_samples *p, size_t first, size_t n, const size_t stride[3],
                    float spacing, float *out)
{
    const vec half = splat(0.5f), h = splat(spacing);
    for (size_t i = 0; i < n; i += VW, out += 4 * VW) {
        const size_t at = first + i;
        const vec f = load(p->f + at), s = load(p->s + at), scale = h * s;
        vec row[4] = {f * s + load(p->r + at)};
        EACH(a, 3)
        {
            const size_t above = at + stride[a], below = at - stride[a];
            vec change = splat(0);
            EACH(c, 3)
            change += load(p->g[c] + at) * (load(p->u[c] + above) - load(p->u[c] + below));
            row[1 + a] = half * (scale * change + (f * (load(p->s + above) - load(p->s + below)) +
                                                   (load(p->r + above) - load(p->r + below))));
        }
        store_points(row, n - i < VW ? n - i : VW, 4, out);
    }
}

/* Cubic interpolation in a block: linear interpolation along the three axes, plus for each axis the
   cubic correction along the four edges parallel to it, interpolated linearly between them. The
   four floats of a quad are edges along z, then voxels along y, then voxels along x; a vector of
   eight floats holds two planes of voxels. Letters: l linear, c correction, s slope; p and q are
   the slopes at both ends less the slope of the straight line. */

// Weights of the voxels of a block along an axis: t, t (1 - t)^2, t^2 (1 - t).
static const float WEIGHTS[3][4] = {
    {0, 0.25f, 0.5f, 0.75f}, {0, 0.140625f, 0.125f, 0.046875f}, {0, 0.046875f, 0.125f, 0.140625f}};

// The four edges along z of a block at one end: distance, and slopes by x, y, z.
static inline void load_corners(const float *corner, size_t line, vec out[4])
{
    const vec a = repeat_four(corner), b = repeat_four(corner + 4), c = repeat_four(corner + line),
              d = repeat_four(corner + line + 4);
    const vec ab[2] = {interleave_low(a, b), interleave_high(a, b)},
              cd[2] = {interleave_low(c, d), interleave_high(c, d)};
    EACH(i, 2) out[2 * i] = low_pairs(ab[i], cd[i]), out[2 * i + 1] = high_pairs(ab[i], cd[i]);
}

static float block(const float *corner, size_t line, size_t plane, float *value)
{
    const veci magnitude = splat_int(INT32_MAX);
    vec low[4], high[4], change[3], w[3], least = splat(INFINITY);
    load_corners(corner, line, low);
    load_corners(corner + plane, line, high);
    EACH(i, 3) change[i] = high[i] - low[i], w[i] = repeat_four(WEIGHTS[i]);
    const vec p = low[3] - change[0], q = high[3] - change[0];
    for (int z = 0; z < 4; z += VW / 4) {
        vec t[3]; // weights of the planes
#if VW == 8
        EACH(i, 3)
        t[i] = z ? SHUFFLE_PLANES(w[i], 2) : SHUFFLE_PLANES(w[i], 0);
#else
        EACH(i, 3) t[i] = splat(WEIGHTS[i][z]);
#endif
        const vec lz = low[0] + t[0] * change[0], cz = t[1] * p - t[2] * q,
                  sx = low[1] + t[0] * change[1], sy = low[2] + t[0] * change[2];
        vec l[2], c[2], s[2]; // at both ends along x, for the four voxels along y
        EACH(i, 2)
        {
            const vec l0 = spread(lz, i), dl = spread(lz, i + 2) - l0, c0 = spread(cz, i),
                      s0 = spread(sx, i);
            l[i] = l0 + w[0] * dl;
            c[i] = c0 + w[0] * (spread(cz, i + 2) - c0) + w[1] * (spread(sy, i) - dl) -
                   w[2] * (spread(sy, i + 2) - dl);
            s[i] = s0 + w[0] * (spread(sx, i + 2) - s0);
        }
        const vec dl = l[1] - l[0], first = l[0] + c[0], slope = dl + (c[1] - c[0]), px = s[0] - dl,
                  qx = s[1] - dl;
        EACH(y, 4)
        {
            const vec v = spread(first, y) + w[0] * spread(slope, y) + w[1] * spread(px, y) -
                          w[2] * spread(qx, y);
            store_planes(value + 16 * z + 4 * y, v);
            least = MIN_VEC((vec)((veci)v & magnitude), least);
        }
    }
    least = MIN_VEC(least, high_pairs(least, least));
    least = MIN_VEC(least, spread(least, 1));
    return VW == 8 && least[VW - 4] < least[0] ? least[VW - 4] : least[0];
}
