/* Images that are truncated, changed at random or made to exhaust memory: an error, without
 * allocating more than the file can justify.
 * Tests: nifti_read.c stream.c */
#include "volume_files.h"

#include <sys/stat.h>

#include "sdm/internal/heap.h"
#include "sdm/internal/rng.h"

#define STEPS "space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\n"

/* Builds sample file number `which`, one for each format. *header: size of the header in bytes. */
static size_t make_sample(int which, bytes *b, const char **name, size_t *header)
{
    static const char *const names[] = {"test_volume_bad_s.nii", "test_volume_bad_s.nii.gz",
                                        "test_volume_bad_s.nrrd", "test_volume_bad_s.seg.nrrd",
                                        "test_volume_bad_s.mha"};
    static const int64_t n[3] = {2, 3, 4};
    static bytes raw;
    double v[24];
    for (int i = 0; i < 24; i++) v[i] = 7 * i - 50;
    raw.size = 0;
    b->size = 0;
    if (which < 2) {
        bytes *to = which ? &raw : b;
        add_nifti(to, 1 + which, which, 3, n);
        add_voxels(to, 3, which, v, 24);
        *header = which ? 0 : 352;
        if (which) add_zipped(b, raw.data, raw.size, 31);
    } else {
        add_voxels(&raw, which == 3 ? 0 : 3, 0, v, 24);
        if (which == 2)
            add_text(b, "NRRD0004\ntype: short\ndimension: 3\nsizes: 2 3 4\nendian: "
                        "little\nencoding: gzip\nspace: LPS\n" STEPS "\n");
        if (which == 3)
            add_text(b, "NRRD0004\ntype: uchar\ndimension: 4\nsizes: 2 3 2 2\nencoding: "
                        "raw\nspace: RAS\nspace "
                        "directions: none (1,0,0) "
                        "(0,1,0) (0,0,1)\nspace origin: "
                        "(0,0,0)\nSegment0_Name:=a\nSegment0_Layer:=1\nSegment0_LabelValue:=2\n\n");
        if (which == 4)
            add_text(b, "NDims = 3\nDimSize = 2 3 4\nElementType = MET_SHORT\nElementSpacing = 1 1 "
                        "1\nCompressedData = "
                        "True\n"
                        "ElementDataFile = LOCAL\n");
        *header = b->size;
        if (which == 3)
            add(b, raw.data, raw.size);
        else
            add_zipped(b, raw.data, raw.size, which == 4 ? 15 : 31);
    }
    *name = names[which];
    return b->size;
}
enum { SAMPLES = 5 };

/* Every proper prefix of a sample is refused: the files have no optional bytes. */
static void test_truncated_files_are_refused(void **state)
{
    (void)state;
    static bytes b;
    for (int which = 0; which < SAMPLES; which++) {
        const char *name;
        size_t header;
        const size_t size = make_sample(which, &b, &name, &header);
        sdm_volume v = {0};
        put_file(name, b.data, size);
        assert_read(name, &v);
        sdm_volume_dispose(&v);
        for (size_t n = 0; n < size; n++) {
            sdm_error err = {0};
            put_file(name, b.data, n);
            const sdm_status s = sdm_volume_read(name, &v, &err);
            if (!s || !err.text[0] || v.values)
                fail_msg("%s cut off after %zu of %zu bytes gave status %d", name, n, size, (int)s);
        }
        b.data[size] = 0;
        put_file(name, b.data, size + 1);
        assert_true(sdm_volume_read(name, &v, NULL) == SDM_E_FORMAT);
    }
}

/* Random changes of bytes give an image or an error, and never allocate more memory than the
 * size of the file justifies. */
