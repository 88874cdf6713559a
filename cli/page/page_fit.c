/* Reads the result of a fit, and computes what a page shows of it. */
#include "page_fit.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "fit/fit_command.h"
#include "inputs/input_checksum.h"
#include "report/terminal.h"
#include "sdm/internal/mat3.h"
#include "sdm/map.h"
#include "sdm/memory.h"

enum { UNKNOWNS_MAX = 256 }; // of a fit with a band of one standard deviation

void cli_page_fit_dispose(cli_page_fit *f)
{
    sdm_free(f->bytes);
    sdm_free(f->image);
    sdm_free(f->sd);
    sdm_free(f->map);
    sdm_free(f->params);
    sdm_json_document_dispose(&f->json);
    sdm_free(f->text);
    *f = (cli_page_fit){0};
}

/* ---- the file ---- */

/* A file that the result names. */
typedef struct named_file {
    char name[SDM_PATH_TEXT_MAX]; /* in the result; "": none */
    char path[SDM_PATH_TEXT_MAX]; /* where it is; "": nowhere */
    bool is_same;                 /* it has the checksum that the result states */
} named_file;

/* text = the checksum that the result states for the file; "" if it states none. */
static void get_checksum(const cli_page_fit *f, const char *name, char text[20])
{
    const sdm_json_document *d = &f->json;
    const size_t inputs = sdm_json_member(d, 0, "inputs");
    char file[SDM_PATH_TEXT_MAX];
    *text = '\0';
    if (!inputs || d->values[inputs].kind != '[') return;
    for (size_t i = inputs + 1; i < d->values[inputs].next; i = d->values[i].next) {
        const size_t given = sdm_json_member(d, i, "file"), sum = sdm_json_member(d, i, "crc64");
        if (!given || !sum || !sdm_json_word(d, given, file, sizeof file)) continue;
        if (strcmp(file, name)) continue;
        if (!sdm_json_word(d, sum, text, 20)) *text = '\0';
        return;
    }
}

/* Sets file->path to this path if it can be read, and it has the checksum or is the first one that
 * can be read. Does nothing once a path with the checksum was found. */
static void try_path(const char *path, const char *checksum, named_file *file)
{
    uint64_t crc = 0;
    char now[20];
    if (file->is_same || strlen(path) >= sizeof file->path || access(path, R_OK)) return;
    if (cli_input_checksum(path, &crc, NULL)) return;
    snprintf(now, sizeof now, "%016" PRIx64, crc);
    file->is_same = !strcmp(now, checksum);
    if (file->is_same || !*file->path) snprintf(file->path, sizeof file->path, "%s", path);
}

/* Finds the file that the member `key` names: from the working folder, from the folder of the
 * result, or beside the result. The first one with the right checksum is taken, or else the first
 * one. */
static void find_file(const cli_page_fit *f, const char *key, named_file *file)
{
    *file = (named_file){.is_same = false};
    if (!sdm_json_word(&f->json, sdm_json_member(&f->json, 0, key), file->name, sizeof file->name))
        *file->name = '\0';
    if (!*file->name) return;
    const char *last = strrchr(file->name, '/'), *slash = strrchr(f->name, '/');
    const int folder = slash ? (int)(slash - f->name) + 1 : 0;
    char checksum[20], path[2 * SDM_PATH_TEXT_MAX];
    get_checksum(f, file->name, checksum);
    try_path(file->name, checksum, file);
    snprintf(path, sizeof path, "%.*s%s", folder, f->name, file->name);
    if (folder && *file->name != '/') try_path(path, checksum, file);
    snprintf(path, sizeof path, "%.*s%s", folder, f->name, last ? last + 1 : file->name);
    if (last) try_path(path, checksum, file);
}

static sdm_status find_model(bool changed, cli_page_fit *f, sdm_error *err)
{
    named_file model;
    find_file(f, "model", &model);
    if (!*model.path)
        return sdm_fail(err, SDM_E_IO,
                        "%s: its model '%s' is gone: put it there, or into the folder of this "
                        "file",
                        f->name, model.name);
    if (!model.is_same && !changed)
        return sdm_fail(err, SDM_E_FORMAT,
                        "%s: its model %s has changed since the fit, or is another file: it has "
                        "not the checksum that the result states; --changed-files takes it",
                        f->name, model.path);
    if (!model.is_same) cli_notice("%s has changed since the fit", model.path);
    snprintf(f->model_path, sizeof f->model_path, "%s", model.path);
    return SDM_OK;
}

