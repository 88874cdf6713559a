/* Teams of threads: every iteration runs once, in any team, and the threads really share a loop.
 * Tests: team.c */
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "sdm/internal/team.h"

enum { N = 1000, THREADS_MAX = 8 };

typedef struct counts {
    int n_threads;
    atomic_int iteration[N], member[THREADS_MAX], wrong;
} counts;

static void count(void *user, size_t index, int member)
{
    counts *c = user;
    if (member < 0 || member >= c->n_threads)
        atomic_fetch_add(&c->wrong, 1);
    else
        atomic_fetch_add(&c->member[member], 1);
    atomic_fetch_add(&c->iteration[index], 1);
}

static void every_iteration_runs_once(void **state)
{
    (void)state;
    const int sizes[] = {1, 2, 3, THREADS_MAX};
    for (size_t k = 0; k < sizeof sizes / sizeof *sizes; k++) {
        sdm_team *team;
        assert_int_equal(sdm_team_start(sizes[k], &team, NULL), SDM_OK);
        // many short loops, with all numbers of iterations and with fewer threads than the team has
        for (size_t n = 0; n <= N; n = n < 20 ? n + 1 : n * 2) {
            for (int threads = 1; threads <= sizes[k]; threads++) {
                counts c = {.n_threads = threads};
                sdm_team_run(threads, n, count, &c);
                assert_int_equal(c.wrong, 0);
                for (size_t i = 0; i < N; i++) assert_int_equal(c.iteration[i], i < n);
            }
        }
        sdm_team_end(team);
    }
}

/* Three iterations that wait for each other: they end only if three threads compute them. */
typedef struct meeting {
    pthread_mutex_t lock;
    pthread_cond_t all;
    int present, members;
} meeting;

static void meet(void *user, size_t index, int member)
{
    meeting *m = user;
    (void)index;
    pthread_mutex_lock(&m->lock);
    m->members |= 1 << member;
    if (++m->present == 3) pthread_cond_broadcast(&m->all);
    while (m->present < 3) pthread_cond_wait(&m->all, &m->lock);
    pthread_mutex_unlock(&m->lock);
}

static void threads_share_a_loop(void **state)
{
    (void)state;
    sdm_team *team;
    assert_int_equal(sdm_team_start(3, &team, NULL), SDM_OK);
    for (int round = 0; round < 100; round++) {
        meeting m = {PTHREAD_MUTEX_INITIALIZER, PTHREAD_COND_INITIALIZER, 0, 0};
        sdm_team_run(3, 3, meet, &m);
        assert_int_equal(m.members, 7); // 0, 1 and 2, each of them once
    }
    sdm_team_end(team);
}

static void nested(void *user, size_t index, int member)
{
    counts *inner = (counts *)user + index;
    (void)member;
    inner->n_threads = 1;
    sdm_team_run(THREADS_MAX, 10, count, inner);
}

static void a_task_runs_loops_alone(void **state)
{
    (void)state;
    static counts inner[4];
    sdm_team *team;
    assert_int_equal(sdm_team_start(THREADS_MAX, &team, NULL), SDM_OK);
    sdm_team_run(THREADS_MAX, 4, nested, inner);
    for (int i = 0; i < 4; i++) {
        assert_int_equal(inner[i].wrong, 0);
        assert_int_equal(inner[i].member[0], 10);
    }
    sdm_team_end(team);
}

static void *lead(void *user)
{
    sdm_team *team;
    counts c = {.n_threads = 3};
    int *failed = user;
    if (sdm_team_start(3, &team, NULL)) return NULL;
    for (int round = 0; round < 200; round++) sdm_team_run(3, N, count, &c);
    for (size_t i = 0; i < N; i++) *failed |= c.iteration[i] != 200;
    *failed |= c.wrong != 0;
    sdm_team_end(team);
    return NULL;
}

static void two_threads_lead_teams_of_their_own(void **state)
{
    (void)state;
    pthread_t other;
    int failed[2] = {0};
    assert_int_equal(pthread_create(&other, NULL, lead, &failed[1]), 0);
    lead(&failed[0]);
    pthread_join(other, NULL);
    assert_false(failed[0] || failed[1]);
}

static void the_outer_team_returns(void **state)
{
    (void)state;
    sdm_team *outer, *inner;
    assert_int_equal(sdm_team_start(3, &outer, NULL), SDM_OK);
    assert_int_equal(sdm_team_start(1, &inner, NULL), SDM_OK);
    counts c = {.n_threads = 1};
    sdm_team_run(3, N, count, &c); // a team of one thread
    assert_int_equal(c.member[0], N);
    sdm_team_end(inner);
    meeting m = {PTHREAD_MUTEX_INITIALIZER, PTHREAD_COND_INITIALIZER, 0, 0};
    sdm_team_run(3, 3, meet, &m);
    assert_int_equal(m.members, 7);
    sdm_team_end(outer);
    counts alone = {.n_threads = 1};
    sdm_team_run(3, N, count, &alone); // no team
    assert_int_equal(alone.member[0], N);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_iteration_runs_once),
        cmocka_unit_test(threads_share_a_loop),
        cmocka_unit_test(a_task_runs_loops_alone),
        cmocka_unit_test(two_threads_lead_teams_of_their_own),
        cmocka_unit_test(the_outer_team_returns),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
