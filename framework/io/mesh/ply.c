/* PLY meshes, ASCII and binary in both byte orders. Unknown elements and properties are ignored. */
#include "ply_header.h"
#include "sdm/internal/text.h"

#include <math.h>

/* The reading position in the body of a file. */
typedef struct body {
    sdm_builder *b;
    sdm_ply_header h;
    /* binary: the file, the next number, the end */
    const uint8_t *start, *at, *end;
    /* ASCII: the text, and the rest of the current line */
    sdm_scan scan;
    char *line;
} body;

/* Fails with SDM_E_FORMAT; the message names the current line or byte. */
static sdm_status fail_here(const body *y, sdm_error *err, const char *what)
{
    if (y->h.ascii)
        return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: %s", y->b->path, y->scan.line, what);
    return sdm_fail(err, SDM_E_FORMAT, "%s: byte %zu: %s", y->b->path, (size_t)(y->at - y->start),
                    what);
}

static size_t bytes_left(const body *y)
{
    if (!y->h.ascii) return (size_t)(y->end - y->at);
    const char *from = y->line && *y->line ? y->line : y->scan.at;
    return (size_t)(y->scan.end - from) + 1; // the last word needs no separator
}

/* Smallest number of bytes that a number takes; in ASCII a digit and a separator. */
static size_t min_size(const body *y, sdm_ply_type type)
{
    return y->h.ascii ? 2 : sdm_ply_type_size(type);
}

static double decode_number(const uint8_t *p, sdm_ply_type type, bool big)
{
    const uint64_t v = sdm_get_uint(p, sdm_ply_type_size(type), big);
    switch (type) {
    case SDM_PLY_INT8:
        return (int8_t)v;
    case SDM_PLY_INT16:
        return (int16_t)v;
    case SDM_PLY_INT32:
        return (int32_t)v;
    case SDM_PLY_FLOAT32:
        return (double)sdm_get_f32(p, big);
    case SDM_PLY_FLOAT64:
        return sdm_get_f64(p, big);
    default:
        return (double)v;
    }
}

/* Reads the next number of the body into *out; out = NULL skips it unchecked. */
static sdm_status next_number(body *y, sdm_ply_type type, double *out, sdm_error *err)
{
    if (y->h.ascii) {
        const char *word = sdm_scan_token(&y->scan, &y->line);
        if (!word) return fail_here(y, err, "the file ends before its last element");
        if (out && !sdm_parse_real(word, out)) return fail_here(y, err, "not a finite number");
        return SDM_OK;
    }
    const size_t size = sdm_ply_type_size(type);
    if (bytes_left(y) < size) return fail_here(y, err, "the file ends before its last element");
    if (out) *out = decode_number(y->at, type, y->h.big);
    if (out && !isfinite(*out)) return fail_here(y, err, "not a finite number");
    y->at += size;
    return SDM_OK;
}

/* Reads a list property if it holds the corners of a face; skips any other list. */
static sdm_status read_list(body *y, const sdm_ply_property *p, sdm_error *err)
{
    const bool corners = p->role == SDM_PLY_CORNERS;
    double n;
    sdm_status s = next_number(y, p->count_type, &n, err);
    if (s) return s;
    if (!(n >= 0) || n != floor(n) || n > (double)(bytes_left(y) / min_size(y, p->type)))
        return fail_here(y, err, "a list longer than the file");
    if (corners && n < 3) return fail_here(y, err, "a face of less than three corners");
    sdm_fan fan = {0};
    for (size_t i = 0; i < (size_t)n; i++) {
        double v;
        s = next_number(y, p->type, corners ? &v : NULL, err);
        if (s) return s;
        if (!corners) continue;
        if (!(v >= 0) || v != floor(v) || v >= (double)y->h.n_vert)
            return fail_here(y, err, "a vertex index outside the vertices");
        s = sdm_builder_corner(y->b, &fan, (uint32_t)v, err);
        if (s) return s;
    }
    return SDM_OK;
}

