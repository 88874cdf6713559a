/* Surveys of families of shapes: each fault of faulty_shape.h is found, with its place and amount
 * known from the source; shapes without faults pass.
 * Tests: shape_survey.c survey_fold.c survey_follow.c survey_line.c survey_meeting.c survey_pole.c
 * survey_scale.c survey_shapes.c survey_state.c survey_still.c survey_swing.c survey_unit.c
 * shape_beside.c units.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "faulty_shape.h"
#include "sdm/builtin_shapes.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/shape_survey.h"
#include "sdm/internal/units.h"

static sdm_registry *registry;
static sdm_error err;

static int set_up(void **state)
{
    (void)state;
    return sdm_registry_create(&registry, NULL) || sdm_builtin_shapes_add(registry, NULL) ||
           sdm_registry_add(registry, &FAULTY, "test", NULL);
}

static int tear_down(void **state)
{
    (void)state;
    sdm_registry_free(registry);
    return 0;
}

static sdm_shape_survey survey_with(const char *fault, const sdm_survey_opts *opts)
{
    const sdm_named_text option = {"fault", fault};
    sdm_instance *shape = NULL;
    sdm_shape_survey s;
    if (sdm_instance_create(&FAULTY, &option, 1, NULL, &shape, &err) ||
        sdm_shape_survey_make(shape, opts, &s, &err))
        fail_msg("%s", err.text);
    sdm_instance_free(shape);
    return s;
}

static sdm_shape_survey survey(const char *fault)
{
    return survey_with(fault, &(sdm_survey_opts){.samples = 32, .seed = 1});
}

// The handle of `meets` meets the body up to a reach of 1.6, and is apart beyond: the survey names
// the pair, the parameter and about the value. A handle that always meets it, or never, is none.
static void parts_begin_to_meet(void **state)
{
    (void)state;
    sdm_shape_survey s = survey("meets");
    const sdm_survey_meeting *m = &s.meeting;
    size_t meet = 0;
    for (size_t i = 0; i < s.n; i++) meet += s.p[2 * i + 1] < 1.6;
    assert_int_equal(m->pairs, 1);
    assert_true(m->part[0] == 0 && m->part[1] == 1);
    assert_int_equal(m->meet, meet);
    assert_int_equal(m->apart, s.n - meet);
    assert_true(m->param == 1 && m->below && m->odd == 0);
    if (!(fabs(m->value - 1.6) < 0.05)) fail_msg("at %g", m->value);
    assert_true(s.p[2 * m->shape[1] + 1] < 1.6 && s.p[2 * m->shape[0] + 1] > 1.6);
    assert_int_equal(sdm_shape_survey_verdict(&s), SDM_OK);
    sdm_shape_survey_dispose(&s);
    static const char *const others[] = {"none", "apart", "within"};
    for (size_t i = 0; i < 3; i++) {
        s = survey(others[i]);
        assert_int_equal(s.meeting.pairs, 0);
        sdm_shape_survey_dispose(&s);
    }
}

// Parts that begin to meet inside of another part, or whose meeting grows out of another part, do
// not count. Parts that stand in another part and meet above and in it count.
static void parts_meet_in_another(void **state)
{
    (void)state;
    static const char *const covered[] = {"hidden", "grows"};
    for (size_t i = 0; i < 2; i++) {
        sdm_shape_survey s = survey(covered[i]);
        assert_int_equal(s.failed.shapes + s.open.shapes + s.apart.shapes, 0);
        assert_int_equal(s.meeting.pairs, 0);
        sdm_shape_survey_dispose(&s);
    }
    sdm_shape_survey s = survey("posts");
    const sdm_survey_meeting *m = &s.meeting;
    size_t meet = 0;
    for (size_t i = 0; i < s.n; i++) meet += s.p[2 * i + 1] > 1.6;
    assert_int_equal(m->pairs, 1);
    assert_true(m->part[0] == 1 && m->part[1] == 2);
    assert_int_equal(m->meet, meet);
    assert_int_equal(m->apart, s.n - meet);
    assert_true(m->param == 1 && !m->below && m->odd == 0);
    if (!(fabs(m->value - 1.6) < 0.05)) fail_msg("at %g", m->value);
    sdm_shape_survey_dispose(&s);
}

// The survey finds a parameter that moves only vertices inside of another part, and finds no other
// parameter. A brief survey does not look for such parameters, nor does one of broken meshes.
static void parameters_that_move_no_surface(void **state)
{
    (void)state;
    static const char *const others[] = {"none", "apart", "groups", "meets"};
    sdm_shape_survey s = survey("within");
    assert_true(!s.still[0] && s.still[1]);
    assert_int_equal(sdm_shape_survey_verdict(&s), SDM_E_QUALITY);
    sdm_shape_survey_dispose(&s);
    for (size_t i = 0; i < 4; i++) {
        s = survey(others[i]);
        assert_true(!s.still[0] && !s.still[1]);
        sdm_shape_survey_dispose(&s);
    }
    s = survey("open");
    assert_null(s.still);
    sdm_shape_survey_dispose(&s);
}

/* Number of the shapes with size > 2. */
static size_t count_large(const sdm_shape_survey *s)
{
    size_t n = 0;
    for (size_t i = 0; i < s->n; i++) n += s->p[2 * i] > 2;
    return n;
}

