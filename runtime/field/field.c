/* A field: the splines of a model's map at one parameter vector. */
#include "sdm/field.h"

#include <math.h>
#include <string.h>

#include "field_parts.h"
#include "maps/check_results.h"
#include "maps/generate_parts.h"
#include "sdm/internal/fine.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/threads.h"

static sdm_status allocate(sdm_field *f, sdm_error *err)
{
    const size_t p = f->info->n_params, n_maps = f->derivatives ? p + 1 : 1;
    size_t count;
    sdm_status s = sdm_mul(n_maps, f->shape.count, &count, err);
    if (!s) s = SDM_ALLOC(&f->splines, count, "splines of a field", err);
    if (!s) s = SDM_ALLOC(&f->maps, n_maps * f->voxels, "maps of a field", err);
    if (!s)
        s = SDM_ALLOC(&f->scratch, sdm_spline_scratch(&f->shape, f->n_threads),
                      "factors of a spline", err);
    if (!s) s = SDM_ALLOC(&f->params, p, "parameters", err);
    return s ? s : SDM_ALLOC(&f->used, p, "parameters", err);
}

sdm_status sdm_field_create(const sdm_model *m, const sdm_generate_opts *opts, bool derivatives,
                            sdm_field **out, sdm_error *err)
{
    if (!m || !out)
        return sdm_fail(err, SDM_E_ARG, "field: a model and a place for the field are needed");
    *out = NULL;
    sdm_generate_opts o;
    sdm_status s = sdm_generate_check_options(m, opts, &o, err);
    if (!s && sdm_wants_check(&o))
        s = sdm_fail(err, SDM_E_ARG, "field: check and max_error_mm are for maps");
    sdm_field *f = NULL;
    if (!s) s = SDM_ALLOC(&f, 1, "field", err);
    if (s) return s;
    f->model = m;
    f->info = sdm_model_get_info(m);
    f->opts = o;
    f->n_threads = sdm_threads(o.n_threads);
    f->derivatives = derivatives;
    f->grid = sdm_model_fine(m) ? sdm_fine_grid(&f->info->grid) : f->info->grid;
    f->shape = sdm_spline_shape(f->grid.n);
    f->frame = sdm_spline_frame(&f->grid);
    f->kernels = sdm_spline_kernels();
    f->voxels = sdm_grid_count(&f->grid);
    s = allocate(f, err);
    if (s) {
        sdm_field_free(f);
        return s;
    }
    *out = f;
    return SDM_OK;
}

static void free_exact(sdm_field *f)
{
    sdm_exact_slopes_free(f->slopes);
    f->slopes = NULL;
    sdm_shape_surface_dispose(&f->surface);
}

void sdm_field_free(sdm_field *f)
{
    if (!f) return;
    free_exact(f);
    sdm_free(f->used);
    sdm_free(f->params);
    sdm_free(f->scratch);
    sdm_free(f->maps);
    sdm_free(f->splines);
    sdm_free(f);
}

/* The exact engine at the parameters of the field, and with `derivatives` what slopes need. */
static sdm_status open_exact(sdm_field *f, bool derivatives, sdm_error *err)
{
    const sdm_exact_opts exact = {.n_threads = f->opts.n_threads};
    sdm_status s = sdm_shape_surface_make(f->opts.exact_shape, f->params, derivatives, &exact,
                                          &f->surface, err);
    if (!s && derivatives)
        s = sdm_exact_slopes_create(f->surface.engine, f->surface.velocity, f->surface.n_params,
                                    &f->slopes, err);
    return s;
}

/* The same; a shape whose vertices have no velocities still has distances outside of the box. */
static sdm_status open_exact_outside(sdm_field *f, sdm_error *err)
{
    const sdm_status s = open_exact(f, f->derivatives, err);
    return s == SDM_E_PLUGIN && f->derivatives ? open_exact(f, false, err) : s;
}

