/* Image files and .npy arrays, read back by small readers that share no code with the writers.
 * Tests: image_write.c metaimage_write.c nifti_write.c npy.c nrrd_write.c sink.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>
#include <zlib.h>

#include "image_phantom.h"
#include "sdm/image.h"
#include "sdm/internal/rng.h"
#include "sdm/memory.h"

/* The result of a reader: values, and the affine map from index (i, j, k) to LPS position. */
typedef struct found {
    long n[3];
    double affine[3][4];
    double a; /* first component of the unit quaternion; files leave it out */
    float value[PHANTOM_COUNT];
} found;

/* Reads a whole file, plain or gzip: gzread() accepts both. */
static size_t file_load(const char *path, unsigned char *data, size_t size)
{
    gzFile f = gzopen(path, "rb");
    assert_non_null(f);
    const int n = gzread(f, data, (unsigned)size);
    assert_true(n >= 0);
    assert_int_equal(gzclose(f), Z_OK);
    return (size_t)n;
}

static void file_save(const char *path, const void *data, size_t size)
{
    FILE *f = fopen(path, "wb");
    assert_non_null(f);
    assert_int_equal(fwrite(data, 1, size, f), size);
    assert_int_equal(fclose(f), 0);
}

static float float_at(const unsigned char *p)
{
    float v;
    memcpy(&v, p, 4); /* the tests run on little-endian machines only */
    return v;
}

static int short_at(const unsigned char *p)
{
    int16_t v;
    memcpy(&v, p, 2);
    return v;
}

/* Reads a NIfTI file as nifti1.h describes it. method 2: qform (quaternion), method 3: sform
 * (matrix). RAS positions are converted to LPS. */
static void read_nifti(const char *path, int method, found *f)
{
    static unsigned char d[352 + 4 * PHANTOM_COUNT + 64];
    assert_int_equal(file_load(path, d, sizeof d), 352 + 4 * PHANTOM_COUNT);
    assert_true(d[0] == 0x5C && d[1] == 1 && d[2] == 0 && d[3] == 0);
    assert_memory_equal(d + 344, "n+1", 4);
    assert_int_equal(short_at(d + 40), 3);
    assert_int_equal(short_at(d + 70), 16);
    assert_int_equal(short_at(d + 72), 32);
    assert_int_equal(short_at(d + 252), 1);
    assert_int_equal(short_at(d + 254), 1);
    assert_true(float_at(d + 108) == 352 && float_at(d + 112) == 1 && float_at(d + 116) == 0);
    assert_int_equal(d[123] & 7, 2);
    assert_string_equal((char *)d + 148, "a phantom");
    for (int i = 0; i < 3; i++) f->n[i] = short_at(d + 42 + 2 * i);
    if (method == 3) {
        for (int r = 0; r < 3; r++)
            for (int c = 0; c < 4; c++)
                f->affine[r][c] = (double)float_at(d + 280 + 16 * r + 4 * c);
    } else {
        const double b = (double)float_at(d + 256), c = (double)float_at(d + 260),
                     e = (double)float_at(d + 264);
        const double a = sqrt(fmax(0, 1 - b * b - c * c - e * e)),
                     qfac = (double)float_at(d + 76) < 0 ? -1 : 1;
        f->a = a;
        const double r[3][3] = {
            {a * a + b * b - c * c - e * e, 2 * (b * c - a * e), 2 * (b * e + a * c)},
            {2 * (b * c + a * e), a * a + c * c - b * b - e * e, 2 * (c * e - a * b)},
            {2 * (b * e - a * c), 2 * (c * e + a * b), a * a + e * e - b * b - c * c}};
        for (int i = 0; i < 3; i++) {
            for (int k = 0; k < 3; k++)
                f->affine[i][k] = r[i][k] * (double)float_at(d + 80 + 4 * k) * (k == 2 ? qfac : 1);
            f->affine[i][3] = (double)float_at(d + 268 + 4 * i);
        }
    }
    for (int r = 0; r < 2; r++)
        for (int c = 0; c < 4; c++) f->affine[r][c] = -f->affine[r][c];
    memcpy(f->value, d + 352, sizeof f->value);
}

