/* Lookup in templates and in the correction, and small matrices, as ONNX operators. */
#include "template_graph.h"

// A constant [3][1].
static sdm_onnx_value column(sdm_onnx *g, const char *what, double x, double y, double z)
{
    return sdm_onnx_constant(g, what, 2, (const size_t[]){3, 1}, (const double[]){x, y, z});
}

// An index [3][1] in units of nodes: `add` is added to the numbers of nodes along the axes.
static sdm_onnx_value sizes(sdm_onnx *g, const int32_t n[3], int add)
{
    return column(g, "size of a lattice", n[0] + add, n[1] + add, n[2] + add);
}

// True [N][1][V] where x[N][3][V] lies in a lattice of n nodes.
static sdm_onnx_value is_in(sdm_onnx *g, sdm_onnx_value x, const int32_t n[3])
{
    const sdm_onnx_value low = sdm_onnx_node2(g, "Max", x, sdm_onnx_scalar(g, 0)),
                         clamped = sdm_onnx_node2(g, "Min", low, sizes(g, n, -1));
    const sdm_onnx_value change = sdm_onnx_node1(g, "Abs", sdm_onnx_sub(g, x, clamped));
    return sdm_onnx_node2(g, "Equal", sdm_onnx_extreme(g, "ReduceMax", change, 1),
                          sdm_onnx_scalar(g, 0));
}

// x[N][3][V] of another lattice, from the indices u.
static sdm_onnx_value scaled(sdm_onnx *g, sdm_onnx_value u, float scale, const float offset[3])
{
    return sdm_onnx_add(
        g, sdm_onnx_mul(g, u, sdm_onnx_scalar(g, (double)scale)),
        column(g, "offset of a lattice", (double)offset[0], (double)offset[1], (double)offset[2]));
}

static sdm_onnx_value level_index(sdm_onnx *g, const template_level *l, sdm_onnx_value u)
{
    return scaled(g, u, l->scale, l->offset);
}

sdm_onnx_value sdm_template_onnx_known(const template_graph *t, size_t c, sdm_onnx_value u)
{
    const template_level *far = &t->k->far[c];
    return sdm_onnx_cast(t->g, is_in(t->g, level_index(t->g, far, u), far->n), SDM_ONNX_FLOAT);
}

// The numbers from one node to the next along x, y, z: [3][1], and from the first node of a cell to
// its eight nodes: [8][1].
typedef struct strides {
    sdm_onnx_value axis, corner;
} strides;

static strides strides_of(sdm_onnx *g, const int32_t n[3])
{
    int32_t *v = sdm_onnx_memory(g, 11, sizeof *v);
    if (!v) return (strides){0};
    v[0] = 1, v[1] = n[0], v[2] = n[0] * n[1];
    for (int i = 0; i < 8; i++) v[3 + i] = (i & 1) + (i >> 1 & 1) * v[1] + (i >> 2) * v[2];
    return (strides){sdm_onnx_indices(g, "strides", 2, (const size_t[]){3, 1}, v),
                     sdm_onnx_indices(g, "nodes of a cell", 2, (const size_t[]){8, 1}, v + 3)};
}

// *at[N][3][V] = the cells of x[N][3][V], clamped to a lattice whose last nodes have the index
// last[..3..], *place = where the points lie in them, 0 .. 1.
static void locate(sdm_onnx *g, sdm_onnx_value x, sdm_onnx_value last, sdm_onnx_value *at,
                   sdm_onnx_value *place)
{
    const sdm_onnx_value zero = sdm_onnx_scalar(g, 0),
                         in = sdm_onnx_node2(g, "Min", sdm_onnx_node2(g, "Max", x, zero), last),
                         end = sdm_onnx_sub(g, last, sdm_onnx_scalar(g, 1)),
                         first = sdm_onnx_node2(g, "Min", sdm_onnx_node1(g, "Floor", in), end);
    *place = sdm_onnx_sub(g, in, first);
    *at = sdm_onnx_cast(g, first, SDM_ONNX_INT32);
}

// The sum over the axes of at[N][3][V] * axis: [N][1][V].
static sdm_onnx_value number(sdm_onnx *g, sdm_onnx_value at, sdm_onnx_value axis)
{
    const sdm_onnx_value p = sdm_onnx_mul(g, at, axis);
    const sdm_onnx_value x = sdm_onnx_slice(g, p, 1, 0, 1), y = sdm_onnx_slice(g, p, 1, 1, 2),
                         z = sdm_onnx_slice(g, p, 1, 2, 3);
    return sdm_onnx_add(g, x, sdm_onnx_add(g, y, z));
}

