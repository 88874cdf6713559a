/* Audits of the parts of a mesh: boxes whose volumes, unions and orientations are known.
 * Tests: part_audit.c part_fold.c part_gap.c part_meeting.c part_thickness.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "oracle/exact_meshes.h"
#include "sdm/exact.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/part_audit.h"

static sdm_error err;

/* A box low .. high. */
typedef struct box {
    double low[3], high[3];
} box;

/* Adds the box; inside_out: its triangles are reversed. */
static void add(sdm_mesh *m, const box *b, bool inside_out)
{
    sdm_mesh one = {0};
    mesh_box(&one, b->low, b->high);
    if (inside_out) mesh_flip(&one);
    mesh_append(m, &one);
    sdm_mesh_dispose(&one);
}

/* Adds the box low .. high along x with a square of +-half across. */
static void add_box(sdm_mesh *m, double low, double high, double half, bool inside_out)
{
    add(m, &(box){{low, -half, -half}, {high, half, half}}, inside_out);
}

static sdm_part_audit audit_of(const sdm_mesh *m)
{
    sdm_part_audit a;
    if (sdm_part_audit_make(m, SDM_AUDIT_WALLS | SDM_AUDIT_UNION, NULL, &a, &err))
        fail_msg("%s", err.text);
    return a;
}

static void near(double a, double b) { assert_true(fabs(a - b) <= 1e-12 * (1 + fabs(b))); }

/* Volume inside by the exact engine, from its surface: independent of the audit. */
static double engine_volume(const sdm_mesh *m, size_t *turned)
{
    sdm_exact *e = NULL;
    sdm_audit a;
    if (sdm_exact_create(m, NULL, &e, &err) || sdm_mesh_audit(sdm_exact_surface(e), &a, &err))
        fail_msg("%s", err.text);
    *turned = sdm_exact_get_report(e)->parts_turned;
    sdm_exact_free(e);
    return a.volume;
}

/* A body of 4 x 4 x 4 and a handle that overlaps it by 1 x 2 x 2. */
static void test_overlapping_parts(void **state)
{
    (void)state;
    static const struct {
        bool body, handle;
        double volume, solid;
        size_t inside_out;
        bool turned;
    } cases[] = {{false, false, 64 + 12, 64 + 8, 0, false},
                 {false, true, 64 - 12, 64 - 4, 1, false},
                 {true, false, -64 + 12, 64 - 4, 1, true},
                 {true, true, -64 - 12, 64 + 8, 0, true}};
    for (size_t i = 0; i < 4; i++) {
        sdm_mesh m = {0};
        add_box(&m, 0, 4, 2, cases[i].body);
        add_box(&m, 3, 6, 1, cases[i].handle);
        sdm_part_audit a = audit_of(&m);
        size_t turned;
        assert_int_equal(a.n, 2);
        assert_int_equal(a.inside_out, cases[i].inside_out);
        assert_true(a.turned == cases[i].turned && a.part[0].turned == a.turned);
        near(a.mesh.volume, cases[i].volume);
        near(a.union_volume, cases[i].solid);
        near(a.union_volume, engine_volume(&m, &turned));
        near(a.part[0].volume, cases[i].body ? -64 : 64);
        near(a.part[1].volume, cases[i].handle ? -12 : 12);
        near(a.part[1].area, 32);
        assert_true(a.part[0].met > 0 && a.part[1].met > 0);
        assert_true(a.part[1].min[0] == 3 && a.part[1].max[2] == 1);
        assert_true(a.part[1].first_vert == 8 && a.part[1].last_vert == 15);
        assert_true(a.part[1].first_tri == 12 && a.part[1].n_tri == 12);
        assert_int_equal(a.part[0].state, SDM_PART_SOLID);
        assert_int_equal(a.part[1].state,
                         cases[i].inside_out ? SDM_PART_INSIDE_OUT : SDM_PART_SOLID);
        sdm_part_audit_dispose(&a);
        // after turning, all is solid
        size_t n;
        assert_int_equal(sdm_mesh_turn_parts(&m, &n, &err), SDM_OK);
        assert_int_equal(n, cases[i].body + cases[i].handle);
        a = audit_of(&m);
        near(a.mesh.volume, 76);
        near(a.union_volume, 72);
        assert_true(!a.turned && !a.inside_out);
        sdm_part_audit_dispose(&a);
        sdm_mesh_dispose(&m);
    }
}

/* A body of 4 x 4 x 4 and a box of 1 x 4 x 4 beside it with which it shares an edge: two parts, of
 * which one may be inside out. */
