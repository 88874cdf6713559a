/* The inner loops of the `template` network, written once with the compiler's vector types and
   compiled once for each instruction set. Before inclusion, define TABLE (name of the
   template_table) and VW (floats in a vector: 8 for AVX, else 4). Contracts: template_kernels.h. */
#include <math.h>
#include <string.h>

#include "kernels/kernels_select.h"
#include "template_kernels.h"

_Static_assert(SDM_TEMPLATE_LANES % VW == 0, "a row holds whole vectors");

/* Shuffles work on each four floats of a vector. SHUFFLE takes the elements i, j, k, l: 0 .. 3 from
   a, 4 .. 7 from b. */
#if VW == 8
#define AT(i) ((i) + ((i)&4))
#define SHUFFLE(a, b, i, j, k, l)                                                                  \
    __builtin_shufflevector(a, b, AT(i), AT(j), AT(k), AT(l), AT(i) + 4, AT(j) + 4, AT(k) + 4,     \
                            AT(l) + 4)
#else
#define SHUFFLE(a, b, i, j, k, l) __builtin_shufflevector(a, b, i, j, k, l)
#endif
static inline vec low_pairs(vec a, vec b) { return SHUFFLE(a, b, 0, 1, 4, 5); }
static inline vec high_pairs(vec a, vec b) { return SHUFFLE(a, b, 2, 3, 6, 7); }
static inline vec even(vec a, vec b) { return SHUFFLE(a, b, 0, 2, 4, 6); }
static inline vec odd(vec a, vec b) { return SHUFFLE(a, b, 1, 3, 5, 7); }
static inline vec interleave_low(vec a, vec b) { return SHUFFLE(a, b, 0, 4, 1, 5); }
static inline vec interleave_high(vec a, vec b) { return SHUFFLE(a, b, 2, 6, 3, 7); }
static inline vec spread(vec v, int i)
{
    return i == 0   ? SHUFFLE(v, v, 0, 0, 0, 0)
           : i == 1 ? SHUFFLE(v, v, 1, 1, 1, 1)
           : i == 2 ? SHUFFLE(v, v, 2, 2, 2, 2)
                    : SHUFFLE(v, v, 3, 3, 3, 3);
}

/* Pairs of floats, p[0 .. 1]: copied as one double. */
typedef double pairs __attribute__((vector_size(4 * VW)));
static inline double load_pair(const float *p)
{
    double pair;
    memcpy(&pair, p, sizeof pair);
    return pair;
}

#if VW == 8
static inline vec repeat_two(const float *p)
{
    const double pair = load_pair(p);
    return (vec)(pairs){pair, pair, pair, pair};
}
static inline vec repeat_four(const float *p)
{
    typedef float four __attribute__((vector_size(16), aligned(4)));
    const four v = *(const four *)p;
    return __builtin_shufflevector(v, v, 0, 1, 2, 3, 0, 1, 2, 3);
}
// out[0], out[1] = first four floats of a and b, last four floats of a and b
static inline void halves(vec a, vec b, vec out[2])
{
    out[0] = __builtin_shufflevector(a, b, 0, 1, 2, 3, 8, 9, 10, 11);
    out[1] = __builtin_shufflevector(a, b, 4, 5, 6, 7, 12, 13, 14, 15);
}
// Four floats at p, and four on the next line.
static inline vec load_lines(const float *p, size_t stride)
{
    typedef float four __attribute__((vector_size(16), aligned(4)));
    const four a = *(const four *)p, b = *(const four *)(p + stride);
    return __builtin_shufflevector(a, b, 0, 1, 2, 3, 4, 5, 6, 7);
}
/* The elements i and i + 1 of the first four floats, four times each. */
#define SHUFFLE_PLANES(v, i)                                                                       \
    __builtin_shufflevector(v, v, i, i, i, i, (i) + 1, (i) + 1, (i) + 1, (i) + 1)