static void without_faults(void **state)
{
    (void)state;
    sdm_shape_survey s = survey("none");
    assert_int_equal(sdm_shape_survey_verdict(&s), SDM_OK);
    assert_int_equal(s.n, 1 + 4 + 32);
    assert_true(s.p[0] == 2.5 && s.p[1] == 1.5);
    assert_int_equal(s.n_vert, 16);
    assert_int_equal(s.n_tri, 24);
    assert_true(s.failed.shapes + s.open.shapes + s.inside_out.shapes + s.turned.shapes == 0);
    assert_true(s.resized.shapes + s.rewired.shapes + s.degenerate.shapes + s.repeat.unlike == 0);
    assert_int_equal(s.overlaps.shapes, s.n);
    assert_true(s.has_velocity && s.velocity_error < 1e-6);
    // union: the body, and the handle outside of it, 0.5 x 0.5 x reach
    assert_true(fabs(s.volume[0] - (8 + 0.25)) < 1e-12);
    assert_true(fabs(s.volume[1] - (216 + 0.5)) < 1e-12);
    assert_true(s.low[0] == -3 && s.high[0] == 5 && s.low[2] == -3 && s.high[2] == 3);
    for (size_t k = 0; k < 2; k++) assert_int_equal(s.jump[k].kind, SDM_BREAK_NONE);
    sdm_shape_survey_dispose(&s);
    // a kink is no jump
    s = survey("kink");
    for (size_t k = 0; k < 2; k++) assert_int_equal(s.jump[k].kind, SDM_BREAK_NONE);
    sdm_shape_survey_dispose(&s);
}

static void parts_that_are_inside_out(void **state)
{
    (void)state;
    sdm_shape_survey s = survey("handle");
    assert_int_equal(s.inside_out.shapes, s.n);
    assert_int_equal((size_t)s.inside_out.amount, 1);
    assert_int_equal(sdm_shape_survey_verdict(&s), SDM_E_QUALITY);
    // the handle is subtracted
    assert_true(fabs(s.volume[0] - (8 - 0.125)) < 1e-12);
    sdm_shape_survey_dispose(&s);
    s = survey("late");
    assert_int_equal(s.inside_out.shapes, count_large(&s));
    assert_true(s.p[2 * s.inside_out.worst] > 2);
    sdm_shape_survey_dispose(&s);
    // the body outweighs the handle, so the whole mesh is turned
    s = survey("body");
    assert_int_equal(s.turned.shapes, s.n);
    assert_int_equal(s.inside_out.shapes, s.n);
    assert_int_equal(sdm_shape_survey_verdict(&s), SDM_E_QUALITY);
    sdm_shape_survey_dispose(&s);
}

static void broken_meshes(void **state)
{
    (void)state;
    sdm_shape_survey s = survey("open");
    assert_int_equal(s.open.shapes, s.n);
    assert_int_equal((size_t)s.open.amount, 3);
    assert_int_equal(sdm_shape_survey_verdict(&s), SDM_E_MESH);
    sdm_shape_survey_dispose(&s);
    s = survey("fail");
    assert_int_equal(s.failed.shapes, count_large(&s));
    assert_int_equal(s.failed.worst, 0);
    assert_int_equal(sdm_shape_survey_verdict(&s), SDM_E_MESH);
    sdm_shape_survey_dispose(&s);
}

// Two boxes in the same place: each triangle of the second one is given twice.
static void parts_in_the_same_place(void **state)
{
    (void)state;
    sdm_shape_survey s = survey("twins");
    assert_int_equal(s.duplicate.shapes, s.n);
    assert_true(s.duplicate.amount == 12 && s.n_tri == 24);
    assert_true(sdm_survey_has_twins(&s));
    assert_int_equal(sdm_shape_survey_verdict(&s), SDM_E_QUALITY);
    // up to a tenth of the triangles may be given twice
    s.duplicate.amount = 2;
    assert_false(sdm_survey_has_twins(&s));
    s.duplicate.amount = 3;
    assert_true(sdm_survey_has_twins(&s));
    sdm_shape_survey_dispose(&s);
    s = survey("none");
    assert_false(sdm_survey_has_twins(&s));
    sdm_shape_survey_dispose(&s);
}

// The vertices in m: the size and the motion by a parameter in mm tell; both name the unit.
static void vertices_in_metres(void **state)
{
    (void)state;
    sdm_shape_survey s = survey("none");
    // a corner of the body moves by sqrt(3) mm
    assert_true(fabs(s.scale.speed - sqrt(3)) < 1e-6 && s.scale.param == 0 && s.scale.size == 8);
    assert_true(!s.scale.odd_size && !s.scale.odd_speed && !s.scale.unit);
    sdm_shape_survey_dispose(&s);
    s = survey("centimetres");
    assert_true(s.scale.odd_speed && !strcmp(s.scale.unit, "cm") && s.scale.unit_mm == 10);
    sdm_shape_survey_dispose(&s);
    s = survey("metres");
    assert_true(s.scale.odd_size && s.scale.odd_speed);
    assert_true(fabs(s.scale.speed - 1e-3 * sqrt(3)) < 1e-9);
    assert_string_equal(s.scale.unit, "m");
    assert_true(s.scale.unit_mm == 1000);
    assert_int_equal(sdm_shape_survey_verdict(&s), SDM_E_QUALITY);
    sdm_shape_survey_dispose(&s);
    static const struct {
        double mm;
        const char *unit;
    } cases[] = {{900, "m"}, {30, "inches"}, {9, "cm"}, {2e-3, "um"}, {1, NULL}, {1e5, NULL}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const char *unit = sdm_unit_near(cases[i].mm, NULL);
        assert_true(!unit == !cases[i].unit && (!unit || !strcmp(unit, cases[i].unit)));
    }
}

