/* Statistical shape: a point-distribution model (Cootes, Taylor, Cooper and Graham 1995) from
 * files, where vertex = mean + sum over modes of weight * mode. The parameters m1, m2, ... are the
 * weights in standard deviations; their distribution is normal. Modes are in mm per standard
 * deviation; with the option `deviations` they have any length and are multiplied by the standard
 * deviations. The triangles are those of the mean mesh. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sdm/internal/ssm.h"
#include "sdm/shape.h"

enum { MEAN, MODES, DEVIATIONS, COUNT, LIMIT, MODEL, N_OPTIONS };

#define MODES_MAX 64

static const sdm_option OPTIONS[N_OPTIONS] = {
    [MEAN] = {"mean", SDM_OPTION_FILE, "mm", 0, 0, 0, NULL,
              "the mean mesh (.ply .stl .obj .off .vtk .vtp)"},
    [MODES] = {"modes", SDM_OPTION_FILE, "mm", 0, 0, 0, NULL,
               "the modes (.npy), [modes][vertices][3] or [modes][3 vertices]"},
    [DEVIATIONS] = {"deviations", SDM_OPTION_FILE, "", 0, 0, 0, NULL,
                    "standard deviations (.npy), [modes], multiplied into the modes; none: modes "
                    "are in mm per "
                    "standard deviation"},
    [COUNT] = {"count", SDM_OPTION_INT, "", 0, MODES_MAX, 0, NULL,
               "how many of the modes are used; 0: all"},
    [LIMIT] = {"limit", SDM_OPTION_REAL, "sd", 0.01, 10, 3, NULL,
               "range of every weight: -limit .. limit"},
    [MODEL] = {"model", SDM_OPTION_FILE, "", 0, 0, 0, NULL,
               "a whole model (.ssm, from `sdmgen import ssm`) in place of mean, modes and "
               "deviations"},
};

typedef struct model {
    size_t n_vert, n_tri, n_modes;
    double *mean;  /* [n_vert][3] */
    double *modes; /* [n_modes][n_vert][3], mm per standard deviation */
    uint32_t *tri; /* [n_tri][3] */
    sdm_param params[MODES_MAX];
    char names[MODES_MAX][8];
    char helps[MODES_MAX][48];
} model;

static void statistical_destroy(void *self)
{
    model *m = self;
    free(m->mean);
    free(m->modes);
    free(m->tri);
    free(m);
}

/* The array of a .npy file. */
typedef struct array {
    const char *path;
    const double *values;
    size_t shape[4];
    int n_dim;
} array;

static int file_fail(const sdm_host *host, const char *path, const char *what)
{
    char text[2400];
    snprintf(text, sizeof text, "%.1000s: %s", path, what);
    return host->fail(host, text);
}

static int array_read(const sdm_host *host, array *a)
{
    const int failed = host->read_npy(host, a->path, &a->values, a->shape, &a->n_dim);
    if (failed) return failed;
    size_t count = 1;
    for (int k = 0; k < a->n_dim; k++) count *= a->shape[k];
    for (size_t i = 0; i < count; i++)
        if (!isfinite(a->values[i])) {
            char what[96];
            snprintf(what, sizeof what, "number %zu is not finite", i);
            return file_fail(host, a->path, what);
        }
    return 0;
}

/* Checks that the array is [modes][vertices][3] or [modes][3 vertices] and fits the mean mesh. */
static int modes_check(const sdm_host *host, const array *modes, const char *mean_path,
                       size_t n_vert)
{
    char what[1300];
    if (modes->n_dim != 2 && !(modes->n_dim == 3 && modes->shape[2] == 3)) {
        snprintf(what, sizeof what,
                 "has %d dimensions, need [modes][vertices][3] or [modes][3 vertices]",
                 modes->n_dim);
        return file_fail(host, modes->path, what);
    }
    const size_t numbers = modes->n_dim == 3 ? 3 * modes->shape[1] : modes->shape[1];
    if (numbers % 3) {
        snprintf(what, sizeof what, "has %zu numbers a mode, need a multiple of 3", numbers);
        return file_fail(host, modes->path, what);
    }
    if (numbers / 3 != n_vert) {
        snprintf(what, sizeof what, "has modes of %zu vertices, but the mean %.900s has %zu",
                 numbers / 3, mean_path, n_vert);
        return file_fail(host, modes->path, what);
    }
    if (modes->shape[0] == 0) return file_fail(host, modes->path, "has no mode");
    return 0;
}

