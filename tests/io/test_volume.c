/* Reading of images: voxels of every type, from files assembled byte by byte and from the library's
 * own writers.
 * Tests: voxels.c */
#include "volume_files.h"

#include "image_phantom.h"
#include "sdm/image.h"

static const int64_t size_small[3] = {2, 3, 4};

/* Integers that fit the type; signed types get negative ones. */
static void small_values(int type, double v[24])
{
    const int sign = type == 1 || type == 3 || type == 5 || type >= 7;
    for (int i = 0; i < 24; i++) v[i] = 5 * i + (sign ? -60 : 3);
    if (type >= 2) v[7] = sign ? -3000 : 60000; /* needs both bytes */
    if (type >= 4) v[8] = sign ? -70000 : 3000000000.0;
    if (type == 6 || type == 7) v[9] = 1099511627776.0; /* 2^40 */
    if (type >= 8) v[10] = 0.375;
}

static void small_check(const char *path, int type)
{
    sdm_volume v = {0};
    double want[24];
    small_values(type, want);
    assert_read(path, &v);
    assert_int_equal(v.stored, type);
    assert_int_equal(v.n_layers, 1);
    for (int a = 0; a < 3; a++) assert_int_equal(v.grid.n[a], size_small[a]);
    for (int i = 0; i < 24; i++)
        if (v.values[i] != (float)want[i])
            fail_msg("%s: value %d is %g, wanted %g", path, i, (double)v.values[i], want[i]);
    sdm_volume_dispose(&v);
    assert_null(v.values);
}

static void test_types_in_both_byte_orders(void **state)
{
    (void)state;
    static bytes b, raw;
    for (int type = 0; type < 10; type++)
        for (int big = 0; big < 2; big++) {
            double v[24];
            small_values(type, v);
            raw.size = 0;
            add_voxels(&raw, type, big, v, 24);
            for (int version = 1; version <= 2; version++) {
                add_nifti(&b, version, big, type, size_small);
                add(&b, raw.data, raw.size);
                put_file("test_volume.nii", b.data, b.size);
                small_check("test_volume.nii", type);
                bytes *zipped = malloc(sizeof *zipped);
                assert_non_null(zipped);
                zipped->size = 0;
                add_zipped(zipped, b.data, b.size, 31);
                put_file("test_volume.nii.GZ", zipped->data, zipped->size);
                small_check("test_volume.nii.GZ", type);
                free(zipped);
            }
            for (int zip = 0; zip < 2; zip++) {
                b.size = 0;
                add_text(&b,
                         "NRRD0001\r\n# comment\r\ntype: %s\r\ndimension: 3\r\nsizes: 2 3 "
                         "4\r\nspacings: 1 1 "
                         "1\r\nendian: %s\r\n"
                         "encoding: %s\r\n\r\n",
                         types[type].nrrd, big ? "big" : "little", zip ? "gz" : "raw");
                if (zip)
                    add_zipped(&b, raw.data, raw.size, 31);
                else
                    add(&b, raw.data, raw.size);
                put_file("test_volume.nrrd", b.data, b.size);
                small_check("test_volume.nrrd", type);
                b.size = 0;
                add_text(&b,
                         "NDims=3\nDimSize = 2 3 4\nElementSpacing = 1 1 1\n%s = "
                         "%s\nCompressedData = %s\nElementType = %s\n"
                         "ElementDataFile = LOCAL\n",
                         big ? "BinaryDataByteOrderMSB" : "ElementByteOrderMSB",
                         big ? "True" : "False", zip ? "True" : "False", types[type].meta);
                if (zip)
                    add_zipped(&b, raw.data, raw.size, 15);
                else
                    add(&b, raw.data, raw.size);
                put_file("test_volume.mha", b.data, b.size);
                small_check("test_volume.mha", type);
            }
        }
}

/* Fills `block`, an array of T, with the phantom's values. */
#define FILL(T)                                                                                    \
    for (int i = 0; i < PHANTOM_COUNT; i++) ((T *)block)[i] = (T)want[i]