/* A bar whose length is the parameter. */
static int bar_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                    const double *p, sdm_mesh_out *out)
{
    (void)self, (void)options;
    const int failed = host->reserve(host, out, 8, 12);
    if (!failed)
        faulty_box(out, 0, (const double[3]){0, -50, -50}, (const double[3]){p[0], 50, 50}, 0);
    return failed;
}

/* A bar whose length mesh() converts to m, while its width is in mm. */
static int converted_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                          const double *p, sdm_mesh_out *out)
{
    const double length = 0.001 * p[0];
    return bar_mesh(self, host, options, &length, out);
}

/* A bar whose length and width mesh() converts to m. */
static int metre_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                      const double *p, sdm_mesh_out *out)
{
    const int failed = bar_mesh(self, host, options, p, out);
    for (size_t i = 0; i < 24 && !failed; i++) out->vert[i] *= 0.001;
    return failed;
}

/* A bar of 100 mm whose length is a thousand times too large. */
static int stretched_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                          const double *p, sdm_mesh_out *out)
{
    const double length = 1000 * p[0];
    return bar_mesh(self, host, options, &length, out);
}

// A length that mesh() converts by itself is told from vertices that are all in another unit: who
// multiplies these by 1000 would make right coordinates wrong.
static void lengths_that_are_converted(void **state)
{
    (void)state;
    static const struct {
        int (*mesh)(const void *, const sdm_host *, const sdm_option_value *, const double *,
                    sdm_mesh_out *);
        const char *question;
    } cases[] = {{converted_mesh, ": does mesh() multiply 'length' by 0.001?"},
                 {metre_mesh, ": are the vertices in m? Multiply them by 1000"},
                 {stretched_mesh, ": does mesh() multiply 'length' by 1000?"}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const sdm_param length = {"length", "mm", 100, 150, 120, "x"};
        const sdm_shape shape = {.abi = SDM_SHAPE_ABI,
                                 .size = sizeof(sdm_shape),
                                 .name = "bar",
                                 .summary = "test",
                                 .params = &length,
                                 .n_params = 1,
                                 .mesh = cases[i].mesh};
        sdm_instance *instance = NULL;
        sdm_shape_survey s;
        sdm_text text = {0};
        if (sdm_instance_create(&shape, NULL, 0, NULL, &instance, &err) ||
            sdm_shape_survey_make(instance, &(sdm_survey_opts){.brief = true}, &s, &err))
            fail_msg("%s", err.text);
        assert_true(s.scale.odd_speed);
        sdm_survey_ask_unit(&s, instance, 0, &text);
        assert_string_equal(text.data, cases[i].question);
        assert_int_equal(sdm_survey_converts(&s), i != 1);
        assert_int_equal(sdm_survey_stretches(&s), i == 2);
        sdm_text_dispose(&text);
        sdm_shape_survey_dispose(&s);
        sdm_instance_free(instance);
    }
}

// The size counts in m in one of its two uses: the motion of the handle by it is 0.0005 mm per mm
// everywhere. A motion that differs from size to size, such as that of a lever, is none.
static void a_length_in_metres_in_one_place(void **state)
{
    (void)state;
    sdm_shape_survey s = survey("mixed");
    assert_true(fabs(s.unit[0].mixed - 5e-4) < 1e-9 && fabs(s.unit[0].fair - sqrt(3)) < 1e-6);
    assert_true(s.unit[0].mixed_part == 1 && s.unit[0].fair_part == 0 && s.unit[1].mixed == 0);
    assert_int_equal(sdm_shape_survey_verdict(&s), SDM_OK);
    sdm_shape_survey_dispose(&s);
    static const char *const none[] = {"lever", "none", "small", "converted"};
    for (size_t i = 0; i < sizeof none / sizeof *none; i++) {
        s = survey(none[i]);
        if (s.unit[0].mixed != 0 || s.unit[1].mixed != 0) fail_msg("%s", none[i]);
        sdm_shape_survey_dispose(&s);
    }
}

