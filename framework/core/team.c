/* Threads that share the iterations of a loop. */
#include "sdm/internal/team.h"

#if defined(__wasi__) && !defined(_REENTRANT)

/* WebAssembly without threads: its C library has no pthread.h. */
sdm_status sdm_team_start(int n_threads, sdm_team **out, sdm_error *err)
{
    (void)n_threads, (void)err;
    *out = NULL;
    return SDM_OK;
}

void sdm_team_end(sdm_team *team) { (void)team; }

void sdm_team_run(int n_threads, size_t n, sdm_team_task *task, void *user)
{
    (void)n_threads;
    for (size_t i = 0; i < n; i++) task(user, i, 0);
}

#else

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>

#include "sdm/memory.h"

/* A thread that has nothing to do looks this often for work (some 20 microseconds) before it
   sleeps: the next loop of a training step begins soon. */
enum { LOOKS = 2000 };

struct sdm_team {
    sdm_team *outer; // the team that the leader led before
    pthread_mutex_t lock;
    pthread_cond_t begun, left; // a loop has begun; a helper has left a loop
    // the loop, written by the leader while no helper is in it
    sdm_team_task *task;
    void *user;
    size_t n;
    int most; // helpers that may join
    // changed under the lock, looked at without it
    atomic_uint loops; // number of loops begun
    atomic_int inside; // helpers in the loop
    atomic_size_t next;
    // under the lock
    bool open, stop;
    int joined, sleeping;
    int n_helpers;
    pthread_t helpers[];
};

static _Thread_local sdm_team *led; // the team that this thread leads

static inline void pause_briefly(void)
{
#if defined(__x86_64__)
    __builtin_ia32_pause();
#endif
}

static void take_iterations(sdm_team *t, int member)
{
    for (size_t i; (i = atomic_fetch_add(&t->next, 1)) < t->n;) t->task(t->user, i, member);
}

/* Waits until another loop has begun. Called and left with the lock. */
static void wait_for_loop(sdm_team *t)
{
    const unsigned seen = atomic_load(&t->loops);
    pthread_mutex_unlock(&t->lock);
    for (int i = 0; i < LOOKS && atomic_load_explicit(&t->loops, memory_order_relaxed) == seen; i++)
        pause_briefly();
    pthread_mutex_lock(&t->lock);
    while (!t->stop && atomic_load(&t->loops) == seen) {
        t->sleeping++;
        pthread_cond_wait(&t->begun, &t->lock);
        t->sleeping--;
    }
}

static void *helper_run(void *user)
{
    sdm_team *t = user;
    pthread_mutex_lock(&t->lock);
    while (!t->stop) {
        if (!t->open || t->joined == t->most || atomic_load(&t->next) >= t->n) {
            wait_for_loop(t);
            continue;
        }
        const int member = ++t->joined;
        atomic_fetch_add(&t->inside, 1);
        pthread_mutex_unlock(&t->lock);
        take_iterations(t, member);
        pthread_mutex_lock(&t->lock);
        if (atomic_fetch_sub(&t->inside, 1) == 1) pthread_cond_signal(&t->left);
    }
    pthread_mutex_unlock(&t->lock);
    return NULL;
}

sdm_status sdm_team_start(int n_threads, sdm_team **out, sdm_error *err)
{
    const size_t n = n_threads > 1 ? (size_t)n_threads - 1 : 0;
    sdm_team *t = NULL;
    const sdm_status s = sdm_alloc((void **)&t, 1, sizeof *t + n * sizeof *t->helpers, "team", err);
    *out = t;
    if (s) return s;
    pthread_mutex_init(&t->lock, NULL);
    pthread_cond_init(&t->begun, NULL);
    pthread_cond_init(&t->left, NULL);
    for (; t->n_helpers < (int)n; t->n_helpers++)
        if (pthread_create(&t->helpers[t->n_helpers], NULL, helper_run, t)) break;
    t->outer = led;
    led = t;
    return SDM_OK;
}

void sdm_team_end(sdm_team *t)
{
    if (!t) return;
    pthread_mutex_lock(&t->lock);
    t->stop = true;
    atomic_fetch_add(&t->loops, 1);
    pthread_cond_broadcast(&t->begun);
    pthread_mutex_unlock(&t->lock);
    for (int i = 0; i < t->n_helpers; i++) pthread_join(t->helpers[i], NULL);
    pthread_cond_destroy(&t->begun);
    pthread_cond_destroy(&t->left);
    pthread_mutex_destroy(&t->lock);
    led = t->outer;
    sdm_free(t);
}

/* Opens a loop and wakes helpers. */
static void loop_begin(sdm_team *t, int n_threads, size_t n, sdm_team_task *task, void *user)
{
    pthread_mutex_lock(&t->lock);
    t->task = task, t->user = user, t->n = n;
    t->most = n_threads - 1;
    t->joined = 0;
    atomic_store(&t->next, 0);
    t->open = true;
    atomic_fetch_add(&t->loops, 1);
    const int wake = t->sleeping < t->most ? t->sleeping : t->most;
    for (int i = 0; i < wake; i++) pthread_cond_signal(&t->begun);
    pthread_mutex_unlock(&t->lock);
}

/* Closes the loop to helpers that have not joined it, and waits for the others. */
static void loop_end(sdm_team *t)
{
    for (int i = 0; i < LOOKS && atomic_load(&t->inside); i++) pause_briefly();
    pthread_mutex_lock(&t->lock);
    t->open = false;
    while (atomic_load(&t->inside)) pthread_cond_wait(&t->left, &t->lock);
    pthread_mutex_unlock(&t->lock);
}

void sdm_team_run(int n_threads, size_t n, sdm_team_task *task, void *user)
{
    sdm_team *t = led;
    if (!t || n < 2 || n_threads < 2 || !t->n_helpers || t->open) {
        for (size_t i = 0; i < n; i++) task(user, i, 0);
        return;
    }
    loop_begin(t, n_threads, n, task, user);
    take_iterations(t, 0);
    loop_end(t);
}

#endif
