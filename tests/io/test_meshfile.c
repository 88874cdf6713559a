/* Mesh files: round trips, every variant of the formats, and hostile content.
 * Tests: builder.c meshfile.c obj.c off.c ply.c ply_header.c polydata.c scan.c stl.c vtk.c
 * vtk_types.c vtp.c vtp_data.c vtp_tags.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/internal/heap.h"
#include "sdm/internal/rng.h"
#include "sdm/meshfile.h"

static const char *const extensions[] = {".ply", ".stl", ".obj", ".off", ".vtk", ".vtp"};

static void file_save(const char *path, const void *data, size_t size)
{
    FILE *f = fopen(path, "wb");
    assert_non_null(f);
    assert_int_equal(fwrite(data, 1, size, f), size);
    assert_int_equal(fclose(f), 0);
}

static unsigned char *file_load(const char *path, size_t *size)
{
    FILE *f = fopen(path, "rb");
    assert_non_null(f);
    unsigned char *data = malloc(1 << 16);
    assert_non_null(data);
    *size = fread(data, 1, 1 << 16, f);
    assert_int_equal(fclose(f), 0);
    return data;
}

static const char *file_name(const char *ext)
{
    static char name[64];
    snprintf(name, sizeof name, "test_meshfile_file%s", ext);
    return name;
}

static sdm_status read_text(const char *ext, const char *text, sdm_mesh *m, sdm_error *err)
{
    file_save(file_name(ext), text, strlen(text));
    return sdm_mesh_read(file_name(ext), m, err);
}

/* An irregular tetrahedron with one more triangle at an edge; `single`: coordinates that float
 * represents exactly. */
static void tetrahedron_make(sdm_mesh *m, bool single)
{
    static const uint32_t tri[5][3] = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}, {3, 2, 4}};
    assert_int_equal(sdm_mesh_reserve(m, 5, 5, NULL), SDM_OK);
    for (size_t i = 0; i < 15; i++) {
        const double v = sdm_rng_normal(7, 1, i) * (i == 4 ? 1e-7 : 10);
        m->vert[i] = single ? (double)(float)v : v;
    }
    memcpy(m->tri, tri, sizeof tri);
}

static void test_round_trip(void **state)
{
    (void)state;
    for (size_t f = 0; f < 4; f++) {
        const bool stl = f == 1;
        sdm_mesh a = {0}, b = {0};
        sdm_error err;
        tetrahedron_make(&a, stl);
        assert_int_equal(sdm_mesh_write(file_name(extensions[f]), &a, &err), SDM_OK);
        assert_int_equal(sdm_mesh_read(file_name(extensions[f]), &b, &err), SDM_OK);
        assert_int_equal(b.n_vert, 5);
        assert_int_equal(b.n_tri, 5);
        if (!stl) assert_memory_equal(a.tri, b.tri, 15 * sizeof *a.tri);
        /* STL repeats vertices and readers renumber them: compare the corners of triangles bit
         * by bit. */
        for (size_t c = 0; c < 15; c++)
            assert_memory_equal(a.vert + 3 * (size_t)a.tri[c], b.vert + 3 * (size_t)b.tri[c],
                                3 * sizeof *a.vert);
        sdm_mesh_dispose(&a);
        sdm_mesh_dispose(&b);
    }
}

/* The same quadrilateral and triangle in every variant: vertices (0,0,0) (1,0,0) (1,2,0) (0,2,0)
 * (0.5,1,-3.25). */
static const double pyramid[5][3] = {{0, 0, 0}, {1, 0, 0}, {1, 2, 0}, {0, 2, 0}, {0.5, 1, -3.25}};
static const uint32_t fans[3][3] = {{0, 1, 2}, {0, 2, 3}, {1, 0, 4}};

static void check_pyramid(const sdm_mesh *m)
{
    assert_int_equal(m->n_vert, 5);
    assert_int_equal(m->n_tri, 3);
    assert_memory_equal(m->vert, pyramid, sizeof pyramid);
    assert_memory_equal(m->tri, fans, sizeof fans);
}

