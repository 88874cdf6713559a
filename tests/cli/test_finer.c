/* Tests when a fit goes on with finer maps, and which voxel size it advises. A stand-in replaces
 * the fit itself. Tests: fit_finer.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "fit/fit_command.h"

static double spacing; // voxel (mm) of the last finer grid that was made; 0: none was made
static int fits;       // number of fits that began on a finer grid

double cli_fit_map_voxel(const cli_fit *f) { return f->source.grid.spacing[0]; }

sdm_status cli_fit_finer_grid(const cli_fit *f, const double *params, double mm, sdm_grid *out,
                              sdm_error *err)
{
    (void)params, (void)err;
    spacing = mm;
    *out = f->source.grid;
    for (int a = 0; a < 3; a++) {
        out->n[a] = (int64_t)floor((double)f->source.grid.n[a] * f->source.grid.spacing[a] / mm);
        out->spacing[a] = mm;
    }
    return SDM_OK;
}

void cli_fit_default_lengths(cli_fit *f) { (void)f; }

sdm_status cli_fit_swap_side(cli_fit *f, sdm_error *err)
{
    (void)f, (void)err;
    return SDM_OK;
}

sdm_status cli_fit_run(cli_fit *f, sdm_error *err)
{
    (void)err;
    fits++;
    f->result.advised_voxel_mm = NAN;
    return SDM_OK;
}

static void add(cli_fit *f, sdm_fit_check_kind kind, double figure, double limit)
{
    sdm_fit_verdict *v = &f->result.verdict;
    const sdm_fit_grade grade = figure > limit ? SDM_FIT_DOUBTFUL : SDM_FIT_PASSED;
    v->findings[v->n_findings++] =
        (sdm_fit_finding){.kind = kind, .grade = grade, .figure = figure, .limit = limit};
    if (grade > v->grade) v->grade = grade;
}

// A fit with n^3 voxels of 0.5 mm, whose limit is `limit` mm, and with residuals of `residuals`
// times their limit.
static cli_fit fit_of(const cli_args *args, int64_t n, double limit, double residuals)
{
    cli_fit f = {.args = args, .n_params = 2};
    f.source.grid = (sdm_grid){.n = {n, n, n}, .spacing = {0.5, 0.5, 0.5}};
    f.result.advised_voxel_mm = NAN;
    add(&f, SDM_FIT_CHECK_RESIDUALS, residuals * 1.86, 1.86);
    add(&f, SDM_FIT_CHECK_VOXELS, 0.5, limit);
    return f;
}

// The edge that a fit advises, over its own; 0: none.
static double advice(const cli_fit *f)
{
    const double voxel = cli_fit_finer_voxel(f);
    return isfinite(voxel) ? voxel / 0.5 : 0;
}

static void test_advice_where_voxels_pass(void **state)
{
    (void)state;
    static const cli_args args = {0};
    cli_fit f = fit_of(&args, 64, 0.55, 1.2);
    assert_true(fabs(advice(&f) - 0.8) < 1e-12);
    // nothing is in doubt; far beyond the limit; the voxels are clearly fine enough
    f = fit_of(&args, 64, 0.55, 0.99);
    assert_true(advice(&f) == 0);
    f = fit_of(&args, 64, 0.55, 1.6);
    assert_true(advice(&f) == 0);
    f = fit_of(&args, 64, 1.05, 1.2);
    assert_true(advice(&f) == 0);
    // beside the shape, too; then a doubt that voxels do not explain
    f = fit_of(&args, 64, 0.55, 0.9);
    add(&f, SDM_FIT_CHECK_BESIDE, 1.7, 1.5);
    assert_true(fabs(advice(&f) - 0.8) < 1e-12);
    add(&f, SDM_FIT_CHECK_BOUNDS, 1, 0);
    assert_true(advice(&f) == 0);
    // a fit to points measures distances on the triangles of the shape: finer voxels do not help
    double points[3] = {0};
    f = fit_of(&args, 64, 0.55, 1.2);
    f.points = points;
    assert_true(advice(&f) == 0);
    // the advice of the check itself stays
    f = fit_of(&args, 64, 0.4, 1.2);
    f.result.advised_voxel_mm = 0.32;
    assert_true(fabs(advice(&f) - 0.64) < 1e-12);
}

static void test_goes_on_once(void **state)
{
    (void)state;
    static const cli_args args = {0};
    sdm_error err;
    cli_fit f = fit_of(&args, 64, 0.55, 1.2);
    fits = 0, spacing = 0;
    assert_int_equal(cli_fit_go_finer(&f, &err), SDM_OK);
    assert_int_equal(fits, 1);
    assert_true(fabs(spacing - 0.4) < 1e-12);
    assert_true(f.coarse_mm == 0.5 && f.was_nearly_coarse);
    // where they did not help, finer ones are not advised again
    f.source.grid.spacing[0] = 0.4;
    f.result.verdict = (sdm_fit_verdict){0};
    add(&f, SDM_FIT_CHECK_RESIDUALS, 1.9, 1.86);
    add(&f, SDM_FIT_CHECK_VOXELS, 0.4, 0.55);
    assert_true(advice(&f) == 0);
    // 100^3 voxels are too many to try it, and a spacing that was given stays: a command is left
    f = fit_of(&args, 100, 0.55, 1.2);
    assert_int_equal(cli_fit_go_finer(&f, &err), SDM_OK);
    assert_true(f.too_many == 1953125 && f.many_at_most == 524288);
    cli_args given = {0};
    given.spacing[0] = 0.5;
    f = fit_of(&given, 64, 0.55, 1.2);
    assert_int_equal(cli_fit_go_finer(&f, &err), SDM_OK);
    assert_int_equal(fits, 1);
    assert_true(fabs(advice(&f) - 0.8) < 1e-12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_advice_where_voxels_pass),
                                       cmocka_unit_test(test_goes_on_once)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
