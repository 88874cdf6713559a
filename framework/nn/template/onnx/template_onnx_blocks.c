/* The distance to a part in a layer of blocks, as ONNX operators, inside the loop. */
#include <string.h>

#include "sdm/memory.h"
#include "template_graph.h"

enum { STEP = SDM_TEMPLATE_STEP };

// matrix[rows][stations] = the expansion from the stations by cubic B-splines for the rows voxels
// from `first` on, with their prefilter. false: out of memory.
static bool cubic_matrix(const template_graph *t, size_t first, size_t rows, size_t stations,
                         float *matrix)
{
    float *through = NULL; // [stations][stations] the coefficients of each sample
    if (SDM_ALLOC(&through, stations * stations, "stations", NULL)) return false;
    for (size_t i = 0; i < stations; i++) through[i * stations + i] = 1;
    sdm_template_spline(through, stations, stations, stations);
    for (size_t v = 0; v < rows; v++) {
        float *to = matrix + v * stations;
        memset(to, 0, stations * sizeof *to);
        for (size_t k = 0; k < 4; k++) {
            const float w = t->k->expansion.cubic[k][(first + v) % STEP],
                        *from = through + ((first + v) / STEP + k) * stations;
            for (size_t i = 0; i < stations; i++) to[i] += w * from[i];
        }
    }
    sdm_free(through);
    return true;
}

// matrix[rows][stations] = linear interpolation between the stations.
static void linear_matrix(const template_graph *t, size_t first, size_t rows, size_t stations,
                          float *matrix)
{
    memset(matrix, 0, rows * stations * sizeof *matrix);
    for (size_t v = 0; v < rows; v++) {
        const float w = t->k->expansion.linear[(first + v) % STEP];
        float *to = matrix + v * stations + (first + v) / STEP + 1;
        to[0] = 1 - w, to[1] = w;
    }
}

static size_t layer_numbers(const template_graph *t)
{
    const size_t corners = t->blocks[2] + 1, stations = t->blocks[2] + 3;
    return 1 + 2 * corners + 2 * STEP * stations;
}

sdm_onnx_value sdm_template_onnx_layers(const template_graph *t, size_t *n)
{
    const size_t layers = t->blocks[2], corners = layers + 1, stations = layers + 3;
    *n = layer_numbers(t);
    float *rows = sdm_onnx_memory(t->g, layers * *n, sizeof *rows);
    for (size_t b = 0; b < layers && rows; b++) {
        float *row = rows + b * *n, *cubic = row + 1 + 2 * corners;
        row[0] = (float)(STEP * b);
        row[1 + b] = row[1 + corners + b + 1] = 1;
        if (!cubic_matrix(t, STEP * b, STEP, stations, cubic)) return 0;
        linear_matrix(t, STEP * b, STEP, stations, cubic + STEP * stations);
    }
    return rows ? sdm_onnx_floats(t->g, "layers", 2, (const size_t[]){layers, *n}, rows) : 0;
}

void sdm_template_onnx_layer(template_graph *t, sdm_onnx_value slice)
{
    sdm_onnx *g = t->g;
    const int64_t corners = (int64_t)t->blocks[2] + 1, stations = corners + 2, at = 1 + 2 * corners,
                  next = at + STEP * stations;
    t->layer.first = sdm_onnx_slice(g, slice, 0, 0, 1);
    t->layer.corners =
        sdm_onnx_reshape(g, sdm_onnx_slice(g, slice, 0, 1, at), 2, (const int64_t[]){2, corners});
    t->layer.cubic = sdm_onnx_reshape(g, sdm_onnx_slice(g, slice, 0, at, next), 2,
                                      (const int64_t[]){STEP, stations});
    t->layer.linear = sdm_onnx_reshape(g, sdm_onnx_slice(g, slice, 0, next, next + STEP * stations),
                                       2, (const int64_t[]){STEP, stations});
}

/* Cubic interpolation in blocks. */

// The weights of a block's ends for its voxels along an axis: of the values, linear and the
// correction of a cubic curve, and of the slopes.
typedef enum weights { LINE, BEND, TANGENT } weights;

static void end_weights(weights kind, size_t voxel, float w[2])
{
    const float t = (float)(voxel % STEP) / STEP, s = 1 - t, first = t * s * s, second = t * t * s;
    w[0] = kind == LINE ? s : kind == BEND ? first - second : first;
    w[1] = kind == LINE ? t : kind == BEND ? second - first : -second;
}