static void test_text_variants(void **state)
{
    (void)state;
    static const struct {
        const char *ext, *text;
    } file[] = {
        {".ply", "ply\r\nformat ascii 1.0\r\ncomment x\r\nelement vertex 5\r\nproperty float "
                 "x\r\nproperty float y\r\n"
                 "property float z\r\nelement face 2\r\nproperty list uchar int "
                 "vertex_indices\r\nend_header\r\n"
                 "0 0 0\r\n1 0 0\r\n1 2 0\r\n0 2 0\r\n.5 1 -3.25\r\n4 0 1 2 3\r\n3 1 0 4"},
        {".ply", "ply\nformat ascii 1.0\nobj_info a b\nelement camera 2\nproperty list int float "
                 "a\nproperty char b\n"
                 "element nothing 2000000000\nelement face 2\nproperty uchar red\nproperty list "
                 "uint8 uint32 vertex_index\n"
                 "property list uchar float texcoord\nelement vertex 5\nproperty float "
                 "nx\nproperty double z\n"
                 "property float64 y\nproperty float x\nproperty int32 q\nend_header\n"
                 "3 nan inf 7 -1\n0 -2\n255 4 0 1 2 3 2 0.5 0.5\n\n0 3 1 0 4 0\n"
                 "nan 0 0 0 1 nan 0 0 1 1 nan 0 2 1 1\nnan 0 2 0 1\nnan -3.25 1 5e-1 1\n"},
        {".obj", "# c\nmtllib a.mtl\no thing\nv 0 0 0\nv 1 0 0 # tail\nv 1 2 0 1.0\nvn 0 0 1\nvt 0 "
                 "0\nf 1/1/1 2/1/1 3//1 4\n"
                 "v 0 2 0\nv 0.5 1 -3.25\nl 1 2\nf -4 -5 \\\n -1\n"},
        {".obj", "f 1 2 3 4\nf 2 1 5\nv 0 0 0\nv 1 0 0\nv 1 2 0\nv 0 2 0\nv 0.5 1 -3.25"},
        {".off",
         "OFF\n# c\n5 2 0\n0 0 0\n1 0 0\n1 2 0\n0 2 0\n0.5 1 -3.25\n4 0 1 2 3 255 0 0\n3  1 0 4\n"},
        {".off", "COFF 5 2 7\n\n0 0 0 1 1 1 1\n1 0 0 1 1 1 1\n1 2 0 1 1 1 1\n0 2 0 1 1 1 1\n+5E-1 "
                 "1 -3.25 1 1 1 1\n4 0 "
                 "1 2 3\n3 1 0 4"},
        {".stl", "solid two words\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 1 "
                 "-0 0\n   vertex 1 2 0\n"
                 "  endloop\n endfacet\nfacet normal nan nan nan\nouter loop\nvertex -0.0 0 "
                 "0\nvertex 1 2 0\nvertex 0 2 0\n"
                 "endloop\nendfacet\nfacet normal 0 0 0\nouter loop\nvertex 1 0 0\nvertex 0 0 "
                 "0\nvertex 0.5 1 -3.25\nendloop\n"
                 "endfacet\nendsolid two words\n"},
        {".stl", "SOLID\nFACET NORMAL 0 0 1\nOUTER LOOP\nVERTEX 0 0 0\nVERTEX 1 0 0\nVERTEX 1 2 "
                 "0\nENDLOOP\nENDFACET\n"
                 "Facet Normal 0 0 1\nOuter Loop\nVertex 0 0 0\nVertex 1 2 0\nVertex 0 2 "
                 "0\nEndLoop\nEndFacet\n"
                 "FACET NORMAL 0 0 1\nOUTER LOOP\nVERTEX 1 0 0\nVERTEX 0 0 0\nVERTEX 5E-1 1 "
                 "-3.25\nENDLOOP\nENDFACET\n"
                 "ENDSOLID\n"},
    };
    static const char *const before[] = {"", "\xEF\xBB\xBF", "\xEF\xBB\xBF \r\n\n"};
    for (size_t i = 0; i < sizeof file / sizeof *file; i++) {
        // The file as it is, after a UTF-8 byte order mark, and after a mark and blank lines.
        for (int k = 0; k < 3; k++) {
            sdm_mesh m = {0};
            sdm_error err = {0};
            char text[1024];
            assert_in_range(snprintf(text, sizeof text, "%s%s", before[k], file[i].text), 1,
                            sizeof text - 1);
            const sdm_status s = read_text(file[i].ext, text, &m, &err);
            if (s) print_error("dialect %zu %d: %s\n", i, k, err.text);
            assert_int_equal(s, SDM_OK);
            check_pyramid(&m);
            sdm_mesh_dispose(&m);
        }
    }
}