static const char *field(const char *header, const char *key)
{
    const char *p = strstr(header, key);
    assert_non_null(p);
    assert_true(p == header || p[-1] == '\n');
    return p + strlen(key);
}

static void read_nrrd(const char *path, found *f)
{
    unsigned char d[8192];
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    const size_t n = fread(d, 1, sizeof d - 1, file);
    assert_int_equal(fclose(file), 0);
    d[n] = 0;
    char *blank = strstr((char *)d, "\n\n"), *h = (char *)d;
    assert_non_null(blank);
    blank[1] = 0;
    assert_memory_equal(h, "NRRD000", 7);
    assert_memory_equal(field(h, "type: "), "float\n", 6);
    assert_memory_equal(field(h, "dimension: "), "3\n", 2);
    assert_memory_equal(field(h, "endian: "), "little\n", 7);
    assert_memory_equal(field(h, "encoding: "), "gzip\n", 5);
    assert_memory_equal(field(h, "space: "), "left-posterior-superior\n", 24);
    assert_memory_equal(field(h, "content: "), "a phantom\n", 10);
    assert_int_equal(sscanf(field(h, "sizes: "), "%ld %ld %ld", &f->n[0], &f->n[1], &f->n[2]), 3);
    double(*a)[4] = f->affine;
    assert_int_equal(sscanf(field(h, "space directions: "),
                            "(%lf,%lf,%lf) (%lf,%lf,%lf) (%lf,%lf,%lf)", &a[0][0], &a[1][0],
                            &a[2][0], &a[0][1], &a[1][1], &a[2][1], &a[0][2], &a[1][2], &a[2][2]),
                     9);
    assert_int_equal(
        sscanf(field(h, "space origin: "), "(%lf,%lf,%lf)", &a[0][3], &a[1][3], &a[2][3]), 3);
    const size_t start = (size_t)(blank - h) + 2;
    file_save("test_image_tail.gz", d + start, n - start);
    unsigned char raw[4 * PHANTOM_COUNT + 64];
    assert_int_equal(file_load("test_image_tail.gz", raw, sizeof raw), sizeof f->value);
    memcpy(f->value, raw, sizeof f->value);
}

static void read_metaimage(const char *path, found *f)
{
    unsigned char d[8192];
    const size_t n = file_load(path, d, sizeof d);
    char *h = (char *)d, *local = strstr(h, "ElementDataFile = LOCAL\n");
    assert_non_null(local);
    local[23] = 0;
    const size_t start = (size_t)(local - h) + 24;
    assert_int_equal(n - start, sizeof f->value);
    assert_memory_equal(field(h, "ObjectType = "), "Image\n", 6);
    assert_memory_equal(field(h, "NDims = "), "3\n", 2);
    assert_memory_equal(field(h, "BinaryData = "), "True\n", 5);
    assert_memory_equal(field(h, "BinaryDataByteOrderMSB = "), "False\n", 6);
    assert_memory_equal(field(h, "CompressedData = "), "False\n", 6);
    assert_memory_equal(field(h, "ElementType = "), "MET_FLOAT\n", 10);
    assert_memory_equal(field(h, "Comment = "), "a phantom\n", 10);
    assert_int_equal(sscanf(field(h, "DimSize = "), "%ld %ld %ld", &f->n[0], &f->n[1], &f->n[2]),
                     3);
    double s[3], m[9], o[3];
    assert_int_equal(sscanf(field(h, "ElementSpacing = "), "%lf %lf %lf", &s[0], &s[1], &s[2]), 3);
    assert_int_equal(sscanf(field(h, "Offset = "), "%lf %lf %lf", &o[0], &o[1], &o[2]), 3);
    assert_int_equal(sscanf(field(h, "TransformMatrix = "), "%lf %lf %lf %lf %lf %lf %lf %lf %lf",
                            &m[0], &m[1], &m[2], &m[3], &m[4], &m[5], &m[6], &m[7], &m[8]),
                     9);
    /* Three numbers for each axis: its direction. */
    for (int axis = 0; axis < 3; axis++)
        for (int r = 0; r < 3; r++) f->affine[r][axis] = m[3 * axis + r] * s[axis];
    for (int r = 0; r < 3; r++) f->affine[r][3] = o[r];
    memcpy(f->value, d + start, sizeof f->value);
}

