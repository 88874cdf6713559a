/* Implementation of sdm_host: the services that a plug-in can call during a callback. */
#include <stdio.h>
#include <string.h>

#include "sdm/image.h"
#include "sdm/internal/file.h"
#include "sdm/memory.h"
#include "sdm/meshfile.h"
#include "shape_internal.h"

#define DATA_FILE_MAX (UINT64_C(1) << 32)
#define MESH_MAX (((size_t)1 << 31) - SHAPE_BEHIND) // vertices, triangles

/* Memory that is freed at the end of the callback. */
typedef struct host_block {
    struct host_block *next;
    void *data;
    sdm_mesh mesh;
} host_block;

static host_call *host_call_of(const sdm_host *host) { return host->ctx; }

static host_block *block_new(host_call *c)
{
    host_block *b = NULL;
    if (SDM_ALLOC(&b, 1, "plug-in data", &c->err)) return NULL;
    b->next = c->blocks;
    c->blocks = b;
    return b;
}

static int mesh_out_set(sdm_mesh *m, sdm_mesh_out *out)
{
    *out = (sdm_mesh_out){.vert = m->vert, .tri = m->tri, .n_vert = m->n_vert, .n_tri = m->n_tri};
    return 0;
}

bool sdm_is_unused(const void *from, const void *to)
{
    const unsigned char *first = from, *end = to;
    // the first byte, and each one as the one before it
    return first == end ||
           (*first == SHAPE_UNUSED && !memcmp(first, first + 1, (size_t)(end - first) - 1));
}

sdm_status sdm_host_check_behind(const sdm_mesh *m, sdm_error *err)
{
    const double *vert = m->vert + 3 * m->n_vert;
    const uint32_t *tri = m->tri + 3 * m->n_tri;
    const bool wide = !sdm_is_unused(vert, vert + 3 * SHAPE_BEHIND);
    if (!wide && sdm_is_unused(tri, tri + 3 * SHAPE_BEHIND)) return SDM_OK;
    return sdm_fail(err, SDM_E_PLUGIN,
                    "mesh() has written beyond the %zu %s that it reserved: let it reserve as many "
                    "as it writes",
                    wide ? m->n_vert : m->n_tri, wide ? "vertices" : "triangles");
}

static int host_reserve(const sdm_host *host, sdm_mesh_out *out, size_t n_vert, size_t n_tri)
{
    host_call *c = host_call_of(host);
    sdm_mesh *m = c->mesh;
    if (!m) {
        host_block *b = block_new(c);
        if (!b) return (int)SDM_E_NOMEM;
        m = &b->mesh;
    }
    if (n_vert > MESH_MAX || n_tri > MESH_MAX)
        return (int)sdm_fail(&c->err, SDM_E_MESH,
                             "mesh of %zu vertices and %zu triangles, at most %zu of each", n_vert,
                             n_tri, MESH_MAX);
    const sdm_status s = sdm_mesh_reserve(m, n_vert + SHAPE_BEHIND, n_tri + SHAPE_BEHIND, &c->err);
    if (s) return (int)s;
    m->n_vert = n_vert;
    m->n_tri = n_tri;
    // NaN and vertices that do not exist: what the callback forgets to write is refused
    memset(m->vert, c->fill, 3 * n_vert * sizeof *m->vert);
    memset(m->tri, c->fill, 3 * n_tri * sizeof *m->tri);
    memset(m->vert + 3 * n_vert, SHAPE_UNUSED, 3 * SHAPE_BEHIND * sizeof *m->vert);
    memset(m->tri + 3 * n_tri, SHAPE_UNUSED, 3 * SHAPE_BEHIND * sizeof *m->tri);
    if (c->fill_stack) sdm_fill_stack(c->fill);
    return mesh_out_set(m, out);
}

static int host_fail(const sdm_host *host, const char *text)
{
    return (int)sdm_fail(&host_call_of(host)->err, SDM_E_PLUGIN, "%s",
                         text ? text : "no reason given");
}

/* Files may only be read in create(): a mesh must not depend on the content of a file at the time
 * of mesh(). */
static int file_refuse(host_call *c, const char *path)
{
    return (int)sdm_fail(&c->err, SDM_E_PLUGIN, "%s: files are read in create() alone", path);
}

static int host_read_file(const sdm_host *host, const char *path, const unsigned char **data,
                          size_t *size)
{
    host_call *c = host_call_of(host);
    if (!c->files) return file_refuse(c, path);
    host_block *b = block_new(c);
    if (!b) return (int)SDM_E_NOMEM;
    uint8_t *bytes = NULL;
    const sdm_status s = sdm_file_read(path, DATA_FILE_MAX, &bytes, size, &c->err);
    b->data = bytes;
    *data = bytes;
    return (int)s;
}

static int host_read_mesh(const sdm_host *host, const char *path, sdm_mesh_out *out)
{
    host_call *c = host_call_of(host);
    if (!c->files) return file_refuse(c, path);
    host_block *b = block_new(c);
    if (!b) return (int)SDM_E_NOMEM;
    const sdm_status s = sdm_mesh_read(path, &b->mesh, &c->err);
    return s ? (int)s : mesh_out_set(&b->mesh, out);
}

static int host_read_npy(const sdm_host *host, const char *path, const double **values,
                         size_t shape[4], int *n_dim)
{
    host_call *c = host_call_of(host);
    if (!c->files) return file_refuse(c, path);
    host_block *b = block_new(c);
    if (!b) return (int)SDM_E_NOMEM;
    double *numbers = NULL;
    const sdm_status s = sdm_npy_read(path, &numbers, shape, n_dim, &c->err);
    b->data = numbers;
    *values = numbers;
    return (int)s;
}

void sdm_host_call_begin(host_call *c, sdm_mesh *mesh, bool files)
{
    // set members one by one: clearing the whole struct would clear the long error text for every
    // mesh
    c->host = (sdm_host){.abi = SDM_SHAPE_ABI,
                         .size = (uint32_t)sizeof(sdm_host),
                         .ctx = c,
                         .reserve = host_reserve,
                         .fail = host_fail,
                         .read_file = host_read_file,
                         .read_mesh = host_read_mesh,
                         .read_npy = host_read_npy};
    c->shape = NULL;
    c->mesh = mesh;
    c->files = files;
    c->fill = 0xff;
    c->fill_stack = false;
    c->blocks = NULL;
    c->err.status = SDM_OK;
    c->err.text[0] = '\0';
}

void sdm_host_call_end(host_call *c)
{
    while (c->blocks) {
        host_block *b = c->blocks;
        c->blocks = b->next;
        sdm_free(b->data);
        sdm_mesh_dispose(&b->mesh);
        sdm_free(b);
    }
}

sdm_status sdm_host_call_failed(const host_call *c, const char *callback, int returned,
                                sdm_status otherwise, sdm_error *err)
{
    if (c->err.status == SDM_OK)
        return sdm_fail(err, otherwise, "%s() returned %d without a reason", callback, returned);
    return sdm_fail(err, c->err.status == SDM_E_NOMEM ? SDM_E_NOMEM : otherwise, "%s", c->err.text);
}