/* Appends an integer of `size` bytes. */
static size_t int_append(unsigned char *p, size_t at, size_t size, bool big, uint64_t v)
{
    for (size_t i = 0; i < size; i++)
        p[at + i] = (unsigned char)(v >> 8 * (big ? size - 1 - i : i));
    return at + size;
}

static size_t real_append(unsigned char *p, size_t at, size_t size, bool big, double v)
{
    uint64_t bits;
    uint32_t single;
    const float f = (float)v;
    memcpy(&bits, &v, 8);
    memcpy(&single, &f, 4);
    return int_append(p, at, size, big, size == 4 ? single : bits);
}

/* The pyramid as binary PLY, with mixed types and with properties that a reader must skip. */
static size_t binary_ply(unsigned char *p, bool big)
{
    size_t n = (size_t)sprintf((char *)p,
                               "ply\nformat binary_%s_endian 1.0\nelement vertex 5\nproperty short "
                               "x\nproperty list ushort short s\n"
                               "property float y\nproperty double z\nproperty uchar red\nelement "
                               "face 2\nproperty int flag\n"
                               "property list uint ushort vertex_indices\nend_header\n",
                               big ? "big" : "little");
    for (int i = 0; i < 5; i++) {
        n = int_append(p, n, 2, big, (uint64_t)(2 * pyramid[i][0]));
        n = int_append(p, n, 2, big, (uint64_t)(i % 3));
        for (int k = 0; k < i % 3; k++) n = int_append(p, n, 2, big, 0xFFFF);
        n = real_append(p, n, 4, big, pyramid[i][1]);
        n = real_append(p, n, 8, big, pyramid[i][2]);
        p[n++] = 200;
    }
    static const unsigned face[2][5] = {{4, 0, 1, 2, 3}, {3, 1, 0, 4, 0}};
    for (int i = 0; i < 2; i++) {
        n = int_append(p, n, 4, big, 0x80000000u);
        n = int_append(p, n, 4, big, face[i][0]);
        for (unsigned k = 1; k <= face[i][0]; k++) n = int_append(p, n, 2, big, face[i][k]);
    }
    return n;
}

static void test_binary_ply(void **state)
{
    (void)state;
    for (int big = 0; big < 2; big++) {
        unsigned char file[1024];
        sdm_mesh m = {0};
        sdm_error err;
        const size_t n = binary_ply(file, big);
        file_save(file_name(".PLY"), file, n);
        assert_int_equal(sdm_mesh_read(file_name(".PLY"), &m, &err), SDM_OK);
        for (size_t i = 0; i < 5; i++) /* The file stores 2 x, which is an integer. */
            m.vert[3 * i] /= 2;
        check_pyramid(&m);
        sdm_mesh_dispose(&m);
    }
}

/* A binary STL whose header begins with "solid", like a text STL: the length of the file
 * decides. */
static void test_binary_stl(void **state)
{
    (void)state;
    unsigned char file[84 + 150] = "solid but binary";
    int_append(file, 80, 4, false, 3);
    for (size_t t = 0; t < 3; t++)
        for (size_t c = 0; c < 3; c++)
            for (size_t d = 0; d < 3; d++)
                real_append(file, 84 + 50 * t + 12 + 12 * c + 4 * d, 4, false,
                            pyramid[fans[t][c]][d]);
    real_append(file, 84 + 50 + 12, 4, false, -0.0);
    file_save(file_name(".stl"), file, sizeof file);
    sdm_mesh m = {0};
    sdm_error err;
    assert_int_equal(sdm_mesh_read(file_name(".stl"), &m, &err), SDM_OK);
    check_pyramid(&m);
    sdm_mesh_dispose(&m);
}

