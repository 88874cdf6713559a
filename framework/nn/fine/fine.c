/* The fine level: where the map has creases, and the changes there. */
#include "sdm/internal/fine.h"

#include <math.h>
#include <string.h>

#include "fine_halve.h"
#include "fine_kernels.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/threads.h"

size_t sdm_fine_count(size_t width)
{
    return (SDM_FINE_INPUTS + 1) * width + (width + 1) * width + (width + 1) * SDM_FINE_OUTPUTS;
}

sdm_grid sdm_fine_grid(const sdm_grid *g)
{
    sdm_grid fine = *g;
    for (int a = 0; a < 3; a++) {
        fine.n[a] = 2 * g->n[a] - 1;
        fine.spacing[a] = g->spacing[a] / 2;
    }
    return fine;
}

/* h of fine.h. */
static float smallest(const sdm_grid *g) { return 10 * sdm_fine_unit(g); }

/* bend[n] = the sum over the axes of the squared second differences at n voxels from `at` on; rows
   and planes are `line` and `plane` voxels apart. */
static void bend_row(size_t n, const float *restrict at, size_t line, size_t plane,
                     float *restrict bend)
{
    for (size_t i = 0; i < n; i++) {
        const float *v = at + i, two = 2 * v[0];
        const float x = (v[-1] + v[1]) - two, y = (v[-(ptrdiff_t)line] + v[line]) - two,
                    z = (v[-(ptrdiff_t)plane] + v[plane]) - two;
        bend[i] = (x * x + y * y) + z * z;
    }
}

sdm_status sdm_fine_cells(const sdm_grid *g, float threshold, const float *map, uint32_t **cells,
                          size_t *n, sdm_error *err)
{
    const size_t nx = (size_t)g->n[0], ny = (size_t)g->n[1], nz = (size_t)g->n[2], plane = nx * ny;
    const float h = smallest(g), least = threshold * threshold * h * h;
    *n = 0;
    *cells = NULL;
    sdm_status s = sdm_alloc_unset((void **)cells, plane * nz, sizeof **cells, "creases", err);
    float *bend = NULL;
    if (!s) s = SDM_ALLOC(&bend, plane * nz, "creases", err);
    if (!s && nx > 3 && ny > 3 && nz > 3) {
        for (size_t k = 1; k + 1 < nz; k++)
            for (size_t j = 1; j + 1 < ny; j++) {
                const size_t at = k * plane + j * nx + 1;
                bend_row(nx - 2, map + at, nx, plane, bend + at);
            }
        for (size_t k = 1; k + 2 < nz; k++)
            for (size_t j = 1; j + 2 < ny; j++) {
                const float *a = bend + k * plane + j * nx, *b = a + nx, *c = a + plane,
                            *d = c + nx;
                size_t count = *n; // without branches, which cannot be foreseen
                for (size_t i = 1; i + 2 < nx; i++) {
                    const float sum = ((a[i] + a[i + 1]) + (b[i] + b[i + 1])) +
                                      ((c[i] + c[i + 1]) + (d[i] + d[i + 1]));
                    (*cells)[count] = (uint32_t)(k * plane + j * nx + i);
                    count += sum > least;
                }
                *n = count;
            }
    }
    sdm_free(bend);
    if (s) {
        sdm_free(*cells);
        *cells = NULL;
    }
    return s;
}

/* Row i (0 .. 15) of four voxels of the stencil of a cell. */
static const float *stencil_row(const sdm_grid *g, const float *map, uint32_t cell, size_t i)
{
    const size_t nx = (size_t)g->n[0], plane = nx * (size_t)g->n[1];
    return map + cell - plane - nx - 1 + i / 4 * plane + i % 4 * nx;
}

typedef float four __attribute__((vector_size(16)));
typedef float four_u __attribute__((vector_size(16), aligned(4)));

/* values[SDM_FINE_STENCIL][FINE_CELLS] = the stencils of FINE_CELLS cells: rows of four cells are
   transposed together. */
static void gather(const sdm_grid *g, const float *map, const uint32_t *cells, float *values)
{
    for (size_t i = 0; i < SDM_FINE_STENCIL / 4; i++)
        for (size_t l = 0; l < FINE_CELLS; l += 4) {
            four r[4];
            for (size_t k = 0; k < 4; k++)
                r[k] = *(const four_u *)stencil_row(g, map, cells[l + k], i);
            const four a = __builtin_shufflevector(r[0], r[1], 0, 4, 1, 5),
                       b = __builtin_shufflevector(r[2], r[3], 0, 4, 1, 5),
                       c = __builtin_shufflevector(r[0], r[1], 2, 6, 3, 7),
                       d = __builtin_shufflevector(r[2], r[3], 2, 6, 3, 7);
            float *to = values + 4 * i * FINE_CELLS + l;
            *(four_u *)to = __builtin_shufflevector(a, b, 0, 1, 4, 5);
            *(four_u *)(to + FINE_CELLS) = __builtin_shufflevector(a, b, 2, 3, 6, 7);
            *(four_u *)(to + 2 * FINE_CELLS) = __builtin_shufflevector(c, d, 0, 1, 4, 5);
            *(four_u *)(to + 3 * FINE_CELLS) = __builtin_shufflevector(c, d, 2, 3, 6, 7);
        }
}