// Stores the first four floats at p, the last four a plane of a block further.
static inline void store_planes(float *p, vec v)
{
    memcpy(p, &v, 16);
    memcpy(p + 16, (const char *)&v + 16, 16);
}
// p[0] and p[1], four times each.
static inline vec repeat_each(const float *p)
{
    const vec v = repeat_two(p);
    return __builtin_shufflevector(v, v, 0, 0, 0, 0, 5, 5, 5, 5);
}
#else
static inline vec repeat_each(const float *p) { return splat(*p); }
static inline vec load_lines(const float *p, size_t stride)
{
    (void)stride;
    return load(p);
}
static inline void store_planes(float *p, vec v) { store(p, v); }
static inline vec repeat_two(const float *p)
{
    const double pair = load_pair(p);
    return (vec)(pairs){pair, pair};
}
static inline vec repeat_four(const float *p) { return load(p); }
#endif

static inline vec mix(vec a, vec b, vec t) { return a + t * (b - a); }
static inline veci splat_int(int32_t v) { return v - (veci){0}; }

// VW / 4 lines of four voxels.
static void expand(const template_expansion *e, const float *points, const float *metric,
                   size_t stride, size_t n_c, float *const *c)
{
    vec w[4];
    EACH(k, 4) w[k] = repeat_four(e->cubic[k]);
    const vec t = repeat_four(e->linear);
    for (size_t at = 0; at < 64; at += VW, points += VW / 4 * stride, metric += VW / 4 * stride) {
        vec p[4];
        EACH(k, 4) p[k] = load_lines(points + 4 * k, stride);
        EACH(a, 3)
        store(c[a] + at, w[0] * spread(p[0], a) + w[1] * spread(p[1], a) + w[2] * spread(p[2], a) +
                             w[3] * spread(p[3], a));
        if (n_c == 3) continue;
        vec low[2], change[2];
        EACH(k, 2)
        {
            low[k] = load_lines(metric + 4 * k, stride);
            change[k] = load_lines(metric + 8 + 4 * k, stride) - low[k];
        }
        EACH(a, 6)
        store(c[3 + a] + at, spread(low[a / 4], a % 4) + t * spread(change[a / 4], a % 4));
    }
}

// The cells of a lattice.
typedef struct cells {
    vec scale, offset[3];
    vec end[3]; // the largest number less than the index of the last node
    veci n[2];
} cells;

static inline cells cells_of(const int32_t *n, float scale, const float *offset)
{
    cells c = {.scale = splat(scale), .n = {splat_int(n[0]), splat_int(n[1])}};
    EACH(a, 3)
    {
        c.offset[a] = splat(offset[a]);
        c.end[a] = (vec)((veci)splat((float)(n[a] - 1)) - 1);
    }
    return c;
}

/* VW points: the index of the first node of their cells, times a factor, and where they lie in the
   cells, 0 .. 1. The points of a chunk are located first: their places go through memory, from
   where the load units repeat single elements. */
#define CHUNK (64 / VW)
typedef struct place {
    float t[3][VW];
    int32_t node[VW];
} place;

static inline void locate(const cells *c, const float *const *u, size_t v, int32_t factor, place *p)
{
    veci at[3];
    EACH(a, 3)
    {
        const vec x = MAX_VEC(load(u[a] + v) * c->scale + c->offset[a], splat(0));
        at[a] = __builtin_convertvector(MIN_VEC(x, c->end[a]), veci);
        store(p->t[a], MIN_VEC(x - __builtin_convertvector(at[a], vec), splat(1)));
    }
    const veci node = ((at[2] * c->n[1] + at[1]) * c->n[0] + at[0]) * splat_int(factor);
    memcpy(p->node, &node, sizeof node);
}

/* Lookup is quadratic interpolation from values f and gradients: trilinear interpolation of f,
   minus t (1 - t) / 2 times the change of the derivative along the axis, for each axis. It is exact
   for quadratic functions. Each point is interpolated along z and y, then VW points along x. */

// For each point, what is left to be interpolated along x: values at the first and the second end,
// four floats each (distance, gradient). For each pair of points, at both ends: the differences
// between neighbouring nodes of d f / dy along y and of d f / dz along z.
typedef struct edges {
    float value[VW][8], kinks[VW / 2][8];
} edges;

