/* Derivatives of the maps of a template network by the parameters, in forward mode. No
   allocation. */
#include <math.h>
#include <string.h>

#include "template_work.h"

typedef float quad __attribute__((vector_size(16)));

static quad quad_at(const float *p)
{
    quad q;
    memcpy(&q, p, sizeof q);
    return q;
}

enum { BLOCK = SDM_TEMPLATE_STEP, VOXELS = SDM_TEMPLATE_BLOCK_VOXELS };

/* Derivatives of the value of a voxel: by its index u[3], and by the metric xx, yy, zz, yz, xz,
   xy. */
typedef struct value_slope {
    float u[3], metric[6];
} value_slope;

/* A trilinear cell: the lower node along each axis, the fraction of the way to the next one, and
   how fast the fraction changes with the index in `near` (0 where the index is clamped). */
typedef struct cell {
    ptrdiff_t node[3];
    float t[3], rate;
    bool moves[3];
} cell;

static cell cell_of(const float u[3], float scale, const float offset[3], const int32_t n[3])
{
    cell c = {.rate = scale};
    for (int a = 0; a < 3; a++) {
        const float x = u[a] * scale + offset[a], last = (float)(n[a] - 1);
        const float y = x > 0 ? x < last ? x : last : 0;
        ptrdiff_t i = (ptrdiff_t)y;
        if (i > n[a] - 2) i = n[a] - 2;
        c.node[a] = i;
        c.t[a] = y - (float)i;
        c.moves[a] = x > 0 && x < last;
    }
    return c;
}

/* The template at a point: distance f, gradient g, and their derivatives by the index u. */
typedef struct template_slope {
    float f, g[3], df[3], dg[3][3]; /* dg[a]: derivative of g by u[a] */
} template_slope;

static template_slope template_at(const template_level *l, const float u[3])
{
    const cell c = cell_of(u, l->scale, l->offset, l->n);
    const ptrdiff_t line = 4 * (ptrdiff_t)l->n[0], plane = line * l->n[1];
    const float *at = l->nodes + 4 * c.node[0] + line * c.node[1] + plane * c.node[2];
    // sums over the corners: no derivative, by x, y, z, and the mixed ones yz, xz, xy
    quad column[4], column_z[4];
    for (int i = 0; i < 4; i++) {
        const float *p = at + (i & 1 ? 4 : 0) + (i & 2 ? line : 0);
        column_z[i] = quad_at(p + plane) - quad_at(p);
        column[i] = quad_at(p) + c.t[2] * column_z[i];
    }
    const quad y0 = column[2] - column[0], y1 = column[3] - column[1];
    const quad yz0 = column_z[2] - column_z[0], yz1 = column_z[3] - column_z[1];
    const quad r0 = column[0] + c.t[1] * y0, r1 = column[1] + c.t[1] * y1;
    const quad z0 = column_z[0] + c.t[1] * yz0, z1 = column_z[1] + c.t[1] * yz1;
    const quad qx = r1 - r0, qxy = y1 - y0, qxz = z1 - z0;
    const quad q = r0 + c.t[0] * qx, qy = y0 + c.t[0] * qxy, qz = z0 + c.t[0] * qxz,
               qyz = yz0 + c.t[0] * (yz1 - yz0);
    float bend[3], slope[3];
    for (int a = 0; a < 3; a++) bend[a] = c.t[a] * (1 - c.t[a]), slope[a] = 1 - 2 * c.t[a];
    template_slope s = {.f = q[0] - l->half * (bend[0] * qx[1] + bend[1] * qy[2] + bend[2] * qz[3]),
                        .g = {q[1], q[2], q[3]}};
    const float df[3] = {qx[0] - l->half * (slope[0] * qx[1] + bend[1] * qxy[2] + bend[2] * qxz[3]),
                         qy[0] - l->half * (bend[0] * qxy[1] + slope[1] * qy[2] + bend[2] * qyz[3]),
                         qz[0] -
                             l->half * (bend[0] * qxz[1] + bend[1] * qyz[2] + slope[2] * qz[3])};
    const quad by[3] = {qx, qy, qz};
    for (int a = 0; a < 3; a++) {
        const float rate = c.moves[a] ? c.rate : 0;
        s.df[a] = rate * df[a];
        for (int b = 0; b < 3; b++) s.dg[a][b] = rate * by[a][b + 1];
    }
    return s;
}

