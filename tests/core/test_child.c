/* Child processes of a program with other threads can allocate memory, and end with their parent.
 * Tests: child.c */
#include <pthread.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#include "sdm/internal/child.h"

enum { THREADS = 4, FORKS = 60, BLOCKS = 200 };

typedef struct gate {
    pthread_mutex_t lock;
    pthread_cond_t opened;
    bool open;
} gate;

/* Allocates memory of many sizes and frees it; 0: there is none. */
static bool allocate(void)
{
    bool done = true;
    for (size_t i = 1; i <= BLOCKS; i++) {
        char *volatile block = calloc(i, 16);
        done = done && block;
        free(block);
    }
    return done;
}

/* As a thread that a library starts when it is loaded: works for a moment, then waits. */
static void *work(void *user)
{
    gate *g = user;
    for (int i = 0; i < 5; i++) allocate();
    pthread_mutex_lock(&g->lock);
    while (!g->open) pthread_cond_wait(&g->opened, &g->lock);
    pthread_mutex_unlock(&g->lock);
    return NULL;
}

/* The exit code of the process within ten seconds; -1: it has not ended, and is killed. */
static int await_exit(pid_t child)
{
    static const struct timespec PAUSE = {.tv_nsec = 1000000};
    int state = 0;
    for (int i = 0; i < 10000; i++) {
        if (waitpid(child, &state, WNOHANG) == child)
            return WIFEXITED(state) ? WEXITSTATUS(state) : -1;
        nanosleep(&PAUSE, NULL);
    }
    kill(child, SIGKILL);
    waitpid(child, NULL, 0);
    return -1;
}

static void children_allocate_while_threads_do(void **state)
{
    (void)state;
    for (int i = 0; i < FORKS; i++) {
        gate g = {.lock = PTHREAD_MUTEX_INITIALIZER, .opened = PTHREAD_COND_INITIALIZER};
        pthread_t threads[THREADS];
        for (int k = 0; k < THREADS; k++)
            assert_int_equal(pthread_create(&threads[k], NULL, work, &g), 0);
        const int child = sdm_child_fork();
        if (child == 0) _exit(allocate() ? 7 : 1);
        assert_true(child > 0);
        const int code = await_exit(child);
        pthread_mutex_lock(&g.lock);
        g.open = true;
        pthread_cond_broadcast(&g.opened);
        pthread_mutex_unlock(&g.lock);
        for (int k = 0; k < THREADS; k++) pthread_join(threads[k], NULL);
        assert_int_equal(code, 7);
    }
}

/* The grandchild holds the end of a pipe: the pipe ends when it is killed. */
static void a_child_ends_with_its_parent(void **state)
{
    (void)state;
    int ends[2];
    char byte;
    assert_int_equal(pipe(ends), 0);
    const int child = sdm_child_fork();
    if (child == 0) {
        close(ends[0]);
        const long parent = getpid();
        if (sdm_child_fork() > 0) _exit(0);
        sdm_child_ends_with(parent);
        for (;;) pause();
    }
    close(ends[1]);
    assert_int_equal(await_exit(child), 0);
    assert_int_equal(read(ends[0], &byte, 1), 0);
    close(ends[0]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(children_allocate_while_threads_do),
        cmocka_unit_test(a_child_ends_with_its_parent),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