/* The bytes written, compared with the format by hand. */
static void test_written_bytes(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    sdm_error err;
    size_t size;
    tetrahedron_make(&m, true);
    assert_int_equal(sdm_mesh_write(file_name(".ply"), &m, &err), SDM_OK);
    unsigned char *data = file_load(file_name(".ply"), &size);
    const size_t body = size - 5 * 24 - 5 * 13;
    assert_memory_equal(data + body - 11, "end_header\n", 11);
    double x;
    /* y of vertex 1; the tests run on little-endian machines only. */
    memcpy(&x, data + body + 24 + 8, 8);
    assert_memory_equal(&x, &m.vert[4], 8);
    static const unsigned char last[13] = {3, 3, 0, 0, 0, 2, 0, 0, 0, 4, 0, 0, 0};
    assert_memory_equal(data + size - 13, last, 13);
    free(data);
    assert_int_equal(sdm_mesh_write(file_name(".stl"), &m, &err), SDM_OK);
    data = file_load(file_name(".stl"), &size);
    assert_int_equal(size, 84 + 250);
    float normal[3], v[3][3];
    memcpy(normal, data + 84, 12);
    memcpy(v, data + 96, 36);
    double dot[2] = {0}, length = 0;
    for (int d = 0; d < 3; d++) {
        dot[0] += (double)normal[d] * (double)(v[1][d] - v[0][d]);
        dot[1] += (double)normal[d] * (double)(v[2][d] - v[0][d]);
        length += (double)normal[d] * (double)normal[d];
    }
    assert_true(fabs(length - 1) < 1e-5 && fabs(dot[0]) < 1e-4 && fabs(dot[1]) < 1e-4);
    free(data);
    sdm_mesh_dispose(&m);
}

#define PLY_HEAD                                                                                   \
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float " \
    "z\n"
#define PLY_FACE "element face 1\nproperty list uchar int vertex_indices\nend_header\n"