// du[3] = derivative of the correction by the index u
static void correction_slope(const template_correction *k, const float u[3], float du[3])
{
    const cell c = cell_of(u, k->scale, k->offset, k->n);
    const ptrdiff_t line = k->n[0], plane = line * k->n[1];
    const float *at = k->map + c.node[0] + line * c.node[1] + plane * c.node[2];
    float low[3] = {0};
    for (int i = 0; i < 8; i++) {
        const int bit[3] = {i & 1, i >> 1 & 1, i >> 2};
        const float v = at[bit[0] + (bit[1] ? line : 0) + (bit[2] ? plane : 0)];
        float w[3];
        for (int a = 0; a < 3; a++) w[a] = bit[a] ? c.t[a] : 1 - c.t[a];
        low[0] += (bit[0] ? v : -v) * w[1] * w[2];
        low[1] += (bit[1] ? v : -v) * w[0] * w[2];
        low[2] += (bit[2] ? v : -v) * w[0] * w[1];
    }
    for (int a = 0; a < 3; a++) du[a] = c.moves[a] ? c.rate * low[a] : 0;
}

// Derivatives of the value of part c in voxel i of w->row, after sdm_template_run().
static value_slope slope_of_value(const template_work *w, size_t c, size_t i)
{
    const template_network *k = w->k;
    const template_row *r = &w->row;
    const float u[3] = {r->u[0][i], r->u[1][i], r->u[2][i]};
    bool in = true;
    for (int a = 0; a < 3; a++) in &= u[a] >= 0 && u[a] <= (float)(k->near[c].n[a] - 1);
    const template_slope s = template_at(in ? &k->near[c] : &k->far[c], u);
    const float m[6] = {r->metric[0][i], r->metric[1][i], r->metric[2][i],
                        r->metric[3][i], r->metric[4][i], r->metric[5][i]};
    const float e = 1e-3f, *g = s.g;
    // value = f sqrt(d / n), d = g^T g + e, n = g^T G g + e t
    const float gg[3] = {m[0] * g[0] + m[5] * g[1] + m[4] * g[2],
                         m[5] * g[0] + m[1] * g[1] + m[3] * g[2],
                         m[4] * g[0] + m[3] * g[1] + m[2] * g[2]};
    const float d = g[0] * g[0] + g[1] * g[1] + g[2] * g[2] + e,
                n = g[0] * gg[0] + g[1] * gg[1] + g[2] * gg[2] + e * (m[0] + m[1] + m[2]) / 3;
    const float root = sqrtf(d / n), f = s.f * root;
    value_slope out;
    for (int a = 0; a < 3; a++) {
        const float *dg = s.dg[a];
        const float by_d = g[0] * dg[0] + g[1] * dg[1] + g[2] * dg[2],
                    by_n = gg[0] * dg[0] + gg[1] * dg[1] + gg[2] * dg[2];
        out.u[a] = root * s.df[a] + f * (by_d / d - by_n / n);
    }
    const float h = -0.5f * f / n;
    for (int a = 0; a < 3; a++) out.metric[a] = h * (g[a] * g[a] + e / 3);
    out.metric[3] = 2 * h * g[1] * g[2];
    out.metric[4] = 2 * h * g[0] * g[2];
    out.metric[5] = 2 * h * g[0] * g[1];
    if (w->correction && c == 0) {
        float du[3];
        correction_slope(&w->correction_at, u, du);
        for (int a = 0; a < 3; a++) out.u[a] += du[a];
    }
    return out;
}