static void found_check(const found *f, const sdm_grid *g, double tolerance)
{
    static const double probe[][3] = {{0, 0, 0}, {6, 0, 0}, {0, 4, 0}, {0, 0, 8}, {6, 4, 8}};
    float v[PHANTOM_COUNT];
    phantom_values(v);
    for (int i = 0; i < 3; i++) assert_int_equal(f->n[i], g->n[i]);
    assert_memory_equal(f->value, v, sizeof v);
    for (size_t p = 0; p < sizeof probe / sizeof *probe; p++)
        for (int r = 0; r < 3; r++) {
            /* The convention spelled out rather than sdm_grid_world(): origin + dir *
             * diag(spacing) * index. */
            double want = g->origin[r], is = f->affine[r][3];
            for (int c = 0; c < 3; c++) {
                want += g->dir[3 * r + c] * g->spacing[c] * probe[p][c];
                is += f->affine[r][c] * probe[p][c];
            }
            assert_true(fabs(is - want) < tolerance);
        }
}

static void test_every_format_keeps_values_and_frame(void **state)
{
    (void)state;
    float v[PHANTOM_COUNT];
    phantom_values(v);
    for (int mirror = 0; mirror < 2; mirror++) {
        const sdm_grid g = phantom_grid(mirror);
        sdm_error err;
        static found f;
        static const char *const names[] = {"test_image.nii", "test_image.nii.gz",
                                            "test_image.NRRD", "test_image.mha"};
        for (int i = 0; i < 4; i++)
            assert_int_equal(sdm_image_write(names[i], &g, v, "a phantom", &err), SDM_OK);
        for (int i = 0; i < 2; i++)
            for (int method = 2; method <= 3; method++) {
                read_nifti(names[i], method, &f);
                found_check(&f, &g, 2e-5); /* the header holds float32 */
            }
        read_nrrd(names[2], &f);
        found_check(&f, &g, 1e-12);
        read_metaimage(names[3], &f);
        found_check(&f, &g, 1e-12);
    }
}

/* Random rotations, so that every branch of the conversion to quaternions is used. */
static void test_quaternions(void **state)
{
    (void)state;
    float v[PHANTOM_COUNT];
    phantom_values(v);
    for (uint64_t i = 0; i < 64; i++) {
        sdm_grid g = phantom_grid(0);
        double q[4], l = 0;
        /* Quaternion i < 4 is a unit vector: the identity or a rotation by pi about an axis. */
        for (uint64_t k = 0; k < 4; k++) q[k] = i < 4 ? (i == k) : sdm_rng_normal(1, i, k);
        for (int k = 0; k < 4; k++) l += q[k] * q[k];
        for (int k = 0; k < 4; k++) q[k] /= sqrt(l);
        const double a = q[0], b = q[1], c = q[2], d = q[3];
        const double r[9] = {
            1 - 2 * (c * c + d * d), 2 * (b * c - a * d),     2 * (b * d + a * c),
            2 * (b * c + a * d),     1 - 2 * (b * b + d * d), 2 * (c * d - a * b),
            2 * (b * d - a * c),     2 * (c * d + a * b),     1 - 2 * (b * b + c * c)};
        for (int k = 0; k < 9; k++) g.dir[k] = i % 2 && k % 3 == 0 ? -r[k] : r[k];
        static found f;
        assert_int_equal(sdm_image_write("test_image.nii", &g, v, "a phantom", NULL), SDM_OK);
        read_nifti("test_image.nii", 2, &f);
        /* The first component follows from the other three, which are rounded to float32: the
         * smaller it is, the larger its error. */
        found_check(&f, &g, 2e-5 + 4e-6 / fmax(f.a, 1e-3));
    }
}

