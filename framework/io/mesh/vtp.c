/* VTK XML polydata (.vtp). Reads points, polygons and strips of one piece: ASCII, base64 and
 * appended (raw or base64), uncompressed or compressed with zlib, headers of 32 and 64 bits, both
 * byte orders. All other cells and all data of points and cells are ignored. Writes base64. */
#include <stdio.h>

#include "polydata.h"
#include "sdm/internal/text.h"
#include "sdm/memory.h"
#include "vtk_types.h"
#include "vtp_data.h"
#include "vtp_tags.h"

enum { POINTS, POLYGON_CORNERS, POLYGON_OFFSETS, STRIP_CORNERS, STRIP_OFFSETS, N_ARRAYS };

/* A DataArray as its tag describes it. */
typedef struct array {
    const sdm_vtk_type *type; /* NULL: the file has no such array */
    sdm_span format, text;    /* text: what stands between the tags */
    uint64_t offset;          /* into the appended data */
} array;

typedef struct document {
    sdm_tags tags;
    array arrays[N_ARRAYS];
    size_t n_pieces;
    uint64_t n_points, n_polygons, n_strips;
    const uint8_t *appended; /* NULL: none */
    sdm_vtp_source source;   /* what all arrays share */
} document;

static sdm_status read_root(document *d, sdm_error *err)
{
    sdm_tags *t = &d->tags;
    const sdm_span order = sdm_tags_attribute(t, "byte_order"),
                   header = sdm_tags_attribute(t, "header_type"),
                   compressor = sdm_tags_attribute(t, "compressor");
    if (!sdm_span_is(t->name, "VTKFile")) return sdm_tags_fail(t, "need <VTKFile>", err);
    if (!sdm_span_is(sdm_tags_attribute(t, "type"), "PolyData"))
        return sdm_tags_fail(t, "need type=\"PolyData\"", err);
    d->source.big = sdm_span_is(order, "BigEndian");
    d->source.header_size = sdm_span_is(header, "UInt64") ? 8 : 4;
    d->source.compressed = compressor.at && compressor.size > 0;
    if (d->source.compressed && !sdm_span_is(compressor, "vtkZLibDataCompressor"))
        return sdm_fail(err, SDM_E_UNSUPPORTED,
                        "%s: the compressor is not vtkZLibDataCompressor; save it with zlib or "
                        "without compression",
                        t->path);
    return SDM_OK;
}

/* Which array the tag begins, or N_ARRAYS: it depends on the element around it. */
static int array_of(const sdm_tags *t)
{
    const int at = t->depth - (t->empty ? 1 : 2);
    if (at < 0 || !sdm_span_is(t->name, "DataArray")) return N_ARRAYS;
    const sdm_span parent = t->open[at], name = sdm_tags_attribute(t, "Name");
    const int first = sdm_span_is(parent, "Polys")    ? POLYGON_CORNERS
                      : sdm_span_is(parent, "Strips") ? STRIP_CORNERS
                                                      : N_ARRAYS;
    if (sdm_span_is(parent, "Points")) return POINTS;
    if (first == N_ARRAYS) return N_ARRAYS;
    return sdm_span_is(name, "connectivity") ? first
           : sdm_span_is(name, "offsets")    ? first + 1
                                             : N_ARRAYS;
}

static sdm_status read_array_tag(document *d, int which, sdm_error *err)
{
    sdm_tags *t = &d->tags;
    array *a = &d->arrays[which];
    const sdm_span type = sdm_tags_attribute(t, "type"), offset = sdm_tags_attribute(t, "offset"),
                   components = sdm_tags_attribute(t, "NumberOfComponents");
    if (a->type) return sdm_tags_fail(t, "an array that is there already", err);
    a->type = type.at ? sdm_vtk_type_xml(type.at, type.size) : NULL;
    if (!a->type) return sdm_tags_fail(t, "a DataArray without a known type", err);
    if (which == POINTS && !sdm_span_is(components, "3"))
        return sdm_tags_fail(t, "points need NumberOfComponents=\"3\"", err);
    if (which != POINTS && a->type->kind == 'f')
        return sdm_tags_fail(t, "indices need a type of whole numbers", err);
    a->format = sdm_tags_attribute(t, "format");
    if (offset.at && !sdm_span_count(offset, &a->offset))
        return sdm_tags_fail(t, "offset is no whole number", err);
    a->text.at = t->at;
    const char *stop = t->empty ? t->at : memchr(t->at, '<', (size_t)(t->end - t->at));
    a->text.size = stop ? (size_t)(stop - t->at) : 0;
    return SDM_OK;
}

