/* Processes that share the work of one training. They are called ranks and have numbers from 0. All
   run the same program on the same configuration and call the functions below in the same order, on
   one thread; rank 0 alone writes files and reads the clock. Data travel only by broadcasts and
   gathers and scatters, never as sums of floats, so that results have the same bits for any number
   of ranks.

   NULL as sdm_comm means one process: rank 0 of 1, and every function below returns at once.
   When a rank ends early, all functions fail on the others, with SDM_E_IO and the reason. */
#pragma once

#include <stdbool.h>
#include <stddef.h>

#include "sdm/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sdm_comm sdm_comm;

/* Makes `size` >= 1 processes of this one by fork(): this one is rank 0, and *out tells each its
   rank. Call it while the process has one thread, and flush stdout before. They exchange data
   through memory that they share. When rank 0 ends, however that is, the system kills the others.
   SDM_E_NOMEM, SDM_E_IO: the system has no memory or no process for that; this process is alone
   then. */
sdm_status sdm_comm_fork(int size, sdm_comm **out, sdm_error *err);

/* Joins the processes that mpirun or mpiexec has started. *out = NULL if there is only one.
   SDM_E_UNSUPPORTED: the back-end for their MPI is missing or cannot be loaded. */
sdm_status sdm_comm_mpi(sdm_comm **out, sdm_error *err);

int sdm_comm_rank(const sdm_comm *c);
int sdm_comm_size(const sdm_comm *c);

/* "fork", "Open MPI" or "MPICH". */
const char *sdm_comm_name(const sdm_comm *c);

/* First of n units of work that are those of `rank` <= size; its last one precedes the first of
   rank + 1. Every rank has n / size units, rounded down or up. */
size_t sdm_comm_first(const sdm_comm *c, size_t n, int rank);

/* Units of work first .. end - 1. */
typedef struct sdm_comm_part {
    size_t first, end;
} sdm_comm_part;

/* Those of this rank, of n. */
sdm_comm_part sdm_comm_own(const sdm_comm *c, size_t n);

/* data[bytes] becomes that of rank `root` on all ranks. */
sdm_status sdm_comm_broadcast(sdm_comm *c, int root, void *data, size_t bytes, sdm_error *err);

/* Bytes at[r] .. at[r + 1] - 1 of data become those of rank r, for all ranks; at[size + 1], the
   same on all ranks. */
sdm_status sdm_comm_gather(sdm_comm *c, void *data, const size_t *at, sdm_error *err);

/* The same for n units of `bytes` each, of which every rank has those of sdm_comm_first(). */
sdm_status sdm_comm_gather_shares(sdm_comm *c, void *data, size_t n, size_t bytes, sdm_error *err);

/* Every rank r for which to[r] is not NULL has an array from[at[size]]; its bytes at[q] ..
   at[q + 1] - 1 come to to[r] on rank q. at[size + 1] and the NULLs among to[size] must be the same
   on all ranks. from: NULL on a rank that has no array. */
sdm_status sdm_comm_scatter(sdm_comm *c, const void *from, const size_t *at, void *const *to,
                            sdm_error *err);

/* *value becomes the smallest one of all ranks. */
sdm_status sdm_comm_least(sdm_comm *c, size_t *value, sdm_error *err);

/* Returns the status and the message of the lowest rank with an error, on all ranks; SDM_OK if no
   rank has one. s, *err: those of this rank; err may be NULL. */
sdm_status sdm_comm_agree(sdm_comm *c, sdm_status s, sdm_error *err);

/* true: the last call was sdm_comm_agree() and gave a failure: all ranks know of it, and each ends
   by itself. */
bool sdm_comm_agreed(const sdm_comm *c);

/* true: a rank has ended early. [any thread] */
bool sdm_comm_broken(const sdm_comm *c);

bool sdm_comm_is_forked(const sdm_comm *c);

/* Tells the other ranks that this one cannot go on, and why. By MPI it ends all processes; by fork
   the caller must end by itself, and rank 0 fails with the text `why`. */
void sdm_comm_abort(sdm_comm *c, const char *why);

/* Leaves the other ranks; rank 0 of a fork waits for their ends. Frees *c and sets it to NULL. */
void sdm_comm_end(sdm_comm **c);

#ifdef __cplusplus
}
#endif
