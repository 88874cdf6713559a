/* Images of unsupported kinds or with invalid headers: each gives a status and a message that names
 * the reason.
 * Tests: metaimage_read.c nrrd_read.c nrrd_segments.c */
#include "volume_files.h"

#include <math.h>

#define NRRD_TYPE "NRRD0004\ntype: uchar\ndimension: 3\n"
#define NRRD_REST "encoding: raw\nspace: left-posterior-superior\n"
#define STEPS "space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\n"
#define NRRD NRRD_TYPE "sizes: 2 3 4\n" NRRD_REST STEPS
#define META                                                                                       \
    "ObjectType = Image\nNDims = 3\nDimSize = 2 3 4\nElementType = MET_UCHAR\nElementSpacing = 1 " \
    "1 1\n"
#define LOCAL "ElementDataFile = LOCAL\n"

typedef struct refusal {
    const char *name, *header; /* 24 bytes of voxels follow the header */
    sdm_status status;
    const char *part; /* expected part of the message */
} refusal;

static const refusal nrrd_refusals[] = {
    {"n.nrrd", "NRRD0009\n", SDM_E_FORMAT, "not a NRRD file"},
    {"n.nrrd", NRRD_TYPE "sizes: 2 3 5\n" NRRD_REST STEPS "\n", SDM_E_FORMAT,
     "declares 30 bytes of voxels, the file has 24"},
    {"n.nrrd", NRRD_TYPE "sizes: 2 3 3\n" NRRD_REST STEPS "\n", SDM_E_FORMAT,
     "declares 18 bytes of voxels, the file has 24"},
    {"n.nrrd", NRRD_TYPE "sizes: 0 3 4\n" NRRD_REST STEPS "\n", SDM_E_FORMAT, "size along x is 0"},
    {"n.nrrd", NRRD_TYPE "sizes: -1 3 4\n" NRRD_REST STEPS "\n", SDM_E_FORMAT,
     "size -1 is outside"},
    {"n.nrrd", NRRD_TYPE "sizes: 2 2147483648 4\n" NRRD_REST STEPS "\n", SDM_E_FORMAT,
     "size 2147483648"},
    {"n.nrrd", NRRD_TYPE "sizes: 2 3 4398046511104\n" NRRD_REST STEPS "\n", SDM_E_FORMAT,
     "size 4398046511104"},
    {"n.nrrd", NRRD_TYPE "sizes: 1048576 1048576 1048576\n" NRRD_REST STEPS "\n", SDM_E_FORMAT,
     "more than memory can hold"},
    {"n.nrrd", NRRD_TYPE "sizes: 1048576 1048576 1024\n" NRRD_REST STEPS "\n", SDM_E_FORMAT,
     "the file has 24"},
    {"n.nrrd", NRRD_TYPE "sizes: 2 3\n" NRRD_REST STEPS "\n", SDM_E_FORMAT, "the size is missing"},
    {"n.nrrd", NRRD_TYPE "sizes: 2 3 4 5\n" NRRD_REST STEPS "\n", SDM_E_FORMAT,
     "more than 3 sizes"},
    {"n.nrrd", NRRD_TYPE "sizes: 2 3 4\nspacings: 1 nan 1\nencoding: raw\n\n", SDM_E_FORMAT,
     "spacing along y is nan"},
    {"n.nrrd", NRRD_TYPE "sizes: 2 3 4\nspacings: 1 inf 1\nencoding: raw\n\n", SDM_E_FORMAT,
     "bad spacing: 'inf'"},
    {"n.nrrd", NRRD_TYPE "sizes: 2 3 4\nspacings: 1 0 1\nencoding: raw\n\n", SDM_E_FORMAT,
     "spacing along y is 0"},
    {"n.nrrd", NRRD_TYPE "sizes: 2 3 4\nencoding: raw\n\n", SDM_E_UNSUPPORTED,
     "size of the voxels"},
    {"n.nrrd",
     NRRD_TYPE "sizes: 2 3 4\n" NRRD_REST "space directions: (1,0,0) (0,nan,0) (0,0,1)\n\n",
     SDM_E_FORMAT, "not a finite number"},
    {"n.nrrd", NRRD_TYPE "sizes: 2 3 4\n" NRRD_REST "space directions: (1,0,0) (0,1,0)\n\n",
     SDM_E_FORMAT, "need a vector"},
    {"n.nrrd", NRRD_TYPE "sizes: 2 3 4\n" NRRD_REST "space directions: (1,0,0) (0,1) (0,0,1)\n\n",
     SDM_E_FORMAT, "three numbers"},
    {"n.nrrd",
     NRRD_TYPE "sizes: 2 3 4\n" NRRD_REST "space directions: (1,0,0) (0.5,1,0) (0,0,1)\n\n",
     SDM_E_UNSUPPORTED, "right angles"},
    {"n.nrrd", NRRD_TYPE "sizes: 2 3 4\n" NRRD_REST "space directions: (1,0,0) (2,0,0) (0,0,1)\n\n",
     SDM_E_UNSUPPORTED, "right angles"},
    {"n.nrrd", NRRD_TYPE "sizes: 2 3 4\n" NRRD_REST "space directions: none (0,1,0) (0,0,1)\n\n",
     SDM_E_UNSUPPORTED, "three axes"},
    {"n.nrrd", NRRD "space origin: (0,0,0)\n\n", SDM_E_FORMAT, "given twice"},
    {"n.nrrd",
     NRRD_TYPE "sizes: 2 3 4\n" NRRD_REST
               "space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,inf,0)\n\n",
     SDM_E_FORMAT, "finite"},
    {"n.nrrd", NRRD_TYPE "space: scanner-xyz\n\n", SDM_E_UNSUPPORTED, "'scanner-xyz'"},
    {"n.nrrd", NRRD_TYPE "space: right-anterior-superior-time\n\n", SDM_E_UNSUPPORTED, "-time"},
    {"n.nrrd", NRRD "space units: \"mm\" \"mm\" \"furlong\"\n\n", SDM_E_UNSUPPORTED, "furlong"},
    {"n.nrrd", "NRRD0004\ntype: block\n\n", SDM_E_UNSUPPORTED, "'block'"},
    {"n.nrrd", "NRRD0004\ndimension: 2\n\n", SDM_E_UNSUPPORTED, "need 3 dimensions"},
    {"n.nrrd", "NRRD0004\nsizes: 2 3 4\n\n", SDM_E_FORMAT, "before 'dimension'"},
    {"n.nrrd", NRRD_TYPE "sizes: 2 3 4\nencoding: ascii\n\n", SDM_E_UNSUPPORTED, "'ascii'"},
    {"n.nrrd", NRRD_TYPE "sizes: 2 3 4\nencoding: bzip2\n\n", SDM_E_UNSUPPORTED, "'bzip2'"},
    {"n.nrrd", "NRRD0004\ntype: short\ndimension: 3\nsizes: 2 3 2\n" NRRD_REST STEPS "\n",
     SDM_E_FORMAT, "no field 'endian'"},
    {"n.nrrd", NRRD "endian: middle\n\n", SDM_E_FORMAT, "'middle'"},
    {"n.nrrd", NRRD "this is no field\n\n", SDM_E_FORMAT, "need 'field: value'"},
    {"n.nrrd", NRRD "data file: /etc/hostname\n\n", SDM_E_UNSUPPORTED, "another folder"},
    {"n.nrrd", NRRD "data file: ../x.raw\n\n", SDM_E_UNSUPPORTED, "another folder"},
    {"n.nrrd", NRRD "data file: ..\n\n", SDM_E_UNSUPPORTED, "another folder"},
    {"n.nrrd", NRRD "data file: a/x.raw\n\n", SDM_E_UNSUPPORTED, "another folder"},
    {"n.nrrd", NRRD "data file: C:\\x.raw\n\n", SDM_E_UNSUPPORTED, "another folder"},
    {"n.nrrd", NRRD "data file: LIST\n\n", SDM_E_UNSUPPORTED, "list of files"},
    {"n.nrrd", NRRD "data file: x%03d.raw 1 4 1\n\n", SDM_E_UNSUPPORTED, "list of files"},
    {"n.nrrd", NRRD "data file: test_volume_no_such.raw\n\n", SDM_E_IO, "no_such.raw: cannot open"},
    {"n.nrrd", NRRD "byte skip: 25\n\n", SDM_E_FORMAT, "ends too early"},
    {"n.nrrd", NRRD "byte skip: -2\n\n", SDM_E_FORMAT, "'-2'"},
    {"n.nrrd", NRRD_TYPE "sizes: 2 3 4\nencoding: gzip\nbyte skip: 2\n" STEPS "\n",
     SDM_E_UNSUPPORTED, "'byte skip'"},
    {"n.nrrd", NRRD_TYPE "sizes: 2 3 4\nencoding: gzip\n" STEPS "\n", SDM_E_FORMAT, "are damaged"},
    {"n.nrrd",
     "NRRD0004\ntype: uchar\ndimension: 4\nsizes: 2 3 2 2\nspace directions: none (1,0,0) (0,1,0) "
     "(0,0,1)\nencoding: "
     "raw\n\n",
     SDM_E_UNSUPPORTED, "2 images"},
    {"n.nrrd",
     "NRRD0004\ntype: uchar\ndimension: 4\nsizes: 0 3 2 2\nspace directions: none (1,0,0) (0,1,0) "
     "(0,0,1)\nencoding: "
     "raw\n\n",
     SDM_E_FORMAT, "axis 0 has no entries"},
    {"n.nrrd",
     "NRRD0004\ntype: uchar\ndimension: 4\nsizes: 2 3 2 2\nspace directions: (1,0,0) (0,1,0) "
     "(0,0,1) "
     "(0,0,1)\nencoding: raw\n\n",
     SDM_E_UNSUPPORTED, "one 'none' of four"},
    {"n.nrrd",
     "NRRD0004\ntype: uchar\ndimension: 4\nsizes: 2147483646 100000 100000 100000\nspace "
     "directions: none (1,0,0) "
     "(0,1,0) (0,0,1)\nencoding: raw\nSegment0_ID:=a\n\n",
     SDM_E_FORMAT, "more voxels than memory can hold"},
    {"n.nrrd", NRRD "Segment0_Name:=a\nSegment0_Layer:=1\n\n", SDM_E_FORMAT,
     "'a' is in layer 1, the file has 1"},
    {"n.nrrd", NRRD "Segment0_Layer:=-1\n\n", SDM_E_FORMAT, "'-1' is no layer"},
    {"n.nrrd", NRRD "Segment0_LabelValue:=one\n\n", SDM_E_FORMAT, "'one' is no label value"},
    {"n.nrrd", NRRD "Segment99999_Name:=a\n\n", SDM_E_UNSUPPORTED, "segment 99999"},
};

