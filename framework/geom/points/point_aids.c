/* Makes the tables for distances at points when they are first needed. */
#include "point_aids.h"

#include <stdatomic.h>

#include "features/feature_side.h"
#include "sdm/internal/heap.h"
#include "wide_tree.h"

// points that cost as much without the tables as the tables
#define WORTH_WHILE 100

enum { NOT_MADE, IN_WORK, READY };

struct sdm_point_aids {
    atomic_int state;    // IN_WORK forever if there is no memory
    atomic_size_t asked; // number of points so far
    int8_t *side;
    sdm_wide_node *wide;
    sdm_nearest surface; // the surface with these tables
};

sdm_status sdm_point_aids_create(sdm_point_aids **out, sdm_error *err)
{
    return SDM_ALLOC(out, 1, "tables for points", err);
}

void sdm_point_aids_free(sdm_point_aids *a)
{
    if (!a) return;
    sdm_free(a->side);
    sdm_free(a->wide);
    sdm_free(a);
}

static sdm_status tables_make(sdm_point_aids *a, const sdm_nearest *surface, bool bounds,
                              size_t limit)
{
    const sdm_features *f = &surface->features;
    // with the scratch memory of the sides
    if (limit && sdm_wide_tree_size(f) * sizeof(sdm_wide_node) + (size_t)f->end * 128 > limit)
        return SDM_E_NOMEM;
    sdm_status s = sdm_wide_tree_build(f, &a->wide, NULL);
    if (!s && bounds) s = SDM_ALLOC(&a->side, f->end, "sides of features", NULL);
    if (!s && bounds) s = sdm_feature_sides_find(surface, a->side, NULL);
    if (s) return s;
    a->surface = *surface;
    a->surface.features.side = a->side;
    a->surface.features.wide = a->wide;
    return SDM_OK;
}

const sdm_nearest *sdm_point_aids_use(sdm_point_aids *a, const sdm_nearest *surface, bool bounds,
                                      size_t limit, size_t n)
{
    if (atomic_load_explicit(&a->state, memory_order_acquire) == READY) return &a->surface;
    if (atomic_fetch_add(&a->asked, n) + n < WORTH_WHILE) return surface;
    int state = NOT_MADE;
    if (!atomic_compare_exchange_strong(&a->state, &state, IN_WORK))
        return state == READY ? &a->surface : surface;
    if (tables_make(a, surface, bounds, limit)) return surface;
    atomic_store_explicit(&a->state, READY, memory_order_release);
    return &a->surface;
}
