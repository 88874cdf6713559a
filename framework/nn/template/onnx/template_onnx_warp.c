/* The warp of a part as ONNX operators: its inverse at the stations by Newton's method, and the
   distances and slopes at the corners of the blocks. Values at S stations are [N][S][...]; nodes
   are those of the warp's lattice. */
#include "template_graph.h"

enum { STEP = SDM_TEMPLATE_STEP };

/* As many as newton() of template_warp.c takes at most. */
enum { ITERATIONS = 12 };

// The stations, and what does not change from one iteration to the next.
typedef struct warp_graph {
    sdm_onnx *g;
    const sdm_lattice *lattice;
    size_t n;                  // S
    sdm_onnx_value control;    // [N][nodes][3]
    sdm_onnx_value q;          // [N][S][3] what y + U(y) has to be
    sdm_onnx_value polynomial; // [4][8] from powers of a coordinate to four weights, four slopes
    sdm_onnx_value node;       // [64] from the first to all control points
} warp_graph;

static sdm_onnx_value along_axes(sdm_onnx *g, double x, double y, double z)
{
    const size_t three = 3;
    return sdm_onnx_constant(g, "axes", 1, &three, (const double[]){x, y, z});
}

// [N][S][4 functions][64]: the weights of the control points at places t[N][S][3] of cells, for the
// displacement and its derivatives by x, y and z; inside[N][S][3]: 1 within the lattice, else 0.
static sdm_onnx_value weights_of(const warp_graph *w, sdm_onnx_value t, sdm_onnx_value inside)
{
    static const double value[] = {1, 1, 1, 1, 0, 0, 0, 0}, slope[] = {0, 0, 0, 0, 1, 1, 1, 1},
                        power[] = {0, 1, 2, 3};
    sdm_onnx *g = w->g;
    const int64_t n = (int64_t)w->n, column[] = {-1, n, 3, 1};
    const size_t four = 4, eight = 8;
    const sdm_onnx_value powers = sdm_onnx_node2(g, "Pow", sdm_onnx_reshape(g, t, 4, column),
                                                 sdm_onnx_constant(g, "powers", 1, &four, power));
    const sdm_onnx_value per_mm =
        sdm_onnx_mul(g, inside, sdm_onnx_scalar(g, 1 / w->lattice->spacing));
    const sdm_onnx_value unit =
        sdm_onnx_add(g, sdm_onnx_constant(g, "of weights", 1, &eight, value),
                     sdm_onnx_mul(g, sdm_onnx_reshape(g, per_mm, 4, column),
                                  sdm_onnx_constant(g, "of slopes", 1, &eight, slope)));
    const sdm_onnx_value both =
        sdm_onnx_mul(g, sdm_onnx_product(g, powers, w->polynomial), unit); // [N][S][3][8]
    sdm_onnx_value product = 0;
    for (int a = 0; a < 3; a++) {
        int32_t index[16]; // the slopes for the derivative by this axis
        for (int f = 0; f < 4; f++)
            for (int i = 0; i < 4; i++) index[4 * f + i] = i + (f == a + 1 ? 4 : 0);
        const int64_t dims[] = {-1, n, 4, a == 2 ? 4 : 1, a == 1 ? 4 : 1, a == 0 ? 4 : 1};
        const sdm_onnx_value all =
            sdm_onnx_pick(g, sdm_onnx_slice(g, both, 2, a, a + 1), 3, 16, index);
        const sdm_onnx_value axis = sdm_onnx_reshape(g, all, 6, dims);
        product = a ? sdm_onnx_mul(g, product, axis) : axis;
    }
    return sdm_onnx_reshape(g, product, 4, (const int64_t[]){-1, n, 4, 64});
}

