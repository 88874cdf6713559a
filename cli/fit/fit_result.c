/* The estimate as a map and a surface in the world. */
#include <string.h>

#include "fit_command.h"
#include "inputs/setup.h"
#include "sdm/internal/rotation.h"
#include "sdm/isosurface.h"
#include "sdm/memory.h"

const char *cli_fit_kind(const cli_fit *f)
{
    return f->target.kind == SDM_FIT_IMAGE   ? "image"
           : f->target.kind == SDM_FIT_LABEL ? "labels"
                                             : "points";
}

/* The source's grid, turned and moved with the shape: its map is that of the source, not
 * interpolated. */
static sdm_grid pose_grid(const sdm_grid *g, const sdm_pose *pose)
{
    sdm_grid posed = *g;
    double r[9];
    sdm_pose_matrix(pose, r);
    sdm_rotation_product(r, g->dir, posed.dir);
    sdm_pose_apply(pose, g->origin, posed.origin);
    return posed;
}

sdm_status cli_fit_draw_up(cli_fit *f, sdm_error *err)
{
    const sdm_fit_result *r = &f->result;
    f->drawn = f->source;
    if (f->source.model &&
        r->n_exact > r->n_exact_outside) { // the last maps were those of a polish
        f->drawn.grid = sdm_model_get_info(f->model)->grid;
        f->drawn.model = NULL;
    }
    f->by_network = f->drawn.model && !cli_check_range(f->params, f->n_params, r->params, NULL);
    f->posed =
        pose_grid(f->drawn.model ? &sdm_model_get_info(f->model)->grid : &f->drawn.grid, &r->pose);
    sdm_status s = SDM_ALLOC(&f->map, sdm_grid_count(&f->posed), "distance map", err);
    if (!s)
        s = sdm_fit_map(&f->drawn, r->params, &r->pose, &f->posed, f->opts.n_threads, f->map, err);
    return s ? s : sdm_isosurface(&f->posed, f->map, 0.0f, &f->surface, NULL, err);
}

void cli_fit_dispose(cli_fit *f)
{
    sdm_mesh_dispose(&f->surface);
    sdm_free(f->map);
    sdm_fit_dispose(&f->result);
    if (!f->own_reference) sdm_free(f->reference);
    sdm_free(f->points);
    sdm_free(f->mask);
    sdm_volume_dispose(&f->image);
    sdm_free(f->start);
    sdm_free(f->params);
    sdm_model_free(f->model);
    sdm_instance_free(f->shape);
    sdm_registry_free(f->registry);
}
