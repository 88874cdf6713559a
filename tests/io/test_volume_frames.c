/* Reading of images: positions of the voxels in every way a header can state them, voxels in a
 * separate file, and segments.
 * Tests: frame.c image_read.c */
#include "volume_files.h"

#include <math.h>

static const int64_t size[3] = {2, 3, 4};

/* Spacings 2, 3, 4 mm along the world axes; the expected LPS positions are written out by hand. */
static void test_nifti_frames(void **state)
{
    (void)state;
    static bytes b;
    double values[24];
    for (int i = 0; i < 24; i++) values[i] = i == 7 ? -3000 : 5 * i - 60;
    for (int version = 1; version <= 2; version++)
        for (int big = 0; big < 2; big++) {
            const size_t real = version == 2 ? 8 : 4, code = version == 2 ? 4 : 2;
            add_nifti(&b, version, big, 3, size);
            add_voxels(&b, 3, big, values, 24);
            unsigned char *pixdim = b.data + (version == 2 ? 104 : 76),
                          *q = b.data + (version == 2 ? 352 : 256),
                          *offset = b.data + (version == 2 ? 376 : 268),
                          *row = b.data + (version == 2 ? 400 : 280),
                          *qcode = b.data + (version == 2 ? 344 : 252),
                          *scode = b.data + (version == 2 ? 348 : 254),
                          *unit = b.data + (version == 2 ? 500 : 123),
                          *slope = b.data + (version == 2 ? 176 : 112);
            sdm_volume v = {0};
            for (size_t a = 0; a < 3; a++)
                store_real(pixdim + real * (a + 1), real, big, 2 + (double)a);
            put_file("test_volume.nii", b.data, b.size);
            assert_read("test_volume.nii", &v);
            assert_false(v.placed);
            assert_at(&v, 0, 0, 0, 0, 0, 0, 0);
            assert_at(&v, 1, 2, 3, -2, -6, 12, 1e-9);
            assert_true(v.values[7] == -3000);

            /* A rotation by pi / 2 about z: i runs along +y (RAS), j along -x; qfac = -1 makes k
             * run along -z. */
            store_real(q + 2 * real, real, big, sqrt(0.5));
            for (size_t a = 0; a < 3; a++)
                store_real(offset + real * a, real, big, 10 * (double)(a + 1));
            store_real(pixdim, real, big, -1);
            store(qcode, code, big, 1);
            put_file("test_volume.nii", b.data, b.size);
            assert_read("test_volume.nii", &v);
            assert_true(v.placed);
            assert_at(&v, 0, 0, 0, -10, -20, 30, 1e-6);
            assert_at(&v, 1, 0, 0, -10, -22, 30, 1e-6);
            assert_at(&v, 0, 1, 0, -7, -20, 30, 1e-6);
            assert_at(&v, 0, 0, 1, -10, -20, 26, 1e-6);
            assert_true(v.frames_differ_mm == 0 && !v.frames_mirrored);

            /* sform takes precedence over qform. i runs along +z (RAS), j along -x, k along +y;
             * the unit is micrometres. */
            const double m[12] = {0, -3000, 0, 1000, 0, 0, 4000, 2000, 2000, 0, 0, 3000};
            for (size_t i = 0; i < 12; i++) store_real(row + real * i, real, big, m[i]);
            store(scode, code, big, 2);
            store(unit, version == 2 ? 4 : 1, big, 3 | 8);
            store_real(slope, real, big, 0.5);
            store_real(slope + real, real, big, -7);
            put_file("test_volume.nii", b.data, b.size);
            assert_read("test_volume.nii", &v);
            assert_at(&v, 0, 0, 0, -1, -2, 3, 1e-6);
            assert_at(&v, 1, 0, 0, -1, -2, 5, 1e-6);
            assert_at(&v, 0, 1, 0, 2, -2, 3, 1e-6);
            assert_at(&v, 0, 0, 1, -1, -6, 3, 1e-6);
            assert_true(v.values[7] == -1507 && v.values[0] == -37);
            /* the places above, those of qform now in micrometres */
            double apart = 0;
            for (int64_t c = 0; c < 8; c++) {
                const double i = (double)(c & 1) * (double)(v.grid.n[0] - 1),
                             j = (double)(c >> 1 & 1) * (double)(v.grid.n[1] - 1),
                             k = (double)(c >> 2) * (double)(v.grid.n[2] - 1);
                const double d[3] = {-1 + 3 * j - 1e-3 * (-10 + 3 * j),
                                     -2 - 4 * k - 1e-3 * (-20 - 2 * i),
                                     3 + 2 * i - 1e-3 * (30 - 4 * k)};
                apart = fmax(apart, sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]));
            }
            assert_true(fabs(v.frames_differ_mm - apart) < 1e-5 * apart);
            /* rows of the axes: (0, -2, 0), (3, 0, 0), (0, 0, -4) and (0, 0, 2), (3, 0, 0), (0, -4,
             * 0): determinants of the same sign, until qfac changes it */
            assert_false(v.frames_mirrored);
            store_real(pixdim, real, big, 1);
            put_file("test_volume.nii", b.data, b.size);
            assert_read("test_volume.nii", &v);
            assert_true(v.frames_mirrored);
            sdm_volume_dispose(&v);
        }
}

