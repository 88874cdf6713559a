/* VTK legacy polydata (.vtk), ASCII and binary (big-endian), versions 1 to 5.1. Reads points,
 * polygons and triangle strips; other cells and all data of points and cells are ignored. */
#include <stdio.h>
#include <strings.h>

#include "polydata.h"
#include "sdm/internal/text.h"
#include "sdm/memory.h"
#include "vtk_types.h"

#define WORD_MAX 128

/* The reading position. */
typedef struct cursor {
    const char *path;
    const uint8_t *start, *at, *end;
    size_t line; /* number of the current line while the file is text */
    bool ascii;  /* false: arrays are binary */
    double version;
} cursor;

static sdm_status fail_here(const cursor *c, sdm_error *err, const char *what)
{
    if (c->ascii) return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: %s", c->path, c->line, what);
    return sdm_fail(err, SDM_E_FORMAT, "%s: byte %zu: %s", c->path, (size_t)(c->at - c->start),
                    what);
}

/* Copies the next word; false at the end of the file. A longer word is cut, which makes it no
 * keyword and no number. */
static bool next_word(cursor *c, char word[WORD_MAX])
{
    size_t n = 0;
    while (c->at < c->end && (*c->at <= ' ' && *c->at != 0)) c->line += *c->at++ == '\n';
    for (; c->at<c->end && * c->at> ' '; c->at++)
        if (n + 1 < WORD_MAX) word[n++] = (char)*c->at;
    word[n] = '\0';
    return n > 0;
}

/* Cuts the rest of the line off; it is copied to line[WORD_MAX] unless that is NULL. */
static void next_line(cursor *c, char *line)
{
    size_t n = 0;
    for (; c->at < c->end && *c->at != '\n'; c->at++)
        if (line && n + 1 < WORD_MAX && *c->at != '\r') line[n++] = (char)*c->at;
    if (line) line[n] = '\0';
    if (c->at < c->end) c->at++;
    c->line++;
}

static sdm_status next_count(cursor *c, size_t *out, sdm_error *err)
{
    char word[WORD_MAX];
    int64_t v;
    if (!next_word(c, word) || !sdm_parse_int(word, &v) || v < 0 || v > (int64_t)1 << 40)
        return fail_here(c, err, "need a count, a whole number from 0");
    *out = (size_t)v;
    return SDM_OK;
}

static sdm_status next_type(cursor *c, const sdm_vtk_type **type, sdm_error *err)
{
    char word[WORD_MAX];
    *type = next_word(c, word) ? sdm_vtk_type_legacy(word) : NULL;
    return *type ? SDM_OK : fail_here(c, err, "need a type such as float, double or int");
}

/* Begins an array of n numbers at the next line, and demands that the file can hold them. */
static sdm_status begin_array(cursor *c, size_t n, const sdm_vtk_type *type, sdm_error *err)
{
    if (!c->ascii) next_line(c, NULL);
    const size_t left = (size_t)(c->end - c->at);
    if (n <= (c->ascii ? left / 2 + 1 : left / type->size)) return SDM_OK;
    char text[96];
    snprintf(text, sizeof text, "%zu numbers cannot fit into the %zu bytes that are left", n, left);
    return fail_here(c, err, text);
}

static sdm_status read_reals(cursor *c, size_t n, const sdm_vtk_type *type, double **out,
                             sdm_error *err)
{
    char word[WORD_MAX];
    sdm_status s = begin_array(c, n, type, err);
    if (!s) s = SDM_ALLOC(out, n, "points of a VTK file", err);
    for (size_t i = 0; i < n && !s; i++) {
        if (!c->ascii)
            (*out)[i] = sdm_vtk_real(c->at, type, true), c->at += type->size;
        else if (!next_word(c, word) || !sdm_parse_real(word, &(*out)[i]))
            s = fail_here(c, err, "need a finite number");
    }
    return s;
}

static sdm_status read_indices(cursor *c, size_t n, const sdm_vtk_type *type, int64_t **out,
                               sdm_error *err)
{
    char word[WORD_MAX];
    if (type->kind == 'f') return fail_here(c, err, "indices need a type of whole numbers");
    sdm_status s = begin_array(c, n, type, err);
    if (!s) s = SDM_ALLOC(out, n, "cells of a VTK file", err);
    for (size_t i = 0; i < n && !s; i++) {
        if (!c->ascii)
            (*out)[i] = sdm_vtk_index(c->at, type, true), c->at += type->size;
        else if (!next_word(c, word) || !sdm_parse_int(word, &(*out)[i]))
            s = fail_here(c, err, "need a whole number");
    }
    return s;
}

