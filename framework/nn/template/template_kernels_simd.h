/* The inner loops of the `template` network, written once with the compiler's vector types and
   compiled once for each instruction set. Before inclusion, define TABLE (name of the
   template_table). Contracts: template_kernels.h. */
#include <math.h>
#include <string.h>

#define VW 8
#include "kernels/kernels_vector.h"
#include "template_kernels.h"

_Static_assert(SDM_TEMPLATE_LANES == VW, "a vector holds the voxels of a step");

typedef float quad __attribute__((vector_size(16)));
typedef float quad_u __attribute__((vector_size(16), aligned(4)));

static inline veci splat_int(int32_t v) { return v - (veci){0}; }
static inline void store_int(int32_t *p, veci v) { memcpy(p, &v, sizeof v); }
static inline vec select_vec(veci mask, vec a, vec b)
{
    return (vec)(((veci)a & mask) | ((veci)b & ~mask));
}
static inline vec clamp_vec(vec x, float low, float high)
{
    x = select_vec(x > splat(low), x, splat(low));
    return select_vec(x < splat(high), x, splat(high));
}

// One coordinate of eight points: the lower node and the fraction of the way to the next one.
typedef struct place {
    veci node;
    vec t;
} place;

static inline place place_of(vec u, float scale, float offset, int32_t n)
{
    const vec x = clamp_vec(u * splat(scale) + splat(offset), 0, (float)(n - 1));
    place p = {__builtin_convertvector(x, veci), x};
    const veci last = splat_int(n - 2), over = p.node > last;
    p.node = (last & over) | (p.node & ~over);
    p.t = x - __builtin_convertvector(p.node, vec);
    return p;
}

static void expand(const template_expansion *e, size_t cells, const float *points,
                   const float *metric, size_t n_c, float *const *c)
{
    vec w[4];
    for (int k = 0; k < 4; k++) w[k] = load(e->cubic[k]);
    const vec t = load(e->linear);
    for (size_t i = 0; i < cells; i++, points += 4, metric += 8) {
        const size_t at = i * (size_t)e->step;
        for (int a = 0; a < 3; a++)
            store(c[a] + at, w[0] * splat(points[a]) + w[1] * splat(points[4 + a]) +
                                 w[2] * splat(points[8 + a]) + w[3] * splat(points[12 + a]));
        for (size_t a = 3; a < n_c; a++) {
            const float low = metric[8 + a - 3], high = metric[16 + a - 3];
            store(c[a] + at, splat(low) + t * splat(high - low));
        }
    }
}

static inline quad load_quad(const float *p) { return *(const quad_u *)p; }
static inline quad splat_quad(float v) { return v - (quad){0}; }

// The interpolated nodes of a point, and the differences that correct them.
typedef struct node_mean {
    quad value; /* trilinear: distance, gradient x, y, z */
    quad kink;  /* element 1, 2, 3: difference of the gradient's x, y, z along x, y, z */
} node_mean;

// Quadratic interpolation from values f and gradients: trilinear interpolation of f, minus
// t (1 - t) / 2 times the difference of the derivatives at the ends, along each axis. It is exact
// for quadratic functions.
static inline node_mean lookup_point(const float *at, ptrdiff_t line, ptrdiff_t plane, float x,
                                     float y, float z)
{
    const quad tx = splat_quad(x), ty = splat_quad(y), tz = splat_quad(z);
    // along z: the four columns
    const quad a0 = load_quad(at), a1 = load_quad(at + 4), a2 = load_quad(at + line),
               a3 = load_quad(at + line + 4);
    const quad d0 = load_quad(at + plane) - a0, d1 = load_quad(at + plane + 4) - a1,
               d2 = load_quad(at + plane + line) - a2, d3 = load_quad(at + plane + line + 4) - a3;
    const quad q0 = a0 + tz * d0, q1 = a1 + tz * d1, q2 = a2 + tz * d2, q3 = a3 + tz * d3;
    // along y
    const quad y0 = q2 - q0, y1 = q3 - q1;
    const quad r0 = q0 + ty * y0, r1 = q1 + ty * y1;
    const quad e0 = __builtin_shufflevector(d0 + ty * (d2 - d0), y0, 0, 1, 6, 3),
               e1 = __builtin_shufflevector(d1 + ty * (d3 - d1), y1, 0, 1, 6, 3);
    // along x
    const quad dx = r1 - r0;
    return (node_mean){r0 + tx * dx, __builtin_shufflevector(e0 + tx * (e1 - e0), dx, 0, 5, 2, 3)};
}