static void test_output_is_reproducible(void **state)
{
    (void)state;
    static const char *const names[] = {"test_image_a.nii.gz", "test_image_a.nrrd"};
    static unsigned char a[8192], b[8192];
    const sdm_grid g = phantom_grid(0);
    float v[PHANTOM_COUNT];
    phantom_values(v);
    for (int i = 0; i < 2; i++) {
        size_t n[2] = {0};
        for (int k = 0; k < 2; k++) {
            assert_int_equal(sdm_image_write(names[i], &g, v, NULL, NULL), SDM_OK);
            FILE *f = fopen(names[i], "rb");
            assert_non_null(f);
            n[k] = fread(k ? b : a, 1, sizeof a, f);
            fclose(f);
        }
        assert_int_equal(n[0], n[1]);
        assert_memory_equal(a, b, n[0]);
    }
}

/* A description with several lines or of excessive length must not break a header. */
static void test_description_cannot_break_headers(void **state)
{
    (void)state;
    const sdm_grid g = phantom_grid(0);
    float v[PHANTOM_COUNT];
    phantom_values(v);
    char text[200] = "one\ntwo: 3\r\n\ntype: int";
    assert_int_equal(sdm_image_write("test_image_d.nrrd", &g, v, text, NULL), SDM_OK);
    unsigned char d[4096] = {0};
    FILE *f = fopen("test_image_d.nrrd", "rb");
    assert_non_null(f);
    assert_true(fread(d, 1, sizeof d - 1, f) > 0);
    fclose(f);
    assert_non_null(strstr((char *)d, "content: one two: 3   type: int\ntype: float\n"));
    memset(text, 'x', 78);
    strcpy(text + 78, "\xC3\xA9 and more"); /* a two-byte character at the end of the field */
    assert_int_equal(sdm_image_write("test_image_d.nii", &g, v, text, NULL), SDM_OK);
    assert_true(file_load("test_image_d.nii", d, sizeof d) > 348);
    assert_true(d[148 + 77] == 'x' && d[148 + 78] == 0 && d[148 + 79] == 0);
    // a word that does not fit is left out; one that ends with the field stays
    memset(text, 'y', 74);
    strcpy(text + 74, " a=0.25");
    assert_int_equal(sdm_image_write("test_image_d.nii", &g, v, text, NULL), SDM_OK);
    assert_true(file_load("test_image_d.nii", d, sizeof d) > 348);
    assert_true(d[148 + 73] == 'y' && d[148 + 74] == 0 && d[148 + 75] == 0);
    strcpy(text + 74, " a=.2 b=1");
    assert_int_equal(sdm_image_write("test_image_d.nii", &g, v, text, NULL), SDM_OK);
    assert_true(file_load("test_image_d.nii", d, sizeof d) > 348);
    assert_memory_equal(d + 148 + 73, "y a=.2", 7);
}

static void check_npy(const char *header, const void *values, size_t size, int version,
                      const double *want, const size_t shape[4], int n_dim)
{
    unsigned char file[512] = "\x93NUMPY";
    const size_t n = strlen(header), width = version == 1 ? 2 : 4;
    file[6] = (unsigned char)version;
    for (size_t i = 0; i < width; i++) file[8 + i] = (unsigned char)(n >> 8 * i);
    memcpy(file + 8 + width, header, n);
    memcpy(file + 8 + width + n, values, size);
    file_save("test_image_in.npy", file, 8 + width + n + size);
    double *got;
    size_t got_shape[4];
    int got_dim;
    sdm_error err = {0};
    const sdm_status s = sdm_npy_read("test_image_in.npy", &got, got_shape, &got_dim, &err);
    if (s) print_error("%s\n", err.text);
    assert_int_equal(s, SDM_OK);
    assert_int_equal(got_dim, n_dim);
    size_t count = 1;
    for (int i = 0; i < n_dim; i++) {
        assert_int_equal(got_shape[i], shape[i]);
        count *= shape[i];
    }
    for (size_t i = 0; i < count; i++) assert_true(got[i] == want[i]);
    sdm_free(got);
}

