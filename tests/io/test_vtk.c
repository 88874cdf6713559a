/* VTK mesh files as text, and zlib data against zlib.
 * Tests: inflate.c polydata.c vtk.c vtk_types.c vtp.c vtp_data.c vtp_tags.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include <cmocka.h>

#include "mesh/inflate.h"
#include "sdm/internal/rng.h"
#include "sdm/meshfile.h"

#define SIZE 70000

static sdm_mesh mesh;
static sdm_error err;

static sdm_status read_text(const char *path, const char *text)
{
    FILE *f = fopen(path, "wb");
    assert_non_null(f);
    assert_int_equal(fwrite(text, 1, strlen(text), f), strlen(text));
    assert_int_equal(fclose(f), 0);
    sdm_mesh_dispose(&mesh);
    return sdm_mesh_read(path, &mesh, &err);
}

static void assert_triangles(const uint32_t *tri, size_t n)
{
    assert_int_equal(mesh.n_tri, n);
    assert_memory_equal(mesh.tri, tri, 3 * n * sizeof *tri);
}

#define POINTS "POINTS 5 float\n0 0 0 1 0 0 0 1 0\n1 1 0 -2.5 1e1 0\n"

static void test_legacy_text(void **state)
{
    (void)state;
    static const char head4[] = "# vtk DataFile Version 4.2\nt\nASCII\nDATASET POLYDATA\n";
    static const char head5[] = "# vtk DataFile Version 5.1\nt\nASCII\nDATASET POLYDATA\n";
    static const uint32_t quad[] = {0, 1, 3, 0, 3, 2, 0, 2, 4},
                          strip[] = {0, 1, 2, 1, 3, 2, 2, 3, 4};
    char text[2000];
    snprintf(text, sizeof text,
             "%sFIELD FieldData 1\nnote 2 2 int\n1 2\n3 4\n" POINTS
             "VERTICES 1 2\n1 0\nPOLYGONS 2 9\n4 0 1 3 2\n3 0 2 4\nPOINT_DATA 5\nSCALARS a float\n",
             head4);
    assert_int_equal(read_text("a.vtk", text), SDM_OK);
    assert_triangles(quad, 3);
    assert_true(mesh.vert[12] == -2.5 && mesh.vert[13] == 10);
    snprintf(
        text, sizeof text,
        "%s" POINTS "METADATA\nINFORMATION 1\nNAME a LOCATION b\n\n"
        "POLYGONS 3 7\nOFFSETS vtktypeint64\n0 4 7\nCONNECTIVITY vtktypeint64\n0 1 3 2 0 2 4\n",
        head5);
    assert_int_equal(read_text("a.vtk", text), SDM_OK);
    assert_triangles(quad, 3);
    snprintf(text, sizeof text, "%s" POINTS "TRIANGLE_STRIPS 1 6\n5 0 1 2 3 4\n", head4);
    assert_int_equal(read_text("a.vtk", text), SDM_OK);
    assert_triangles(strip, 3);
}

static void test_legacy_refused(void **state)
{
    (void)state;
    static const struct {
        const char *text, *what;
    } cases[] = {
        {"POLYGONS 1 4\n3 0 1 2\n", "no POINTS"},
        {POINTS "POLYGONS 1 4\n3 0 1 5\n", "point 5 of 5"},
        {POINTS "POLYGONS 1 4\n3 0 1 -1\n", "point -1 of 5"},
        {POINTS "POLYGONS 1 3\n2 0 1\n", "2 corners"},
        {POINTS "POLYGONS 1 4\n4 0 1 2\n", "differ"},
        {POINTS "POLYGONS 1 5\n3 0 1 2 0\n", "differ"},
        {POINTS "POLYGONS 9 4\n3 0 1 2\n", "more cells"},
        {"POINTS 1000000000 float\n0 0 0\n", "cannot fit"},
        {"POINTS 1 colour\n0 0 0\n", "need a type"},
        {"POINTS 1 float\n0 0 nan\n", "finite number"},
        {"POINTS -1 float\n", "need a count"},
        {POINTS "POLYGONES 1 4\n3 0 1 2\n", "keyword"},
        {POINTS POINTS, "second list"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char text[1000];
        snprintf(text, sizeof text, "# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\n%s",
                 cases[i].text);
        assert_int_equal(read_text("a.vtk", text), SDM_E_FORMAT);
        assert_non_null(strstr(err.text, cases[i].what));
        assert_non_null(strstr(err.text, "a.vtk"));
    }
    assert_int_equal(read_text("a.vtk", "# vtk DataFile Version 9.0\n"), SDM_E_UNSUPPORTED);
    assert_int_equal(
        read_text("a.vtk", "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED\n"),
        SDM_E_UNSUPPORTED);
}

#define VTP(root, points, polys)                                                                   \
    "<?xml version='1.0'?><!-- a > b -->\n<VTKFile type=\"PolyData\" " root "><PolyData>"          \
    "<Piece NumberOfPoints=\"3\" NumberOfPolys=\"1\"><Points>" points "</Points><Polys>" polys     \
    "</Polys></Piece></PolyData></VTKFile>"
#define VTP_POINTS                                                                                 \
    "<DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"ascii\">0 0 0 1 0 0 0 2 0"      \
    "</DataArray>"
#define VTP_POLYS                                                                                  \
    "<DataArray type=\"Int32\" Name=\"connectivity\" format=\"ascii\">2 0 1</DataArray>"           \
    "<DataArray type=\"Int32\" Name=\"offsets\" format=\"ascii\">3</DataArray>"

static void test_xml(void **state)
{
    (void)state;
    static const uint32_t tri[] = {2, 0, 1};
    assert_int_equal(read_text("a.vtp", VTP("", VTP_POINTS, VTP_POLYS)), SDM_OK);
    assert_triangles(tri, 1);
    static const struct {
        const char *text, *what;
    } cases[] = {
        {"", "not XML"},
        {"<VTKFile type=\"ImageData\">", "type=\"PolyData\""},
        {"<!DOCTYPE a><VTKFile>", "document types"},
        {VTP("", "", VTP_POLYS), "NumberOfPoints"},
        {VTP("", VTP_POINTS VTP_POINTS, VTP_POLYS), "there already"},
        {VTP("", VTP_POINTS, ""), "one for each cell"},
        {VTP("", VTP_POINTS, "</Points>"), "not the last one"},
        {VTP("a=b", VTP_POINTS, ""), "=\"value\""},
        {VTP("",
             "<DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"binary\">"
             "////fwAA</DataArray>",
             VTP_POLYS),
         "longer than the file"},
        {VTP("",
             "<DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"binary\">"
             "JAA*AAAA</DataArray>",
             VTP_POLYS),
         "base64"},
        {VTP("",
             "<DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"appended\" "
             "offset=\"0\"/>",
             VTP_POLYS),
         "no appended data"},
        {VTP("compressor=\"vtkZLibDataCompressor\"",
             "<DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"binary\">"
             "AQAAAP////8AAAAACQAAAA==eJxjYGBgAAAABAAB</DataArray>",
             VTP_POLYS),
         "longer than"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        assert_int_equal(read_text("a.vtp", cases[i].text), SDM_E_FORMAT);
        assert_non_null(strstr(err.text, cases[i].what));
        assert_non_null(strstr(err.text, "a.vtp"));
    }
    assert_int_equal(read_text("a.vtp", VTP("compressor=\"x\"", VTP_POINTS, VTP_POLYS)),
                     SDM_E_UNSUPPORTED);
    sdm_mesh_dispose(&mesh);
}

/* zlib's stream of data[SIZE] at a level and with a strategy. */
static size_t deflate_all(const uint8_t *data, size_t n, int level, int strategy, uint8_t *out)
{
    z_stream z = {0};
    assert_int_equal(deflateInit2(&z, level, Z_DEFLATED, 15, 8, strategy), Z_OK);
    z.next_in = (uint8_t *)(uintptr_t)data, z.avail_in = (uInt)n;
    z.next_out = out, z.avail_out = 2 * SIZE;
    assert_int_equal(deflate(&z, Z_FINISH), Z_STREAM_END);
    const size_t size = z.total_out;
    assert_int_equal(deflateEnd(&z), Z_OK);
    return size;
}