// A shape of over 1 m is in mm where a length in mm moves its vertices by as many mm.
static void large_shape_in_mm(void **state)
{
    (void)state;
    for (int mm = 0; mm < 2; mm++) {
        const sdm_param length = {"length", mm ? "mm" : "", 1000, 1500, 1200, "x"};
        const sdm_shape shape = {.abi = SDM_SHAPE_ABI,
                                 .size = sizeof(sdm_shape),
                                 .name = "bar",
                                 .summary = "test",
                                 .params = &length,
                                 .n_params = 1,
                                 .mesh = bar_mesh};
        sdm_instance *instance = NULL;
        sdm_shape_survey s;
        if (sdm_instance_create(&shape, NULL, 0, NULL, &instance, &err) ||
            sdm_shape_survey_make(instance, &(sdm_survey_opts){.samples = 8}, &s, &err))
            fail_msg("%s", err.text);
        assert_true(s.scale.size == 1500 && s.scale.odd_size == !mm && !s.scale.odd_speed);
        assert_int_equal(sdm_shape_survey_verdict(&s), mm ? SDM_OK : SDM_E_QUALITY);
        sdm_shape_survey_dispose(&s);
        sdm_instance_free(instance);
    }
}

// Only the handle is in m: it lies in the body, and its length moves nothing that counts.
static void a_part_in_metres(void **state)
{
    (void)state;
    sdm_shape_survey s = survey("none");
    assert_true(s.slow == 0 && s.apart.shapes == 0 && fabs(s.speed[1] - 1) < 1e-6);
    assert_int_equal(s.tiny.shapes, 0);
    sdm_shape_survey_dispose(&s);
    s = survey("small");
    assert_true(!s.scale.odd_size && !s.scale.odd_speed && s.slow == 1);
    assert_true(fabs(s.speed[0] - sqrt(3)) < 1e-6 && fabs(s.speed[1] - 1e-3) < 1e-8);
    assert_int_equal(s.apart.shapes, s.n);
    assert_int_equal((size_t)s.apart.amount, 2); // the body, too
    assert_int_equal(s.tiny.shapes, s.n);
    assert_int_equal(sdm_shape_survey_verdict(&s), SDM_E_QUALITY);
    sdm_shape_survey_dispose(&s);
    // a cube of 0.005 mm beside a body of 6 mm; no parameter moves it, and it is as thick as long
    s = survey("crumb");
    assert_true(!s.slow && !s.flat.shapes && !s.scale.odd_size && !s.scale.odd_speed);
    assert_int_equal(s.tiny.shapes, s.n);
    assert_true(fabs(s.tiny.amount - 1200) < 1e-6 && s.p[2 * s.tiny.worst] == 3);
    assert_int_equal(sdm_shape_survey_verdict(&s), SDM_E_QUALITY);
    sdm_shape_survey_dispose(&s);
}

// Two triangles that are each other's other side enclose nothing: they have no size to compare.
static void a_part_without_volume(void **state)
{
    (void)state;
    double vert[33] = {0};
    uint32_t tri[42];
    sdm_mesh_out box = {.vert = vert, .tri = tri};
    faulty_box(&box, 0, (const double[3]){-2, -2, -2}, (const double[3]){2, 2, 2}, 0);
    vert[24] = vert[27] = vert[30] = 3;
    vert[28] = vert[32] = 1e-17;
    memcpy(tri + 36, (const uint32_t[]){8, 9, 10, 8, 10, 9}, 6 * sizeof *tri);
    const sdm_mesh m = {.vert = vert, .tri = tri, .n_vert = 11, .n_tri = 14};
    sdm_part_audit a;
    size_t shortest, longest;
    if (sdm_part_audit_make(&m, SDM_AUDIT_WALLS, NULL, &a, &err)) fail_msg("%s", err.text);
    assert_int_equal(a.n, 2);
    assert_true(sdm_survey_part_lengths(&a, &shortest, &longest) == 0);
    assert_true(sdm_survey_part_is_flat(&a, 1));
    sdm_part_audit_dispose(&a);
}

// A box from which another one is subtracted encloses more than the union, and winds once.
static void a_box_winds_once(void **state)
{
    (void)state;
    double vert[48];
    uint32_t tri[72];
    sdm_mesh_out boxes = {.vert = vert, .tri = tri};
    faulty_box(&boxes, 0, (const double[3]){-2, -2, -2}, (const double[3]){2, 2, 2}, 0);
    faulty_box(&boxes, 1, (const double[3]){0, -1, -1}, (const double[3]){2.5, 1, 1}, 1);
    const sdm_mesh m = {.vert = vert, .tri = tri, .n_vert = 16, .n_tri = 24};
    sdm_part_audit a;
    if (sdm_part_audit_make(&m, SDM_AUDIT_WALLS | SDM_AUDIT_UNION, NULL, &a, &err))
        fail_msg("%s", err.text);
    assert_int_equal(a.n, 2);
    assert_true(a.part[0].volume > SDM_SURVEY_WOUND * a.union_volume);
    for (size_t i = 0; i < 2; i++) assert_true(sdm_survey_part_winding(&m, &a, i, NULL) == 0);
    assert_true(fabs(sdm_part_filled(&m, &a, 0, NULL) - 64) < 1e-9);
    sdm_part_audit_dispose(&a);
}

