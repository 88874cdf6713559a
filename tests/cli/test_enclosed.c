/* Parts of a mask that its border does not reach: a box within walls of one voxel. Tests:
 * enclosed.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "measure/enclosed.h"

enum { N = 16, FIRST = 4, LAST = 11 }; // the walls

static size_t at(int i, int j, int k) { return (size_t)((k * N + j) * N + i); }

// Number of voxels of a box of 6 x 6 x 6 that count as enclosed, with a square hole of `hole` x
// `hole` voxels in one wall.
static size_t enclosed_with(int hole)
{
    const sdm_grid g = {.n = {N, N, N}};
    static unsigned char mask[N * N * N];
    size_t n;
    memset(mask, 1, sizeof mask);
    for (int k = FIRST; k <= LAST; k++)
        for (int j = FIRST; j <= LAST; j++)
            for (int i = FIRST; i <= LAST; i++)
                if (i == FIRST || i == LAST || j == FIRST || j == LAST || k == FIRST || k == LAST)
                    mask[at(i, j, k)] = 0;
    for (int j = 0; j < hole; j++)
        for (int i = 0; i < hole; i++) mask[at(6 + i, 6 + j, LAST)] = 1;
    assert_int_equal(cli_count_enclosed(&g, mask, &n, NULL), SDM_OK);
    return n;
}

static void test_walls_and_holes(void **state)
{
    (void)state;
    assert_int_equal(enclosed_with(0), 6 * 6 * 6);
    // noise opens no wall
    assert_int_equal(enclosed_with(1), 6 * 6 * 6);
    // a hole of three voxels does: but for the twelve edges and eight corners of the box, which
    // have two walls beside them, all is beside a voxel that is reached; below the hole are three
    // voxels of two of the edges, which have one wall
    assert_int_equal(enclosed_with(3), 12 * 4 + 8 - 2 * 3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_walls_and_holes)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
