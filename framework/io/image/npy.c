/* Reads and writes NumPy arrays (.npy) in C order. Reads format versions 1 to 3, float32 and
 * float64 of both byte orders; writes float32 and uint32, little endian. */
#include "sdm/image.h"

#include <stdio.h>

#include "bytes.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/npy.h"

#define NPY_FILE_MAX ((size_t)1 << 31)
#define NPY_HEADER_MAX ((size_t)1 << 16)
#define NPY_PREFIX 10 /* bytes of magic string, version and header length in version 1 */

/* The header, a Python dictionary as ASCII text: {'descr': '<f4', 'fortran_order': False, 'shape':
 * (3, 4), }. */
typedef struct npy_header {
    /* byte order and type, "<f4" */
    char descr[16];
    bool has_descr, has_order, has_shape, fortran;
    size_t shape[4];
    int n_dim;
} npy_header;

/* A position in the text of the header. The take_ functions skip white space, read what their name
   says and move behind it; they return false when something else is there. */
typedef struct cursor {
    const char *at, *end;
} cursor;

static void skip_space(cursor *c)
{
    while (c->at < c->end && (*c->at == ' ' || *c->at == '\n' || *c->at == '\t' || *c->at == '\r'))
        c->at++;
}

static bool take_char(cursor *c, char wanted)
{
    skip_space(c);
    if (c->at >= c->end || *c->at != wanted) return false;
    c->at++;
    return true;
}

static bool take_word(cursor *c, const char *word)
{
    const size_t n = strlen(word);
    skip_space(c);
    if ((size_t)(c->end - c->at) < n || memcmp(c->at, word, n) != 0) return false;
    c->at += n;
    return true;
}

static bool take_string(cursor *c, char *out, size_t size)
{
    skip_space(c);
    if (c->at >= c->end || (*c->at != '\'' && *c->at != '"')) return false;
    const char quote = *c->at++;
    size_t n = 0;
    while (c->at < c->end && *c->at != quote) {
        if (n + 1 >= size || *c->at == '\\') return false;
        out[n++] = *c->at++;
    }
    out[n] = '\0';
    return take_char(c, quote);
}

static bool take_size(cursor *c, size_t *out)
{
    size_t v = 0;
    skip_space(c);
    const char *start = c->at;
    for (; c->at < c->end && *c->at >= '0' && *c->at <= '9'; c->at++) {
        if (v > (SIZE_MAX - 9) / 10) return false;
        v = v * 10 + (size_t)(*c->at - '0');
    }
    *out = v;
    return c->at > start;
}

/* Reads "(3, 4)" or "(3,)". All dimensions are counted in n_dim, the first four stored. */
static bool take_shape(cursor *c, npy_header *h)
{
    h->n_dim = 0;
    if (!take_char(c, '(')) return false;
    while (!take_char(c, ')')) {
        size_t v;
        if (!take_size(c, &v)) return false;
        if (h->n_dim < 4) h->shape[h->n_dim] = v;
        h->n_dim++;
        if (!take_char(c, ',') && !(c->at < c->end && *c->at == ')')) return false;
    }
    return true;
}

static bool take_entry(cursor *c, npy_header *h)
{
    char key[16];
    if (!take_string(c, key, sizeof key) || !take_char(c, ':')) return false;
    if (strcmp(key, "descr") == 0) return h->has_descr = take_string(c, h->descr, sizeof h->descr);
    if (strcmp(key, "shape") == 0) return h->has_shape = take_shape(c, h);
    if (strcmp(key, "fortran_order") != 0) return false;
    h->fortran = take_word(c, "True");
    return h->has_order = h->fortran || take_word(c, "False");
}

static bool parse_header(cursor c, npy_header *h)
{
    if (!take_char(&c, '{')) return false;
    while (!take_char(&c, '}')) {
        if (!take_entry(&c, h)) return false;
        if (!take_char(&c, ',') && !(c.at < c.end && *c.at == '}')) return false;
    }
    skip_space(&c);
    return c.at == c.end && h->has_descr && h->has_order && h->has_shape;
}

