/* sdmgen exact: computes the exact distance map of a shape or a mesh file. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "commands.h"
#include "inputs/grid_cut.h"
#include "inputs/grid_hits.h"
#include "inputs/points_file.h"
#include "inputs/points_unit.h"
#include "inputs/setup.h"
#include "measure/map_memory.h"
#include "measure/measures.h"
#include "measure/points_table.h"
#include "report/exact_layers.h"
#include "report/files.h"
#include "report/json_values.h"
#include "report/output.h"
#include "report/progress_bar.h"
#include "report/report_audit.h"
#include "report/terminal.h"
#include "sdm/exact.h"
#include "sdm/internal/block_border.h"
#include "sdm/internal/checksum.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/exact_slopes.h"
#include "sdm/internal/mesh_box.h"
#include "sdm/internal/methods.h"
#include "sdm/internal/shape_box.h"
#include "sdm/internal/shape_survey.h"
#include "sdm/internal/threads.h"
#include "sdm/internal/units.h"
#include "sdm/internal/vec3.h"
#include "sdm/map.h"
#include "sdm/memory.h"
#include "slicer/results_file.h"

typedef struct job {
    const cli_args *args;
    sdm_text params;
    cli_shape shape; /* of --shape; owns the names of its measures */
    sdm_mesh mesh;
    double ms_mesh;
    sdm_grid grid;
    sdm_exact_report report;
    float *values;     /* the map; NULL: it is in blocks */
    sdm_blocks blocks; /* the map near the surface, if the outputs are level sets only */
    sdm_exact *engine; /* NULL: another method */
    cli_layers layers;
    cli_points_table points; /* of --points */
    sdm_measures measures;   /* of --measure */
    double ms_build, ms_query;
    bool thin;                        /* a part is too thin for the voxels, as was told */
    sdm_sign_certificate certificate; /* checked == 0 without --certify */
    double bound_mm;                  /* bound on the error of the distances; 0: exact */
} job;

static sdm_status measure_shape(job *j, sdm_error *err)
{
    cli_depths depths;
    const sdm_status s = cli_read_depths(j->args, j->shape.instance, &depths, err);
    if (s || !j->args->measure) return s;
    return sdm_shape_measure(j->shape.instance, j->shape.values, depths.mm, depths.n, &j->measures,
                             err);
}

static sdm_status make_shape_mesh(job *j, sdm_error *err)
{
    const cli_shape *shape = &j->shape;
    sdm_status s = cli_shape_open(j->args, j->args->shape, &j->args->options, &j->shape, err);
    if (!s) s = measure_shape(j, err);
    const double start = sdm_clock();
    if (!s) s = sdm_instance_mesh(shape->instance, shape->values, &j->mesh, err);
    j->ms_mesh = 1e3 * (sdm_clock() - start);
    if (!s)
        s = cli_layers_velocity(&j->layers, j->args->jacobian || j->points.wants_slopes,
                                shape->instance, shape->values, j->mesh.n_vert, err);
    if (!s) cli_add_params(shape->params, shape->n_params, shape->values, &j->params);
    if (!s && j->params.failed) s = sdm_fail(err, SDM_E_NOMEM, "out of memory for the metadata");
    return s;
}