// Nodes of a point interpolated along z and y: both ends of the edge (VW = 8), or one (VW = 4).
typedef struct mean {
    vec value, dy, dz[2]; // changes along y, and along z at both ends along y
} mean;

static inline mean mean_of(const float *const corner[4], const place *p, int i, int end)
{
    const ptrdiff_t at = 2 * (ptrdiff_t)p->node[i] + 4 * end;
    const vec y = splat(p->t[1][i]), z = splat(p->t[2][i]);
    const vec first = load(corner[0] + at), second = load(corner[1] + at);
    mean m = {.dz = {load(corner[2] + at) - first, load(corner[3] + at) - second}};
    const vec low = first + z * m.dz[0];
    m.dy = second + z * m.dz[1] - low;
    m.value = low + y * m.dy;
    return m;
}

static inline void reduce(const float *const corner[4], const place *p, edges *e)
{
    for (int i = 0; i < VW; i += 2) {
        EACH(h, 8 / VW)
        {
            const int end = h * VW / 4;
            const mean a = mean_of(corner, p, i, end), b = mean_of(corner, p, i + 1, end);
            store(e->value[i] + 4 * end, a.value);
            store(e->value[i + 1] + 4 * end, b.value);
            const vec y = interleave_high(a.dy, b.dy),
                      z = mix(interleave_high(a.dz[0], b.dz[0]), interleave_high(a.dz[1], b.dz[1]),
                              repeat_two(p->t[1] + i));
            store(e->kinks[i / 2] + 4 * end, SHUFFLE(y, z, 0, 1, 6, 7));
        }
    }
}

// ends[2] = first and second end of row i of n rows; with VW = 8, of the row i + n / 2 too.
static inline void load_ends(const float (*rows)[8], int n, int i, vec ends[2])
{
#if VW == 8
    halves(load(rows[i]), load(rows[i + n / 2]), ends);
#else
    (void)n;
    EACH(h, 2) ends[h] = load(rows[i] + 4 * h);
#endif
}

// Interpolates along x, and writes f and g at v.
static inline void finish(const place *p, const edges *e, float half, float *f, float *const *g,
                          size_t v)
{
    vec t[3], value[4], dx[4], kinks[2];
    EACH(a, 3) t[a] = load(p->t[a]);
    EACH(i, 4)
    {
        vec ends[2];
        load_ends(e->value, VW, i, ends);
        dx[i] = ends[1] - ends[0];
        value[i] = ends[0] + spread(t[0], i) * dx[i];
    }
    EACH(i, 2)
    {
        vec ends[2];
        load_ends(e->kinks, VW / 2, i, ends);
        kinks[i] = mix(ends[0], ends[1], i ? high_pairs(t[0], t[0]) : low_pairs(t[0], t[0]));
    }
    const vec kink_x = high_pairs(interleave_low(dx[0], dx[1]), interleave_low(dx[2], dx[3])),
              kink_y = low_pairs(kinks[0], kinks[1]), kink_z = high_pairs(kinks[0], kinks[1]);
    const vec bend =
        t[0] * (1 - t[0]) * kink_x + t[1] * (1 - t[1]) * kink_y + t[2] * (1 - t[2]) * kink_z;
    const vec f_gx[2] = {interleave_low(value[0], value[1]), interleave_low(value[2], value[3])},
              gy_gz[2] = {interleave_high(value[0], value[1]), interleave_high(value[2], value[3])};
    store(f + v, low_pairs(f_gx[0], f_gx[1]) - splat(half) * bend);
    store(g[0] + v, high_pairs(f_gx[0], f_gx[1]));
    store(g[1] + v, low_pairs(gy_gz[0], gy_gz[1]));
    store(g[2] + v, high_pairs(gy_gz[0], gy_gz[1]));
}

