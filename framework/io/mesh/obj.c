/* Wavefront OBJ meshes. Reads vertices and faces and ignores normals, texture coordinates, groups
 * and lines. */
#include "mesh_formats.h"
#include "sdm/internal/text.h"

/* The largest vertex index of all faces, and the line on which it stands (0: no face yet). The
   index is checked at the end of the file, since a face may refer to vertices that follow it. */
typedef struct max_index {
    size_t index, line;
} max_index;

/* Reads a corner, "12", "12/3", "12//4" or "12/3/4", of which only the first number, the vertex, is
 * used. Vertices are counted from 1; negative numbers count backwards from the latest vertex,
 * -1. */
static sdm_status read_corner(const sdm_builder *b, const sdm_scan *scan, char *word, uint32_t *out,
                              max_index *max, sdm_error *err)
{
    char *slash = strchr(word, '/');
    if (slash) *slash = '\0';
    int64_t v;
    if (!sdm_parse_int(word, &v) || v == 0 || v >= (int64_t)1 << 31 || v < -(int64_t)b->n_vert)
        return sdm_fail(err, SDM_E_FORMAT,
                        "%s:%zu: '%.40s' is not the number of a vertex (%zu so far)", scan->path,
                        scan->line, word, b->n_vert);
    const size_t index = v > 0 ? (size_t)v - 1 : b->n_vert - (size_t)-v;
    if (max->line == 0 || index > max->index) *max = (max_index){index, scan->line};
    *out = (uint32_t)index;
    return SDM_OK;
}

static sdm_status read_face(sdm_builder *b, const sdm_scan *scan, char *line, max_index *max,
                            sdm_error *err)
{
    sdm_fan fan = {0};
    for (char *word; (word = sdm_scan_word(&line)) != NULL;) {
        uint32_t v = 0;
        sdm_status s = read_corner(b, scan, word, &v, max, err);
        if (!s) s = sdm_builder_corner(b, &fan, v, err);
        if (s) return s;
    }
    if (fan.n < 3)
        return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: face of %zu corners, need 3", scan->path,
                        scan->line, fan.n);
    return SDM_OK;
}

sdm_status sdm_obj_read(sdm_builder *b, uint8_t *data, size_t size, sdm_error *err)
{
    sdm_scan scan = {.at = (char *)data,
                     .end = (char *)data + size,
                     .path = b->path,
                     .comment = '#',
                     .continues = true};
    max_index max = {0};
    for (char *line; (line = sdm_scan_line(&scan)) != NULL;) {
        const char *word = sdm_scan_word(&line);
        sdm_status s = SDM_OK;
        double x[3];
        if (strcmp(word, "v") == 0) {
            s = sdm_scan_reals(&scan, &line, x, 3, err);
            if (!s) s = sdm_builder_vertex(b, x, err);
        } else if (strcmp(word, "f") == 0) {
            s = read_face(b, &scan, line, &max, err);
        }
        if (s) return s;
    }
    if (b->n_vert == 0)
        return sdm_fail(err, SDM_E_FORMAT, "%s: no vertex in %zu lines: not an OBJ file", scan.path,
                        scan.lines);
    if (max.line && max.index >= b->n_vert)
        return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: vertex %zu of %zu", scan.path, max.line,
                        max.index + 1, b->n_vert);
    return SDM_OK;
}

sdm_status sdm_obj_write(sdm_outfile *f, const sdm_mesh *m, sdm_error *err)
{
    char x[32], y[32], z[32];
    sdm_status s = sdm_outfile_printf(f, err, "# unit: mm\n");
    for (size_t i = 0; i < m->n_vert && !s; i++) {
        const double *v = m->vert + 3 * i;
        s = sdm_outfile_printf(f, err, "v %s %s %s\n", sdm_format_real(v[0], x),
                               sdm_format_real(v[1], y), sdm_format_real(v[2], z));
    }
    for (size_t i = 0; i < m->n_tri && !s; i++) {
        const uint32_t *t = m->tri + 3 * i;
        s = sdm_outfile_printf(f, err, "f %zu %zu %zu\n", (size_t)t[0] + 1, (size_t)t[1] + 1,
                               (size_t)t[2] + 1);
    }
    return s;
}