/* Checks the options and opens the mesh. */
static sdm_status open_mesh(job *j, sdm_error *err)
{
    const cli_args *args = j->args;
    if (!args->shape == !args->mesh)
        return sdm_fail(err, SDM_E_ARG, "exact: either --shape NAME or --mesh FILE is needed");
    if (args->mesh && (args->params.n > 0 || args->options.n > 0))
        return sdm_fail(err, SDM_E_ARG,
                        "exact: -p and -O belong to --shape; a mesh file has no parameters");
    if (!args->shape && (args->measure || args->depths))
        return sdm_fail(err, SDM_E_ARG,
                        "exact: --measure and --depth belong to --shape; sdmgen mesh --audit "
                        "measures a mesh file");
    if (args->measure && args->points)
        return sdm_fail(err, SDM_E_ARG, "exact: --measure does not go with --points");
    if (args->outputs.n == 0 && !args->points && !args->json && !args->measure &&
        !cli_layers_wanted(args))
        return sdm_fail(err, SDM_E_ARG, "exact: an output is needed: -o FILE, or --json");
    if (args->certify && strcmp(args->method, "exact"))
        return sdm_fail(err, SDM_E_ARG, "exact: --certify belongs to --method exact, not %s",
                        args->method);
    if (args->tolerance > 0 && strcmp(args->method, "octree"))
        return sdm_fail(err, SDM_E_ARG, "exact: --tolerance belongs to --method octree, not %s",
                        args->method);
    if (strcmp(args->sign, "auto") && !strcmp(args->method, "naive"))
        return sdm_fail(err, SDM_E_ARG,
                        "exact: --sign does nothing with --method naive, which computes winding "
                        "numbers");
    if (args->keep_overlap && !strcmp(args->method, "naive"))
        return sdm_fail(err, SDM_E_ARG,
                        "exact: --keep-overlap does nothing with --method naive, which always "
                        "measures to all triangles");
    if (args->columns && !args->points)
        return sdm_fail(err, SDM_E_ARG, "exact: --columns belongs to --points FILE");
    sdm_status s = args->mesh ? cli_refuse_plugins(args, "a mesh file", err) : SDM_OK;
    if (!s) s = cli_check_vdb_options(args, err);
    if (!s)
        s = args->points ? cli_points_check(args, &j->points, err) : cli_layers_check(args, err);
    if (s) return s;
    s = args->mesh ? cli_read_mesh(args->mesh, &j->mesh, err) : make_shape_mesh(j, err);
    return s || !args->turn_parts ? s : cli_turn_parts(&j->mesh, err);
}

static sdm_sign_method find_sign_method(const char *name)
{
    for (int m = SDM_SIGN_AUTO; m <= SDM_SIGN_WINDING; m++)
        if (!strcmp(name, sdm_sign_method_name((sdm_sign_method)m))) return (sdm_sign_method)m;
    return SDM_SIGN_AUTO;
}

/* Are only level sets of a closed mesh wanted, which need the map near the surface only? */
static bool blocks_suffice(const job *j)
{
    const cli_args *args = j->args;
    return cli_blocks_suffice(args) && !args->json && !args->certify && !(args->narrow > 0) &&
           !cli_layers_wanted(args) && j->report.sign == SDM_SIGN_CROSSINGS;
}

/* Computes j->blocks; leaves them empty if the band reaches the border of the grid, where only the
 * whole map can be closed. */
static sdm_status make_blocks(job *j, const sdm_exact *engine, sdm_error *err)
{
    double band;
    // the numbers of the tiles, which every band has
    const double bytes = 4.0 / SDM_BLOCK_VOXELS * (double)sdm_grid_count(&j->grid);
    sdm_status s = cli_check_map_memory(&j->grid, bytes, err);
    if (!s) s = cli_blocks_band(&j->grid, j->args, &band, err);
    if (!s) s = sdm_exact_map_blocks(engine, &j->grid, band, &j->blocks, err);
    if (!s && sdm_blocks_reach_border(&j->blocks)) sdm_blocks_dispose(&j->blocks);
    return s;
}

/* Is nothing asked for but --measure, which needs no map? */
static bool measures_alone(const cli_args *args)
{
    return args->measure && !args->outputs.n && !args->json && !args->certify && !args->returns &&
           !cli_layers_wanted(args);
}

