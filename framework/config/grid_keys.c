/* The grid of a configuration: complete, or to be fitted to the shapes. */
#include "grid_keys.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

typedef enum grid_key { SIZE = 0, SPACING, ORIGIN, CENTRE, VOXELS, N_KEYS } grid_key;

static const char *const KEYS[N_KEYS] = {"size", "spacing", "origin", "centre", "voxels"};

static void keys_given(sdm_reader *r, sdm_given *given[N_KEYS])
{
    for (int k = 0; k < N_KEYS; k++) given[k] = sdm_fields_given(r, "grid", KEYS[k]);
}

void sdm_config_grid_auto(sdm_reader *r, sdm_mark mark)
{
    sdm_given *given[N_KEYS];
    (void)mark;
    keys_given(r, given);
    for (int k = 0; k < VOXELS; k++) *given[k] = (sdm_given){0};
}

void sdm_config_settle_grid(sdm_reader *r, int override)
{
    // row: these keys, when given, replace those
    static const struct {
        unsigned by, replaced;
    } RULES[] = {{1 << ORIGIN, 1 << CENTRE | 1 << VOXELS},
                 {1 << CENTRE, 1 << ORIGIN | 1 << VOXELS},
                 {1 << SIZE | 1 << SPACING, 1 << VOXELS},
                 {1 << VOXELS, 1 << SIZE | 1 << SPACING | 1 << ORIGIN | 1 << CENTRE}};
    sdm_given *given[N_KEYS];
    keys_given(r, given);
    for (size_t i = 0; i < sizeof RULES / sizeof RULES[0]; i++) {
        bool replaces = false;
        for (int k = 0; k < N_KEYS; k++)
            replaces |= (RULES[i].by >> k & 1) && sdm_given_by(given[k], override);
        for (int k = 0; k < N_KEYS && replaces; k++)
            if ((RULES[i].replaced >> k & 1) && given[k]->mark.override != override)
                *given[k] = (sdm_given){0};
    }
}

/* Records a mistake unless the keys given, bit k of `has` for key k, may stand together. */
static bool check_keys(sdm_reader *r, sdm_given *given[N_KEYS], unsigned has, sdm_mark section)
{
    const unsigned complete = 1 << SIZE | 1 << SPACING;
    if (has == 0 || has == 1 << SPACING || has == 1 << VOXELS) return true;
    if ((has & complete) == complete && !(has & 1 << VOXELS)) return true;
    if (sdm_fields_unknown(r, "grid")) return false;
    char list[80] = "";
    sdm_mark last = section;
    for (int k = 0; k < N_KEYS; k++) {
        if (!(has >> k & 1)) continue;
        const size_t used = strlen(list);
        snprintf(list + used, sizeof list - used, "%s%s", used ? ", " : "", KEYS[k]);
        if (sdm_mark_is_later(given[k]->mark, last)) last = given[k]->mark;
    }
    sdm_mistakes_add(r->mistakes, last,
                     "grid: %s do%s not determine a grid; give size and spacing, and origin or "
                     "centre if you like; or spacing, or voxels, or nothing (grid: auto) for a "
                     "grid that is fitted to the shapes",
                     list, strchr(list, ',') ? "" : "es");
    return false;
}

/* The defaults of lengths that follow from the spacing. */
static void derive_lengths(sdm_config *c)
{
    const double *h = c->grid.spacing, smallest = fmin(h[0], fmin(h[1], h[2]));
    if (c->train.near_mm == 0) c->train.near_mm = 2 * smallest;
    if (c->train.clamp_mm == 0) c->train.clamp_mm = 0.5 * smallest;
}

void sdm_config_set_grid(sdm_config *c, const sdm_grid *grid)
{
    c->grid = *grid;
    c->grid_voxels = 0;
    c->grid_auto = c->grid_fitted = false;
    derive_lengths(c);
}

void sdm_config_finish_grid(sdm_reader *r, sdm_mark section)
{
    sdm_config *c = r->config;
    sdm_grid *g = &c->grid;
    sdm_given *given[N_KEYS];
    unsigned has = 0;
    keys_given(r, given);
    for (int k = 0; k < N_KEYS; k++) has |= (unsigned)sdm_mark_is_set(given[k]->mark) << k;
    if (has >> ORIGIN & has >> CENTRE & 1)
        sdm_mistakes_add(r->mistakes,
                         sdm_mark_is_later(given[ORIGIN]->mark, given[CENTRE]->mark)
                             ? given[ORIGIN]->mark
                             : given[CENTRE]->mark,
                         "only one of grid.origin and grid.centre may be given");
    const bool fits = check_keys(r, given, has, section);
    for (int i = 0; i < 9; i++) g->dir[i] = i % 4 == 0;
    for (int i = 0; i < 3; i++) { // values of before that were replaced
        if (!(has >> SIZE & 1)) g->n[i] = 0;
        if (!(has >> SPACING & 1)) g->spacing[i] = 0;
        if (!(has >> ORIGIN & 1) || !(has >> SIZE & 1)) g->origin[i] = 0;
    }
    if (!fits) return;
    c->grid_auto = !has;
    if (!(has >> VOXELS & 1)) c->grid_voxels = has ? 0 : SDM_GRID_VOXELS;
    if (!(has >> SIZE & 1)) return;
    for (int i = 0; i < 3 && !(has >> ORIGIN & 1); i++)
        g->origin[i] =
            (has >> CENTRE & 1 ? r->centre[i] : 0) - 0.5 * (double)(g->n[i] - 1) * g->spacing[i];

    // size or spacing is still 0 if it was refused
    sdm_error err;
    if (g->n[0] == 0 || !(g->spacing[0] > 0)) return;
    derive_lengths(c);
    if (sdm_grid_check(g, &err))
        sdm_mistakes_add(r->mistakes, given[SIZE]->mark, "grid.size: %.200s", err.text);
}