static void test_npy_of_other_writers(void **state)
{
    (void)state;
    static const double want[6] = {1, -2, 0.5, 1024, 3, -0.25};
    static const size_t one[4] = {6}, two[4] = {2, 3}, four[4] = {1, 2, 1, 3};
    float f[6];
    unsigned char big4[24], big8[48];
    for (int i = 0; i < 6; i++) {
        f[i] = (float)want[i];
        for (int b = 0; b < 4; b++) big4[4 * i + b] = ((const unsigned char *)&f[i])[3 - b];
        for (int b = 0; b < 8; b++) big8[8 * i + b] = ((const unsigned char *)&want[i])[7 - b];
    }
    check_npy("{'descr': '<f4', 'fortran_order': False, 'shape': (6,), }   \n", f, 24, 1, want, one,
              1);
    check_npy("{'descr': '<f8', 'fortran_order': True, 'shape': (6,), }\n", want, 48, 1, want, one,
              1);
    check_npy("{\"shape\":(2,3),\"descr\":\">f4\",\"fortran_order\":False}", big4, 24, 2, want, two,
              2);
    check_npy("{ 'fortran_order' : False , 'shape' : ( 1, 2,1, 3 ) , 'descr' : '>f8' }", big8, 48,
              3, want, four, 4);
}

static void test_npy_round_trip(void **state)
{
    (void)state;
    static const size_t shape[4] = {2, 3, 4, 5};
    float v[120];
    for (uint64_t i = 0; i < 120; i++) v[i] = (float)sdm_rng_normal(3, 0, i);
    size_t count = 1;
    for (int n_dim = 1; n_dim <= 4; n_dim++) {
        count *= shape[n_dim - 1];
        double *got;
        size_t got_shape[4];
        int got_dim;
        sdm_error err;
        assert_int_equal(sdm_npy_write("test_image_rt.npy", v, shape, n_dim, &err), SDM_OK);
        assert_int_equal(sdm_npy_read("test_image_rt.npy", &got, got_shape, &got_dim, &err),
                         SDM_OK);
        assert_int_equal(got_dim, n_dim);
        assert_memory_equal(got_shape, shape, (size_t)n_dim * sizeof *shape);
        for (size_t i = 0; i < count; i++) assert_true(got[i] == (double)v[i]);
        sdm_free(got);
        unsigned char d[1024];
        /* Values start at a multiple of 64 bytes. */
        assert_int_equal(file_load("test_image_rt.npy", d, sizeof d) % 64, count * 4 % 64);
    }
    const sdm_grid g = phantom_grid(0);
    float p[PHANTOM_COUNT];
    phantom_values(p);
    double *got;
    size_t got_shape[4];
    int got_dim;
    assert_int_equal(sdm_image_write("test_image_map.npy", &g, p, "x", NULL), SDM_OK);
    assert_int_equal(sdm_npy_read("test_image_map.npy", &got, got_shape, &got_dim, NULL), SDM_OK);
    assert_true(got_dim == 3 && got_shape[0] == PHANTOM_NZ && got_shape[1] == PHANTOM_NY &&
                got_shape[2] == PHANTOM_NX);
    assert_true(got[PHANTOM_NX * PHANTOM_NY * 8 + PHANTOM_NX * 3 + 2] ==
                (double)(float)(0.2 - 9 + 800));
    sdm_free(got);
}

static sdm_status read_header(const char *header, size_t extra, sdm_error *err)
{
    unsigned char file[1024] = "\x93NUMPY\x01";
    const size_t n = strlen(header);
    file[8] = (unsigned char)n;
    memcpy(file + 10, header, n);
    file_save("test_image_bad.npy", file, 10 + n + extra);
    double *got = (double *)file;
    size_t shape[4];
    int n_dim;
    const sdm_status s = sdm_npy_read("test_image_bad.npy", &got, shape, &n_dim, err);
    if (s) assert_null(got);
    if (!s) sdm_free(got);
    return s;
}

