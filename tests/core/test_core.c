/* The core library: status and error texts, memory, random numbers, checksums, files, text,
 * threads, grids.
 * Tests: checksum.c file.c foreign.c grid.c json.c memory.c rng.c status.c text.c threads.c */
#include <limits.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "sdm/grid.h"
#include "sdm/internal/checksum.h"
#include "sdm/internal/file.h"
#include "sdm/internal/foreign.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/near.h"
#include "sdm/internal/rng.h"
#include "sdm/internal/text.h"
#include "sdm/internal/threads.h"

static void errors_have_text_and_prefix(void **state)
{
    (void)state;
    sdm_error e;
    assert_int_equal(sdm_fail(&e, SDM_E_MESH, "radius %d", 3), SDM_E_MESH);
    assert_string_equal(e.text, "radius 3");
    assert_int_equal(sdm_fail_in(&e, SDM_E_IO, "file %s", "a"), SDM_E_IO);
    assert_string_equal(e.text, "file a: radius 3");
    assert_int_equal(sdm_fail(NULL, SDM_E_ARG, "unheard"), SDM_E_ARG);
    // Text that does not fit is cut, also when a prefix is added.
    memset(e.text, 'x', sizeof e.text - 1);
    e.text[sizeof e.text - 1] = '\0';
    sdm_fail_in(&e, SDM_E_IO, "prefix");
    assert_int_equal(strlen(e.text), sizeof e.text - 1);
    assert_memory_equal(e.text, "prefix: xxx", 11);
    for (int s = 0; s <= SDM_E_INTERNAL; s++)
        assert_string_not_equal(sdm_status_name((sdm_status)s), "unknown");
}

static void allocation_errors_are_reported(void **state)
{
    (void)state;
    sdm_error e;
    void *p;
    size_t n;
    assert_int_equal(sdm_alloc(&p, SIZE_MAX / 2, 3, "block", &e), SDM_E_NOMEM);
    assert_non_null(strstr(e.text, "block"));
    assert_null(p);
    assert_int_equal(sdm_mul(SIZE_MAX, 2, &n, &e), SDM_E_NOMEM);
    assert_int_equal(sdm_mul(3, 5, &n, &e), SDM_OK);
    assert_int_equal(n, 15);
    assert_int_equal(sdm_alloc(&p, 0, 8, "empty", &e), SDM_OK);
    assert_int_equal((uintptr_t)p % 64, 0);
    sdm_free(p);
    assert_int_equal(sdm_alloc_unset(&p, SIZE_MAX / 2, 3, "unset block", &e), SDM_E_NOMEM);
    assert_non_null(strstr(e.text, "unset block"));
    assert_null(p);
    sdm_alloc_fail_after(1);
    assert_int_equal(sdm_alloc_unset(&p, 100, 8, "unset block", &e), SDM_E_NOMEM);
    sdm_alloc_fail_after(0);
    assert_int_equal(sdm_alloc_unset(&p, 100, 8, "unset block", &e), SDM_OK);
    assert_int_equal((uintptr_t)p % 64, 0);
    memset(p, 1, 800);
    sdm_free(p);
    double *v;
    assert_int_equal(SDM_ALLOC(&v, 3, "v", &e), SDM_OK);
    assert_true(v[0] == 0 && v[2] == 0);
    v[2] = 7;
    assert_int_equal(sdm_grow((void **)&v, 3, 100, sizeof *v, "v", &e), SDM_OK);
    assert_true(v[2] == 7 && v[99] == 0);
    sdm_alloc_fail_after(1);
    assert_int_equal(sdm_grow((void **)&v, 100, 200, sizeof *v, "v", &e), SDM_E_NOMEM);
    assert_true(v[2] == 7); // the old array is still valid
    sdm_alloc_fail_after(0);
    sdm_free(v);
}

// Known answers for Philox4x32-10, published by its authors (Salmon et al. 2011).
static void philox_known_answers(void **state)
{
    (void)state;
    // First number of SplitMix64 for seed 0.
    assert_true(sdm_mix64(0x9e3779b97f4a7c15u) == 0xe220a8397b1dcdafu);
    uint32_t r[4];
    sdm_rng_block(0, 0, 0, r);
    const uint32_t zeros[4] = {0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8};
    assert_memory_equal(r, zeros, sizeof r);
    sdm_rng_block(UINT64_MAX, UINT64_MAX, UINT64_MAX, r);
    const uint32_t ones[4] = {0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd};
    assert_memory_equal(r, ones, sizeof r);
}