static void breaks_along_a_parameter(void **state)
{
    (void)state;
    static const struct {
        const char *fault;
        sdm_survey_break kind;
    } cases[] = {
        {"jump", SDM_BREAK_JUMP}, {"sizes", SDM_BREAK_SIZES}, {"wires", SDM_BREAK_TRIANGLES}};
    for (size_t i = 0; i < 3; i++) {
        sdm_shape_survey s = survey(cases[i].fault);
        assert_int_equal(s.jump[0].kind, cases[i].kind);
        assert_true(fabs(s.jump[0].value - 2) < 1e-5);
        assert_int_equal(s.jump[1].kind, SDM_BREAK_NONE);
        assert_int_equal(sdm_shape_survey_verdict(&s), SDM_E_QUALITY);
        const size_t large = count_large(&s);
        assert_int_equal(s.resized.shapes, i == 1 ? s.n - large : 0); // the default is large
        assert_int_equal(s.rewired.shapes, i == 2 ? s.n - large : 0);
        if (i == 0) assert_true(fabs(s.jump[0].mm - 0.125) < 1e-4 && s.jump[0].vertex >= 8);
        sdm_shape_survey_dispose(&s);
    }
}

// A parameter with a threshold moves vertices there alone: it does not `move no vertex`.
static void a_step_moves_vertices(void **state)
{
    (void)state;
    for (int brief = 0; brief < 2; brief++) {
        sdm_shape_survey s = survey_with("step", &(sdm_survey_opts){.samples = 8, .brief = brief});
        assert_true(s.speed[1] == 1);
        if (!brief) assert_int_equal(s.jump[1].kind, SDM_BREAK_JUMP);
        sdm_shape_survey_dispose(&s);
    }
}

// The sides of the handle pass through each other at size 1.75; its volume stays positive.
static void walls_that_pass_through_each_other(void **state)
{
    (void)state;
    sdm_shape_survey s = survey("none");
    assert_int_equal(s.folded.shapes, 0);
    sdm_shape_survey_dispose(&s);
    s = survey("wall");
    assert_int_equal(s.inside_out.shapes, 0);
    size_t small = 0;
    for (size_t i = 0; i < s.n; i++) small += s.p[2 * i] < 1.75;
    assert_true(s.folded.shapes >= 2 && s.folded.shapes <= small);
    const double worst = s.p[2 * s.folded.worst];
    assert_true(worst < 1.75 && s.folded.amount > 0.1);
    assert_true(fabs(2.5 + s.folded_at * (worst - 2.5) - 1.75) < 0.1);
    assert_int_equal(sdm_shape_survey_verdict(&s), SDM_E_QUALITY);
    sdm_shape_survey_dispose(&s);
}

static void count_calls(void *user, const char *what, double share)
{
    assert_true(share > 0 && share <= 1 && strlen(what) > 0);
    ++*(size_t *)user;
}

static void time_is_short(void **state)
{
    (void)state;
    size_t calls = 0;
    sdm_shape_survey s = survey_with(
        "none",
        &(sdm_survey_opts){.samples = 8, .seconds = 1e-9, .progress = count_calls, .user = &calls});
    // the first shape is always tested
    assert_int_equal(s.untested, s.n - 1);
    assert_true(s.lines > 0 && s.lines_untested == s.lines);
    assert_true(s.fold_tested == 0 && s.fold_untested == s.n - 1 && s.box_untested);
    assert_true(s.failed.shapes == 0 && s.overlaps.shapes == 1);
    assert_int_equal(sdm_shape_survey_verdict(&s), SDM_OK);
    assert_true(calls >= s.n + s.lines);
    sdm_shape_survey_dispose(&s);
}

static bool is_set(void *user) { return *(const bool *)user; }

static void set(void *user, sdm_survey_stage stage)
{
    *(bool *)user = *(bool *)user || stage == SDM_SURVEY_MESHES;
}

// What is known before the survey is cancelled is kept.
static void a_cancelled_survey(void **state)
{
    (void)state;
    bool now = false;
    sdm_shape_survey s = survey_with(
        "sizes", &(sdm_survey_opts){.samples = 8, .cancelled = is_set, .known = set, .user = &now});
    assert_true(s.cancelled && s.untested == s.n);
    assert_true(s.resized.shapes > 0 && s.n_vert == 24);
    assert_true(s.overlaps.shapes == 0 && s.lines == 0 && isnan(s.volume[0]));
    assert_int_equal(sdm_shape_survey_verdict(&s), SDM_E_QUALITY);
    sdm_shape_survey_dispose(&s);
}

// After a finding from which others follow nothing else is tested, if this is wanted.
static void the_first_to_mend(void **state)
{
    (void)state;
    for (int end = 0; end < 2; end++) {
        sdm_shape_survey s =
            survey_with("offset", &(sdm_survey_opts){.samples = 8, .mend_first = end});
        assert_true(s.unused.shapes == s.n && sdm_survey_mend_first(&s));
        assert_true((s.lines == 0) == end && isnan(s.volume[0]) >= end);
        sdm_shape_survey_dispose(&s);
    }
    sdm_shape_survey s = survey("shared"); // usable with --isolate
    assert_true(s.repeat.unlike && !sdm_survey_mend_first(&s));
    sdm_shape_survey_dispose(&s);
}

static void callbacks(void **state)
{
    (void)state;
    sdm_shape_survey s = survey("velocity");
    assert_true(fabs(s.velocity_error - 0.01 / 1.01) < 1e-6);
    assert_int_equal(s.velocity_param, 1);
    assert_int_equal(s.velocity_vertex, 9);
    assert_int_equal(sdm_shape_survey_verdict(&s), SDM_E_QUALITY);
    sdm_shape_survey_dispose(&s);
}

