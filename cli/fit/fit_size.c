/* Compares the size of the target with that of the start shape: files in another unit than mm are
 * the most common mistake. */
#include <math.h>
#include <stdio.h>

#include "fit_command.h"
#include "report/terminal.h"
#include "sdm/internal/box.h"
#include "sdm/internal/units.h"
#include "sdm/map.h"
#include "sdm/memory.h"

/* Largest ratio of the two sizes, either way, that gives no warning. */
#define RATIO_MAX 5.0

/* A shape that is larger than its image by the first factor does not fit into it; by the second,
 * the image is in m. */
#define IMAGE_MAX 2.0
#define IMAGE_IN_M 30.0

/* Length of the diagonal, mm. */
static double box_size(const sdm_box *b)
{
    double square = 0;
    for (int a = 0; a < 3; a++) square += pow(fmax(b->max[a] - b->min[a], 0), 2);
    return sqrt(square);
}

/* Adds the corners of voxels whose value is above (sign 1) or below (sign -1) the level. */
static void add_voxels(const sdm_grid *g, const float *values, float sign, float level, sdm_box *b)
{
    size_t v = 0;
    for (int64_t k = 0; k < g->n[2]; k++)
        for (int64_t j = 0; j < g->n[1]; j++)
            for (int64_t i = 0; i < g->n[0]; i++, v++) {
                if (!(sign * values[v] > sign * level)) continue;
                for (int corner = 0; corner < 8; corner++) {
                    const double index[3] = {(double)i + (corner & 1 ? 0.5 : -0.5),
                                             (double)j + (corner & 2 ? 0.5 : -0.5),
                                             (double)k + (corner & 4 ? 0.5 : -0.5)};
                    double x[3];
                    sdm_grid_world(g, index, x);
                    sdm_box_add(b, x);
                }
            }
}

/* Diagonal of the box of the start shape, from its mesh or its map. */
static sdm_status shape_size(const cli_fit *f, double *size, sdm_error *err)
{
    sdm_box b = SDM_BOX_EMPTY;
    if (f->shape) {
        sdm_mesh mesh = {0};
        const sdm_status s = sdm_instance_mesh(f->shape, f->start, &mesh, err);
        for (size_t v = 0; v < mesh.n_vert && !s; v++) sdm_box_add(&b, mesh.vert + 3 * v);
        sdm_mesh_dispose(&mesh);
        *size = box_size(&b);
        return s;
    }
    const sdm_grid *g = &sdm_model_get_info(f->model)->grid;
    const sdm_pose here = {{0, 0, 0}, {0, 0, 0}};
    float *map = NULL;
    sdm_status s = SDM_ALLOC(&map, sdm_grid_count(g), "distance map", err);
    if (!s) s = sdm_fit_map(&f->source, f->start, &here, g, f->opts.n_threads, map, err);
    if (!s) add_voxels(g, map, -1, 0, &b);
    sdm_free(map);
    *size = box_size(&b);
    return s;
}

/* Warns if the image is too small to hold the shape, or has voxels larger than the shape. An image
 * may be much larger than the shape, so its unit is named only where it is clear. */
static void warn_image(const cli_fit *f, double shape)
{
    const sdm_grid *g = &f->target.grid;
    double square = 0, voxel = 0;
    for (int i = 0; i < 3; i++) {
        square += pow(g->spacing[i] * (double)g->n[i], 2);
        voxel = fmax(voxel, g->spacing[i]);
    }
    const double image = sqrt(square);
    const char *unit = shape > IMAGE_IN_M * image ? "m" : voxel > shape ? "um" : NULL;
    if (!unit && shape <= IMAGE_MAX * image) return;
    cli_warn("%s: the image measures %.3g mm across, its voxels %.3g mm, the start shape %.3g mm: "
             "%s%s%slengths are mm",
             f->path, image, voxel, shape, unit ? "are they in " : "", unit ? unit : "",
             unit ? "? " : "");
}

sdm_status cli_fit_warn_size(const cli_fit *f, sdm_error *err)
{
    sdm_box b = SDM_BOX_EMPTY;
    double shape = 0;
    for (size_t i = 0; i < f->target.n_points && f->points; i++) sdm_box_add(&b, f->points + 3 * i);
    if (f->mask) add_voxels(&f->target.grid, f->mask, 1, 0.5f, &b);
    const sdm_status s = shape_size(f, &shape, err);
    const double target = box_size(&b), ratio = shape / target;
    if (!s && f->target.kind == SDM_FIT_IMAGE) warn_image(f, shape);
    if (s || !(shape > 0) || !(target > 0)) return s;
    if (ratio <= RATIO_MAX && ratio >= 1 / RATIO_MAX) return SDM_OK;
    const char *unit = sdm_unit_near(ratio, NULL);
    char advice[80] = "lengths are mm";
    if (unit) snprintf(advice, sizeof advice, "are they in %s? lengths are mm", unit);
    cli_warn("%s: the %s measure %.3g mm across, the start shape %.3g mm: %s", f->path,
             cli_fit_kind(f), target, shape, advice);
    return SDM_OK;
}