static void random_numbers_have_their_distribution(void **state)
{
    (void)state;
    const int n = 20000;
    double sum = 0, square = 0, normal = 0, normal2 = 0;
    int below[7] = {0};
    for (int i = 0; i < n; i++) {
        const double u = sdm_rng_uniform(5, 1, (uint64_t)i), z = sdm_rng_normal(5, 2, (uint64_t)i);
        assert_true(u >= 0 && u < 1);
        sum += u, square += u * u, normal += z, normal2 += z * z;
        below[sdm_rng_below(5, 3, (uint64_t)i, 7)]++;
    }
    // Each bound is five standard errors.
    assert_true(fabs(sum / n - 0.5) < 5 * 0.289 / sqrt(n));
    assert_true(fabs(square / n - 1.0 / 3) < 5 * 0.298 / sqrt(n));
    assert_true(fabs(normal / n) < 5 / sqrt(n));
    assert_true(fabs(normal2 / n - 1) < 5 * 1.414 / sqrt(n));
    for (int i = 0; i < 7; i++) assert_true(fabs(below[i] - n / 7.0) < 5 * sqrt(n / 7.0));
    assert_true(sdm_rng_below(1, 1, 1, UINT64_C(1) << 40) < UINT64_C(1) << 40);
}

static void crc_known_answer(void **state)
{
    (void)state;
    // Published check value of CRC-64/XZ.
    assert_true(sdm_crc64(0, "123456789", 9) == UINT64_C(0x995DC9BBDF1939FA));
    uint8_t data[100];
    for (int i = 0; i < 100; i++) data[i] = (uint8_t)(i * 37);
    for (size_t cut = 0; cut <= 100; cut += 9)
        assert_true(sdm_crc64(sdm_crc64(0, data, cut), data + cut, 100 - cut) ==
                    sdm_crc64(0, data, 100));
}

static void numbers_and_names_are_parsed(void **state)
{
    (void)state;
    double v;
    int64_t i;
    char buf[32];
    assert_true(sdm_parse_real("-1.5e3", &v) && v == -1500);
    for (const char *const *bad = (const char *const[]){"", "nan", "inf", "1e999", "1x", " 1",
                                                        "0x10", "1,5", "--1", NULL};
         *bad; bad++)
        assert_false(sdm_parse_real(*bad, &v));
    char hint[64];
    assert_string_equal(sdm_comma_hint("-1,5", hint), "; a decimal number has a point: -1.5");
    for (const char *const *other =
             (const char *const[]){"", "1.5", "1,5,2", ",5", "5,", "a,b", "1,5 mm", NULL};
         *other; other++)
        assert_string_equal(sdm_comma_hint(*other, hint), "");
    assert_true(sdm_parse_int("-9223372036854775808", &i) && i == INT64_MIN);
    assert_true(sdm_parse_int("9223372036854775807", &i) && i == INT64_MAX);
    for (const char *const *bad = (const char *const[]){"", "-", "1.0", "9223372036854775808",
                                                        "-9223372036854775809", "1 ", NULL};
         *bad; bad++)
        assert_false(sdm_parse_int(*bad, &i));
    for (int k = 0; k < 1000; k++) {
        const double x = sdm_rng_normal(1, 1, (uint64_t)k) * pow(10, k % 40 - 20);
        assert_true(sdm_parse_real(sdm_format_real(x, buf), &v) && v == x);
    }
    assert_string_equal(sdm_format_real(0.2, buf), "0.2");
    assert_string_equal(sdm_format_real(20, buf), "20");
    assert_string_equal(sdm_format_real(-3000, buf), "-3000");
    const char *const names[] = {"depth", "width", "rank"};
    assert_string_equal(sdm_nearest_name("dpeth", names, 3), "depth");
    assert_string_equal(sdm_nearest_name("withd", names, 3), "width");
    assert_null(sdm_nearest_name("colour", names, 3));
    // no words that only share letters
    const char *const options[] = {"part", "quiet", "dense", "find"};
    assert_null(sdm_nearest_name("start", options, 4));
    assert_null(sdm_nearest_name("budget", options, 4));
    assert_null(sdm_nearest_name("center", options, 4));
    assert_null(sdm_nearest_name("fix", options, 4));
    const char *const lengths[] = {"size", "spacing"};
    assert_string_equal(sdm_nearest_name("space", lengths, 2), "spacing");
    const char *const parts[] = {"height", "head_radius"};
    assert_string_equal(sdm_nearest_name("head", parts, 2), "head_radius");
    assert_null(sdm_nearest_name("he", parts, 2));

    // lists of names, cut to the room
    char list[64];
    assert_string_equal(sdm_list_names(names, 3, list, sizeof list), "depth, width, rank");
    assert_string_equal(sdm_list_names(names, 3, list, 16), "depth, ...");
    assert_string_equal(sdm_list_names(names, 0, list, sizeof list), "");

    // names of shapes, parameters and options
    assert_true(sdm_is_name("a") && sdm_is_name("a_1"));
    char longest[65] = "a";
    memset(longest, 'z', 63);
    assert_true(sdm_is_name(longest));
    longest[63] = 'z';
    assert_false(sdm_is_name(longest));
    static const char *const no_names[] = {NULL, "", "A", "1a", "_a", "a-b", "a b", "\xc3\xa9"};
    for (size_t k = 0; k < sizeof no_names / sizeof *no_names; k++)
        assert_false(sdm_is_name(no_names[k]));
}

