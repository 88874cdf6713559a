/* Inner loops for the derivatives of the `template` network, in forward and in reverse mode; part
   of template_kernels_simd.h, whose definitions they use. */

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

static inline vec root_of(vec v)
{
    vec root;
    EACH(l, VW) root[l] = sqrtf(v[l]);
    return root;
}

static void factor_slopes(size_t n, const float *const *metric, const template_slope_rows *r)
{
    const vec e = splat(1e-3f), third = splat(1.0f / 3);
    for (size_t v = 0; v < n; v += VW) {
        const vec x = load(r->g[0] + v), y = load(r->g[1] + v), z = load(r->g[2] + v);
        const vec xx = load(metric[0] + v), yy = load(metric[1] + v), zz = load(metric[2] + v),
                  yz = load(metric[3] + v), xz = load(metric[4] + v), xy = load(metric[5] + v);
        // factor = sqrt(p / q), p = g^T g + e, q = g^T G g + e t
        const vec gx = xx * x + xy * y + xz * z, gy = xy * x + yy * y + yz * z,
                  gz = xz * x + yz * y + zz * z;
        const vec p = x * x + y * y + z * z + e,
                  q = x * gx + y * gy + z * gz + e * ((xx + yy + zz) * third);
        const vec per_p = 1 / p, per_q = 1 / q, factor = root_of(p / q), h = -0.5f * factor * per_q;
        // the derivative of the factor by g
        const vec fx = factor * (x * per_p - gx * per_q), fy = factor * (y * per_p - gy * per_q),
                  fz = factor * (z * per_p - gz * per_q);
        store(r->factor + v, factor);
        EACH(a, 3)
        store(r->by_u[a] + v,
              fx * load(r->dg[a][0] + v) + fy * load(r->dg[a][1] + v) + fz * load(r->dg[a][2] + v));
        store(r->by_metric[0] + v, h * (x * x + e * third));
        store(r->by_metric[1] + v, h * (y * y + e * third));
        store(r->by_metric[2] + v, h * (z * z + e * third));
        store(r->by_metric[3] + v, 2 * h * (y * z));
        store(r->by_metric[4] + v, 2 * h * (x * z));
        store(r->by_metric[5] + v, 2 * h * (x * y));
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

/* Reverse mode: transposes of kernels. From the adjoints of the values that a kernel writes follow
   those of the values that it reads. */

// out[16] = the sum of w[z] planes[z][16] over four planes of a block.
static inline void sum_planes(const float *planes, const float w[4], float *out)
{
    for (int i = 0; i < 16; i++)
        out[i] = w[0] * planes[i] + w[1] * planes[16 + i] +
                 (w[2] * planes[32 + i] + w[3] * planes[48 + i]);
}

// The same for four lines of four voxels each.
static inline quad sum_lines(const float *lines, const float w[4])
{
    const quad *line = (const quad *)lines;
    return w[0] * line[0] + w[1] * line[1] + (w[2] * line[2] + w[3] * line[3]);
}

static inline void add_quad(float *to, quad v) { *(quad *)to += v; }

/* expand_back: along z, then y, then x. After two axes line[x][4] holds the four components of a
   line of voxels, for each station along y and z. */

static inline void expand_points_back(const float (*cubic)[4], const float *const *c,
                                      ptrdiff_t line, ptrdiff_t plane, float *points)
{
    EACH(k, 4)
    {
        float planes[3][16];
        EACH(a, 3) sum_planes(c[a], cubic[k], planes[a]);
        EACH(j, 4)
        {
            quad row[3];
            EACH(a, 3) row[a] = sum_lines(planes[a], cubic[j]);
            float *to = points + 4 * (k * plane + j * line);
            quad sum[4] = {{0}};
            EACH(x, 4)
            {
                const quad v = {row[0][x], row[1][x], row[2][x], 0};
                EACH(i, 4) sum[i] += cubic[i][x] * v;
            }
            EACH(i, 4) add_quad(to + 4 * i, sum[i]);
        }
    }
}

static inline void expand_metric_back(const float linear[4], const float *const *c, ptrdiff_t line,
                                      ptrdiff_t plane, float *metric)
{
    float weight[2][4]; // of the two stations
    EACH(x, 4) weight[0][x] = 1 - linear[x], weight[1][x] = linear[x];
    EACH(k, 2)
    {
        float planes[6][16];
        EACH(a, 6) sum_planes(c[a], weight[k], planes[a]);
        EACH(j, 2)
        {
            quad row[6];
            EACH(a, 6) row[a] = sum_lines(planes[a], weight[j]);
            float *to = metric + 8 * (k * plane + j * line);
            quad sum[4] = {{0}};
            EACH(x, 4)
            {
                const quad low = {row[0][x], row[1][x], row[2][x], row[3][x]},
                           high = {row[4][x], row[5][x], 0, 0};
                EACH(i, 2)
                {
                    sum[2 * i] += weight[i][x] * low;
                    sum[2 * i + 1] += weight[i][x] * high;
                }
            }
            EACH(i, 4) add_quad(to + 4 * i, sum[i]);
        }
    }
}

static void expand_back(const template_expansion *e, const float *const *c, size_t line,
                        size_t plane, float *points, float *metric)
{
    expand_points_back(e->cubic, c, (ptrdiff_t)line, (ptrdiff_t)plane, points);
    expand_metric_back(e->linear, c + 3, (ptrdiff_t)line, (ptrdiff_t)plane, metric);
}

/* block_back. Along an axis the value at one of the two corners has the weights l of linear
   interpolation and k of the cubic correction, the slope has the weights h. In the block the value
   at a corner has the weight l l l + k l l + l k l + l l k, its slope along x the weight h l l. */
enum { END_L, END_K, END_H, END_WEIGHTS };

static const float END[2][END_WEIGHTS][4] = {
    {{1, 0.75f, 0.5f, 0.25f}, {0, 0.09375f, 0, -0.09375f}, {0, 0.140625f, 0.125f, 0.046875f}},
    {{0, 0.25f, 0.5f, 0.75f}, {0, -0.09375f, 0, 0.09375f}, {0, -0.046875f, -0.125f, -0.140625f}}};

static inline float sum_line_with(quad v, const float w[4])
{
    return w[0] * v[0] + w[1] * v[1] + (w[2] * v[2] + w[3] * v[3]);
}

static void block_back(const float *value, size_t line, size_t plane, float *corner)
{
    EACH(k, 2)
    {
        float planes[END_WEIGHTS][16];
        EACH(i, END_WEIGHTS) sum_planes(value, END[k][i], planes[i]);
        EACH(j, 2)
        {
            const float(*w)[4] = END[j];
            const quad l = sum_lines(planes[END_L], w[END_L]),
                       cubic =
                           sum_lines(planes[END_K], w[END_L]) + sum_lines(planes[END_L], w[END_K]),
                       by_y = sum_lines(planes[END_L], w[END_H]),
                       by_z = sum_lines(planes[END_H], w[END_L]);
            EACH(i, 2)
            {
                const float(*x)[4] = END[i];
                const quad sum = {sum_line_with(l, x[END_L]) +
                                      (sum_line_with(l, x[END_K]) + sum_line_with(cubic, x[END_L])),
                                  sum_line_with(l, x[END_H]), sum_line_with(by_y, x[END_L]),
                                  sum_line_with(by_z, x[END_L])};
                add_quad(corner + k * (ptrdiff_t)plane + j * (ptrdiff_t)line + 4 * i, sum);
            }
        }
    }
}

static void correct_back(const template_correction *c, size_t n, const float *const *u,
                         const float *value, float *map)
{
    const ptrdiff_t line = c->n[0], plane = line * c->n[1];
    const cells all = cells_of(c->n, c->scale, c->offset);
    for (size_t v = 0; v < n; v += VW) {
        place p;
        locate(&all, u, v, 1, &p);
        const int count = n - v < VW ? (int)(n - v) : VW;
        for (int i = 0; i < count; i++) {
            const float value_here = value[v + (size_t)i], x = p.t[0][i], y = p.t[1][i],
                        z = p.t[2][i], far = z * value_here, near = value_here - far;
            if (value_here == 0) continue;
            float *to = map + p.node[i];
            const float ends[4] = {near - y * near, y * near, far - y * far, y * far};
            EACH(e, 4)
            {
                float *edge = to + (e & 1) * line + (e >> 1) * plane;
                edge[0] += ends[e] - x * ends[e];
                edge[1] += x * ends[e];
            }
        }
    }
}

static void displace_back(const template_warp *w, const template_place *p, const float (*sum)[4],
                          float *control)
{
    const ptrdiff_t line = 4 * (ptrdiff_t)w->n[0], plane = line * w->n[1];
    const float(*const weights)[2][4] = p->weights;
    quad s[4];
    EACH(i, 4) s[i] = *(const quad *)sum[i];
    EACH(k, 4)
    {
        const float z = weights[2][0][k];
        const quad plain = z * s[0] + weights[2][1][k] * s[3], by_x = z * s[1], by_y = z * s[2];
        EACH(j, 4)
        {
            const float y = weights[1][0][j];
            const quad f = y * plain + weights[1][1][j] * by_y, slope = y * by_x;
            float *to = control + p->first + k * plane + j * line;
            EACH(i, 4) add_quad(to + 4 * i, weights[0][0][i] * f + weights[0][1][i] * slope);
        }
    }
}
