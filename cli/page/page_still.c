/* The surface and three slices of a map, in a compact form for a page. */
#include <math.h>
#include <string.h>

#include "page.h"
#include "sdm/isosurface.h"
#include "sdm/map.h"
#include "sdm/memory.h"

static void put16(uint8_t **at, uint16_t v)
{
    *(*at)++ = (uint8_t)v;
    *(*at)++ = (uint8_t)(v >> 8);
}

static void put32(uint8_t **at, uint32_t v)
{
    put16(at, (uint16_t)v);
    put16(at, (uint16_t)(v >> 16));
}

static void put_float(uint8_t **at, float v)
{
    uint32_t bits;
    memcpy(&bits, &v, sizeof bits);
    put32(at, bits);
}

/* Writes the slice across axis `a`; the other axes in the order of the map, the faster one last. */
static void put_slice(const sdm_grid *g, const float *values, int a, int64_t index, uint8_t **at)
{
    const int fast = a == 0 ? 1 : 0, slow = a == 2 ? 1 : 2;
    int64_t v[3];
    v[a] = index;
    for (v[slow] = 0; v[slow] < g->n[slow]; v[slow]++)
        for (v[fast] = 0; v[fast] < g->n[fast]; v[fast]++)
            put_float(at, values[sdm_grid_voxel(g, v[0], v[1], v[2])]);
}

/* Measures the surface, if there is one. */
static sdm_status measure(const sdm_mesh *m, cli_still *s, sdm_error *err)
{
    sdm_audit audit;
    s->n_vert = m->n_vert;
    s->n_tri = m->n_tri;
    if (!m->n_tri) return SDM_OK;
    const sdm_status status = sdm_mesh_audit(m, &audit, err);
    if (status) return status;
    s->area = audit.area;
    memcpy(s->min, audit.min, sizeof s->min);
    memcpy(s->max, audit.max, sizeof s->max);
    return SDM_OK;
}

/* slice[a] = index of the slice through the middle of the surface; without one, of the grid. */
static void choose_slices(const sdm_grid *g, cli_still *s)
{
    double middle[3], index[3];
    for (int a = 0; a < 3; a++) middle[a] = (s->min[a] + s->max[a]) / 2;
    sdm_grid_index(g, middle, index);
    for (int a = 0; a < 3; a++) {
        const double at = s->n_tri ? index[a] : (double)(g->n[a] - 1) / 2;
        s->slice[a] = (int64_t)fmin(fmax(round(at), 0), (double)(g->n[a] - 1));
    }
}

static sdm_status pack(const sdm_grid *g, const float *values, const sdm_mesh *m, cli_still *s,
                       sdm_error *err)
{
    const size_t slices = (size_t)(g->n[1] * g->n[2] + g->n[0] * g->n[2] + g->n[0] * g->n[1]);
    const bool wide = m->n_vert > 65536;
    s->size = 4 * slices + (wide ? 12 : 6) * m->n_tri + 6 * m->n_vert;
    const sdm_status status = SDM_ALLOC(&s->bytes, s->size, "pictures of the page", err);
    if (status) return status;
    uint8_t *at = s->bytes;
    for (int a = 0; a < 3; a++) put_slice(g, values, a, s->slice[a], &at);
    for (size_t i = 0; i < 3 * m->n_tri; i++)
        if (wide)
            put32(&at, m->tri[i]);
        else
            put16(&at, (uint16_t)m->tri[i]);
    for (size_t i = 0; i < 3 * m->n_vert; i++) {
        const double low = s->min[i % 3], length = s->max[i % 3] - low;
        put16(&at, (uint16_t)(length > 0 ? round(65535 * (m->vert[i] - low) / length) : 0));
    }
    return SDM_OK;
}

sdm_status cli_still_make(const sdm_grid *grid, const float *values, cli_still *out, sdm_error *err)
{
    sdm_mesh mesh = {0};
    sdm_status s = sdm_isosurface(grid, values, 0, &mesh, &out->cut, err);
    if (!s) s = sdm_map_volume(grid, values, 0, &out->volume, err);
    if (!s) s = measure(&mesh, out, err);
    if (!s) {
        choose_slices(grid, out);
        s = pack(grid, values, &mesh, out, err);
    }
    sdm_mesh_dispose(&mesh);
    return s;
}

void cli_still_dispose(cli_still *s)
{
    sdm_free(s->bytes);
    *s = (cli_still){0};
}