static void test_damaged_files_are_safe(void **state)
{
    (void)state;
    static bytes b, bad;
    size_t read = 0, refused = 0;
    for (int which = 0; which < SAMPLES; which++) {
        const char *name;
        size_t header;
        const size_t size = make_sample(which, &b, &name, &header);
        for (uint64_t trial = 0; trial < 400; trial++) {
            const uint64_t stream = trial * SAMPLES + (uint64_t)which;
            bad = b;
            const uint64_t changes = 1 + sdm_rng_below(11, stream, 0, 4);
            for (uint64_t c = 1; c <= changes; c++) {
                unsigned char *at = &bad.data[sdm_rng_below(11, stream, 3 * c, size)];
                const uint64_t bits = sdm_rng_below(11, stream, 3 * c + 1, 256);
                *at = (unsigned char)(c % 2 ? *at ^ 1u << bits % 8 : bits);
            }
            put_file(name, bad.data, size);
            sdm_volume v = {0};
            sdm_error err = {0};
            const sdm_status s = sdm_volume_read(name, &v, &err);
            if (s) {
                refused++;
                assert_true(err.text[0] && !v.values && !v.segments);
            } else {
                read++;
                assert_int_equal(sdm_grid_check(&v.grid, NULL), SDM_OK);
                assert_true(v.n_layers * sdm_grid_count(&v.grid) <= 1032 * size);
            }
            sdm_volume_dispose(&v);
        }
    }
    assert_true(read > 20 && refused > 1000);
}

/* gzip data that expand to more, or to less, than the header declares. */
static void test_gzip_of_wrong_size(void **state)
{
    (void)state;
    static bytes b;
    unsigned char *zeros = calloc(1, 16 << 20);
    assert_non_null(zeros);
    b.size = 0;
    add_text(&b,
             "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 3 4\nencoding: gzip\nspace: LPS\n" STEPS
             "\n");
    const size_t header = b.size;
    add_zipped(&b, zeros, 16 << 20, 31);
    put_file("test_volume_bad.nrrd", b.data, b.size);
    assert_refused("test_volume_bad.nrrd", SDM_E_FORMAT,
                   "more bytes of voxels than the header declares");
    b.size = header;
    add_zipped(&b, zeros, 23, 31);
    put_file("test_volume_bad.nrrd", b.data, b.size);
    assert_refused("test_volume_bad.nrrd", SDM_E_FORMAT, "ends too early");
    /* Correct voxels with a wrong checksum. */
    b.size = header;
    add_zipped(&b, zeros, 24, 31);
    b.data[b.size - 8] ^= 1;
    put_file("test_volume_bad.nrrd", b.data, b.size);
    assert_refused("test_volume_bad.nrrd", SDM_E_FORMAT, "damaged");
    b.size = 0;
    add_text(&b, "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 65536 65536 1024\nencoding: "
                 "gzip\nspace: LPS\n" STEPS "\n"); /* 4 TiB of voxels */
    add_zipped(&b, zeros, 16 << 20, 31);
    put_file("test_volume_bad.nrrd", b.data, b.size);
    assert_refused("test_volume_bad.nrrd", SDM_E_FORMAT, "cannot hold them");
    free(zeros);
}

static void test_each_allocation_may_fail(void **state)
{
    (void)state;
    static bytes b;
    for (int which = 0; which < SAMPLES; which++) {
        const char *name;
        size_t header;
        const size_t size = make_sample(which, &b, &name, &header);
        put_file(name, b.data, size);
        sdm_volume v = {0};
        sdm_status s = SDM_E_NOMEM;
        unsigned long n = 0;
        while (s == SDM_E_NOMEM && n < 20) {
            sdm_alloc_fail_after(++n);
            s = sdm_volume_read(name, &v, NULL);
            sdm_alloc_fail_after(0);
            assert_true(s == SDM_OK || v.values == NULL);
        }
        assert_int_equal(s, SDM_OK);
        /* allocations: buffer, voxels, and segments for sample 3 */
        assert_int_equal(n, which == 3 ? 4 : 3);
        sdm_volume_dispose(&v);
    }
}