static void find_image(bool changed, cli_page_fit *f)
{
    named_file image;
    find_file(f, "image", &image);
    const bool taken = *image.path && (image.is_same || changed);
    if (!*image.path)
        cli_notice("%s: its image '%s' is gone: the page shows none (put it there, or into the "
                   "folder of this file)",
                   f->name, image.name);
    else if (!taken)
        cli_notice("%s: its image %s has changed since the fit, or is another file: it has not "
                   "the checksum that the result states, and the page shows none "
                   "(--changed-files shows it)",
                   f->name, image.path);
    else if (!image.is_same)
        cli_notice("%s has changed since the fit", image.path);
    snprintf(f->image_path, sizeof f->image_path, "%s", taken ? image.path : "");
}

sdm_status cli_page_fit_take(const char *name, char *text, size_t size, bool changed,
                             cli_page_fit *f, sdm_error *err)
{
    f->name = name;
    f->text = text;
    while (size && text[size - 1] == '\n') text[--size] = '\0';
    sdm_status s = sdm_json_parse(name, text, size, &f->json, err);
    if (s) return s;
    static const char *const members[] = {"image", "parameters", "pose", "unknowns", "covariance"};
    for (size_t i = 0; i < sizeof members / sizeof *members; i++)
        if (!sdm_json_member(&f->json, 0, members[i]))
            return sdm_fail(err, SDM_E_FORMAT,
                            "%s: no member \"%s\": it is no result of a fit (sdmgen fit ... -o "
                            "FIT.json)",
                            name, members[i]);
    if (!sdm_json_member(&f->json, 0, "model"))
        return sdm_fail(err, SDM_E_UNSUPPORTED,
                        "%s: a fit without a model (--shape) has no page: fit a MODEL", name);
    s = find_model(changed, f, err);
    if (!s) find_image(changed, f);
    return s;
}

/* ---- the estimate ---- */

/* out[n] = the numbers of the array at index i; false if it is none of this length. A null is NaN.
 */
static bool get_numbers(const sdm_json_document *d, size_t i, double *out, size_t n)
{
    if (!i || d->values[i].kind != '[') return false;
    size_t at = i + 1;
    for (size_t k = 0; k < n; k++, at = d->values[at].next) {
        if (at >= d->values[i].next) return false;
        if (!sdm_json_number(d, at, &out[k])) out[k] = NAN;
    }
    return at == d->values[i].next;
}

/* Reads the parameters of the model and the pose. */
static sdm_status get_estimate(const sdm_model_info *m, cli_page_fit *f, sdm_error *err)
{
    const sdm_json_document *d = &f->json;
    const size_t params = sdm_json_member(d, 0, "parameters"), pose = sdm_json_member(d, 0, "pose");
    sdm_status s = SDM_ALLOC(&f->params, m->n_params, "parameters", err);
    for (size_t i = 0; i < m->n_params && !s; i++) {
        const size_t at = sdm_json_member(d, params, m->params[i].name);
        if (!at || !sdm_json_number(d, at, &f->params[i]))
            s = sdm_fail(err, SDM_E_FORMAT,
                         "%s: no value of the model's parameter '%s': it is a fit of another model",
                         f->name, m->params[i].name);
    }
    if (!s && (!get_numbers(d, sdm_json_member(d, pose, "rotation_rad"), f->pose.rotation, 3) ||
               !get_numbers(d, sdm_json_member(d, pose, "translation_mm"), f->pose.translation, 3)))
        s = sdm_fail(err, SDM_E_FORMAT, "%s: the pose is not three and three numbers", f->name);
    return s ? s : sdm_pose_check(&f->pose, err);
}

/* ---- the standard deviation of the surface ---- */

/* cov[n][n] = the covariance of the unknowns in the JSON of the fit. *known = false if one of its
 * elements is null there, which is NaN in cov. */
static sdm_status get_covariance(const cli_page_fit *f, double *cov, size_t n, bool *known,
                                 sdm_error *err)
{
    const sdm_json_document *d = &f->json;
    const size_t rows = sdm_json_member(d, 0, "covariance");
    size_t at = rows + 1, k = 0;
    *known = true;
    for (; k < n && at < d->values[rows].next; k++, at = d->values[at].next)
        if (!get_numbers(d, at, cov + k * n, n)) break;
    if (k < n || at != d->values[rows].next)
        return sdm_fail(err, SDM_E_FORMAT, "%s: the covariance has not %zu rows of as many numbers",
                        f->name, n);
    for (size_t i = 0; i < n * n; i++) *known = *known && isfinite(cov[i]);
    return SDM_OK;
}

