/* Inner loops for the derivatives of the `template` network; part of template_kernels_simd.h, whose
   definitions they use. */

typedef float quad __attribute__((vector_size(16), aligned(4)));

/* A point in its cell: the interpolated node (distance, gradient) and its derivatives by the
   fractions along x, y, z and along two of them, two quads in each row: value and x, y and z,
   xy and xz, yz and 0. Rows of VW points. */
typedef struct cell_sums {
    float rows[4][VW][8];
} cell_sums;

static inline void set_pair(float *row, quad a, quad b)
{
    memcpy(row, &a, sizeof a);
    memcpy(row + 4, &b, sizeof b);
}

static inline void sum_corners(const float *const corner[4], const place *p, int i, cell_sums *out)
{
    const ptrdiff_t at = 2 * (ptrdiff_t)p->node[i];
    const float t[3] = {p->t[0][i], p->t[1][i], p->t[2][i]};
    quad r[2], y[2], z[2], yz[2]; // at both ends along x
    EACH(end, 2)
    {
        quad node[4], dz[2];
        EACH(k, 4) node[k] = *(const quad *)(corner[k] + at + 4 * end);
        EACH(k, 2) dz[k] = node[k + 2] - node[k];
        const quad low = node[0] + t[2] * dz[0], high = node[1] + t[2] * dz[1];
        y[end] = high - low;
        yz[end] = dz[1] - dz[0];
        r[end] = low + t[1] * y[end];
        z[end] = dz[0] + t[1] * yz[end];
    }
    const quad x = r[1] - r[0], xy = y[1] - y[0], xz = z[1] - z[0];
    set_pair(out->rows[0][i], r[0] + t[0] * x, x);
    set_pair(out->rows[1][i], y[0] + t[0] * xy, z[0] + t[0] * xz);
    set_pair(out->rows[2][i], xy, xz);
    set_pair(out->rows[3][i], yz[0] + t[0] * (yz[1] - yz[0]), (quad){0});
}

// first[4], second[4] = the elements of the first and second quads, each for VW points
static inline void split_rows(const float (*rows)[8], vec first[4], vec second[4])
{
    vec in[2][4];
    EACH(i, 4)
    {
        vec ends[2];
        load_ends(rows, VW, i, ends);
        in[0][i] = ends[0], in[1][i] = ends[1];
    }
    EACH(h, 2)
    {
        const vec *q = in[h];
        vec *out = h ? second : first;
        const vec a = interleave_low(q[0], q[1]), b = interleave_low(q[2], q[3]),
                  c = interleave_high(q[0], q[1]), d = interleave_high(q[2], q[3]);
        out[0] = low_pairs(a, b), out[1] = high_pairs(a, b);
        out[2] = low_pairs(c, d), out[3] = high_pairs(c, d);
    }
}

// How fast the fraction along axis a changes with the index in `near`: 0 where it is clamped.
static inline vec rate_of(const cells *c, const float *const *u, int a, vec last, size_t v)
{
    const vec x = load(u[a] + v) * c->scale + c->offset[a];
    return (vec)((veci)c->scale & (x > splat(0)) & (x < last));
}

static void lookup_slopes(const template_level *l, size_t n, const float *const *u,
                          const template_slope_rows *out)
{
    const ptrdiff_t line = 4 * (ptrdiff_t)l->n[0], plane = line * l->n[1];
    const float *const corner[4] = {l->nodes, l->nodes + line, l->nodes + plane,
                                    l->nodes + plane + line};
    const cells c = cells_of(l->n, l->scale, l->offset);
    const vec half = splat(l->half);
    for (size_t v = 0; v < n; v += VW) {
        place p;
        cell_sums sums;
        locate(&c, u, v, 2, &p);
        for (int i = 0; i < VW; i++) sum_corners(corner, &p, i, &sums);
        vec q[4], by[3][4], xy[4], xz[4], yz[4], none[4], bend[3], slope[3], rate[3];
        split_rows((const float(*)[8])sums.rows[0], q, by[0]);
        split_rows((const float(*)[8])sums.rows[1], by[1], by[2]);
        split_rows((const float(*)[8])sums.rows[2], xy, xz);
        split_rows((const float(*)[8])sums.rows[3], yz, none);
        EACH(a, 3)
        {
            const vec t = load(p.t[a]);
            bend[a] = t * (1 - t), slope[a] = 1 - 2 * t;
            rate[a] = rate_of(&c, u, a, splat((float)(l->n[a] - 1)), v);
        }
        store(out->f + v,
              q[0] - half * (bend[0] * by[0][1] + bend[1] * by[1][2] + bend[2] * by[2][3]));
        const vec kinks[3] = {slope[0] * by[0][1] + bend[1] * xy[2] + bend[2] * xz[3],
                              bend[0] * xy[1] + slope[1] * by[1][2] + bend[2] * yz[3],
                              bend[0] * xz[1] + bend[1] * yz[2] + slope[2] * by[2][3]};
        EACH(a, 3)
        {
            store(out->g[a] + v, q[a + 1]);
            store(out->df[a] + v, rate[a] * (by[a][0] - half * kinks[a]));
            EACH(b, 3) store(out->dg[a][b] + v, rate[a] * by[a][b + 1]);
        }
    }
}