/* Scratch memory of the derivatives along D directions. */
typedef struct slopes_work {
    template_work w;
    size_t n;               /* D */
    double *dg;             /* [D][N] */
    double (*dm)[9];        /* [D][n_parts] */
    double (*db)[3];        /* [D][n_parts] */
    float *control;         /* control displacements of the warp of the first part */
    float *points, *metric; /* [D][stations][4], [D][stations][8] */
    warp_lines *lines;      /* [warps][D] */
    float *row[9];          /* [64] du, d metric */
    value_slope *slope;     /* [64] */
    float *value;           /* [64] the map, or a derivative */
    uint8_t *nearest;       /* [64] part with the smallest value */
} slopes_work;

static size_t slopes_carve(const sdm_model *m, size_t n, size_t correction_scratch, void *memory,
                           slopes_work *s)
{
    const template_network *k = m->network;
    size_t at = sdm_template_carve(m, true, 1 + n, correction_scratch, memory, &s->w);
    s->n = n;
    s->dg = sdm_template_take(memory, &at, n * k->n_numbers * sizeof *s->dg);
    s->dm = sdm_template_take(memory, &at, n * k->n_parts * sizeof *s->dm);
    s->db = sdm_template_take(memory, &at, n * k->n_parts * sizeof *s->db);
    size_t control = 0, stations = k->stations[0] * k->stations[1] * k->stations[2], warps = 0;
    for (size_t c = 0; c < k->n_parts; c++) {
        const size_t count = sdm_lattice_count(&k->parts[c].warp);
        if (k->parts[c].n_modes && count > control) control = count;
        warps += k->parts[c].n_modes > 0;
    }
    s->control = sdm_template_take(memory, &at, 4 * control * sizeof *s->control);
    s->points = sdm_template_take(memory, &at, warps * n * 4 * stations * sizeof *s->points);
    s->metric = sdm_template_take(memory, &at, warps * n * 8 * stations * sizeof *s->metric);
    s->lines = sdm_template_take(memory, &at, warps * n * sizeof *s->lines);
    for (size_t i = 0; i < warps * n; i++) {
        warp_lines l = {.points = s->points + 4 * i * stations,
                        .metric = s->metric + 8 * i * stations};
        sdm_template_take_lines(k, memory, &at, &l);
        if (memory) s->lines[i] = l;
    }
    for (int i = 0; i < 9; i++)
        s->row[i] = sdm_template_take(memory, &at, VOXELS * sizeof *s->row[i]);
    s->slope = sdm_template_take(memory, &at, VOXELS * sizeof *s->slope);
    s->value = sdm_template_take(memory, &at, VOXELS * sizeof *s->value);
    s->nearest = sdm_template_take(memory, &at, VOXELS);
    return at;
}

// number of parts with a warp before part c: where its derivatives are stored
static size_t warp_number(const template_network *k, size_t c)
{
    size_t n = 0;
    for (size_t i = 0; i < c; i++) n += k->parts[i].n_modes > 0;
    return n;
}

// Derivatives of frames and warps along direction[D][P], after sdm_template_begin().
static void slopes_begin(slopes_work *s, const double *direction)
{
    const template_network *k = s->w.k;
    const size_t n_params = s->w.model->info.n_params, N = k->n_numbers,
                 stations = k->stations[0] * k->stations[1] * k->stations[2];
    for (size_t d = 0; d < s->n; d++) {
        double *dg = s->dg + d * N;
        for (size_t i = 0; i < N; i++) {
            dg[i] = 0;
            for (size_t p = 0; p < n_params; p++)
                dg[i] += direction[d * n_params + p] * s->w.dg[p * N + i];
        }
        sdm_template_frames_slope(k, s->w.g, dg, s->w.pose, s->dm + d * k->n_parts,
                                  s->db + d * k->n_parts);
        for (size_t c = 0; c < k->n_parts; c++) {
            if (k->parts[c].n_modes == 0) continue;
            const size_t at = (warp_number(k, c) * s->n + d) * stations;
            sdm_template_control(&k->parts[c], dg + k->parts[c].amplitudes, s->control);
            sdm_template_invert_slope(k, &k->parts[c], &s->w.pose[c], s->w.grid, &s->w.warp[c],
                                      s->control, s->dm[d * k->n_parts + c],
                                      s->db[d * k->n_parts + c], s->points + 4 * at,
                                      s->metric + 8 * at);
            s->lines[at / stations].plane_of = s->lines[at / stations].line_of = SIZE_MAX;
        }
    }
}

