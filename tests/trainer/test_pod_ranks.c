/* The trees of a `pod` network of each rank: they follow one another, all trees have a rank, and
 * the largest share of voxels is not much larger than the mean. Tests: pod_ranks.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "comm/comm_types.h"
#include "pod/pod_ranks.h"
#include "sdm/memory.h"

/* Checks the shares of `size` ranks; returns the largest number of voxels of a rank, divided by the
 * mean. */
static double check_shares(pod_state *pod, int size)
{
    const sdm_pod_levels *levels = &pod->arch.levels;
    const size_t n = levels->first[levels->n] - levels->first[levels->n - 1];
    size_t next = 0, most = 0;
    for (int rank = 0; rank < size; rank++) {
        sdm_comm comm = {.rank = rank, .size = size};
        pod->t->hooks.comm = &comm;
        const pod_share share = trainer_pod_share(pod);
        assert_int_equal(share.first, next);
        assert_true(share.end >= share.first);
        next = share.end;
        const size_t begin =
            trainer_pod_place_voxel(pod, trainer_pod_first_block(pod, 0, share.first));
        const size_t end = trainer_pod_place_voxel(pod, trainer_pod_first_block(pod, 0, share.end));
        if (end - begin > most) most = end - begin;
    }
    assert_int_equal(next, n);
    pod->t->hooks.comm = NULL;
    return (double)most * size / (double)pod->arch.n_voxels;
}

/* Makes the blocks of a grid with `levels` levels and checks the shares of 1 to 9 ranks; returns
 * the largest share of two ranks, divided by the mean. */
static double largest_of_two(const int64_t n[3], size_t levels)
{
    trainer t = {0};
    pod_state pod = {.t = &t};
    sdm_error e = {0};
    const sdm_grid g = sdm_grid_centred(n, 1, (double[]){0, 0, 0});
    pod.arch.levels = sdm_pod_count(&g, 8, levels);
    pod.arch.n_voxels = (size_t)(n[0] * n[1] * n[2]);
    if (SDM_ALLOC(&pod.blocks, pod.arch.levels.first[pod.arch.levels.n], "blocks", &e))
        fail_msg("%s", e.text);
    sdm_pod_blocks(&g, 8, &pod.arch.levels, pod.blocks);
    for (int size = 1; size < 10; size++) check_shares(&pod, size);
    const double largest = check_shares(&pod, 2);
    sdm_free(pod.blocks);
    return largest;
}

static void test_trees_at_the_end_of_the_grid_are_smaller(void **state)
{
    (void)state;
    // eight trees: a half of them would have 64 % of the voxels
    assert_true(largest_of_two((int64_t[]){60, 50, 50}, 3) < 1.07);
    // 392 trees
    assert_true(largest_of_two((int64_t[]){60, 50, 50}, 1) < 1.01);
}

static void test_one_tree_has_one_rank(void **state)
{
    (void)state;
    assert_true(largest_of_two((int64_t[]){8, 7, 6}, 1) == 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_trees_at_the_end_of_the_grid_are_smaller),
        cmocka_unit_test(test_one_tree_has_one_rank),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
