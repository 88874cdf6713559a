/* Computes the map and the zero surface of the estimate in the world. */
#include <string.h>

#include "fit_command.h"
#include "inputs/setup.h"
#include "sdm/internal/mat3.h"
#include "sdm/isosurface.h"
#include "sdm/memory.h"

/* Returns the grid g, rotated and translated with the shape. On this grid the map of the network or
 * of the exact engine needs no interpolation. */
static sdm_grid grid_in_pose(const sdm_grid *g, const sdm_pose *pose)
{
    sdm_grid posed = *g;
    double r[9];
    sdm_pose_matrix(pose, r);
    m3_product(r, g->dir, posed.dir);
    sdm_pose_apply(pose, g->origin, posed.origin);
    return posed;
}

sdm_status cli_fit_make_map(cli_fit *f, sdm_error *err)
{
    const sdm_fit_result *r = &f->result;
    f->map_source = f->source;
    if (r->polished) {
        f->map_source.grid = sdm_model_get_info(f->model)->grid;
        f->map_source.model = NULL;
    }
    f->by_network =
        f->map_source.model && !cli_check_range(f->params, f->n_params, r->params, NULL);
    f->map_grid = grid_in_pose(
        f->map_source.model ? &sdm_model_get_info(f->model)->grid : &f->map_source.grid, &r->pose);
    sdm_status s = SDM_ALLOC(&f->map, sdm_grid_count(&f->map_grid), "distance map", err);
    if (!s)
        s = sdm_fit_map(&f->map_source, r->params, &r->pose, &f->map_grid, f->opts.n_threads,
                        f->map, err);
    return s ? s : sdm_isosurface(&f->map_grid, f->map, 0.0f, &f->surface, NULL, err);
}

void cli_fit_dispose(cli_fit *f)
{
    sdm_mesh_dispose(&f->surface);
    sdm_free(f->map);
    cli_fit_candidates_dispose(f);
    sdm_fit_dispose(&f->result);
    if (!f->reference_is_target) sdm_free(f->reference);
    sdm_free(f->points);
    sdm_free(f->mask);
    sdm_volume_dispose(&f->image);
    sdm_free(f->start);
    sdm_free(f->kept);
    sdm_free(f->truth);
    sdm_free(f->params);
    sdm_model_free(f->model);
    sdm_instance_free(f->shape);
    sdm_instance_free(f->other_shape);
    sdm_registry_free(f->registry);
    sdm_instance_free(f->judge_shape);
    sdm_registry_free(f->judge_registry);
}