// Why meshes differ when they are made again, in a brief survey, too.
static void meshes_made_again(void **state)
{
    (void)state;
    static const struct {
        const char *fault;
        sdm_repeat_cause cause;
    } cases[] = {{"none", SDM_REPEAT_UNKNOWN},  {"unlike", SDM_REPEAT_HISTORY},
                 {"behind", SDM_REPEAT_BEHIND}, {"unset", SDM_REPEAT_UNSET},
                 {"cache", SDM_REPEAT_BESIDE},  {"shared", SDM_REPEAT_THREADS}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        // in the tenth of a second of a brief survey threads need not meet on a busy machine
        for (int brief = 0; brief < (cases[i].cause == SDM_REPEAT_THREADS ? 1 : 2); brief++) {
            sdm_shape_survey s =
                survey_with(cases[i].fault, &(sdm_survey_opts){.samples = 4, .brief = brief});
            assert_int_equal(s.repeat.cause, cases[i].cause);
            assert_true((s.repeat.unlike == 0) == !i && s.repeat.unlike <= 8);
            if (cases[i].cause == SDM_REPEAT_BEHIND) assert_int_equal(s.repeat.param, 3);
            if (cases[i].cause == SDM_REPEAT_BESIDE) assert_int_equal(s.repeat.param, 1);
            // behind the parameters there is no number
            const sdm_status bad = cases[i].cause == SDM_REPEAT_BEHIND ? SDM_E_MESH : SDM_E_QUALITY;
            assert_int_equal(sdm_shape_survey_verdict(&s), i ? bad : SDM_OK);
            sdm_shape_survey_dispose(&s);
        }
}

// State in a part of the range of the size looks like a jump, but a jump is the same again.
static void state_is_no_jump(void **state)
{
    (void)state;
    sdm_shape_survey s = survey("lapse");
    assert_int_equal(s.repeat.unlike, 0);
    assert_int_equal(s.jump[0].kind, SDM_BREAK_STATE);
    assert_true(s.jump[0].value > 2.14 && s.jump[0].value < 2.31);
    assert_int_equal(s.jump[1].kind, SDM_BREAK_NONE);
    assert_int_equal(sdm_shape_survey_verdict(&s), SDM_E_QUALITY);
    sdm_shape_survey_dispose(&s);
    s = survey("jump");
    assert_int_equal(s.jump[0].kind, SDM_BREAK_JUMP);
    sdm_shape_survey_dispose(&s);
}

/* A shape of three parameters whose mesh() keeps its last mesh, and gives it again if some of the
 * parameters are those of the call before. */
static const sdm_param KEPT_PARAMS[] = {
    {"a", "mm", 1, 2, 1.5, "x"}, {"b", "mm", 1, 2, 1.5, "y"}, {"c", "mm", 1, 2, 1.5, "z"}};
static unsigned kept_compares; // bits of the parameters that are compared
static double kept_near;       // parameters that differ by less pass for equal
static size_t kept_copies = 1; // of every triangle

static int kept_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                     const double *p, sdm_mesh_out *out)
{
    static _Thread_local double key[3];
    double edge[3];
    (void)self, (void)options;
    const int failed = host->reserve(host, out, 8, 12 * kept_copies);
    if (failed) return failed;
    bool same = true;
    for (unsigned k = 0; k < 3; k++)
        same = same && !(kept_compares >> k & 1 && fabs(p[k] - key[k]) > kept_near);
    if (!same) memcpy(key, p, sizeof key);
    for (size_t k = 0; k < 3; k++) edge[k] = 0.5 * (p[k] + key[k]);
    faulty_box(out, 0, (const double[3]){0, 0, 0}, edge, 0);
    for (size_t i = 1; i < kept_copies; i++)
        memcpy(out->tri + 36 * i, out->tri, 36 * sizeof *out->tri);
    return 0;
}

// Of a cache the survey names a parameter that is not compared, whichever are, and finds one that
// compares with a tolerance. A cache that compares all values is right. The survey makes fewer of
// large meshes, and names the parameter of their caches, too.
static void caches_of_meshes(void **state)
{
    (void)state;
    static const sdm_shape shape = {.abi = SDM_SHAPE_ABI,
                                    .size = sizeof(sdm_shape),
                                    .name = "kept",
                                    .summary = "test",
                                    .params = KEPT_PARAMS,
                                    .n_params = 3,
                                    .mesh = kept_mesh};
    sdm_instance *instance = NULL;
    assert_int_equal(sdm_instance_create(&shape, NULL, 0, NULL, &instance, &err), SDM_OK);
    const sdm_survey_opts opts = {.samples = 16, .brief = true, .n_threads = 1};
    for (unsigned compares = 1; compares < 8; compares++)
        for (int near = 0; near < 2; near++) {
            sdm_shape_survey s;
            kept_compares = compares;
            kept_near = near ? 1e-4 : 0;
            assert_int_equal(sdm_shape_survey_make(instance, &opts, &s, &err), SDM_OK);
            assert_true((s.repeat.unlike == 0) == (compares == 7 && !near));
            if (s.repeat.unlike) assert_int_equal(s.repeat.cause, SDM_REPEAT_BESIDE);
            if (s.repeat.unlike && !near) assert_false(compares >> s.repeat.param & 1);
            sdm_repeat large;
            kept_copies = 8000;
            assert_int_equal(sdm_repeat_find(instance, s.p, s.n, true, &large, &err), SDM_OK);
            kept_copies = 1;
            assert_true((large.unlike == 0) == (compares == 7 && !near));
            if (large.unlike && !near) assert_false(compares >> large.param & 1);
            sdm_shape_survey_dispose(&s);
        }
    sdm_instance_free(instance);
}

