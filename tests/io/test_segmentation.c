/* Segmentations of 3D Slicer: written, read back by the library, and the text of the header.
 * Tests: segmentation_write.c */
#include "volume_files.h"

enum { N = 4 * 3 * 2 };

static const sdm_grid GRID = {.n = {4, 3, 2},
                              .spacing = {0.5, 1, 2},
                              .origin = {1, 2, 3},
                              .dir = {0, -1, 0, 1, 0, 0, 0, 0, 1}};

/* Voxels (1..2, 1, 0..1) have the label 1, voxel (3, 2, 1) the label 7. */
static void fill(uint8_t labels[N])
{
    memset(labels, 0, N);
    for (int k = 0; k < 2; k++) labels[(k * 3 + 1) * 4 + 1] = labels[(k * 3 + 1) * 4 + 2] = 1;
    labels[(1 * 3 + 2) * 4 + 3] = 7;
}

static void test_round_trip(void **state)
{
    (void)state;
    const sdm_segment want[2] = {{.name = "left\ncochlea", .id = "", .value = 1},
                                 {.name = "other", .id = "Segment_7", .value = 7}};
    uint8_t labels[N];
    sdm_volume v = {0};
    sdm_error err = {0};
    const sdm_segment *found;
    fill(labels);
    if (sdm_segmentation_write("two.seg.nrrd", &GRID, labels, want, 2, "a test", &err))
        fail_msg("%s", err.text);
    if (sdm_volume_read("two.seg.nrrd", &v, &err)) fail_msg("%s", err.text);
    assert_int_equal(v.stored, SDM_VOXEL_UINT8);
    assert_int_equal(v.n_layers, 1);
    assert_int_equal(v.n_segments, 2);
    for (int i = 0; i < N; i++) assert_int_equal((int)v.values[i], labels[i]);
    for (int a = 0; a < 3; a++) {
        assert_int_equal(v.grid.n[a], GRID.n[a]);
        assert_true(v.grid.spacing[a] == GRID.spacing[a] && v.grid.origin[a] == GRID.origin[a]);
    }
    for (int i = 0; i < 9; i++) assert_true(v.grid.dir[i] == GRID.dir[i]);
    assert_string_equal(v.segments[0].name, "left cochlea"); // line ends would end the key
    assert_string_equal(v.segments[0].id, "left cochlea");
    assert_int_equal(sdm_volume_find_segment(&v, "Segment_7", &found, &err), SDM_OK);
    assert_int_equal(found->value, 7);
    assert_int_equal(found->layer, 0);
    sdm_volume_dispose(&v);
}

/* The keys that Slicer reads, word by word. */
static void test_header(void **state)
{
    (void)state;
    static const char *const lines[] = {"NRRD0005\n",
                                        "\ntype: unsigned char\n",
                                        "\nspace: left-posterior-superior\n",
                                        "\nSegment0_Extent:=1 2 1 1 0 1\n",
                                        "\nSegment0_LabelValue:=1\n",
                                        "\nSegment0_Name:=inside\n",
                                        "\nSegment0_Tags:=TerminologyEntry:Segmentation category "
                                        "and type - 3D Slicer General Anatomy list~SCT^85756007^",
                                        "\nSegment0_Color:=0.",
                                        "\nSegmentation_MasterRepresentation:=Binary labelmap\n"};
    const sdm_segment inside = {.name = "inside", .value = 1};
    uint8_t labels[N];
    char text[4096] = "";
    fill(labels);
    assert_int_equal(sdm_segmentation_write("one.seg.nrrd", &GRID, labels, &inside, 1, NULL, NULL),
                     SDM_OK);
    FILE *f = fopen("one.seg.nrrd", "rb");
    assert_non_null(f);
    const size_t size = fread(text, 1, sizeof text - 1, f);
    fclose(f);
    text[size] = '\0';
    char *end = strstr(text, "\n\n"); // the voxels follow
    assert_non_null(end);
    end[1] = '\0';
    for (size_t i = 0; i < sizeof lines / sizeof *lines; i++)
        if (!strstr(text, lines[i])) fail_msg("no '%s' in: %s", lines[i], text);
}

static void test_refused(void **state)
{
    (void)state;
    const sdm_segment absent = {.name = "absent", .value = 2}, zero = {.name = "zero", .value = 0},
                      high = {.name = "high", .value = 256}, good = {.name = "good", .value = 1};
    const struct {
        const char *path;
        const sdm_segment *segment;
        size_t n;
        sdm_status status;
        const char *text;
    } cases[] = {{"no.seg.nrrd", &absent, 1, SDM_E_ARG, "no voxel belongs to the segment 'absent'"},
                 {"no.seg.nrrd", &zero, 1, SDM_E_ARG, "label 0 of segment 'zero'"},
                 {"no.seg.nrrd", &high, 1, SDM_E_ARG, "label 256 of segment 'high'"},
                 {"no.seg.nrrd", &good, 0, SDM_E_ARG, "no segment"},
                 {"no.nrrd", &good, 1, SDM_E_UNSUPPORTED, "must end in .seg.nrrd"}};
    uint8_t labels[N];
    fill(labels);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        sdm_error err = {0};
        const sdm_status s = sdm_segmentation_write(cases[i].path, &GRID, labels, cases[i].segment,
                                                    cases[i].n, NULL, &err);
        assert_int_equal(s, cases[i].status);
        if (!strstr(err.text, cases[i].text)) fail_msg("%s", err.text);
        assert_null(fopen(cases[i].path, "rb"));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_round_trip),
                                       cmocka_unit_test(test_header),
                                       cmocka_unit_test(test_refused)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