static void fill(int type, const double *want, void *block)
{
    switch (type) {
    case SDM_VOXEL_UINT8:
        FILL(uint8_t);
        break;
    case SDM_VOXEL_INT8:
        FILL(int8_t);
        break;
    case SDM_VOXEL_UINT16:
        FILL(uint16_t);
        break;
    case SDM_VOXEL_INT16:
        FILL(int16_t);
        break;
    case SDM_VOXEL_UINT32:
        FILL(uint32_t);
        break;
    case SDM_VOXEL_INT32:
        FILL(int32_t);
        break;
    case SDM_VOXEL_UINT64:
        FILL(uint64_t);
        break;
    case SDM_VOXEL_INT64:
        FILL(int64_t);
        break;
    case SDM_VOXEL_FLOAT32:
        FILL(float);
        break;
    default:
        FILL(double);
    }
}

static void test_round_trips(void **state)
{
    (void)state;
    static const char *const names[] = {"test_volume_r.nii", "test_volume_r.nii.gz",
                                        "test_volume_r.nrrd", "test_volume_r.mha"};
    static double block[PHANTOM_COUNT];
    double want[PHANTOM_COUNT];
    for (int type = 0; type < 10; type++) {
        const int sign = type % 2 || type >= 8;
        for (int i = 0; i < PHANTOM_COUNT; i++) {
            const int x = i % PHANTOM_NX, y = i / PHANTOM_NX % PHANTOM_NY,
                      z = i / (PHANTOM_NX * PHANTOM_NY);
            want[i] = x + 3 * y + 20 * z - (sign ? 60 : 0) + (type >= 8 ? 0.25 : 0) +
                      (type >= 2 ? 200 * x : 0);
        }
        fill(type, want, block);
        for (int f = 0; f < 4; f++) {
            const sdm_grid g = phantom_grid(type % 2);
            sdm_volume v = {0};
            assert_int_equal(
                sdm_volume_write(names[f], &g, block, (sdm_voxel_type)type, "a phantom", NULL),
                SDM_OK);
            assert_read(names[f], &v);
            assert_true(v.placed && v.stored == (sdm_voxel_type)type && v.n_nan == 0 &&
                        v.n_inf == 0);
            assert_int_equal(v.checked, f == 1 || f == 2);
            assert_string_equal(v.text, "a phantom");
            float min = 1e9f, max = -1e9f;
            for (int i = 0; i < PHANTOM_COUNT; i++) {
                if (v.values[i] != (float)want[i])
                    fail_msg("%s: type %d, value %d", names[f], type, i);
                min = fminf(min, (float)want[i]);
                max = fmaxf(max, (float)want[i]);
            }
            assert_true(v.min == min && v.max == max);
            for (int c = 0; c < 8; c++) {
                const double at[3] = {(c & 1) * 6.0, (c >> 1 & 1) * 4.0, (c >> 2) * 8.0};
                double w[3];
                /* The convention spelled out rather than sdm_grid_world(): origin + dir *
                 * diag(spacing) * index. */
                for (int r = 0; r < 3; r++) {
                    w[r] = g.origin[r];
                    for (int a = 0; a < 3; a++) w[r] += g.dir[3 * r + a] * g.spacing[a] * at[a];
                }
                assert_at(&v, at[0], at[1], at[2], w[0], w[1], w[2], f < 2 ? 2e-5 : 1e-12);
            }
            sdm_volume_dispose(&v);
        }
    }
}