// s->row = derivatives of u and metric of part c, which has no warp, in the voxels of a block.
static void affine_slope(const slopes_work *s, size_t c, size_t d, const template_block *block)
{
    const template_network *k = s->w.k;
    const part_pose *pose = &s->w.pose[c];
    const double *dm = s->dm[d * k->n_parts + c], *db = s->db[d * k->n_parts + c],
                 *b = pose->inverse;
    double moved[9];
    sdm_template_inverse_slope(pose, dm, moved);
    for (size_t line = 0; line < BLOCK * BLOCK; line++) {
        double du[2][3]; // at the first two voxels of the line
        for (int e = 0; e < 2; e++) {
            const double voxel[3] = {(double)(BLOCK * block->at[0]) + e,
                                     (double)(BLOCK * block->at[1] + line % BLOCK),
                                     (double)(BLOCK * block->at[2] + line / BLOCK)};
            double p[3];
            sdm_grid_world(s->w.grid, voxel, p);
            for (int i = 0; i < 3; i++) p[i] -= pose->b[i];
            for (int i = 0; i < 3; i++) {
                double sum = 0;
                for (int j = 0; j < 3; j++) sum += moved[3 * i + j] * p[j] - b[3 * i + j] * db[j];
                du[e][i] = sum / k->parts[c].near.spacing;
            }
        }
        for (int i = 0; i < 3; i++) {
            const float from = (float)du[0][i], by = (float)(du[1][i] - du[0][i]);
            for (size_t x = 0; x < BLOCK; x++) s->row[i][BLOCK * line + x] = from + by * (float)x;
        }
    }
    float metric[6];
    sdm_template_metric_slope(b, moved, metric);
    for (int i = 0; i < 6; i++)
        for (size_t v = 0; v < VOXELS; v++) s->row[3 + i][v] = metric[i];
}

// s->value = the derivative along direction d in the voxels of a block in which part c is the
// nearest, after sdm_template_run().
static void block_slope(slopes_work *s, size_t c, size_t d, const template_block *b)
{
    template_work *w = &s->w;
    const template_network *k = w->k;
    if (w->part[c].warped)
        sdm_template_expand(k, b, &s->lines[warp_number(k, c) * s->n + d], 9, s->row);
    else
        affine_slope(s, c, d, b);
    for (size_t v = 0; v < VOXELS; v++) {
        float sum = 0;
        for (int a = 0; a < 3 && s->nearest[v] == c; a++) sum += s->slope[v].u[a] * s->row[a][v];
        for (int a = 0; a < 6 && s->nearest[v] == c; a++)
            sum += s->slope[v].metric[a] * s->row[3 + a][v];
        s->value[v] = sum;
    }
    if (w->correction && c == 0) {
        template_correction change = k->correction_lattice;
        change.map = w->correction + (1 + d) * sdm_grid_count(&k->correction->info.grid);
        sdm_template_kernels()->correct(&change, VOXELS, (const float *const *)w->row.u, s->value);
    }
}

