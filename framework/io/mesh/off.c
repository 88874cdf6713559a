/* OFF meshes: "OFF", counts, vertices, polygons; colours and normals behind the coordinates are
 * skipped. */
#include "meshparts.h"
#include "sdm/internal/text.h"

/* The counts may follow the magic word on its own line. */
static sdm_status read_counts(sdm_scan *s, int64_t n[2], sdm_error *err)
{
    static const char *const known[] = {"OFF", "COFF", "NOFF", "CNOFF"};
    char *line = sdm_scan_line(s);
    char *word = line ? sdm_scan_word(&line) : NULL;
    bool ok = false;
    for (size_t i = 0; word && i < sizeof known / sizeof *known; i++)
        ok = ok || strcmp(word, known[i]) == 0;
    if (!ok) return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: not an OFF file", s->path, s->line);
    while (*line == ' ') line++;
    if (strcmp(line, "BINARY") == 0)
        return sdm_fail(err, SDM_E_UNSUPPORTED, "%s: binary OFF; save it as PLY", s->path);
    if (*line == '\0' || *line == '\r') line = sdm_scan_line(s);
    if (!line)
        return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: the counts are missing", s->path, s->line);
    static const char *const what[] = {"number of vertices", "number of polygons"};
    for (int i = 0; i < 2; i++) {
        const sdm_status e = sdm_scan_count(s, &line, (int64_t)1 << 31, what[i], &n[i], err);
        if (e) return e;
    }
    return SDM_OK;
}

static sdm_status read_polygon(sdm_builder *b, sdm_scan *s, int64_t n_vert, sdm_error *err)
{
    char *line = sdm_scan_line(s);
    if (!line)
        return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: the file ends before its last polygon", s->path,
                        s->lines);
    int64_t n, v;
    sdm_status e = sdm_scan_count(s, &line, (int64_t)1 << 31, "number of corners", &n, err);
    if (e) return e;
    if (n < 3)
        return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: polygon of %lld corners, need 3", s->path,
                        s->line, (long long)n);
    sdm_fan fan = {0};
    for (int64_t i = 0; i < n; i++) {
        e = sdm_scan_count(s, &line, n_vert, "vertex index", &v, err);
        if (!e) e = sdm_builder_corner(b, &fan, (uint32_t)v, err);
        if (e) return e;
    }
    return SDM_OK;
}

sdm_status sdm_off_read(sdm_builder *b, uint8_t *data, size_t size, sdm_error *err)
{
    sdm_scan s = {.at = (char *)data, .end = (char *)data + size, .path = b->path, .comment = '#'};
    int64_t n[2];
    sdm_status e = read_counts(&s, n, err);
    if (e) return e;
    /* every number takes two bytes at least, so the counts are bounded by the file */
    if ((uint64_t)n[0] > size / 6 || (uint64_t)n[1] > size / 8)
        return sdm_fail(err, SDM_E_FORMAT,
                        "%s:%zu: %lld vertices and %lld polygons cannot fit into %zu bytes", s.path,
                        s.line, (long long)n[0], (long long)n[1], size);
    for (int64_t i = 0; i < n[0]; i++) {
        double x[3];
        char *line = sdm_scan_line(&s);
        if (!line)
            return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: the file ends before its last vertex",
                            s.path, s.lines);
        e = sdm_scan_reals(&s, &line, x, 3, err);
        if (!e) e = sdm_builder_vertex(b, x, err);
        if (e) return e;
    }
    for (int64_t i = 0; i < n[1]; i++) {
        e = read_polygon(b, &s, n[0], err);
        if (e) return e;
    }
    return SDM_OK;
}

sdm_status sdm_off_write(sdm_outfile *f, const sdm_mesh *m, sdm_error *err)
{
    char x[32], y[32], z[32];
    sdm_status e = sdm_outfile_printf(f, err, "OFF\n# unit: mm\n%zu %zu 0\n", m->n_vert, m->n_tri);
    for (size_t i = 0; i < m->n_vert && !e; i++) {
        const double *v = m->vert + 3 * i;
        e = sdm_outfile_printf(f, err, "%s %s %s\n", sdm_format_real(v[0], x),
                               sdm_format_real(v[1], y), sdm_format_real(v[2], z));
    }
    for (size_t i = 0; i < m->n_tri && !e; i++) {
        const uint32_t *t = m->tri + 3 * i;
        e = sdm_outfile_printf(f, err, "3 %u %u %u\n", t[0], t[1], t[2]);
    }
    return e;
}
