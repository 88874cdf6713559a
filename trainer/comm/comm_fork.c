/* Ranks on one machine, made by fork(), which exchange data through shared memory. A thread of rank
   0 notices when one of the others ends early. */
#define _GNU_SOURCE // syscall(), MAP_ANONYMOUS
#include <errno.h>
#include <linux/futex.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "comm_types.h"
#include "sdm/internal/child.h"
#include "sdm/memory.h"

/* Bytes that a rank sends at a time. */
enum { PIECE = 1 << 20 };

/* The processes share this; behind it lie two pieces for each rank. */
typedef struct common {
    atomic_uint arrived, round;  // ranks at the barrier; number of barriers passed
    atomic_int failed;           // 1: a rank writes `why`; 2: it is written
    char why[sizeof(sdm_error)]; // why a rank has ended early
} common;

typedef struct forked {
    common *common;
    char *pieces;
    size_t bytes; // of the shared memory
    int rank, size;
    unsigned turn; // which of the two pieces is next
    // rank 0 alone
    pid_t *children; // [size], by rank; 0: it has ended
    pthread_t watcher;
    atomic_bool ending;
} forked;

static void fail(common *c, const char *why)
{
    int none = 0;
    if (!atomic_compare_exchange_strong(&c->failed, &none, 1)) return;
    snprintf(c->why, sizeof c->why, "%s", why);
    atomic_store(&c->failed, 2);
}

static bool is_broken(const void *state)
{
    const forked *f = state;
    return atomic_load(&f->common->failed) == 2;
}

static const char *why(const void *state)
{
    const forked *f = state;
    return f->common->why;
}

/* Waits until all ranks are here; false: one has ended early. */
static bool barrier(forked *f)
{
    enum { TRIES = 1000 };
    static const struct timespec WAIT = {.tv_nsec = 50000000};
    common *c = f->common;
    const unsigned round = atomic_load(&c->round);
    if (atomic_fetch_add(&c->arrived, 1) + 1 == (unsigned)f->size) {
        atomic_store(&c->arrived, 0);
        atomic_fetch_add(&c->round, 1);
        syscall(SYS_futex, &c->round, FUTEX_WAKE, f->size, NULL, NULL, 0);
        return true;
    }
    for (int i = 0; i < TRIES && atomic_load(&c->round) == round; i++) continue;
    while (atomic_load(&c->round) == round) {
        if (is_broken(f)) return false;
        syscall(SYS_futex, &c->round, FUTEX_WAIT, round, &WAIT, NULL, 0);
    }
    return true;
}

static char *piece(const forked *f, int rank)
{
    return f->pieces + ((size_t)rank * 2 + f->turn % 2) * PIECE;
}

/* Bytes of a part of `size` bytes that go with the piece from `at` on. */
static size_t piece_size(size_t size, size_t at)
{
    return at >= size ? 0 : size - at < PIECE ? size - at : PIECE;
}

/* Two pieces in turn: when a rank writes one, all ranks have passed the barrier after which they
 * read the other, and so they have read this one. */
static bool gather(void *state, void *data, const size_t *at)
{
    forked *f = state;
    size_t longest = 0;
    for (int r = 0; r < f->size; r++)
        if (at[r + 1] - at[r] > longest) longest = at[r + 1] - at[r];
    for (size_t from = 0; from < longest; from += PIECE, f->turn++) {
        const size_t mine = at[f->rank];
        memcpy(piece(f, f->rank), (char *)data + mine + from,
               piece_size(at[f->rank + 1] - mine, from));
        if (!barrier(f)) return false;
        for (int r = 0; r < f->size; r++)
            if (r != f->rank)
                memcpy((char *)data + at[r] + from, piece(f, r),
                       piece_size(at[r + 1] - at[r], from));
    }
    return !is_broken(f);
}

static bool broadcast(void *state, int root, void *data, size_t bytes)
{
    forked *f = state;
    for (size_t from = 0; from < bytes; from += PIECE, f->turn++) {
        const size_t n = piece_size(bytes, from);
        if (f->rank == root) memcpy(piece(f, root), (char *)data + from, n);
        if (!barrier(f)) return false;
        if (f->rank != root) memcpy((char *)data + from, piece(f, root), n);
    }
    return !is_broken(f);
}

static size_t smaller(size_t a, size_t b) { return a < b ? a : b; }

static bool scatter(void *state, const void *from, const size_t *at, void *const *to)
{
    forked *f = state;
    const size_t all = at[f->size], first = at[f->rank], end = at[f->rank + 1];
    for (size_t begin = 0; begin < all; begin += PIECE, f->turn++) {
        const size_t n = piece_size(all, begin);
        if (to[f->rank]) memcpy(piece(f, f->rank), (const char *)from + begin, n);
        if (!barrier(f)) return false;
        // the bytes of this piece that are for this rank
        const size_t here = first > begin ? first : begin, until = smaller(end, begin + n);
        for (int r = 0; r < f->size && here < until; r++)
            if (to[r])
                memcpy((char *)to[r] + (here - first), piece(f, r) + (here - begin), until - here);
    }
    return !is_broken(f);
}