static void test_parts_that_share_an_edge(void **state)
{
    (void)state;
    for (int flip = 0; flip < 2; flip++) {
        sdm_mesh m = {0}, plate = {0};
        add_box(&m, 0, 4, 2, false);
        mesh_box(&plate, (const double[3]){4, 2, -2}, (const double[3]){5, 6, 2});
        if (flip) mesh_flip(&plate);
        if (sdm_mesh_reserve(&m, 16, 24, &err)) fail_msg("%s", err.text);
        memcpy(m.vert + 24, plate.vert, 24 * sizeof *m.vert);
        for (size_t i = 0; i < 36; i++) m.tri[36 + i] = plate.tri[i] + 8;
        sdm_part_audit a = audit_of(&m);
        assert_int_equal(a.mesh.components, 1);
        assert_int_equal(a.n, 2);
        assert_true(a.part[0].met > 0 && a.part[1].met > 0);
        near(a.part[1].volume, flip ? -16 : 16);
        assert_int_equal(a.part[0].state, SDM_PART_SOLID);
        assert_int_equal(a.part[1].state, flip ? SDM_PART_INSIDE_OUT : SDM_PART_SOLID);
        assert_int_equal(a.inside_out, flip);
        sdm_part_audit_dispose(&a);
        size_t n;
        assert_int_equal(sdm_mesh_turn_parts(&m, &n, &err), SDM_OK);
        assert_int_equal(n, flip);
        a = audit_of(&m);
        near(a.mesh.volume, 80);
        sdm_part_audit_dispose(&a);
        sdm_mesh_dispose(&m);
        sdm_mesh_dispose(&plate);
    }
}

/* Two boxes side by side: their common face is there twice, and all its edges are shared. */
static void test_boxes_with_a_common_face(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    add_box(&m, 0, 4, 2, false);
    add_box(&m, 4, 6, 2, false); // the common face is there twice, once each way
    sdm_part_audit a = audit_of(&m);
    assert_int_equal(a.n, 2);
    assert_int_equal(a.inside_out, 0);
    near(a.union_volume, 96);
    sdm_part_audit_dispose(&a);
    sdm_mesh_dispose(&m);
}

/* A shell with a cavity, and a box beside it that is inside out: the engine turns the latter. */
static void test_cavity_and_parts_apart(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    size_t turned, n;
    add_box(&m, 0, 4, 2, false);
    add_box(&m, 1, 3, 1, true);
    add_box(&m, 7, 8, 0.5, true);
    sdm_part_audit a = audit_of(&m);
    assert_int_equal(a.part[0].state, SDM_PART_SOLID);
    assert_int_equal(a.part[1].state, SDM_PART_CAVITY);
    assert_int_equal(a.part[2].state, SDM_PART_SOLID);
    assert_true(!a.part[1].turned && a.part[2].turned && !a.inside_out);
    near(a.union_volume, 64 - 8 + 1);
    near(a.union_volume, engine_volume(&m, &turned));
    near(sdm_part_gap(&m, &a, 2), 3);
    near(sdm_part_gap(&m, &a, 1), 3); // of the box with its cavity
    assert_int_equal(turned, 1);
    sdm_part_audit_dispose(&a);
    assert_int_equal(sdm_mesh_turn_parts(&m, &n, &err), SDM_OK);
    assert_int_equal(n, 1);
    a = audit_of(&m);
    near(a.mesh.volume, 64 - 8 + 1);
    sdm_part_audit_dispose(&a);
    sdm_mesh_dispose(&m);
}

/* A long bar beside a small box: its vertices lie far from the box, its middle near. */
static void test_gap_of_a_bar(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    add_box(&m, -1, 1, 1, false);
    add_box(&m, -1, 1, 1, false);
    for (size_t v = 8; v < 16; v++) m.vert[3 * v + 1] *= 100, m.vert[3 * v] += 5.25;
    sdm_part_audit a = audit_of(&m);
    assert_int_equal(a.n, 2);
    near(sdm_part_gap(&m, &a, 0), 3.25);
    near(sdm_part_gap(&m, &a, 1), 3.25);
    sdm_part_audit_dispose(&a);
    sdm_mesh_dispose(&m);
}

/* Two groups of two boxes that overlap, 2 mm apart, in an order that mixes them; a cavity belongs
 * to the part around it. */