static void test_bad_npy_headers_are_refused(void **state)
{
    (void)state;
    static const struct {
        const char *header;
        size_t extra;
        sdm_status status;
    } bad[] = {
        {"{'descr': '<f4', 'fortran_order': False, 'shape': (3,), }", 11, SDM_E_FORMAT},
        {"{'descr': '<f4', 'fortran_order': False, 'shape': (3,), }", 13, SDM_E_FORMAT},
        {"{'descr': '<f4', 'fortran_order': False, 'shape': (), }", 4, SDM_E_UNSUPPORTED},
        {"{'descr': '<f4', 'fortran_order': False, 'shape': (1,1,1,1,1), }", 4, SDM_E_UNSUPPORTED},
        {"{'descr': '<f4', 'fortran_order': True, 'shape': (2,2), }", 16, SDM_E_UNSUPPORTED},
        {"{'descr': '<i4', 'fortran_order': False, 'shape': (3,), }", 12, SDM_E_UNSUPPORTED},
        {"{'descr': '|O', 'fortran_order': False, 'shape': (3,), }", 12, SDM_E_UNSUPPORTED},
        {"{'descr': '', 'fortran_order': False, 'shape': (3,), }", 12, SDM_E_UNSUPPORTED},
        {"{'descr': '<f4', 'fortran_order': False, 'shape': (4294967296,4294967296,4), }", 12,
         SDM_E_FORMAT},
        {"{'descr': '<f4', 'fortran_order': False, 'shape': (99999999999999999999999,), }", 12,
         SDM_E_FORMAT},
        {"{'descr': '<f4', 'fortran_order': False, 'shape': (-1,), }", 12, SDM_E_FORMAT},
        {"{'descr': '<f4', 'fortran_order': False, }", 12, SDM_E_FORMAT},
        {"{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': (3,), }", 12, SDM_E_FORMAT},
        {"{'descr': '<f4', 'fortran_order': False, 'shape': (3,), } x", 12, SDM_E_FORMAT},
        {"", 12, SDM_E_FORMAT},
    };
    sdm_error err;
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        assert_int_equal(read_header(bad[i].header, bad[i].extra, &err), bad[i].status);
        assert_non_null(strstr(err.text, "test_image_bad.npy"));
    }
    assert_int_equal(
        read_header("{'descr': '<f4', 'fortran_order': False, 'shape': (3,), }", 12, &err), SDM_OK);
    file_save("test_image_bad.npy", "\x93NUMPY\x04\x00\xFF\xFF", 10);
    double *got;
    size_t shape[4];
    int n_dim;
    assert_int_equal(sdm_npy_read("test_image_bad.npy", &got, shape, &n_dim, &err),
                     SDM_E_UNSUPPORTED);
    file_save("test_image_bad.npy", "\x93NUMPY\x02\x00\xFF\xFF\xFF\xFF", 12);
    assert_int_equal(sdm_npy_read("test_image_bad.npy", &got, shape, &n_dim, &err), SDM_E_FORMAT);
}

/* A file truncated at each byte, and with each byte changed. */
static void test_damaged_npy_is_safe(void **state)
{
    (void)state;
    static const size_t shape[2] = {2, 3};
    static const float v[6] = {1, 2, 3, 4, 5, 6};
    unsigned char d[256];
    assert_int_equal(sdm_npy_write("test_image_cut.npy", v, shape, 2, NULL), SDM_OK);
    const size_t n = file_load("test_image_cut.npy", d, sizeof d);
    double *got;
    size_t s[4];
    int n_dim;
    for (size_t i = 0; i < n; i++) {
        file_save("test_image_cut.npy", d, i);
        assert_int_equal(sdm_npy_read("test_image_cut.npy", &got, s, &n_dim, NULL), SDM_E_FORMAT);
        assert_null(got);
    }
    for (size_t i = 0; i < n - 24; i++)
        for (int b = 0; b < 8; b++) {
            d[i] ^= (unsigned char)(1 << b);
            file_save("test_image_cut.npy", d, n);
            if (sdm_npy_read("test_image_cut.npy", &got, s, &n_dim, NULL) == SDM_OK) {
                size_t count = 1;
                for (int k = 0; k < n_dim; k++) count *= s[k];
                assert_true(count == 6 || count == 3);
            }
            sdm_free(got);
            d[i] ^= (unsigned char)(1 << b);
        }
}