static sdm_status run_engine(job *j, sdm_error *err)
{
    const sdm_exact_opts opts = {.sign = find_sign_method(j->args->sign),
                                 .keep_overlap = j->args->keep_overlap,
                                 .n_threads = (int)j->args->threads,
                                 .cancelled = cli_interrupted};
    const double start = sdm_clock();
    sdm_status s = sdm_exact_create(&j->mesh, &opts, &j->engine, err);
    const double built = sdm_clock();
    if (s) return s;
    j->report = *sdm_exact_get_report(j->engine);
    s = cli_grid_for_box(j->args, j->report.audit.min, j->report.audit.max, &j->grid, err);
    const double query = sdm_clock();
    if (s || measures_alone(j->args)) return s;
    if (blocks_suffice(j)) s = make_blocks(j, j->engine, err);
    if (!s && !j->blocks.tile) {
        const double bytes = sizeof *j->values + cli_layers_bytes(&j->layers, j->args);
        s = cli_check_map_memory(&j->grid, bytes * (double)sdm_grid_count(&j->grid), err);
        if (!s) s = cli_tell_large_map(j->engine, &j->grid, bytes, err);
        if (!s) s = cli_allocate_map(&j->grid, &j->values, err);
        if (!s) s = cli_layers_map(&j->layers, j->args, j->engine, &j->grid, j->values, err);
    }
    j->ms_build = 1e3 * (built - start);
    j->ms_query = 1e3 * (sdm_clock() - query);
    if (!s && j->args->certify)
        s = sdm_exact_certify(j->engine, &j->grid, j->values, &j->certificate, err);
    return s;
}

/* The derivatives by the parameters at the points x[n][3], whose answers are known. */
static sdm_status compute_slopes(job *j, const sdm_exact *engine, const double *x, sdm_error *err)
{
    cli_points_table *t = &j->points;
    sdm_exact_slopes *slopes = NULL;
    const sdm_status s =
        sdm_exact_slopes_create(engine, j->layers.velocity, t->n_params, &slopes, err);
    for (size_t i = 0; i < t->n && !s; i++)
        sdm_exact_slopes_at(slopes, x + 3 * i, &t->at, i, t->slopes + i * t->n_params);
    sdm_exact_slopes_free(slopes);
    return s;
}

/* Does the work of --points. */
static sdm_status run_points(job *j, sdm_error *err)
{
    const sdm_exact_opts opts = {.sign = find_sign_method(j->args->sign),
                                 .keep_overlap = j->args->keep_overlap,
                                 .n_threads = (int)j->args->threads,
                                 .cancelled = cli_interrupted};
    sdm_exact *engine = NULL;
    size_t n_params = 0;
    double *x = NULL;
    size_t n = 0;
    sdm_status s = cli_read_points(j->args->points, &x, NULL, &n, err);
    if (!s) {
        sdm_box shape = SDM_BOX_EMPTY;
        sdm_box_add_mesh(&shape, &j->mesh);
        cli_warn_points_unit(j->args->points, x, n, &shape, "the shape");
    }
    const sdm_param *params =
        j->shape.instance ? sdm_instance_params(j->shape.instance, &n_params) : NULL;
    if (!s) s = cli_points_allocate(&j->points, params, n_params, n, err);
    if (!s) s = sdm_exact_create(&j->mesh, &opts, &engine, err);
    if (!s) j->report = *sdm_exact_get_report(engine);
    if (!s) s = sdm_exact_points(engine, x, n, &j->points.at, err);
    if (!s && j->points.wants_slopes) s = compute_slopes(j, engine, x, err);
    if (!s) s = cli_points_write(&j->points, x, j->args, err);
    sdm_exact_free(engine);
    sdm_free(x);
    return s;
}

typedef struct progress_state {
    cli_progress bar;
    const char *title;
} progress_state;

static void show_progress(void *user, double share)
{
    progress_state *w = user;
    cli_progress_show(&w->bar, w->title, share, NULL);
}

