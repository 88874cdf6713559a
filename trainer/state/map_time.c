/* The time that a finished network takes for a map. */
#include "map_time.h"

#include <math.h>

#include "sdm/internal/clock.h"
#include "sdm/internal/heap.h"
#include "sdm/memory.h"

sdm_status trainer_map_time(const dataset *d, const sdm_model *m, double *ms, sdm_error *err)
{
    enum { MAPS = 3 };
    float *map = NULL;
    void *scratch = NULL;
    sdm_status s = SDM_ALLOC(&map, sdm_grid_count(d->grid), "time of a map", err);
    if (!s) s = sdm_alloc(&scratch, sdm_model_scratch_bytes(m, 1), 1, "time of a map", err);
    *ms = INFINITY;
    for (int i = 0; i < MAPS && !s; i++) {
        const double start = sdm_thread_clock();
        sdm_model_forward(m, d->holdout_params, 1, map, scratch);
        *ms = fmin(*ms, 1e3 * (sdm_thread_clock() - start));
    }
    sdm_free(scratch);
    sdm_free(map);
    return s;
}