static sdm_status skip_array(cursor *c, size_t n, const sdm_vtk_type *type, sdm_error *err)
{
    char word[WORD_MAX];
    const sdm_status s = begin_array(c, n, type, err);
    if (s) return s;
    if (!c->ascii) c->at += n * type->size;
    for (size_t i = 0; c->ascii && i < n; i++)
        if (!next_word(c, word)) return fail_here(c, err, "the file ends inside an array");
    return SDM_OK;
}

/* Versions before 5: the corners of each cell follow their number, `size` numbers in all. They are
 * moved to the front of the same array. */
static sdm_status read_counted_cells(cursor *c, size_t n_cells, size_t size, sdm_vtk_cells *out,
                                     sdm_error *err)
{
    if (n_cells > size) return fail_here(c, err, "more cells than numbers");
    sdm_status s = read_indices(c, size, sdm_vtk_type_legacy("int"), &out->corner, err);
    if (!s) s = SDM_ALLOC(&out->offset, n_cells + 1, "cells of a VTK file", err);
    if (s) return s;
    size_t at = 0, corners = 0;
    for (size_t i = 0; i < n_cells; i++) {
        const int64_t n = at < size ? out->corner[at++] : -1;
        if (n < 0 || (uint64_t)n > size - at)
            return fail_here(c, err, "the sizes of the cells and the size of their list differ");
        for (int64_t k = 0; k < n; k++) out->corner[corners++] = out->corner[at++];
        out->offset[i + 1] = (int64_t)corners;
    }
    if (at != size)
        return fail_here(c, err, "the sizes of the cells and the size of their list differ");
    out->n_offset = n_cells + 1;
    out->n_corner = corners;
    return SDM_OK;
}

/* From version 5 on: the arrays OFFSETS and CONNECTIVITY. */
static sdm_status read_offset_cells(cursor *c, size_t n_offset, size_t n_corner, sdm_vtk_cells *out,
                                    sdm_error *err)
{
    static const char *const keys[] = {"OFFSETS", "CONNECTIVITY"};
    const size_t n[] = {n_offset, n_corner};
    int64_t **const arrays[] = {&out->offset, &out->corner};
    for (int k = 0; k < 2 && n_offset > 0; k++) {
        char word[WORD_MAX];
        const sdm_vtk_type *type;
        if (!next_word(c, word) || strcasecmp(word, keys[k]) != 0)
            return fail_here(c, err, k ? "need CONNECTIVITY" : "need OFFSETS");
        sdm_status s = next_type(c, &type, err);
        if (!s) s = read_indices(c, n[k], type, arrays[k], err);
        if (s) return s;
    }
    out->n_offset = n_offset;
    out->n_corner = n_corner;
    return SDM_OK;
}

static sdm_status read_cells(cursor *c, sdm_vtk_cells *out, sdm_error *err)
{
    size_t n = 0, size = 0;
    sdm_status s = next_count(c, &n, err);
    if (!s) s = next_count(c, &size, err);
    if (!s && out->offset) s = fail_here(c, err, "a second list of the same kind of cells");
    if (s) return s;
    return c->version < 5 ? read_counted_cells(c, n, size, out, err)
                          : read_offset_cells(c, n, size, out, err);
}

static sdm_status skip_cells(cursor *c, sdm_error *err)
{
    sdm_vtk_cells cells = {0};
    const sdm_status s = read_cells(c, &cells, err);
    sdm_vtk_cells_dispose(&cells);
    return s;
}

static sdm_status read_points(cursor *c, sdm_polydata *p, sdm_error *err)
{
    const sdm_vtk_type *type;
    sdm_status s = next_count(c, &p->n_points, err);
    if (!s) s = next_type(c, &type, err);
    if (!s && p->points) s = fail_here(c, err, "a second list of points");
    return s ? s : read_reals(c, 3 * p->n_points, type, &p->points, err);
}

/* FIELD name n: n arrays, each "name components tuples type". */
static sdm_status skip_field(cursor *c, sdm_error *err)
{
    char word[WORD_MAX];
    size_t n = 0, components = 0, tuples = 0;
    const sdm_vtk_type *type;
    if (!next_word(c, word)) return fail_here(c, err, "the file ends inside a FIELD");
    sdm_status s = next_count(c, &n, err);
    for (size_t i = 0; i < n && !s; i++) {
        if (!next_word(c, word)) return fail_here(c, err, "the file ends inside a FIELD");
        s = next_count(c, &components, err);
        if (!s) s = next_count(c, &tuples, err);
        if (!s) s = next_type(c, &type, err);
        if (!s && components > 0 && tuples > SIZE_MAX / 16 / components)
            s = fail_here(c, err, "an array that is too large");
        if (!s) s = skip_array(c, components * tuples, type, err);
    }
    return s;
}

/* METADATA ends at an empty line. */
static void skip_metadata(cursor *c)
{
    char line[WORD_MAX];
    next_line(c, NULL);
    do next_line(c, line);
    while (c->at < c->end && line[0]);
}

