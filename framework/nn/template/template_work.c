/* Scratch memory of a map of a template network, and its blocks. */
#include <math.h>
#include <string.h>

#include "template_work.h"

enum { BLOCK = SDM_TEMPLATE_STEP };

// Half of the diagonal of a block, mm.
static double block_radius(const sdm_grid *grid)
{
    double sum = 0;
    for (int a = 0; a < 3; a++) {
        const double half = 0.5 * (BLOCK - 1) * grid->spacing[a];
        sum += half * half;
    }
    return sqrt(sum);
}

void *sdm_template_take(void *memory, size_t *at, size_t bytes)
{
    void *p = memory ? (uint8_t *)memory + *at : NULL;
    *at += (bytes + 63) / 64 * 64;
    return p;
}

void sdm_template_take_lines(const template_network *k, void *memory, size_t *at, warp_lines *l)
{
    const size_t nx = k->stations[0], ny = k->stations[1];
    l->plane = sdm_template_take(memory, at, BLOCK * 12 * nx * ny * sizeof *l->plane);
    l->line = sdm_template_take(memory, at, BLOCK * BLOCK * 12 * nx * sizeof *l->line);
}

size_t sdm_template_row_bytes(const template_network *k)
{
    // the kernels use room for whole vectors
    const size_t least = SDM_TEMPLATE_ROWS_POINTS,
                 n = k->stations[0] > least ? k->stations[0] : least;
    return (n + 3 * SDM_TEMPLATE_LANES) * sizeof(float);
}

static void take_row(const template_network *k, void *memory, size_t *at, template_row *r)
{
    const size_t bytes = sdm_template_row_bytes(k);
    float **const fields[] = {
        &r->u[0],      &r->u[1],      &r->u[2],      &r->metric[0], &r->metric[1], &r->metric[2],
        &r->metric[3], &r->metric[4], &r->metric[5], &r->f,         &r->g[0],      &r->g[1],
        &r->g[2],      &r->far_f,     &r->far_g[0],  &r->far_g[1],  &r->far_g[2],  &r->value};
    for (size_t i = 0; i < sizeof fields / sizeof *fields; i++)
        *fields[i] = sdm_template_take(memory, at, bytes);
}

static void take_warp(template_work *w, size_t c, bool slopes, void *memory, size_t *at)
{
    const template_network *k = w->k;
    const size_t n = k->stations[0] * k->stations[1] * k->stations[2];
    warp_scratch *s = &w->warp[c];
    s->control = sdm_template_take(memory, at,
                                   4 * sdm_lattice_count(&k->parts[c].warp) * sizeof *s->control);
    s->points = sdm_template_take(memory, at, 4 * n * sizeof *s->points);
    s->metric = sdm_template_take(memory, at, 8 * n * sizeof *s->metric);
    // the kernels use room for whole vectors
    const size_t bytes = (n + 2 * SDM_TEMPLATE_LANES) * sizeof(float);
    float **const samples[] = {&s->sample.f,    &s->sample.g[0], &s->sample.g[1],
                               &s->sample.g[2], &s->sample.s,    &s->sample.r,
                               &s->sample.u[0], &s->sample.u[1], &s->sample.u[2]};
    for (size_t i = 0; i < sizeof samples / sizeof *samples; i++)
        *samples[i] = sdm_template_take(memory, at, bytes);
    if (slopes) s->station = sdm_template_take(memory, at, n * sizeof *s->station);
    sdm_template_take_lines(k, memory, at, &w->lines[c]);
    w->lines[c].points = s->points;
    w->lines[c].metric = s->metric;
}