/* Computes the map with a method other than the exact engine. */
static sdm_status run_method(job *j, sdm_error *err)
{
    // the grid
    const sdm_method *method = sdm_method_find(j->args->method, err);
    if (!method) return SDM_E_ARG;
    sdm_audit audit;
    sdm_status s = sdm_mesh_audit(&j->mesh, &audit, err);
    if (!s) s = cli_grid_for_box(j->args, audit.min, audit.max, &j->grid, err);
    if (!s) s = cli_allocate_map(&j->grid, &j->values, err);
    if (s) return s;

    // the map
    progress_state w = {.title = method->name};
    const sdm_method_opts opts = {.exact = {.sign = find_sign_method(j->args->sign),
                                            .keep_overlap = j->args->keep_overlap,
                                            .n_threads = (int)j->args->threads,
                                            .cancelled = cli_interrupted,
                                            .user = &w},
                                  .max_error_mm = j->args->tolerance,
                                  .progress = show_progress};
    sdm_method_report report;
    cli_progress_start(&w.bar);
    s = method->map(&j->mesh, &j->grid, &opts, j->values, &report, err);
    cli_progress_end(&w.bar, !s);
    if (s) return s;
    // the report
    j->report = report.exact;
    j->ms_build = report.ms_prepare;
    j->ms_query = report.ms_map;
    j->bound_mm = report.error_bound_mm;
    if (!method->exact)
        cli_notice("method %s is approximate: the distance is off by at most %g mm (%s)",
                   method->name, report.error_bound_mm, report.note);
    return SDM_OK;
}

/* Finds the smallest and the largest distance of the map in j->values, and counts the voxels
 * inside. */
static void find_range(const job *j, float *min, float *max, int64_t *inside)
{
    const size_t n = sdm_grid_count(&j->grid);
    *min = *max = j->values[0];
    *inside = 0;
    for (size_t i = 0; i < n; i++) {
        if (j->values[i] < *min) *min = j->values[i];
        if (j->values[i] > *max) *max = j->values[i];
        *inside += j->values[i] < 0;
    }
}

/* Warns of a neck or a wall that is thinner than a voxel, while most of its part is not. */
static void warn_torn(const job *j)
{
    static const char *const mend = "give a smaller --spacing";
    if (j->values)
        cli_warn_torn_map("", &j->grid, j->values, mend);
    else if (j->blocks.tile)
        cli_warn_torn_blocks("", &j->blocks, mend);
}

/* A warning, or a notice for grids of one voxel along an axis: probes and slices may miss. */
static void tell_nothing_inside(const sdm_grid *g, const sdm_audit *a)
{
    char text[400];
    const sdm_box box = sdm_box_of_grid(g);
    snprintf(
        text, sizeof text,
        "no voxel of the grid is inside the surface: does the grid cover the shape? It reaches "
        "from (%.4g, %.4g, %.4g) to (%.4g, %.4g, %.4g) mm, the grid from (%.4g, %.4g, %.4g) "
        "to (%.4g, %.4g, %.4g) mm",
        a->min[0], a->min[1], a->min[2], a->max[0], a->max[1], a->max[2], box.min[0], box.min[1],
        box.min[2], box.max[0], box.max[1], box.max[2]);
    if (g->n[0] > 1 && g->n[1] > 1 && g->n[2] > 1)
        cli_warn("%s", text);
    else
        cli_notice("%s", text);
}

static bool writes_labels(const cli_args *args)
{
    for (size_t i = 0; i < args->outputs.n; i++)
        if (cli_ends_with_any(args->outputs.items[i], ".seg.nrrd")) return true;
    return false;
}