static void range_mistakes_have_one_text(void **state)
{
    (void)state;
    sdm_error err = {0};
    assert_int_equal(sdm_fail_range("a", 9.5, 2, 5, "mm", &err), SDM_E_RANGE);
    assert_string_equal(err.text, "parameter 'a' = 9.5 mm, allowed 2 .. 5 mm");
    sdm_fail_range("b", NAN, -1, 0.25, "", &err);
    assert_string_equal(err.text, "parameter 'b' = nan, allowed -1 .. 0.25");
    assert_int_equal(sdm_fail_range("b", INFINITY, -1, 0.25, "", NULL), SDM_E_RANGE);
    sdm_fail_range("a", 0.0042, 2, 5, "mm", &err);
    assert_string_equal(err.text, "parameter 'a' = 0.0042 mm, allowed 2 .. 5 mm; was it given in "
                                  "metres? It needs mm: a=4.2");
    sdm_fail_range("angle", 15, -1, 1, "rad", &err);
    assert_string_equal(err.text,
                        "parameter 'angle' = 15 rad, allowed -1 .. 1 rad; was it given in "
                        "degrees? It needs rad: angle=0.2618");
}

/* A length that is a thousand times too small or too large may be in another unit. */
static void another_unit_is_asked_for(void **state)
{
    (void)state;
    static const double metres[][3] = {{0.003, 2, 5},
                                       {0.006, 2, 5},
                                       {0.0015, 2, 5},
                                       {-3e-3, -5, -2}},
                        micrometres[][3] = {{3000, 2, 5}, {-3000, -5, 5}},
                        neither[][3] = {{0.03, 2, 5}, {3e-4, 2, 5},  {50, 2, 5},  {5.5, -5, 5},
                                        {3, 2, 5},    {1e300, 2, 5}, {NAN, 2, 5}, {INFINITY, 2, 5}};
    for (size_t k = 0; k < 4; k++)
        assert_non_null(
            strstr(sdm_unit_question(metres[k][0], metres[k][1], metres[k][2], "mm"), "in metres"));
    for (size_t k = 0; k < 2; k++)
        assert_non_null(
            strstr(sdm_unit_question(micrometres[k][0], micrometres[k][1], micrometres[k][2], "mm"),
                   "in micrometres"));
    for (size_t k = 0; k < sizeof neither / sizeof *neither; k++)
        assert_string_equal(sdm_unit_question(neither[k][0], neither[k][1], neither[k][2], "mm"),
                            "");
    assert_string_equal(sdm_unit_question(0.003, 2, 5, "rad"), "");
    static const double angles[][4] = {{15, -1, 1, 1},   {-30, -1, 1, 1},      {300, 0, 6.2832, 1},
                                       {1.2, -1, 1, 0},  {90, -1, 1, 0},       {-15, 0, 1, 0},
                                       {7, 0, 6.283, 0}, {1e4, -1000, 180, 0}, {NAN, 0, 1, 0}};
    for (size_t k = 0; k < sizeof angles / sizeof *angles; k++)
        assert_true(!*sdm_unit_question(angles[k][0], angles[k][1], angles[k][2], "rad") ==
                    !(angles[k][3] > 0));
}