static void test_mistakes_are_named(void **state)
{
    (void)state;
    static const struct {
        const char *ext, *text, *said;
    } file[] = {
        {".ply", "", ":1: not a PLY"},
        {".ply", "ply\nformat ascii 1.0\n", ":2: the file ends inside"},
        {".ply", "ply\nelement vertex 4294967296\n", ":2: number of elements 4294967296"},
        {".ply", "ply\nelement vertex -1\n", ":2: number of elements -1"},
        {".ply", "ply\nelement vertex 3\nelement vertex 3\n", ":3: a second element 'vertex'"},
        {".ply", "ply\nproperty float x\n", ":2: a property before"},
        {".ply", "ply\nelement vertex 3\nproperty list float int x\n", ":3: the property's type"},
        {".ply", "ply\nelement vertex 3\nproperty float x\nproperty float x\n",
         ":4: a second property 'x'"},
        {".ply", "ply\nelement vertex 3\nproperty float x\nend_header\n",
         ":4: the header names no format"},
        {".ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nend_header\n",
         ":5: no element 'vertex' with x"},
        {".ply", PLY_HEAD "element face 1\nend_header\n", "no list 'vertex_indices'"},
        {".ply", PLY_HEAD PLY_FACE "0 0 0 1 0 0\n0 1 nan\n3 0 1 2\n", ":11: not a finite number"},
        {".ply", PLY_HEAD PLY_FACE "0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", ":13: a vertex index outside"},
        {".ply", PLY_HEAD PLY_FACE "0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n",
         ":13: a vertex index outside"},
        {".ply", PLY_HEAD PLY_FACE "0 0 0\n1 0 0\n0 1 0\n2 0 1\n",
         ":13: a face of less than three"},
        {".ply", PLY_HEAD PLY_FACE "0 0 0\n1 0 0\n0 1 0\n99999 0 1\n", ":13: a list longer"},
        {".ply", PLY_HEAD PLY_FACE "0 0 0\n1 0 0\n0 1 0\n3 0 1\n", ":13: a list longer"},
        {".ply", PLY_HEAD PLY_FACE "0 0 0\n1 0 0\n0 1 0\n", ":12: more elements declared"},
        {".ply",
         "ply\nformat ascii 1.0\nelement vertex 2000000000\nproperty float x\nproperty float "
         "y\nproperty float "
         "z\nend_header\n1 2 3\n",
         "more elements declared"},
        {".ply",
         "ply\nformat binary_big_endian 1.0\nelement vertex 2000000000\nproperty float x\nproperty "
         "float y\nproperty "
         "float z\n"
         "end_header\n123456789012",
         "more elements declared"},
        {".ply", PLY_HEAD PLY_FACE "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n3 0 2 1\n",
         ":14: more elements than the header declares"},
        {".ply",
         "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty uchar x\nproperty uchar "
         "y\nproperty uchar z\nend_header\nabcdefg",
         "4 bytes behind the last element"},
        {".off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n3 0 2 1\n",
         ":7: more lines than 3 vertices and 1 polygons"},
        {".off", "OF\n", ":1: not an OFF"},
        {".off", "OFF\n2000000000 1 0\n0 0 0\n", "cannot fit"},
        {".off", "OFF\n3 1 0\n0 0 0\n1 0\n", ":4: 2 numbers on the line"},
        {".off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n", "ends before its last polygon"},
        {".off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n",
         ":6: vertex index 3 is outside 0 .. 2"},
        {".off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n2 0 1\n", ":6: polygon of 2"},
        {".off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1e999 0\n3 0 1 2\n", ":5: '1e999' is not a finite"},
        {".obj", "hello\n", "not an OBJ"},
        {".obj", "v 0 0 0\nv 0 0\n", ":2: 2 numbers"},
        {".obj", "v 0 0 0\nf 1 2\n", ":2: face of 2"},
        {".obj", "v 0 0 0\nf 1 0 1\n", ":2: '0' is not the number"},
        {".obj", "v 0 0 0\nf 1 -2 1\n", ":2: '-2' is not the number"},
        {".obj", "v 0 0 0\nf 1 1 2\n\n", ":2: vertex 2 of 1"},
        {".obj", "v 0 0 0\nf 1 1 99999999999999999999\n", ":2: '99999999999999999999'"},
        {".stl", "hello", "too short"},
        {".stl", "solid a\nfacet normal 0 0 0\nvertex 0 0 0\nendfacet\nendsolid\n",
         ":4: facet of 1"},
        {".stl", "solid a\nvertex 0 0 0\n", ":2: vertex outside"},
        {".stl", "solid a\nfacet normal 0 0 0\nfacet normal 0 0 0\n", ":3: facet inside"},
        {".stl", "solid a\nfacet normal 0 0 0\n", ":2: the file ends before 'endsolid'"},
        {".stl", "solid a\nwhat\n", ":2: 'what' is not a word"},
        {".stl",
         "01234567890123456789012345678901234567890123456789012345678901234567890123456789\x01\x01"
         "\x01\x01xyz",
         "facets need"},
    };
    for (size_t i = 0; i < sizeof file / sizeof *file; i++) {
        sdm_mesh m = {0};
        sdm_error err = {0};
        const sdm_status s = read_text(file[i].ext, file[i].text, &m, &err);
        if (s != SDM_E_FORMAT || !strstr(err.text, file[i].said))
            print_error("mistake %zu: %d %s\n", i, s, err.text);
        assert_int_equal(s, SDM_E_FORMAT);
        assert_non_null(strstr(err.text, file[i].said));
        assert_non_null(strstr(err.text, file_name(file[i].ext)));
        assert_null(m.vert);
    }
}

/* Reads any file: either a mesh with valid indices and finite coordinates, or an error and an
 * empty mesh. */
static void file_check(const char *path)
{
    sdm_mesh m = {0};
    sdm_error err;
    const sdm_status s = sdm_mesh_read(path, &m, &err);
    assert_true(s == SDM_OK || s == SDM_E_FORMAT || s == SDM_E_UNSUPPORTED);
    if (s) assert_null(m.vert);
    if (s == SDM_OK) {
        for (size_t i = 0; i < 3 * m.n_vert; i++) assert_true(isfinite(m.vert[i]));
        for (size_t i = 0; i < 3 * m.n_tri; i++) assert_true(m.tri[i] < m.n_vert);
    }
    sdm_mesh_dispose(&m);
}