static void kill_children(const forked *f)
{
    for (int r = 1; r < f->size; r++)
        if (f->children[r]) kill(f->children[r], SIGKILL);
}

/* Notes the end of a child with this state of waitpid(). */
static void note_end(forked *f, int rank, int state)
{
    char text[160] = "";
    f->children[rank] = 0;
    if (WIFEXITED(state) && WEXITSTATUS(state) == 0) return;
    if (WIFSIGNALED(state))
        snprintf(text, sizeof text, "rank %d of %d was killed by signal %d (%s): all ranks end",
                 rank, f->size, WTERMSIG(state), strsignal(WTERMSIG(state)));
    else
        snprintf(text, sizeof text, "rank %d of %d ended with exit code %d: all ranks end", rank,
                 f->size, WEXITSTATUS(state));
    fail(f->common, text);
    kill_children(f);
}

/* Number of children that have not ended; notes those that have. */
static int count_children(forked *f)
{
    int n = 0, state;
    for (int r = 1; r < f->size; r++) {
        if (f->children[r] && waitpid(f->children[r], &state, WNOHANG) == f->children[r])
            note_end(f, r, state);
        n += f->children[r] != 0;
    }
    return n;
}

static void *watch(void *state)
{
    enum { PATIENCE = 100 }; // looks at children that are to end, before they are killed
    static const struct timespec PAUSE = {.tv_nsec = 50000000};
    forked *f = state;
    for (int late = 0; count_children(f) > 0;) {
        if (atomic_load(&f->ending) && ++late > PATIENCE) kill_children(f);
        nanosleep(&PAUSE, NULL);
    }
    return NULL;
}

static void free_state(forked *f)
{
    if (f->common) munmap(f->common, f->bytes);
    sdm_free(f->children);
    sdm_free(f);
}

static void abort_ranks(void *state, const char *reason)
{
    const forked *f = state;
    fail(f->common, reason);
}

static void end(void *state)
{
    forked *f = state;
    atomic_store(&f->ending, true);
    if (f->rank == 0 && f->size > 1) {
        if (is_broken(f)) kill_children(f);
        pthread_join(f->watcher, NULL);
    }
    free_state(f);
}

static const comm_backend fork_backend = {.name = "fork",
                                          .broadcast = broadcast,
                                          .gather = gather,
                                          .scatter = scatter,
                                          .broken = is_broken,
                                          .why = why,
                                          .abort = abort_ranks,
                                          .end = end};

bool sdm_comm_is_forked(const sdm_comm *c) { return c->backend == &fork_backend; }

/* What a child does first. */
static void begin_child(forked *f, int rank, pid_t parent)
{
    sdm_child_ends_with(parent);
    f->rank = rank;
}

/* Makes the other processes; returns in each of them. */
static sdm_status make_children(forked *f, sdm_error *err)
{
    const pid_t parent = getpid();
    for (int r = 1; r < f->size; r++) {
        const pid_t pid = sdm_child_fork();
        if (pid == 0) {
            begin_child(f, r, parent);
            return SDM_OK;
        }
        if (pid < 0) return sdm_fail(err, SDM_E_IO, "cannot start rank %d: %s", r, strerror(errno));
        f->children[r] = pid;
    }
    const int code = pthread_create(&f->watcher, NULL, watch, f);
    return code ? sdm_fail(err, SDM_E_IO, "cannot start a thread: %s", strerror(code)) : SDM_OK;
}

static sdm_status share_memory(forked *f, sdm_error *err)
{
    f->bytes = sizeof *f->common + (size_t)f->size * 2 * PIECE;
    void *memory = mmap(NULL, f->bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED)
        return sdm_fail(err, SDM_E_NOMEM, "no memory to share between %d ranks", f->size);
    f->common = memory;
    f->pieces = (char *)memory + sizeof *f->common;
    return SDM_OK;
}

sdm_status sdm_comm_fork(int size, sdm_comm **out, sdm_error *err)
{
    forked *f = NULL;
    sdm_comm *c = NULL;
    *out = NULL;
    sdm_status s = SDM_ALLOC(&c, 1, "ranks", err);
    if (!s) s = SDM_ALLOC(&f, 1, "ranks", err);
    if (!s) f->size = size;
    if (!s) s = SDM_ALLOC(&f->children, (size_t)size, "ranks", err);
    if (!s) s = share_memory(f, err);
    if (!s) s = make_children(f, err);
    if (!s) {
        *c = (sdm_comm){.backend = &fork_backend, .state = f, .rank = f->rank, .size = size};
        *out = c;
        return SDM_OK;
    }
    if (f && f->common) {
        kill_children(f);
        for (int r = 1; r < f->size; r++)
            if (f->children[r]) waitpid(f->children[r], NULL, 0);
    }
    if (f) free_state(f);
    sdm_free(c);
    return s;
}
