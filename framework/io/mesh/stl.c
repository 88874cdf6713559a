/* STL meshes, ASCII and binary. The format repeats a vertex in every triangle that uses it; the
   reader merges equal vertices. */
#include "mesh_formats.h"
#include "sdm/internal/rng.h"
#include "sdm/memory.h"

#include <float.h>
#include <math.h>

/* Number of bytes of the binary header, which includes the number of facets, and of a facet. */
#define STL_HEADER 84
#define STL_FACET 50

/* A hash table of vertices by the bits of their coordinates, with open addressing: slot[mask + 1]
   holds vertex index + 1; a free slot holds 0. */
typedef struct vertex_table {
    uint32_t *slot;
    size_t mask;
} vertex_table;

/* Allocates a table that n_corner vertices fill to at most one half. */
static sdm_status table_create(vertex_table *w, size_t n_corner, sdm_error *err)
{
    size_t size = 64;
    while (size < 2 * n_corner) size *= 2;
    w->mask = size - 1;
    return SDM_ALLOC(&w->slot, size, "table of STL vertices", err);
}

/* *out = index of the vertex at raw[3], which is added to the mesh when it is new. */
static sdm_status merge_vertex(sdm_builder *b, vertex_table *w, const double raw[3], uint32_t *out,
                               sdm_error *err)
{
    uint64_t hash = 0;
    double x[3];
    for (int i = 0; i < 3; i++) {
        uint64_t bits;
        x[i] = raw[i] + 0.0; // -0 becomes +0
        memcpy(&bits, &x[i], sizeof bits);
        hash = sdm_mix64(hash + 0x9E3779B97F4A7C15u + bits);
    }
    size_t at = (size_t)hash & w->mask;
    for (; w->slot[at]; at = (at + 1) & w->mask) {
        *out = w->slot[at] - 1;
        if (memcmp(b->mesh->vert + 3 * (size_t)*out, x, sizeof x) == 0) return SDM_OK;
    }
    *out = (uint32_t)b->n_vert;
    const sdm_status s = sdm_builder_vertex(b, x, err);
    if (!s) w->slot[at] = *out + 1;
    return s;
}

static sdm_status read_facets(sdm_builder *b, vertex_table *w, const uint8_t *data, size_t n,
                              sdm_error *err)
{
    for (size_t i = 0; i < n; i++) {
        const uint8_t *facet = data + STL_HEADER + STL_FACET * i + 12; // skips the normal
        uint32_t v[3];
        for (int c = 0; c < 3; c++) {
            double x[3];
            for (int d = 0; d < 3; d++) x[d] = (double)sdm_get_f32(facet + 12 * c + 4 * d, false);
            if (!(isfinite(x[0]) && isfinite(x[1]) && isfinite(x[2])))
                return sdm_fail(err, SDM_E_FORMAT,
                                "%s: byte %zu: coordinates of facet %zu are not finite", b->path,
                                (size_t)(facet + 12 * c - data), i);
            const sdm_status s = merge_vertex(b, w, x, &v[c], err);
            if (s) return s;
        }
        const sdm_status s = sdm_builder_triangle(b, v[0], v[1], v[2], err);
        if (s) return s;
    }
    return SDM_OK;
}

static char lower(char c) { return c >= 'A' && c <= 'Z' ? (char)(c - 'A' + 'a') : c; }

/* True when the text begins with "solid", in upper or lower case, after blanks. */
static bool begins_with_solid(const char *text, size_t size)
{
    size_t at = sdm_scan_mark(text, size), n = 0;
    while (at < size && (text[at] == ' ' || (text[at] >= '\t' && text[at] <= '\r'))) at++;
    while (n < 5 && at + n < size && lower(text[at + n]) == "solid"[n]) n++;
    return n == 5;
}

