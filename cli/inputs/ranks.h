/* The processes that share a training. */
#pragma once

#include "args/options.h"
#include "sdm/internal/comm.h"

/* *out = the processes that mpirun has started, or those that --ranks asks for, made now by fork();
   NULL: this one alone. Call it before the program has threads. All but rank 0 print no notices
   from now on. SDM_E_ARG: both; errors of sdm_comm_mpi() and sdm_comm_fork(). */
sdm_status cli_ranks_start(const cli_args *args, sdm_comm **out, sdm_error *err);

/* The ranks of a training, for its summary. */
typedef struct cli_ranks_use {
    int n;
    const char *by;  /* sdm_comm_name() */
    int64_t *memory; /* [n] largest resident memory of each so far, bytes; free with sdm_free() */
} cli_ranks_use;

/* *out = the number of ranks, the way they were started and the memory of each. Collective: every
 * rank must call it. */
sdm_status cli_ranks_measure(sdm_comm *comm, cli_ranks_use *out, sdm_error *err);

/* Leaves the other processes; s, *err: the result of this one. Rank 0 returns s. The others end
   here: only what rank 0 cannot know is printed. */
sdm_status cli_ranks_end(sdm_comm *comm, sdm_status s, sdm_error *err);
