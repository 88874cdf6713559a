/* Wavefront OBJ meshes: vertices and faces; everything else (normals, texture, groups, lines) is
 * skipped. */
#include "meshparts.h"
#include "sdm/internal/text.h"

/* A face may name vertices that come later in the file: the largest index is checked at the end. */
typedef struct highest {
    size_t index, line;
} highest;

/* "12", "12/3", "12//4" or "12/3/4"; from 1, or from -1 backwards from the last vertex. */
static sdm_status read_corner(const sdm_builder *b, const sdm_scan *s, char *word, uint32_t *out,
                              highest *high, sdm_error *err)
{
    char *slash = strchr(word, '/');
    if (slash) *slash = '\0';
    int64_t v;
    if (!sdm_parse_int(word, &v) || v == 0 || v >= (int64_t)1 << 31 || v < -(int64_t)b->n_vert)
        return sdm_fail(err, SDM_E_FORMAT,
                        "%s:%zu: '%.40s' is not the number of a vertex (%zu so far)", s->path,
                        s->line, word, b->n_vert);
    const size_t index = v > 0 ? (size_t)v - 1 : b->n_vert - (size_t)-v;
    if (high->line == 0 || index > high->index) *high = (highest){index, s->line};
    *out = (uint32_t)index;
    return SDM_OK;
}

static sdm_status read_face(sdm_builder *b, const sdm_scan *s, char *line, highest *high,
                            sdm_error *err)
{
    sdm_fan fan = {0};
    for (char *word; (word = sdm_scan_word(&line)) != NULL;) {
        uint32_t v = 0;
        sdm_status e = read_corner(b, s, word, &v, high, err);
        if (!e) e = sdm_builder_corner(b, &fan, v, err);
        if (e) return e;
    }
    if (fan.n < 3)
        return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: face of %zu corners, need 3", s->path, s->line,
                        fan.n);
    return SDM_OK;
}

sdm_status sdm_obj_read(sdm_builder *b, uint8_t *data, size_t size, sdm_error *err)
{
    sdm_scan s = {.at = (char *)data,
                  .end = (char *)data + size,
                  .path = b->path,
                  .comment = '#',
                  .continues = true};
    highest high = {0};
    for (char *line; (line = sdm_scan_line(&s)) != NULL;) {
        const char *word = sdm_scan_word(&line);
        sdm_status e = SDM_OK;
        double x[3];
        if (strcmp(word, "v") == 0) {
            e = sdm_scan_reals(&s, &line, x, 3, err);
            if (!e) e = sdm_builder_vertex(b, x, err);
        } else if (strcmp(word, "f") == 0) {
            e = read_face(b, &s, line, &high, err);
        }
        if (e) return e;
    }
    if (b->n_vert == 0)
        return sdm_fail(err, SDM_E_FORMAT, "%s: no vertex in %zu lines: not an OBJ file", s.path,
                        s.lines);
    if (high.line && high.index >= b->n_vert)
        return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: vertex %zu of %zu", s.path, high.line,
                        high.index + 1, b->n_vert);
    return SDM_OK;
}

sdm_status sdm_obj_write(sdm_outfile *f, const sdm_mesh *m, sdm_error *err)
{
    char x[32], y[32], z[32];
    sdm_status e = sdm_outfile_printf(f, err, "# unit: mm\n");
    for (size_t i = 0; i < m->n_vert && !e; i++) {
        const double *v = m->vert + 3 * i;
        e = sdm_outfile_printf(f, err, "v %s %s %s\n", sdm_format_real(v[0], x),
                               sdm_format_real(v[1], y), sdm_format_real(v[2], z));
    }
    for (size_t i = 0; i < m->n_tri && !e; i++) {
        const uint32_t *t = m->tri + 3 * i;
        e = sdm_outfile_printf(f, err, "f %zu %zu %zu\n", (size_t)t[0] + 1, (size_t)t[1] + 1,
                               (size_t)t[2] + 1);
    }
    return e;
}