/* slope[6] = the derivative of the distance at x (frame of the shape), whose gradient there is
 * `normal`, by a small turn after the pose about the axes of the world, and by the translation. */
static void pose_slopes(const double r[9], const double x[3], const double normal[3],
                        double slope[6])
{
    double y[3], n[3];
    m3_apply(r, x, y);
    m3_apply(r, normal, n);
    slope[0] = n[1] * y[2] - n[2] * y[1];
    slope[1] = n[2] * y[0] - n[0] * y[2];
    slope[2] = n[0] * y[1] - n[1] * y[0];
    for (int a = 0; a < 3; a++) slope[3 + a] = -n[a];
}

/* f->sd = the standard deviation of the distance at each voxel, from its derivatives and the
 * covariance of the unknowns; to first order that of the place of the surface. */
static void spread(cli_page_fit *f, const sdm_grid *g, size_t n_params, const float *jacobian,
                   const double *cov, const float *gradient)
{
    const size_t count = sdm_grid_count(g), n = n_params + 6;
    double r[9], slope[UNKNOWNS_MAX];
    sdm_pose_matrix(&f->pose, r);
    for (size_t v = 0; v < count; v++) {
        const int64_t nx = g->n[0], ny = g->n[1], at = (int64_t)v;
        const double index[3] = {(double)(at % nx), (double)(at / nx % ny), (double)(at / nx / ny)};
        double x[3], variance = 0;
        const double normal[3] = {(double)gradient[v], (double)gradient[count + v],
                                  (double)gradient[2 * count + v]};
        sdm_grid_world(g, index, x);
        for (size_t i = 0; i < n_params; i++) slope[i] = (double)jacobian[i * count + v];
        pose_slopes(r, x, normal, slope + n_params);
        for (size_t i = 0; i < n; i++)
            for (size_t j = 0; j < n; j++) variance += slope[i] * cov[i * n + j] * slope[j];
        f->sd[v] = (float)sqrt(fmax(variance, 0));
    }
}

/* Computes f->map and f->sd. */
static sdm_status make_maps(const sdm_model *model, const sdm_instance *shape, cli_page_fit *f,
                            sdm_error *err)
{
    const sdm_model_info *m = sdm_model_get_info(model);
    const size_t count = sdm_grid_count(&m->grid), n = m->n_params + 6;
    const sdm_generate_opts opts = {.policy = shape ? SDM_RANGE_EXACT : SDM_RANGE_REFUSE,
                                    .exact_shape = shape};
    float *jacobian = NULL, *gradient = NULL;
    double *cov = NULL;
    bool known = false;
    sdm_status s = SDM_ALLOC(&f->map, count, "map", err);
    if (!s) s = SDM_ALLOC(&jacobian, m->n_params * count, "derivatives of the map", err);
    if (!s) s = SDM_ALLOC(&gradient, 3 * count, "gradient of the map", err);
    if (!s) s = SDM_ALLOC(&cov, n * n, "covariance", err);
    if (!s) s = get_covariance(f, cov, n, &known, err);
    if (!s) s = sdm_generate_jacobian(model, f->params, &opts, f->map, jacobian, NULL, err);
    if (!s) s = sdm_map_gradient(&m->grid, f->map, 0, gradient, err);
    if (!s && known && n <= UNKNOWNS_MAX) {
        s = SDM_ALLOC(&f->sd, count, "standard deviations", err);
        if (!s) spread(f, &m->grid, m->n_params, jacobian, cov, gradient);
    }
    sdm_free(cov);
    sdm_free(gradient);
    sdm_free(jacobian);
    return s;
}

/* ---- the image ---- */

/* The grid on which the page shows the image: that of the model, with voxels half as long if those
 * of the image are clearly smaller. */
static sdm_grid choose_grid(const sdm_grid *model, const sdm_grid *image)
{
    sdm_grid g = *model;
    // along any axis of the model: the pose turns the image
    const double finest = fmin(image->spacing[0], fmin(image->spacing[1], image->spacing[2]));
    for (int a = 0; a < 3; a++)
        if (finest < 0.75 * g.spacing[a] && g.n[a] > 1) {
            g.n[a] = 2 * g.n[a] - 1;
            g.spacing[a] /= 2;
        }
    return g;
}

/* The value below which this share of the n finite values between low and high lies. */
static double quantile(const float *values, size_t n, double low, double high, double share)
{
    enum { BINS = 1024 };
    size_t bins[BINS] = {0}, all = 0, sum = 0;
    for (size_t i = 0; i < n; i++) {
        if (!isfinite(values[i])) continue;
        bins[(size_t)fmin(fmax((values[i] - low) / (high - low) * BINS, 0), BINS - 1)]++;
        all++;
    }
    for (size_t b = 0; b < BINS; b++) {
        sum += bins[b];
        if ((double)sum >= share * (double)all) return low + (high - low) * (double)b / BINS;
    }
    return high;
}

