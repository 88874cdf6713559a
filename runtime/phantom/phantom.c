/* Makes phantoms: checks the options, makes the label and the image; draws random parameters and
   poses. */
#include "sdm/phantom.h"

#include <math.h>

#include "phantom_parts.h"
#include "sdm/internal/distribution.h"
#include "sdm/internal/rng.h"
#include "sdm/internal/threads.h"
#include "sdm/memory.h"

enum { SIGMA_VOXELS_MAX = 64, SUPERSAMPLING_MAX = 16 };

sdm_phantom_opts sdm_phantom_defaults(void)
{
    // the noise is as measured in air; texture and noise together give 170, 270 and 150 HU
    return (sdm_phantom_opts){.inside = {40, 80},
                              .outside = {1300, 225},
                              .air = {-880, 0},
                              .air_mm = 1,
                              .air_clear_mm = 1,
                              .blur = {0.15, 0.15, 0.15},
                              .texture_mm = 0.4,
                              .noise = 150,
                              .noise_is_blurred = true,
                              .supersampling = 3,
                              .seed = 1};
}

/* ---- checks ---- */

static sdm_status check_tissue(const char *name, sdm_tissue t, sdm_error *err)
{
    if (!(fabs(t.mean) <= 1e30))
        return sdm_fail(err, SDM_E_ARG, "mean of the tissue %s is %g, need a finite number", name,
                        t.mean);
    if (!(t.sd >= 0) || !(t.sd <= 1e30))
        return sdm_fail(err, SDM_E_ARG,
                        "texture of the tissue %s is %g, need a finite number from 0 on", name,
                        t.sd);
    return SDM_OK;
}

/* SDM_E_ARG unless `width` (mm) is from 0 to SIGMA_VOXELS_MAX voxels along the axis. */
static sdm_status check_width(const char *what, double width, int axis, const sdm_grid *g,
                              sdm_error *err)
{
    const double limit = SIGMA_VOXELS_MAX * g->spacing[axis];
    if (width >= 0 && width <= limit) return SDM_OK;
    return sdm_fail(err, SDM_E_ARG, "%s along %c is %g mm, need 0 to %g (%d voxels)", what,
                    "xyz"[axis], width, limit, SIGMA_VOXELS_MAX);
}

static sdm_status check_air(const sdm_phantom_opts *o, sdm_error *err)
{
    if (!(o->air_share >= 0) || !(o->air_share <= 1))
        return sdm_fail(err, SDM_E_ARG, "share of air cells is %g, need 0 to 1", o->air_share);
    if (o->air_share == 0) return SDM_OK;
    if (!(o->air_mm > 0) || !(o->air_mm <= 1e30))
        return sdm_fail(err, SDM_E_ARG,
                        "diameter of the air cells is %g mm, need a positive number", o->air_mm);
    if (!(o->air_clear_mm >= 0) || !(o->air_clear_mm <= 1e30))
        return sdm_fail(err, SDM_E_ARG,
                        "air cells keep %g mm clear of the surface, need a finite number from 0 on",
                        o->air_clear_mm);
    return SDM_OK;
}

static sdm_status check_options(const sdm_phantom_opts *o, const sdm_grid *g, sdm_error *err)
{
    sdm_status s = check_tissue("inside", o->inside, err);
    if (!s) s = check_tissue("outside", o->outside, err);
    if (!s) s = check_tissue("air", o->air, err);
    if (!s) s = check_air(o, err);
    for (int a = 0; a < 3 && !s; a++) {
        s = check_width("blur", o->blur[a], a, g, err);
        if (!s) s = check_width("smoothing of the texture", o->texture_mm, a, g, err);
    }
    if (s) return s;
    if (!(o->noise >= 0) || !(o->noise <= 1e30))
        return sdm_fail(err, SDM_E_ARG, "noise is %g, need a finite number from 0 on", o->noise);
    if (o->supersampling < 1 || o->supersampling > SUPERSAMPLING_MAX)
        return sdm_fail(err, SDM_E_ARG, "supersampling is %d, need 1 to %d", o->supersampling,
                        SUPERSAMPLING_MAX);
    if (o->n_threads < 0)
        return sdm_fail(err, SDM_E_ARG, "%d threads, need 0 (all) or more", o->n_threads);
    return SDM_OK;
}

/* ---- the image ---- */

/* *out = new exact engine of the shape at p (NULL: defaults). */
static sdm_status make_engine(const sdm_instance *shape, const double *p, const sdm_phantom_opts *o,
                              sdm_exact **out, sdm_error *err)
{
    size_t n;
    const sdm_param *params = sdm_instance_params(shape, &n);
    const sdm_exact_opts exact = {
        .n_threads = o->n_threads, .cancelled = o->cancelled, .user = o->user};
    double *defaults = NULL;
    sdm_mesh mesh = {0};
    sdm_status s = p ? SDM_OK : SDM_ALLOC(&defaults, n, "parameters", err);
    for (size_t i = 0; i < n && defaults; i++) defaults[i] = params[i].def;
    if (!s) s = sdm_instance_mesh(shape, p ? p : defaults, &mesh, err);
    if (!s) s = sdm_exact_create(&mesh, &exact, out, err);
    sdm_mesh_dispose(&mesh);
    sdm_free(defaults);
    return s;
}

