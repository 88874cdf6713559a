/* Example of a fit in C: reads points on a surface, fits the shape of a model to them, and prints
 * the parameters and the pose with their standard deviations, what the points do not determine, and
 * the verdict. The fit begins at the middle of the points with the shape's default parameters and
 * tries 60 rotations.
 * Usage: fit_points MODEL POINTS.csv [PLUGIN.so]
 * PLUGIN.so: the plug-in of the shape. If the shape is known, built in or from the plug-in, the fit
 * measures exact distances to it: for points this takes less time than maps of the network.
 * POINTS.csv: a header, then x,y,z in each line (mm). Exit code 4: the fit is not to be trusted. */
#include <stdio.h>

#include "sdm/builtin_shapes.h"
#include "sdm/fit.h"
#include "sdm/memory.h"

enum { POINTS_MAX = 100000 };

static sdm_status read_points(const char *path, double *points, size_t *n, sdm_error *err)
{
    char line[256];
    FILE *f = fopen(path, "r");
    *n = 0;
    if (!f || !fgets(line, sizeof line, f)) {
        if (f) fclose(f);
        return sdm_fail(err, SDM_E_IO, "%s: no such file, or it is empty", path);
    }
    while (*n < POINTS_MAX && fgets(line, sizeof line, f)) {
        double *x = points + 3 * *n;
        if (sscanf(line, "%lf,%lf,%lf", &x[0], &x[1], &x[2]) == 3) ++*n;
    }
    fclose(f);
    return *n ? SDM_OK : sdm_fail(err, SDM_E_FORMAT, "%s: no points", path);
}

static void print_fit(const sdm_model_info *info, const sdm_fit_result *r)
{
    static const char *const GRADES[] = {"passed", "doubtful", "FAILED"};
    for (size_t i = 0; i < info->n_params; i++)
        printf("%s = %.5g +- %.2g %s%s%s\n", info->params[i].name, r->params[i], r->sd[i],
               info->params[i].unit, r->by_prior[i] ? ", not determined" : "",
               r->at_bound[i] ? ", at an end of its range: +- does not hold" : "");
    // with deviations that leave out the motions which the points do not determine
    const double *turn = r->pose.rotation, *move = r->pose.translation, *sd = r->pose_sd_determined;
    printf("rotation %.5g %.5g %.5g +- %.2g %.2g %.2g rad\n", turn[0], turn[1], turn[2], sd[0],
           sd[1], sd[2]);
    printf("translation %.5g %.5g %.5g +- %.2g %.2g %.2g mm\n", move[0], move[1], move[2], sd[3],
           sd[4], sd[5]);
    if (r->open_motions[0]) printf("not determined: %s\n", r->open_motions);
    printf("verdict: %s\n", GRADES[r->verdict.grade]);
    for (size_t i = 0; i < r->verdict.n_findings; i++) {
        const sdm_fit_finding *f = &r->verdict.findings[i];
        if (f->grade != SDM_FIT_PASSED)
            printf("  %s: %s, %s\n", sdm_fit_check_name(f->kind), GRADES[f->grade], f->text);
    }
}

static sdm_status fit_points(const sdm_model *model, const sdm_instance *shape, const char *path,
                             sdm_error *err)
{
    const sdm_model_info *info = sdm_model_get_info(model);
    const sdm_fit_source source = {
        .model = shape ? NULL : model, .shape = shape, .grid = info->grid};
    sdm_fit_opts opts = sdm_fit_defaults_for(info->grid.spacing[0]);
    opts.turns = SDM_FIT_TURNS_SPHERE;
    opts.n_turns = 60;
    sdm_fit_target target = {.kind = SDM_FIT_POINTS};
    sdm_fit_result result = {0};
    double *points = NULL, middle[3] = {0};
    sdm_status s = SDM_ALLOC(&points, 3 * POINTS_MAX, "points", err);
    if (!s) s = read_points(path, points, &target.n_points, err);
    target.points = points;
    for (size_t i = 0; i < target.n_points && !s; i++)
        for (size_t a = 0; a < 3; a++) middle[a] += points[3 * i + a] / (double)target.n_points;
    // Points of a part of the shape need a better start: set `middle` to the place of the shape's
    // middle, and a rotation that is known so (axis times angle in rad, here 90 degrees about z):
    //     opts.turns = SDM_FIT_TURNS_NONE;
    //     opts.start_pose.rotation[2] = 1.5708;
    if (!s) s = sdm_fit_centre(&source, NULL, opts.pivot, err); // the middle of the shape ...
    double at[3];
    sdm_pose_apply(&opts.start_pose, opts.pivot, at);
    for (int a = 0; a < 3; a++) // ... starts at the middle of the points
        opts.start_pose.translation[a] = middle[a] - at[a];
    if (!s) s = sdm_fit(&source, &target, &opts, &result, err);
    if (result.params) print_fit(info, &result); // also of a fit that is refused
    sdm_fit_dispose(&result);
    sdm_free(points);
    return s;
}

int main(int argc, char **argv)
{
    sdm_error err = {0};
    sdm_model *model = NULL;
    sdm_registry *registry = NULL;
    sdm_instance *shape = NULL;
    if (argc != 3 && argc != 4) {
        fputs("usage: fit_points MODEL POINTS.csv [PLUGIN.so]\n", stderr);
        return 2;
    }
    sdm_status s = sdm_model_open(argv[1], &model, &err);
    if (!s) s = sdm_registry_create(&registry, &err);
    if (!s) s = sdm_builtin_shapes_add(registry, &err);
    if (!s && argc == 4) s = sdm_registry_load(registry, argv[3], &err);
    if (!s) s = sdm_runtime_instance(model, registry, &shape, &err);
    if (!s) s = fit_points(model, shape, argv[2], &err);
    if (s) fprintf(stderr, "fit_points: %s\n", err.text);
    sdm_instance_free(shape);
    sdm_registry_free(registry);
    sdm_model_free(model);
    return s == SDM_E_QUALITY ? 4 : s ? 1 : 0;
}
