/* Evaluates the parts of a template network in rows of voxels. */
#include "template_rows.h"

#include <math.h>
#include <string.h>

static size_t row_floats(const sdm_grid *grid)
{
    return ((size_t)grid->n[0] + 3 * SDM_TEMPLATE_LANES) / SDM_TEMPLATE_LANES * SDM_TEMPLATE_LANES;
}

static size_t blocks_along(const sdm_grid *grid, int axis)
{
    return ((size_t)grid->n[axis] + SDM_TEMPLATE_BLOCK - 1) / SDM_TEMPLATE_BLOCK;
}

static size_t station_count(const template_network *k)
{
    return k->stations[0] * k->stations[1] * k->stations[2];
}

// Takes the next `bytes` of memory, 64-byte aligned, and advances *at.
static void *carve(void *memory, size_t *at, size_t bytes)
{
    void *p = memory ? (uint8_t *)memory + *at : NULL;
    *at += (bytes + 63) / 64 * 64;
    return p;
}

static void carve_row(const sdm_grid *grid, void *memory, size_t *at, template_row *r)
{
    const size_t bytes = row_floats(grid) * sizeof(float);
    float **const fields[] = {&r->u[0],      &r->u[1],      &r->u[2],      &r->metric[0],
                              &r->metric[1], &r->metric[2], &r->metric[3], &r->metric[4],
                              &r->metric[5], &r->f,         &r->g[0],      &r->g[1],
                              &r->g[2],      &r->far_f,     &r->far_g[0],  &r->far_g[1],
                              &r->far_g[2],  &r->value};
    for (size_t i = 0; i < sizeof fields / sizeof *fields; i++)
        *fields[i] = carve(memory, at, bytes);
}

size_t sdm_template_carve(const sdm_model *m, bool slopes, size_t correction_maps,
                          size_t correction_scratch, void *memory, template_work *w)
{
    const template_network *k = m->network;
    const size_t n = station_count(k);
    size_t at = 0;
    *w = (template_work){.model = m, .k = k, .grid = &m->info.grid};
    w->g = carve(memory, &at, k->n_numbers * sizeof *w->g);
    w->dg = carve(memory, &at, (slopes ? m->info.n_params * k->n_numbers : 0) * sizeof *w->dg);
    w->phi = carve(memory, &at, sdm_template_numbers_scratch(m) * sizeof *w->phi);
    w->pose = carve(memory, &at, k->n_parts * sizeof *w->pose);
    for (size_t c = 0; c < k->n_parts; c++) {
        if (k->parts[c].n_modes == 0) continue;
        warp_scratch *s = &w->warp[c];
        s->control =
            carve(memory, &at, 4 * sdm_lattice_count(&k->parts[c].warp) * sizeof *s->control);
        s->points = carve(memory, &at, 4 * n * sizeof *s->points);
        s->metric = carve(memory, &at, 8 * n * sizeof *s->metric);
        s->plane = carve(memory, &at, 12 * k->stations[0] * k->stations[1] * sizeof *s->plane);
        s->line = carve(memory, &at, 12 * k->stations[0] * sizeof *s->line);
        if (slopes) s->station = carve(memory, &at, n * sizeof *s->station);
    }
    const size_t blocks =
        blocks_along(w->grid, 0) * blocks_along(w->grid, 1) * blocks_along(w->grid, 2);
    w->active = carve(memory, &at, blocks * sizeof *w->active);
    if (k->correction) {
        w->correction = carve(memory, &at,
                              correction_maps * sdm_grid_count(&k->correction->info.grid) *
                                  sizeof *w->correction);
        w->correction_scratch = carve(memory, &at, correction_scratch);
        w->correction_at = k->correction_lattice;
        w->correction_at.map = w->correction;
    }
    carve_row(w->grid, memory, &at, &w->row);
    return at;
}

void sdm_template_plane(const template_network *k, const float *points, const float *metric,
                        size_t z, float *plane)
{
    const size_t n = k->stations[0] * k->stations[1], cell = z / k->step, phase = z % k->step;
    const float *p = points + 4 * n * cell, *g = metric + 8 * n * (cell + 1);
    float w[4];
    for (int a = 0; a < 4; a++) w[a] = k->expansion.cubic[a][phase];
    const float t = k->expansion.linear[phase];
    float *out = plane, *out_metric = plane + 4 * n;
    for (size_t i = 0; i < 4 * n; i++)
        out[i] = w[0] * p[i] + w[1] * p[4 * n + i] + w[2] * p[8 * n + i] + w[3] * p[12 * n + i];
    for (size_t i = 0; i < 8 * n; i++) out_metric[i] = g[i] + t * (g[8 * n + i] - g[i]);
}