// Nodes [N][8][V][width], x fastest, interpolated along z, y and x: [N][1][V][width]. kinks: the
// changes of the elements 3, 2 and 1 along z, y and x, interpolated along the other axes, follow as
// further elements.
static sdm_onnx_value interpolate(sdm_onnx *g, sdm_onnx_value nodes, size_t points,
                                  sdm_onnx_value place, bool kinks)
{
    for (int axis = 2; axis >= 0; axis--) {
        const int64_t half = (int64_t)1 << axis;
        const sdm_onnx_value w = sdm_onnx_reshape(g, sdm_onnx_slice(g, place, 1, axis, axis + 1), 4,
                                                  (const int64_t[]){-1, 1, (int64_t)points, 1});
        const sdm_onnx_value low = sdm_onnx_slice(g, nodes, 1, 0, half),
                             change =
                                 sdm_onnx_sub(g, sdm_onnx_slice(g, nodes, 1, half, 2 * half), low);
        nodes = sdm_onnx_add(g, low, sdm_onnx_mul(g, w, change));
        if (!kinks) continue;
        const sdm_onnx_value parts[] = {nodes, sdm_onnx_slice(g, change, 3, axis + 1, axis + 2)};
        nodes = sdm_onnx_join(g, 3, 2, parts);
    }
    return nodes;
}

static sdm_onnx_value choose(sdm_onnx *g, sdm_onnx_value near, sdm_onnx_value a, sdm_onnx_value b)
{
    return sdm_onnx_node3(g, "Where", near, a, b);
}

void sdm_template_onnx_lookup(const template_graph *t, size_t c, size_t points, sdm_onnx_value u,
                              sdm_onnx_value *f, sdm_onnx_value *gradient)
{
    sdm_onnx *g = t->g;
    const template_level *near = &t->k->near[c], *far = &t->k->far[c];
    const strides sn = strides_of(g, near->n), sf = strides_of(g, far->n);
    int32_t *begin = sdm_onnx_memory(g, 2, sizeof *begin);
    if (!begin) return;
    begin[1] = near->n[0] * near->n[1] * near->n[2];
    const size_t one = 1;
    const sdm_onnx_value in = is_in(g, u, near->n), x = choose(g, in, u, level_index(g, far, u)),
                         last = choose(g, in, sizes(g, near->n, -1), sizes(g, far->n, -1));
    sdm_onnx_value at, place;
    locate(g, x, last, &at, &place);
    const sdm_onnx_value first = choose(g, in, sdm_onnx_indices(g, "first node", 1, &one, begin),
                                        sdm_onnx_indices(g, "first node", 1, &one, begin + 1));
    const sdm_onnx_value cell =
        sdm_onnx_add(g, number(g, at, choose(g, in, sn.axis, sf.axis)), first);
    const sdm_onnx_value index = sdm_onnx_add(g, choose(g, in, sn.corner, sf.corner), cell);
    const sdm_onnx_value nodes = sdm_onnx_gather(g, t->part[c].nodes, index, 0);
    // [N][V][7]: distance, gradient, kinks along z, y, x
    const sdm_onnx_value rows = sdm_onnx_reshape(g, interpolate(g, nodes, points, place, true), 3,
                                                 (const int64_t[]){-1, (int64_t)points, 7});
    const sdm_onnx_value all = sdm_onnx_transpose(g, rows, 3, (const int64_t[]){0, 2, 1});
    *gradient = sdm_onnx_slice(g, all, 1, 1, 4);
    const sdm_onnx_value back = sdm_onnx_pick(g, place, 1, 3, (const int32_t[]){2, 1, 0}),
                         rest = sdm_onnx_sub(g, sdm_onnx_scalar(g, 1), back),
                         bend = sdm_onnx_mul(g, sdm_onnx_mul(g, back, rest),
                                             sdm_onnx_slice(g, all, 1, 4, 7));
    const sdm_onnx_value half = choose(g, in, sdm_onnx_scalar(g, (double)near->half),
                                       sdm_onnx_scalar(g, (double)far->half));
    *f = sdm_onnx_sub(g, sdm_onnx_slice(g, all, 1, 0, 1),
                      sdm_onnx_mul(g, half, sdm_onnx_sum(g, bend, 1)));
}