static void lookup(const template_level *l, size_t n, const float *const *u, float *f,
                   float *const *g)
{
    const ptrdiff_t line = 4 * (ptrdiff_t)l->n[0], plane = line * l->n[1];
    const float *const corner[4] = {l->nodes, l->nodes + line, l->nodes + plane,
                                    l->nodes + plane + line};
    const cells c = cells_of(l->n, l->scale, l->offset);
    _Alignas(32) place places[CHUNK];
    _Alignas(32) edges rows[CHUNK];
    // One loop for each stage: many points are in flight in a short stage.
    for (size_t v = 0; v < n; v += VW * CHUNK) {
        const size_t left = (n - v + VW - 1) / VW, count = left < CHUNK ? left : CHUNK;
        for (size_t i = 0; i < count; i++) locate(&c, u, v + VW * i, 2, &places[i]);
        for (size_t i = 0; i < count; i++) reduce(corner, &places[i], &rows[i]);
        for (size_t i = 0; i < count; i++) finish(&places[i], &rows[i], l->half, f, g, v + VW * i);
    }
}

static bool is_above(float base, const float slope[3], const float *value)
{
    static const float x[8] = {0, 1, 2, 3, 0, 1, 2, 3}, y[8] = {0, 0, 0, 0, 1, 1, 1, 1};
    const vec by_x = splat(slope[0]) * load(x), by_y = splat(slope[1]);
    veci above = splat_int(-1);
    EACH(v, 64 / VW)
    {
        const int line = v * VW / 4;
        const vec yz =
            by_y * (splat((float)(line % 4)) + load(y)) + splat(slope[2] * (float)(line / 4));
        above &= splat(base) + (by_x + yz) > load(value + v * VW);
    }
    int32_t each[VW], all = -1;
    memcpy(each, &above, sizeof each);
    for (int i = 0; i < VW; i++) all &= each[i];
    return all;
}

// The compiler makes vectors of the loops of the next functions, of sixteen floats with AVX-512.

static void combine(const template_expansion *e, const float *points, const float *metric, size_t n,
                    size_t phase, float *out)
{
    float w[4], *out_metric = out + 4 * n;
    for (int a = 0; a < 4; a++) w[a] = e->cubic[a][phase];
    const float t = e->linear[phase], *p = points, *g = metric;
    for (size_t i = 0; i < 4 * n; i++)
        out[i] = w[0] * p[i] + w[1] * p[4 * n + i] + w[2] * p[8 * n + i] + w[3] * p[12 * n + i];
    for (size_t i = 0; i < 8 * n; i++) out_metric[i] = g[i] + t * (g[8 * n + i] - g[i]);
}

static void normalise(size_t n, const float *f, const float *const *g, const float *const *metric,
                      float *out)
{
    const float e = 1e-3f;
    for (size_t i = 0; i < n; i++) {
        const float x = g[0][i], y = g[1][i], z = g[2][i];
        const float xx = metric[0][i], yy = metric[1][i], zz = metric[2][i];
        const float t = (xx + yy + zz) * (1.0f / 3);
        const float q = x * x * xx + y * y * yy + z * z * zz +
                        2 * (y * z * metric[3][i] + x * z * metric[4][i] + x * y * metric[5][i]);
        out[i] = f[i] * sqrtf((x * x + y * y + z * z + e) / (q + e * t));
    }
}

static void take_lesser(const float *other, float *value)
{
    for (size_t v = 0; v < 64; v += VW) store(value + v, MIN_VEC(load(other + v), load(value + v)));
}

static void line(size_t n, double first, double step, float *out)
{
    for (int32_t at = 0; at < (int32_t)n; at += SDM_TEMPLATE_LANES, out += SDM_TEMPLATE_LANES)
        for (int32_t i = 0; i < SDM_TEMPLATE_LANES; i++) out[i] = (float)(first + step * (at + i));
}

