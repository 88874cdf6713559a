/* The three formats of pictures (PNG, SVG, PDF): chosen by the ending, well-formed, text stored as
 * text, reproducible bytes, and no file left after a failure.
 * Tests: canvas.c drawer.c */
#include <dirent.h>
#include <math.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "sdm/internal/heap.h"
#include "sdm/internal/picture_child.h"
#include "sdm/picture.h"

enum { SIDE = 12 };

static bool in_child;

/* Writes one of the four kinds of picture, with titles that need escaping in XML. */
static sdm_status write_picture(int kind, const char *path, sdm_error *err)
{
    static float v[SIDE * SIDE * SIDE];
    static double vert[] = {2, 0, 0, -2, 0, 0, 0, 2, 0, 0, -2, 0, 0, 0, 2, 0, 0, -2};
    static uint32_t tri[] = {0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4,
                             2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5};
    static const double values[] = {1, -1, 0, 0.5, 0.2, -0.7}, x[] = {0, 1, 2, 3};
    static const float level = 0;
    const sdm_grid g = {
        .n = {SIDE, SIDE, SIDE}, .spacing = {1, 1, 1}, .dir = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    for (int i = 0; i < SIDE * SIDE * SIDE; i++)
        v[i] =
            (float)hypot(hypot(i % SIDE - 5.6, i / SIDE % SIDE - 5.7), i / SIDE / SIDE - 5.2) - 4;
    const sdm_picture_map maps[] = {{.title = "a < b & \"c\" > d", .values = v},
                                    {.title = "image7 #image7", .values = v, .error = true}};
    const sdm_mesh mesh = {.vert = vert, .tri = tri, .n_vert = 6, .n_tri = 8};
    const sdm_picture_surface surface = {"a < b & \"c\" > d", &mesh, values};
    const sdm_curve curve = {"a < b & \"c\" > d", x, x, 4};
    switch (kind) {
    case 0:
        return sdm_picture_slices(path, &g, maps, 2, &level, 1, err);
    case 1:
        return sdm_picture_overlay(path, &g, v, maps, 1, "\x01 title \xFF", err);
    case 2:
        return sdm_picture_surfaces(path, &surface, 1, "\xC2\xB5", err);
    default:
        return sdm_picture_plot(path, "plot", "x", "y", false, &curve, 1, err);
    }
}

/* The whole file, terminated by a zero byte. The caller frees it. */
static char *read_file(const char *path, size_t *size)
{
    FILE *f = fopen(path, "rb");
    assert_non_null(f);
    char *data = malloc(1 << 22);
    assert_non_null(data);
    *size = fread(data, 1, (1 << 22) - 1, f);
    data[*size] = 0;
    fclose(f);
    return data;
}

/* Fails the test unless elements nest, attributes are quoted, and no unescaped < or & occurs. */
static void check_xml(const char *at)
{
    char open[32][32];
    int depth = 0, elements = 0;
    assert_memory_equal(at, "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n", 39);
    at += 39;
    while (*at) {
        if (*at == '&') {
            assert_true(!strncmp(at, "&amp;", 5) || !strncmp(at, "&lt;", 4) ||
                        !strncmp(at, "&gt;", 4));
            at++;
        } else if (*at != '<') {
            assert_true(depth > 0 || *at == '\n');
            at++;
        } else {
            const int closing = at[1] == '/';
            char name[32];
            assert_int_equal(sscanf(at + 1 + closing, "%31[a-zA-Z]", name), 1);
            at += 1 + closing + (int)strlen(name);
            while (*at != '>' && strncmp(at, "/>", 2)) {
                assert_true(*at && *at != '<' && *at != '&');
                if (*at++ != '"') continue;
                const size_t n = strcspn(at, "\"<&");
                assert_int_equal(at[n], '"');
                at += n + 1;
            }
            if (closing) {
                assert_true(depth > 0);
                assert_string_equal(name, open[--depth]);
            } else if (*at == '>') {
                assert_true(depth < 32);
                strcpy(open[depth++], name);
            }
            at += *at == '>' ? 1 : 2;
            elements++;
        }
    }
    assert_true(depth == 0 && elements > 10);
}

static int count(const char *text, const char *word)
{
    int n = 0;
    for (; (text = strstr(text, word)); text++) n++;
    return n;
}

static void test_svg_is_well_formed(void **state)
{
    (void)state;
    static const int images[] = {2 * 3 + 2, 3 + 1, 2 + 1, 0};
    static const char *const texts[][3] = {
        {">a &lt; b &amp; \"c\" &gt; d</text>", ">signed distance (mm)</text>",
         ">image7 #image7</text>"},
        {">? title ?</text>", ">value of the image</text>", ">a &lt; b &amp; \"c\" &gt; d</text>"},
        {">a &lt; b &amp; \"c\" &gt; d</text>", ">oblique</text>", ">\xC2\xB5 (mm)</text>"},
        {">plot</text>", "rotate(-90)", ">a &lt; b &amp; \"c\" &gt; d</text>"}};
    for (int kind = 0; kind < 4; kind++) {
        sdm_error err;
        size_t size, again;
        if (write_picture(kind, "a.svg", &err)) fail_msg("%s", err.text);
        char *svg = read_file("a.svg", &size);
        assert_int_equal(strlen(svg), size);
        check_xml(svg);
        assert_memory_equal(svg + size - 7, "</svg>\n", 7);
        for (int i = 0; i < 3; i++) assert_non_null(strstr(svg, texts[kind][i]));
        /* Lines are stored as paths. Only maps and colour bars are images, and each is
         * referenced once. */
        assert_int_equal(count(svg, "<image "), images[kind]);
        assert_true(count(svg, "<path ") > 5);
        for (const char *p = svg; (p = strstr(p, "href=\"#")); p++) {
            char id[40] = "id=\"";
            assert_int_equal(sscanf(p + 7, "%30[a-z0-9]", id + 4), 1);
            assert_int_equal(count(svg, strcat(id, "\"")), 1);
        }
        /* Writing again in the same process, after another picture, gives the same bytes. */
        assert_int_equal(write_picture(0, "b.svg", NULL), SDM_OK);
        assert_int_equal(write_picture(kind, "b.svg", NULL), SDM_OK);
        char *other = read_file("b.svg", &again);
        assert_int_equal(size, again);
        assert_memory_equal(svg, other, size);
        free(other);
        free(svg);
    }
}

// Each axis of a plot has three labelled ticks or more, whatever its range. Labels of the y axis
// end at it, those of the x axis are centred below it; a power of ten is two texts.
static void test_axes_have_three_labels(void **state)
{
    (void)state;
    for (int i = 0; i < 60; i++) {
        const double low = pow(10, 0.37 * (i % 7) - 3), factor = pow(10, 0.06 * (i + 1)),
                     x[2] = {0, 3 + i}, y[2] = {low, low * factor};
        for (int log_y = 0; log_y < 2; log_y++) {
            const sdm_curve curve = {.x = x, .y = y, .n = 2};
            sdm_error err;
            size_t size;
            if (sdm_picture_plot("ticks.svg", NULL, NULL, NULL, log_y, &curve, 1, &err))
                fail_msg("%s", err.text);
            char *svg = read_file("ticks.svg", &size);
            const int power = count(svg, ">10</text>") > 2 ? 2 : 1,
                      on_y = count(svg, "text-anchor=\"end\"") / power;
            if (on_y < 3 || count(svg, "text-anchor=\"middle\"") < 3)
                fail_msg("y from %g to %g, log %d: %d labels", y[0], y[1], log_y, on_y);
            free(svg);
        }
    }
    remove("ticks.svg");
}

static void test_pdf_has_text(void **state)
{
    (void)state;
    for (int kind = 0; kind < 4; kind++) {
        sdm_error err;
        size_t size, again;
        if (write_picture(kind, "a.pdf", &err)) fail_msg("%s", err.text);
        char *pdf = read_file("a.pdf", &size);
        assert_memory_equal(pdf, "%PDF-1.", 7);
        assert_memory_equal(pdf + size - 6, "%%EOF\n", 6);
        size_t start = size - 6;
        while (start > 0 && memcmp(pdf + start, "startxref", 9)) start--;
        assert_memory_equal(pdf + strtoul(pdf + start + 9, NULL, 10), "xref", 4);
        /* Text is stored as text: an embedded font and a map from glyphs to characters. */
        size_t fonts = 0, unicode = 0;
        for (size_t i = 0; i + 10 < size; i++) {
            fonts += !memcmp(pdf + i, "/FontFile", 9);
            unicode += !memcmp(pdf + i, "/ToUnicode", 10);
        }
        assert_true(fonts > 0 && unicode > 0);
        assert_int_equal(write_picture(0, "b.pdf", NULL), SDM_OK);
        assert_int_equal(write_picture(kind, "b.pdf", NULL), SDM_OK);
        char *other = read_file("b.pdf", &again);
        assert_int_equal(size, again);
        assert_memory_equal(pdf, other, size);
        free(other);
        free(pdf);
    }
}

static int count_files(const char *folder)
{
    int n = 0;
    DIR *d = opendir(folder);
    assert_non_null(d);
    for (const struct dirent *e; (e = readdir(d));) n += e->d_name[0] != '.';
    closedir(d);
    return n;
}

/* Unknown endings, a missing folder or a file in place of a folder, and failing allocations: the
 * right status and no new file. */
static void test_failures_leave_no_file(void **state)
{
    (void)state;
    static const char *const unknown[] = {"a.jpg",    "a",      "png",
                                          "a.png.gz", "a.svgz", "folder.png/a"};
    static const char *const known[] = {"new.png", "new.SVG", "new.Pdf"};
    sdm_error err;
    mkdir("folder.png", 0777);
    for (int i = 0; i < 3; i++) remove(known[i]);
    const int files = count_files(".");
    for (int kind = 0; kind < 4; kind++) {
        for (size_t i = 0; i < sizeof unknown / sizeof *unknown; i++) {
            assert_int_equal(sdm_picture_check(unknown[i], &err), SDM_E_UNSUPPORTED);
            assert_int_equal(write_picture(kind, unknown[i], &err), SDM_E_UNSUPPORTED);
            assert_non_null(strstr(err.text, unknown[i]));
            assert_non_null(strstr(err.text, ".png, .svg or .pdf"));
        }
        assert_int_equal(write_picture(kind, "folder.png", &err), SDM_E_IO);
        for (int i = 0; i < 3; i++) {
            char path[64];
            snprintf(path, sizeof path, "no_such_folder/%s", known[i]);
            assert_int_equal(sdm_picture_check(path, &err), SDM_OK);
            assert_int_equal(write_picture(kind, path, &err), SDM_E_IO);
            // all kinds as PNG, only the plot in every format and by a child process
            if ((i > 0 || in_child) && kind < 3) continue;
            for (unsigned long n = 1;; n++) {
                sdm_alloc_fail_after(n);
                const sdm_status s = write_picture(kind, known[i], &err);
                sdm_alloc_fail_after(0);
                if (s == SDM_OK) {
                    assert_true(n > 2);
                    break;
                }
                assert_int_equal(s, SDM_E_NOMEM);
                assert_int_equal(count_files("."), files);
            }
            assert_int_equal(count_files("."), files + 1);
            remove(known[i]);
        }
    }
    rmdir("folder.png");
    assert_int_equal(sdm_picture_check(NULL, &err), SDM_E_ARG);
}

/* A limit on the file size simulates a full disk: an error status, and the older picture stays. */
static void test_full_disk(void **state)
{
    (void)state;
    static const char *const paths[] = {"kept.png", "kept.svg", "kept.pdf"};
    sdm_error err;
    struct rlimit before;
    for (int i = 0; i < 3; i++) remove(paths[i]);
    const int files = count_files(".");
    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    for (int i = 0; i < 3; i++) {
        FILE *f = fopen(paths[i], "wb");
        assert_non_null(f);
        fputs("before", f);
        fclose(f);
        assert_int_equal(setrlimit(RLIMIT_FSIZE, &(struct rlimit){1000, before.rlim_max}), 0);
        const sdm_status s = write_picture(3, paths[i], &err);
        assert_int_equal(setrlimit(RLIMIT_FSIZE, &before), 0);
        assert_int_equal(s, SDM_E_IO);
        assert_non_null(strstr(err.text, paths[i]));
        assert_int_equal(count_files("."), files + i + 1);
        size_t size;
        char *data = read_file(paths[i], &size);
        assert_string_equal(data, "before");
        free(data);
        assert_int_equal(write_picture(3, paths[i], NULL), SDM_OK);
        data = read_file(paths[i], &size);
        assert_true(size > 1000);
        free(data);
    }
}

static int draw_in_child(void **state)
{
    (void)state;
    sdm_picture_in_child(in_child = true);
    return 0;
}

static int draw_here(void **state)
{
    (void)state;
    sdm_picture_in_child(in_child = false);
    return 0;
}

/* A picture by a child process has the bytes of one by the process itself. */
static void test_child_draws_the_same(void **state)
{
    (void)state;
    static const char *const paths[2][3] = {{"here.png", "here.svg", "here.pdf"},
                                            {"child.png", "child.svg", "child.pdf"}};
    for (int kind = 0; kind < 4; kind++) {
        for (int i = 0; i < 3; i++) {
            char *data[2];
            size_t size[2];
            for (int child = 0; child < 2; child++) {
                sdm_picture_in_child(child);
                assert_int_equal(write_picture(kind, paths[child][i], NULL), SDM_OK);
                data[child] = read_file(paths[child][i], &size[child]);
                remove(paths[child][i]);
            }
            assert_int_equal(size[0], size[1]);
            assert_memory_equal(data[0], data[1], size[0]);
            free(data[0]);
            free(data[1]);
        }
    }
}

/* A crash of the child is an error, and no file is left. Only the child reads the title. */
static void test_child_crashes(void **state)
{
    (void)state;
    static const double x[] = {0, 1};
    const sdm_curve curve = {"", x, x, 2};
    const char *nowhere = (const char *)(uintptr_t)64;
    const int files = count_files(".");
    sdm_error err;
    assert_int_equal(sdm_picture_plot("crash.png", nowhere, "x", "y", false, &curve, 1, &err),
                     SDM_E_NOMEM);
    assert_non_null(strstr(err.text, "crash.png: cairo crashed"));
    assert_int_equal(count_files("."), files);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_svg_is_well_formed),
        cmocka_unit_test(test_axes_have_three_labels),
        cmocka_unit_test(test_pdf_has_text),
        cmocka_unit_test(test_failures_leave_no_file),
        cmocka_unit_test(test_full_disk),
        cmocka_unit_test_setup_teardown(test_failures_leave_no_file, draw_in_child, draw_here),
        cmocka_unit_test_setup_teardown(test_full_disk, draw_in_child, draw_here),
        cmocka_unit_test_teardown(test_child_draws_the_same, draw_here),
        cmocka_unit_test_setup_teardown(test_child_crashes, draw_in_child, draw_here),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
