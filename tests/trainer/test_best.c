/* The best weights of a phase and the end of a phase that gains nothing. Tests: best.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "state/best.h"

static char told[1024];

static void tell(void *user, const char *line)
{
    (void)user;
    snprintf(told, sizeof told, "%s", line);
}

// A run with a given patience, and two weights.
static trainer run(sdm_config *c, double patience, parameters *p)
{
    *c = (sdm_config){.train = {.patience = patience}};
    assert_int_equal(trainer_parameters_create(p, 2, NULL), SDM_OK);
    return (trainer){.config = c, .heldout_mse = NAN, .hooks = {.message = tell}};
}

// The weights of the smallest error return, not those of the last one.
static void smallest_error_wins(void **state)
{
    (void)state;
    static const double errors[] = {3, 1, 2, NAN, 1.5};
    sdm_config c;
    parameters p;
    trainer t = run(&c, 0, &p);
    for (int i = 0; i < 5; i++) {
        p.average[0] = (float)i, p.average[1] = (float)-i;
        assert_false(trainer_best_note(&t, &p, 0.2 * i, errors[i]));
    }
    trainer_best_restore(&t, &p);
    assert_true(p.average[0] == 1 && p.average[1] == -1);
    assert_true(t.heldout_mse == 1);
    trainer_parameters_dispose(&p);
}

// Without any evaluation the weights stay as they are.
static void nothing_noted(void **state)
{
    (void)state;
    sdm_config c;
    parameters p;
    trainer t = run(&c, 0.3, &p);
    p.average[0] = 7;
    trainer_best_restore(&t, &p);
    assert_true(p.average[0] == 7 && isnan(t.heldout_mse));
    trainer_parameters_dispose(&p);
}

// A phase ends when the error has not fallen by 1 % for more than the patience; gains below 1 % add
// up until they count.
static void patience_ends_a_phase(void **state)
{
    (void)state;
    sdm_config c;
    parameters p;
    trainer t = run(&c, 0.25, &p);
    assert_false(trainer_best_note(&t, &p, 0, 1));
    assert_false(trainer_best_note(&t, &p, 0.1, 0.996));
    assert_false(trainer_best_note(&t, &p, 0.2, 0.989)); // 1.1 % below the error at 0
    assert_false(trainer_best_note(&t, &p, 0.44, 0.985));
    assert_true(trainer_best_note(&t, &p, 0.46, 0.985));
    // the best weights are the last ones although they were no gain
    assert_true(p.best_mse == 0.985);
    trainer_ended_early(&t, 0.46);
    assert_non_null(strstr(told, "46 % of its budget"));
    trainer_parameters_dispose(&p);
}

// patience 0: never
static void no_patience_key(void **state)
{
    (void)state;
    sdm_config c;
    parameters p;
    trainer t = run(&c, 0, &p);
    for (int i = 0; i <= 10; i++) assert_false(trainer_best_note(&t, &p, 0.1 * i, 1));
    trainer_parameters_dispose(&p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(smallest_error_wins),
        cmocka_unit_test(nothing_noted),
        cmocka_unit_test(patience_ends_a_phase),
        cmocka_unit_test(no_patience_key),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