/* Finds the header: *text = its text, *start = offset of the first value. */
static sdm_status find_header(const char *path, const uint8_t *data, size_t size, cursor *text,
                              size_t *start, sdm_error *err)
{
    if (size < NPY_PREFIX || memcmp(data, "\x93NUMPY", 6) != 0)
        return sdm_fail(err, SDM_E_FORMAT, "%s: byte 0: not a .npy file", path);
    if (data[6] < 1 || data[6] > 3)
        return sdm_fail(err, SDM_E_UNSUPPORTED, "%s: byte 6: .npy version %d, known are 1 to 3",
                        path, data[6]);
    const size_t width = data[6] == 1 ? 2 : 4, prefix = 8 + width;
    if (size < prefix)
        return sdm_fail(err, SDM_E_FORMAT, "%s: byte %zu: the file ends inside its header", path,
                        size);
    const uint64_t length = sdm_get_uint(data + 8, width, false);
    if (length > NPY_HEADER_MAX || length > size - prefix)
        return sdm_fail(err, SDM_E_FORMAT, "%s: byte 8: header of %llu bytes in a file of %zu",
                        path, (unsigned long long)length, size);
    *start = prefix + (size_t)length;
    *text = (cursor){(const char *)data + prefix, (const char *)data + *start};
    return SDM_OK;
}

/* Checks type, order and shape against the `available` bytes of values; *item: bytes of a value,
 * *count: number of values. */
static sdm_status check_header(const char *path, const npy_header *h, size_t *item, size_t *count,
                               size_t available, sdm_error *err)
{
    const bool f4 = strcmp(h->descr + (h->descr[0] != '\0'), "f4") == 0,
               f8 = strcmp(h->descr + (h->descr[0] != '\0'), "f8") == 0;
    if ((!f4 && !f8) || (h->descr[0] != '<' && h->descr[0] != '>'))
        return sdm_fail(
            err, SDM_E_UNSUPPORTED,
            "%s: values of type '%s', need float32 or float64: save with .astype('float32')", path,
            h->descr);
    if (h->n_dim < 1 || h->n_dim > 4)
        return sdm_fail(err, SDM_E_UNSUPPORTED, "%s: %d dimensions, need 1 to 4", path, h->n_dim);
    if (h->fortran && h->n_dim > 1)
        return sdm_fail(err, SDM_E_UNSUPPORTED,
                        "%s: Fortran order, need C order: save with numpy.ascontiguousarray()",
                        path);
    *item = f4 ? 4 : 8;
    size_t bytes = *item;
    for (int d = 0; d < h->n_dim; d++)
        if (sdm_mul(bytes, h->shape[d], &bytes, NULL))
            return sdm_fail(err, SDM_E_FORMAT, "%s: the shape in the header is too large", path);
    if (bytes != available)
        return sdm_fail(err, SDM_E_FORMAT,
                        "%s: the header's shape needs %zu bytes of values, the file has %zu", path,
                        bytes, available);
    *count = bytes / *item;
    return SDM_OK;
}

static sdm_status decode_file(const char *path, const uint8_t *data, size_t size, double **values,
                              size_t shape[4], int *n_dim, sdm_error *err)
{
    cursor text = {0};
    size_t start = 0, item = 0, count = 0;
    npy_header h = {0};
    sdm_status s = find_header(path, data, size, &text, &start, err);
    if (s) return s;
    if (!parse_header(text, &h))
        return sdm_fail(err, SDM_E_FORMAT, "%s: the .npy header cannot be read", path);
    s = check_header(path, &h, &item, &count, size - start, err);
    if (s) return s;
    s = SDM_ALLOC(values, count, "values of a .npy file", err);
    if (s) return s;
    const bool big = h.descr[0] == '>';
    const uint8_t *p = data + start;
    for (size_t i = 0; i < count; i++, p += item)
        (*values)[i] = item == 4 ? (double)sdm_get_f32(p, big) : sdm_get_f64(p, big);
    for (int d = 0; d < 4; d++) shape[d] = d < h.n_dim ? h.shape[d] : 1;
    *n_dim = h.n_dim;
    return SDM_OK;
}

