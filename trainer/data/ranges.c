/* Ranges and distributions of the parameters: those of the shape, changed by the configuration. */
#include <math.h>
#include <string.h>

#include "sdm/internal/distribution.h"
#include "sdm/internal/text.h"
#include "sdm/internal/train.h"

/* *index = the parameter of this name. SDM_E_CONFIG with the place `mark` and the most similar
 * name. */
static sdm_status find_param(const sdm_config *config, const sdm_instance *shape, const char *name,
                             sdm_mark mark, size_t *index, sdm_error *err)
{
    const int i = sdm_instance_param_index(shape, name);
    if (i >= 0) {
        *index = (size_t)i;
        return SDM_OK;
    }
    char where[1200];
    const char *names[SDM_MAX_PARAMS];
    size_t n;
    const sdm_param *params = sdm_instance_params(shape, &n);
    for (size_t k = 0; k < n && k < SDM_MAX_PARAMS; k++) names[k] = params[k].name;
    const char *near = sdm_nearest_name(name, names, n < SDM_MAX_PARAMS ? n : SDM_MAX_PARAMS);
    return sdm_fail(err, SDM_E_CONFIG, "%s: shape '%s' has no parameter '%s'%s%s%s",
                    sdm_config_where(config, mark, where), sdm_instance_shape(shape)->name, name,
                    near ? "; did you mean '" : "", near ? near : "", near ? "'?" : "");
}

sdm_status sdm_train_ranges(const sdm_config *config, const sdm_instance *shape, double *min,
                            double *max, sdm_error *err)
{
    size_t n;
    const sdm_param *params = sdm_instance_params(shape, &n);
    char where[1200];
    for (size_t i = 0; i < n; i++) min[i] = params[i].min, max[i] = params[i].max;
    for (size_t r = 0; r < config->shape.n_ranges; r++) {
        const sdm_config_range *range = &config->shape.ranges[r];
        size_t i = 0;
        const sdm_status s = find_param(config, shape, range->name, range->mark, &i, err);
        if (s) return s;
        // narrowing is allowed, widening is not
        if (!(range->min >= params[i].min && range->max <= params[i].max &&
              range->min < range->max))
            return sdm_fail(err, SDM_E_CONFIG,
                            "%s: range [%g, %g] of '%s' must lie within [%g, %g] of shape '%s'",
                            sdm_config_where(config, range->mark, where), range->min, range->max,
                            range->name, params[i].min, params[i].max,
                            sdm_instance_shape(shape)->name);
        min[i] = range->min, max[i] = range->max;
    }
    return SDM_OK;
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

sdm_status sdm_train_distributions(const sdm_config *config, const sdm_instance *shape,
                                   const double *min, const double *max, sdm_distribution *out,
                                   sdm_error *err)
{
    size_t n;
    const sdm_param *params = sdm_instance_params(shape, &n);
    const sdm_config_distribution *chosen[SDM_MAX_PARAMS];
    for (size_t i = 0; i < n; i++) chosen[i] = &config->shape.distribution;
    for (size_t k = 0; k < config->shape.n_distributions; k++) {
        const sdm_config_distribution *one = &config->shape.distributions[k];
        size_t i = 0;
        const sdm_status s = find_param(config, shape, one->name, one->mark, &i, err);
        if (s) return s;
        chosen[i] = one;
    }
    for (size_t i = 0; i < n; i++) {
        char where[1200];
        out[i] = choose(chosen[i], shape, i, min[i], max[i]);
        if (sdm_distribution_check(&out[i], min[i], max[i], err))
            return sdm_fail_in(
                err, SDM_E_CONFIG, "%s: distribution of '%s'",
                sdm_config_where(config, place_of(config, chosen[i], params[i].name), where),
                params[i].name);
    }
    return SDM_OK;
}