size_t sdm_template_carve(const sdm_model *m, bool slopes, size_t correction_maps,
                          size_t correction_scratch, void *memory, template_work *w)
{
    const template_network *k = m->network;
    size_t at = 0, corners = 1;
    *w = (template_work){.model = m,
                         .k = k,
                         .kernels = sdm_template_kernels(),
                         .grid = &m->info.grid,
                         .block_radius = block_radius(&m->info.grid),
                         .n_blocks = 1};
    for (int a = 0; a < 3; a++) {
        w->blocks[a] = k->stations[a] - 3;
        w->n_blocks *= w->blocks[a];
        corners *= w->blocks[a] + 1;
    }
    w->g = sdm_template_take(memory, &at, k->n_numbers * sizeof *w->g);
    w->dg = sdm_template_take(memory, &at,
                              (slopes ? m->info.n_params * k->n_numbers : 0) * sizeof *w->dg);
    w->phi = sdm_template_take(memory, &at, sdm_template_numbers_scratch(m) * sizeof *w->phi);
    w->pose = sdm_template_take(memory, &at, k->n_parts * sizeof *w->pose);
    for (size_t c = 0; c < k->n_parts; c++)
        if (k->parts[c].n_modes) take_warp(w, c, slopes, memory, &at);
    w->part = sdm_template_take(memory, &at, k->n_parts * sizeof *w->part);
    w->corner = sdm_template_take(memory, &at, 4 * k->n_parts * corners * sizeof *w->corner);
    w->centre = sdm_template_take(
        memory, &at, (k->n_parts > 1 ? 4 * k->n_parts * w->n_blocks : 0) * sizeof *w->centre);
    w->value = sdm_template_take(memory, &at, SDM_TEMPLATE_BLOCK_VOXELS * sizeof *w->value);
    for (int a = 0; a < 3; a++)
        w->offset[a] =
            sdm_template_take(memory, &at, SDM_TEMPLATE_BLOCK_VOXELS * sizeof *w->offset[a]);
    if (k->correction) {
        w->correction = sdm_template_take(
            memory, &at,
            correction_maps * sdm_grid_count(&k->correction->info.grid) * sizeof *w->correction);
        w->correction_scratch = sdm_template_take(memory, &at, correction_scratch);
        w->correction_at = k->correction_lattice;
        w->correction_at.map = w->correction;
    }
    take_row(k, memory, &at, &w->row);
    return at;
}

bool sdm_template_is_rigid(const template_network *k, size_t c)
{
    for (int p = (int)c; p >= 0; p = k->parts[p].parent)
        if (k->parts[p].frame == SDM_FRAME_AFFINE || k->parts[p].n_modes) return false;
    return true;
}

// Places block *b at `at` along an axis.
static void place(const template_work *w, int axis, size_t at, template_block *b)
{
    const size_t left = (size_t)w->grid->n[axis] - BLOCK * at;
    b->at[axis] = at;
    b->n[axis] = left < BLOCK ? left : BLOCK;
}

template_block sdm_template_first_block(const template_work *w)
{
    template_block b = {.number = 0};
    for (int a = 0; a < 3; a++) place(w, a, 0, &b);
    return b;
}

bool sdm_template_next_block(const template_work *w, template_block *b)
{
    b->number++;
    for (int a = 0; a < 3; a++) {
        if (b->at[a] + 1 < w->blocks[a]) {
            place(w, a, b->at[a] + 1, b);
            return true;
        }
        place(w, a, 0, b);
    }
    return false;
}

void sdm_template_store(const template_work *w, const template_block *b, const float *value,
                        float *map)
{
    const size_t nx = (size_t)w->grid->n[0], ny = (size_t)w->grid->n[1];
    float *to = map + ((b->at[2] * ny + b->at[1]) * nx + b->at[0]) * BLOCK;
    for (size_t z = 0; z < b->n[2]; z++)
        for (size_t y = 0; y < b->n[1]; y++) {
            float *line = to + (z * ny + y) * nx;
            const float *from = value + BLOCK * (BLOCK * z + y);
            if (b->n[0] == BLOCK)
                memcpy(line, from, BLOCK * sizeof *line);
            else
                memcpy(line, from, b->n[0] * sizeof *line);
        }
}