static sdm_status read_piece(document *d, sdm_error *err)
{
    const struct {
        const char *name;
        uint64_t *out;
    } counts[] = {{"NumberOfPoints", &d->n_points},
                  {"NumberOfPolys", &d->n_polygons},
                  {"NumberOfStrips", &d->n_strips}};
    if (d->n_pieces++ > 0)
        return sdm_fail(err, SDM_E_UNSUPPORTED, "%s: several pieces; save it as one", d->tags.path);
    for (int i = 0; i < 3; i++) {
        const sdm_span text = sdm_tags_attribute(&d->tags, counts[i].name);
        if (text.at && !sdm_span_count(text, counts[i].out))
            return sdm_tags_fail(&d->tags, "a number of points or cells is no whole number", err);
    }
    return SDM_OK;
}

/* The appended data begin behind the first underscore; the text ends here, since they may be raw.
 */
static sdm_status read_appended(document *d, sdm_error *err)
{
    sdm_tags *t = &d->tags;
    const sdm_span encoding = sdm_tags_attribute(t, "encoding");
    const char *mark = memchr(t->at, '_', (size_t)(t->end - t->at));
    d->source.base64 = sdm_span_is(encoding, "base64");
    if (!d->source.base64 && !sdm_span_is(encoding, "raw"))
        return sdm_tags_fail(t, "appended data need the encoding raw or base64", err);
    if (!mark) return sdm_tags_fail(t, "no '_' before the appended data", err);
    d->appended = (const uint8_t *)mark + 1;
    return SDM_OK;
}

/* Reads all tags up to the appended data. */
static sdm_status read_tags(document *d, sdm_error *err)
{
    bool more = true;
    sdm_status s = sdm_tags_next(&d->tags, &more, err);
    if (!s) s = read_root(d, err);
    while (!s && !d->appended) {
        s = sdm_tags_next(&d->tags, &more, err);
        if (s || !more) break;
        if (d->tags.closes) continue;
        const int which = array_of(&d->tags);
        if (sdm_span_is(d->tags.name, "Piece"))
            s = read_piece(d, err);
        else if (sdm_span_is(d->tags.name, "AppendedData"))
            s = read_appended(d, err);
        else if (which < N_ARRAYS)
            s = read_array_tag(d, which, err);
    }
    return s;
}

/* Counts the words of a text. */
static size_t count_words(sdm_span text)
{
    size_t n = 0;
    for (size_t i = 0; i < text.size; i++)
        n += (unsigned char)text.at[i] > ' ' && (i == 0 || (unsigned char)text.at[i - 1] <= ' ');
    return n;
}

/* Copies the next word of the text; false for one of more than 63 characters. */
static bool cut_word(sdm_span *text, char word[64])
{
    size_t n = 0;
    while (text->size > 0 && (unsigned char)*text->at <= ' ') text->at++, text->size--;
    for (; text->size > 0 && (unsigned char)*text->at > ' '; text->at++, text->size--)
        if (n < 64) word[n++] = *text->at;
    if (n == 64) return false;
    word[n] = '\0';
    return true;
}

static sdm_status fail_array(const document *d, int which, const char *what, sdm_error *err)
{
    static const char *const names[] = {"points", "connectivity of polygons", "offsets of polygons",
                                        "connectivity of strips", "offsets of strips"};
    return sdm_fail(err, SDM_E_FORMAT, "%s: %s: %s", d->tags.path, names[which], what);
}