static void json_text_is_escaped(void **state)
{
    (void)state;
    sdm_json j = {0};
    sdm_json_open(&j, NULL, '{');
    sdm_json_text(&j, "a", "q\"\\\n\x01");
    sdm_json_open(&j, "b", '[');
    sdm_json_int(&j, NULL, -3);
    sdm_json_uint(&j, NULL, UINT64_MAX);
    sdm_json_real(&j, NULL, 0.1);
    sdm_json_real(&j, NULL, NAN);
    sdm_json_close(&j, ']');
    sdm_json_bool(&j, "c", true);
    sdm_json_close(&j, '}');
    assert_string_equal(j.text.data, "{\"a\": \"q\\\"\\\\\\n\\u0001\", \"b\": [-3, "
                                     "18446744073709551615, 0.1, null], \"c\": true}");
    sdm_json_dispose(&j);
}

static void files_are_written_whole_or_not(void **state)
{
    (void)state;
    sdm_error e;
    char folder[] = "core_XXXXXX", path[64], deep[64];
    assert_non_null(mkdtemp(folder));
    snprintf(path, sizeof path, "%s/f", folder);
    snprintf(deep, sizeof deep, "%s/a/b/c", folder);
    assert_int_equal(sdm_make_folder(deep, &e), SDM_OK);
    assert_int_equal(sdm_make_folder(deep, &e), SDM_OK);

    // The final name appears only at commit; a discard keeps the old content.
    sdm_outfile *f;
    assert_int_equal(sdm_outfile_open(path, &f, &e), SDM_OK);
    assert_int_equal(sdm_outfile_printf(f, &e, "%d", 42), SDM_OK);
    assert_int_equal(access(path, F_OK), -1);
    assert_int_equal(sdm_outfile_commit(&f, &e), SDM_OK);
    assert_null(f);
    assert_int_equal(sdm_outfile_open(path, &f, &e), SDM_OK);
    assert_int_equal(sdm_outfile_write(f, "other", 5, &e), SDM_OK);
    char temp[128];
    snprintf(temp, sizeof temp, "%s", sdm_outfile_temp_path(f));
    sdm_outfile_discard(&f);
    assert_int_equal(access(temp, F_OK), -1);
    uint8_t *data;
    size_t size;
    assert_int_equal(sdm_file_read(path, 100, &data, &size, &e), SDM_OK);
    assert_int_equal(size, 2);
    assert_string_equal((char *)data, "42");
    sdm_free(data);
    uint64_t crc;
    assert_int_equal(sdm_file_checksum(path, &crc, &e), SDM_OK);
    assert_true(crc == sdm_crc64(0, "42", 2));
    assert_int_equal(sdm_file_checksum(folder, &crc, &e), SDM_E_IO);

    // files that end with their own CRC-64: it tells them apart, the CRC-64 of all bytes does not
    for (uint64_t k = 0; k < 3; k++) {
        uint8_t whole[20] = "content ....";
        whole[9] = (uint8_t)k;
        const uint64_t own = sdm_crc64(0, whole, 12);
        for (int i = 0; i < 8; i++) whole[12 + i] = (uint8_t)(own >> (8 * i));
        assert_true(sdm_crc64(0, whole, 20) == SDM_CRC64_WITH_OWN);
        assert_true(sdm_content_checksum(whole, 20) == own);
        whole[12] ^= 1;
        assert_true(sdm_content_checksum(whole, 20) == sdm_crc64(0, whole, 20));
    }

    // Two writers of the same name: both files are whole, and the last commit wins.
    for (int last = 0; last < 2; last++) {
        sdm_outfile *two[2];
        for (int i = 0; i < 2; i++) assert_int_equal(sdm_outfile_open(path, &two[i], &e), SDM_OK);
        for (int i = 0; i < 200000; i++) {
            assert_int_equal(sdm_outfile_write(two[0], "a", 1, &e), SDM_OK);
            if (i % 2) assert_int_equal(sdm_outfile_write(two[1], "b", 1, &e), SDM_OK);
        }
        for (int i = 0; i < 2; i++) {
            const int which = i ? last : !last;
            assert_int_equal(sdm_outfile_commit(&two[which], &e), SDM_OK);
            assert_int_equal(sdm_file_read(path, 200000, &data, &size, &e), SDM_OK);
            assert_int_equal(size, which ? 100000 : 200000);
            for (size_t k = 0; k < size; k++) assert_int_equal(data[k], "ab"[which]);
            sdm_free(data);
        }
    }
    // A symbolic link placed at the next temporary name is not followed.
    assert_int_equal(sdm_outfile_open(path, &f, &e), SDM_OK);
    unsigned long pid, number;
    assert_int_equal(sscanf(sdm_outfile_temp_path(f) + strlen(path), ".%lu.%lu.tmp", &pid, &number),
                     2);
    assert_int_equal(pid, getpid());
    sdm_outfile_discard(&f);
    snprintf(temp, sizeof temp, "%s.%lu.%lu.tmp", path, pid, number + 1);
    assert_int_equal(symlink("f", temp), 0);
    assert_int_equal(sdm_outfile_open(path, &f, &e), SDM_OK);
    assert_string_not_equal(sdm_outfile_temp_path(f), temp);
    sdm_outfile_discard(&f);
    assert_int_equal(sdm_file_read(path, 200000, &data, &size, &e), SDM_OK);
    assert_int_equal(size, 100000);
    sdm_free(data);
    assert_int_equal(remove(temp), 0);

    assert_int_equal(sdm_file_read(path, 1, &data, &size, &e), SDM_E_FORMAT);
    assert_int_equal(sdm_file_read("no such file", 1, &data, &size, &e), SDM_E_IO);
    assert_int_equal(sdm_file_read(folder, 1, &data, &size, &e), SDM_E_IO);
    assert_int_equal(sdm_outfile_open("no/such/folder/f", &f, &e), SDM_E_IO);
    assert_int_equal(sdm_outfile_open(folder, &f, &e), SDM_E_IO);
    assert_int_equal(sdm_make_folder(path, &e), SDM_E_IO);
    assert_int_equal(sdm_make_folder("", &e), SDM_E_ARG);
    remove(path);
    assert_int_equal(mkfifo(path, 0600), 0); // opening a pipe would block until a writer comes
    assert_int_equal(sdm_file_read(path, 1, &data, &size, &e), SDM_E_IO);
    // An output file must not replace a pipe.
    assert_int_equal(sdm_outfile_open(path, &f, &e), SDM_E_IO);
    assert_non_null(strstr(e.text, "pipe"));
    remove(path);
    remove(deep);
    snprintf(deep, sizeof deep, "%s/a/b", folder);
    remove(deep);
    snprintf(deep, sizeof deep, "%s/a", folder);
    remove(deep);
    assert_int_equal(remove(folder), 0); // fails unless the folder is empty
}

