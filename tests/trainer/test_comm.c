/* Ranks made by fork(): shares, broadcasts, gathers and scatters of more bytes than they send at a
 * time, agreement on an error, and the end of a rank that is killed. Tests: comm.c comm_fork.c */
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#include "sdm/internal/comm.h"
#include "sdm/memory.h"

enum { RANKS = 3, UNITS = 1000001, UNIT = 5 };

static sdm_comm *start(void)
{
    sdm_comm *c = NULL;
    sdm_error e = {0};
    if (sdm_comm_fork(RANKS, &c, &e)) fail_msg("%s", e.text);
    return c;
}

/* Ends the ranks; only rank 0 returns. */
static void finish(sdm_comm *c)
{
    const int rank = sdm_comm_rank(c);
    sdm_comm_end(&c);
    if (rank) _exit(0);
}

static uint8_t value(size_t i) { return (uint8_t)(i * 2654435761u >> 13); }

/* true if this rank gets what the others have. */
static bool exchange(sdm_comm *c)
{
    const int rank = sdm_comm_rank(c);
    uint8_t *data = NULL;
    if (SDM_ALLOC(&data, UNITS * UNIT, "test", NULL)) return false;
    const size_t first = sdm_comm_first(c, UNITS, rank) * UNIT,
                 end = sdm_comm_first(c, UNITS, rank + 1) * UNIT;
    for (size_t i = first; i < end; i++) data[i] = value(i);
    bool good = !sdm_comm_gather_shares(c, data, UNITS, UNIT, NULL);
    for (size_t i = 0; i < UNITS * UNIT; i++) good = good && data[i] == value(i);
    // parts of any size, one of them empty
    const size_t at[RANKS + 1] = {3, 4, 4, 9};
    memset(data, rank, 16);
    good = good && !sdm_comm_gather(c, data, at, NULL);
    const uint8_t mine = (uint8_t)rank, expected[] = {mine, mine, mine, 0, 2, 2, 2, 2, 2, mine};
    good = good && !memcmp(data, expected, sizeof expected);
    memset(data, rank, UNITS * UNIT);
    good = good && !sdm_comm_broadcast(c, 2, data, UNITS * UNIT, NULL);
    for (size_t i = 0; i < UNITS * UNIT; i++) good = good && data[i] == 2;
    sdm_free(data);
    size_t least = 7 + (size_t)(rank == 1 ? 0 : 5 + rank);
    good = good && !sdm_comm_least(c, &least, NULL) && least == 7;
    return good;
}

static void data_arrive(void **state)
{
    (void)state;
    sdm_comm *c = start();
    bool good[RANKS] = {false};
    good[sdm_comm_rank(c)] = exchange(c);
    const sdm_status s = sdm_comm_gather_shares(c, good, RANKS, sizeof *good, NULL);
    finish(c);
    assert_int_equal(s, SDM_OK);
    for (int r = 0; r < RANKS; r++) assert_true(good[r]);
}

/* true if this rank gets its parts of the arrays of the others; rank 1 has none, rank 0 has an
 * empty part. */
static bool scatter(sdm_comm *c)
{
    const int rank = sdm_comm_rank(c);
    const size_t at[RANKS + 1] = {0, 0, 1700001, UNITS * UNIT}, own = at[rank + 1] - at[rank];
    uint8_t *data = NULL, *parts = NULL;
    if (SDM_ALLOC(&data, UNITS * UNIT, "test", NULL)) return false;
    if (SDM_ALLOC(&parts, RANKS * UNITS * UNIT, "test", NULL)) return false;
    for (size_t i = 0; i < UNITS * UNIT; i++) data[i] = (uint8_t)(value(i) + rank);
    void *to[RANKS] = {parts, NULL, parts + UNITS * UNIT};
    bool good = !sdm_comm_scatter(c, rank == 1 ? NULL : data, at, to, NULL);
    for (int r = 0; r < RANKS; r += 2) {
        const uint8_t *part = to[r];
        for (size_t i = 0; i < own; i++)
            good = good && part[i] == (uint8_t)(value(at[rank] + i) + r);
        good = good && part[own] == 0; // nothing behind it
    }
    sdm_free(parts);
    sdm_free(data);
    return good;
}