/* Reads numbers: into reals[n] for the points, else into indices[n]. */
static sdm_status read_ascii(const document *d, int which, double **reals, int64_t **indices,
                             size_t *n, sdm_error *err)
{
    sdm_span text = d->arrays[which].text;
    char word[64];
    *n = count_words(text);
    sdm_status s = reals ? SDM_ALLOC(reals, *n, "points of a VTK file", err)
                         : SDM_ALLOC(indices, *n, "cells of a VTK file", err);
    for (size_t i = 0; i < *n && !s; i++) {
        const bool ok = cut_word(&text, word) && (reals ? sdm_parse_real(word, &(*reals)[i])
                                                        : sdm_parse_int(word, &(*indices)[i]));
        if (!ok) s = fail_array(d, which, "need finite numbers", err);
    }
    return s;
}

static sdm_status read_binary(const document *d, int which, double **reals, int64_t **indices,
                              size_t *n, sdm_error *err)
{
    const array *a = &d->arrays[which];
    const bool appended = sdm_span_is(a->format, "appended");
    sdm_vtp_source source = d->source;
    if (appended && !d->appended) return fail_array(d, which, "no appended data", err);
    if (appended) {
        if (a->offset > (size_t)(source.end - d->appended))
            return fail_array(d, which, "the offset is outside the file", err);
        source.at = d->appended + a->offset;
    } else {
        source.base64 = true;
        source.at = (const uint8_t *)a->text.at;
        source.end = source.at + a->text.size;
    }
    uint8_t *bytes = NULL;
    size_t size = 0;
    sdm_status s = sdm_vtp_bytes(&source, &bytes, &size, err);
    if (!s && size % a->type->size) s = fail_array(d, which, "a part of a number is missing", err);
    *n = size / a->type->size;
    if (!s)
        s = reals ? SDM_ALLOC(reals, *n, "points of a VTK file", err)
                  : SDM_ALLOC(indices, *n, "cells of a VTK file", err);
    for (size_t i = 0; i < *n && !s; i++) {
        const uint8_t *p = bytes + i * a->type->size;
        if (reals)
            (*reals)[i] = sdm_vtk_real(p, a->type, source.big);
        else
            (*indices)[i] = sdm_vtk_index(p, a->type, source.big);
    }
    sdm_free(bytes);
    return s;
}

/* Reads one array; an array that is missing has 0 numbers. */
static sdm_status read_array(const document *d, int which, double **reals, int64_t **indices,
                             size_t *n, sdm_error *err)
{
    const array *a = &d->arrays[which];
    *n = 0;
    if (!a->type) return SDM_OK;
    if (sdm_span_is(a->format, "ascii")) return read_ascii(d, which, reals, indices, n, err);
    if (sdm_span_is(a->format, "binary") || sdm_span_is(a->format, "appended"))
        return read_binary(d, which, reals, indices, n, err);
    return fail_array(d, which, "need the format ascii, binary or appended", err);
}

/* Reads cells. In the file, the offsets are the ends of the cells. */
static sdm_status read_cells(const document *d, int corners, uint64_t n_cells, sdm_vtk_cells *out,
                             sdm_error *err)
{
    int64_t *ends = NULL;
    size_t n = 0;
    sdm_status s = read_array(d, corners, NULL, &out->corner, &out->n_corner, err);
    if (!s) s = read_array(d, corners + 1, NULL, &ends, &n, err);
    if (!s && n != n_cells) s = fail_array(d, corners + 1, "not one for each cell", err);
    if (!s) s = SDM_ALLOC(&out->offset, n + 1, "cells of a VTK file", err);
    if (!s && n > 0) memcpy(out->offset + 1, ends, n * sizeof *ends);
    if (!s) out->n_offset = n + 1;
    sdm_free(ends);
    return s;
}

