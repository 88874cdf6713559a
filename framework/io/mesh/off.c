/* OFF meshes: "OFF", counts, vertices, polygons. Colours and normals behind the coordinates are
 * ignored. */
#include "mesh_formats.h"
#include "sdm/internal/text.h"

/* Reads the magic word and, on the same or the next line, the numbers of vertices and polygons. */
static sdm_status read_counts(sdm_scan *scan, int64_t n[2], sdm_error *err)
{
    static const char *const known[] = {"OFF", "COFF", "NOFF", "CNOFF"};
    char *line = sdm_scan_line(scan);
    char *word = line ? sdm_scan_word(&line) : NULL;
    bool ok = false;
    for (size_t i = 0; word && i < sizeof known / sizeof *known; i++)
        ok = ok || strcmp(word, known[i]) == 0;
    if (!ok) return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: not an OFF file", scan->path, scan->line);
    while (*line == ' ') line++;
    if (strcmp(line, "BINARY") == 0)
        return sdm_fail(err, SDM_E_UNSUPPORTED, "%s: binary OFF; save it as PLY", scan->path);
    if (*line == '\0' || *line == '\r') line = sdm_scan_line(scan);
    if (!line)
        return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: the counts are missing", scan->path,
                        scan->line);
    static const char *const what[] = {"number of vertices", "number of polygons"};
    for (int i = 0; i < 2; i++) {
        const sdm_status s = sdm_scan_count(scan, &line, (int64_t)1 << 31, what[i], &n[i], err);
        if (s) return s;
    }
    return SDM_OK;
}

static sdm_status read_polygon(sdm_builder *b, sdm_scan *scan, int64_t n_vert, sdm_error *err)
{
    char *line = sdm_scan_line(scan);
    if (!line)
        return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: the file ends before its last polygon",
                        scan->path, scan->lines);
    int64_t n, v;
    sdm_status s = sdm_scan_count(scan, &line, (int64_t)1 << 31, "number of corners", &n, err);
    if (s) return s;
    if (n < 3)
        return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: polygon of %lld corners, need 3", scan->path,
                        scan->line, (long long)n);
    sdm_fan fan = {0};
    for (int64_t i = 0; i < n; i++) {
        s = sdm_scan_count(scan, &line, n_vert, "vertex index", &v, err);
        if (!s) s = sdm_builder_corner(b, &fan, (uint32_t)v, err);
        if (s) return s;
    }
    return SDM_OK;
}

sdm_status sdm_off_read(sdm_builder *b, uint8_t *data, size_t size, sdm_error *err)
{
    sdm_scan scan = {
        .at = (char *)data, .end = (char *)data + size, .path = b->path, .comment = '#'};
    int64_t n[2];
    sdm_status s = read_counts(&scan, n, err);
    if (s) return s;
    // a number takes at least two bytes, a vertex three numbers and a polygon four
    if ((uint64_t)n[0] > size / 6 || (uint64_t)n[1] > size / 8)
        return sdm_fail(err, SDM_E_FORMAT,
                        "%s:%zu: %lld vertices and %lld polygons cannot fit into %zu bytes",
                        scan.path, scan.line, (long long)n[0], (long long)n[1], size);
    for (int64_t i = 0; i < n[0]; i++) {
        double x[3];
        char *line = sdm_scan_line(&scan);
        if (!line)
            return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: the file ends before its last vertex",
                            scan.path, scan.lines);
        s = sdm_scan_reals(&scan, &line, x, 3, err);
        if (!s) s = sdm_builder_vertex(b, x, err);
        if (s) return s;
    }
    for (int64_t i = 0; i < n[1]; i++) {
        s = read_polygon(b, &scan, n[0], err);
        if (s) return s;
    }
    // a lower count in the header would drop polygons in silence
    if (sdm_scan_line(&scan))
        return sdm_fail(err, SDM_E_FORMAT,
                        "%s:%zu: more lines than %lld vertices and %lld polygons", scan.path,
                        scan.line, (long long)n[0], (long long)n[1]);
    return SDM_OK;
}

sdm_status sdm_off_write(sdm_outfile *f, const sdm_mesh *m, sdm_error *err)
{
    char x[32], y[32], z[32];
    sdm_status s = sdm_outfile_printf(f, err, "OFF\n# unit: mm\n%zu %zu 0\n", m->n_vert, m->n_tri);
    for (size_t i = 0; i < m->n_vert && !s; i++) {
        const double *v = m->vert + 3 * i;
        s = sdm_outfile_printf(f, err, "%s %s %s\n", sdm_format_real(v[0], x),
                               sdm_format_real(v[1], y), sdm_format_real(v[2], z));
    }
    for (size_t i = 0; i < m->n_tri && !s; i++) {
        const uint32_t *t = m->tri + 3 * i;
        s = sdm_outfile_printf(f, err, "3 %u %u %u\n", t[0], t[1], t[2]);
    }
    return s;
}
