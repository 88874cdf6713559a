/* A template network as ONNX operators: numbers, frames, and the loop over layers of blocks. */
#include "template_graph.h"

enum { STEP = SDM_TEMPLATE_STEP };

// Row i of the functions, as floats.
static void fill_functions(const void *user, size_t i, float *to)
{
    const template_network *k = user;
    for (size_t f = 0; f < k->n_terms; f++) to[f] = (float)k->functions[i * k->n_terms + f];
}

// numbers[N][K] at x[N][P]
static sdm_onnx_value numbers_of(const template_graph *t, sdm_onnx_value x)
{
    sdm_onnx *g = t->g;
    const template_network *k = t->k;
    const size_t dims[] = {k->n_numbers, k->n_terms};
    const int64_t swap[] = {1, 0};
    const sdm_onnx_value phi =
        sdm_onnx_polynomials(g, sdm_onnx_transpose(g, x, 2, swap), k->exponents, k->n_terms,
                             t->model->info.n_params, k->degree);
    const sdm_onnx_value functions = sdm_onnx_weights(g, "functions", 2, dims, fill_functions, k);
    return sdm_onnx_transpose(g, sdm_onnx_product(g, functions, phi), 2, swap);
}

// The inverse [N][3][3] of the rotation by a vector w[N][3] (Rodrigues).
static sdm_onnx_value inverse_rotation(sdm_onnx *g, sdm_onnx_value w)
{
    static const double cross[3][9] = {{0, 0, 0, 0, 0, -1, 0, 1, 0},
                                       {0, 0, 1, 0, 0, 0, -1, 0, 0},
                                       {0, -1, 0, 1, 0, 0, 0, 0, 0}},
                        unit[] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    const size_t nine[] = {3, 9}, three[] = {3, 3};
    const int64_t matrix[] = {-1, 3, 3}, scalar[] = {-1, 1, 1};
    const sdm_onnx_value square = sdm_onnx_sum(g, sdm_onnx_mul(g, w, w), 1),
                         angle = sdm_onnx_node1(g, "Sqrt",
                                                sdm_onnx_add(g, square, sdm_onnx_scalar(g, 1e-16))),
                         half = sdm_onnx_mul(g, angle, sdm_onnx_scalar(g, 0.5));
    const sdm_onnx_value sinc = sdm_onnx_node2(g, "Div", sdm_onnx_node1(g, "Sin", angle), angle),
                         sinc_half = sdm_onnx_node2(g, "Div", sdm_onnx_node1(g, "Sin", half), half);
    const sdm_onnx_value x = sdm_onnx_reshape(
        g, sdm_onnx_product(g, w, sdm_onnx_constant(g, "cross product", 2, nine, cross[0])), 3,
        matrix);
    const sdm_onnx_value even = sdm_onnx_mul(g, sdm_onnx_mul(g, sinc_half, sinc_half),
                                             sdm_onnx_scalar(g, 0.5)),
                         first = sdm_onnx_mul(g, sdm_onnx_reshape(g, sinc, 3, scalar), x),
                         second = sdm_onnx_mul(g, sdm_onnx_reshape(g, even, 3, scalar),
                                               sdm_onnx_product(g, x, x));
    return sdm_onnx_add(g, sdm_onnx_sub(g, sdm_onnx_constant(g, "identity", 2, three, unit), first),
                        second);
}

// The inverse [N][3][3] of I + S for the stretch S of an affine frame, from its numbers [N][6].
static sdm_onnx_value inverse_stretch(sdm_onnx *g, sdm_onnx_value n)
{
    static const double unit[] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    const size_t nine = 9;
    const sdm_onnx_value s = sdm_onnx_pick(g, n, 1, 9,
                                           (const int32_t[]){0, 5, 4, 5, 1, 3, 4, 3, 2}),
                         m = sdm_onnx_add(g, s, sdm_onnx_constant(g, "identity", 1, &nine, unit));
    return sdm_onnx_reshape(g, sdm_template_onnx_inverse(g, m, 0), 3, (const int64_t[]){-1, 3, 3});
}

static sdm_onnx_value point(sdm_onnx *g, const double v[3])
{
    return sdm_onnx_constant(g, "point", 2, (const size_t[]){3, 1}, v);
}

// frame and place of part c: those of its parent, then the inverse of its relative frame
static void set_frame(template_graph *t, size_t c, sdm_onnx_value numbers)
{
    sdm_onnx *g = t->g;
    const sdm_template_part *part = &t->k->parts[c];
    part_graph *p = &t->part[c];
    if (part->parent >= 0) {
        p->frame = t->part[part->parent].frame;
        p->place = t->part[part->parent].place;
    }
    if (part->frame == SDM_FRAME_NONE) return;
    const int64_t at = (int64_t)part->numbers;
    const sdm_onnx_value moved = sdm_onnx_reshape(g, sdm_onnx_slice(g, numbers, 1, at + 3, at + 6),
                                                  3, (const int64_t[]){-1, 3, 1});
    const sdm_onnx_value pivot = point(g, part->pivot);
    sdm_onnx_value m = inverse_rotation(g, sdm_onnx_slice(g, numbers, 1, at, at + 3));
    if (part->frame == SDM_FRAME_AFFINE)
        m = sdm_onnx_product(g, inverse_stretch(g, sdm_onnx_slice(g, numbers, 1, at + 6, at + 12)),
                             m);
    const sdm_onnx_value from = sdm_onnx_sub(g, sdm_onnx_sub(g, p->place, pivot), moved);
    p->place = sdm_onnx_add(g, sdm_onnx_product(g, m, from), pivot);
    p->frame = sdm_onnx_product(g, m, p->frame);
}