static void thread_counts_are_limited(void **state)
{
    (void)state;
    const int most = sdm_threads(1000000);
    assert_true(most == 1 || most >= 64); // a build without OpenMP has one thread
    assert_true(most <= 64 || most <= 2 * sysconf(_SC_NPROCESSORS_CONF));
    assert_int_equal(sdm_threads(INT_MAX), most);
    assert_int_equal(sdm_threads(3), most == 1 ? 1 : 3);
    assert_in_range(sdm_threads(0), 1, most);
    assert_int_equal(sdm_thread(), 0);
}

static void grids_convert_coordinates(void **state)
{
    (void)state;
    sdm_error e;
    const int64_t n[3] = {60, 50, 40};
    sdm_grid g = sdm_grid_centred(n, 0.2, (const double[]){1, 2, 3});
    assert_int_equal(sdm_grid_check(&g, &e), SDM_OK);
    assert_int_equal(sdm_grid_count(&g), 120000);
    size_t voxel = 0; // x is fastest
    for (int64_t z = 0; z < 40; z++)
        for (int64_t y = 0; y < 50; y++)
            for (int64_t x = 0; x < 60; x++) assert_int_equal(sdm_grid_voxel(&g, x, y, z), voxel++);
    double w[3], i[3];
    sdm_grid_world(&g, (const double[]){29.5, 24.5, 19.5}, w);
    assert_true(fabs(w[0] - 1) < 1e-12 && fabs(w[1] - 2) < 1e-12 && fabs(w[2] - 3) < 1e-12);
    const double c = cos(0.3), s = sin(0.3);
    memcpy(g.dir, (const double[]){c, -s, 0, s, c, 0, 0, 0, -1}, sizeof g.dir);
    g.spacing[1] = 0.5;
    assert_int_equal(sdm_grid_check(&g, &e), SDM_OK);
    sdm_grid_world(&g, (const double[]){3, 4, 5}, w);
    sdm_grid_index(&g, w, i);
    assert_true(fabs(i[0] - 3) < 1e-12 && fabs(i[1] - 4) < 1e-12 && fabs(i[2] - 5) < 1e-12);

    sdm_grid bad = g;
    bad.n[1] = 0;
    assert_int_equal(sdm_grid_check(&bad, &e), SDM_E_ARG);
    assert_non_null(strstr(e.text, "along y"));
    bad = g, bad.spacing[2] = NAN;
    assert_int_equal(sdm_grid_check(&bad, &e), SDM_E_ARG);
    bad = g, bad.origin[0] = INFINITY;
    assert_int_equal(sdm_grid_check(&bad, &e), SDM_E_ARG);
    bad = g, bad.dir[0] = 2;
    assert_int_equal(sdm_grid_check(&bad, &e), SDM_E_ARG);
    bad = g, bad.n[0] = bad.n[1] = bad.n[2] = 1 << 20;
    assert_int_equal(sdm_grid_check(&bad, &e), SDM_E_ARG);
}

