/* Example of a fit in C without a network: fits a shape to the voxels with one label of an image
 * file, by exact maps, and prints the parameters with their standard deviations and the verdict.
 * The shape begins at the middle of the labels, with its default parameters and as it stands in its
 * own frame.
 * Usage: fit_labels SHAPE LABELS.nii.gz LABEL [PLUGIN.so]
 * Exit code 4: the fit is not to be trusted. */
#include <sdm/sdmgen.h>
#include <stdio.h>
#include <stdlib.h>

/* The grid of the exact maps, in the frame of the shape: the box of the mesh with a quarter of its
 * longest edge around it, 64 voxels along this edge. Thin parts need more: at least three voxels
 * across the thinnest. */
static sdm_status fit_grid(const sdm_instance *shape, sdm_grid *grid, sdm_error *err)
{
    double p[64]; // a shape has at most 64 parameters
    size_t n_params = 0;
    const sdm_param *params = sdm_instance_params(shape, &n_params);
    sdm_mesh mesh = {0};
    sdm_audit audit;
    for (size_t i = 0; i < n_params; i++) p[i] = params[i].def;
    sdm_status s = sdm_instance_mesh(shape, p, &mesh, err);
    if (!s) s = sdm_mesh_audit(&mesh, &audit, err);
    sdm_mesh_dispose(&mesh);
    if (s) return s;
    double centre[3], edge = 0;
    for (int a = 0; a < 3; a++) {
        centre[a] = 0.5 * (audit.min[a] + audit.max[a]);
        if (audit.max[a] - audit.min[a] > edge) edge = audit.max[a] - audit.min[a];
    }
    int64_t n[3];
    for (int a = 0; a < 3; a++)
        n[a] = (int64_t)(64 * (audit.max[a] - audit.min[a] + 0.5 * edge) / edge) + 2;
    *grid = sdm_grid_centred(n, edge / 64, centre);
    return SDM_OK;
}

/* Turns the values of the voxels into 1 with the label, 0 without it (between them: the probability
 * of inside). middle: the mean of the voxels with the label, mm. */
static sdm_status take_label(sdm_volume *labels, float label, double middle[3], sdm_error *err)
{
    const sdm_grid *grid = &labels->grid;
    size_t n = 0;
    for (int a = 0; a < 3; a++) middle[a] = 0;
    for (int64_t k = 0; k < grid->n[2]; k++)
        for (int64_t j = 0; j < grid->n[1]; j++)
            for (int64_t i = 0; i < grid->n[0]; i++) {
                const double index[3] = {(double)i, (double)j, (double)k};
                float *value = &labels->values[sdm_grid_voxel(grid, i, j, k)];
                double at[3];
                *value = *value == label ? 1 : 0;
                if (*value == 0) continue;
                sdm_grid_world(grid, index, at);
                for (int a = 0; a < 3; a++) middle[a] += at[a];
                n++;
            }
    if (!n) return sdm_fail(err, SDM_E_ARG, "no voxel has the label %g", (double)label);
    for (int a = 0; a < 3; a++) middle[a] /= (double)n;
    return SDM_OK;
}

static void print_fit(const sdm_instance *shape, const sdm_fit_result *r)
{
    static const char *const GRADES[] = {"passed", "doubtful", "FAILED"};
    size_t n = 0;
    const sdm_param *params = sdm_instance_params(shape, &n);
    for (size_t i = 0; i < n; i++)
        printf("%s = %.5g +- %.2g %s\n", params[i].name, r->params[i], r->sd[i], params[i].unit);
    printf("verdict: %s\n", GRADES[r->verdict.grade]);
    for (size_t i = 0; i < r->verdict.n_findings; i++) {
        const sdm_fit_finding *f = &r->verdict.findings[i];
        if (f->grade != SDM_FIT_PASSED)
            printf("  %s: %s, %s\n", sdm_fit_check_name(f->kind), GRADES[f->grade], f->text);
    }
}

static sdm_status fit_labels(const sdm_instance *shape, const sdm_volume *labels,
                             const double middle[3], sdm_error *err)
{
    sdm_fit_source source = {.shape = shape};
    const sdm_fit_target target = {
        .kind = SDM_FIT_LABEL, .grid = labels->grid, .values = labels->values};
    sdm_fit_result result = {0};
    sdm_status s = fit_grid(shape, &source.grid, err);
    if (s) return s;
    double voxel = source.grid.spacing[0]; // the longest edge of a voxel of maps or labels
    for (int a = 0; a < 3; a++)
        if (labels->grid.spacing[a] > voxel) voxel = labels->grid.spacing[a];
    sdm_fit_opts opts = sdm_fit_defaults_for(voxel);
    // not known how the shape stands: opts.turns = SDM_FIT_TURNS_SPHERE; opts.n_turns = 60;
    s = sdm_fit_centre(&source, NULL, opts.pivot, err); // the middle of the shape ...
    for (int a = 0; a < 3; a++)                         // ... starts at the middle of the labels
        opts.start_pose.translation[a] = middle[a] - opts.pivot[a];
    if (!s) s = sdm_fit(&source, &target, &opts, &result, err);
    if (result.params) print_fit(shape, &result); // also of a fit that is refused
    sdm_fit_dispose(&result);
    return s;
}

int main(int argc, char **argv)
{
    sdm_error err = {0};
    sdm_registry *registry = NULL;
    sdm_instance *shape = NULL;
    sdm_volume labels = {0};
    double middle[3];
    if (argc != 4 && argc != 5) {
        fputs("usage: fit_labels SHAPE LABELS.nii.gz LABEL [PLUGIN.so]\n", stderr);
        return 2;
    }
    sdm_status s = sdm_registry_create(&registry, &err);
    if (!s) s = sdm_builtin_shapes_add(registry, &err);
    if (!s && argc == 5) s = sdm_registry_load(registry, argv[4], &err);
    const sdm_shape *table = s ? NULL : sdm_registry_find(registry, argv[1], NULL);
    if (!s && !table) s = sdm_fail(&err, SDM_E_ARG, "no shape '%s'", argv[1]);
    if (!s) s = sdm_instance_create(table, NULL, 0, NULL, &shape, &err);
    if (!s) s = sdm_volume_read(argv[2], &labels, &err);
    if (!s) s = take_label(&labels, strtof(argv[3], NULL), middle, &err);
    if (!s) s = fit_labels(shape, &labels, middle, &err);
    if (s) fprintf(stderr, "fit_labels: %s\n", err.text);
    sdm_volume_dispose(&labels);
    sdm_instance_free(shape);
    sdm_registry_free(registry);
    return s == SDM_E_QUALITY ? 4 : s ? 1 : 0;
}
