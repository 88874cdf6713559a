/* The back-end of ranks for MPI, a shared object of its own for each MPI (comm_mpi.c loads it). On
   any error MPI ends all processes. */
#define _POSIX_C_SOURCE 200809L // nanosleep()
#include <limits.h>
#include <mpi.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "comm_backend.h"

extern comm_module_entry sdm_comm_module;

/* The arguments of MPI_Allgatherv(). */
typedef struct world {
    int size;
    int *counts, *starts; // [size]
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

static bool broadcast(void *state, int root, void *data, size_t bytes)
{
    const size_t most = INT_MAX; // the counts of MPI are integers of 32 bits
    (void)state;
    for (size_t at = 0; at < bytes; at += most) {
        MPI_Request request;
        MPI_Ibcast((char *)data + at, (int)(bytes - at < most ? bytes - at : most), MPI_BYTE, root,
                   MPI_COMM_WORLD, &request);
        complete(request);
    }
    return true;
}

static bool gather(void *state, void *data, const size_t *at)
{
    world *w = state;
    if (at[w->size] - at[0] > INT_MAX) {
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
        *w = (world){*size, malloc((size_t)*size * sizeof(int)),
                     malloc((size_t)*size * sizeof(int))};
        if (w->counts && w->starts) {
            *state = w;
            return &backend;
        }
    }
    MPI_Abort(MPI_COMM_WORLD, 1);
    return &backend;
}