static void parts_arrive(void **state)
{
    (void)state;
    sdm_comm *c = start();
    bool good[RANKS] = {false};
    good[sdm_comm_rank(c)] = scatter(c);
    const sdm_status s = sdm_comm_gather_shares(c, good, RANKS, sizeof *good, NULL);
    finish(c);
    assert_int_equal(s, SDM_OK);
    for (int r = 0; r < RANKS; r++) assert_true(good[r]);
}

static void all_learn_of_an_error(void **state)
{
    (void)state;
    sdm_comm *c = start();
    sdm_error e = {0};
    const int rank = sdm_comm_rank(c);
    bool good[RANKS] = {false};
    good[rank] = !sdm_comm_agree(c, SDM_OK, &e) && !sdm_comm_agreed(c);
    const sdm_status mine = rank ? sdm_fail(&e, SDM_E_IO, "error of rank %d", rank) : SDM_OK;
    good[rank] = good[rank] && sdm_comm_agree(c, mine, &e) == SDM_E_IO && sdm_comm_agreed(c) &&
                 e.status == SDM_E_IO && !strcmp(e.text, "error of rank 1");
    const sdm_status s = sdm_comm_gather_shares(c, good, RANKS, sizeof *good, NULL);
    const bool agreed = sdm_comm_agreed(c);
    finish(c);
    assert_int_equal(s, SDM_OK);
    assert_false(agreed);
    for (int r = 0; r < RANKS; r++) assert_true(good[r]);
}

static void a_killed_rank_ends_all(void **state)
{
    (void)state;
    char data[RANKS] = "";
    sdm_error e = {0};
    const time_t began = time(NULL);
    sdm_comm *c = start();
    if (sdm_comm_rank(c) == 1) kill(getpid(), SIGKILL);
    const sdm_status s = sdm_comm_gather_shares(c, data, RANKS, 1, &e);
    const bool broken = sdm_comm_broken(c);
    finish(c);
    assert_int_equal(s, SDM_E_IO);
    assert_true(broken);
    assert_non_null(strstr(e.text, "rank 1 of 3 was killed by signal 9"));
    assert_true(time(NULL) - began < 10);
}

static void an_aborting_rank_tells_why(void **state)
{
    (void)state;
    char data[RANKS] = "";
    sdm_error e = {0};
    sdm_comm *c = start();
    if (sdm_comm_rank(c) == 2) {
        sdm_comm_abort(c, "no memory here");
        _exit(1);
    }
    const sdm_status s = sdm_comm_gather_shares(c, data, RANKS, 1, &e);
    finish(c);
    assert_int_equal(s, SDM_E_IO);
    assert_string_equal(e.text, "no memory here");
}

static void one_process_needs_no_others(void **state)
{
    (void)state;
    int x = 5;
    assert_int_equal(sdm_comm_size(NULL), 1);
    assert_int_equal(sdm_comm_rank(NULL), 0);
    assert_int_equal(sdm_comm_first(NULL, 7, 0), 0);
    assert_int_equal(sdm_comm_first(NULL, 7, 1), 7);
    assert_int_equal(sdm_comm_broadcast(NULL, 0, &x, sizeof x, NULL), SDM_OK);
    assert_int_equal(sdm_comm_agree(NULL, SDM_E_IO, NULL), SDM_E_IO);
    assert_int_equal(x, 5);
    assert_false(sdm_comm_agreed(NULL));
    size_t least = 3;
    assert_int_equal(sdm_comm_least(NULL, &least, NULL), SDM_OK);
    assert_int_equal(least, 3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(data_arrive),
                                       cmocka_unit_test(parts_arrive),
                                       cmocka_unit_test(all_learn_of_an_error),
                                       cmocka_unit_test(a_killed_rank_ends_all),
                                       cmocka_unit_test(an_aborting_rank_tells_why),
                                       cmocka_unit_test(one_process_needs_no_others)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