static void test_wrong_arguments_are_refused(void **state)
{
    (void)state;
    sdm_volume v = {0};
    const sdm_segment *segment;
    const sdm_grid g = {.n = {1, 1, 1}, .spacing = {1, 1, 1}, .dir = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    const uint8_t one = 1;
    sdm_error err;
    assert_int_equal(sdm_volume_read(NULL, &v, &err), SDM_E_ARG);
    assert_int_equal(sdm_volume_read("a.nii", NULL, &err), SDM_E_ARG);
    assert_int_equal(sdm_volume_find_segment(NULL, "a", &segment, &err), SDM_E_ARG);
    assert_int_equal(sdm_volume_find_segment(&v, "a", &segment, &err), SDM_E_ARG);
    assert_text(err.text, "it names no segments");
    assert_refused("a.hdr", SDM_E_UNSUPPORTED, "pairs of files");
    assert_refused("a.IMG", SDM_E_UNSUPPORTED, "pairs of files");
    assert_refused("a.dcm", SDM_E_UNSUPPORTED, "known are .nii");
    assert_refused("test_volume_no_such.nii", SDM_E_IO, "cannot open");
    mkdir("test_volume_folder.nii", 0777);
    assert_refused("test_volume_folder.nii", SDM_E_IO, "not a regular file");
    assert_true(sdm_volume_knows("a.NII.gz") && sdm_volume_knows("b.seg.nrrd") &&
                sdm_volume_knows("c.mhd"));
    assert_false(sdm_volume_knows("a.gz") || sdm_volume_knows("a.npy") || sdm_volume_knows(NULL));
    assert_int_equal(sdm_volume_write(NULL, &g, &one, SDM_VOXEL_UINT8, NULL, &err), SDM_E_ARG);
    assert_int_equal(sdm_volume_write("a.nii", NULL, &one, SDM_VOXEL_UINT8, NULL, &err), SDM_E_ARG);
    assert_int_equal(sdm_volume_write("a.nii", &g, NULL, SDM_VOXEL_UINT8, NULL, &err), SDM_E_ARG);
    assert_int_equal(sdm_volume_write("a.nii", &g, &one, (sdm_voxel_type)10, NULL, &err),
                     SDM_E_ARG);
    assert_int_equal(sdm_volume_write("a.jpg", &g, &one, SDM_VOXEL_UINT8, NULL, &err),
                     SDM_E_UNSUPPORTED);
    assert_int_equal(sdm_voxel_size((sdm_voxel_type)10), 0);
    assert_int_equal(sdm_voxel_size(SDM_VOXEL_INT16), 2);
    assert_string_equal(sdm_voxel_name((sdm_voxel_type)-1), "unknown");
    assert_string_equal(sdm_voxel_name(SDM_VOXEL_FLOAT64), "float64");
}

/* Reading into a volume that holds an image frees the old one. */
static void test_read_again(void **state)
{
    (void)state;
    static bytes b;
    const char *name;
    size_t header;
    const size_t size = make_sample(3, &b, &name, &header);
    sdm_volume v = {0};
    put_file(name, b.data, size);
    assert_read(name, &v);
    assert_read(name, &v);
    assert_int_equal(v.n_segments, 1);
    const size_t other = make_sample(0, &b, &name, &header);
    put_file(name, b.data, other);
    assert_read(name, &v);
    assert_true(v.n_segments == 0 && v.n_layers == 1 && v.grid.n[0] == 2);
    assert_int_equal(sdm_volume_read("test_volume_no_such.nii", &v, NULL), SDM_E_IO);
    assert_true(v.values == NULL && v.n_segments == 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_truncated_files_are_refused),
        cmocka_unit_test(test_damaged_files_are_safe),
        cmocka_unit_test(test_gzip_of_wrong_size),
        cmocka_unit_test(test_each_allocation_may_fail),
        cmocka_unit_test(test_wrong_arguments_are_refused),
        cmocka_unit_test(test_read_again),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
