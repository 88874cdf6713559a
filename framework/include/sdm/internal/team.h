/* A team of threads that share the iterations of a loop. In contrast to a parallel loop of OpenMP,
   the loop never waits for a thread that has not begun an iteration: on a machine with other work,
   where a thread may wait long for a processor, the others do the work. */
#pragma once

#include <stddef.h>

#include "sdm/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sdm_team sdm_team;

/* One iteration of a loop. member: number of the calling thread in this loop, 0 .. n_threads - 1,
   e.g. for scratch memory; which thread computes which iteration is not determined. */
typedef void sdm_team_task(void *user, size_t index, int member);

/* Starts a team of n_threads threads, of which the calling thread is one: its leader. A team with
   fewer threads is returned if the system refuses a thread. A thread leads the team that it started
   last. SDM_E_NOMEM. */
sdm_status sdm_team_start(int n_threads, sdm_team **out, sdm_error *err);

/* Ends the threads of a team; called by its leader, teams started last first. NULL does nothing. */
void sdm_team_end(sdm_team *team);

/* Calls task(user, i, member) for i = 0 .. n - 1 and returns when all calls have returned. At most
   n_threads threads of the team that the calling thread leads take the iterations one by one, in
   ascending order. A thread that leads no team, or a task that calls this function, computes all
   iterations alone, as member 0. */
void sdm_team_run(int n_threads, size_t n, sdm_team_task *task, void *user);

#ifdef __cplusplus
}
#endif