/* gcc's OpenMP waits for ever in a child of a process that has used threads. */
static void a_child_has_one_thread(void **state)
{
    (void)state;
    const int before = sdm_threads(3);
    const pid_t child = fork();
    if (!child) _exit(sdm_threads(3) == 1 && sdm_threads(0) == 1 ? 0 : 1);
    int status = -1;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    assert_int_equal(sdm_threads(3), before);
}

static void voxels_on_the_surface_have_either_side(void **state)
{
    (void)state;
    static const float exact[] = {0, 1e-7f, -1e-7f, 4e-4f, -4e-4f};
    for (size_t i = 0; i < sizeof exact / sizeof *exact; i++) {
        assert_true(sdm_inside_beside(exact[i], -0.01f, 0.5f));
        assert_false(sdm_inside_beside(exact[i], 0.01f, 0.5f));
    }
    assert_true(sdm_inside_beside(-0.002f, 0.01f, 0.5f));
    assert_false(sdm_inside_beside(0.002f, -0.01f, 0.5f));
}

static void the_library_at_work_is_known(void **state)
{
    (void)state;
    assert_null(sdm_foreign_running().library);
    const sdm_foreign none = sdm_foreign_enter((sdm_foreign){"cairo", "x.png"});
    assert_null(none.library);
    // while it calls back it is not at work
    const sdm_foreign cairo = sdm_foreign_enter(none);
    assert_null(sdm_foreign_running().library);
    sdm_foreign_enter(cairo);
    assert_string_equal(sdm_foreign_running().library, "cairo");
    assert_string_equal(sdm_foreign_running().path, "x.png");
    sdm_foreign_enter(none);
    assert_null(sdm_foreign_running().library);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(errors_have_text_and_prefix),
        cmocka_unit_test(allocation_errors_are_reported),
        cmocka_unit_test(philox_known_answers),
        cmocka_unit_test(random_numbers_have_their_distribution),
        cmocka_unit_test(crc_known_answer),
        cmocka_unit_test(numbers_and_names_are_parsed),
        cmocka_unit_test(range_mistakes_have_one_text),
        cmocka_unit_test(another_unit_is_asked_for),
        cmocka_unit_test(json_text_is_escaped),
        cmocka_unit_test(files_are_written_whole_or_not),
        cmocka_unit_test(thread_counts_are_limited),
        cmocka_unit_test(the_library_at_work_is_known),
        cmocka_unit_test(a_child_has_one_thread),
        cmocka_unit_test(grids_convert_coordinates),
        cmocka_unit_test(voxels_on_the_surface_have_either_side),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