sdm_status sdm_vtp_read(sdm_builder *b, uint8_t *data, size_t size, sdm_error *err)
{
    const char *text = (const char *)data;
    document d = {.tags = {.path = b->path, .start = text, .at = text, .end = text + size},
                  .source = {.path = b->path, .start = data, .end = data + size}};
    sdm_polydata p = {0};
    size_t n = 0;
    sdm_status s = read_tags(&d, err);
    if (!s && d.n_pieces == 0)
        s = sdm_fail(err, SDM_E_FORMAT, "%s: no <Piece>: no polydata", b->path);
    if (!s) s = read_array(&d, POINTS, &p.points, NULL, &n, err);
    if (!s && (n % 3 || n / 3 != d.n_points))
        s = fail_array(&d, POINTS, "their number differs from NumberOfPoints", err);
    p.n_points = n / 3;
    if (!s) s = read_cells(&d, POLYGON_CORNERS, d.n_polygons, &p.polygons, err);
    if (!s) s = read_cells(&d, STRIP_CORNERS, d.n_strips, &p.strips, err);
    if (!s) s = sdm_polydata_build(&p, b, err);
    sdm_polydata_dispose(&p);
    return s;
}

/* Writes base64: bytes wait in `bytes` until three are together. */
typedef struct encoder {
    sdm_outfile *f;
    uint8_t bytes[3];
    size_t n;
    sdm_status status;
    sdm_error *err;
} encoder;

static void encode_group(encoder *e)
{
    static const char letters[] =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    char text[4];
    for (size_t i = e->n; i < 3; i++) e->bytes[i] = 0;
    const uint32_t v = (uint32_t)e->bytes[0] << 16 | (uint32_t)e->bytes[1] << 8 | e->bytes[2];
    for (size_t i = 0; i < 4; i++) text[i] = i > e->n ? '=' : letters[v >> (18 - 6 * i) & 63];
    if (!e->status) e->status = sdm_outfile_write(e->f, text, sizeof text, e->err);
    e->n = 0;
}

static void encode(encoder *e, uint64_t bits)
{
    for (int i = 0; i < 8; i++) {
        e->bytes[e->n++] = (uint8_t)(bits >> 8 * i);
        if (e->n == 3) encode_group(e);
    }
}

/* Ends an array. */
static sdm_status encode_end(encoder *e)
{
    if (e->n > 0) encode_group(e);
    return e->status ? e->status : sdm_outfile_printf(e->f, e->err, "\n</DataArray>\n");
}

sdm_status sdm_vtp_write(sdm_outfile *f, const sdm_mesh *m, sdm_error *err)
{
    encoder e = {.f = f, .err = err};
    const sdm_status s = sdm_outfile_printf(
        f, err,
        "<?xml version=\"1.0\"?>\n<!-- unit: mm -->\n<VTKFile type=\"PolyData\" version=\"1.0\" "
        "byte_order=\"LittleEndian\" header_type=\"UInt64\">\n<PolyData>\n"
        "<Piece NumberOfPoints=\"%zu\" NumberOfVerts=\"0\" NumberOfLines=\"0\" "
        "NumberOfStrips=\"0\" NumberOfPolys=\"%zu\">\n<Points>\n"
        "<DataArray type=\"Float64\" Name=\"Points\" NumberOfComponents=\"3\" "
        "format=\"binary\">\n",
        m->n_vert, m->n_tri);
    if (s) return s;
    encode(&e, 24 * (uint64_t)m->n_vert);
    for (size_t i = 0; i < 3 * m->n_vert; i++) {
        uint64_t bits;
        memcpy(&bits, &m->vert[i], sizeof bits);
        encode(&e, bits);
    }
    e.status = encode_end(&e);
    for (int offsets = 0; offsets < 2 && !e.status; offsets++) {
        const size_t n = offsets ? m->n_tri : 3 * m->n_tri;
        e.status = sdm_outfile_printf(
            f, err, "%s<DataArray type=\"Int64\" Name=\"%s\" format=\"binary\">\n",
            offsets ? "" : "</Points>\n<Polys>\n", offsets ? "offsets" : "connectivity");
        encode(&e, 8 * (uint64_t)n);
        for (size_t i = 0; i < n; i++) encode(&e, offsets ? 3 * (uint64_t)(i + 1) : m->tri[i]);
        e.status = encode_end(&e);
    }
    if (e.status) return e.status;
    return sdm_outfile_printf(f, err, "</Polys>\n</Piece>\n</PolyData>\n</VTKFile>\n");
}