static void test_damaged_files_are_safe(void **state)
{
    (void)state;
    for (size_t f = 0; f < 6; f++) {
        unsigned char small[1024], *data = small;
        size_t size = 0;
        const char *ext = f < 4 ? extensions[f] : ".ply";
        sdm_mesh m = {0};
        tetrahedron_make(&m, true);
        assert_int_equal(sdm_mesh_write(file_name(ext), &m, NULL), SDM_OK);
        sdm_mesh_dispose(&m);
        if (f < 4)
            data = file_load(file_name(ext), &size);
        else
            size = binary_ply(small, f == 5);
        for (size_t n = 0; n < size; n++) {
            file_save(file_name(ext), data, n);
            file_check(file_name(ext));
        }
        for (uint64_t i = 0; i < 400; i++) {
            const size_t at = (size_t)sdm_rng_below(f, 2, 2 * i, size);
            const unsigned char old = data[at];
            data[at] = (unsigned char)sdm_rng_below(f, 2, 2 * i + 1, 256);
            file_save(file_name(ext), data, size);
            file_check(file_name(ext));
            data[at] = old;
        }
        if (f < 4) free(data);
    }
}

static void test_each_allocation_may_fail(void **state)
{
    (void)state;
    for (size_t f = 0; f < 4; f++) {
        sdm_mesh m = {0};
        tetrahedron_make(&m, true);
        assert_int_equal(sdm_mesh_write(file_name(extensions[f]), &m, NULL), SDM_OK);
        sdm_mesh_dispose(&m);
        unsigned long n = 1;
        for (;; n++) {
            sdm_alloc_fail_after(n);
            const sdm_status s = sdm_mesh_read(file_name(extensions[f]), &m, NULL);
            sdm_alloc_fail_after(0);
            if (s == SDM_OK) break;
            assert_int_equal(s, SDM_E_NOMEM);
            assert_null(m.vert);
        }
        assert_true(n > 2);
        sdm_mesh_dispose(&m);
    }
}

static void test_wrong_arguments_are_refused(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    sdm_error err;
    assert_int_equal(sdm_mesh_read(NULL, &m, &err), SDM_E_ARG);
    assert_int_equal(sdm_mesh_read("a.ply", NULL, &err), SDM_E_ARG);
    assert_int_equal(sdm_mesh_read("no_such_file.ply", &m, &err), SDM_E_IO);
    assert_int_equal(sdm_mesh_read("a.step", &m, &err), SDM_E_UNSUPPORTED);
    assert_non_null(strstr(err.text, ".off"));
    assert_int_equal(sdm_mesh_read(".ply", &m, &err), SDM_E_UNSUPPORTED);
    tetrahedron_make(&m, true);
    assert_int_equal(sdm_mesh_write(NULL, &m, &err), SDM_E_ARG);
    assert_int_equal(sdm_mesh_write("a.ply", NULL, &err), SDM_E_ARG);
    assert_int_equal(sdm_mesh_write("no_such_folder/a.ply", &m, &err), SDM_E_IO);
    assert_int_equal(sdm_mesh_write("a.vrml", &m, &err), SDM_E_UNSUPPORTED);
    m.tri[7] = 5;
    assert_int_equal(sdm_mesh_write("test_meshfile_bad.ply", &m, &err), SDM_E_MESH);
    m.tri[7] = 0;
    m.vert[3] = 1e300;
    assert_int_equal(sdm_mesh_write("test_meshfile_bad.stl", &m, &err), SDM_E_MESH);
    m.vert[3] = NAN;
    assert_int_equal(sdm_mesh_write("test_meshfile_bad.ply", &m, &err), SDM_E_MESH);
    assert_null(fopen("test_meshfile_bad.ply", "rb"));
    assert_null(fopen("test_meshfile_bad.stl", "rb"));
    sdm_mesh_dispose(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_round_trip),
        cmocka_unit_test(test_text_variants),
        cmocka_unit_test(test_binary_ply),
        cmocka_unit_test(test_binary_stl),
        cmocka_unit_test(test_written_bytes),
        cmocka_unit_test(test_mistakes_are_named),
        cmocka_unit_test(test_damaged_files_are_safe),
        cmocka_unit_test(test_each_allocation_may_fail),
        cmocka_unit_test(test_wrong_arguments_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