// [N][S][12] = the displacement at y[N][S][3] and its derivatives by x, y and z. Beyond the lattice
// it is that of the nearest point of the lattice.
static sdm_onnx_value displacement(const warp_graph *w, sdm_onnx_value y)
{
    sdm_onnx *g = w->g;
    const sdm_lattice *l = w->lattice;
    const int64_t n = (int64_t)w->n;
    const sdm_onnx_value from = sdm_onnx_sub(
                             g, y, along_axes(g, l->origin[0], l->origin[1], l->origin[2])),
                         u = sdm_onnx_mul(g, from, sdm_onnx_scalar(g, 1 / l->spacing)),
                         last = along_axes(g, l->n[0] - 2.0, l->n[1] - 2.0, l->n[2] - 2.0),
                         one = sdm_onnx_scalar(g, 1);
    const sdm_onnx_value in = sdm_onnx_node2(g, "Min", sdm_onnx_node2(g, "Max", u, one), last);
    const sdm_onnx_value at =
        sdm_onnx_node2(g, "Min", sdm_onnx_node1(g, "Floor", in), sdm_onnx_sub(g, last, one));
    const sdm_onnx_value inside =
        sdm_onnx_node3(g, "Where", sdm_onnx_node2(g, "Equal", in, u), one, sdm_onnx_scalar(g, 0));
    const sdm_onnx_value weights = weights_of(w, sdm_onnx_sub(g, in, at), inside);
    // the first control point lies before the cell
    const sdm_onnx_value before = sdm_onnx_cast(g, sdm_onnx_sub(g, at, one), SDM_ONNX_INT64);
    const int64_t strides[] = {1, l->n[0], (int64_t)l->n[0] * l->n[1]};
    const sdm_onnx_value first =
        sdm_onnx_sum(g, sdm_onnx_mul(g, before, sdm_onnx_list(g, 3, strides)), 2);
    const sdm_onnx_value index = sdm_onnx_add(g, first, w->node);
    const sdm_onnx_value list = sdm_onnx_reshape(g, index, 3, (const int64_t[]){-1, 64 * n, 1});
    sdm_onnx_set_int(g, "batch_dims", 1);
    const sdm_onnx_value points = sdm_onnx_node2(g, "GatherND", w->control, list);
    const sdm_onnx_value sums = sdm_onnx_product(
        g, weights, sdm_onnx_reshape(g, points, 4, (const int64_t[]){-1, n, 64, 3}));
    return sdm_onnx_reshape(g, sums, 3, (const int64_t[]){-1, n, 12});
}

// (I + dU)^-1 as [N][S][9], from a displacement [N][S][12]. A warp that folds is treated as the
// identity.
static sdm_onnx_value inverse_slope(const warp_graph *w, sdm_onnx_value u)
{
    static const int32_t element[] = {3, 6, 9, 4, 7, 10, 5, 8, 11};
    static const double unit[] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    const size_t nine = 9;
    const sdm_onnx_value slope = sdm_onnx_pick(w->g, u, 2, 9, element);
    return sdm_template_onnx_inverse(
        w->g, sdm_onnx_add(w->g, slope, sdm_onnx_constant(w->g, "identity", 1, &nine, unit)), 1e-2);
}

// One step of Newton's method from y, at most half a cell long.
static sdm_onnx_value improve(const warp_graph *w, sdm_onnx_value y)
{
    sdm_onnx *g = w->g;
    const int64_t n = (int64_t)w->n;
    const sdm_onnx_value u = displacement(w, y), inverse = inverse_slope(w, u),
                         left = sdm_onnx_sub(g, sdm_onnx_sub(g, w->q, y),
                                             sdm_onnx_slice(g, u, 2, 0, 3));
    const sdm_onnx_value matrix = sdm_onnx_reshape(g, inverse, 4, (const int64_t[]){-1, n, 3, 3}),
                         column = sdm_onnx_reshape(g, left, 4, (const int64_t[]){-1, n, 3, 1});
    const sdm_onnx_value step =
        sdm_onnx_reshape(g, sdm_onnx_product(g, matrix, column), 3, (const int64_t[]){-1, n, 3});
    const sdm_onnx_value square =
        sdm_onnx_add(g, sdm_onnx_sum(g, sdm_onnx_mul(g, step, step), 2), sdm_onnx_scalar(g, 1e-24));
    const sdm_onnx_value share = sdm_onnx_node2(
        g, "Div", sdm_onnx_scalar(g, 0.5 * w->lattice->spacing), sdm_onnx_node1(g, "Sqrt", square));
    const sdm_onnx_value factor = sdm_onnx_node2(g, "Min", share, sdm_onnx_scalar(g, 1));
    return sdm_onnx_add(g, y, sdm_onnx_mul(g, factor, step));
}