/* Headers written by the library name each type as the formats specify. */
static void test_names_of_written_types(void **state)
{
    (void)state;
    static const char *const nrrd[10] = {
        "unsigned char", "signed char",        "unsigned short", "short", "unsigned int",
        "int",           "unsigned long long", "long long",      "float", "double"};
    static const char *const meta[10] = {"UCHAR", "CHAR",       "USHORT",    "SHORT", "UINT",
                                         "INT",   "ULONG_LONG", "LONG_LONG", "FLOAT", "DOUBLE"};
    static const uint64_t block[PHANTOM_COUNT];
    const sdm_grid g = phantom_grid(0);
    for (int type = 0; type < 10; type++) {
        char head[1024] = {0}, want[64];
        for (int f = 0; f < 3; f++) {
            const char *name = f == 0   ? "test_volume_t.nii"
                               : f == 1 ? "test_volume_t.nrrd"
                                        : "test_volume_t.mha";
            assert_int_equal(sdm_volume_write(name, &g, block, (sdm_voxel_type)type, NULL, NULL),
                             SDM_OK);
            FILE *file = fopen(name, "rb");
            assert_non_null(file);
            assert_true(fread(head, 1, sizeof head - 1, file) > 352);
            fclose(file);
            if (f == 0) {
                unsigned char code[4];
                store(code, 2, 0, (uint64_t)types[type].nifti);
                store(code + 2, 2, 0, 8 * types[type].size);
                assert_memory_equal(head + 70, code, 4);
                continue;
            }
            snprintf(want, sizeof want, f == 1 ? "\ntype: %s\n" : "\nElementType = MET_%s\n",
                     (f == 1 ? nrrd : meta)[type]);
            assert_text(head, want);
        }
    }
}

/* sdm_image_write() writes the same bytes as sdm_volume_write() for a float32 image. */
static void test_both_writers_agree(void **state)
{
    (void)state;
    const sdm_grid g = phantom_grid(0);
    float p[PHANTOM_COUNT];
    phantom_values(p);
    unsigned char a[8192], b[8192];
    assert_int_equal(sdm_image_write("test_volume_a.mha", &g, p, "x", NULL), SDM_OK);
    assert_int_equal(sdm_volume_write("test_volume_b.mha", &g, p, SDM_VOXEL_FLOAT32, "x", NULL),
                     SDM_OK);
    FILE *fa = fopen("test_volume_a.mha", "rb"), *fb = fopen("test_volume_b.mha", "rb");
    assert_true(fa && fb);
    const size_t n = fread(a, 1, sizeof a, fa), m = fread(b, 1, sizeof b, fb);
    fclose(fa);
    fclose(fb);
    assert_true(n == m && n > 0 && !memcmp(a, b, n));
}

static void test_nan_and_infinity_are_kept(void **state)
{
    (void)state;
    static bytes b;
    double values[24];
    sdm_volume v = {0};
    small_values(8, values);
    values[3] = values[5] = NAN;
    values[11] = -INFINITY;
    values[20] = 1e5;
    add_nifti(&b, 1, 0, 9, size_small);
    add_voxels(&b, 9, 0, values, 24);
    put_file("test_volume.nii", b.data, b.size);
    assert_read("test_volume.nii", &v);
    assert_true(v.n_nan == 2 && v.n_inf == 1 && v.min == -70000 && v.max == 100000);
    assert_true(isnan(v.values[3]) && isinf(v.values[11]));
    sdm_volume_dispose(&v);
}

/* gzip data made of several members, as parallel compressors write them. */
static void test_gzip_of_several_members(void **state)
{
    (void)state;
    static bytes b, zipped;
    double values[24];
    small_values(5, values);
    add_nifti(&b, 1, 0, 5, size_small);
    add_voxels(&b, 5, 0, values, 24);
    zipped.size = 0;
    add_zipped(&zipped, b.data, 100, 31);
    add_zipped(&zipped, b.data + 100, 0, 31);
    add_zipped(&zipped, b.data + 100, b.size - 100, 31);
    put_file("test_volume.nii.gz", zipped.data, zipped.size);
    small_check("test_volume.nii.gz", 5);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_types_in_both_byte_orders),
        cmocka_unit_test(test_round_trips),
        cmocka_unit_test(test_both_writers_agree),
        cmocka_unit_test(test_names_of_written_types),
        cmocka_unit_test(test_nan_and_infinity_are_kept),
        cmocka_unit_test(test_gzip_of_several_members),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