/* label[nz][ny][nx] = 1 where the voxel centre is inside the shape. */
static sdm_status make_label(const sdm_exact *engine, const sdm_pose *pose, const sdm_grid *grid,
                             uint8_t *label, sdm_error *err)
{
    const sdm_grid seen = phantom_shape_grid(grid, pose);
    const size_t n = sdm_grid_count(grid);
    float *distance = NULL;
    sdm_status s = SDM_ALLOC(&distance, n, "distance map", err);
    const sdm_exact_layers layers = {
        .values = distance, .band_mm = grid->spacing[0]}; // only signs are needed: a narrow band
    if (!s) s = sdm_exact_map_layers(engine, &seen, &layers, err);
    for (size_t i = 0; i < n && !s; i++) label[i] = distance[i] < 0;
    sdm_free(distance);
    return s;
}

/* Replaces values[n], which holds the shares of the inside, by the image. air[n]: shares of the
   air; texture[n], noise[n]: random fields; each NULL if not wanted. */
static void mix_tissues(const sdm_phantom_opts *o, size_t n, const float *air, const float *texture,
                        const float *noise, float *values)
{
    const double mean[2] = {o->inside.mean - o->outside.mean, o->air.mean - o->outside.mean};
    const double base = o->outside.sd * o->outside.sd;
    const double variance[2] = {o->inside.sd * o->inside.sd - base, o->air.sd * o->air.sd - base};
    for (size_t i = 0; i < n; i++) {
        const double a = (double)values[i], b = air ? (double)air[i] : 0;
        double v = o->outside.mean + a * mean[0] + b * mean[1];
        if (texture)
            v += sqrt(fmax(base + a * variance[0] + b * variance[1], 0)) * (double)texture[i];
        if (noise) v += o->noise * (double)noise[i];
        values[i] = (float)v;
    }
}

/* values[nz][ny][nx] = the image. */
static sdm_status make_values(const sdm_exact *engine, const sdm_pose *pose,
                              const sdm_phantom_opts *o, const sdm_grid *grid, float *values,
                              sdm_error *err)
{
    static const double white[3];
    const double smooth[3] = {o->texture_mm, o->texture_mm, o->texture_mm};
    const size_t n = sdm_grid_count(grid);
    const bool has_texture =
        o->inside.sd > 0 || o->outside.sd > 0 || (o->air_share > 0 && o->air.sd > 0);
    float *air = NULL, *texture = NULL, *noise = NULL;
    sdm_status s = o->air_share > 0 ? SDM_ALLOC(&air, n, "air cells", err) : SDM_OK;
    if (!s) s = phantom_shares(engine, pose, o, grid, values, air, err);
    if (!s && has_texture)
        s = phantom_field_make(grid, smooth, o, PHANTOM_STREAM_TEXTURE, &texture, err);
    if (!s && o->noise > 0)
        s = phantom_field_make(grid, o->noise_is_blurred ? o->blur : white, o, PHANTOM_STREAM_NOISE,
                               &noise, err);
    if (!s) mix_tissues(o, n, air, texture, noise, values);
    sdm_free(noise);
    sdm_free(texture);
    sdm_free(air);
    return s;
}

sdm_status sdm_phantom_make(const sdm_instance *shape, const double *p, const sdm_pose *pose,
                            const sdm_phantom_opts *opts, const sdm_grid *grid, float *values,
                            uint8_t *label, sdm_error *err)
{
    static const sdm_pose identity;
    if (!shape || !grid || (!values && !label))
        return sdm_fail(err, SDM_E_ARG, "phantom: shape, grid, and values or label are needed");
    const sdm_phantom_opts o = opts ? *opts : sdm_phantom_defaults();
    if (!pose) pose = &identity;
    sdm_exact *engine = NULL;
    sdm_status s = sdm_grid_check(grid, err);
    if (!s) s = sdm_pose_check(pose, err);
    if (!s) s = check_options(&o, grid, err);
    if (!s) s = make_engine(shape, p, &o, &engine, err);
    if (!s && label) s = make_label(engine, pose, grid, label, err);
    if (!s && values) s = make_values(engine, pose, &o, grid, values, err);
    sdm_exact_free(engine);
    return s;
}

/* ---- random truth ---- */

void sdm_phantom_random_params(const sdm_instance *shape, uint64_t seed, double *p)
{
    size_t n;
    const sdm_param *params = sdm_instance_params(shape, &n);
    const sdm_distribution *distribution = sdm_instance_distributions(shape);
    for (size_t i = 0; i < n; i++) {
        const double u = sdm_rng_uniform(seed, PHANTOM_STREAM_PARAMS, i);
        p[i] = fmin(sdm_distribution_quantile(&distribution[i], params[i].min, params[i].max, u),
                    params[i].max);
    }
}

/* v = random vector of uniform direction and the given length, from numbers first .. first + 2 of
   the stream. */
static void random_vector(uint64_t seed, uint64_t first, double length, double v[3])
{
    double square = 0;
    for (int i = 0; i < 3; i++) {
        v[i] = sdm_rng_normal(seed, PHANTOM_STREAM_POSE, first + (uint64_t)i);
        square += v[i] * v[i];
    }
    for (int i = 0; i < 3; i++) v[i] *= square > 0 ? length / sqrt(square) : 0;
}

sdm_pose sdm_phantom_random_pose(double max_angle, double max_mm, uint64_t seed)
{
    sdm_pose pose;
    const double turn = sdm_rng_uniform(seed, PHANTOM_STREAM_POSE, 0);
    // cube root: uniform in the ball
    const double shift = cbrt(sdm_rng_uniform(seed, PHANTOM_STREAM_POSE, 1));
    random_vector(seed, 2, turn * max_angle, pose.rotation);
    random_vector(seed, 5, shift * max_mm, pose.translation);
    return pose;
}