// Weights [STEP blocks][blocks + 1], or transposed.
static sdm_onnx_value matrix(const template_graph *t, weights kind, size_t blocks, bool transposed)
{
    const size_t voxels = STEP * blocks, corners = blocks + 1;
    float *m = sdm_onnx_memory(t->g, voxels * corners, sizeof *m);
    if (!m) return 0;
    for (size_t v = 0; v < voxels; v++) {
        float w[2];
        end_weights(kind, v, w);
        for (size_t e = 0; e < 2; e++) {
            const size_t c = v / STEP + e;
            m[transposed ? c * voxels + v : v * corners + c] = w[e];
        }
    }
    const size_t dims[] = {transposed ? corners : voxels, transposed ? voxels : corners};
    return sdm_onnx_floats(t->g, "blocks", 2, dims, m);
}

// [N][4][Y][X] = the distance in a layer from corner[N][4][2][cy cx]: value and slopes by blocks.
// Linear interpolation, and the correction of the edges along each axis, interpolated between them.
static sdm_onnx_value hermite(const template_graph *t, sdm_onnx_value corner)
{
    sdm_onnx *g = t->g;
    const size_t bx = t->blocks[0], by = t->blocks[1];
    sdm_onnx_value x[3], y[3], z[3], in[4];
    for (weights k = LINE; k <= TANGENT; k++) {
        x[k] = matrix(t, k, bx, true), y[k] = matrix(t, k, by, false);
        z[k] = matrix(t, k, 1, false);
    }
    const sdm_onnx_value all = sdm_onnx_reshape(
        g, corner, 5, (const int64_t[]){-1, 4, 2, (int64_t)by + 1, (int64_t)bx + 1});
    for (int i = 0; i < 4; i++) in[i] = sdm_onnx_slice(g, all, 1, i, i + 1);
    // along x: linear, with the correction along x, and the slopes by y and by z
    const sdm_onnx_value p = sdm_onnx_product(g, in[0], x[LINE]),
                         px = sdm_onnx_add(g, sdm_onnx_product(g, in[0], x[BEND]),
                                           sdm_onnx_product(g, in[1], x[TANGENT])),
                         sy = sdm_onnx_product(g, in[2], x[LINE]),
                         sz = sdm_onnx_product(g, in[3], x[LINE]);
    // along y: linear, the corrections along x and y, and the slope by z
    const sdm_onnx_value q = sdm_onnx_product(g, y[LINE], p), qx = sdm_onnx_product(g, y[LINE], px),
                         qy = sdm_onnx_add(g, sdm_onnx_product(g, y[BEND], p),
                                           sdm_onnx_product(g, y[TANGENT], sy)),
                         qz = sdm_onnx_product(g, y[LINE], sz);
    // along z
    const int64_t plane[] = {-1, 2, (int64_t)(STEP * STEP * bx * by)};
    const sdm_onnx_value straight = sdm_onnx_reshape(g, sdm_onnx_add(g, q, sdm_onnx_add(g, qx, qy)),
                                                     3, plane),
                         value = sdm_onnx_reshape(g, q, 3, plane),
                         slope = sdm_onnx_reshape(g, qz, 3, plane);
    const sdm_onnx_value sum = sdm_onnx_add(g, sdm_onnx_product(g, z[LINE], straight),
                                            sdm_onnx_add(g, sdm_onnx_product(g, z[BEND], value),
                                                         sdm_onnx_product(g, z[TANGENT], slope)));
    return sdm_onnx_reshape(
        g, sum, 4, (const int64_t[]){-1, STEP, (int64_t)(STEP * by), (int64_t)(STEP * bx)});
}

// The smaller of neighbours along an axis of n elements.
static sdm_onnx_value least_neighbours(sdm_onnx *g, sdm_onnx_value v, int axis, size_t n)
{
    const int64_t end = (int64_t)n;
    return sdm_onnx_node2(g, "Min", sdm_onnx_slice(g, v, axis, 0, end - 1),
                          sdm_onnx_slice(g, v, axis, 1, end));
}

// [N][1][by][bx]: 1 for blocks all of whose corners known[N][1][2][cy cx] are 1, else 0.
static sdm_onnx_value known_blocks(const template_graph *t, sdm_onnx_value known)
{
    sdm_onnx *g = t->g;
    const size_t cx = t->blocks[0] + 1, cy = t->blocks[1] + 1;
    const sdm_onnx_value plane =
        sdm_onnx_reshape(g, sdm_onnx_extreme(g, "ReduceMin", known, 2), 4,
                         (const int64_t[]){-1, 1, (int64_t)cy, (int64_t)cx});
    return least_neighbours(g, least_neighbours(g, plane, 2, cy), 3, cx);
}

// exact[N][4][Y][X] with the share[N][1][by][bx] of `far`.
static sdm_onnx_value blend(const template_graph *t, sdm_onnx_value share, sdm_onnx_value far,
                            sdm_onnx_value exact)
{
    sdm_onnx *g = t->g;
    for (int a = 0; a < 2; a++) {
        const size_t n = STEP * t->blocks[a];
        int32_t *index = sdm_onnx_memory(g, n, sizeof *index);
        if (!index) return 0;
        for (size_t i = 0; i < n; i++) index[i] = (int32_t)(i / STEP);
        share =
            sdm_onnx_gather(g, share, sdm_onnx_indices(g, "block of a voxel", 1, &n, index), 3 - a);
    }
    return sdm_onnx_add(g, exact, sdm_onnx_mul(g, share, sdm_onnx_sub(g, far, exact)));
}