static void notice_mesh(job *j)
{
    const sdm_audit *a = &j->report.audit;
    const bool map = !j->args->points && !measures_alone(j->args);
    int64_t inside = 1; // a level set without voxels inside is refused when it is written
    float min, max;
    if (j->values) find_range(j, &min, &max, &inside);
    if (inside && map)
        cli_warn_cut_shape(&j->grid, &j->mesh,
                           "a larger grid (--size, --spacing, --origin) holds it");
    const double size = sqrt(v3_dist2(a->min, a->max));
    // the check of a shape tells it with the parameters
    if (!j->args->shape && size > 0 && (size < SDM_SURVEY_SIZE_MIN || size > SDM_SURVEY_SIZE_MAX))
        cli_warn("the mesh measures %.3g mm across: is it in %s? lengths are mm", size,
                 sdm_unit_near(size < SDM_SURVEY_SIZE_MIN ? 1e3 : 1e-3, NULL));
    // a closed part that meets no other cannot be inside out after the engine has turned it; the
    // audit of the single part of a file, which may be large, would only tell its thickness
    if (a->components > 1 || !a->closed || j->args->shape)
        j->thin = cli_warn_mesh(&j->mesh, map ? sdm_grid_coarsest(&j->grid) : 0,
                                j->args->mesh ? CLI_MEND_FILE : CLI_MEND_SHAPE);
    else {
        cli_warn_audit(a);
        if (j->report.turned) cli_notice("the whole mesh is inside out; maps turn it");
    }
    // a part that is too thin, told above, is the cause of both
    if (map && !j->thin && inside) warn_torn(j);
    if (!j->thin && !inside) tell_nothing_inside(&j->grid, a);
    if (inside && a->closed && map)
        cli_tell_hits(&j->mesh, &j->grid, writes_labels(j->args), !j->args->like);
    if (j->report.unioned)
        cli_notice("the mesh overlaps itself: the union of its %zu triangles is bounded by %zu "
                   "triangles (error at most %.2g mm)",
                   a->n_tri, j->report.n_tri_used, j->report.union_error_mm);
}

/* Returns what the certificate says; without --certify it says nothing. */
static sdm_status judge_signs(const job *j, sdm_error *err)
{
    const sdm_sign_certificate *c = &j->certificate;
    if (!c->checked) return SDM_OK;
    if (c->wrong) {
        const double index[3] = {(double)c->first_wrong[0], (double)c->first_wrong[1],
                                 (double)c->first_wrong[2]};
        double x[3];
        sdm_grid_world(&j->grid, index, x);
        return sdm_fail(err, SDM_E_QUALITY,
                        "signs: %zu of %zu voxels differ from %s, the first at %g, %g, %g mm",
                        c->wrong, c->checked, c->compared, x[0], x[1], x[2]);
    }
    cli_notice("signs: %zu of %zu voxels compared with %s, all agree", c->checked, c->voxels,
               c->compared);
    if (!c->below_zero) return SDM_OK;
    return sdm_fail(
        err, SDM_E_QUALITY,
        "signs: %zu voxels are in a part of the mesh that is inside out and count as outside",
        c->below_zero);
}

static sdm_status write_outputs(const job *j, sdm_error *err)
{
    cli_map map = {.grid = &j->grid,
                   .values = j->values,
                   .blocks = j->blocks.tile ? &j->blocks : NULL,
                   .shape = j->args->mesh ? j->args->mesh : j->args->shape,
                   .params = j->params.data ? j->params.data : "",
                   .source = SDM_SOURCE_EXACT,
                   .error_mm = j->report.union_error_mm + j->bound_mm,
                   .thin = j->thin,
                   .origin = j->args->method,
                   .engine = j->args->narrow > 0 ? NULL : j->engine};
    if (cli_writes_surface(j->args)) cli_map_compare(&j->mesh, &map);
    return cli_write_maps(j->args->outputs.items, j->args->outputs.n, &map, j->args, err);
}