/* maps[1 + n_params or 1][voxels of the model's grid] = the map by the network, and its
 * derivatives.
 */
static sdm_status network_maps(const sdm_field *f, float *maps, sdm_error *err)
{
    const sdm_generate_opts plain = {.n_threads = f->opts.n_threads};
    return f->derivatives ? sdm_generate_jacobian(f->model, f->used, &plain, maps,
                                                  maps + sdm_grid_count(&f->info->grid), NULL, err)
                          : sdm_generate(f->model, f->used, &plain, maps, NULL, err);
}

/* The same on the grid of the fine level. */
static sdm_status fine_maps(const sdm_field *f, float *maps, sdm_error *err)
{
    const size_t n_tangents = f->derivatives ? f->info->n_params : 0;
    float *coarse = NULL;
    sdm_status s =
        sdm_alloc_unset((void **)&coarse, (1 + n_tangents) * sdm_grid_count(&f->info->grid),
                        sizeof *coarse, "maps of a field", err);
    if (!s) s = network_maps(f, coarse, err);
    if (!s)
        s = sdm_fine_map(sdm_model_fine(f->model), &f->info->grid, n_tangents, coarse, f->n_threads,
                         maps, err);
    sdm_free(coarse);
    return s;
}

/* The maps and splines. */
static sdm_status fill_maps(sdm_field *f, sdm_error *err)
{
    const size_t n_maps = f->derivatives ? f->info->n_params + 1 : 1;
    const sdm_status s =
        sdm_model_fine(f->model) ? fine_maps(f, f->maps, err) : network_maps(f, f->maps, err);
    for (size_t i = 0; i < n_maps && !s; i++)
        sdm_spline_fit(&f->shape, f->maps + i * f->voxels, f->n_threads, f->scratch,
                       f->splines + i * f->shape.count);
    return s;
}

sdm_status sdm_field_set_params(sdm_field *f, const double *params, sdm_result *result,
                                sdm_error *err)
{
    if (!f || !params) return sdm_fail(err, SDM_E_ARG, "field: a field and parameters are needed");
    f->ready = false;
    free_exact(f);
    memcpy(f->params, params, f->info->n_params * sizeof *params);
    sdm_status s = sdm_generate_check_params(f->model, params, &f->opts, f->used, &f->result, err);
    if (!s && !field_is_exact(f)) {
        // clamped parameters are those of every later exact distance too
        memcpy(f->params, f->used, f->info->n_params * sizeof *params);
        s = fill_maps(f, err);
    }
    if (!s && field_is_exact(f))
        s = open_exact(f, f->derivatives, err);
    else if (!s && f->opts.outside == SDM_OUTSIDE_EXACT)
        s = open_exact_outside(f, err);
    f->ready = !s;
    if (!s && result) *result = f->result;
    return s;
}

sdm_status sdm_field_check(const sdm_field *f, const float *slopes, sdm_error *err)
{
    if (!f->ready) return sdm_fail(err, SDM_E_ARG, "field: sdm_field_set_params() comes first");
    if (slopes && !f->derivatives)
        return sdm_fail(err, SDM_E_ARG, "field: created without derivatives, slopes are not known");
    return SDM_OK;
}

sdm_status sdm_field_refuse(const sdm_field *f, const char *what, sdm_error *err)
{
    const sdm_grid *g = &f->info->grid;
    const double last[3] = {(double)(g->n[0] - 1), (double)(g->n[1] - 1), (double)(g->n[2] - 1)};
    double end[3];
    sdm_grid_world(g, last, end);
    return sdm_fail(err, SDM_E_RANGE,
                    "%s the box in which the network knows the distance, from (%.6g, %.6g, %.6g) "
                    "to (%.6g, %.6g, %.6g) mm; other points need sdm_generate_opts.outside "
                    "bound or exact",
                    what, g->origin[0], g->origin[1], g->origin[2], end[0], end[1], end[2]);
}