// out[D] = the derivatives in the voxels of a block in which part c is the nearest.
static void block_slopes(slopes_work *s, size_t c, const template_block *b, float *const *out)
{
    template_work *w = &s->w;
    if (w->loaded != c) sdm_template_run(w, c, b);
    if (w->part[c].rigid)
        for (int a = 0; a < 6; a++)
            for (size_t v = 0; v < VOXELS; v++) w->row.metric[a][v] = a < 3;
    for (size_t v = 0; v < VOXELS; v++)
        if (s->nearest[v] == c) s->slope[v] = slope_of_value(w, c, v);
    const size_t nx = (size_t)w->grid->n[0], ny = (size_t)w->grid->n[1],
                 first = BLOCK * ((b->at[2] * ny + b->at[1]) * nx + b->at[0]);
    for (size_t d = 0; d < s->n; d++) {
        block_slope(s, c, d, b);
        for (size_t z = 0; z < b->n[2]; z++)
            for (size_t y = 0; y < b->n[1]; y++)
                for (size_t x = 0, v = BLOCK * (BLOCK * z + y); x < b->n[0]; x++, v++)
                    if (s->nearest[v] == c) out[d][first + (z * ny + y) * nx + x] = s->value[v];
    }
}

// values = the map, out[D] = its derivatives
static void fill_slopes(slopes_work *s, float *values, float *const *out)
{
    template_work *w = &s->w;
    for (size_t i = 0; i < w->n_blocks; i++) {
        const template_block b = sdm_template_block(w, i);
        sdm_template_values(w, &b, s->value, s->nearest);
        sdm_template_store(w, &b, s->value, values);
        for (size_t c = 0; c < w->k->n_parts; c++)
            if (memchr(s->nearest, (int)c, VOXELS)) block_slopes(s, c, &b, out);
    }
}

// Bytes of scratch memory of the correction's Jacobian, or of its product with one direction.
static size_t correction_bytes(const template_network *k, bool jacobian)
{
    if (!k->correction) return 0;
    const sdm_model_kind *kind = k->correction->kind;
    return jacobian ? kind->jacobian_scratch_bytes(k->correction, 1)
                    : kind->jvp_scratch_bytes(k->correction, 1);
}

// values = the map, out[n] = its derivatives along direction[n][P]; jacobian: along all parameters
static void forward_mode(const sdm_model *m, const double *params, bool jacobian, size_t n,
                         const double *direction, float *values, float *const *out, void *scratch)
{
    const template_network *k = m->network;
    slopes_work s;
    slopes_carve(m, n, correction_bytes(k, jacobian), scratch, &s);
    if (k->correction) {
        const sdm_model_kind *kind = k->correction->kind;
        float *map = s.w.correction, *slopes = map + sdm_grid_count(&k->correction->info.grid);
        if (jacobian)
            kind->jacobian(k->correction, params, map, slopes, s.w.correction_scratch, 1);
        else
            kind->jvp(k->correction, params, direction, map, slopes, s.w.correction_scratch, 1);
    }
    sdm_template_begin(&s.w, params, true);
    slopes_begin(&s, direction);
    fill_slopes(&s, values, out);
}

size_t sdm_template_jacobian_scratch_bytes(const sdm_model *m, int n_threads)
{
    (void)n_threads;
    slopes_work s;
    return slopes_carve(m, m->info.n_params, correction_bytes(m->network, true), NULL, &s);
}

void sdm_template_jacobian(const sdm_model *m, const double *params, float *values, float *jacobian,
                           void *scratch, int n_threads)
{
    (void)n_threads;
    const size_t n = m->info.n_params, voxels = sdm_grid_count(&m->info.grid);
    double unit[SDM_POD_MAX_PARAMS * SDM_POD_MAX_PARAMS] = {0};
    float *out[SDM_POD_MAX_PARAMS];
    for (size_t i = 0; i < n; i++) unit[i * n + i] = 1, out[i] = jacobian + i * voxels;
    forward_mode(m, params, true, n, unit, values, out, scratch);
}

size_t sdm_template_jvp_scratch_bytes(const sdm_model *m, int n_threads)
{
    (void)n_threads;
    slopes_work s;
    return slopes_carve(m, 1, correction_bytes(m->network, false), NULL, &s);
}

void sdm_template_jvp(const sdm_model *m, const double *params, const double *direction,
                      float *values, float *tangent, void *scratch, int n_threads)
{
    (void)n_threads;
    forward_mode(m, params, false, 1, direction, values, &tangent, scratch);
}