static void a_grid_that_cuts(void **state)
{
    (void)state;
    // the handle reaches to size + reach, at most 5 mm; the grid ends at x = 4
    const int64_t n[3] = {41, 33, 33};
    sdm_grid grid = sdm_grid_centred(n, 0.25, (const double[3]){-1, 0, 0});
    sdm_shape_survey s = survey_with("none", &(sdm_survey_opts){.samples = 64, .grid = &grid});
    size_t cut = 0;
    for (size_t i = s.n_corners + 1; i < s.n; i++) cut += s.p[2 * i] + s.p[2 * i + 1] > 4;
    assert_true(cut > 0 && cut < s.n_samples);
    assert_int_equal(s.cut.shapes, cut);
    assert_true(s.beyond[0][1] == 1 && s.beyond[0][0] == 0 && s.beyond[2][1] == 0);
    assert_int_equal(sdm_shape_survey_verdict(&s), SDM_E_QUALITY);
    sdm_shape_survey_dispose(&s);
    // within narrower ranges it does not
    const double range[2][2] = {{1, 2}, {1, 2}};
    s = survey_with("none", &(sdm_survey_opts){.samples = 64, .grid = &grid, .range = range});
    assert_int_equal(s.cut.shapes, 0);
    assert_int_equal(sdm_shape_survey_verdict(&s), SDM_OK);
    assert_true(s.p[0] == 2);
    sdm_shape_survey_dispose(&s);
}

// The handle is 0.5 mm thick, outside of the body as inside.
static void a_grid_that_is_too_coarse(void **state)
{
    (void)state;
    static const struct {
        double spacing;
        bool thin;
    } cases[] = {{0.35, false}, {0.36, true}};
    for (size_t i = 0; i < 2; i++) {
        const sdm_grid grid = sdm_grid_centred((const int64_t[3]){45, 45, 45}, cases[i].spacing,
                                               (const double[3]){0});
        sdm_shape_survey s =
            survey_with("none", &(sdm_survey_opts){.samples = 8, .grid = &grid, .brief = true});
        assert_int_equal(s.cut.shapes, 0);
        assert_int_equal(s.thin.shapes, cases[i].thin ? s.n : 0);
        assert_true(!cases[i].thin || fabs(s.thin.amount - 0.72) < 1e-9);
        assert_int_equal(sdm_shape_survey_verdict(&s), cases[i].thin ? SDM_E_QUALITY : SDM_OK);
        sdm_shape_survey_dispose(&s);
    }
}

// Grids of 30 x 24 x 24 voxels and a little more than twice as many along each axis.
static void a_grid_that_is_too_large(void **state)
{
    (void)state;
    for (int large = 0; large < 2; large++) {
        const int64_t n[3] = {large ? 62 : 58, large ? 49 : 46, large ? 49 : 46};
        const sdm_grid grid = sdm_grid_centred(n, 0.35, (const double[3]){1, 0, 0});
        sdm_shape_survey s =
            survey_with("none", &(sdm_survey_opts){.samples = 8, .grid = &grid, .brief = true});
        // the box is 8 x 6 x 6 mm, the margin 7 voxels
        const double need[3] = {8 / 0.35 + 7, 6 / 0.35 + 7, 6 / 0.35 + 7};
        for (int a = 0; a < 3; a++)
            assert_true(fabs(s.surplus_along[a] - (double)n[a] / need[a]) < 1e-9);
        assert_int_equal(s.cut.shapes + s.thin.shapes, 0);
        assert_int_equal(sdm_shape_survey_verdict(&s), large ? SDM_E_QUALITY : SDM_OK);
        sdm_shape_survey_dispose(&s);
    }
}

// Vertices far away that belong to no triangle change no box, and no grid cuts them.
static void vertices_of_no_triangle(void **state)
{
    (void)state;
    const sdm_grid grid =
        sdm_grid_centred((const int64_t[3]){35, 25, 25}, 0.3, (const double[3]){1, 0, 0});
    for (int brief = 0; brief < 2; brief++) {
        const sdm_survey_opts opts = {.samples = 8, .grid = &grid, .brief = brief};
        sdm_shape_survey s[2] = {survey_with("none", &opts), survey_with("spare", &opts)};
        assert_int_equal(s[1].n_vert, s[0].n_vert + 8);
        assert_memory_equal(s[0].low, s[1].low, sizeof s->low);
        assert_memory_equal(s[0].high, s[1].high, sizeof s->high);
        assert_memory_equal(s[0].beyond, s[1].beyond, sizeof s->beyond);
        assert_true(s[0].surplus == s[1].surplus && s[0].scale.size == s[1].scale.size);
        assert_int_equal(s[1].cut.shapes, 0);
        assert_int_equal(s[0].unused.shapes, 0);
        assert_int_equal(s[1].unused.shapes, s[1].n);
        assert_true(s[1].unused.amount == 8);
        assert_int_equal(sdm_shape_survey_verdict(&s[0]), SDM_OK);
        assert_int_equal(sdm_shape_survey_verdict(&s[1]), SDM_E_QUALITY);
        for (int i = 0; i < 2; i++) sdm_shape_survey_dispose(&s[i]);
    }
}

