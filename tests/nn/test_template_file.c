/* Damaged files of the template network, and allocations that fail.
 * Tests: model_read.c template_build.c template_open.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "model_faults.h"
#include "sdm/internal/container.h"
#include "template_toy.h"

static const double ORIGIN[3] = {0, 0, 0};

// Two parts, one with a warp, on a grid of one row.
static toy make(void)
{
    const sdm_grid grid = sdm_grid_centred((const int64_t[]){9, 1, 1}, 0.5, ORIGIN);
    toy t = toy_new(&grid);
    const sdm_lattice near = lattice(ORIGIN, 1, 0.5), far = lattice(ORIGIN, 4, 2),
                      warp = lattice(ORIGIN, 6, 3);
    const body o = {CAPSULE, {0, 0, 0}, {0, 0, 1}, 0.5};
    toy_add(&t, &o, -1, SDM_FRAME_RIGID, &near, &far);
    toy_warp(&t, 0, 0, 2, &warp);
    toy_add(&t, &o, 0, SDM_FRAME_AFFINE, &near, &far);
    return t;
}

typedef struct file {
    uint8_t *bytes;
    size_t size, n, meta; // number of sections, and which is the description
    sdm_section sections[SDM_CONTAINER_MAX_SECTIONS];
    char names[SDM_CONTAINER_MAX_SECTIONS][24], text[4096];
} file;

static void file_make(file *f, toy *t)
{
    sdm_error e = {0};
    uint64_t checksum;
    if (toy_build(t, &f->bytes, &f->size, &e)) fail_msg("%s", e.text);
    assert_int_equal(
        sdm_container_parse(f->bytes, f->size, f->sections, f->names, &f->n, &checksum, &e),
        SDM_OK);
    for (size_t i = 0; i < f->n; i++)
        if (strcmp(f->names[i], "meta") == 0) f->meta = i;
    const sdm_section *meta = &f->sections[f->meta];
    assert_true(meta->size < sizeof f->text);
    memcpy(f->text, meta->data, meta->size);
    f->text[meta->size] = '\0';
}

static void expect_refused(const sdm_section *sections, size_t n, const char *what)
{
    uint8_t *bytes;
    size_t size;
    sdm_model *m;
    sdm_error e = {0};
    assert_int_equal(sdm_container_build(sections, n, &bytes, &size, &e), SDM_OK);
    const sdm_status s = sdm_model_open_memory("wrong", bytes, size, &m, &e);
    if (s != SDM_E_FORMAT || m) fail_msg("%s: status %d", what, (int)s);
    if (!strstr(e.text, "damaged") && !strstr(e.text, "unknown kind")) fail_msg("%s", e.text);
    sdm_free(bytes);
}

static void damage_is_refused(void **state)
{
    (void)state;
    toy t = make();
    file f;
    file_make(&f, &t);
    sdm_model *m;
    sdm_error e;
    for (size_t n = 0; n < f.size; n += 1 + n / 7) {
        assert_int_equal(sdm_model_open_memory("cut", f.bytes, n, &m, &e), SDM_E_FORMAT);
        f.bytes[n] ^= 4;
        assert_int_equal(sdm_model_open_memory("flip", f.bytes, f.size, &m, &e), SDM_E_FORMAT);
        f.bytes[n] ^= 4;
    }
    // Files with right checksums, but with a section that is missing, too short or too long.
    for (size_t i = 0; i < f.n; i++) {
        sdm_section changed[SDM_CONTAINER_MAX_SECTIONS];
        size_t kept = 0;
        for (size_t j = 0; j < f.n; j++)
            if (j != i) changed[kept++] = f.sections[j];
        expect_refused(changed, kept, f.names[i]);
        if (strncmp(f.names[i], "template.", 9) != 0) continue;
        memcpy(changed, f.sections, sizeof changed);
        changed[i].size -= 4;
        expect_refused(changed, f.n, f.names[i]);
        uint8_t *longer = NULL;
        assert_int_equal(SDM_ALLOC(&longer, f.sections[i].size + 4, "longer", NULL), SDM_OK);
        memcpy(longer, f.sections[i].data, f.sections[i].size);
        changed[i].data = longer;
        changed[i].size += 8;
        expect_refused(changed, f.n, f.names[i]);
        sdm_free(longer);
    }
    sdm_free(f.bytes);
    toy_dispose(&t);
}

// Right checksums, but a line of the description that does not fit.
static void wrong_lines_are_refused(void **state)
{
    (void)state;
    static const char *const lines[][2] = {{"kind=template", "kind=templatf"},
                                           {"template.degree=2", "template.degree=3"},
                                           {"template.degree=2", "template.degree=13"},
                                           {"template.degree=2", "template.degree=-1"},
                                           {"template.numbers=20", "template.numbers=21"},
                                           {"template.numbers=20", "template.numbers=19"},
                                           {"template.numbers=20", "template.numbers=1048577"},
                                           {"template.numbers=20", "template.numbers=-1"},
                                           {"template.step=4", "template.step=1"},
                                           {"template.step=4", "template.step=9"},
                                           {"template.parts=2", "template.parts=0"},
                                           {"template.parts=2", "template.parts=1"},
                                           {"template.parts=2", "template.parts=3"},
                                           {"template.parts=2", "template.parts=33"},
                                           {"part.parent=-1", "part.parent=0"},
                                           {"part.parent=-1", "part.parent=-2"},
                                           {"part.parent=0", "part.parent=1"},
                                           {"part.frame=1", "part.frame=3"},
                                           {"part.frame=1", "part.frame=-1"},
                                           {"part.pivot=", "part.pivot=nan 0 0 "},
                                           {"part.pivot=0.5 ", "part.pivot=nan "},
                                           {"part.pivot=0.5 ", "part.pivot=inf "},
                                           {"part.pivot=0.5 ", "part.pivot=1e10 "},
                                           {"part.numbers=0", "part.numbers=15"},
                                           {"part.numbers=0", "part.numbers=-1"},
                                           {"part.modes=2", "part.modes=3"},
                                           {"part.modes=2", "part.modes=257"},
                                           {"part.modes=2", "part.modes=0"},
                                           {"part.amplitudes=6", "part.amplitudes=19"},
                                           {"part.amplitudes=6", "part.amplitudes=1048577"},
                                           {"part.warp=5 ", "part.warp=3 "},
                                           {"part.warp=5 ", "part.warp=6 "},
                                           {"part.warp=5 ", "part.warp=4097 "},
                                           {"part.warp=5 ", "part.warp=nan "},
                                           {"part.near=5 ", "part.near=1 "},
                                           {"part.near=5 ", "part.near=4 "},
                                           {"part.near=5 6 7", "part.near=4096 4096 4096"},
                                           {"part.near=5 6 7", "part.near=1024 1024 1024"},
                                           {"part.warp=5 6 7", "part.warp=4096 4096 4096"},
                                           {"part.near=5 ", "part.near=inf "},
                                           {"part.near=5 ", "part.near=-5 "},
                                           {"part.far=5 ", "part.far=1e300 "},
                                           {"part.far=5 6 7", "part.far=6 5 8"},
                                           {"part.far=5 6 7 -4", "part.far=5 6 7 nan"},
                                           {"part.far=5 6 7 -4", "part.far=5 6 7 2e9"},
                                           {"part.far=5 6 7 -4 ", "part.far=5 6 7 "},
                                           {"part.sag=0 ", "part.sag=nan "},
                                           {"part.sag=0 ", "part.sag=-1 "}};
    toy t = make();
    file f;
    file_make(&f, &t);
    for (size_t i = 0; i < sizeof lines / sizeof *lines; i++) {
        char text[5000];
        const char *at = strstr(f.text, lines[i][0]);
        if (!at) fail_msg("no line '%s' in\n%s", lines[i][0], f.text);
        snprintf(text, sizeof text, "%.*s%s%s", (int)(at - f.text), f.text, lines[i][1],
                 at + strlen(lines[i][0]));
        f.sections[f.meta].data = text;
        f.sections[f.meta].size = strlen(text);
        expect_refused(f.sections, f.n, lines[i][1]);
    }
    // The spacing is the last number of a lattice.
    static const char *const keys[] = {"part.warp=", "part.near=", "part.far="},
                             *const spacings[] = {"0", "-1", "nan", "inf", "1e-10", "1e10", ""};
    for (size_t i = 0; i < 3; i++)
        for (size_t k = 0; k < sizeof spacings / sizeof *spacings; k++) {
            char text[5000];
            const char *at = strstr(f.text, keys[i]), *end = strchr(at, '\n');
            while (end[-1] != ' ') end--;
            snprintf(text, sizeof text, "%.*s%s%s", (int)(end - f.text), f.text, spacings[k],
                     strchr(end, '\n'));
            f.sections[f.meta].data = text;
            f.sections[f.meta].size = strlen(text);
            expect_refused(f.sections, f.n, spacings[k]);
        }
    sdm_free(f.bytes);
    toy_dispose(&t);
}

// A grid whose scratch memory cannot be counted in a size_t.
static void endless_grid_is_refused(void **state)
{
    (void)state;
    toy t = make();
    file f;
    file_make(&f, &t);
    char text[5000];
    const char *at = strstr(f.text, "grid.size=9 1 1");
    assert_non_null(at);
    snprintf(text, sizeof text, "%.*sgrid.size=1048576 262144 1048576%s", (int)(at - f.text),
             f.text, at + strlen("grid.size=9 1 1"));
    f.sections[f.meta].data = text;
    f.sections[f.meta].size = strlen(text);
    uint8_t *bytes;
    size_t size;
    sdm_model *m;
    sdm_error e = {0};
    assert_int_equal(sdm_container_build(f.sections, f.n, &bytes, &size, &e), SDM_OK);
    assert_int_equal(sdm_model_open_memory("endless", bytes, size, &m, &e), SDM_E_NOMEM);
    assert_null(m);
    sdm_free(bytes);
    sdm_free(f.bytes);
    toy_dispose(&t);
}

// Weights that are no numbers are refused; huge ones cause no access outside of an array.
static void hostile_weights_are_harmless(void **state)
{
    (void)state;
    static const char *const names[] = {"template.functions", "template.modes", "template.nodes"};
    const double p[P] = {0, 3};
    for (size_t i = 0; i < 3; i++)
        for (int bits = 0; bits < 3; bits++) {
            toy t = make();
            file f;
            file_make(&f, &t);
            for (size_t s = 0; s < f.n; s++) {
                if (strcmp(f.names[s], names[i]) != 0) continue;
                // NaN; the largest infinity; large finite values
                uint8_t *data = NULL;
                assert_int_equal(SDM_ALLOC(&data, f.sections[s].size, "weights", NULL), SDM_OK);
                for (size_t b = 0; b < f.sections[s].size; b++) {
                    const size_t byte = i == 0 ? b % 8 : b % 4, top = i == 0 ? 7 : 3;
                    data[b] = bits == 0         ? 0xff
                              : byte == top     ? (bits == 1 ? 0x7f : 0x7e)
                              : byte == top - 1 ? (i == 0 ? 0xf0 : 0x80)
                                                : 0;
                }
                f.sections[s].data = data;
                uint8_t *bytes;
                size_t size;
                sdm_model *m = NULL;
                sdm_error e = {0};
                assert_int_equal(sdm_container_build(f.sections, f.n, &bytes, &size, &e), SDM_OK);
                const sdm_status opened = sdm_model_open_memory("hostile", bytes, size, &m, &e);
                if (bits < 2) {
                    assert_int_equal(opened, SDM_E_FORMAT);
                    assert_non_null(strstr(e.text, "is not finite"));
                    sdm_free(bytes), sdm_free(data);
                    continue;
                }
                if (opened) fail_msg("%s", e.text);
                float *map = toy_map(m, p, 1), *jacobian = NULL, *again = toy_map(m, p, 1);
                assert_memory_equal(map, again, 9 * sizeof *map);
                void *scratch = NULL;
                assert_int_equal(SDM_ALLOC(&jacobian, 9 * P, "jacobian", NULL), SDM_OK);
                assert_int_equal(
                    sdm_alloc(&scratch, sdm_model_jacobian_scratch_bytes(m), 1, "scratch", NULL),
                    SDM_OK);
                sdm_model_jacobian(m, p, map, jacobian, scratch);
                sdm_free(scratch), sdm_free(jacobian), sdm_free(map), sdm_free(again);
                sdm_model_free(m);
                sdm_free(bytes);
                sdm_free(data);
            }
            sdm_free(f.bytes);
            toy_dispose(&t);
        }
}

static sdm_status build(const void *spec, uint8_t **bytes, size_t *size, sdm_error *err)
{
    toy t = *(const toy *)spec;
    return toy_build(&t, bytes, size, err);
}

static void every_allocation_may_fail(void **state)
{
    (void)state;
    toy t = make();
    sdm_model *m = open_with_failing_allocations(build, &t, 4, 5);
    sdm_error e;
    sdm_status s = SDM_E_NOMEM;
    unsigned long n = 1;
    const double p[P] = {0, 3}, y[3] = {0};
    double x[3];
    for (; s; n++) {
        sdm_alloc_fail_after(n);
        s = sdm_template_carry(m, p, y, 1, x, &e);
        sdm_alloc_fail_after(0);
        if (s) assert_int_equal(s, SDM_E_NOMEM);
        assert_true(n < 100);
    }
    assert_true(n > 4);
    sdm_model_free(m);
    toy_dispose(&t);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(damage_is_refused), cmocka_unit_test(wrong_lines_are_refused),
        cmocka_unit_test(endless_grid_is_refused), cmocka_unit_test(hostile_weights_are_harmless),
        cmocka_unit_test(every_allocation_may_fail)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
