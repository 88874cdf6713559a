/* Ranges and distributions of the parameters: those of the shape, changed by the configuration. */
#include <math.h>
#include <string.h>

#include "sdm/internal/distribution.h"
#include "sdm/internal/text.h"
#include "sdm/internal/train.h"

/* *index = the parameter of this name; false, with a mistake at `mark`: there is none. */
static bool find_param(const sdm_instance *shape, const char *name, sdm_mark mark, size_t *index,
                       sdm_mistakes *m)
{
    const int i = sdm_instance_param_index(shape, name);
    *index = i < 0 ? 0 : (size_t)i;
    if (i >= 0) return true;
    const char *names[SDM_MAX_PARAMS];
    char list[200];
    size_t n;
    const sdm_param *params = sdm_instance_params(shape, &n);
    if (n > SDM_MAX_PARAMS) n = SDM_MAX_PARAMS;
    for (size_t k = 0; k < n; k++) names[k] = params[k].name;
    const char *near = sdm_nearest_name(name, names, n);
    sdm_mistakes_add(m, mark, "shape '%s' has no parameter '%s'; %s%s%s",
                     sdm_instance_shape(shape)->name, name,
                     near ? "did you mean '" : "its parameters are ",
                     near ? near : sdm_list_names(names, n, list, sizeof list), near ? "'?" : "");
    return false;
}

/* As sdm_train_ranges(), but adds mistakes to *m. */
static void find_ranges(const sdm_config *config, const sdm_instance *shape, double *min,
                        double *max, sdm_mistakes *m)
{
    size_t n;
    const sdm_param *params = sdm_instance_params(shape, &n);
    for (size_t i = 0; i < n; i++) min[i] = params[i].min, max[i] = params[i].max;
    for (size_t r = 0; r < config->shape.n_ranges; r++) {
        const sdm_config_range *range = &config->shape.ranges[r];
        size_t i = 0;
        if (!find_param(shape, range->name, range->mark, &i, m)) continue;
        // narrowing is allowed, widening is not
        if (range->min >= params[i].min && range->max <= params[i].max && range->min < range->max)
            min[i] = range->min, max[i] = range->max;
        else
            sdm_mistakes_add(m, range->mark,
                             "range [%g, %g] of '%s' must lie within [%g, %g] of shape '%s'",
                             range->min, range->max, range->name, params[i].min, params[i].max,
                             sdm_instance_shape(shape)->name);
    }
}

sdm_status sdm_train_ranges(const sdm_config *config, const sdm_instance *shape, double *min,
                            double *max, sdm_error *err)
{
    sdm_mistakes m = {.file = config->file};
    find_ranges(config, shape, min, max, &m);
    return sdm_mistakes_report(&m, err);
}

/* The distribution that the configuration chooses for parameter i on its range. */
static sdm_distribution choose(const sdm_config_distribution *c, const sdm_instance *shape,
                               size_t i, double min, double max)
{
    const sdm_distribution stated = sdm_instance_distributions(shape)[i];
    const double def = sdm_instance_params(shape, NULL)[i].def;
    switch (c->choice) {
    case SDM_DISTRIBUTION_SET_UNIFORM:
        return (sdm_distribution){SDM_DISTRIBUTION_UNIFORM, 0, 0};
    case SDM_DISTRIBUTION_FIGURES:
        return (sdm_distribution){SDM_DISTRIBUTION_NORMAL, c->mean, c->deviation};
    case SDM_DISTRIBUTION_SET_NORMAL:
        if (stated.kind == SDM_DISTRIBUTION_NORMAL) break;
        return (sdm_distribution){SDM_DISTRIBUTION_NORMAL, fmin(fmax(def, min), max),
                                  0.25 * (max - min)};
    case SDM_DISTRIBUTION_OF_SHAPE:
        break;
    }
    return stated;
}

/* Place of the key that sets the distribution or, if the shape does, the range of parameter
 * `name`. */
static sdm_mark place_of(const sdm_config *config, const sdm_config_distribution *c,
                         const char *name)
{
    if (c->choice != SDM_DISTRIBUTION_OF_SHAPE) return c->mark;
    for (size_t r = 0; r < config->shape.n_ranges; r++)
        if (!strcmp(config->shape.ranges[r].name, name)) return config->shape.ranges[r].mark;
    return config->shape.mark;
}

/* As sdm_train_distributions(), but adds mistakes to *m. */
static void find_distributions(const sdm_config *config, const sdm_instance *shape,
                               const double *min, const double *max, sdm_distribution *out,
                               sdm_mistakes *m)
{
    size_t n;
    const sdm_param *params = sdm_instance_params(shape, &n);
    const sdm_config_distribution *chosen[SDM_MAX_PARAMS];
    for (size_t i = 0; i < n; i++) chosen[i] = &config->shape.distribution;
    for (size_t k = 0; k < config->shape.n_distributions; k++) {
        const sdm_config_distribution *one = &config->shape.distributions[k];
        size_t i = 0;
        if (find_param(shape, one->name, one->mark, &i, m)) chosen[i] = one;
    }
    for (size_t i = 0; i < n; i++) {
        sdm_error why = {0};
        out[i] = choose(chosen[i], shape, i, min[i], max[i]);
        if (sdm_distribution_check(&out[i], min[i], max[i], &why))
            sdm_mistakes_add(m, place_of(config, chosen[i], params[i].name),
                             "distribution of '%s': %s", params[i].name, why.text);
    }
}

sdm_status sdm_train_distributions(const sdm_config *config, const sdm_instance *shape,
                                   const double *min, const double *max, sdm_distribution *out,
                                   sdm_error *err)
{
    sdm_mistakes m = {.file = config->file};
    find_distributions(config, shape, min, max, out, &m);
    return sdm_mistakes_report(&m, err);
}

void sdm_train_find_mistakes(const sdm_config *config, const sdm_instance *shape, sdm_mistakes *m)
{
    double min[SDM_MAX_PARAMS], max[SDM_MAX_PARAMS];
    sdm_distribution distribution[SDM_MAX_PARAMS];
    size_t n;
    sdm_instance_params(shape, &n);
    if (n > SDM_MAX_PARAMS) {
        sdm_mistakes_add(m, config->shape.mark,
                         "shape '%s' has %zu parameters, at most %d can be trained",
                         config->shape.name, n, SDM_MAX_PARAMS);
        return;
    }
    find_ranges(config, shape, min, max, m);
    find_distributions(config, shape, min, max, distribution, m);
}