static int deviations_check(const sdm_host *host, const array *deviations, const array *modes)
{
    char what[1300];
    if (deviations->n_dim != 1 || deviations->shape[0] != modes->shape[0]) {
        snprintf(what, sizeof what,
                 "has %zu numbers in %d dimensions, need one for each of the %zu modes of %.900s",
                 deviations->shape[0], deviations->n_dim, modes->shape[0], modes->path);
        return file_fail(host, deviations->path, what);
    }
    for (size_t i = 0; i < deviations->shape[0]; i++)
        if (!(deviations->values[i] > 0)) {
            snprintf(what, sizeof what, "standard deviation %zu is %g, need > 0", i,
                     deviations->values[i]);
            return file_fail(host, deviations->path, what);
        }
    return 0;
}

/* Number of modes to use, or 0 after an error. */
static size_t modes_count(const sdm_host *host, const array *modes, double asked)
{
    const size_t n = asked > 0 ? (size_t)asked : modes->shape[0];
    char what[128];
    if (n > modes->shape[0])
        snprintf(what, sizeof what, "has %zu modes, count = %zu asks for more", modes->shape[0], n);
    else if (n > MODES_MAX)
        snprintf(what, sizeof what, "has %zu modes, at most %d can be used: set count",
                 modes->shape[0], MODES_MAX);
    else
        return n;
    file_fail(host, modes->path, what);
    return 0;
}

static void *array_copy(const void *from, size_t count, size_t size)
{
    void *to = count ? calloc(count, size) : NULL;
    if (to) memcpy(to, from, count * size);
    return to;
}

static int model_build(const sdm_host *host, const sdm_mesh_out *mean, const array *modes,
                       const array *deviations, size_t n_modes, double limit, model **out)
{
    model *m = calloc(1, sizeof *m);
    if (!m) return host->fail(host, "out of memory");
    m->n_vert = mean->n_vert, m->n_tri = mean->n_tri, m->n_modes = n_modes;
    m->mean = array_copy(mean->vert, 3 * m->n_vert, sizeof *m->mean);
    m->tri = array_copy(mean->tri, 3 * m->n_tri, sizeof *m->tri);
    m->modes = array_copy(modes->values, n_modes * 3 * m->n_vert, sizeof *m->modes);
    if (!m->mean || !m->tri || !m->modes) {
        statistical_destroy(m);
        return host->fail(host, "out of memory");
    }
    for (size_t i = 0; i < n_modes; i++) {
        const double scale = deviations->values ? deviations->values[i] : 1;
        for (size_t k = 0; k < 3 * m->n_vert; k++) m->modes[3 * m->n_vert * i + k] *= scale;
        snprintf(m->names[i], sizeof m->names[i], "m%d", (int)i + 1);
        snprintf(m->helps[i], sizeof m->helps[i], "weight of mode %d", (int)i + 1);
        m->params[i] = (sdm_param){m->names[i], "sd", -limit, limit, 0, m->helps[i]};
    }
    *out = m;
    return 0;
}

/* The model of an .ssm file. */
static int create_from_model(const sdm_host *host, const sdm_option_value *options, void **self)
{
    const char *path = options[MODEL].text;
    if (options[MEAN].text[0] || options[MODES].text[0] || options[DEVIATIONS].text[0])
        return host->fail(host, "option 'model' excludes 'mean', 'modes' and 'deviations'");
    const unsigned char *bytes;
    size_t size;
    sdm_ssm ssm;
    sdm_error err = {0};
    int failed = host->read_file(host, path, &bytes, &size);
    if (failed) return failed;
    if (sdm_ssm_parse(path, bytes, size, &ssm, &err)) return host->fail(host, err.text);
    const sdm_mesh_out mean = {ssm.mean, ssm.tri, ssm.n_vert, ssm.n_tri};
    const array modes = {path, ssm.modes, {ssm.n_modes, ssm.n_vert, 3}, 3}, none = {.path = path};
    const size_t n_modes = modes_count(host, &modes, options[COUNT].number);
    model *m = NULL;
    failed = n_modes == 0
                 ? 1
                 : model_build(host, &mean, &modes, &none, n_modes, options[LIMIT].number, &m);
    sdm_ssm_dispose(&ssm);
    *self = m;
    return failed;
}

