/* The figures of a fit do not depend on how the image is stored: another order of its axes in
 * memory, or a smaller field of view around the shape, gives the same evidence and noise. Images
 * with empty slices and with wrong units.
 * Tests: evidence.c neighbours.c start_search.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "oracle/fit_tools.h"

// Axis a of *to is axis axis[a] of the image, without `cut` voxels at either end; the caller frees.
static float *store_again(const float *v, const int axis[3], int64_t cut, sdm_grid *to)
{
    const sdm_grid from = image_grid();
    const double corner[3] = {(double)cut, (double)cut, (double)cut};
    *to = from;
    sdm_grid_world(&from, corner, to->origin);
    for (int a = 0; a < 3; a++) {
        to->n[a] = from.n[axis[a]] - 2 * cut;
        to->spacing[a] = from.spacing[axis[a]];
        for (int k = 0; k < 3; k++) to->dir[3 * k + a] = from.dir[3 * k + axis[a]];
    }
    float *out = calloc(sdm_grid_count(to), sizeof *out);
    if (!out) abort();
    size_t count = 0;
    int64_t i[3], at[3];
    for (i[2] = 0; i[2] < to->n[2]; i[2]++)
        for (i[1] = 0; i[1] < to->n[1]; i[1]++)
            for (i[0] = 0; i[0] < to->n[0]; i[0]++) {
                for (int a = 0; a < 3; a++) at[axis[a]] = i[a] + cut;
                out[count++] = v[(at[2] * from.n[1] + at[1]) * from.n[0] + at[0]];
            }
    return out;
}

static void assert_same(double found, double wanted, double share)
{
    if (!(fabs(found - wanted) <= share * fabs(wanted))) fail_msg("%g, not %g", found, wanted);
}

static void test_order_and_field_of_view(void **state)
{
    (void)state;
    const struct {
        int axis[3];
        int64_t cut;
    } cases[] = {{{2, 0, 1}, 0}, {{1, 0, 2}, 0}, {{0, 1, 2}, 2}, {{2, 1, 0}, 2}};
    float *v = phantom(TRUTH, &POSE, 1, 9);
    const sdm_fit_target whole = image_of(v);
    sdm_fit_opts o = near_start();
    o.margin = 0.6; // the smaller fields of view hold it
    sdm_fit_result r = fit(&whole, &o);
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        sdm_fit_target t = {.kind = SDM_FIT_IMAGE};
        float *again = store_again(v, cases[c].axis, cases[c].cut, &t.grid);
        t.values = again;
        sdm_fit_result f = fit(&t, &o);
        assert_int_equal(f.n_used, r.n_used);
        assert_same(f.evidence, r.evidence, 0.01);
        assert_same(f.noise_factor, r.noise_factor, 0.01);
        for (int k = 0; k < 9; k++) assert_same(f.sd[k], r.sd[k], 0.02);
        sdm_fit_dispose(&f);
        free(again);
    }
    sdm_fit_dispose(&r);
    free(v);
}

// Every second slice is empty: a search that looks at every second voxel must not look there only.
static void test_empty_slices(void **state)
{
    (void)state;
    float *v = phantom(TRUTH, &POSE, 1, 9);
    const sdm_fit_target t = image_of(v);
    for (int64_t i = 0; i < (int64_t)sdm_grid_count(&t.grid); i++)
        if (i / (t.grid.n[0] * t.grid.n[1]) % 2 == 0) v[i] = NAN;
    sdm_fit_opts o = near_start();
    o.turns = SDM_FIT_TURNS_AXIS;
    o.n_turns = 2;
    sdm_fit_result r = fit(&t, &o);
    assert_true(r.n_nan > 0);
    for (int k = 0; k < 3; k++) assert_true(fabs(r.params[k] - TRUTH[k]) < 5 * r.sd[k]);
    sdm_fit_dispose(&r);
    free(v);
}

// An image whose unit is not mm: its voxels are larger than the shape.
static void test_voxels_larger_than_the_shape(void **state)
{
    (void)state;
    float *v = phantom(TRUTH, &POSE, 1, 9);
    sdm_fit_target t = image_of(v);
    for (int k = 0; k < 3; k++) t.grid.spacing[k] *= 1000;
    const sdm_fit_source source = exact_source();
    const sdm_fit_opts o = near_start();
    sdm_fit_result r;
    sdm_error err = {0};
    assert_int_equal(sdm_fit(&source, &t, &o, &r, &err), SDM_E_ARG);
    assert_non_null(strstr(err.text, "voxels of 280 mm are larger than the shape"));
    free(v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_order_and_field_of_view),
                                       cmocka_unit_test(test_empty_slices),
                                       cmocka_unit_test(test_voxels_larger_than_the_shape)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