// to[k][0 .. 3] = element k of four quads
static inline void transpose(const quad *m, float to[4][VW], int i)
{
    const quad a = __builtin_shufflevector(m[0], m[1], 0, 4, 1, 5),
               b = __builtin_shufflevector(m[2], m[3], 0, 4, 1, 5),
               c = __builtin_shufflevector(m[0], m[1], 2, 6, 3, 7),
               d = __builtin_shufflevector(m[2], m[3], 2, 6, 3, 7);
    *(quad_u *)(to[0] + i) = __builtin_shufflevector(a, b, 0, 1, 4, 5);
    *(quad_u *)(to[1] + i) = __builtin_shufflevector(a, b, 2, 3, 6, 7);
    *(quad_u *)(to[2] + i) = __builtin_shufflevector(c, d, 0, 1, 4, 5);
    *(quad_u *)(to[3] + i) = __builtin_shufflevector(c, d, 2, 3, 6, 7);
}

static void lookup(const template_level *l, size_t n, const float *const *u, float *f,
                   float *const *g)
{
    const ptrdiff_t line = 4 * (ptrdiff_t)l->n[0], plane = line * l->n[1];
    for (size_t v = 0; v < n; v += VW) {
        place p[3];
        EACH(a, 3) p[a] = place_of(load(u[a] + v), l->scale, l->offset[a], l->n[a]);
        int32_t node[VW];
        float t[3][VW], out[4][VW], kink[4][VW];
        store_int(node, 4 * ((p[2].node * splat_int(l->n[1]) + p[1].node) * splat_int(l->n[0]) +
                             p[0].node));
        EACH(a, 3) store(t[a], p[a].t);
        for (int i = 0; i < VW; i += 4) {
            quad value[4], bends[4];
            EACH(k, 4)
            {
                const node_mean m = lookup_point(l->nodes + node[i + k], line, plane, t[0][i + k],
                                                 t[1][i + k], t[2][i + k]);
                value[k] = m.value, bends[k] = m.kink;
            }
            transpose(value, out, i);
            transpose(bends, kink, i);
        }
        vec bend = {0};
        EACH(a, 3) bend += p[a].t * (1 - p[a].t) * load(kink[a + 1]);
        store(f + v, load(out[0]) - splat(l->half) * bend);
        EACH(a, 3) store(g[a] + v, load(out[a + 1]));
    }
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

static void correct(const template_correction *c, size_t n, const float *const *u, float *out)
{
    const ptrdiff_t line = c->n[0], plane = line * c->n[1];
    for (size_t v = 0; v < n; v += VW) {
        place p[3];
        EACH(a, 3) p[a] = place_of(load(u[a] + v), c->scale, c->offset[a], c->n[a]);
        const veci node =
            (p[2].node * splat_int(c->n[1]) + p[1].node) * splat_int(c->n[0]) + p[0].node;
        int32_t at[VW];
        float corner[8][VW];
        store_int(at, node);
        for (int i = 0; i < VW; i++) {
            const float *from = c->map + at[i];
            EACH(k, 8) corner[k][i] = from[(k & 1) + (k & 2 ? line : 0) + (k & 4 ? plane : 0)];
        }
        vec q[4];
        EACH(k, 4) q[k] = load(corner[k]) + p[2].t * (load(corner[k + 4]) - load(corner[k]));
        EACH(k, 2) q[k] += p[1].t * (q[k + 2] - q[k]);
        store(out + v, load(out + v) + q[0] + p[0].t * (q[1] - q[0]));
    }
}

const template_table TABLE = {
    .expand = expand, .lookup = lookup, .normalise = normalise, .correct = correct};