static const refusal meta_refusals[] = {
    {"m.mha", "ObjectType = Tube\n", SDM_E_UNSUPPORTED, "'Tube'"},
    {"m.mha", "NDims = 2\n", SDM_E_UNSUPPORTED, "need 3 dimensions"},
    {"m.mha", META "ElementSize = 1 1 1\nnothing\n", SDM_E_FORMAT, "need 'Key = value'"},
    {"m.mha", META, SDM_E_FORMAT, "this is no header"},
    {"m.mha", "NDims = 3\nDimSize = 2 3 4\nElementType = MET_UCHAR\n" LOCAL, SDM_E_UNSUPPORTED,
     "no key 'ElementSpacing'"},
    {"m.mha", "NDims = 3\nElementSpacing = 1 1 1\nElementType = MET_UCHAR\n" LOCAL, SDM_E_FORMAT,
     "no key 'DimSize'"},
    {"m.mha", META "NDims = 3\n", SDM_E_FORMAT, "given twice"},
    {"m.mha", META "ElementNumberOfChannels = 3\n", SDM_E_UNSUPPORTED, "one number a voxel"},
    {"m.mha", META "BinaryData = False\n", SDM_E_UNSUPPORTED, "as text"},
    {"m.mha", META "CompressedData = Maybe\n", SDM_E_FORMAT, "'Maybe'"},
    {"m.mha", META "CompressedData = True\n" LOCAL, SDM_E_FORMAT, "are damaged"},
    {"m.mha", META "DistanceUnits = parsec\n", SDM_E_UNSUPPORTED, "parsec"},
    {"m.mha", META "TransformMatrix = 1 0 0 0 1 0 0 0\n", SDM_E_FORMAT, "need 9"},
    {"m.mha", META "TransformMatrix = 1 0 0 0 1 0 0 0 0\n" LOCAL, SDM_E_FORMAT,
     "spacing along z is 0"},
    {"m.mha", META "TransformMatrix = 1 0 0 0.5 1 0 0 0 1\n" LOCAL, SDM_E_UNSUPPORTED,
     "right angles"},
    {"m.mha", META "Offset = 0 nan 0\n", SDM_E_FORMAT, "'nan'"},
    {"m.mha", META "ElementToIntensityFunctionSlope = 2\n", SDM_E_UNSUPPORTED, "scaled"},
    {"m.mha", META "ElementToIntensityFunctionOffset = 2\n", SDM_E_UNSUPPORTED, "moved"},
    {"m.mha", META "HeaderSize = 3\n" LOCAL, SDM_E_UNSUPPORTED, "'HeaderSize'"},
    {"m.mha", META "ElementDataFile = LIST\n", SDM_E_UNSUPPORTED, "list of files"},
    {"m.mha", META "ElementDataFile = s%02d.raw 1 4 1\n", SDM_E_UNSUPPORTED, "list of files"},
    {"m.mhd", META "ElementDataFile = /etc/hostname\n", SDM_E_UNSUPPORTED, "another folder"},
    {"m.mhd", META "ElementDataFile = ../m.raw\n", SDM_E_UNSUPPORTED, "another folder"},
    {"m.mha", "NDims = 3\nDimSize = 2 3 4\nElementType = MET_STRING\n", SDM_E_UNSUPPORTED,
     "MET_STRING"},
    {"m.mha", "NDims = 3\nDimSize = 2 3 5\nElementSpacing = 1 1 1\nElementType = MET_UCHAR\n" LOCAL,
     SDM_E_FORMAT, "the file has 24"},
    {"m.mha",
     "NDims = 3\nDimSize = 2 3 4\nElementSpacing = 1 -1 1\nElementType = MET_UCHAR\n" LOCAL, SDM_OK,
     NULL},
};