/* Parts. */

// A row v[N][1][V] of the voxels of the layer as [N][4][Y][X].
static sdm_onnx_value as_layer(const template_graph *t, sdm_onnx_value v)
{
    const int64_t dims[] = {-1, STEP, (int64_t)(STEP * t->blocks[1]),
                            (int64_t)(STEP * t->blocks[0])};
    return sdm_onnx_reshape(t->g, v, 4, dims);
}

// The indices [N][3][n] of part c, which has no warp, at places[4][n] of the first layer.
static sdm_onnx_value index_at(const template_graph *t, size_t c, sdm_onnx_value places)
{
    sdm_onnx *g = t->g;
    const sdm_onnx_value index = t->part[c].index,
                         up = sdm_onnx_mul(g, sdm_onnx_slice(g, index, 2, 2, 3), t->layer.first);
    return sdm_onnx_add(g, sdm_onnx_product(g, index, places), up);
}

// The distance at the indices u[N][3][V] with their metric, and the correction.
static sdm_onnx_value distance_at(const template_graph *t, size_t c, sdm_onnx_value u,
                                  sdm_onnx_value metric)
{
    sdm_onnx *g = t->g;
    const size_t points = template_graph_voxels(t);
    sdm_onnx_value f, gradient;
    sdm_template_onnx_lookup(t, c, points, u, &f, &gradient);
    if (!t->part[c].rigid) f = sdm_onnx_mul(g, f, sdm_template_onnx_factor(g, gradient, metric));
    if (c == 0 && t->correction) f = sdm_onnx_add(g, f, sdm_template_onnx_correction(t, points, u));
    return as_layer(t, f);
}

// 1 for blocks that lie wholly within the lattice `near` of part c: [N][1][by][bx].
static sdm_onnx_value within(const template_graph *t, size_t c)
{
    sdm_onnx *g = t->g;
    const int32_t *n = t->k->near[c].n;
    const double rounding = 1e-4, last[] = {n[0] - 1, n[1] - 1, n[2] - 1};
    const sdm_onnx_value by = sdm_onnx_slice(g, t->part[c].index, 2, 0, 3),
                         sum = sdm_onnx_sum(g, sdm_onnx_node1(g, "Abs", by), 2),
                         extent = sdm_onnx_add(
                             g, sdm_onnx_mul(g, sum, sdm_onnx_scalar(g, 0.5 * (STEP - 1))),
                             sdm_onnx_scalar(g, rounding));
    const sdm_onnx_value middle = index_at(t, c, t->middles),
                         end = sdm_onnx_constant(g, "last node", 2, (const size_t[]){3, 1}, last);
    const sdm_onnx_value room =
        sdm_onnx_sub(g, sdm_onnx_node2(g, "Min", middle, sdm_onnx_sub(g, end, middle)), extent);
    const sdm_onnx_value least = sdm_onnx_extreme(g, "ReduceMin", room, 1);
    const sdm_onnx_value in =
        sdm_onnx_node3(g, "Where", sdm_onnx_node2(g, "Less", least, sdm_onnx_scalar(g, 0)),
                       sdm_onnx_scalar(g, 0), sdm_onnx_scalar(g, 1));
    return sdm_onnx_reshape(g, in, 4,
                            (const int64_t[]){-1, 1, (int64_t)t->blocks[1], (int64_t)t->blocks[0]});
}

// A rigid part is interpolated in the blocks that do not lie within its lattice `near`.
static sdm_onnx_value rigid_part(const template_graph *t, size_t c)
{
    sdm_onnx *g = t->g;
    const part_graph *p = &t->part[c];
    const size_t corners = 2 * (t->blocks[0] + 1) * (t->blocks[1] + 1);
    const int64_t planes[] = {-1, 4, 2, (int64_t)corners / 2}, one[] = {-1, 1, 2, planes[3]};
    const sdm_onnx_value u = index_at(t, c, t->edges);
    sdm_onnx_value f, gradient;
    sdm_template_onnx_lookup(t, c, corners, u, &f, &gradient);
    // slopes by blocks
    const sdm_onnx_value by = sdm_onnx_transpose(g, sdm_onnx_slice(g, p->index, 2, 0, 3), 3,
                                                 (const int64_t[]){0, 2, 1}),
                         scale = sdm_onnx_scalar(g, STEP * t->k->parts[c].near.spacing);
    const sdm_onnx_value both[] = {f, sdm_onnx_product(g, sdm_onnx_mul(g, by, scale), gradient)};
    const sdm_onnx_value far =
        hermite(t, sdm_onnx_reshape(g, sdm_onnx_join(g, 1, 2, both), 4, planes));
    const sdm_onnx_value known =
        known_blocks(t, sdm_onnx_reshape(g, sdm_template_onnx_known(t, c, u), 4, one));
    const sdm_onnx_value beyond = sdm_onnx_sub(g, sdm_onnx_scalar(g, 1), within(t, c));
    const sdm_onnx_value exact = distance_at(t, c, index_at(t, c, t->voxels), 0);
    return blend(t, sdm_onnx_mul(g, known, beyond), far, exact);
}