sdm_status sdm_npy_read(const char *path, double **values, size_t shape[4], int *n_dim,
                        sdm_error *err)
{
    if (!path || !values || !shape || !n_dim)
        return sdm_fail(err, SDM_E_ARG, "sdm_npy_read: NULL argument");
    uint8_t *data = NULL;
    size_t size = 0;
    *values = NULL;
    sdm_status s = sdm_file_read(path, NPY_FILE_MAX, &data, &size, err);
    if (s) return s;
    s = decode_file(path, data, size, values, shape, n_dim, err);
    sdm_free(data);
    return s;
}

/* Writes a header of version 1, padded so that the values start at a multiple of 64 bytes. */
static sdm_status write_header(sdm_outfile *f, const char *descr, const size_t *shape, int n_dim,
                               sdm_error *err)
{
    char text[192];
    int n =
        snprintf(text, sizeof text, "{'descr': '%s', 'fortran_order': False, 'shape': (", descr);
    for (int d = 0; d < n_dim; d++)
        n += snprintf(text + n, sizeof text - (size_t)n,
                      n_dim == 1 ? "%zu,"
                      : d        ? ", %zu"
                                 : "%zu",
                      shape[d]);
    n += snprintf(text + n, sizeof text - (size_t)n, "), }");
    while ((NPY_PREFIX + n + 1) % 64 != 0) text[n++] = ' ';
    text[n++] = '\n';
    uint8_t prefix[NPY_PREFIX] = {0x93, 'N', 'U', 'M', 'P', 'Y', 1, 0};
    sdm_put_uint(prefix + 8, 2, (uint64_t)n);
    const sdm_status s = sdm_outfile_write(f, prefix, sizeof prefix, err);
    return s ? s : sdm_outfile_write(f, text, (size_t)n, err);
}

/* Writes words[count] of 4 or 8 bytes, little endian. */
static sdm_status write_words(sdm_outfile *f, const uint8_t *words, size_t size, size_t count,
                              sdm_error *err)
{
    uint8_t block[4096];
    for (size_t i = 0; i < count;) {
        size_t n = 0;
        for (; n < sizeof block && i < count; n += size, i++) {
            uint32_t word;
            uint64_t wide;
            memcpy(&word, words + size * i, sizeof word);
            if (size == sizeof wide) memcpy(&wide, words + size * i, sizeof wide);
            sdm_put_uint(block + n, size, size == sizeof wide ? wide : word);
        }
        const sdm_status s = sdm_outfile_write(f, block, n, err);
        if (s) return s;
    }
    return SDM_OK;
}

/* Writes an array of values of type `descr` and `size` bytes, 4 or 8. */
static sdm_status write_array(const char *path, const char *descr, const void *words, size_t size,
                              const size_t *shape, int n_dim, sdm_error *err)
{
    if (!path || !words || !shape)
        return sdm_fail(err, SDM_E_ARG, "writing of a .npy file: NULL argument");
    if (n_dim < 1 || n_dim > 4)
        return sdm_fail(err, SDM_E_ARG, "%s: %d dimensions, need 1 to 4", path, n_dim);
    size_t count = 1;
    sdm_status s = SDM_OK;
    for (int d = 0; d < n_dim && !s; d++) s = sdm_mul(count, shape[d], &count, err);
    if (s) return sdm_fail(err, SDM_E_ARG, "%s: the product of the dimensions is too large", path);
    sdm_outfile *f = NULL;
    s = sdm_outfile_open(path, &f, err);
    if (!s) s = write_header(f, descr, shape, n_dim, err);
    if (!s) s = write_words(f, words, size, count, err);
    if (!s) return sdm_outfile_commit(&f, err);
    sdm_outfile_discard(&f);
    return s;
}

sdm_status sdm_npy_write(const char *path, const float *values, const size_t *shape, int n_dim,
                         sdm_error *err)
{
    return write_array(path, "<f4", values, sizeof *values, shape, n_dim, err);
}

sdm_status sdm_npy_write_uint32(const char *path, const uint32_t *values, const size_t *shape,
                                int n_dim, sdm_error *err)
{
    return write_array(path, "<u4", values, sizeof *values, shape, n_dim, err);
}

sdm_status sdm_npy_write_double(const char *path, const double *values, const size_t *shape,
                                int n_dim, sdm_error *err)
{
    return write_array(path, "<f8", values, sizeof *values, shape, n_dim, err);
}