static void test_inflate(void **state)
{
    (void)state;
    static uint8_t data[SIZE], packed[2 * SIZE], got[SIZE], want[SIZE];
    static const int levels[] = {0, 1, 6, 9};
    static const int strategies[] = {Z_DEFAULT_STRATEGY, Z_FIXED, Z_HUFFMAN_ONLY, Z_RLE};
    uint64_t draw = 0;
    for (size_t kind = 0; kind < 3; kind++) {
        // noise, a few letters, long runs
        for (size_t i = 0; i < SIZE; i++) {
            const uint64_t r = sdm_mix64(i + 1 + SIZE * kind);
            const uint64_t value = kind == 0 ? r : kind == 1 ? 97 + r % 5 : i / 9000;
            data[i] = (uint8_t)value;
        }
        for (int l = 0; l < 4; l++)
            for (int s = 0; s < 4; s++) {
                const size_t n = l == 3 ? 0 : SIZE,
                             size = deflate_all(data, n, levels[l], strategies[s], packed);
                assert_true(sdm_inflate(packed, size, got, n));
                assert_memory_equal(got, data, n);
                // other lengths, and damaged streams: right exactly where zlib says so
                assert_false(sdm_inflate(packed, size - 1, got, n));
                assert_false(n > 0 && sdm_inflate(packed, size, got, n - 1));
                for (int trial = 0; trial < 20; trial++) {
                    const size_t at = (size_t)(sdm_mix64(++draw) % size);
                    const uint8_t kept = packed[at];
                    packed[at] ^= (uint8_t)(1 << draw % 8);
                    uLongf length = SIZE;
                    const bool right =
                        uncompress(want, &length, packed, size) == Z_OK && length == n;
                    assert_int_equal(sdm_inflate(packed, size, got, n), right);
                    packed[at] = kept;
                }
            }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_legacy_text),
                                       cmocka_unit_test(test_legacy_refused),
                                       cmocka_unit_test(test_xml), cmocka_unit_test(test_inflate)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