static void test_groups(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    add_box(&m, 0, 4, 2, false);
    add_box(&m, 8, 10, 2, false);
    add_box(&m, 3, 6, 1, false);
    add_box(&m, 9, 12, 1, false);
    add_box(&m, 1, 2, 0.25, true);
    sdm_part_audit a = audit_of(&m);
    static const size_t group[] = {0, 1, 0, 1, 0};
    assert_int_equal(a.n, 5);
    for (size_t i = 0; i < 5; i++) assert_int_equal(a.part[i].group, group[i]);
    assert_int_equal(a.bodies, 2);
    for (size_t i = 0; i < 5; i++) near(sdm_part_gap(&m, &a, i), 2);
    sdm_part_audit_dispose(&a);
    sdm_mesh_dispose(&m);
}

/* An open box: the engine turns nothing, and the closed box beside it that is inside out is not
 * solid. */
static void test_open_and_flat_parts(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    add_box(&m, 0, 4, 2, false);
    m.n_tri--;
    add_box(&m, 7, 8, 0.5, true);
    sdm_part_audit a = audit_of(&m);
    assert_int_equal(a.part[0].state, SDM_PART_OPEN);
    assert_int_equal(a.part[0].open_edges, 3);
    int at_side = 0;
    for (int d = 0; d < 3; d++)
        at_side +=
            a.part[0].open_at[d] == a.part[0].min[d] || a.part[0].open_at[d] == a.part[0].max[d];
    assert_true(at_side > 0);
    assert_int_equal(a.part[1].state, SDM_PART_INSIDE_OUT);
    assert_true(isnan(a.union_volume));
    sdm_part_audit_dispose(&a);
    sdm_mesh_dispose(&m);
    // a box; two triangles with the same vertices in opposite order, which are a flat part; and a
    // triangle with a vertex given twice, which belongs to no part
    add_box(&m, 0, 4, 2, false);
    const size_t v = m.n_vert, t = m.n_tri;
    mesh_make(&m, v + 3, t + 3);
    mesh_vertex(&m, v, 9, 0, 0);
    mesh_vertex(&m, v + 1, 9, 1, 0);
    mesh_vertex(&m, v + 2, 9, 0, 1);
    mesh_triangle(&m, t, v, v, v + 1);
    mesh_triangle(&m, t + 1, v, v + 1, v + 2);
    mesh_triangle(&m, t + 2, v, v + 2, v + 1);
    a = audit_of(&m);
    assert_int_equal(a.n, 2);
    assert_int_equal(a.part[1].state, SDM_PART_FLAT);
    near(a.union_volume, 64);
    sdm_part_audit_dispose(&a);
    sdm_mesh_dispose(&m);
}

/* The thickness of a box is its shortest edge, also of the part of it that sticks out of another
 * box, and of one that runs the wrong way. */
static void test_thickness(void **state)
{
    (void)state;
    for (int inside_out = 0; inside_out < 2; inside_out++) {
        sdm_mesh m = {0};
        add_box(&m, 0, 4, 2, inside_out);
        add_box(&m, 3, 16, 0.25, inside_out);
        sdm_part_audit a = audit_of(&m);
        near(a.part[0].thick, 4);
        near(a.part[1].thick, 0.5);
        assert_int_equal(sdm_part_audit_thinnest(&a), 1);
        assert_true(sdm_too_thin(a.part[1].thick, 0.36) && !sdm_too_thin(a.part[1].thick, 0.35));
        sdm_part_audit_dispose(&a);
        // a box that lies wholly in the first one has no surface of its own
        add_box(&m, 1, 2, 0.125, inside_out);
        a = audit_of(&m);
        assert_int_equal(a.n, 3);
        near(a.part[1].thick, 0.5);
        sdm_part_audit_dispose(&a);
        sdm_mesh_dispose(&m);
    }
    // a wall: a box with a cavity
    sdm_mesh m = {0};
    add_box(&m, 0, 4, 2, false);
    add_box(&m, 0.5, 3.5, 1.5, true);
    sdm_part_audit a = audit_of(&m);
    assert_int_equal(a.part[1].state, SDM_PART_CAVITY);
    near(a.part[0].thick, 0.5);
    assert_true(isnan(a.part[1].thick));
    sdm_part_audit_dispose(&a);
    // an open mesh
    m.n_tri--;
    a = audit_of(&m);
    assert_int_equal(sdm_part_audit_thinnest(&a), a.n);
    sdm_part_audit_dispose(&a);
    sdm_mesh_dispose(&m);
}

