/* Reads and writes triangle mesh files; the ending of the name selects the format. */
#include "mesh_formats.h"
#include "sdm/memory.h"

#include <math.h>

#define MESH_FILE_MAX ((size_t)1 << 31) /* bytes */

typedef struct mesh_format {
    const char *ext;
    sdm_status (*read)(sdm_builder *b, uint8_t *data, size_t size, sdm_error *err);
    sdm_status (*write)(sdm_outfile *f, const sdm_mesh *m, sdm_error *err);
} mesh_format;

static const mesh_format formats[] = {
    {".ply", sdm_ply_read, sdm_ply_write}, {".stl", sdm_stl_read, sdm_stl_write},
    {".obj", sdm_obj_read, sdm_obj_write}, {".off", sdm_off_read, sdm_off_write},
    {".vtk", sdm_vtk_read, sdm_vtk_write}, {".vtp", sdm_vtp_read, sdm_vtp_write}};

static sdm_status find_format(const char *path, const mesh_format **out, sdm_error *err)
{
    for (size_t i = 0; i < sizeof formats / sizeof *formats; i++) {
        *out = &formats[i];
        if (sdm_has_ext(path, formats[i].ext)) return SDM_OK;
    }
    return sdm_fail(err, SDM_E_UNSUPPORTED,
                    "%s: unknown type of mesh file, known are .ply .stl .obj .off .vtk .vtp", path);
}

sdm_status sdm_mesh_read(const char *path, sdm_mesh *out, sdm_error *err)
{
    if (!path || !out) return sdm_fail(err, SDM_E_ARG, "sdm_mesh_read: NULL argument");
    const mesh_format *format;
    uint8_t *data = NULL;
    size_t size = 0;
    sdm_status s = find_format(path, &format, err);
    if (!s) s = sdm_file_read(path, MESH_FILE_MAX, &data, &size, err);
    if (s) return s;
    sdm_builder b = {.path = path, .mesh = out};
    out->n_vert = out->n_tri = 0;
    s = format->read(&b, data, size, err);
    if (!s) s = sdm_builder_finish(&b, err);
    sdm_free(data);
    if (s) sdm_mesh_dispose(out);
    return s;
}

/* Demands finite coordinates and valid vertex indices. */
static sdm_status check_mesh(const sdm_mesh *m, sdm_error *err)
{
    for (size_t i = 0; i < 3 * m->n_vert; i++)
        if (!isfinite(m->vert[i]))
            return sdm_fail(err, SDM_E_MESH, "vertex %zu of the mesh to write is not finite",
                            i / 3);
    for (size_t i = 0; i < 3 * m->n_tri; i++)
        if (m->tri[i] >= m->n_vert)
            return sdm_fail(err, SDM_E_MESH,
                            "triangle %zu of the mesh to write has vertex %u of %zu", i / 3,
                            m->tri[i], m->n_vert);
    return SDM_OK;
}

sdm_status sdm_mesh_write(const char *path, const sdm_mesh *mesh, sdm_error *err)
{
    if (!path || !mesh) return sdm_fail(err, SDM_E_ARG, "sdm_mesh_write: NULL argument");
    const mesh_format *format;
    sdm_outfile *f = NULL;
    sdm_status s = find_format(path, &format, err);
    if (!s) s = check_mesh(mesh, err);
    if (!s) s = sdm_outfile_open(path, &f, err);
    if (s) return s;
    s = format->write(f, mesh, err);
    if (!s) return sdm_outfile_commit(&f, err);
    sdm_outfile_discard(&f);
    return s;
}