static void refusals_check(const refusal *r, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        static bytes b;
        char name[64];
        b.size = 0;
        add(&b, r[i].header, strlen(r[i].header));
        for (unsigned char v = 0; v < 24; v++) add(&b, &v, 1);
        snprintf(name, sizeof name, "test_volume_bad_%s", r[i].name);
        put_file(name, b.data, b.size);
        if (r[i].status) {
            assert_refused(name, r[i].status, r[i].part);
            continue;
        }
        sdm_volume v = {0};
        assert_read(name, &v);
        sdm_volume_dispose(&v);
    }
}

static void test_bad_text_headers_are_refused(void **state)
{
    (void)state;
    refusals_check(nrrd_refusals, sizeof nrrd_refusals / sizeof *nrrd_refusals);
    refusals_check(meta_refusals, sizeof meta_refusals / sizeof *meta_refusals);
}

#define NIFTI "test_volume_bad.nii"

/* Expects a refusal of a NIfTI-1 header in which one number is changed: at byte `at`, a real or
 * an integer of `size` bytes. */
static void nifti_refused(size_t at, size_t size, bool real, double value, sdm_status status,
                          const char *part)
{
    static bytes b;
    static const int64_t n[3] = {2, 3, 4};
    add_nifti(&b, 1, 0, 0, n);
    for (unsigned char v = 0; v < 24; v++) add(&b, &v, 1);
    if (real)
        store_real(b.data + at, size, 0, value);
    else
        store(b.data + at, size, 0, (uint64_t)(int64_t)value);
    put_file(NIFTI, b.data, b.size);
    assert_refused(NIFTI, status, part);
}