static sdm_status print_json(const job *j, sdm_error *err)
{
    float min, max;
    int64_t inside;
    double volume = NAN;
    find_range(j, &min, &max, &inside);
    const sdm_status s = sdm_map_volume(&j->grid, j->values, (int)j->args->threads, &volume, err);
    if (s) return s;
    const size_t voxels = sdm_grid_count(&j->grid);
    char hash[32];
    snprintf(hash, sizeof hash, "%016llx",
             (unsigned long long)sdm_crc64(0, j->values, voxels * sizeof *j->values));
    // method and times
    sdm_json json = {0};
    sdm_json_open(&json, NULL, '{');
    sdm_json_text(&json, "method", j->args->method);
    sdm_json_real(&json, "error_bound_mm", j->bound_mm);
    sdm_json_real(&json, "ms_mesh", j->ms_mesh);
    sdm_json_real(&json, "ms_build", j->ms_build);
    sdm_json_real(&json, "ms_query", j->ms_query);
    sdm_json_real(&json, "ms_total", j->ms_build + j->ms_query);
    // sizes
    sdm_json_int(&json, "voxels", (int64_t)voxels);
    sdm_json_int(&json, "triangles", (int64_t)j->report.audit.n_tri);
    sdm_json_int(&json, "triangles_used", (int64_t)j->report.n_tri_used);
    sdm_json_int(&json, "threads", sdm_threads((int)j->args->threads));
    // signs, union and defects of the mesh
    sdm_json_text(&json, "sign_method", sdm_sign_method_name(j->report.sign));
    sdm_json_bool(&json, "union", j->report.unioned);
    sdm_json_real(&json, "union_error_mm", j->report.union_error_mm);
    sdm_json_bool(&json, "turned", j->report.turned);
    sdm_json_int(&json, "parts_turned", (int64_t)j->report.parts_turned);
    sdm_json_bool(&json, "closed", j->report.audit.closed);
    sdm_json_int(&json, "boundary_edges", (int64_t)j->report.audit.boundary_edges);
    sdm_json_int(&json, "nonmanifold_edges", (int64_t)j->report.audit.nonmanifold_edges);
    sdm_json_int(&json, "degenerate", (int64_t)j->report.audit.degenerate);
    // values
    sdm_json_real(&json, "min_mm", (double)min);
    sdm_json_real(&json, "max_mm", (double)max);
    sdm_json_int(&json, "inside_voxels", inside);
    sdm_json_real(&json, "volume_mm3", volume);
    if (j->certificate.checked) {
        const sdm_sign_certificate *c = &j->certificate;
        sdm_json_text(&json, "sign_compared", c->compared);
        sdm_json_real(&json, "sign_checked", (double)c->checked / (double)c->voxels);
        sdm_json_real(&json, "sign_agreed", (double)(c->checked - c->wrong) / (double)c->voxels);
        sdm_json_int(&json, "sign_wrong", (int64_t)c->wrong);
        sdm_json_int(&json, "below_zero", (int64_t)c->below_zero);
    }
    if (j->args->measure) cli_json_measures(&j->measures, false, &json);
    sdm_json_text(&json, "values_crc64", hash);
    sdm_json_grid(&json, "grid", &j->grid, false);
    sdm_json_close(&json, '}');
    return cli_print_json(&json, err);
}

/* Writes the file of --returnparameterfile. */
static sdm_status write_results(const job *j, sdm_error *err)
{
    float min = NAN, max;
    int64_t inside;
    cli_results r = {0};
    if (j->values) find_range(j, &min, &max, &inside);
    cli_results_real(&r, "volume", j->report.audit.volume);
    cli_results_text(&r, "closed", j->report.audit.closed ? "yes" : "no");
    cli_results_real(&r, "error", j->report.union_error_mm + j->bound_mm);
    cli_results_real(&r, "deepest", (double)min);
    return cli_results_write(&r, j->args->returns, err);
}

sdm_status cmd_exact(const cli_args *args, sdm_error *err)
{
    job j = {.args = args};
    sdm_status s = open_mesh(&j, err);
    if (!s && args->points) {
        s = run_points(&j, err);
        if (!s) notice_mesh(&j);
    } else if (!s) {
        s = strcmp(args->method, "exact") ? run_method(&j, err) : run_engine(&j, err);
        if (!s) notice_mesh(&j);
        if (!s) s = write_outputs(&j, err);
        if (!s) s = cli_layers_write(&j.layers, args, &j.grid, err);
        if (!s && args->json) s = print_json(&j, err);
        if (!s && args->measure && !args->json) cli_print_measures(&j.measures, false);
        if (!s) s = write_results(&j, err);
        if (!s) s = judge_signs(&j, err);
    }
    cli_layers_dispose(&j.layers);
    sdm_exact_free(j.engine);
    sdm_free(j.values);
    sdm_blocks_dispose(&j.blocks);
    cli_points_dispose(&j.points);
    sdm_mesh_dispose(&j.mesh);
    sdm_text_dispose(&j.params);
    cli_shape_dispose(&j.shape);
    return s;
}
