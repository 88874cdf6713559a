/* Grids and parameters as JSON (sdm/internal/json_describe.h). */
#include "sdm/internal/json_describe.h"

void sdm_json_reals(sdm_json *j, const char *key, const double *v, size_t n)
{
    sdm_json_open(j, key, '[');
    for (size_t i = 0; i < n; i++) sdm_json_real(j, NULL, v[i]);
    sdm_json_close(j, ']');
}

void sdm_json_grid(sdm_json *j, const char *key, const sdm_grid *g, bool with_direction)
{
    sdm_json_open(j, key, '{');
    sdm_json_open(j, "size", '[');
    for (int i = 0; i < 3; i++) sdm_json_int(j, NULL, g->n[i]);
    sdm_json_close(j, ']');
    sdm_json_reals(j, "spacing", g->spacing, 3);
    sdm_json_reals(j, "origin", g->origin, 3);
    if (with_direction) sdm_json_reals(j, "direction", g->dir, 9);
    sdm_json_close(j, '}');
}

void sdm_json_parameter(sdm_json *j, const char *name, const char *unit, double min, double max,
                        double def)
{
    sdm_json_text(j, "name", name);
    sdm_json_text(j, "unit", unit);
    sdm_json_real(j, "min", min);
    sdm_json_real(j, "max", max);
    sdm_json_real(j, "default", def);
}

void sdm_json_distribution(sdm_json *j, const sdm_distribution *d)
{
    const bool normal = d->kind == SDM_DISTRIBUTION_NORMAL;
    sdm_json_text(j, "distribution", normal ? "normal" : "uniform");
    if (!normal) return;
    sdm_json_real(j, "mean", d->mean);
    sdm_json_real(j, "deviation", d->deviation);
}
