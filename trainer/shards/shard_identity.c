/* All that decides the maps of a configuration, as text, and the names and sizes of shards. */
#include "shard_identity.h"

#include <stdio.h>

#include "option_texts.h"
#include "sdm/internal/train.h"
#include "sdm/memory.h"

static const char *const SETS[MAP_SETS] = {
    [MAP_HOLDOUT] = "holdout", [MAP_STATIC] = "static", [MAP_RANDOM] = "random"};

void trainer_shard_name(const shard_place *at, char name[SHARD_NAME_MAX])
{
    snprintf(name, SHARD_NAME_MAX, "%s-%08zu" SHARD_ENDING, SETS[at->set], at->first);
}

size_t trainer_shard_maps(const sdm_grid *grid)
{
    enum { MAPS = 128, BYTES = 1 << 24 };
    const size_t n = BYTES / sizeof(float) / sdm_grid_count(grid);
    return n > MAPS ? MAPS : n ? n : 1;
}

static void add_reals(sdm_text *out, const char *key, const double *v, size_t n)
{
    char buf[32];
    sdm_text_add(out, "%s=", key);
    for (size_t i = 0; i < n; i++)
        sdm_text_add(out, "%s%s", i ? " " : "", sdm_format_real(v[i], buf));
    sdm_text_add(out, "\n");
}

static void add_options(sdm_text *out, const sdm_instance *shape, option_texts *o)
{
    uint64_t sums[SDM_MAX_OPTIONS];
    trainer_option_sums(shape, sums);
    trainer_option_texts(shape, sums, NULL, o);
    // the content of a data file counts, not its place
    for (size_t i = 0; i < o->n; i++)
        if (!o->is_path[i]) sdm_text_add(out, "shape.options.%s=%s\n", o->names[i], o->values[i]);
}

static void add_params(sdm_text *out, const sdm_param *p, size_t n, const double *min,
                       const double *max, const sdm_distribution *d)
{
    char key[2 * SDM_NAME_MAX + 32];
    for (size_t i = 0; i < n; i++) {
        const double range[2] = {min[i], max[i]}, normal[2] = {d[i].mean, d[i].deviation};
        snprintf(key, sizeof key, "shape.ranges.%s", p[i].name);
        add_reals(out, key, range, 2);
        snprintf(key, sizeof key, "shape.distribution.%s", p[i].name);
        if (d[i].kind == SDM_DISTRIBUTION_NORMAL)
            add_reals(out, key, normal, 2);
        else
            sdm_text_add(out, "%s=uniform\n", key);
    }
}

sdm_status trainer_shard_identity(const sdm_config *c, const sdm_instance *shape, sdm_text *out,
                                  sdm_error *err)
{
    double min[SDM_MAX_PARAMS], max[SDM_MAX_PARAMS];
    sdm_distribution distribution[SDM_MAX_PARAMS];
    option_texts *options = NULL;
    size_t n;
    const sdm_param *params = sdm_instance_params(shape, &n);
    sdm_status s = sdm_train_ranges(c, shape, min, max, err);
    if (!s) s = sdm_train_distributions(c, shape, min, max, distribution, err);
    if (!s) s = SDM_ALLOC(&options, 1, "options", err);
    if (s) return s;
    sdm_text_add(out, "shape.name=%s\n", sdm_instance_shape(shape)->name);
    add_options(out, shape, options);
    sdm_free(options);
    add_params(out, params, n, min, max, distribution);
    const sdm_grid *g = &c->grid;
    sdm_text_add(out, "grid.size=%lld %lld %lld\n", (long long)g->n[0], (long long)g->n[1],
                 (long long)g->n[2]);
    add_reals(out, "grid.spacing", g->spacing, 3);
    add_reals(out, "grid.origin", g->origin, 3);
    add_reals(out, "grid.direction", g->dir, 9);
    sdm_text_add(out, "data.static=");
    for (size_t i = 0; i < n && sdm_config_static_count(c, n, 0); i++)
        sdm_text_add(out, "%s%lld", i ? " " : "", (long long)sdm_config_static_count(c, n, i));
    sdm_text_add(out, "\nseed=%llu\n", (unsigned long long)c->seed);
    return out->failed ? sdm_fail(err, SDM_E_NOMEM, "no memory for the description of the maps")
                       : SDM_OK;
}
