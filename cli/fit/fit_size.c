/* Compares the size of the target with that of the shape: files in another unit than mm are the
 * most common mistake. A fit that cannot succeed is refused at once. */
#include <math.h>
#include <stdio.h>

#include "fit_command.h"
#include "measure/median.h"
#include "report/terminal.h"
#include "sdm/internal/mesh_box.h"
#include "sdm/internal/units.h"
#include "sdm/map.h"
#include "sdm/memory.h"

/* Largest ratio of the two sizes, either way, that gives no warning. */
#define RATIO_MAX 5.0

/* A shape that is larger than its image by the first factor does not fit into it; by the second,
 * the image is in m. One that has fewer voxels across than the third hardly shows. */
#define IMAGE_MAX 2.0
#define IMAGE_IN_M 30.0
#define VOXELS_MIN 4.0

/* Diagonals of boxes, mm: of the shape at the start; the smallest and the largest of these three:
 * at the start, with all parameters at their lower and at their upper ends. */
typedef struct shape_sizes {
    double start, least, most;
} shape_sizes;

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

/* Diagonal of the box of the shape at p, from its mesh or its map. */
static sdm_status shape_size(const cli_fit *f, const double *p, double *size, sdm_error *err)
{
    sdm_box b = SDM_BOX_EMPTY;
    if (f->shape) {
        sdm_mesh mesh = {0};
        const sdm_status s = sdm_instance_mesh(f->shape, p, &mesh, err);
        if (!s) sdm_box_add_mesh(&b, &mesh);
        sdm_mesh_dispose(&mesh);
        *size = box_size(&b);
        return s;
    }
    const sdm_grid *g = &sdm_model_get_info(f->model)->grid;
    const sdm_pose here = {{0, 0, 0}, {0, 0, 0}};
    float *map = NULL;
    sdm_status s = SDM_ALLOC(&map, sdm_grid_count(g), "distance map", err);
    if (!s) s = sdm_fit_map(&f->source, p, &here, g, f->opts.n_threads, map, err);
    if (!s) add_voxels(g, map, -1, 0, &b);
    sdm_free(map);
    *size = box_size(&b);
    return s;
}

/* A shape may refuse the ends of its ranges, which then do not count. */
static sdm_status find_sizes(const cli_fit *f, shape_sizes *out, sdm_error *err)
{
    double *p = NULL;
    sdm_status s = shape_size(f, f->start, &out->start, err);
    out->least = out->most = out->start;
    if (!s) s = SDM_ALLOC(&p, f->n_params, "parameters", err);
    for (int end = 0; end < 2 && !s; end++) {
        double size;
        for (size_t i = 0; i < f->n_params; i++) p[i] = end ? f->params[i].max : f->params[i].min;
        if (shape_size(f, p, &size, NULL) || !(size > 0)) continue;
        out->least = fmin(out->least, size);
        out->most = fmax(out->most, size);
    }
    sdm_free(p);
    return s;
}

/* Refuses a fit that cannot succeed, unless --force is given: then this is a warning. */
static sdm_status refuse(const cli_fit *f, const char *what, sdm_error *err)
{
    if (!f->args->force)
        return sdm_fail(err, SDM_E_ARG, "%s%s; --force fits nevertheless", what,
                        f->suspicion ? f->suspicion : "");
    cli_warn("%s", what);
    return SDM_OK;
}

/* Refuses an image that is too small to hold the shape, or has voxels larger than the shape. An
 * image may be much larger than the shape, so its unit is named only where it is clear. */
static sdm_status check_image(const cli_fit *f, const shape_sizes *shape, sdm_error *err)
{
    const sdm_grid *g = &f->target.grid;
    double square = 0, voxel = 0;
    for (int i = 0; i < 3; i++) {
        square += pow(g->spacing[i] * (double)g->n[i], 2);
        voxel = fmax(voxel, g->spacing[i]);
    }
    const double image = sqrt(square);
    const char *unit = shape->least > IMAGE_IN_M * image ? "m" : voxel > shape->most ? "um" : NULL;
    if (shape->start <= IMAGE_MAX * image && VOXELS_MIN * voxel <= shape->start) return SDM_OK;
    char text[512];
    snprintf(text, sizeof text,
             "%s: the image measures %.3g mm across, its voxels %.3g mm, the start shape %.3g mm: "
             "%s%s%slengths are mm",
             f->path, image, voxel, shape->start, unit ? "are they in " : "", unit ? unit : "",
             unit ? "? " : "");
    if (unit || shape->least > IMAGE_MAX * image) return refuse(f, text, err);
    cli_warn("%s", text);
    return SDM_OK;
}

/* *size = diagonal of the box around the middle half of the points along each axis, mm: outliers
 * hardly change it. */
static sdm_status middle_size(const cli_fit *f, double *size, sdm_error *err)
{
    const size_t n = f->target.n_points;
    double *x = NULL, square = 0;
    const sdm_status s = SDM_ALLOC(&x, n, "points", err);
    for (size_t a = 0; a < 3 && !s; a++) {
        for (size_t i = 0; i < n; i++) x[i] = f->points[3 * i + a];
        cli_sort(x, n);
        square += pow(x[3 * n / 4] - x[n / 4], 2);
    }
    sdm_free(x);
    *size = sqrt(square);
    return s;
}

/* Points and labels: far from the size of the shape at any parameters they are refused, far from
 * the start shape a warning is printed. */
static sdm_status check_surface(const cli_fit *f, const shape_sizes *shape, sdm_error *err)
{
    sdm_box b = SDM_BOX_EMPTY;
    sdm_status s = SDM_OK;
    if (f->points) sdm_box_add_points(&b, f->points, f->target.n_points);
    if (f->mask) add_voxels(&f->target.grid, f->mask, 1, 0.5f, &b);
    const double target = box_size(&b), ratio = shape->start / target;
    double middle = target;
    if (f->points) s = middle_size(f, &middle, err);
    if (s || !(shape->start > 0) || !(target > 0)) return s;
    if (ratio <= RATIO_MAX && ratio >= 1 / RATIO_MAX) return SDM_OK;
    const char *unit = sdm_unit_near(ratio, NULL);
    char advice[80] = "lengths are mm", text[512];
    if (unit)
        snprintf(advice, sizeof advice, "are they in %s? or is it another shape? lengths are mm",
                 unit);
    snprintf(text, sizeof text, "%s: the %s measure %.3g mm across, the start shape %.3g mm: %s",
             f->path, cli_fit_kind(f), target, shape->start, advice);
    // half of the points may lie closer together than the whole shape
    if (shape->least > RATIO_MAX * target || middle > 0.5 * RATIO_MAX * shape->most)
        return refuse(f, text, err);
    cli_warn("%s", text);
    return SDM_OK;
}

sdm_status cli_fit_check_size(const cli_fit *f, sdm_error *err)
{
    shape_sizes shape;
    const sdm_status s = find_sizes(f, &shape, err);
    if (s) return s;
    return f->target.kind == SDM_FIT_IMAGE ? check_image(f, &shape, err)
                                           : check_surface(f, &shape, err);
}