static sdm_status read_ascii(sdm_builder *b, vertex_table *w, uint8_t *data, size_t size,
                             sdm_error *err)
{
    sdm_scan scan = {.at = (char *)data, .end = (char *)data + size, .path = b->path};
    uint32_t v[3] = {0};
    int n = -1; // corners of the open facet; -1: outside of a facet
    bool ended = false;
    for (char *line; (line = sdm_scan_line(&scan)) != NULL;) {
        char *word = sdm_scan_word(&line);
        for (char *c = word; *c; c++) *c = lower(*c);
        sdm_status s = SDM_OK;
        double x[3];
        // a corner; the begin and the end of a facet; words without effect
        if (strcmp(word, "vertex") == 0) {
            if (n < 0 || n > 2)
                return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: vertex outside a facet of three",
                                scan.path, scan.line);
            s = sdm_scan_reals(&scan, &line, x, 3, err);
            if (!s) s = merge_vertex(b, w, x, &v[n++], err);
        } else if (strcmp(word, "facet") == 0) {
            if (n >= 0)
                return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: facet inside a facet", scan.path,
                                scan.line);
            n = 0;
        } else if (strcmp(word, "endfacet") == 0) {
            if (n != 3)
                return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: facet of %d vertices", scan.path,
                                scan.line, n < 0 ? 0 : n);
            s = sdm_builder_triangle(b, v[0], v[1], v[2], err);
            n = -1;
        } else if (strcmp(word, "solid") != 0 && strcmp(word, "endsolid") != 0 &&
                   strcmp(word, "outer") != 0 && strcmp(word, "endloop") != 0) {
            return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: '%.40s' is not a word of STL", scan.path,
                            scan.line, word);
        }
        if (s) return s;
        ended = strcmp(word, "endsolid") == 0;
    }
    if (n >= 0 || !ended)
        return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: the file ends before 'endsolid'", scan.path,
                        scan.lines);
    return SDM_OK;
}

sdm_status sdm_stl_read(sdm_builder *b, uint8_t *data, size_t size, sdm_error *err)
{
    // a binary header may begin with "solid" too, so the length of the file decides
    const uint64_t n = size >= STL_HEADER ? sdm_get_uint(data + 80, 4, false) : 0;
    const bool binary = size >= STL_HEADER && n * STL_FACET == size - STL_HEADER;
    const bool ascii = !binary && begins_with_solid((const char *)data, size);
    if (!binary && !ascii && size < STL_HEADER)
        return sdm_fail(err, SDM_E_FORMAT, "%s: byte %zu: too short for an STL file", b->path,
                        size);
    if (!binary && !ascii)
        return sdm_fail(
            err, SDM_E_FORMAT, "%s: byte 80: %llu facets need %llu bytes, the file has %zu",
            b->path, (unsigned long long)n, (unsigned long long)(n * STL_FACET + STL_HEADER), size);
    vertex_table w = {0};
    // a corner in ASCII, "vertex 0 0 0", has at least 12 bytes
    sdm_status s = table_create(&w, binary ? 3 * (size_t)n : size / 12, err);
    if (!s)
        s = binary ? read_facets(b, &w, data, (size_t)n, err) : read_ascii(b, &w, data, size, err);
    sdm_free(w.slot);
    return s;
}

/* n = unit normal of the triangle a, b, c; zero for a degenerate triangle. */
static void facet_normal(const double *a, const double *b, const double *c, double n[3])
{
    const double u[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]},
                 v[3] = {c[0] - a[0], c[1] - a[1], c[2] - a[2]};
    n[0] = u[1] * v[2] - u[2] * v[1];
    n[1] = u[2] * v[0] - u[0] * v[2];
    n[2] = u[0] * v[1] - u[1] * v[0];
    const double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int i = 0; i < 3; i++) n[i] = length > 0 ? n[i] / length : 0;
}

sdm_status sdm_stl_write(sdm_outfile *f, const sdm_mesh *m, sdm_error *err)
{
    for (size_t i = 0; i < 3 * m->n_vert; i++)
        if (!(fabs(m->vert[i]) <= (double)FLT_MAX))
            return sdm_fail(err, SDM_E_MESH,
                            "coordinate %g of vertex %zu does not fit STL's float32", m->vert[i],
                            i / 3);
    uint8_t header[STL_HEADER] = "binary STL, mm"; // must not begin with "solid"
    sdm_put_uint(header + 80, 4, m->n_tri);
    sdm_status s = sdm_outfile_write(f, header, sizeof header, err);
    for (size_t i = 0; i < m->n_tri && !s; i++) {
        const double *v[3];
        double n[3];
        uint8_t facet[STL_FACET] = {0};
        for (int c = 0; c < 3; c++) v[c] = m->vert + 3 * (size_t)m->tri[3 * i + (size_t)c];
        facet_normal(v[0], v[1], v[2], n);
        for (int d = 0; d < 3; d++) {
            sdm_put_f32(facet + 4 * d, (float)n[d]);
            for (int c = 0; c < 3; c++) sdm_put_f32(facet + 12 + 12 * c + 4 * d, (float)v[c][d]);
        }
        s = sdm_outfile_write(f, facet, sizeof facet, err);
    }
    return s;
}
