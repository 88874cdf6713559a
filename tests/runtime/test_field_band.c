/* Bands of fields: parts of the whole map, also where it is steep.
 * Tests: field_band.c band_doubt.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "runtime/field_scene.h"

static double steep(const double x[3])
{
    return 40 * sin(2 * x[0]) * sin(3 * x[1]) * cos(2 * x[2]);
}

static void test_band_is_part_of_the_map(void **state)
{
    const scene *s = *state;
    for (int t = 0; t < 2; t++) {
        const sdm_grid m = model_grid(t);
        sdm_field *f = open_field(s->model[t], NULL, false);
        for (int c = 0; c < N_CASES; c++) {
            const sdm_grid g = case_grid(&m, &cases[c]);
            const double edge = fmax(g.spacing[0], fmax(g.spacing[1], g.spacing[2]));
            check_band(f, &g, edge);
            check_band(f, &g, 3 * edge);
        }
        // a fine grid: few of its blocks have values
        sdm_grid fine = m;
        for (int a = 0; a < 3; a++) {
            fine.n[a] = 8 * (m.n[a] - 1) + 1;
            fine.spacing[a] = m.spacing[a] / 8;
        }
        assert_true(check_band(f, &fine, 3 * 0.04) < 0.35);
        sdm_field_free(f);
    }
}

/* A map that changes by more than 1 mm per mm: the bound must follow it. */
static void test_band_of_a_steep_map(void **state)
{
    (void)state;
    const sdm_grid m = model_grid(false);
    sdm_model *model = ball_model("bulge", &m, steep);
    sdm_field *f = open_field(model, NULL, false);
    sdm_grid fine = m;
    for (int a = 0; a < 3; a++) {
        fine.n[a] = 6 * (m.n[a] - 1) + 1;
        fine.spacing[a] = m.spacing[a] / 6;
    }
    assert_true(check_band(f, &fine, 0.06) < 1);
    sdm_field_free(f);
    sdm_model_free(model);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_band_is_part_of_the_map),
        cmocka_unit_test(test_band_of_a_steep_map),
    };
    return cmocka_run_group_tests(tests, open_scene, close_scene);
}