static void test_wrong_arguments_are_refused(void **state)
{
    (void)state;
    sdm_grid g = phantom_grid(0);
    static float v[PHANTOM_COUNT];
    const size_t shape[2] = {SIZE_MAX, 2};
    double *values;
    size_t got[4];
    int n_dim;
    sdm_error err;
    assert_int_equal(sdm_image_write(NULL, &g, v, "", &err), SDM_E_ARG);
    assert_int_equal(sdm_image_write("a.nii", NULL, v, "", &err), SDM_E_ARG);
    assert_int_equal(sdm_image_write("a.nii", &g, NULL, "", &err), SDM_E_ARG);
    assert_int_equal(sdm_image_write("a.dcm", &g, v, "", &err), SDM_E_UNSUPPORTED);
    assert_non_null(strstr(err.text, ".nii.gz"));
    assert_int_equal(sdm_image_write("no_such_folder/a.nii", &g, v, "", &err), SDM_E_IO);
    assert_int_equal(sdm_npy_read(NULL, &values, got, &n_dim, &err), SDM_E_ARG);
    assert_int_equal(sdm_npy_read("no_such_file.npy", &values, got, &n_dim, &err), SDM_E_IO);
    assert_int_equal(sdm_npy_write(NULL, v, shape, 1, &err), SDM_E_ARG);
    assert_int_equal(sdm_npy_write("a.npy", v, shape, 2, &err), SDM_E_ARG);
    assert_int_equal(sdm_npy_write("a.npy", v, shape, 0, &err), SDM_E_ARG);
    assert_int_equal(sdm_npy_write("a.npy", v, shape, 5, &err), SDM_E_ARG);
    const uint32_t u[1] = {1};
    assert_int_equal(sdm_npy_write_uint32(NULL, u, shape, 1, &err), SDM_E_ARG);
    assert_int_equal(sdm_npy_write_uint32("a.npy", NULL, shape, 1, &err), SDM_E_ARG);
    assert_int_equal(sdm_npy_write_uint32("a.npy", u, shape, 5, &err), SDM_E_ARG);
    g.spacing[1] = NAN;
    assert_int_equal(sdm_image_write("a.nii", &g, v, "", &err), SDM_E_ARG);
    /* Too large for the int16 sizes of NIfTI; no file may be left behind. */
    sdm_grid row = {.n = {40000, 1, 1}, .spacing = {1, 1, 1}, .dir = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    float *line = calloc(40000, sizeof *line);
    assert_non_null(line);
    assert_int_equal(sdm_image_write("test_image_long.nii", &row, line, "", &err),
                     SDM_E_UNSUPPORTED);
    assert_null(fopen("test_image_long.nii", "rb"));
    assert_int_equal(sdm_image_write("test_image_long.nrrd", &row, line, "", &err), SDM_OK);
    free(line);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_every_format_keeps_values_and_frame),
        cmocka_unit_test(test_quaternions),
        cmocka_unit_test(test_output_is_reproducible),
        cmocka_unit_test(test_description_cannot_break_headers),
        cmocka_unit_test(test_npy_of_other_writers),
        cmocka_unit_test(test_npy_round_trip),
        cmocka_unit_test(test_bad_npy_headers_are_refused),
        cmocka_unit_test(test_damaged_npy_is_safe),
        cmocka_unit_test(test_wrong_arguments_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