static void test_refusals(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    sdm_part_audit a;
    size_t n;
    assert_int_equal(sdm_part_audit_make(&m, SDM_AUDIT_WALLS | SDM_AUDIT_UNION, NULL, &a, &err),
                     SDM_E_MESH);
    assert_int_equal(sdm_part_audit_make(NULL, SDM_AUDIT_WALLS | SDM_AUDIT_UNION, NULL, &a, &err),
                     SDM_E_ARG);
    assert_int_equal(sdm_mesh_turn_parts(NULL, &n, &err), SDM_E_ARG);
    add_box(&m, 0, 4, 2, false);
    add_box(&m, 3, 6, 1, true);
    int failed = 0;
    for (size_t k = 1; k < 60; k++) {
        sdm_alloc_fail_after(k);
        const sdm_status s =
            sdm_part_audit_make(&m, SDM_AUDIT_WALLS | SDM_AUDIT_UNION, NULL, &a, &err);
        sdm_alloc_fail_after(0);
        assert_true(s == SDM_OK || s == SDM_E_NOMEM);
        failed += s == SDM_E_NOMEM;
        if (!s) sdm_part_audit_dispose(&a);
    }
    assert_true(failed > 10);
    sdm_mesh_dispose(&m);
}

/* A solid of revolution: the outline of n points (radius, z), from the axis to the axis. */
static sdm_mesh revolve(const double (*outline)[2], size_t n)
{
    enum { SECTORS = 24, POINTS = 64 };
    static double vert[POINTS * SECTORS][3];
    static uint32_t tri[2 * POINTS * SECTORS][3];
    size_t n_tri = 0;
    const double turn = 2 * acos(-1) / SECTORS;
    // vertices of ring i: SECTORS * i and the following; an end of the outline, on the axis, is a
    // point: of its ring the triangles use the first vertex only
    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < SECTORS; k++) {
            double *v = vert[i * SECTORS + k];
            v[0] = outline[i][0] * cos(turn * (double)k);
            v[1] = outline[i][0] * sin(turn * (double)k);
            v[2] = outline[i][1];
        }
    for (size_t i = 0; i + 1 < n; i++)
        for (size_t k = 0; k < SECTORS; k++) {
            const uint32_t low = (uint32_t)(i ? i * SECTORS + k : 0),
                           low2 = (uint32_t)(i ? i * SECTORS + (k + 1) % SECTORS : 0),
                           end = (uint32_t)((n - 1) * SECTORS);
            const bool last = i + 2 == n;
            const uint32_t high = last ? end : (uint32_t)((i + 1) * SECTORS + k),
                           high2 = last ? end : (uint32_t)((i + 1) * SECTORS + (k + 1) % SECTORS);
            if (i) memcpy(tri[n_tri++], (uint32_t[]){low, low2, high}, sizeof *tri);
            if (!last) memcpy(tri[n_tri++], (uint32_t[]){low2, high2, high}, sizeof *tri);
        }
    return (sdm_mesh){vert[0], tri[0], n * SECTORS, n_tri, n * SECTORS, n_tri};
}

// The rim of a disc whose two edges cross: the tip beyond the crossing is a loop that runs the
// wrong way round.
static void test_outline_that_crosses_itself(void **state)
{
    (void)state;
    for (int crossed = 0; crossed < 2; crossed++) {
        const double z = crossed ? 1 : -1,
                     outline[8][2] = {{0, -1},      {2, -1},       {2.8, 0.12 * z},
                                      {3, 0.4 * z}, {3, -0.4 * z}, {2.8, -0.12 * z},
                                      {2, 1},       {0, 1}};
        sdm_mesh m = revolve(outline, 8);
        sdm_part_audit a;
        if (sdm_part_audit_make(&m, SDM_AUDIT_WALLS | SDM_AUDIT_UNION, NULL, &a, &err))
            fail_msg("%s", err.text);
        assert_int_equal(a.n, 1);
        assert_int_equal(a.part[0].state, SDM_PART_SOLID);
        // beyond the crossing, at radius 2.714: 32.7 of 94.2 mm^2
        if (crossed)
            assert_true(a.part[0].crossed > 0 && fabs(a.part[0].folded - 0.347) < 0.02);
        else
            assert_true(a.part[0].crossed == 0 && a.part[0].folded == 0);
        sdm_part_audit_dispose(&a);
    }
}

