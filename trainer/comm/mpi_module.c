/* The back-end of ranks for MPI, a shared object of its own for each MPI (comm_mpi.c loads it). On
   any error MPI ends all processes. */
#define _POSIX_C_SOURCE 200809L // nanosleep()
#include <limits.h>
#include <mpi.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "comm_backend.h"

extern comm_module_entry sdm_comm_module;

typedef struct world {
    int rank, size;
    int *counts, *starts; // [size] arguments of MPI_Allgatherv()
} world;

/* Waits for the end of an exchange. MPI_Wait() keeps a core busy meanwhile: where ranks and other
 * programs want more cores than there are, each step of an exchange then lasts until the system
 * stops one that waits. This function soon sleeps between its questions. */
static void complete(MPI_Request request)
{
    enum { FIRST = 1000, NEXT = 100 }; // questions before the first sleep, and between two
    static const struct timespec PAUSE = {.tv_nsec = 20000};
    int done = 0;
    for (int left = FIRST; MPI_Test(&request, &done, MPI_STATUS_IGNORE) == MPI_SUCCESS && !done;) {
        if (--left) continue;
        nanosleep(&PAUSE, NULL);
        left = NEXT;
    }
}

/* The counts of MPI are integers of 32 bits: a message has at most so many bytes. */
static const size_t MOST = INT_MAX;

/* Bytes of the message that begins with byte `at` of `bytes`. */
static int message_size(size_t bytes, size_t at)
{
    return (int)(bytes - at < MOST ? bytes - at : MOST);
}

static bool broadcast(void *state, int root, void *data, size_t bytes)
{
    (void)state;
    for (size_t at = 0; at < bytes; at += MOST) {
        MPI_Request request;
        MPI_Ibcast((char *)data + at, message_size(bytes, at), MPI_BYTE, root, MPI_COMM_WORLD,
                   &request);
        complete(request);
    }
    return true;
}

static bool gather(void *state, void *data, const size_t *at)
{
    world *w = state;
    if (at[w->size] - at[0] > MOST) {
        for (int r = 0; r < w->size; r++) broadcast(w, r, (char *)data + at[r], at[r + 1] - at[r]);
        return true;
    }
    for (int r = 0; r < w->size; r++) {
        w->counts[r] = (int)(at[r + 1] - at[r]);
        w->starts[r] = (int)(at[r] - at[0]);
    }
    MPI_Request request;
    MPI_Iallgatherv(MPI_IN_PLACE, 0, MPI_BYTE, (char *)data + at[0], w->counts, w->starts, MPI_BYTE,
                    MPI_COMM_WORLD, &request);
    complete(request);
    return true;
}

/* Sends bytes to rank `other`, and receives bytes from rank `from`. */
static void send_and_receive(const char *sent, size_t n_sent, int other, char *received,
                             size_t n_received, int from)
{
    for (size_t at = 0; at < n_sent || at < n_received; at += MOST) {
        MPI_Request sending = MPI_REQUEST_NULL, receiving = MPI_REQUEST_NULL;
        if (at < n_received)
            MPI_Irecv(received + at, message_size(n_received, at), MPI_BYTE, from, 0,
                      MPI_COMM_WORLD, &receiving);
        if (at < n_sent)
            MPI_Isend(sent + at, message_size(n_sent, at), MPI_BYTE, other, 0, MPI_COMM_WORLD,
                      &sending);
        complete(receiving);
        complete(sending);
    }
}

/* In round k each rank sends to the k-th rank behind it. */
static bool scatter(void *state, const void *from, const size_t *at, void *const *to)
{
    const world *w = state;
    const size_t own = at[w->rank + 1] - at[w->rank];
    const char *bytes = from;
    if (to[w->rank]) memcpy(to[w->rank], bytes + at[w->rank], own);
    for (int k = 1; k < w->size; k++) {
        const int next = (w->rank + k) % w->size, last = (w->rank + w->size - k) % w->size;
        send_and_receive(to[w->rank] ? bytes + at[next] : NULL,
                         to[w->rank] ? at[next + 1] - at[next] : 0, next, to[last],
                         to[last] ? own : 0, last);
    }
    return true;
}

static bool broken(const void *state)
{
    (void)state;
    return false;
}

static const char *why(const void *state)
{
    (void)state;
    return "";
}

static void abort_ranks(void *state, const char *reason)
{
    (void)state;
    (void)reason;
    MPI_Abort(MPI_COMM_WORLD, 1);
}

static void end(void *state)
{
    world *w = state;
    MPI_Request all;
    free(w->counts);
    free(w->starts);
    free(w);
    MPI_Ibarrier(MPI_COMM_WORLD, &all);
    complete(all);
    MPI_Finalize();
}

static const comm_backend backend = {.name = SDM_MPI_NAME,
                                     .broadcast = broadcast,
                                     .gather = gather,
                                     .scatter = scatter,
                                     .broken = broken,
                                     .why = why,
                                     .abort = abort_ranks,
                                     .end = end};

__attribute__((visibility("default"))) const comm_backend *sdm_comm_module(void **state, int *rank,
                                                                           int *size)
{
    int threads;
    MPI_Init_thread(NULL, NULL, MPI_THREAD_FUNNELED, &threads);
    MPI_Comm_rank(MPI_COMM_WORLD, rank);
    MPI_Comm_size(MPI_COMM_WORLD, size);
    world *w = malloc(sizeof *w);
    if (w) {
        *w = (world){*rank, *size, malloc((size_t)*size * sizeof(int)),
                     malloc((size_t)*size * sizeof(int))};
        if (w->counts && w->starts) {
            *state = w;
            return &backend;
        }
    }
    MPI_Abort(MPI_COMM_WORLD, 1);
    return &backend;
}