/* Writes the header, then the voxels 1 .. 24 as bytes. */
static void voxel_file_save(const char *path, const char *header)
{
    static bytes b;
    b.size = 0;
    add(&b, header, strlen(header));
    for (unsigned char i = 1; i <= 24; i++) add(&b, &i, 1);
    put_file(path, b.data, b.size);
}

#define NRRD "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 3 4\nencoding: raw\n"
#define STEPS "space directions: (0,2,0) (3,0,0) (0,0,-4)\nspace origin: (1,2,3)\n"

static void test_nrrd_frames(void **state)
{
    (void)state;
    sdm_volume v = {0};
    voxel_file_save("test_volume.nrrd",
                    NRRD "space: left-posterior-superior\n" STEPS "content: one\ttwo\n\n");
    assert_read("test_volume.nrrd", &v);
    assert_true(v.placed && v.values[23] == 24 && v.min == 1 && v.max == 24);
    assert_string_equal(v.text, "one two");
    assert_at(&v, 0, 0, 0, 1, 2, 3, 1e-12);
    assert_at(&v, 1, 2, 3, 7, 4, -9, 1e-12);
    voxel_file_save("test_volume.nrrd", NRRD "space: RAS\n" STEPS "\n");
    assert_read("test_volume.nrrd", &v);
    assert_at(&v, 1, 2, 3, -7, -4, -9, 1e-12);
    voxel_file_save("test_volume.nrrd",
                    NRRD "space: left-anterior-superior\nspace units: \"um\" \"um\" \"um\"\n" STEPS
                         "\n");
    assert_read("test_volume.nrrd", &v);
    assert_at(&v, 1, 2, 3, 7e-3, -4e-3, -9e-3, 1e-12);
    voxel_file_save("test_volume.nrrd", NRRD "spacings: 2 3 4\n\n");
    assert_read("test_volume.nrrd", &v);
    assert_false(v.placed);
    assert_at(&v, 1, 2, 3, 2, 6, 12, 1e-12);
    voxel_file_save("test_volume.nrrd",
                    NRRD "space: LPS\nspace directions: (0,2,0) (3,0,0) (0,0,-4)\n\n");
    assert_read("test_volume.nrrd", &v);
    assert_false(v.placed);
    voxel_file_save("test_volume.nrrd", NRRD "space dimension: 3\n" STEPS "\n");
    assert_read("test_volume.nrrd", &v);
    assert_false(v.placed);
    sdm_volume_dispose(&v);
}

/* Voxels in a separate file, with bytes to skip at its start. */
static void test_detached(void **state)
{
    (void)state;
    sdm_volume v = {0};
    voxel_file_save("test_volume.raw", "line\nxx");
    static const char *const nrrd[] = {"data file: test_volume.raw\nline skip: 1\nbyte skip: 2\n",
                                       "datafile: ./test_volume.raw\nbyte skip: -1\n\n"};
    for (int i = 0; i < 2; i++) {
        char header[512];
        snprintf(header, sizeof header, "%s%s%s", NRRD, "space: LPS\n" STEPS, nrrd[i]);
        put_file("./test_volume.nhdr", header, strlen(header));
        assert_read("./test_volume.nhdr", &v);
        assert_true(v.values[0] == 1 && v.values[23] == 24);
    }
    for (int i = 0; i < 2; i++) {
        char header[512];
        snprintf(
            header, sizeof header,
            "ObjectType = Image\nNDims = 3\nDimSize = 2 3 4\nElementType = MET_UCHAR\nHeaderSize = "
            "%d\nElementSpacing = 2 3 4\n"
            "TransformMatrix = 0 1 0 1 0 0 0 0 -1\nPosition = 1 2 3\nElementDataFile = "
            "test_volume.raw\n",
            i ? -1 : 7);
        put_file("test_volume.mhd", header, strlen(header));
        assert_read("test_volume.mhd", &v);
        assert_true(v.placed && v.values[0] == 1 && v.values[23] == 24);
        assert_at(&v, 1, 2, 3, 7, 4, -9, 1e-12);
    }
    sdm_volume_dispose(&v);
    remove("test_volume.raw");
    assert_refused("test_volume.mhd", SDM_E_IO, "test_volume.raw: cannot open");
}

/* Two layers of 3 x 2 x 2 voxels; the axis of the layers is the first, the second or the last
 * one. */