// A disc whose poles are exchanged: its faces are cones that cross at half of the radius, and each
// triangle reaches from the axis to the rim. A quarter of the cones faces the wrong way.
static void test_poles_exchanged(void **state)
{
    (void)state;
    for (int exchanged = 0; exchanged < 2; exchanged++) {
        const double z = exchanged ? 1 : -1, outline[4][2] = {{0, z}, {3, -1}, {3, 1}, {0, -z}};
        const sdm_mesh m = revolve(outline, 4);
        sdm_part_audit a = audit_of(&m);
        assert_int_equal(a.part[0].state, SDM_PART_SOLID);
        // cones of 68 mm^2 and a rim of 37.7 mm^2
        assert_true(exchanged ? fabs(a.part[0].folded - 0.161) < 0.02 : a.part[0].folded == 0);
        sdm_part_audit_dispose(&a);
    }
}

// The same where the cones are a small part of the disc, about the axis: 1.9 % of its surface.
static void test_poles_exchanged_near_the_axis(void **state)
{
    (void)state;
    for (int exchanged = 0; exchanged < 2; exchanged++) {
        const double z = exchanged ? 2.5 : -2.5,
                     outline[6][2] = {{0, z}, {6, -2.5}, {22, -2.5}, {22, 2.5}, {6, 2.5}, {0, -z}};
        const sdm_mesh m = revolve(outline, 6);
        sdm_part_audit a = audit_of(&m);
        assert_int_equal(a.part[0].state, SDM_PART_SOLID);
        const double folded = a.part[0].folded;
        if (exchanged)
            assert_true(folded > SDM_PART_FOLDED_MIN && folded < 0.03);
        else
            assert_true(folded == 0);
        sdm_part_audit_dispose(&a);
    }
}

// The same rim, of which one side lies in a box: the loop is a hole in the box. In two boxes at the
// same place it harms nothing there.
static void test_loop_in_another_part(void **state)
{
    (void)state;
    const double outline[8][2] = {{0, -1},   {2, -1},      {2.8, 0.12}, {3, 0.4},
                                  {3, -0.4}, {2.8, -0.12}, {2, 1},      {0, 1}};
    for (int boxes = 1; boxes < 3; boxes++) {
        sdm_mesh rim = revolve(outline, 8), m = {0};
        for (int i = 0; i < boxes; i++) add_box(&m, 0.01, 4, 4 + i, false);
        const size_t v = m.n_vert, t = m.n_tri;
        assert_int_equal(sdm_mesh_reserve(&m, v + rim.n_vert, t + rim.n_tri, &err), SDM_OK);
        memcpy(m.vert + 3 * v, rim.vert, 3 * rim.n_vert * sizeof *m.vert);
        for (size_t i = 0; i < 3 * rim.n_tri; i++) m.tri[3 * t + i] = rim.tri[i] + (uint32_t)v;
        sdm_part_audit a;
        if (sdm_part_audit_make(&m, SDM_AUDIT_WALLS | SDM_AUDIT_UNION, NULL, &a, &err))
            fail_msg("%s", err.text);
        assert_int_equal(a.n, (size_t)boxes + 1);
        assert_true(fabs(a.part[boxes].folded - (boxes == 1 ? 0.347 : 0.347 / 2)) < 0.02);
        sdm_part_audit_dispose(&a);
        sdm_mesh_dispose(&m);
    }
}

static sdm_part_audit meetings_of(const sdm_mesh *m)
{
    sdm_part_audit a;
    if (sdm_part_audit_make(m, SDM_AUDIT_MEETINGS, NULL, &a, &err)) fail_msg("%s", err.text);
    return a;
}