static sdm_onnx_value affine_part(const template_graph *t, size_t c)
{
    const sdm_onnx_value metric = sdm_template_onnx_metric(t->g, 1, t->part[c].frame);
    return distance_at(t, c, index_at(t, c, t->voxels), metric);
}

// Values at the stations [N][width][sz][sy sx] in the voxels of the layer, [N][width][V]: the
// matrix along_z[4][sz] of the layer, then those along y and x.
static sdm_onnx_value expand(const template_graph *t, sdm_onnx_value v, size_t width,
                             sdm_onnx_value along_z, bool cubic)
{
    sdm_onnx *g = t->g;
    const size_t n[] = {t->blocks[0] + 3, t->blocks[1] + 3},
                 voxels[] = {STEP * t->blocks[0], STEP * t->blocks[1]};
    sdm_onnx_value along[2];
    for (int a = 0; a < 2; a++) {
        float *m = sdm_onnx_memory(g, voxels[a] * n[a], sizeof *m);
        if (!m) return 0;
        if (!cubic)
            linear_matrix(t, 0, voxels[a], n[a], m);
        else if (!cubic_matrix(t, 0, voxels[a], n[a], m))
            return 0;
        along[a] = sdm_onnx_floats(g, "stations", 2, (const size_t[]){voxels[a], n[a]}, m);
    }
    const sdm_onnx_value planes =
        sdm_onnx_reshape(g, sdm_onnx_product(g, along_z, v), 5,
                         (const int64_t[]){-1, (int64_t)width, STEP, (int64_t)n[1], (int64_t)n[0]});
    const sdm_onnx_value lines = sdm_onnx_product(g, along[1], planes),
                         all = sdm_onnx_product(
                             g, lines, sdm_onnx_transpose(g, along[0], 2, (const int64_t[]){1, 0}));
    return sdm_onnx_reshape(
        g, all, 3, (const int64_t[]){-1, (int64_t)width, (int64_t)template_graph_voxels(t)});
}

// A part with a warp is interpolated in the blocks that lie four voxels from its surface.
static sdm_onnx_value warped_part(const template_graph *t, size_t c)
{
    sdm_onnx *g = t->g;
    const part_graph *p = &t->part[c];
    const double *s = t->model->info.grid.spacing, two = s[0] > s[1] ? s[0] : s[1],
                 longest = two > s[2] ? two : s[2];
    const sdm_onnx_value far = hermite(t, sdm_onnx_product(g, t->layer.corners, p->corners)),
                         known = known_blocks(t, sdm_onnx_product(g, t->layer.corners, p->known));
    // the smallest distance of each block, in voxels
    const sdm_onnx_value plane = sdm_onnx_extreme(g, "ReduceMin", sdm_onnx_node1(g, "Abs", far), 1),
                         minus = sdm_onnx_node1(g, "Neg", plane);
    sdm_onnx_set_ints(g, "kernel_shape", 2, (const int64_t[]){STEP, STEP});
    sdm_onnx_set_ints(g, "strides", 2, (const int64_t[]){STEP, STEP});
    const sdm_onnx_value pool = sdm_onnx_node1(g, "MaxPool", minus),
                         least = sdm_onnx_mul(g, pool, sdm_onnx_scalar(g, -1 / longest));
    const sdm_onnx_value beyond = sdm_onnx_sub(g, least,
                                               sdm_onnx_scalar(g, (double)SDM_TEMPLATE_FAR_VOXELS)),
                         share = sdm_onnx_node2(
                             g, "Min", sdm_onnx_node2(g, "Max", beyond, sdm_onnx_scalar(g, 0)),
                             sdm_onnx_scalar(g, 1));
    const sdm_onnx_value u = expand(t, p->points, 3, t->layer.cubic, true),
                         metric = expand(t, p->metric, 6, t->layer.linear, false);
    return blend(t, sdm_onnx_mul(g, share, known), far, distance_at(t, c, u, metric));
}

sdm_onnx_value sdm_template_onnx_part(const template_graph *t, size_t c)
{
    const part_graph *p = &t->part[c];
    return p->warped ? warped_part(t, c) : p->rigid ? rigid_part(t, c) : affine_part(t, c);
}
