/* Sends parts of training maps to the ranks that keep them, and puts parts together. */
#include "dataset_ranks.h"

#include <string.h>

#include "sdm/memory.h"

/* Places in memory of which each rank has one. */
typedef struct places {
    size_t *at; // [ranks + 1] first byte of the voxels of each rank in a map
    void **to;  // [ranks] where this rank puts the voxels that come from each rank
} places;

static void places_free(places *p)
{
    sdm_free(p->at);
    sdm_free(p->to);
}

static sdm_status places_create(const dataset *d, places *p, sdm_error *err)
{
    const size_t ranks = (size_t)sdm_comm_size(d->comm);
    sdm_status s = SDM_ALLOC(&p->at, ranks + 1, "parts of a map", err);
    if (!s) s = SDM_ALLOC(&p->to, ranks, "parts of a map", err);
    for (size_t r = 0; r <= ranks && !s; r++) p->at[r] = d->share[r] * sizeof *d->maps;
    return s;
}

sdm_status trainer_dataset_spread(dataset *d, const int16_t *map, const size_t *slots,
                                  sdm_error *err)
{
    places p = {0};
    sdm_status s = places_create(d, &p, err);
    for (int r = 0; r < sdm_comm_size(d->comm) && !s; r++)
        p.to[r] = slots[r] == SIZE_MAX ? NULL : d->maps + slots[r] * d->n_kept;
    if (!s) s = sdm_comm_scatter(d->comm, map, p.at, p.to, err);
    places_free(&p);
    return s;
}

sdm_status trainer_dataset_whole(const dataset *d, size_t slot, int16_t *map, sdm_error *err)
{
    places p = {0};
    memcpy(map + d->first_kept, d->maps + slot * d->n_kept, d->n_kept * sizeof *map);
    if (!d->share) return SDM_OK;
    sdm_status s = places_create(d, &p, err);
    if (!s) s = sdm_comm_gather(d->comm, map, p.at, err);
    places_free(&p);
    return s;
}
