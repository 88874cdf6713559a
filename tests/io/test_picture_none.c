/* A build without cairo: every picture is refused with a message that names the missing build
 * option.
 * Tests: picture_none.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/picture.h"

static void test_pictures_are_refused(void **state)
{
    (void)state;
    const sdm_grid grid = {.n = {1, 1, 1}};
    const float value = 0;
    const double x = 0;
    const sdm_picture_map map = {.title = "a", .values = &value};
    const sdm_picture_surface surface = {0};
    const sdm_curve curve = {"a", &x, &x, 1};
    for (int i = 0; i < 6; i++) {
        sdm_error err = {0};
        const sdm_status s =
            i == 0   ? sdm_picture_slices("a.png", &grid, &map, 1, NULL, 0, &err)
            : i == 1 ? sdm_picture_overlay("a.png", &grid, &value, &map, 1, "", &err)
            : i == 2 ? sdm_picture_surfaces("a.png", &surface, 1, "", &err)
            : i == 3 ? sdm_picture_gallery("a.png", &surface, 1, "", &err)
            : i == 4 ? sdm_picture_plot("a.png", "", "", "", false, &curve, 1, &err)
                     : sdm_picture_check("a.png", &err);
        assert_int_equal(s, SDM_E_UNSUPPORTED);
        assert_non_null(strstr(err.text, "a.png"));
        assert_non_null(strstr(err.text, "SDM_PICTURE"));
    }
    assert_int_equal(sdm_picture_check(NULL, NULL), SDM_E_ARG);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_pictures_are_refused)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