static void test_segments(void **state)
{
    (void)state;
    static const char *const sizes[] = {"2 3 2 2", "3 2 2 2", "3 2 2 2"};
    static const char *const directions[] = {"none (1,0,0) (0,1,0) (0,0,1)",
                                             "(1,0,0) none (0,1,0) (0,0,1)",
                                             "(1,0,0) (0,1,0) (0,0,1) none"};
    static const int step[] = {1, 3, 12}; /* number of consecutive voxels of one layer */
    for (int form = 0; form < 3; form++) {
        sdm_volume v = {0};
        sdm_error err;
        const sdm_segment *s;
        char header[1024];
        snprintf(header, sizeof header,
                 "NRRD0005\ntype: unsigned char\ndimension: 4\nspace: "
                 "left-posterior-superior\nsizes: %s\n"
                 "space directions: %s\nencoding: raw\nspace origin: (0,0,0)\nSegmentation_X:=1\n"
                 "Segment0_ID:=a\nSegment0_Name:=scala "
                 "tympani\nSegment0_Layer:=1\nSegment0_LabelValue:=7\n"
                 "Segment2_ID:=b\nSegment2_Name:=c\nSegment2_Layer:=0\nSegment2_LabelValue:=-2\n\n",
                 sizes[form], directions[form]);
        voxel_file_save("test_volume.seg.nrrd", header);
        assert_read("test_volume.seg.nrrd", &v);
        assert_true(v.n_layers == 2 && v.n_segments == 2 && v.grid.n[0] == 3 && v.grid.n[1] == 2 &&
                    v.grid.n[2] == 2);
        for (int layer = 0; layer < 2; layer++)
            for (int i = 0; i < 12; i++) {
                const int run = step[form], at = i / run * 2 * run + layer * run + i % run;
                assert_true(v.values[12 * layer + i] == (float)(at + 1));
            }
        assert_int_equal(sdm_volume_find_segment(&v, "scala tympani", &s, &err), SDM_OK);
        assert_true(s->layer == 1 && s->value == 7 && s == &v.segments[0]);
        assert_int_equal(sdm_volume_find_segment(&v, "b", &s, &err), SDM_OK);
        assert_true(s->layer == 0 && s->value == -2);
        assert_int_equal(sdm_volume_find_segment(&v, "x", &s, &err), SDM_E_ARG);
        assert_text(err.text, "'scala tympani' (a), 'c' (b)");
        sdm_volume_dispose(&v);
    }
}

/* Files of older versions of 3D Slicer state neither layer nor label value: segment i is the
 * value 1 of layer i. */
static void test_segments_unstated(void **state)
{
    (void)state;
    sdm_volume v = {0};
    voxel_file_save("test_volume.seg.nrrd",
                    "NRRD0005\ntype: unsigned char\ndimension: 4\nspace: RAS\nsizes: 2 3 2 2\n"
                    "space directions: none (1,0,0) (0,1,0) (0,0,1)\nencoding: raw\nspace "
                    "origin: (0,0,0)\nSegment0_ID:=a\nSegment1_ID:=b\n\n");
    assert_read("test_volume.seg.nrrd", &v);
    assert_true(v.n_segments == 2 && v.segments[0].layer == 0 && v.segments[1].layer == 1);
    assert_true(v.segments[0].value == 1 && v.segments[1].value == 1);
    sdm_volume_dispose(&v);
}

/* Directions rounded in the header are made orthonormal; a mirrored frame is kept. */
static void test_orthonormal(void **state)
{
    (void)state;
    sdm_volume v = {0};
    voxel_file_save("test_volume.nrrd", NRRD "space: LPS\nspace directions: (0.8660,0.5,0) "
                                             "(0.5,-0.8660,0) (0,0,-1)\nspace origin: (0,0,0)\n\n");
    assert_read("test_volume.nrrd", &v);
    assert_int_equal(sdm_grid_check(&v.grid, NULL), SDM_OK);
    assert_at(&v, 1, 0, 0, 0.8660, 0.5, 0, 1e-4);
    assert_at(&v, 0, 1, 0, 0.5, -0.8660, 0, 1e-4);
    assert_at(&v, 0, 0, 1, 0, 0, -1, 1e-12);
    voxel_file_save(
        "test_volume.nrrd",
        NRRD "space: LPS\nspace directions: (1,0.01,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\n\n");
    assert_read("test_volume.nrrd", &v); /* the skew moves a corner by 0.01 voxels */
    for (int a = 0; a < 3; a++)
        for (int c = 0; c < 3; c++) {
            double dot = 0;
            for (int r = 0; r < 3; r++) dot += v.grid.dir[3 * r + a] * v.grid.dir[3 * r + c];
            assert_true(fabs(dot - (a == c)) < 1e-14);
        }
    sdm_volume_dispose(&v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_nifti_frames), cmocka_unit_test(test_nrrd_frames),
        cmocka_unit_test(test_orthonormal),  cmocka_unit_test(test_detached),
        cmocka_unit_test(test_segments),     cmocka_unit_test(test_segments_unstated),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