// Sets the matrix `index` of part c: it takes a voxel (i, j, k, 1) to its place in the lattice
// `near`.
static void set_index(template_graph *t, size_t c)
{
    sdm_onnx *g = t->g;
    part_graph *p = &t->part[c];
    const sdm_grid *grid = &t->model->info.grid;
    const sdm_lattice *near = &t->k->parts[c].near;
    double steps[9];
    for (int i = 0; i < 9; i++) steps[i] = grid->dir[i] * grid->spacing[i % 3];
    const sdm_onnx_value by = sdm_onnx_product(
        g, p->frame, sdm_onnx_constant(g, "steps", 2, (const size_t[]){3, 3}, steps));
    const sdm_onnx_value first =
        sdm_onnx_add(g, sdm_onnx_product(g, p->frame, point(g, grid->origin)), p->place);
    const sdm_onnx_value both[] = {by, sdm_onnx_sub(g, first, point(g, near->origin))};
    p->index = sdm_onnx_mul(g, sdm_onnx_join(g, 2, 2, both), sdm_onnx_scalar(g, 1 / near->spacing));
}

static void set_part(template_graph *t, size_t c, sdm_onnx_value numbers)
{
    const sdm_template_part *part = &t->k->parts[c];
    part_graph *p = &t->part[c];
    p->warped = part->n_modes > 0;
    p->rigid = sdm_template_is_rigid(t->k, c);
    const size_t dims[] = {sdm_lattice_count(&part->near) + sdm_lattice_count(&part->far), 4};
    p->nodes = sdm_onnx_floats(t->g, "template", 2, dims, part->near_nodes);
    set_frame(t, c, numbers);
    set_index(t, c);
    if (p->warped) sdm_template_onnx_warp(t, c, numbers);
}

// (i, j, k, 1) of nx x ny x nz points, x fastest, `step` voxels apart from `first` on: [4][n]
static sdm_onnx_value places(sdm_onnx *g, size_t nx, size_t ny, size_t nz, double step,
                             double first)
{
    const size_t n = nx * ny * nz;
    float *v = sdm_onnx_memory(g, 4 * n, sizeof *v);
    if (!v) return 0;
    for (size_t i = 0; i < n; i++) {
        v[i] = (float)(first + step * (double)(i % nx));
        v[n + i] = (float)(first + step * (double)(i / nx % ny));
        v[2 * n + i] = (float)(first + step * (double)(i / nx / ny));
        v[3 * n + i] = 1;
    }
    return sdm_onnx_floats(g, "voxels", 2, (const size_t[]){4, n}, v);
}

// The root of the frames: the identity, for each map.
static void set_root(template_graph *t, sdm_onnx_value x)
{
    static const double unit[] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, origin[3];
    sdm_onnx *g = t->g;
    const sdm_onnx_value first = sdm_onnx_slice(g, x, 1, 0, 1),
                         zero = sdm_onnx_reshape(g, sdm_onnx_sub(g, first, first), 3,
                                                 (const int64_t[]){-1, 1, 1}),
                         one = sdm_onnx_constant(g, "identity", 2, (const size_t[]){3, 3}, unit);
    const sdm_onnx_value frame = sdm_onnx_add(g, one, zero),
                         place = sdm_onnx_add(g, point(g, origin), zero);
    for (size_t c = 0; c < t->k->n_parts; c++) t->part[c].frame = frame, t->part[c].place = place;
}

sdm_onnx_value sdm_template_onnx(const sdm_model *m, sdm_onnx *g, sdm_onnx_value x)
{
    const template_network *k = m->network;
    const int64_t *n = m->info.grid.n;
    template_graph *t = sdm_onnx_memory(g, 1, sizeof *t);
    if (!t) return 0;
    *t = (template_graph){.g = g, .model = m, .k = k};
    for (int a = 0; a < 3; a++) t->blocks[a] = ((size_t)n[a] + STEP - 1) / STEP;
    const size_t bx = t->blocks[0], by = t->blocks[1], bz = t->blocks[2];
    if (k->correction)
        t->correction = sdm_onnx_reshape(
            g, k->correction->kind->onnx(k->correction, g, x), 2,
            (const int64_t[]){-1, (int64_t)sdm_grid_count(&k->correction->info.grid)});
    const sdm_onnx_value numbers = numbers_of(t, x);
    set_root(t, x);
    bool still = false, rigid = false;
    for (size_t c = 0; c < k->n_parts; c++) {
        set_part(t, c, numbers);
        still |= !t->part[c].warped;
        rigid |= t->part[c].rigid;
    }
    if (still) t->voxels = places(g, STEP * bx, STEP * by, STEP, 1, 0);
    if (rigid) {
        t->edges = places(g, bx + 1, by + 1, 2, STEP, 0);
        t->middles = places(g, bx, by, 1, STEP, 0.5 * (STEP - 1));
    }

    size_t slice;
    const sdm_onnx_value layers = sdm_template_onnx_layers(t, &slice);
    sdm_template_onnx_layer(t, sdm_onnx_loop_begin(g, layers, 1, &slice));
    sdm_onnx_value map = sdm_template_onnx_part(t, 0);
    for (size_t c = 1; c < k->n_parts; c++)
        map = sdm_onnx_node2(g, "Min", map, sdm_template_onnx_part(t, c));
    map = sdm_onnx_loop_end(g, map, 4, (const size_t[]){0, STEP, STEP * by, STEP * bx}, 1);
    map = sdm_onnx_reshape(
        g, map, 4,
        (const int64_t[]){-1, (int64_t)(STEP * bz), (int64_t)(STEP * by), (int64_t)(STEP * bx)});
    for (int a = 0; a < 3; a++) map = sdm_onnx_slice(g, map, 3 - a, 0, n[a]);
    return sdm_model_onnx_maps(m, g, map);
}