static warp_graph warp_of(template_graph *t, size_t c, sdm_onnx_value numbers, size_t stations)
{
    // coefficients of 1, t, t^2, t^3: the four weights, then the four slopes
    static const double sixth = 1.0 / 6;
    const double polynomial[] = {sixth,  4 * sixth, sixth, 0,     -0.5, 0,   0.5,  0,   //
                                 -0.5,   0,         0.5,   0,     1,    -2,  1,    0,   //
                                 0.5,    -1,        0.5,   0,     -0.5, 1.5, -1.5, 0.5, //
                                 -sixth, 0.5,       -0.5,  sixth, 0,    0,   0,    0};
    sdm_onnx *g = t->g;
    const sdm_template_part *part = &t->k->parts[c];
    const size_t nodes = sdm_lattice_count(&part->warp), dims[] = {part->n_modes, 3 * nodes};
    const int64_t at = (int64_t)part->amplitudes;
    const sdm_onnx_value amplitudes =
        sdm_onnx_slice(g, numbers, 1, at, at + (int64_t)part->n_modes);
    const sdm_onnx_value control = sdm_onnx_product(
        g, amplitudes, sdm_onnx_floats(g, "modes of the warp", 2, dims, part->modes));
    int64_t node[64];
    for (int64_t i = 0; i < 64; i++)
        node[i] = (i / 16 * part->warp.n[1] + i / 4 % 4) * part->warp.n[0] + i % 4;
    return (warp_graph){
        .g = g,
        .lattice = &part->warp,
        .n = stations,
        .control = sdm_onnx_reshape(g, control, 3, (const int64_t[]){-1, (int64_t)nodes, 3}),
        .polynomial = sdm_onnx_constant(g, "B-splines", 2, (const size_t[]){4, 8}, polynomial),
        .node = sdm_onnx_list(g, 64, node)};
}

// The stations (i, j, k, 1) as voxel indices: [S][4]
static sdm_onnx_value stations_of(const template_graph *t)
{
    const size_t sx = t->blocks[0] + 3, sy = t->blocks[1] + 3, n = sx * sy * (t->blocks[2] + 3);
    float *v = sdm_onnx_memory(t->g, 4 * n, sizeof *v);
    if (!v) return 0;
    for (size_t i = 0; i < n; i++) {
        const size_t at[] = {i % sx, i / sx % sy, i / sx / sy};
        for (size_t a = 0; a < 3; a++) v[4 * i + a] = (float)STEP * ((float)at[a] - 1);
        v[4 * i + 3] = 1;
    }
    return sdm_onnx_floats(t->g, "stations", 2, (const size_t[]){n, 4}, v);
}

/* Corners of blocks. */

// v[N][width][sz][sy][sx] at the corners, `by` stations further along an axis.
static sdm_onnx_value at_corners(const template_graph *t, sdm_onnx_value v, int axis, int by)
{
    for (int a = 0; a < 3; a++) {
        const int64_t first = 1 + (a == axis ? by : 0), n = (int64_t)t->blocks[a] + 1;
        v = sdm_onnx_slice(t->g, v, 4 - a, first, first + n);
    }
    return v;
}