static void test_bad_nifti_headers_are_refused(void **state)
{
    (void)state;
    nifti_refused(0, 4, false, 349, SDM_E_FORMAT, "begins neither with 348 nor with 540");
    nifti_refused(344, 4, false, 0, SDM_E_FORMAT, "the mark 'n+1' is missing");
    nifti_refused(344, 4, false, 0x31696e, SDM_E_UNSUPPORTED, ".hdr and .img");
    nifti_refused(40, 2, false, 2, SDM_E_UNSUPPORTED, "2 dimensions");
    nifti_refused(40, 2, false, 0, SDM_E_FORMAT, "0 dimensions");
    nifti_refused(40, 2, false, 8, SDM_E_FORMAT, "8 dimensions");
    nifti_refused(42, 2, false, -1, SDM_E_FORMAT, "size along x is -1");
    nifti_refused(44, 2, false, 0, SDM_E_FORMAT, "size along y is 0");
    nifti_refused(46, 2, false, 32767, SDM_E_FORMAT, "the file has 24");
    nifti_refused(70, 2, false, 128, SDM_E_UNSUPPORTED, "NIfTI type 128");
    nifti_refused(84, 4, true, NAN, SDM_E_FORMAT, "voxels of nan");
    nifti_refused(84, 4, true, INFINITY, SDM_E_FORMAT, "voxels of inf");
    nifti_refused(84, 4, true, -1, SDM_E_FORMAT, "voxels of -1");
    nifti_refused(108, 4, true, 351, SDM_E_FORMAT, "begin at byte 351");
    nifti_refused(108, 4, true, 352.5, SDM_E_FORMAT, "begin at byte 352.5");
    nifti_refused(108, 4, true, 353, SDM_E_FORMAT, "the file has 23");
    nifti_refused(108, 4, true, 1e9, SDM_E_FORMAT, "ends too early");
    nifti_refused(108, 4, true, NAN, SDM_E_FORMAT, "begin at byte nan");
    nifti_refused(112, 4, true, INFINITY, SDM_E_FORMAT, "scaled by inf");
    nifti_refused(254, 2, false, 1, SDM_E_FORMAT, "spacing along x is 0"); /* an sform of zeros */

    static bytes b;
    const int64_t four[3] = {2, 3, 4}, large[3] = {INT64_C(1) << 42, INT64_C(1) << 31, 1};
    add_nifti(&b, 1, 0, 0, four);
    store(b.data + 40, 2, 0, 4);
    store(b.data + 48, 2, 0, 2);
    put_file(NIFTI, b.data, b.size);
    assert_refused(NIFTI, SDM_E_UNSUPPORTED, "dimension 4 has 2 entries");
    store(b.data + 48, 2, 0, 1);
    for (unsigned char v = 0; v < 24; v++) add(&b, &v, 1);
    put_file(NIFTI, b.data, b.size);
    sdm_volume v = {0};
    assert_read(NIFTI, &v);
    assert_int_equal(v.grid.n[2], 4);
    sdm_volume_dispose(&v);
    store(b.data + 252, 2, 0, 1);
    store_real(b.data + 256, 4, 0, 2);
    put_file(NIFTI, b.data, b.size);
    assert_refused(NIFTI, SDM_E_FORMAT, "quaternion");
    add_nifti(&b, 2, 1, 0, large);
    put_file(NIFTI, b.data, b.size);
    assert_refused(NIFTI, SDM_E_FORMAT, "size along x is 4398046511104");
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_bad_text_headers_are_refused),
                                       cmocka_unit_test(test_bad_nifti_headers_are_refused)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
