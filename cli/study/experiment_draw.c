/* Draws the pictures of a row: slices with contours at 0 and 1 mm, and the zero surface, coloured
 * by its distance from the mesh. */
#include <stdio.h>
#include <string.h>

#include "experiment_command.h"
#include "report/terminal.h"
#include "sdm/internal/file.h"
#include "sdm/internal/near.h"
#include "sdm/isosurface.h"
#include "sdm/memory.h"
#include "sdm/picture.h"

static sdm_status draw_slices(const cli_experiment_run *run, const cli_experiment_job *job,
                              const float *values, sdm_error *err)
{
    const sdm_exact_opts opts = {.n_threads = 0};
    const sdm_grid *g = &job->maker.grid;
    const float levels[] = {0.0f, sdm_grid_contour(g)};
    const size_t n = sdm_grid_count(g);
    char path[SDM_PATH_TEXT_MAX];
    float *maps = NULL;
    sdm_status s = sdm_alloc((void **)&maps, n, 2 * sizeof *maps, "maps of the picture", err);
    if (!s) s = sdm_exact_shape_map(job->shape, job->nominal, &opts, g, maps, NULL, err);
    for (size_t i = 0; i < n && !s; i++) maps[n + i] = values[i] - maps[i];
    const sdm_picture_map columns[] = {{.title = "exact", .values = maps},
                                       {.title = run->e->rows[job->index].title, .values = values},
                                       {.title = "error", .values = maps + n, .error = true}};
    if (!s) s = cli_experiment_path(run, job->index, "slices.png", path, err);
    if (!s) s = sdm_picture_slices(path, g, columns, 3, levels, 2, err);
    sdm_free(maps);
    return s;
}

/* distance[surface->n_vert] = signed distances from the mesh at the vertices of the zero
 * surface. */
static sdm_status find_distances(const sdm_mesh *mesh, const sdm_mesh *surface, double *distance,
                                 sdm_error *err)
{
    const sdm_exact_opts opts = {.n_threads = 0};
    sdm_exact *engine = NULL;
    const sdm_status s = sdm_exact_create(mesh, &opts, &engine, err);
    for (size_t i = 0; i < surface->n_vert && !s; i++)
        distance[i] = sdm_exact_point(engine, surface->vert + 3 * i, NULL, NULL, NULL);
    sdm_exact_free(engine);
    return s;
}

static sdm_status draw_surfaces(const cli_experiment_run *run, const cli_experiment_job *job,
                                const float *values, sdm_error *err)
{
    char path[SDM_PATH_TEXT_MAX];
    sdm_mesh mesh = {0}, surface = {0};
    double *distance = NULL;
    sdm_status s = sdm_isosurface(&job->maker.grid, values, 0.0f, &surface, NULL, err);
    if (s || surface.n_tri == 0) {
        sdm_mesh_dispose(&surface);
        return s;
    }
    s = sdm_instance_mesh(job->shape, job->nominal, &mesh, err);
    if (!s) s = SDM_ALLOC(&distance, surface.n_vert, "distances of the picture", err);
    if (!s) s = find_distances(&mesh, &surface, distance, err);
    const sdm_picture_surface columns[] = {{"mesh", &mesh, NULL},
                                           {run->e->rows[job->index].title, &surface, distance}};
    if (!s) s = cli_experiment_path(run, job->index, "surfaces.png", path, err);
    if (!s)
        s = sdm_picture_surfaces(path, columns, 2, "zero surface's distance from the mesh", err);
    sdm_free(distance);
    sdm_mesh_dispose(&mesh);
    sdm_mesh_dispose(&surface);
    return s;
}

sdm_status cli_experiment_draw(const cli_experiment_run *run, const cli_experiment_job *job,
                               const float *values, sdm_error *err)
{
    if (!run->e->experiment.pictures) return SDM_OK;
    char folder[SDM_PATH_TEXT_MAX];
    sdm_status s = cli_experiment_path(run, job->index, "", folder, err);
    if (!s) s = sdm_make_folder(folder, err);
    if (!s) s = draw_slices(run, job, values, err);
    if (!s) s = draw_surfaces(run, job, values, err);
    return s ? s : cli_check_interrupt(err);
}