// corners and known of part c, from the indices u[N][3][S] of its stations and their metric: as in
// template_corners.c.
static void set_corners(template_graph *t, size_t c, sdm_onnx_value u, sdm_onnx_value metric,
                        size_t stations)
{
    sdm_onnx *g = t->g;
    part_graph *p = &t->part[c];
    const int64_t grid[] = {-1, 0, (int64_t)t->blocks[2] + 3, (int64_t)t->blocks[1] + 3,
                            (int64_t)t->blocks[0] + 3},
                  cells = (int64_t)((t->blocks[0] + 1) * (t->blocks[1] + 1)),
                  layers = (int64_t)t->blocks[2] + 1;
    sdm_onnx_value f, gradient;
    sdm_template_onnx_lookup(t, c, stations, u, &f, &gradient);
    const sdm_onnx_value factor = sdm_template_onnx_factor(g, gradient, metric),
                         r = c == 0 && t->correction ? sdm_template_onnx_correction(t, stations, u)
                                                     : sdm_onnx_sub(g, f, f);
    // f, gradient, known, factor, r, u: 10 functions of the station
    const sdm_onnx_value list[] = {f, gradient, sdm_template_onnx_known(t, c, u), factor, r, u};
    const sdm_onnx_value all =
        sdm_onnx_reshape(g, sdm_onnx_join(g, 1, 6, list), 5,
                         (const int64_t[]){grid[0], 10, grid[2], grid[3], grid[4]});
    const sdm_onnx_value here = at_corners(t, all, 0, 0), s = sdm_onnx_slice(g, here, 1, 5, 6),
                         value = sdm_onnx_slice(g, here, 1, 0, 1);
    sdm_onnx_value four[4];
    four[0] = sdm_onnx_add(g, sdm_onnx_mul(g, value, s), sdm_onnx_slice(g, here, 1, 6, 7));
    const sdm_onnx_value moving =
        sdm_onnx_mul(g, sdm_onnx_mul(g, s, sdm_onnx_slice(g, here, 1, 1, 4)),
                     sdm_onnx_scalar(g, t->k->parts[c].near.spacing));
    for (int a = 0; a < 3; a++) {
        const sdm_onnx_value change =
            sdm_onnx_mul(g, sdm_onnx_sub(g, at_corners(t, all, a, 1), at_corners(t, all, a, -1)),
                         sdm_onnx_scalar(g, 0.5));
        const sdm_onnx_value carried =
            sdm_onnx_sum(g, sdm_onnx_mul(g, moving, sdm_onnx_slice(g, change, 1, 7, 10)), 1);
        const sdm_onnx_value rest =
            sdm_onnx_add(g, sdm_onnx_mul(g, value, sdm_onnx_slice(g, change, 1, 5, 6)),
                         sdm_onnx_slice(g, change, 1, 6, 7));
        four[1 + a] = sdm_onnx_add(g, carried, rest);
    }
    p->corners = sdm_onnx_reshape(g, sdm_onnx_join(g, 1, 4, four), 4,
                                  (const int64_t[]){-1, 4, layers, cells});
    p->known = sdm_onnx_reshape(g, sdm_onnx_slice(g, here, 1, 4, 5), 4,
                                (const int64_t[]){-1, 1, layers, cells});
}

void sdm_template_onnx_warp(template_graph *t, size_t c, sdm_onnx_value numbers)
{
    sdm_onnx *g = t->g;
    part_graph *p = &t->part[c];
    const sdm_lattice *near = &t->k->parts[c].near;
    const size_t line = t->blocks[0] + 3, rows = t->blocks[1] + 3, layers = t->blocks[2] + 3,
                 n = line * rows * layers;
    const int64_t swap[] = {0, 2, 1}, planes = (int64_t)layers, plane = (int64_t)(line * rows);
    const sdm_onnx_value origin = along_axes(g, near->origin[0], near->origin[1], near->origin[2]);
    const sdm_onnx_value index =
        sdm_onnx_product(g, stations_of(t), sdm_onnx_transpose(g, p->index, 3, swap));
    warp_graph w = warp_of(t, c, numbers, n);
    w.q = sdm_onnx_add(g, sdm_onnx_mul(g, index, sdm_onnx_scalar(g, near->spacing)), origin);
    sdm_onnx_value y = w.q;
    for (int i = 0; i < ITERATIONS; i++) y = improve(&w, y);
    const sdm_onnx_value inverse = sdm_onnx_reshape(g, inverse_slope(&w, displacement(&w, y)), 4,
                                                    (const int64_t[]){-1, (int64_t)n, 3, 3});
    const sdm_onnx_value back = sdm_onnx_product(
        g, inverse, sdm_onnx_reshape(g, p->frame, 4, (const int64_t[]){-1, 1, 3, 3}));
    const sdm_onnx_value metric = sdm_template_onnx_metric(g, n, back);
    const sdm_onnx_value u = sdm_onnx_transpose(
        g, sdm_onnx_mul(g, sdm_onnx_sub(g, y, origin), sdm_onnx_scalar(g, 1 / near->spacing)), 3,
        swap);
    p->points = sdm_onnx_reshape(g, u, 4, (const int64_t[]){-1, 3, planes, plane});
    p->metric = sdm_onnx_reshape(g, metric, 4, (const int64_t[]){-1, 6, planes, plane});
    set_corners(t, c, u, metric, n);
}