static int statistical_create(const sdm_host *host, const sdm_option_value *options, void **self)
{
    if (options[MODEL].text[0]) return create_from_model(host, options, self);
    if (!options[MEAN].text[0])
        return host->fail(host, "option 'mean' is missing: the file of the mean mesh (or 'model')");
    if (!options[MODES].text[0])
        return host->fail(host, "option 'modes' is missing: the .npy file of the modes");
    array modes = {.path = options[MODES].text}, deviations = {.path = options[DEVIATIONS].text};
    sdm_mesh_out mean = {0};
    int failed = host->read_mesh(host, options[MEAN].text, &mean);
    if (!failed && (mean.n_vert == 0 || mean.n_tri == 0))
        failed = file_fail(host, options[MEAN].text, "has no triangle");
    if (!failed) failed = array_read(host, &modes);
    if (!failed) failed = modes_check(host, &modes, options[MEAN].text, mean.n_vert);
    if (!failed && deviations.path[0]) failed = array_read(host, &deviations);
    if (!failed && deviations.path[0]) failed = deviations_check(host, &deviations, &modes);
    if (failed) return failed;
    const size_t n_modes = modes_count(host, &modes, options[COUNT].number);
    if (n_modes == 0) return 1;
    model *m = NULL;
    failed = model_build(host, &mean, &modes, &deviations, n_modes, options[LIMIT].number, &m);
    *self = m;
    return failed;
}

static void statistical_describe(const void *self, const sdm_param **params, uint32_t *n_params)
{
    const model *m = self;
    *params = m->params;
    *n_params = (uint32_t)m->n_modes;
}

static int statistical_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                            const double *p, sdm_mesh_out *out)
{
    (void)options;
    const model *m = self;
    const int failed = host->reserve(host, out, m->n_vert, m->n_tri);
    if (failed) return failed;
    const size_t n = 3 * m->n_vert;
    memcpy(out->vert, m->mean, n * sizeof *out->vert);
    memcpy(out->tri, m->tri, 3 * m->n_tri * sizeof *out->tri);
    for (size_t i = 0; i < m->n_modes; i++)
        for (size_t k = 0; k < n; k++) out->vert[k] += p[i] * m->modes[n * i + k];
    return 0;
}

static int statistical_velocity(const void *self, const sdm_host *host,
                                const sdm_option_value *options, const double *p, size_t n_vert,
                                double *out)
{
    (void)options, (void)p;
    const model *m = self;
    if (n_vert != m->n_vert)
        return host->fail(host, "velocity: n_vert is not the number of vertices of the mesh");
    memcpy(out, m->modes, m->n_modes * 3 * n_vert * sizeof *out);
    return 0;
}

static void statistical_distributions(const void *self, sdm_distribution *out)
{
    const model *m = self;
    for (size_t i = 0; i < m->n_modes; i++)
        out[i] = (sdm_distribution){SDM_DISTRIBUTION_NORMAL, 0, 1};
}

const sdm_shape sdm_shape_statistical = {
    .abi = SDM_SHAPE_ABI,
    .size = sizeof(sdm_shape),
    .name = "statistical",
    .summary = "point-distribution model from files: mean mesh and modes, parameters m1, m2 ... in "
               "standard deviations",
    .options = OPTIONS,
    .n_options = N_OPTIONS,
    .create = statistical_create,
    .destroy = statistical_destroy,
    .describe = statistical_describe,
    .mesh = statistical_mesh,
    .velocity = statistical_velocity,
    .distributions = statistical_distributions,
};
