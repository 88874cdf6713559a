/* The design of a template network from meshes: components, parts with their frames and parents,
 * shapes whose vertices do not correspond.
 * Tests: design.c family.c pieces.c template_parts.c template_maps.c warp_modes.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "sdm/internal/heap.h"
#include "template/design.h"
#include "template/pieces.h"
#include "template/template_parts.h"
#include "template_shapes.h"

static const sdm_distribution uniform[RING_PARAMS];
static double low[RING_PARAMS], high[RING_PARAMS];

// A design that is not computed yet.
static template_design blank(const sdm_instance *shape, const sdm_grid *grid)
{
    size_t n;
    const sdm_param *params = sdm_instance_params(shape, &n);
    for (size_t i = 0; i < n; i++) low[i] = params[i].min, high[i] = params[i].max;
    return (template_design){.grid = grid,
                             .family = {.shape = shape,
                                        .n_params = n,
                                        .min = low,
                                        .max = high,
                                        .distribution = uniform,
                                        .seed = 5,
                                        .n_threads = 2}};
}

static sdm_grid coarse_grid(void)
{
    return sdm_grid_centred((const int64_t[]){34, 30, 26}, 0.5, (const double[]){1, 0, 0});
}

// Part whose vertices contain those of a box; each box belongs to one part.
static size_t part_of(const template_design *d, int box)
{
    const uint32_t v = box ? (uint32_t)(36 + 8 * (box - 1)) : 0;
    for (size_t c = 0; c < d->n_parts; c++)
        for (size_t k = d->first[c]; k < d->first[c + 1]; k++)
            if (d->vertices[k] == v) return c;
    fail_msg("box %d is in no part", box);
    return 0;
}

static void components_join_vertices(void **state)
{
    (void)state;
    mistaken = NONE;
    sdm_instance *shape = instance_of(&mechanism);
    template_design d = blank(shape, NULL);
    assert_int_equal(trainer_family_create(&d.family, NULL), SDM_OK);
    const family *f = &d.family;
    assert_int_equal(f->n_components, BOXES);
    // The 36 vertices of the first box are at 8 places; the last vertex is in no triangle.
    assert_int_equal(f->base.n_vert, 36 + 8 * (BOXES - 1) + 1);
    for (size_t v = 0; v + 1 < f->base.n_vert; v++)
        assert_int_equal(f->component[v], v < 36 ? 0 : (v - 36) / 8 + 1);
    assert_int_equal(f->component[f->base.n_vert - 1], UINT32_MAX);
    // Random parameters are in their ranges and depend on their index only.
    double p[2][LINK_PARAMS], q[LINK_PARAMS];
    for (size_t i = 0; i < 2; i++) trainer_family_params(f, i, p[i]);
    trainer_family_params(f, 0, q);
    assert_memory_equal(p[0], q, sizeof q);
    for (int k = 0; k < LINK_PARAMS; k++)
        assert_true(p[0][k] != p[1][k] && p[0][k] >= low[k] && p[0][k] <= high[k]);
    trainer_template_design_dispose(&d);
    sdm_instance_free(shape);
}

static void mechanism_has_its_parts(void **state)
{
    (void)state;
    mistaken = NONE;
    sdm_instance *shape = instance_of(&mechanism);
    const sdm_grid grid = coarse_grid();
    template_design d = blank(shape, &grid);
    sdm_error e = {0};
    if (trainer_template_design(&d, &e)) fail_msg("%s", e.text);
    // The tool is fixed to the hand: one part.
    assert_int_equal(d.n_parts, BOXES - 1);
    const size_t base = part_of(&d, BASE), arm = part_of(&d, ARM), hand = part_of(&d, HAND),
                 block = part_of(&d, BLOCK);
    assert_int_equal(part_of(&d, TOOL), hand);
    assert_int_equal(d.first[hand + 1] - d.first[hand], 16);
    assert_int_equal(d.first[base + 1] - d.first[base], 36);
    assert_int_equal(d.first[d.n_parts], 36 + 8 * (BOXES - 1));
    const sdm_template_part *p = d.parts;
    assert_true(p[base].frame == SDM_FRAME_NONE && p[base].parent == -1);
    assert_true(p[arm].frame == SDM_FRAME_RIGID && p[arm].parent == -1);
    assert_true(p[hand].frame == SDM_FRAME_RIGID && p[hand].parent == (int)arm);
    assert_true(p[block].frame == SDM_FRAME_AFFINE && p[block].parent == -1);
    // The pivots lie on the axes of the joints: z, and y at the end of the arm.
    assert_true(fabs(p[arm].pivot[0]) < 1e-3 && fabs(p[arm].pivot[1]) < 1e-3);
    const double c = cos(0.1), s = sin(0.1), x = p[hand].pivot[0], y = p[hand].pivot[1];
    assert_true(fabs(c * x + s * y - 2.75) < 1e-3 && fabs(p[hand].pivot[2]) < 1e-3);
    for (size_t k = 0; k < d.n_parts; k++) assert_int_equal(p[k].n_modes, 0);
    assert_int_equal(d.n_numbers, 6 + 6 + 12);
    // Angles that are parameters need polynomials of degree 1.
    assert_int_equal(d.degree, 1);
    assert_true(d.motion_error_mm < 1e-4 && d.warp_error_mm == 0);
    // The lattices `near` reach six voxels beyond the box.
    for (int a = 0; a < 3; a++) {
        const sdm_lattice *l = &p[base].near;
        assert_true(l->origin[a] <= box_low[BASE][a] - 3 + 1e-9 && l->spacing == 0.5);
        assert_true(l->origin[a] + 0.5 * (l->n[a] - 1.0) >= box_high[BASE][a] + 3 - 1e-9);
    }
    trainer_template_design_dispose(&d);
    sdm_instance_free(shape);
}

static void expect_unsupported(const sdm_instance *shape, const char *says)
{
    const sdm_grid grid = coarse_grid();
    template_design d = blank(shape, &grid);
    sdm_error e = {0};
    assert_int_equal(trainer_template_design(&d, &e), SDM_E_UNSUPPORTED);
    if (!strstr(e.text, says) || !strstr(e.text, "mechanism")) fail_msg("%s", e.text);
    trainer_template_design_dispose(&d);
}

// A mesh that differs is found wherever it appears: among the first samples or the last ones.
static void other_meshes_are_refused(void **state)
{
    (void)state;
    const mistake mistakes[] = {COUNT, WINDING};
    const size_t samples[] = {0, 191, 192, 767};
    for (size_t k = 0; k < 2; k++)
        for (size_t i = 0; i < 4; i++) {
            mistaken = mistakes[k];
            sdm_instance *shape = instance_of(&mechanism);
            template_design d = blank(shape, NULL);
            double p[LINK_PARAMS];
            trainer_family_params(&d.family, samples[i], p);
            strange = p[0];
            expect_unsupported(shape, "vertices do not correspond");
            sdm_instance_free(shape);
        }
    mistaken = NONE;
}

// A grid so fine that a template would not fit into memory.
static void fine_grid_is_refused(void **state)
{
    (void)state;
    mistaken = NONE;
    sdm_instance *shape = instance_of(&mechanism);
    const sdm_grid grid =
        sdm_grid_centred((const int64_t[]){8, 8, 8}, 1e-3, (const double[]){0, 0, 1});
    template_design d = blank(shape, &grid);
    sdm_error e = {0};
    assert_int_equal(trainer_template_design(&d, &e), SDM_E_UNSUPPORTED);
    assert_non_null(strstr(e.text, "too large"));
    trainer_template_design_dispose(&d);
    sdm_instance_free(shape);
}

// A cavity, or a part that bends: the shape is one part.
static void some_shapes_are_one_part(void **state)
{
    (void)state;
    const mistake mistakes[] = {CAVITY, BEND};
    for (size_t k = 0; k < 2; k++) {
        mistaken = mistakes[k];
        sdm_instance *shape = instance_of(&mechanism);
        template_design d = blank(shape, NULL);
        sdm_error e = {0};
        if (trainer_family_create(&d.family, &e)) fail_msg("%s", e.text);
        if (trainer_template_parts(&d, 0.01, &e)) fail_msg("%s", e.text);
        assert_int_equal(d.n_parts, 1);
        assert_int_equal(d.first[1], 36 + 8 * (BOXES - 1)); // without the vertex in no triangle
        assert_true(d.parts[0].n_modes > 0 && d.parts[0].parent == -1);
        trainer_template_design_dispose(&d);
        sdm_instance_free(shape);
    }
    mistaken = NONE;
}

// The ring: its modes are those of the shape, and the warp meets the vertices.
static void ring_has_its_modes(void **state)
{
    (void)state;
    sdm_instance *shape = instance_of(&ring);
    const sdm_grid grid =
        sdm_grid_centred((const int64_t[]){24, 24, 12}, 0.45, (const double[]){0, 0, 0});
    template_design d = blank(shape, &grid);
    sdm_error e = {0};
    if (trainer_template_design(&d, &e)) fail_msg("%s", e.text);
    assert_int_equal(d.n_parts, 1);
    assert_int_equal(d.parts[0].n_modes, RING_PARAMS);
    assert_int_equal(d.degree, 1);
    assert_true(d.warp_error_mm < 0.02 * 0.45 && d.motion_error_mm < 1e-3);
    // The model carries the vertices of the default shape to those of another one.
    const double p[RING_PARAMS] = {1, -0.5, 0.7, -1.2};
    sdm_mesh mesh = {0};
    assert_int_equal(sdm_instance_mesh(shape, p, &mesh, &e), SDM_OK);
    double *x = NULL, sum = 0;
    assert_int_equal(SDM_ALLOC(&x, 3 * mesh.n_vert, "vertices", NULL), SDM_OK);
    assert_int_equal(sdm_template_carry(d.model, p, d.family.base.vert, mesh.n_vert, x, &e),
                     SDM_OK);
    for (size_t i = 0; i < 3 * mesh.n_vert; i++)
        sum += (x[i] - mesh.vert[i]) * (x[i] - mesh.vert[i]);
    assert_true(sqrt(sum / (double)mesh.n_vert) < 0.02 * 0.45);
    sdm_free(x);
    sdm_mesh_dispose(&mesh);
    trainer_template_design_dispose(&d);
    sdm_instance_free(shape);
}

// True if the piece contains a vertex with x[0] near `at`.
static bool piece_reaches(const pieces *found, size_t k, const sdm_mesh *m, double at)
{
    for (size_t i = found->first[k]; i < found->first[k + 1]; i++)
        if (fabs(m->vert[3 * found->vertices[i]] - at) < 0.1) return true;
    return false;
}

// Three links and two joints; a link and a bow. Every triangle lies in a piece.
static void welded_links_are_found(void **state)
{
    (void)state;
    for (int bow = 0; bow < 2; bow++) {
        flexing = bow;
        sdm_instance *shape = instance_of(&welded);
        template_design d = blank(shape, NULL);
        const sdm_mesh *m = &d.family.base;
        pieces found;
        assert_int_equal(trainer_family_create(&d.family, NULL), SDM_OK);
        assert_int_equal(trainer_pieces_find(&d.family, 0, 0.005, 0.8, &found, NULL), SDM_OK);
        assert_int_equal(found.n, bow ? 4 : 5);
        // the middles of the links in the order of their size or of their place, then the joints
        const double links[3] = {1.5, 4.5, 7.5};
        for (int l = 0; l < 3; l++) {
            size_t owners = 0;
            for (size_t k = 0; k < found.n; k++)
                if (piece_reaches(&found, k, m, links[l])) {
                    owners++;
                    assert_true(found.flexes[k] == (bow && l == 2));
                }
            assert_int_equal(owners, 1);
        }
        size_t n_flexing = 0;
        for (size_t k = 0; k < found.n; k++) {
            n_flexing += found.flexes[k];
            if (!found.flexes[k]) continue;
            // joints overlap the links by 0.8 mm
            const double at = piece_reaches(&found, k, m, 3) ? 3 : 6;
            assert_true(piece_reaches(&found, k, m, at));
            assert_true(
                piece_reaches(&found, k, m, at - (at == 6 && bow ? 0 : welded_blend) - 0.6));
        }
        assert_int_equal(n_flexing, 2);
        for (size_t t = 0; t < m->n_tri; t++) {
            bool covered = false;
            for (size_t k = 0; k < found.n && !covered; k++) {
                int corners = 0;
                for (size_t i = found.first[k]; i < found.first[k + 1]; i++)
                    for (int c = 0; c < 3; c++)
                        corners += found.vertices[i] == m->tri[3 * t + (size_t)c];
                covered = corners == 3;
            }
            assert_true(covered);
        }
        trainer_pieces_dispose(&found);
        trainer_template_design_dispose(&d);
        sdm_instance_free(shape);
    }
    flexing = false;
}

// A surface that bends everywhere has no rigid piece.
static void ring_has_no_pieces(void **state)
{
    (void)state;
    sdm_instance *shape = instance_of(&ring);
    template_design d = blank(shape, NULL);
    pieces found;
    assert_int_equal(trainer_family_create(&d.family, NULL), SDM_OK);
    assert_int_equal(trainer_pieces_find(&d.family, 0, 0.009, 1.8, &found, NULL), SDM_OK);
    assert_int_equal(found.n, 0);
    trainer_pieces_dispose(&found);
    trainer_template_design_dispose(&d);
    sdm_instance_free(shape);
}

// The design with pieces: the links are parts of a chain, the joints have warps.
static void welded_arm_is_split(void **state)
{
    (void)state;
    sdm_instance *shape = instance_of(&welded);
    const sdm_grid grid =
        sdm_grid_centred((const int64_t[]){30, 34, 34}, 0.5, (const double[]){4.5, 0, 0});
    template_design d = blank(shape, &grid);
    d.split = true;
    sdm_error e = {0};
    if (trainer_template_design(&d, &e)) fail_msg("%s", e.text);
    assert_int_equal(d.n_parts, 5);
    size_t still = 0, chained = 0, joints = 0;
    for (size_t c = 0; c < d.n_parts; c++) {
        const sdm_template_part *p = &d.parts[c];
        joints += p->n_modes > 0;
        still += p->frame == SDM_FRAME_NONE;
        // the last link hangs on the middle one
        chained += !p->n_modes && p->parent >= 0 && !d.parts[p->parent].n_modes;
        assert_true(p->n_modes == 0 || p->frame == SDM_FRAME_RIGID);
    }
    assert_true(joints == 2 && still == 1 && chained == 1);
    assert_true(d.motion_error_mm < 0.01);
    trainer_template_design_dispose(&d);
    sdm_instance_free(shape);
}

static void allocations_may_fail(void **state)
{
    (void)state;
    mistaken = NONE;
    for (int split = 0; split < 2; split++) {
        sdm_instance *shape = instance_of(split ? &welded : &mechanism);
        const sdm_grid grid =
            sdm_grid_centred((const int64_t[]){12, 10, 8}, 2, (const double[]){0, 0, 0});
        sdm_error e;
        sdm_status s = SDM_E_NOMEM;
        for (unsigned long n = 1; s; n += 1 + n / 3) {
            template_design d = blank(shape, &grid);
            d.split = split;
            sdm_alloc_fail_after(n);
            s = trainer_template_design(&d, &e);
            sdm_alloc_fail_after(0);
            trainer_template_design_dispose(&d);
            assert_true(s == SDM_OK || s == SDM_E_NOMEM);
            assert_true(n < 10000000);
        }
        sdm_instance_free(shape);
    }
}

// Several components, or one with pieces, can be several parts; a ring that bends as a whole and a
// shape with a cavity cannot.
static void shapes_that_divide(void **state)
{
    (void)state;
    const struct {
        const sdm_shape *shape;
        mistake mistake;
        bool divides;
    } cases[] = {{&mechanism, BEND, true},
                 {&mechanism, CAVITY, false},
                 {&welded, NONE, true},
                 {&ring, NONE, false}};
    const sdm_grid grid = coarse_grid();
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        sdm_instance *shape = instance_of(cases[i].shape);
        const template_design d = blank(shape, &grid);
        bool divides = !cases[i].divides;
        sdm_error e = {0};
        mistaken = cases[i].mistake;
        if (trainer_template_divides(&d.family, 0.01, &divides, &e)) fail_msg("%s", e.text);
        mistaken = NONE;
        if (divides != cases[i].divides) fail_msg("case %zu", i);
        sdm_instance_free(shape);
    }
}

// A design that is not ready at its time ends.
static void late_design_ends(void **state)
{
    (void)state;
    sdm_instance *shape = instance_of(&mechanism);
    const sdm_grid grid = coarse_grid();
    template_design d = blank(shape, &grid);
    d.family.until = 1e-9;
    sdm_error e = {0};
    assert_int_equal(trainer_template_design(&d, &e), SDM_E_CANCELLED);
    assert_non_null(strstr(e.text, "takes too long"));
    trainer_template_design_dispose(&d);
    sdm_instance_free(shape);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(shapes_that_divide),       cmocka_unit_test(late_design_ends),

        cmocka_unit_test(components_join_vertices), cmocka_unit_test(mechanism_has_its_parts),
        cmocka_unit_test(other_meshes_are_refused), cmocka_unit_test(fine_grid_is_refused),
        cmocka_unit_test(some_shapes_are_one_part), cmocka_unit_test(ring_has_its_modes),
        cmocka_unit_test(welded_links_are_found),   cmocka_unit_test(ring_has_no_pieces),
        cmocka_unit_test(welded_arm_is_split),      cmocka_unit_test(allocations_may_fail)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