static void threads_and_brief_surveys(void **state)
{
    (void)state;
    for (int brief = 0; brief < 2; brief++) {
        sdm_shape_survey s[2];
        for (int i = 0; i < 2; i++)
            s[i] = survey_with(
                "late", &(sdm_survey_opts){.samples = 24, .brief = brief, .n_threads = 1 + 3 * i});
        assert_memory_equal(s[0].p, s[1].p, s[0].n * 2 * sizeof *s[0].p);
        assert_memory_equal(&s[0].inside_out, &s[1].inside_out, sizeof s[0].inside_out);
        assert_memory_equal(s[0].low, s[1].low, sizeof s[0].low);
        assert_true((s[0].jump == NULL) == brief);
        assert_true((isnan(s[0].volume[0]) != 0) == brief);
        for (int i = 0; i < 2; i++) sdm_shape_survey_dispose(&s[i]);
    }
}

static void refusals(void **state)
{
    (void)state;
    sdm_instance *shape = NULL;
    sdm_shape_survey s;
    const double range[2][2] = {{1, 4}, {1, 2}};
    assert_int_equal(sdm_instance_create(&FAULTY, NULL, 0, NULL, &shape, &err), SDM_OK);
    assert_int_equal(sdm_shape_survey_make(shape, &(sdm_survey_opts){.range = range}, &s, &err),
                     SDM_E_RANGE);
    assert_non_null(strstr(err.text, "1 .. 4 of 'size'"));
    assert_int_equal(sdm_shape_survey_make(NULL, NULL, &s, &err), SDM_E_ARG);
    int failed = 0;
    for (size_t k = 1; k < 400; k += 7) {
        sdm_alloc_fail_after(k);
        const sdm_status status = sdm_shape_survey_make(
            shape, &(sdm_survey_opts){.samples = 2, .n_threads = 1}, &s, &err);
        sdm_alloc_fail_after(0);
        assert_true(status == SDM_OK || status == SDM_E_NOMEM);
        failed += status == SDM_E_NOMEM;
        if (!status) sdm_shape_survey_dispose(&s);
    }
    assert_true(failed > 20);
    sdm_instance_free(shape);
}

static void built_in_shapes_pass(void **state)
{
    (void)state;
    static const char *const names[] = {"cochlea", "ellipsoid", "torus", "capsule", "linkage"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        sdm_instance *shape = NULL;
        sdm_shape_survey s;
        assert_int_equal(sdm_instance_create(sdm_registry_find(registry, names[i], NULL), NULL, 0,
                                             NULL, &shape, &err),
                         SDM_OK);
        if (sdm_shape_survey_make(shape, &(sdm_survey_opts){.samples = 16}, &s, &err))
            fail_msg("%s", err.text);
        if (sdm_shape_survey_verdict(&s)) fail_msg("%s does not pass", names[i]);
        sdm_shape_survey_dispose(&s);
        sdm_instance_free(shape);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(parameters_that_move_no_surface),
        cmocka_unit_test(parts_begin_to_meet),
        cmocka_unit_test(parts_meet_in_another),
        cmocka_unit_test(without_faults),
        cmocka_unit_test(parts_that_are_inside_out),
        cmocka_unit_test(broken_meshes),
        cmocka_unit_test(parts_in_the_same_place),
        cmocka_unit_test(vertices_in_metres),
        cmocka_unit_test(large_shape_in_mm),
        cmocka_unit_test(lengths_that_are_converted),
        cmocka_unit_test(a_length_in_metres_in_one_place),
        cmocka_unit_test(a_part_in_metres),
        cmocka_unit_test(a_part_without_volume),
        cmocka_unit_test(a_box_winds_once),
        cmocka_unit_test(breaks_along_a_parameter),
        cmocka_unit_test(a_step_moves_vertices),
        cmocka_unit_test(walls_that_pass_through_each_other),
        cmocka_unit_test(time_is_short),
        cmocka_unit_test(a_cancelled_survey),
        cmocka_unit_test(the_first_to_mend),
        cmocka_unit_test(callbacks),
        cmocka_unit_test(meshes_made_again),
        cmocka_unit_test(state_is_no_jump),
        cmocka_unit_test(caches_of_meshes),
        cmocka_unit_test(a_grid_that_cuts),
        cmocka_unit_test(a_grid_that_is_too_coarse),
        cmocka_unit_test(a_grid_that_is_too_large),
        cmocka_unit_test(vertices_of_no_triangle),
        cmocka_unit_test(threads_and_brief_surveys),
        cmocka_unit_test(refusals),
        cmocka_unit_test(built_in_shapes_pass),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