void sdm_template_line(const template_network *k, const float *plane, size_t y, float *line)
{
    const size_t n = k->stations[0], cell = y / k->step, phase = y % k->step;
    const float *p = plane + 4 * n * cell,
                *g = plane + 4 * n * k->stations[1] + 8 * n * (cell + 1);
    float w[4];
    for (int a = 0; a < 4; a++) w[a] = k->expansion.cubic[a][phase];
    const float t = k->expansion.linear[phase];
    float *out = line, *out_metric = line + 4 * n;
    for (size_t i = 0; i < 4 * n; i++)
        out[i] = w[0] * p[i] + w[1] * p[4 * n + i] + w[2] * p[8 * n + i] + w[3] * p[12 * n + i];
    for (size_t i = 0; i < 8 * n; i++) out_metric[i] = g[i] + t * (g[8 * n + i] - g[i]);
}

/* A part without a warp: its index at a voxel is an affine function of the voxel's index. */

// u[3] = index of part c at a voxel index
static void affine_index(const template_work *w, size_t c, const double voxel[3], double u[3])
{
    const part_pose *pose = &w->pose[c];
    const sdm_lattice *l = &w->k->parts[c].near;
    double x[3];
    sdm_grid_world(w->grid, voxel, x);
    for (int i = 0; i < 3; i++) x[i] -= pose->b[i];
    for (int i = 0; i < 3; i++)
        u[i] = (pose->inverse[3 * i] * x[0] + pose->inverse[3 * i + 1] * x[1] +
                pose->inverse[3 * i + 2] * x[2] - l->origin[i]) /
               l->spacing;
}

// metric[6] of a part without a warp: m^-1 m^-T
static void affine_metric(const part_pose *pose, float metric[6])
{
    static const int I[6] = {0, 1, 2, 1, 0, 0}, J[6] = {0, 1, 2, 2, 2, 1};
    const double *b = pose->inverse;
    for (int c = 0; c < 6; c++)
        metric[c] = (float)(b[3 * I[c]] * b[3 * J[c]] + b[3 * I[c] + 1] * b[3 * J[c] + 1] +
                            b[3 * I[c] + 2] * b[3 * J[c] + 2]);
}

static void affine_run(const template_work *w, size_t c, size_t x, size_t y, size_t z, size_t n)
{
    double first[3], last[3];
    affine_index(w, c, (const double[3]){(double)x, (double)y, (double)z}, first);
    affine_index(w, c, (const double[3]){(double)x + 1, (double)y, (double)z}, last);
    for (int a = 0; a < 3; a++) {
        const float from = (float)first[a], by = (float)(last[a] - first[a]);
        for (size_t i = 0; i < n; i++) w->row.u[a][i] = from + by * (float)i;
    }
    float metric[6];
    affine_metric(&w->pose[c], metric);
    for (int a = 0; a < 6; a++)
        for (size_t i = 0; i < n; i++) w->row.metric[a][i] = metric[a];
}

// true if distances are carried along unchanged: rotations and translations only
static bool is_rigid(const template_network *k, size_t c)
{
    for (int p = (int)c; p >= 0; p = k->parts[p].parent)
        if (k->parts[p].frame == SDM_FRAME_AFFINE || k->parts[p].n_modes) return false;
    return true;
}

// Distance and gradient of the template of part c at row.u: from the lattice `near`, and from `far`
// for points outside of it.
static void lookup(const template_work *w, size_t c, size_t n)
{
    const template_row *r = &w->row;
    const template_network *k = w->k;
    const template_table *t = sdm_template_kernels();
    const float *const u[3] = {r->u[0], r->u[1], r->u[2]};
    float end[3];
    for (int a = 0; a < 3; a++) end[a] = (float)(k->near[c].n[a] - 1);
    size_t inside = 0;
    for (size_t i = 0; i < n; i++)
        inside += (u[0][i] >= 0) & (u[0][i] <= end[0]) & (u[1][i] >= 0) & (u[1][i] <= end[1]) &
                  (u[2][i] >= 0) & (u[2][i] <= end[2]);
    if (inside) t->lookup(&k->near[c], n, u, r->f, r->g);
    if (inside == n) return;
    if (!inside) {
        t->lookup(&k->far[c], n, u, r->f, r->g);
        return;
    }
    t->lookup(&k->far[c], n, u, r->far_f, r->far_g);
    for (size_t i = 0; i < n; i++) {
        const bool in = (u[0][i] >= 0) & (u[0][i] <= end[0]) & (u[1][i] >= 0) &
                        (u[1][i] <= end[1]) & (u[2][i] >= 0) & (u[2][i] <= end[2]);
        r->f[i] = in ? r->f[i] : r->far_f[i];
        for (int a = 0; a < 3; a++) r->g[a][i] = in ? r->g[a][i] : r->far_g[a][i];
    }
}

void sdm_template_run(template_work *w, size_t c, size_t x, size_t y, size_t z, size_t n)
{
    const template_row *r = &w->row;
    const template_network *k = w->k;
    const template_table *t = sdm_template_kernels();
    if (k->parts[c].n_modes) {
        const warp_scratch *s = &w->warp[c];
        float *const to[9] = {r->u[0],      r->u[1],      r->u[2],      r->metric[0], r->metric[1],
                              r->metric[2], r->metric[3], r->metric[4], r->metric[5]};
        sdm_template_line(k, s->plane, y, s->line);
        t->expand(&k->expansion, (n + k->step - 1) / k->step, s->line,
                  s->line + 4 * k->stations[0], 9, to);
    } else {
        affine_run(w, c, x, y, z, n);
    }
    lookup(w, c, n);
    if (is_rigid(k, c))
        memcpy(r->value, r->f, n * sizeof *r->value);
    else
        t->normalise(n, r->f, (const float *const *)r->g, (const float *const *)r->metric,
                     r->value);
    if (w->correction_at.map && c == 0)
        t->correct(&w->correction_at, n, (const float *const *)r->u, r->value);
}