void sdm_fine_inputs(const sdm_grid *g, float threshold, const float *map, uint32_t cell,
                     float x[SDM_FINE_INPUTS], float *gate)
{
    float v[SDM_FINE_STENCIL], mean = 0, c = 0;
    const float h = smallest(g);
    for (size_t i = 0; i < SDM_FINE_STENCIL / 4; i++)
        memcpy(v + 4 * i, stencil_row(g, map, cell, i), 4 * sizeof *v);
    for (size_t q = 0; q < 8; q++) {
        const size_t i = 21 + q / 4 * 16 + q / 2 % 2 * 4 + q % 2;
        mean += v[i] / 8;
        for (size_t s = 1; s <= 16; s *= 4) {
            const float second = (v[i - s] + v[i + s] - 2 * v[i]) / h;
            c += second * second;
        }
    }
    for (size_t i = 0; i < SDM_FINE_STENCIL; i++) x[i] = (v[i] - mean) / h;
    x[SDM_FINE_STENCIL] = mean / sqrtf(h * h + mean * mean);
    const float low = threshold * threshold, s = fminf(fmaxf((c - low) / (3 * low), 0), 1);
    *gate = s * s * (3 - 2 * s);
}

/* The memory of a thread: values and results of FINE_CELLS cells. */
static size_t work_floats(size_t n_maps)
{
    return n_maps * (SDM_FINE_STENCIL + SDM_FINE_OUTPUTS) * FINE_CELLS;
}

typedef struct change_job {
    const sdm_fine *f;
    const sdm_grid *g;
    size_t n_maps, voxels, fine_voxels;
    const float *maps;
    float *fine;
} change_job;

/* Adds the changes of n cells; cells[FINE_CELLS] has more, which are computed too. */
static void change_cells(const change_job *j, const uint32_t *cells, size_t n, float *work)
{
    const size_t nx = (size_t)j->g->n[0], ny = (size_t)j->g->n[1], fx = 2 * nx - 1, fy = 2 * ny - 1;
    float *out = work + j->n_maps * SDM_FINE_STENCIL * FINE_CELLS;
    for (size_t m = 0; m < j->n_maps; m++)
        gather(j->g, j->maps + m * j->voxels, cells, work + m * SDM_FINE_STENCIL * FINE_CELLS);
    sdm_fine_kernels()->cells(j->f, smallest(j->g), j->n_maps - 1, work, out);
    size_t place[FINE_CELLS];
    for (size_t l = 0; l < n; l++) {
        const uint32_t row = cells[l] / (uint32_t)nx, z = row / (uint32_t)ny;
        const size_t x = cells[l] - row * (uint32_t)nx, y = row - z * (uint32_t)ny;
        place[l] = (2 * (size_t)z * fy + 2 * y) * fx + 2 * x;
    }
    for (size_t m = 0; m < j->n_maps; m++)
        for (size_t l = 0; l < n; l++) {
            float *to = j->fine + m * j->fine_voxels + place[l];
            for (size_t q = 1; q < SDM_FINE_OUTPUTS; q++)
                to[(q / 4 * fy + q / 2 % 2) * fx + q % 2] +=
                    out[(m * SDM_FINE_OUTPUTS + q) * FINE_CELLS + l];
        }
}

/* Corrects the creases. */
static sdm_status change_map(const change_job *j, int n_threads, sdm_error *err)
{
    uint32_t *cells = NULL;
    float *work = NULL;
    size_t n = 0;
    const size_t floats = work_floats(j->n_maps);
    sdm_status s = sdm_fine_cells(j->g, j->f->threshold, j->maps, &cells, &n, err);
    if (!s) s = SDM_ALLOC(&work, floats * (size_t)n_threads, "fine level", err);
    const size_t groups = s ? 0 : (n + FINE_CELLS - 1) / FINE_CELLS;
#pragma omp parallel for schedule(static) num_threads(n_threads) if (n_threads > 1)
    for (size_t k = 0; k < groups; k++) {
        const size_t first = k * FINE_CELLS, left = n - first < FINE_CELLS ? n - first : FINE_CELLS;
        uint32_t group[FINE_CELLS];
        for (size_t l = 0; l < FINE_CELLS; l++) group[l] = cells[first + (l < left ? l : 0)];
        change_cells(j, group, left, work + (size_t)sdm_thread() * floats);
    }
    sdm_free(work);
    sdm_free(cells);
    return s;
}

sdm_status sdm_fine_map(const sdm_fine *f, const sdm_grid *g, size_t n_tangents, const float *maps,
                        int n_threads, float *fine, sdm_error *err)
{
    const sdm_grid to = sdm_fine_grid(g);
    const change_job j = {.f = f,
                          .g = g,
                          .n_maps = 1 + n_tangents,
                          .voxels = sdm_grid_count(g),
                          .fine_voxels = sdm_grid_count(&to),
                          .maps = maps,
                          .fine = fine};
    sdm_status s = SDM_OK;
    for (size_t i = 0; i < j.n_maps && !s; i++)
        s = sdm_fine_halve(g->n, maps + i * j.voxels, n_threads, fine + i * j.fine_voxels, err);
    return s || !f ? s : change_map(&j, n_threads, err);
}
