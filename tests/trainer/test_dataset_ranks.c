/* Training maps of which each of three ranks keeps a part: the parts are those of the maps of one
 * process, whether they are made before or during the training or taken from another data set, and
 * together they are whole. Tests: dataset.c dataset_fill.c dataset_ranks.c producer.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <unistd.h>

#include <cmocka.h>

#include "data/dataset_fill.h"
#include "data/dataset_ranks.h"
#include "data/producer.h"
#include "sdm/internal/comm.h"
#include "train_tools.h"

enum { RANKS = 3, VOXELS = 6 * 5 * 4, STATIC = 9, START = 40, ONLINE = 7, ALL = STATIC + START };

/* Rank 1 keeps nothing. */
static const size_t SHARE[RANKS + 1] = {0, 50, 50, VOXELS};

static sdm_config config;
static sdm_pod_block block;
static dataset one; // that of one process

/* A data set of capsules with all maps but those made during the training. known: NULL, or a data
 * set that has the maps. */
static sdm_status create(dataset *d, sdm_comm *comm, const dataset *known, sdm_error *err)
{
    const fill_hooks none = {0};
    *d = (dataset){.comm = comm,
                   .shape = capsule,
                   .grid = &config.grid,
                   .n_voxels = VOXELS,
                   .n_blocks = 1,
                   .blocks = &block,
                   .seed = 5,
                   .known = known};
    sdm_instance_params(capsule, &d->n_params);
    sdm_status s = sdm_train_ranges(&config, capsule, d->min, d->max, err);
    if (!s) s = sdm_train_distributions(&config, capsule, d->min, d->max, d->distribution, err);
    if (!s) s = trainer_dataset_size(d, &config, err);
    if (!s && comm) s = SDM_ALLOC(&d->share, RANKS + 1, "test", err);
    if (!s && comm) memcpy(d->share, SHARE, sizeof SHARE);
    if (!s) s = trainer_dataset_create(d, &config, err);
    return s ? s : trainer_dataset_fill(d, 1, &none, err);
}

/* Makes the random samples that a training makes meanwhile. */
static sdm_status make_more(dataset *d, sdm_error *err)
{
    producer *p = NULL;
    sdm_status s = trainer_producer_start(d, d->n_taken, 1, &p, err);
    if (!s) s = trainer_producer_take(p, START + ONLINE, err);
    trainer_producer_stop(p);
    return s;
}

static int make_maps(void **state)
{
    static const char text[] = "shape: {name: capsule}\n"
                               "grid: {size: [6, 5, 4], spacing: 3}\n"
                               "network: {kind: pod}\n"
                               "data: {static: 3, start: 40, online: 7, holdout: 4}\n"
                               "train: {steps: 1}\n";
    sdm_error e = {0};
    const int failed = set_up(state);
    config = parse_config(text, NULL, 0);
    const sdm_pod_levels levels = sdm_pod_count(&config.grid, 6, 1);
    sdm_pod_blocks(&config.grid, 6, &levels, &block);
    if (create(&one, NULL, NULL, &e) || make_more(&one, &e)) fail_msg("%s", e.text);
    return failed;
}

static int free_maps(void **state)
{
    trainer_dataset_dispose(&one);
    return tear_down(state);
}

/* true if the first n slots hold this rank's parts of the maps of one process, and whole maps can
 * be put together. */
static bool same_maps(const dataset *d, size_t n)
{
    int16_t map[VOXELS];
    const int rank = sdm_comm_rank(d->comm);
    bool good = d->n_kept == SHARE[rank + 1] - SHARE[rank];
    for (size_t slot = 0; slot < n; slot++) {
        good =
            good && d->scale[slot] == one.scale[slot] &&
            !memcmp(d->params + slot * d->n_params, one.params + slot * d->n_params,
                    d->n_params * sizeof *d->params) &&
            !memcmp(trainer_dataset_values(d, slot, d->first_kept),
                    trainer_dataset_values(&one, slot, d->first_kept), d->n_kept * sizeof *d->maps);
        good = !trainer_dataset_whole(d, slot, map, NULL) && good &&
               !memcmp(map, trainer_dataset_values(&one, slot, 0), sizeof map);
    }
    return good && !memcmp(d->holdout, one.holdout, d->n_holdout * VOXELS * sizeof *d->holdout);
}

/* The test on each rank. */
static bool all_maps(sdm_comm *c)
{
    dataset first = {0}, second = {0};
    sdm_error e = {0};
    bool good = !create(&first, c, NULL, &e) && same_maps(&first, ALL) && !make_more(&first, &e) &&
                same_maps(&first, ALL + ONLINE);
    // maps that are there already
    good = good && !create(&second, c, &first, &e) && same_maps(&second, ALL);
    trainer_dataset_dispose(&first);
    trainer_dataset_dispose(&second);
    return good;
}

static void each_rank_keeps_its_part(void **state)
{
    (void)state;
    sdm_comm *c = NULL;
    sdm_error e = {0};
    if (sdm_comm_fork(RANKS, &c, &e)) fail_msg("%s", e.text);
    bool good[RANKS] = {false};
    const int rank = sdm_comm_rank(c);
    good[rank] = all_maps(c);
    const sdm_status s = sdm_comm_gather_shares(c, good, RANKS, sizeof *good, NULL);
    sdm_comm_end(&c);
    if (rank) _exit(0);
    assert_int_equal(s, SDM_OK);
    for (int r = 0; r < RANKS; r++) assert_true(good[r]);
}

static void one_process_has_whole_maps(void **state)
{
    (void)state;
    int16_t map[VOXELS];
    assert_int_equal(trainer_dataset_whole(&one, 3, map, NULL), SDM_OK);
    assert_memory_equal(map, trainer_dataset_values(&one, 3, 0), sizeof map);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_rank_keeps_its_part),
        cmocka_unit_test(one_process_has_whole_maps),
    };
    return cmocka_run_group_tests(tests, make_maps, free_maps);
}