sdm_onnx_value sdm_template_onnx_correction(const template_graph *t, size_t points,
                                            sdm_onnx_value u)
{
    sdm_onnx *g = t->g;
    const template_correction *c = &t->k->correction_lattice;
    const strides s = strides_of(g, c->n);
    const int64_t n = (int64_t)points;
    sdm_onnx_value at, place;
    locate(g, scaled(g, u, c->scale, c->offset), sizes(g, c->n, -1), &at, &place);
    const sdm_onnx_value index = sdm_onnx_add(g, number(g, at, s.axis), s.corner);
    const sdm_onnx_value list = sdm_onnx_reshape(g, sdm_onnx_cast(g, index, SDM_ONNX_INT64), 3,
                                                 (const int64_t[]){-1, 8 * n, 1});
    sdm_onnx_set_int(g, "batch_dims", 1);
    const sdm_onnx_value nodes = sdm_onnx_reshape(
        g, sdm_onnx_node2(g, "GatherND", t->correction, list), 4, (const int64_t[]){-1, 8, n, 1});
    return sdm_onnx_reshape(g, interpolate(g, nodes, points, place, false), 3,
                            (const int64_t[]){-1, 1, n});
}

sdm_onnx_value sdm_template_onnx_metric(sdm_onnx *g, size_t points, sdm_onnx_value b)
{
    static const int32_t element[] = {0, 4, 8, 5, 2, 1};
    const sdm_onnx_value m =
        sdm_onnx_reshape(g, b, 4, (const int64_t[]){-1, (int64_t)points, 3, 3});
    const sdm_onnx_value square =
        sdm_onnx_product(g, m, sdm_onnx_transpose(g, m, 4, (const int64_t[]){0, 1, 3, 2}));
    const sdm_onnx_value rows =
        sdm_onnx_reshape(g, square, 3, (const int64_t[]){-1, (int64_t)points, 9});
    return sdm_onnx_transpose(g, sdm_onnx_pick(g, rows, 2, 6, element), 3,
                              (const int64_t[]){0, 2, 1});
}

sdm_onnx_value sdm_template_onnx_factor(sdm_onnx *g, sdm_onnx_value gradient, sdm_onnx_value metric)
{
    static const int32_t row[] = {0, 1, 2, 1, 0, 0}, columns[] = {0, 1, 2, 2, 2, 1};
    static const double twice[] = {1, 1, 1, 2, 2, 2};
    const double least = 1e-3; // as in normalise() of template_kernels_simd.h
    const sdm_onnx_value products = sdm_onnx_mul(g, sdm_onnx_pick(g, gradient, 1, 6, row),
                                                 sdm_onnx_pick(g, gradient, 1, 6, columns)),
                         weights =
                             sdm_onnx_constant(g, "weights", 2, (const size_t[]){6, 1}, twice);
    const sdm_onnx_value q =
        sdm_onnx_sum(g, sdm_onnx_mul(g, sdm_onnx_mul(g, products, weights), metric), 1);
    const sdm_onnx_value square = sdm_onnx_sum(g, sdm_onnx_slice(g, products, 1, 0, 3), 1),
                         trace = sdm_onnx_sum(g, sdm_onnx_slice(g, metric, 1, 0, 3), 1);
    const sdm_onnx_value above = sdm_onnx_add(g, square, sdm_onnx_scalar(g, least)),
                         below = sdm_onnx_add(
                             g, q, sdm_onnx_mul(g, trace, sdm_onnx_scalar(g, least / 3)));
    return sdm_onnx_node1(g, "Sqrt", sdm_onnx_node2(g, "Div", above, below));
}

sdm_onnx_value sdm_template_onnx_inverse(sdm_onnx *g, sdm_onnx_value m, double least)
{
    // the adjugate: m[a] m[b] - m[c] m[d] for each element
    static const int32_t a[] = {4, 2, 1, 5, 0, 2, 3, 1, 0}, b[] = {8, 7, 5, 6, 8, 3, 7, 6, 4},
                         c[] = {5, 1, 2, 3, 2, 0, 4, 0, 1}, d[] = {7, 8, 4, 8, 6, 5, 6, 7, 3};
    static const double unit[] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    const size_t nine = 9;
    const sdm_onnx_value adjugate = sdm_onnx_sub(
        g, sdm_onnx_mul(g, sdm_onnx_pick(g, m, -1, 9, a), sdm_onnx_pick(g, m, -1, 9, b)),
        sdm_onnx_mul(g, sdm_onnx_pick(g, m, -1, 9, c), sdm_onnx_pick(g, m, -1, 9, d)));
    const sdm_onnx_value det =
        sdm_onnx_sum(g,
                     sdm_onnx_mul(g, sdm_onnx_slice(g, m, -1, 0, 3),
                                  sdm_onnx_pick(g, adjugate, -1, 3, (const int32_t[]){0, 3, 6})),
                     -1);
    const sdm_onnx_value regular = sdm_onnx_node2(g, "Greater", det, sdm_onnx_scalar(g, least));
    return choose(g, regular, sdm_onnx_node2(g, "Div", adjugate, det),
                  sdm_onnx_constant(g, "identity", 1, &nine, unit));
}