// The compiler makes vectors of this loop, as of normalise().
static void factor_slopes(size_t n, const float *const *metric, const template_slope_rows *r)
{
    const float e = 1e-3f;
    for (size_t i = 0; i < n; i++) {
        const float x = r->g[0][i], y = r->g[1][i], z = r->g[2][i];
        const float xx = metric[0][i], yy = metric[1][i], zz = metric[2][i], yz = metric[3][i],
                    xz = metric[4][i], xy = metric[5][i];
        // factor = sqrt(p / q), p = g^T g + e, q = g^T G g + e t
        const float gx = xx * x + xy * y + xz * z, gy = xy * x + yy * y + yz * z,
                    gz = xz * x + yz * y + zz * z;
        const float p = x * x + y * y + z * z + e,
                    q = x * gx + y * gy + z * gz + e * ((xx + yy + zz) * (1.0f / 3));
        const float per_p = 1 / p, per_q = 1 / q, factor = sqrtf(p / q), h = -0.5f * factor * per_q;
        // the derivative of the factor by g
        const float fx = factor * (x * per_p - gx * per_q), fy = factor * (y * per_p - gy * per_q),
                    fz = factor * (z * per_p - gz * per_q);
        r->factor[i] = factor;
        r->by_u[0][i] = fx * r->dg[0][0][i] + fy * r->dg[0][1][i] + fz * r->dg[0][2][i];
        r->by_u[1][i] = fx * r->dg[1][0][i] + fy * r->dg[1][1][i] + fz * r->dg[1][2][i];
        r->by_u[2][i] = fx * r->dg[2][0][i] + fy * r->dg[2][1][i] + fz * r->dg[2][2][i];
        r->by_metric[0][i] = h * (x * x + e * (1.0f / 3));
        r->by_metric[1][i] = h * (y * y + e * (1.0f / 3));
        r->by_metric[2][i] = h * (z * z + e * (1.0f / 3));
        r->by_metric[3][i] = 2 * h * (y * z);
        r->by_metric[4][i] = 2 * h * (x * z);
        r->by_metric[5][i] = 2 * h * (x * y);
    }
}

static void correct_slopes(const template_correction *k, size_t n, const float *const *u,
                           float *const *out)
{
    const ptrdiff_t line = k->n[0], plane = line * k->n[1];
    const float *const corner[4] = {k->map, k->map + line, k->map + plane, k->map + plane + line};
    const cells c = cells_of(k->n, k->scale, k->offset);
    for (size_t v = 0; v < n; v += VW) {
        place p;
        locate(&c, u, v, 1, &p);
        const vec x = load(p.t[0]), y = load(p.t[1]), z = load(p.t[2]);
        vec low[2], dy[2], dz[2]; // the points two by two, both ends along x
        EACH(h, 2)
        {
            const vec yy = h ? interleave_high(y, y) : interleave_low(y, y),
                      zz = h ? interleave_high(z, z) : interleave_low(z, z);
            vec m[4];
            EACH(i, 4) m[i] = neighbours(corner[i], p.node, h);
            const vec first = mix(m[0], m[2], zz), second = mix(m[1], m[3], zz);
            low[h] = mix(first, second, yy);
            dy[h] = second - first;
            dz[h] = mix(m[2] - m[0], m[3] - m[1], yy);
        }
        const vec slope[3] = {odd(low[0], low[1]) - even(low[0], low[1]),
                              mix(even(dy[0], dy[1]), odd(dy[0], dy[1]), x),
                              mix(even(dz[0], dz[1]), odd(dz[0], dz[1]), x)};
        EACH(a, 3)
        store(out[a] + v, rate_of(&c, u, a, splat((float)(k->n[a] - 1)), v) * slope[a]);
    }
}

static void sum_products(size_t n, const float *const *a, const float *const *b, float *sum)
{
    for (size_t i = 0; i < 64; i += VW) {
        vec total = load(a[0] + i) * load(b[0] + i);
        for (size_t k = 1; k < n; k++) total += load(a[k] + i) * load(b[k] + i);
        store(sum + i, total);
    }
}
