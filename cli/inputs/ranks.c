/* Starts and ends the processes that share a training. */
#include "ranks.h"

#include <stdio.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#include "report/terminal.h"
#include "sdm/memory.h"

sdm_status cli_ranks_start(const cli_args *args, sdm_comm **out, sdm_error *err)
{
    fflush(stdout);
    sdm_status s = sdm_comm_mpi(out, err);
    if (!s && *out && args->ranks)
        s = sdm_fail(err, SDM_E_ARG,
                     "train: mpirun has started %d processes already: leave --ranks out",
                     sdm_comm_size(*out));
    if (!s && !*out && args->ranks > 1) s = sdm_comm_fork((int)args->ranks, out, err);
    if (sdm_comm_rank(*out)) cli_set_quiet(true);
    return s;
}

sdm_status cli_ranks_measure(sdm_comm *comm, cli_ranks_use *out, sdm_error *err)
{
    struct rusage use = {0};
    *out = (cli_ranks_use){.n = sdm_comm_size(comm), .by = sdm_comm_name(comm)};
    const sdm_status s = SDM_ALLOC(&out->memory, (size_t)out->n, "ranks", err);
    if (s) return s;
    getrusage(RUSAGE_SELF, &use);
    out->memory[sdm_comm_rank(comm)] = 1024 * (int64_t)use.ru_maxrss; // Linux counts in kB
    return sdm_comm_gather_shares(comm, out->memory, (size_t)out->n, sizeof *out->memory, err);
}

/* Tells an error that the other ranks do not know, and ends them all. */
static void abort_all(sdm_comm *comm, sdm_status s, sdm_error *err)
{
    const int rank = sdm_comm_rank(comm);
    // rank 0 has probably the same error, and tells it
    const struct timespec wait = {.tv_sec = rank ? 1 : 0};
    nanosleep(&wait, NULL);
    err->status = s;
    if (rank) sdm_fail_in(err, s, "rank %d", rank);
    if (!sdm_comm_is_forked(comm)) cli_report(err); // MPI leaves no time for that
    sdm_comm_abort(comm, err->text);
}

sdm_status cli_ranks_end(sdm_comm *comm, sdm_status s, sdm_error *err)
{
    if (!comm) return s;
    const int rank = sdm_comm_rank(comm);
    const bool known = sdm_comm_agreed(comm) || sdm_comm_broken(comm);
    if (s && !known) abort_all(comm, s, err);
    sdm_comm_end(&comm);
    if (!rank) return s;
    fflush(stdout);
    _exit(s && !known);
}