/* Blocks. */

// Marks the parts that may be the nearest in each block: those whose distance at the centre of the
// block is at most the smallest one plus what both can change by within the block. Parts with a
// warp are active everywhere.
static void mark_active(template_work *w)
{
    const template_network *k = w->k;
    const sdm_grid *grid = w->grid;
    const size_t nx = blocks_along(grid, 0), ny = blocks_along(grid, 1), nz = blocks_along(grid, 2);
    const uint32_t all = k->n_parts < 32 ? (UINT32_C(1) << k->n_parts) - 1 : UINT32_MAX;
    bool only_affine = k->n_parts > 1;
    for (size_t c = 0; c < k->n_parts; c++) only_affine &= k->parts[c].n_modes == 0;
    if (!only_affine) {
        for (size_t b = 0; b < nx * ny * nz; b++) w->active[b] = all;
        return;
    }
    // half of the diagonal of a block, and how fast the value of each part changes at most
    double radius = 0, slope[SDM_TEMPLATE_MAX_PARTS];
    for (int a = 0; a < 3; a++)
        radius += grid->spacing[a] * grid->spacing[a] * (SDM_TEMPLATE_BLOCK - 1) *
                  (SDM_TEMPLATE_BLOCK - 1) / 4;
    radius = sqrt(radius);
    for (size_t c = 0; c < k->n_parts; c++) {
        double forward = 0, back = 0; // Frobenius norms bound the largest singular values
        for (int i = 0; i < 9; i++) {
            forward += w->pose[c].m[i] * w->pose[c].m[i];
            back += w->pose[c].inverse[i] * w->pose[c].inverse[i];
        }
        slope[c] = is_rigid(k, c) ? 1 : sqrt(forward * back) / 3 * 1.5;
    }
    for (size_t z = 0, b = 0; z < nz; z++)
        for (size_t y = 0; y < ny; y++)
            for (size_t x = 0; x < nx; x++, b++) {
                double low[SDM_TEMPLATE_MAX_PARTS], least = INFINITY;
                const double half = (SDM_TEMPLATE_BLOCK - 1) / 2.0,
                             voxel[3] = {SDM_TEMPLATE_BLOCK * (double)x + half,
                                         SDM_TEMPLATE_BLOCK * (double)y + half,
                                         SDM_TEMPLATE_BLOCK * (double)z + half};
                for (size_t c = 0; c < k->n_parts; c++) {
                    double u[3];
                    affine_index(w, c, voxel, u);
                    for (int a = 0; a < 3; a++) w->row.u[a][0] = (float)u[a];
                    float metric[6];
                    affine_metric(&w->pose[c], metric);
                    for (int a = 0; a < 6; a++) w->row.metric[a][0] = metric[a];
                    lookup(w, c, 1);
                    sdm_template_kernels()->normalise(
                        1, w->row.f, (const float *const *)w->row.g,
                        (const float *const *)w->row.metric, w->row.value);
                    const double v = (double)w->row.value[0],
                                 reach = 1.05 * slope[c] * radius + 0.1 * grid->spacing[0];
                    low[c] = v - reach;
                    least = fmin(least, v + reach);
                }
                w->active[b] = 0;
                for (size_t c = 0; c < k->n_parts; c++)
                    if (low[c] <= least) w->active[b] |= UINT32_C(1) << c;
            }
}

size_t sdm_template_active(const template_work *w, size_t c, size_t x, size_t y, size_t z)
{
    const size_t nx = blocks_along(w->grid, 0), all = (size_t)w->grid->n[0];
    const uint32_t *row = w->active + ((z / SDM_TEMPLATE_BLOCK) * blocks_along(w->grid, 1) +
                                       y / SDM_TEMPLATE_BLOCK) *
                                          nx;
    size_t end = x / SDM_TEMPLATE_BLOCK;
    while (end < nx && (row[end] >> c & 1)) end++;
    const size_t stop = end * SDM_TEMPLATE_BLOCK < all ? end * SDM_TEMPLATE_BLOCK : all;
    return stop > x ? stop - x : 0;
}

void sdm_template_begin(template_work *w, const double *p, bool slopes)
{
    const template_network *k = w->k;
    sdm_template_numbers(w->model, p, w->phi, w->g, slopes ? w->dg : NULL);
    sdm_template_frames(k, w->g, w->pose);
    for (size_t c = 0; c < k->n_parts; c++) {
        const sdm_template_part *part = &k->parts[c];
        if (part->n_modes == 0) continue;
        sdm_template_control(part, w->g + part->amplitudes, w->warp[c].control);
        sdm_template_invert(k, part, &w->pose[c], w->grid, &w->warp[c]);
    }
    mark_active(w);
}