// out[i stride .. i stride + 3] = the elements i of four rows, for i = 0 .. n - 1, n <= VW.
static inline void store_points(const vec row[4], size_t n, size_t stride, float *out)
{
    const vec low[2] = {interleave_low(row[0], row[1]), interleave_low(row[2], row[3])},
              high[2] = {interleave_high(row[0], row[1]), interleave_high(row[2], row[3])};
    float point[4][VW]; // points k, and with VW = 8 also k + 4
    store(point[0], low_pairs(low[0], low[1]));
    store(point[1], high_pairs(low[0], low[1]));
    store(point[2], low_pairs(high[0], high[1]));
    store(point[3], high_pairs(high[0], high[1]));
    for (size_t i = 0; i < n; i++, out += stride)
        memcpy(out, point[i % 4] + i / 4 * 4, 4 * sizeof *out);
}

static void tangents(size_t n, const float *f, const float *const *g, const float (*by)[3],
                     size_t stride, float *out)
{
    for (size_t v = 0; v < n; v += VW, out += VW * stride) {
        vec row[4] = {load(f + v)};
        EACH(a, 3)
        row[1 + a] = splat(by[a][0]) * load(g[0] + v) + splat(by[a][1]) * load(g[1] + v) +
                     splat(by[a][2]) * load(g[2] + v);
        store_points(row, n - v < VW ? n - v : VW, stride, out);
    }
}

// The neighbours along x of half of the points: 2 h, 2 h + 1, and with VW = 8 the fourth ones
// after.
static inline vec neighbours(const float *from, const int32_t *node, int h)
{
    const int32_t *at = node + 2 * h;
#if VW == 8
    return (vec)(pairs){load_pair(from + at[0]), load_pair(from + at[1]), load_pair(from + at[4]),
                        load_pair(from + at[5])};
#else
    return (vec)(pairs){load_pair(from + at[0]), load_pair(from + at[1])};
#endif
}

// Trilinear interpolation.
static inline vec interpolate(const float *const corner[4], const place *p)
{
    const vec x = load(p->t[0]), y = load(p->t[1]), z = load(p->t[2]);
    vec ends[2];
    EACH(h, 2)
    {
        const vec yy = h ? interleave_high(y, y) : interleave_low(y, y),
                  zz = h ? interleave_high(z, z) : interleave_low(z, z);
        vec m[4];
        EACH(k, 4) m[k] = neighbours(corner[k], p->node, h);
        ends[h] = mix(mix(m[0], m[2], zz), mix(m[1], m[3], zz), yy);
    }
    return mix(even(ends[0], ends[1]), odd(ends[0], ends[1]), x);
}

static void correct(const template_correction *c, size_t n, const float *const *u, float *out)
{
    const ptrdiff_t line = c->n[0], plane = line * c->n[1];
    const float *const corner[4] = {c->map, c->map + line, c->map + plane, c->map + plane + line};
    const cells all = cells_of(c->n, c->scale, c->offset);
    _Alignas(32) place places[CHUNK];
    for (size_t v = 0; v < n; v += VW * CHUNK) {
        const size_t left = (n - v + VW - 1) / VW, count = left < CHUNK ? left : CHUNK;
        for (size_t i = 0; i < count; i++) locate(&all, u, v + VW * i, 1, &places[i]);
        for (size_t i = 0; i < count; i++) {
            float *to = out + v + VW * i;
            store(to, load(to) + interpolate(corner, &places[i]));
        }
    }
}

#include "template_kernels_block.h"
#include "template_kernels_slopes.h"
#include "template_kernels_warp.h"

const template_table TABLE = {.expand = expand,
                              .lookup = lookup,
                              .combine = combine,
                              .is_above = is_above,
                              .take_lesser = take_lesser,
                              .line = line,
                              .tangents = tangents,
                              .normalise = normalise,
                              .correct = correct,
                              .lookup_slopes = lookup_slopes,
                              .factor_slopes = factor_slopes,
                              .correct_slopes = correct_slopes,
                              .sum_products = sum_products,
                              .block = block,
                              .separate = separate,
                              .corners = corners,
                              .find_place = find_place,
                              .displace = displace,
                              .invert_line = invert_line,
                              .invert_in_turn = invert_in_turn,
                              .expand_back = expand_back,
                              .block_back = block_back,
                              .correct_back = correct_back,
                              .displace_back = displace_back};