static sdm_status read_sections(cursor *c, sdm_polydata *p, sdm_error *err)
{
    char word[WORD_MAX];
    sdm_status s = SDM_OK;
    while (!s && next_word(c, word)) {
        if (!strcasecmp(word, "POINTS"))
            s = read_points(c, p, err);
        else if (!strcasecmp(word, "POLYGONS"))
            s = read_cells(c, &p->polygons, err);
        else if (!strcasecmp(word, "TRIANGLE_STRIPS"))
            s = read_cells(c, &p->strips, err);
        else if (!strcasecmp(word, "VERTICES") || !strcasecmp(word, "LINES"))
            s = skip_cells(c, err);
        else if (!strcasecmp(word, "FIELD"))
            s = skip_field(c, err);
        else if (!strcasecmp(word, "METADATA"))
            skip_metadata(c);
        else if (!strcasecmp(word, "POINT_DATA") || !strcasecmp(word, "CELL_DATA"))
            break; // data follow the geometry
        else
            s = fail_here(c, err, "need POINTS, POLYGONS or another keyword of polydata");
    }
    if (!s && !p->points) s = fail_here(c, err, "no POINTS");
    return s;
}

/* The four lines before the data. */
static sdm_status read_header(cursor *c, sdm_error *err)
{
    static const char magic[] = "# vtk DataFile Version ";
    char line[WORD_MAX], word[WORD_MAX];
    c->ascii = true;
    next_line(c, line);
    if (strncasecmp(line, magic, sizeof magic - 1) != 0 ||
        !sdm_parse_real(line + sizeof magic - 1, &c->version))
        return sdm_fail(err, SDM_E_FORMAT, "%s:1: not a VTK file (no '%s')", c->path, magic);
    if (!(c->version >= 1 && c->version < 6))
        return sdm_fail(err, SDM_E_UNSUPPORTED, "%s:1: VTK version %g, known are 1 to 5.1", c->path,
                        c->version);
    next_line(c, NULL); // the title
    const bool known =
        next_word(c, word) && (!strcasecmp(word, "ASCII") || !strcasecmp(word, "BINARY"));
    if (!known) return fail_here(c, err, "need ASCII or BINARY");
    const bool ascii = !strcasecmp(word, "ASCII");
    if (!next_word(c, word) || strcasecmp(word, "DATASET") != 0)
        return fail_here(c, err, "need DATASET POLYDATA");
    if (!next_word(c, word) || strcasecmp(word, "POLYDATA") != 0)
        return sdm_fail(err, SDM_E_UNSUPPORTED,
                        "%s:%zu: dataset '%.40s', a mesh is a dataset POLYDATA", c->path, c->line,
                        word);
    c->ascii = ascii;
    return SDM_OK;
}

sdm_status sdm_vtk_read(sdm_builder *b, uint8_t *data, size_t size, sdm_error *err)
{
    cursor c = {.path = b->path, .start = data, .at = data, .end = data + size, .line = 1};
    sdm_polydata p = {0};
    sdm_status s = read_header(&c, err);
    if (!s) s = read_sections(&c, &p, err);
    if (!s) s = sdm_polydata_build(&p, b, err);
    sdm_polydata_dispose(&p);
    return s;
}

/* Stores a number of `size` bytes, big-endian. */
static void put_big(uint8_t *p, size_t size, uint64_t v)
{
    for (size_t i = 0; i < size; i++) p[size - 1 - i] = (uint8_t)(v >> 8 * i);
}

sdm_status sdm_vtk_write(sdm_outfile *f, const sdm_mesh *m, sdm_error *err)
{
    sdm_status s = sdm_outfile_printf(
        f, err,
        "# vtk DataFile Version 3.0\nunit: mm\nBINARY\nDATASET POLYDATA\nPOINTS %zu double\n",
        m->n_vert);
    for (size_t i = 0; i < m->n_vert && !s; i++) {
        uint8_t bytes[24];
        for (size_t d = 0; d < 3; d++) {
            uint64_t bits;
            memcpy(&bits, &m->vert[3 * i + d], sizeof bits);
            put_big(bytes + 8 * d, 8, bits);
        }
        s = sdm_outfile_write(f, bytes, sizeof bytes, err);
    }
    if (!s) s = sdm_outfile_printf(f, err, "\nPOLYGONS %zu %zu\n", m->n_tri, 4 * m->n_tri);
    for (size_t i = 0; i < m->n_tri && !s; i++) {
        uint8_t bytes[16] = {0, 0, 0, 3};
        for (size_t c = 0; c < 3; c++) put_big(bytes + 4 + 4 * c, 4, m->tri[3 * i + c]);
        s = sdm_outfile_write(f, bytes, sizeof bytes, err);
    }
    return s ? s : sdm_outfile_printf(f, err, "\n");
}