// Two bars and a body. They meet inside of the body, outside, through its wall, in its cavity, and
// on its flat bottom, which covers them.
static void test_meetings_in_a_third_part(void **state)
{
    (void)state;
    enum { NONE, INSIDE, PARTLY, OUTSIDE };
    static const box body = {{-2, -2, -2}, {2, 2, 2}}, hole = {{-1, -1, -1}, {1, 1, 1}};
    static const struct {
        box a, b;
        bool hole;
        int meet;
    } cases[] = {
        {{{-0.5, -0.4, -0.4}, {4, 0.4, 0.4}}, {{-0.3, -0.3, -0.3}, {0.3, 0.3, 4}}, false, INSIDE},
        {{{-0.5, -0.4, -0.4}, {4, 0.4, 0.4}}, {{-0.3, -0.3, -0.3}, {0.3, 0.3, 4}}, true, OUTSIDE},
        {{{-0.5, -0.4, -0.4}, {4, 0.4, 0.4}}, {{2.5, -0.3, -0.3}, {3, 0.3, 4}}, false, OUTSIDE},
        {{{-0.5, -0.4, -0.4}, {4, 0.4, 0.4}}, {{1.5, -0.3, -0.3}, {3, 0.3, 4}}, false, PARTLY},
        {{{-0.5, -0.4, -0.4}, {4, 0.4, 0.4}}, {{-0.3, -0.3, 1}, {0.3, 0.3, 4}}, false, NONE},
        {{{-0.5, -0.4, -2}, {0.5, 0.4, 1}}, {{-0.3, -0.6, -2}, {0.3, 0.3, 1.5}}, false, INSIDE},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        for (int turned = 0; turned < 2; turned++) { // the engine turns the whole mesh
            sdm_mesh m = {0};
            add(&m, &cases[i].a, turned);
            add(&m, &body, turned);
            add(&m, &cases[i].b, turned);
            if (cases[i].hole) add(&m, &hole, !turned);
            sdm_part_audit a = meetings_of(&m);
            for (size_t k = 0; k < 3; k += 2) {
                const uint32_t other = (uint32_t)1 << (2 - k);
                if (!(a.part[k].meets & other) != (cases[i].meet == NONE) ||
                    !(a.part[k].meets_outside & other) != (cases[i].meet != OUTSIDE) ||
                    !(a.part[k].meets_partly & other) != (cases[i].meet != PARTLY))
                    fail_msg("case %zu, part %zu: %x, %x, %x", i, k, a.part[k].meets,
                             a.part[k].meets_outside, a.part[k].meets_partly);
            }
            sdm_part_audit_dispose(&a);
            sdm_mesh_dispose(&m);
        }
}

// Two bars side by side on a body share a face, or an edge only; inside of the body they share a
// face, too.
static void test_meetings_of_shared_edges(void **state)
{
    (void)state;
    static const box body = {{-2, -2, -2}, {2, 2, 2}};
    for (int inside = 0; inside < 2; inside++)
        for (int edge = 0; edge < 2; edge++) {
            const double low = inside ? -1 : 3, y = edge ? 1 : 0;
            const box a = {{0, 0, low}, {1, 1, low + 1}}, b = {{1, y, low}, {1.5, y + 1, low + 1}},
                      foot = {{-0.5, 0.3, -1}, {0.5, 0.5, low + 0.5}};
            sdm_mesh m = {0};
            add(&m, &body, false);
            add(&m, &a, false);
            add(&m, &b, false);
            add(&m, &foot, false);
            sdm_part_audit audit = meetings_of(&m);
            assert_int_equal(audit.n, 4);
            assert_true(audit.part[1].meets & 4);
            assert_int_equal(!(audit.part[1].meets_outside & 4), inside);
            assert_int_equal(!(audit.part[2].meets_outside & 2), inside);
            sdm_part_audit_dispose(&audit);
            sdm_mesh_dispose(&m);
        }
}

/* Does the box hold x, if it is larger by this on each side? */
static bool holds(const box *b, const double x[3], double larger)
{
    bool in = true;
    for (int d = 0; d < 3; d++) in = in && x[d] > b->low[d] - larger && x[d] < b->high[d] + larger;
    return in;
}

// Random boxes against the corners of the curve along which two of them meet: those of their common
// box that lie on a face of each.
static void test_meetings_of_random_boxes(void **state)
{
    (void)state;
    uint32_t seed = 7;
    size_t seen[3] = {0};
    for (int n = 0; n < 4000; n++) {
        box b[3];
        for (int i = 0; i < 3; i++)
            for (int d = 0; d < 3; d++) {
                double x[2];
                for (int k = 0; k < 2; k++)
                    x[k] = (seed = seed * 1664525 + 1013904223) / 4294967296.0;
                b[i].low[d] = 4 * x[0];
                b[i].high[d] = b[i].low[d] + 1 + (i ? 2 : 5) * x[1];
            }
        bool meet = true, reached = true, clear = true;
        for (int d = 0; d < 3; d++) {
            const double low = fmax(b[1].low[d], b[2].low[d]),
                         high = fmin(b[1].high[d], b[2].high[d]);
            meet = meet && high > low + 0.1;
            // the third box reaches the common one
            reached = reached && low < b[0].high[d] + 0.1 && high > b[0].low[d] - 0.1;
        }
        size_t corners = 0, out = 0;
        for (int c = 0; c < 8 && meet; c++) {
            double x[3];
            int of[2] = {0, 0};
            for (int d = 0; d < 3; d++) {
                const bool upper = c >> d & 1;
                const double u = upper ? b[1].high[d] : b[1].low[d],
                             v = upper ? b[2].high[d] : b[2].low[d];
                const int from = (u < v) != upper; // whose face it is
                x[d] = from ? v : u;
                of[from]++;
            }
            if (!of[0] || !of[1]) continue;
            corners++;
            out += !holds(&b[0], x, 0);
            clear = clear && holds(&b[0], x, 0.1) == holds(&b[0], x, -0.1);
        }
        if (!corners || !clear) continue;
        sdm_mesh m = {0};
        for (int i = 0; i < 3; i++) add(&m, &b[i], false);
        sdm_part_audit a = meetings_of(&m);
        const sdm_part *p = &a.part[1];
        const bool outside = p->meets_outside >> 2 & 1, partly = p->meets_partly >> 2 & 1;
        if (!(p->meets >> 2 & 1) || (outside && partly) || (outside || partly) != (out > 0) ||
            (!reached && !outside))
            fail_msg("boxes %d: %zu of %zu corners outside, %d, %d", n, out, corners, outside,
                     partly);
        seen[outside ? 2 : partly]++;
        sdm_part_audit_dispose(&a);
        sdm_mesh_dispose(&m);
    }
    if (!(seen[0] > 50 && seen[1] > 50 && seen[2] > 50))
        fail_msg("%zu, %zu, %zu", seen[0], seen[1], seen[2]);
}

// Vertices of no triangle: their number, and the first run of them.
static void test_unused_vertices(void **state)
{
    (void)state;
    static const struct {
        size_t spare[2]; // before and after the boxes
        size_t first, last;
    } cases[] = {{{0, 0}, 0, 0}, {{0, 8}, 16, 23}, {{3, 0}, 0, 2}, {{1, 2}, 0, 0}};
    for (size_t i = 0; i < 4; i++) {
        const size_t before = cases[i].spare[0], n = before + cases[i].spare[1];
        sdm_mesh m = {0};
        add_box(&m, 0, 4, 2, false);
        add_box(&m, 3, 6, 1, false);
        if (sdm_mesh_reserve(&m, 16 + n, m.n_tri, &err)) fail_msg("%s", err.text);
        memmove(m.vert + 3 * before, m.vert, 48 * sizeof *m.vert);
        for (size_t k = 0; k < 3 * m.n_tri; k++) m.tri[k] += (uint32_t)before;
        for (size_t k = 0; k < 3 * n; k++) m.vert[k < 3 * before ? k : k + 48] = 500;
        sdm_part_audit a = audit_of(&m);
        assert_int_equal(a.unused, n);
        assert_int_equal(a.unused_first, cases[i].first);
        assert_int_equal(a.unused_last, cases[i].last);
        near(a.union_volume, 64 + 8);
        assert_true(a.mesh.max[0] == 6);
        sdm_part_audit_dispose(&a);
        sdm_mesh_dispose(&m);
    }
}

static bool always(void *user)
{
    (void)user;
    return true;
}

// A disc whose rim is two quarter arcs, the angle of which is taken for rad: the outline goes round
// many times, mostly in the right sense. An audit of it can be stopped.
static void test_crossing_of_arcs(void **state)
{
    (void)state;
    enum { ARC = 12, N = 2 * ARC + 2 };
    for (int degrees = 0; degrees < 2; degrees++) {
        double outline[N][2] = {{0}};
        sdm_part_audit a;
        for (int i = 0; i < 2 * ARC; i++) {
            const double unit = degrees ? 1 : acos(-1) / 180;
            const double angle = 90. / (ARC - 1) * (i % ARC) * unit;
            const bool up = i >= ARC;
            outline[i + 1][0] = 11.1 + 0.9 * (up ? cos(angle) : sin(angle));
            outline[i + 1][1] = up ? 5.1 + 0.9 * sin(angle) : 0.9 - 0.9 * cos(angle);
        }
        outline[N - 1][1] = 6;
        const sdm_mesh m = revolve((const double(*)[2])outline, N);
        if (sdm_part_audit_make(&m, SDM_AUDIT_WALLS, NULL, &a, &err)) fail_msg("%s", err.text);
        assert_true(a.n == 1 && a.part[0].folded < SDM_PART_FOLDED_MIN);
        assert_true(degrees ? a.part[0].crossing > 0.5 : a.part[0].crossing == 0);
        assert_true((sdm_part_tangle(&a.part[0]) > 0.5) == degrees);
        sdm_part_audit_dispose(&a);
        const sdm_exact_opts stop = {.cancelled = always};
        assert_int_equal(sdm_part_audit_make(&m, SDM_AUDIT_WALLS, &stop, &a, &err),
                         SDM_E_CANCELLED);
    }
}

/* The thickness of a body whose radius is radius(z) for -1 <= z <= 1. */
static double thickness_of(double (*radius)(double z))
{
    enum { N = 61 };
    double outline[N][2];
    sdm_part_audit a;
    for (int i = 0; i < N; i++) {
        const double z = -cos(acos(-1) * i / (N - 1));
        outline[i][0] = i && i < N - 1 ? radius(z) : 0;
        outline[i][1] = z;
    }
    const sdm_mesh m = revolve((const double(*)[2])outline, N);
    if (sdm_part_audit_make(&m, SDM_AUDIT_WALLS, NULL, &a, &err)) fail_msg("%s", err.text);
    assert_int_equal(a.n, 1);
    const double thick = a.part[0].thick;
    sdm_part_audit_dispose(&a);
    return thick;
}

static double ball(double z) { return sqrt(1 - z * z); }
static double needle(double z) { return 0.1 * sqrt(1 - z * z); }
static double drop(double z) { return 0.2 * (1 - z); }
/* Two balls with a thin neck. */
static double dumbbell(double z)
{
    const double d = fabs(z) - 0.6;
    return fabs(d) < 0.4 ? fmax(0.05, sqrt(0.16 - d * d)) : 0.05;
}

// A neck counts also where it is a small part of the surface (4 % of it); tips and edges do not.
static void test_thickness_of_necks(void **state)
{
    (void)state;
    assert_true(fabs(thickness_of(ball) - 2) < 0.05);
    const double along = thickness_of(needle);
    assert_true(along > 0.1 && along < 0.21);
    assert_true(thickness_of(drop) > 0.15);
    assert_true(fabs(thickness_of(dumbbell) - 0.1) < 0.005);
}

/* A cup of radius 3 and height 4, with a bottom of this thickness, tilted so that coordinates of
 * the bottom are rounded. */
static sdm_mesh cup(double bottom)
{
    const double outline[6][2] = {{0, 0}, {3, 0}, {3, 4}, {2, 4}, {2, bottom}, {0, bottom}};
    const sdm_mesh m = revolve(outline, 6);
    for (size_t v = 0; v < m.n_vert; v++) {
        double *x = m.vert + 3 * v;
        const double y = 0.8 * x[1] - 0.6 * x[2];
        x[2] = 0.6 * x[1] + 0.8 * x[2];
        x[1] = y;
    }
    return m;
}

// A bottom without thickness, whose faces have different triangles: nothing is between them, and
// the thickness is that of the wall. Of parts that touch along a face none has walls on each other.
static void test_walls_in_one_place(void **state)
{
    (void)state;
    for (int none = 0; none < 2; none++) {
        const sdm_mesh m = cup(none ? 0 : 1e-3);
        sdm_part_audit a = audit_of(&m);
        assert_int_equal(a.part[0].state, SDM_PART_SOLID);
        assert_int_equal(a.part[0].doubled, none);
        assert_true(fabs(a.part[0].thick - (none ? 1 : 1e-3)) < (none ? 0.02 : 1e-9));
        sdm_part_audit_dispose(&a);
    }
    sdm_mesh m = {0};
    add_box(&m, 0, 1, 4, false);
    add_box(&m, 1, 2, 3, false);
    sdm_part_audit a = audit_of(&m);
    assert_true(a.n == 2 && !a.part[0].doubled && !a.part[1].doubled);
    sdm_part_audit_dispose(&a);
    sdm_mesh_dispose(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_overlapping_parts),
        cmocka_unit_test(test_unused_vertices),
        cmocka_unit_test(test_meetings_in_a_third_part),
        cmocka_unit_test(test_meetings_of_shared_edges),
        cmocka_unit_test(test_meetings_of_random_boxes),
        cmocka_unit_test(test_parts_that_share_an_edge),
        cmocka_unit_test(test_boxes_with_a_common_face),
        cmocka_unit_test(test_cavity_and_parts_apart),
        cmocka_unit_test(test_gap_of_a_bar),
        cmocka_unit_test(test_groups),
        cmocka_unit_test(test_open_and_flat_parts),
        cmocka_unit_test(test_poles_exchanged),
        cmocka_unit_test(test_thickness),
        cmocka_unit_test(test_walls_in_one_place),
        cmocka_unit_test(test_thickness_of_necks),
        cmocka_unit_test(test_crossing_of_arcs),
        cmocka_unit_test(test_outline_that_crosses_itself),
        cmocka_unit_test(test_poles_exchanged_near_the_axis),
        cmocka_unit_test(test_loop_in_another_part),
        cmocka_unit_test(test_refusals),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
