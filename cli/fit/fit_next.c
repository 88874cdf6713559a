/* The command that goes on from a fit: with finer or exact maps, with more iterations, or with
 * known values. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "args/shell_word.h"
#include "fit_command.h"
#include "report/terminal.h"
#include "sdm/internal/hardly_known.h"

/* Options that say where a fit starts, how much it prints, or which maps it takes: the command has
 * its own. */
static const char *const STARTS[] = {
    "param", "rotation",     "translation", "start-centre",   "start-axis",
    "turns", "start-points", "find",        "turns-sphere",   "candidates",
    "json",  "force",        "quiet",       "max-iterations", "returnparameterfile"};
static const char *const MAPS[] = {"exact", "polish", "spacing"};

static bool is_left_out(const char *name, bool same_maps)
{
    for (size_t i = 0; i < sizeof STARTS / sizeof *STARTS; i++)
        if (!strcmp(name, STARTS[i])) return true;
    for (size_t i = 0; i < sizeof MAPS / sizeof *MAPS && !same_maps; i++)
        if (!strcmp(name, MAPS[i])) return true;
    return false;
}

/* Appends --name=value; a value may begin with a minus. */
static void add_option(sdm_text *t, const char *name, const char *value)
{
    sdm_text_add(t, " --%s=", name);
    cli_add_shell_word(t, value);
}

static void add_three(sdm_text *t, const char *name, const double x[3])
{
    char text[96];
    snprintf(text, sizeof text, "%.7g,%.7g,%.7g", x[0], x[1], x[2]);
    add_option(t, name, text);
}

/* What samples and verdict take, as voxels of maps: they hardly take longer with finer maps. */
#define OTHER_WORK 5e5
/* The time that is named is so many times the estimate: seven fits with 5 to 139 times as many
 * voxels took 0.28 to 0.7 of the time that is named. */
#define TIME_RESERVE 2

/* text[size] = what the finer maps cost, and why the fit did not go on with them by itself. */
static void write_price(const cli_fit *f, char *text, size_t size)
{
    const sdm_fit_result *r = &f->result;
    const double factor = pow(cli_fit_map_voxel(f) / cli_fit_finer_voxel(f), 3),
                 voxels = (double)sdm_grid_count(f->source.model
                                                     ? &sdm_model_get_info(f->source.model)->grid
                                                     : &f->source.grid),
                 most = TIME_RESERVE * (OTHER_WORK + factor * voxels) / (OTHER_WORK + voxels) *
                        (r->seconds - r->seconds_search);
    char times[32], time[32], why[120] = "";
    if (f->too_many > 0)
        snprintf(why, sizeof why,
                 ", %.2g million in all (more than the %.2g million that a fit takes by itself)",
                 f->too_many / 1e6, f->many_at_most / 1e6);
    snprintf(text, size,
             "; %s times as many voxels%s, up to %s %s if the machine is as busy as in this fit",
             cli_number(factor, 2, times), why, cli_number(most < 100 ? most : most / 60, 2, time),
             most < 100 ? "s" : "minutes");
}

void cli_fit_print_next(const cli_fit *f)
{
    const cli_args *a = f->args;
    const sdm_fit_result *r = &f->result;
    const bool voxels = isfinite(cli_fit_finer_voxel(f));
    // --exact and --polish need the exact shape
    const bool more = cli_fit_is_unfinished(f),
               refused = f->doubt.status && (!cli_fit_voxels_refuse(f) || cli_fit_shows_other(f)),
               exact = !f->source.model || f->shape || f->judge_shape;
    if ((!exact && !more) || (refused && !more) || f->other_side || f->n_candidates ||
        a->cohort.cases ||
        (!voxels && !more &&
         !cli_fit_found(f, SDM_FIT_CHECK_NETWORK_ERROR, SDM_FIT_DOUBTFUL, -INFINITY)))
        return;
    // maps that are too coarse may be why the usual number of iterations did not end the fit
    const size_t iterations = 4 * f->opts.max_iterations, usual = sdm_fit_defaults().max_iterations;
    const bool lacks = cli_fit_lacks_data(f), finer = more && !lacks && !f->source.model &&
                                                      f->opts.max_iterations >= usual &&
                                                      isfinite(r->advised_voxel_mm);
    // the same iterations would go to and fro, too
    if (more && !lacks && !finer && cli_fit_swings(f)) return;
    sdm_text t = {0};
    char text[96], price[240] = "";
    sdm_text_add(&t, "sdmgen fit");
    for (size_t i = 0; i < a->files.n; i++) cli_add_next_word(&t, a->files.items[i]);
    for (size_t i = 0; i < a->n_given; i++) {
        const cli_option *o = a->given[i].option;
        if (is_left_out(o->name, more && !finer && !r->polished)) continue;
        if (o->kind == CLI_FLAG) {
            sdm_text_add(&t, " --%s", o->name);
        } else {
            add_option(&t, o->name, a->given[i].value);
        }
    }
    // a polish is over that ran out of iterations: exact maps from its end go on
    if (f->model_path && (!more || r->polished))
        sdm_text_add(&t, voxels || more ? " --exact" : " --polish");
    if (more && !lacks)
        sdm_text_add(&t, " --max-iterations=%zu", iterations > usual ? iterations : usual);
    if ((voxels && !more) || finer) {
        snprintf(text, sizeof text, "%.2g", finer ? r->advised_voxel_mm : cli_fit_finer_voxel(f));
        add_option(&t, "spacing", text);
    }
    if (voxels && !more) write_price(f, price, sizeof price);
    for (size_t i = 0; i < f->n_params; i++) {
        if (lacks && sdm_fit_hardly_known(r, i)) {
            add_option(&t, "keep", f->params[i].name);
            snprintf(text, sizeof text, "%.60s=VALUE", f->params[i].name);
        } else {
            snprintf(text, sizeof text, "%.60s=%.7g", f->params[i].name, r->params[i]);
        }
        sdm_text_add(&t, " -p");
        cli_add_next_word(&t, text);
    }
    add_three(&t, "rotation", r->pose.rotation);
    add_three(&t, "translation", r->pose.translation);
    if (!t.failed)
        printf("%s from here%s%s:\n  %s\n",
               lacks    ? "known values in place of VALUE, for what the data hardly determine,"
               : finer  ? "more iterations with finer maps"
               : more   ? "more iterations"
               : voxels ? "finer maps"
                        : "a polish with exact maps",
               voxels && !more && !isfinite(r->advised_voxel_mm)
                   ? " (the present ones are nearly too coarse, which may explain the doubt)"
                   : "",
               voxels && !more ? price : "", t.data);
    sdm_text_dispose(&t);
}
