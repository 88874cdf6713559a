/* Writes the surface of a phantom in its pose: the mesh, or points on it. */

#include "phantom_command.h"
#include "report/files.h"
#include "sdm/fit.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/npy.h"
#include "sdm/internal/rng.h"
#include "sdm/internal/table.h"
#include "sdm/internal/text.h"
#include "sdm/meshfile.h"

/* Stream of the random numbers of the noise; the image has others. */
enum { STREAM = 0x53555246 };

static void add_noise(const cli_phantom *p, size_t n, double *points)
{
    const double sd = p->args->phantom.surface_noise;
    if (!(sd > 0)) return;
    for (size_t i = 0; i < 3 * n; i++) points[i] += sd * sdm_rng_normal(p->opts.seed, STREAM, i);
}

static sdm_status write_table(const char *path, const double *points, size_t n, sdm_error *err)
{
    sdm_text text = {0};
    sdm_text_add(&text, "x,y,z\n");
    for (size_t i = 0; i < n; i++)
        sdm_text_add(&text, "%.9g,%.9g,%.9g\n", points[3 * i], points[3 * i + 1],
                     points[3 * i + 2]);
    const sdm_status s = sdm_text_write(&text, path, err);
    sdm_text_dispose(&text);
    return s;
}

static sdm_status write_points(const cli_phantom *p, const sdm_mesh *mesh, sdm_error *err)
{
    const cli_phantom_args *a = &p->args->phantom;
    const size_t n = a->surface_points ? (size_t)a->surface_points : CLI_SURFACE_POINTS;
    double *points = NULL;
    sdm_status s = SDM_ALLOC(&points, 3 * n, "points", err);
    if (!s) s = sdm_fit_surface_points(mesh, n, p->opts.n_threads, points, err);
    if (s) {
        sdm_free(points);
        return s;
    }
    add_noise(p, n, points);
    if (cli_ends_with(a->surface, ".csv"))
        s = write_table(a->surface, points, n, err);
    else
        s = sdm_npy_write_double(a->surface, points, (const size_t[]){n, 3}, 2, err);
    sdm_free(points);
    return s;
}

sdm_status cli_phantom_surface(const cli_phantom *p, sdm_error *err)
{
    sdm_mesh mesh = {0};
    const char *path = p->args->phantom.surface;
    if (!path) return SDM_OK;
    sdm_status s = sdm_instance_mesh(p->shape.instance, p->shape.values, &mesh, err);
    for (size_t i = 0; i < mesh.n_vert && !s; i++)
        sdm_pose_apply(&p->pose, mesh.vert + 3 * i, mesh.vert + 3 * i);
    if (!s && cli_ends_with_any(path, CLI_MESH_ENDINGS))
        s = sdm_mesh_write(path, &mesh, err);
    else if (!s)
        s = write_points(p, &mesh, err);
    sdm_mesh_dispose(&mesh);
    return s;
}