/* Reads the properties of one vertex, face or other element. */
static sdm_status read_instance(body *y, const sdm_ply_element *element, sdm_error *err)
{
    double x[3] = {0};
    for (size_t i = 0; i < element->n; i++) {
        const sdm_ply_property *p = &y->h.property[element->first + i];
        sdm_status s;
        if (p->count_type != SDM_PLY_NONE)
            s = read_list(y, p, err);
        else
            s = next_number(y, p->type, p->role <= SDM_PLY_Z ? &x[p->role] : NULL, err);
        if (s) return s;
    }
    return element->is_vertex ? sdm_builder_vertex(y->b, x, err) : SDM_OK;
}

/* Reads all instances of an element. Before anything is allocated, their number is compared with
 * the bytes left. */
static sdm_status read_element(body *y, const sdm_ply_element *element, sdm_error *err)
{
    if (element->n == 0) return SDM_OK; // an element without properties takes no bytes
    size_t smallest = 0;
    for (size_t i = 0; i < element->n; i++) {
        const sdm_ply_property *p = &y->h.property[element->first + i];
        smallest += min_size(y, p->count_type != SDM_PLY_NONE ? p->count_type : p->type);
    }
    if ((uint64_t)element->count > bytes_left(y) / smallest)
        return fail_here(y, err, "more elements declared than the file holds");
    for (int64_t i = 0; i < element->count; i++) {
        const sdm_status s = read_instance(y, element, err);
        if (s) return s;
    }
    return SDM_OK;
}

/* Refuses bytes behind the last element, white space excepted: a count in the header may be too
 * low, and elements would be missing in silence. */
static sdm_status check_rest(body *y, sdm_error *err)
{
    if (y->h.ascii) {
        const char *word = sdm_scan_token(&y->scan, &y->line);
        return word ? fail_here(y, err, "more elements than the header declares") : SDM_OK;
    }
    const uint8_t *at = y->at;
    while (at < y->end && (*at == '\n' || *at == '\r' || *at == ' ')) at++;
    if (at == y->end) return SDM_OK;
    return sdm_fail(err, SDM_E_FORMAT,
                    "%s: byte %zu: %zu bytes behind the last element that the header declares",
                    y->b->path, (size_t)(y->at - y->start), bytes_left(y));
}

sdm_status sdm_ply_read(sdm_builder *b, uint8_t *data, size_t size, sdm_error *err)
{
    body y = {.b = b, .scan = {.at = (char *)data, .end = (char *)data + size, .path = b->path}};
    sdm_status s = sdm_ply_read_header(&y.scan, &y.h, err);
    y.start = data;
    y.at = (const uint8_t *)y.scan.at;
    y.end = data + size;
    for (size_t i = 0; i < y.h.n_elements && !s; i++) s = read_element(&y, &y.h.element[i], err);
    return s ? s : check_rest(&y, err);
}

sdm_status sdm_ply_write(sdm_outfile *f, const sdm_mesh *m, sdm_error *err)
{
    sdm_status s = sdm_outfile_printf(
        f, err,
        "ply\nformat binary_little_endian 1.0\ncomment unit: mm\nelement vertex %zu\n"
        "property double x\nproperty double y\nproperty double z\nelement face %zu\n"
        "property list uchar int vertex_indices\nend_header\n",
        m->n_vert, m->n_tri);
    for (size_t i = 0; i < m->n_vert && !s; i++) {
        uint8_t bytes[24];
        for (size_t d = 0; d < 3; d++) sdm_put_f64(bytes + 8 * d, m->vert[3 * i + d]);
        s = sdm_outfile_write(f, bytes, sizeof bytes, err);
    }
    for (size_t i = 0; i < m->n_tri && !s; i++) {
        uint8_t bytes[13] = {3};
        for (size_t c = 0; c < 3; c++) sdm_put_uint(bytes + 1 + 4 * c, 4, m->tri[3 * i + c]);
        s = sdm_outfile_write(f, bytes, sizeof bytes, err);
    }
    return s;
}