/* Values to bytes: the darkest and the brightest hundredth are cut off. */
static void to_bytes(const float *values, size_t n, cli_page_fit *f)
{
    double low = INFINITY, high = -INFINITY;
    for (size_t i = 0; i < n; i++) {
        if (!isfinite(values[i])) continue;
        low = fmin(low, (double)values[i]);
        high = fmax(high, (double)values[i]);
    }
    if (!(high > low)) high = low + 1;
    f->low = quantile(values, n, low, high, 0.01);
    f->high = quantile(values, n, low, high, 0.99);
    if (!(f->high > f->low)) f->low = low, f->high = high; // labels
    for (size_t i = 0; i < n; i++) {
        const double share = ((double)values[i] - f->low) / (f->high - f->low);
        f->image[i] = (uint8_t)(share > 0 ? fmin(round(255 * share), 255) : 0);
    }
}

static sdm_status sample_image(const sdm_grid *model_grid, cli_page_fit *f, sdm_error *err)
{
    sdm_volume volume = {0};
    float *values = NULL;
    sdm_status s = sdm_volume_read(f->image_path, &volume, err);
    if (!s) {
        f->image_grid = choose_grid(model_grid, &volume.grid);
        s = SDM_ALLOC(&values, sdm_grid_count(&f->image_grid), "image", err);
    }
    if (!s) s = SDM_ALLOC(&f->image, sdm_grid_count(&f->image_grid), "image", err);
    if (!s) {
        const sdm_grid *g = &f->image_grid;
        float *out = values;
        for (int64_t k = 0; k < g->n[2]; k++)
            for (int64_t j = 0; j < g->n[1]; j++)
                for (int64_t i = 0; i < g->n[0]; i++) {
                    const double index[3] = {(double)i, (double)j, (double)k};
                    double x[3];
                    sdm_grid_world(g, index, x);
                    sdm_pose_apply(&f->pose, x, x);
                    *out++ = (float)cli_fit_interpolate(&volume.grid, volume.values, x);
                }
        to_bytes(values, sdm_grid_count(g), f);
    }
    sdm_free(values);
    sdm_volume_dispose(&volume);
    return s;
}

/* ---- bytes ---- */

/* Standard deviations beyond the largest one within this distance of the surface (voxels) are cut
 * off: they grow without limit away from it. */
#define SD_REACH 3

static sdm_status pack(const sdm_grid *g, cli_page_fit *f, sdm_error *err)
{
    const size_t count = sdm_grid_count(g), image = f->image ? sdm_grid_count(&f->image_grid) : 0;
    const double reach = SD_REACH * fmax(g->spacing[0], fmax(g->spacing[1], g->spacing[2]));
    double largest = 0, spread = 0;
    for (size_t i = 0; i < count; i++) {
        const double d = fabs((double)f->map[i]);
        largest = fmax(largest, d);
        if (f->sd && d < reach) spread = fmax(spread, (double)f->sd[i]);
    }
    f->map_step = largest > 0 ? largest / 32767 : 1;
    f->sd_step = spread / 255;
    f->size = 2 * count + (spread > 0 ? count : 0) + image;
    const sdm_status s = SDM_ALLOC(&f->bytes, f->size, "pictures of the page", err);
    if (s) return s;
    uint8_t *at = f->bytes;
    for (size_t i = 0; i < count; i++) {
        const uint16_t word = (uint16_t)(int16_t)round((double)f->map[i] / f->map_step);
        *at++ = (uint8_t)word;
        *at++ = (uint8_t)(word >> 8);
    }
    for (size_t i = 0; i < count && spread > 0; i++)
        *at++ = (uint8_t)fmin(round((double)f->sd[i] / f->sd_step), 255);
    if (image) memcpy(at, f->image, image);
    return SDM_OK;
}

sdm_status cli_page_fit_sample(const sdm_model *model, const sdm_instance *shape, cli_page_fit *f,
                               sdm_error *err)
{
    sdm_status s = get_estimate(sdm_model_get_info(model), f, err);
    if (!s) s = make_maps(model, shape, f, err);
    if (!s && *f->image_path && sdm_volume_knows(f->image_path))
        s = sample_image(&sdm_model_get_info(model)->grid, f, err);
    return s ? s : pack(&sdm_model_get_info(model)->grid, f, err);
}
