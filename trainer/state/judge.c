/* Measures the parts of the error at the end of a run, finds the largest, and says which key of the
   configuration makes it smaller. */
#include "judge.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "data/surface_check.h"
#include "forecast.h"
#include "history.h"
#include "progress.h"
#include "sdm/internal/shape_box.h"

/* If the last third of the steps took away more of the error than this, more steps help. */
static const double STILL_FALLING = 0.1;

/* With fewer steps than this no network has converged, whether the error still falls or not. */
static const double FEW_STEPS = 500;

/* With a higher learning rate than this, ten times the largest default, steps undo each other; the
   default of most kinds of network. */
static const double RATE_HIGH = 0.03, RATE_USUAL = 3e-3;

/* The grid limits the surface if interpolation between its voxels errs by this multiple of the
   error of the model, and by more than this fraction of a voxel: only then does a finer grid, of
   eight times as many voxels, take away most of the error of the surface. */
static const double GRID_SHARE = 2, GRID_ERROR = 0.05;

/* true: most maps for which the time was enough are those of the static grid. */
static bool grid_took_time(const verdict_input *in) { return in->cut && 2 * in->fixed > in->maps; }

/* Sets the key to change and its values. */
static void advise(sdm_verdict *v, const char *key, double from, double to)
{
    snprintf(v->key, sizeof v->key, "%s", key);
    v->from = from, v->to = to;
}

/* Doubles the key unless it would exceed `most`. Returns whether it could. */
static bool advise_double(sdm_verdict *v, const char *key, double value, double most)
{
    if (2 * value > most) return false;
    advise(v, key, value, 2 * value);
    return true;
}

/* Twice the budget of the run; four times the minutes that did not reach the first step. */
static void advise_budget(const verdict_input *in, sdm_verdict *v)
{
    const sdm_config *c = in->config;
    if (c->train.minutes > 0)
        advise(v, "train.minutes", in->budget,
               fmax((in->steps > 0 ? 2 : 4) * in->budget, in->minutes_asked));
    else
        advise(v, c->train.steps > 0 ? "train.steps" : "train.samples", in->budget, 2 * in->budget);
}

static bool has_bases(const sdm_config *c)
{
    return c->network.kind == SDM_NETWORK_POD || c->network.kind == SDM_NETWORK_TEMPLATE;
}

/* The largest smaller static grid with at most a third of the maps of the run; 0: none. */
static const char *advise_static(const verdict_input *in, sdm_verdict *v)
{
    const sdm_config *c = in->config;
    int64_t most = c->data.static_counts[0];
    for (size_t i = 1; i < c->data.n_static_counts; i++)
        if (c->data.static_counts[i] > most) most = c->data.static_counts[i];
    int64_t fewer = most - 1;
    while (fewer > 1 && pow((double)fewer, in->n_params) > in->maps / 3) fewer--;
    advise(v, "data.static", (double)most, fewer > 1 ? (double)fewer : 0);
    return in->steps < FEW_STEPS ? "The static grid took most of the time for maps, so that the "
                                   "training made fewer than 500 steps. This limits the model"
                                 : "The static grid took most of the time for maps. This limits "
                                   "the model";
}

/* The network leaves much of training maps: it was trained too shortly or is too small. */
static const char *advise_network(const verdict_input *in, sdm_verdict *v)
{
    const sdm_config *c = in->config;
    if (has_bases(c) && !c->network.depth) {
        advise(v, "network.depth", 0, 3);
        return "Polynomials alone limit the model";
    }
    if (c->train.learning_rate > RATE_HIGH) {
        advise(v, "train.learning_rate", c->train.learning_rate, RATE_USUAL);
        return "The learning rate is too high";
    }
    const bool few = in->steps<FEW_STEPS, falls = v->fall> STILL_FALLING && !in->ended_early;
    if ((few || falls) && grid_took_time(in)) return advise_static(in, v);
    // time was left: a longer budget alone makes patience end the steps a little later
    if (few && in->ended_early && advise_double(v, "train.patience", c->train.patience, 1))
        return "train.patience ended the training after few steps";
    if (few) {
        advise_budget(in, v);
        return in->steps > 0 ? "The training was too short, it made fewer than 500 steps"
                             : "The training was too short, the maps left no time for steps";
    }
    if (falls) {
        advise_budget(in, v);
        return "The training was too short, its error was still falling";
    }
    // the head sees more than the modes, but the MLP learns only them
    if (has_bases(c) && v->modes_mm2 > 0.5 * v->part_mm2[SDM_CAUSE_NETWORK] &&
        advise_double(v, "network.modes", c->network.modes, 2048))
        return "The number of global modes limits the model";
    if (c->network.kind == SDM_NETWORK_SDMNN &&
        advise_double(v, "network.channels", c->network.channels, 512))
        return "The size of the network limits the model";
    if (!advise_double(v, "network.width", c->network.width, 4096) && c->network.depth < 16)
        advise(v, "network.depth", c->network.depth, c->network.depth + 1);
    return "The size of the network limits the model";
}

/* Held-out maps have a larger error than training maps. */
static const char *advise_maps(const verdict_input *in, sdm_verdict *v)
{
    const sdm_config *c = in->config;
    if (grid_took_time(in)) return advise_static(in, v);
    if (in->cut) {
        advise_budget(in, v);
        return in->ended_early
                   ? "There are fewer maps than data.start, because they may take half of "
                     "train.minutes only. Their number limits the model"
                   : "There are fewer maps than data.start, because the time was too short. Their "
                     "number limits the model";
    }
    if (in->full) {
        advise_double(v, "data.memory_gb", c->data.memory_gb, INFINITY);
        return "There are fewer maps than data.start, because data.memory_gb holds no more. Their "
               "number limits the model";
    }
    // `start` counts for bases and polynomials, too
    if (c->data.online > c->data.start)
        advise(v, "data.online", (double)c->data.online, 2 * (double)c->data.online);
    else
        advise(v, "data.start", (double)c->data.start, 2 * fmax((double)c->data.start, in->maps));
    return "The number of maps limits the model";
}

/* Sets the key for the part that limits; returns the first half of the sentence. */
static const char *advise_part(const verdict_input *in, sdm_verdict *v)
{
    const sdm_config *c = in->config;
    switch (v->limit) {
    case SDM_CAUSE_BASES:
        if (!advise_double(v, "network.rank", c->network.rank, 256) && c->network.block >= 4)
            advise(v, "network.block", c->network.block, c->network.block / 2);
        return "The bases limit the model";
    case SDM_CAUSE_NETWORK:
        return advise_network(in, v);
    case SDM_CAUSE_MAPS:
        return advise_maps(in, v);
    case SDM_CAUSE_ROUNDING:
        return "The rounding of the weights limits the model";
    case SDM_CAUSE_FAR:
        return "Far from the surface the template only estimates distances, inside overlaps of its "
               "parts and where parts are stretched; this limits the model";
    case SDM_CAUSE_TEMPLATE:
        advise(v, "grid.spacing", v->voxel_mm, v->voxel_mm / 2);
        return "The lattices of the template limit the model, which are as fine as the grid";
    default:
        if (sdm_verdict_lacks_part(v)) {
            advise(v, "grid.spacing", v->coarse_mm, sdm_verdict_spacing(v));
            return "The grid is too coarse for the thinnest part, which surfaces lack or show "
                   "broken";
        }
        advise(v, "grid.spacing", v->voxel_mm, v->voxel_mm / 2);
        return "The grid limits the surface, more than the network does";
    }
}

static sdm_grade grade_of(const sdm_verdict *v)
{
    const double voxels = v->rmse_voxel_mm / v->voxel_mm;
    if (voxels <= SDM_GRADE_GOOD_VOXELS && v->dice >= SDM_GRADE_GOOD_DICE && v->cut <= 0.05)
        return SDM_GRADE_GOOD;
    return voxels <= 0.2 && v->dice >= 0.9 && v->cut <= SDM_CUT_POOR ? SDM_GRADE_USABLE
                                                                     : SDM_GRADE_POOR;
}

/* *limit = the largest part, or the grid. Returns false if nothing was measured. */
static bool find_limit(const verdict_input *in, const sdm_verdict *v, sdm_cause *limit)
{
    const double *part = v->part_mm2;
    double largest = 0;
    for (int i = 0; i < SDM_CAUSE_GRID; i++)
        if (part[i] > largest) largest = part[i], *limit = (sdm_cause)i;
    // a network that has not learned what it could fits neither training maps nor others
    const bool unfinished = in->steps < FEW_STEPS || v->fall > STILL_FALLING ||
                            v->modes_mm2 > part[SDM_CAUSE_NETWORK] + part[SDM_CAUSE_MAPS];
    if (*limit == SDM_CAUSE_MAPS && in->config->network.depth && unfinished &&
        part[SDM_CAUSE_NETWORK] > 0.5 * part[SDM_CAUSE_MAPS])
        *limit = SDM_CAUSE_NETWORK;
    // no network shows a part that its grid does not
    if (sdm_verdict_lacks_part(v)) {
        *limit = SDM_CAUSE_GRID;
        return true;
    }
    // a run that ended before its first step says nothing about the grid
    if (in->config->network.depth && in->steps < 1 && part[SDM_CAUSE_NETWORK] > 0 &&
        !(*limit == SDM_CAUSE_MAPS && grid_took_time(in))) {
        *limit = SDM_CAUSE_NETWORK;
        return true;
    }
    const double grid = sqrt(v->part_mm2[SDM_CAUSE_GRID]);
    if (grid > fmax(GRID_SHARE * v->rmse_voxel_mm, GRID_ERROR * v->voxel_mm))
        *limit = SDM_CAUSE_GRID;
    return largest > 0 || *limit == SDM_CAUSE_GRID;
}

/* The minutes that a training needs after the change, if they limit it and the key is another; else
 * 0. */
static double minutes_for(const verdict_input *in, const sdm_verdict *v)
{
    const sdm_config *c = in->config;
    double factor = 1;
    // a template without a correction takes the seconds of the held-out maps
    if (c->network.kind == SDM_NETWORK_TEMPLATE && in->steps < 1) return 0;
    if (!strcmp(v->key, "grid.spacing")) factor = pow(v->from / v->to, 3);
    if (v->limit == SDM_CAUSE_MAPS && !in->cut) factor = 2;
    if (v->limit == SDM_CAUSE_NETWORK && !strncmp(v->key, "network.", 8)) factor = 2;
    // too few maps limit the next training, too, whatever else it changes
    if (!(factor > 1) && in->minutes_asked > 0 && strcmp(v->key, "train.minutes") && v->key[0])
        return in->minutes_asked;
    if (!(c->train.minutes > 0) || !(factor > 1)) return 0;
    // the time that train.patience has saved is there already
    const double minutes = ceil(10 * (factor * in->budget - v->saved_seconds / 60)) / 10;
    return fmax(minutes > in->budget ? minutes : 0, factor * in->minutes_asked);
}

/* text = what follows from an error far from the surface, of which no key of a template takes away
 * anything. */
static void advise_far(const sdm_verdict *v, size_t size, char *text)
{
    static const char far[] = "where distances far away matter, set network.kind to pod (a finer "
                              "grid does not change them)";
    char volumes[48] = "";
    if (v->volume_error > SDM_VOLUME_BAD)
        snprintf(volumes, sizeof volumes, " and volumes by %.2g %%", 100 * v->volume_error);
    if (sdm_verdict_errs_near(v))
        snprintf(text, size,
                 ": near the surface it errs, too, distances by %.2g voxels%s, and a finer grid "
                 "does not mend this; set network.kind to pod, or use exact maps",
                 v->rmse_voxel_mm / v->voxel_mm, volumes);
    else if (sdm_verdict_surfaces_off(v))
        snprintf(text, size,
                 ": nothing to change for level sets and fits near the surface, and a smaller "
                 "grid.spacing for volumes of surfaces; %s",
                 far);
    else
        snprintf(text, size, ": %s%s",
                 v->grade == SDM_GRADE_GOOD
                     ? "nothing to change for surfaces, level sets and fits near the surface; "
                     : "",
                 far);
}

/* The sentence, with the other keys that must change together with v->key. */
static void write_sentence(const verdict_input *in, const char *what, sdm_verdict *v)
{
    const sdm_config *c = in->config;
    char change[256] = "", also[96] = "", time[96] = "", result[96] = "", share[96] = "";
    if (v->key[0])
        snprintf(change, sizeof change, ": %s %s from %.6g to %.6g",
                 v->to < v->from ? "lower" : "raise", v->key, v->from, v->to);
    if (v->limit == SDM_CAUSE_ROUNDING)
        snprintf(change, sizeof change, ": set network.weights to %s",
                 c->network.weights == SDM_WEIGHT_I8 ? "f16" : "f32");
    if (v->limit == SDM_CAUSE_FAR) advise_far(v, sizeof change, change);
    if (!strcmp(v->key, "grid.spacing"))
        snprintf(also, sizeof also, " (and raise grid.size in proportion, if it is given)");
    // with `auto`, a value that is the default of `auto` would become that of the kind
    if (c->network.kind == SDM_NETWORK_TEMPLATE && !strncmp(v->key, "network.", 8))
        snprintf(also, sizeof also, " with network.kind: template");
    // maps of two bytes a voxel; twice as many for this key
    const double gb = 2e-9 * (double)sdm_grid_count(&c->grid) * (in->maps + v->to);
    if (v->limit == SDM_CAUSE_MAPS && !in->cut && !in->full && gb > c->data.memory_gb)
        snprintf(also, sizeof also, " and data.memory_gb to %.0f", ceil(gb));
    v->minutes = minutes_for(in, v);
    if (v->minutes > 0)
        snprintf(time, sizeof time, ", and train.minutes from %.3g to %.3g for %s", in->budget,
                 v->minutes,
                 v->limit == SDM_CAUSE_MAPS || v->minutes <= in->minutes_asked ? "the maps"
                 : v->limit == SDM_CAUSE_NETWORK                               ? "a larger network"
                                                                               : "more voxels");
    if (v->limit == SDM_CAUSE_GRID)
        snprintf(result, sizeof result,
                 "; between its voxels exact maps miss the surface by %.2g mm",
                 sqrt(v->part_mm2[SDM_CAUSE_GRID]));
    else if (v->limit != SDM_CAUSE_NETWORK && v->at_best_mm > 0)
        snprintf(result, sizeof result,
                 "; without this part alone the RMSE would be %.2g mm, not %.2g mm", v->at_best_mm,
                 v->rmse_mm);
    if (v->limit != SDM_CAUSE_GRID) {
        const double rest = v->at_best_mm * v->at_best_mm, part = v->part_mm2[v->limit];
        snprintf(share, sizeof share, " (%.0f %% of the mean square error)",
                 100 * part / (part + rest));
    }
    snprintf(v->sentence, sizeof v->sentence, "%s%s%s%s%s%s.", what, share, change, also, time,
             result);
}

/* Sets the limit, the key and the sentence about them. */
static void decide_limit(const verdict_input *in, sdm_verdict *v)
{
    v->at_best_mm = NAN;
    v->limited = find_limit(in, v, &v->limit);
    if (!v->limited) {
        snprintf(v->sentence, sizeof v->sentence, "Nothing that was measured limits the model.");
        return;
    }
    double rest = 0;
    for (int i = 0; i < SDM_CAUSE_GRID; i++)
        if (v->part_mm2[i] > 0 && i != (int)v->limit) rest += v->part_mm2[i];
    if (v->limit != SDM_CAUSE_GRID) v->at_best_mm = sqrt(rest);
    write_sentence(in, advise_part(in, v), v);
}

/* Begins the sentence with the shapes that the grid cuts: no key of the network mends them. */
static void tell_cut(sdm_verdict *v)
{
    char rest[sizeof v->sentence], share[32] = "all";
    memcpy(rest, v->sentence, sizeof rest);
    if (v->cut < 1) snprintf(share, sizeof share, "%.2g %% of the", fmin(99, 100 * v->cut));
    snprintf(v->sentence, sizeof v->sentence,
             "The grid cuts %s shapes, their surfaces end open: grid: auto holds them. %.400s",
             share, rest);
}

/* Parts that are inside out make the maps jump where they begin to overlap others, and open edges
 * where the side of a point is a guess: no network learns that, and the error that it leaves says
 * nothing about network or maps. */
static void tell_broken(sdm_verdict *v)
{
    v->limited = false;
    v->key[0] = 0;
    v->at_best_mm = NAN;
    if (!(v->inside_out > 0) && !(v->open > 0)) {
        snprintf(v->sentence, sizeof v->sentence,
                 "The thinnest part is %.2g mm thick, %.0f times thinner than a voxel: no grid of "
                 "the whole shape shows it. Is one of its lengths in another unit than mm? Mend "
                 "mesh() of the shape first (sdmgen shapes check names the part).",
                 v->thickness_mm, v->coarse_mm / v->thickness_mm);
        return;
    }
    snprintf(v->sentence, sizeof v->sentence, "%s",
             v->inside_out > 0
                 ? "Parts of the meshes are inside out and vanish where they overlap others: "
                   "reverse the vertices of their triangles in mesh() of the shape (sdmgen shapes "
                   "check names the parts)."
                 : "The meshes have open or badly oriented edges, so that nothing tells the inside "
                   "from the outside there: mend mesh() of the shape (sdmgen shapes check names "
                   "the edges), then train again.");
}

/* Ends the sentence with the number of held-out shapes, where they are few. */
static void tell_few(sdm_verdict *v)
{
    const size_t used = strlen(v->sentence);
    if (v->heldout > 0 && v->heldout < SDM_HELDOUT_FEW)
        snprintf(v->sentence + used, sizeof v->sentence - used,
                 " All figures come from %d held-out %s: raise data.holdout to %d or more.",
                 (int)v->heldout, v->heldout == 1 ? "shape" : "shapes", SDM_HELDOUT_FEW);
}

void trainer_verdict_decide(const verdict_input *in, sdm_verdict *v)
{
    v->grade = grade_of(v);
    decide_limit(in, v);
    // the maps lack these parts: however exact the network is, it has learned another shape
    const bool lacks = sdm_verdict_broken(v) || sdm_verdict_lacks_part(v);
    if (lacks && v->grade == SDM_GRADE_GOOD) v->grade = SDM_GRADE_USABLE;
    // whole parts are missing: who has only the model file must be warned
    if (v->inside_out > 0) v->grade = SDM_GRADE_POOR;
    if (v->thickness_mm < SDM_PART_MISSING * v->coarse_mm) v->grade = SDM_GRADE_POOR;
    if (sdm_verdict_broken(v))
        tell_broken(v);
    else if (v->cut > 0)
        tell_cut(v);
    tell_few(v);
}

void trainer_verdict_unfinished(const char *own, const char *other, bool tried, sdm_verdict *v)
{
    char rest[sizeof v->sentence];
    if (sdm_verdict_broken(v)) return;
    // the other kind is the change to make: no key of this one, but the grid of both
    if (v->limited && strncmp(v->key, "grid.", 5)) {
        const double part = v->part_mm2[v->limit], others = v->at_best_mm * v->at_best_mm;
        if (v->limit == SDM_CAUSE_FAR)
            snprintf(v->sentence, sizeof v->sentence,
                     "Far from the surface the %s only estimates distances%s.", own,
                     sdm_verdict_errs_near(v) ? ", and near the surface it errs, too" : "");
        else
            snprintf(v->sentence, sizeof v->sentence, "Of its error %.0f %% is the %s.",
                     100 * part / (part + others), sdm_cause_text(v->limit));
        v->key[0] = '\0', v->minutes = 0;
        if (v->cut > 0) tell_cut(v);
        tell_few(v);
    }
    memcpy(rest, v->sentence, sizeof rest);
    snprintf(
        v->sentence, sizeof v->sentence,
        "network.kind: auto had no time left to train %s, too%s: %s may be better than %s, near "
        "the surface, too. %.340s",
        other, tried ? ", after a trial" : "", other, own, rest);
}

/* Distributes the error of the model over its causes. What a template leaves besides its correction
 * is divided as the whole error is between the voxels near the surface and the others. */
static void set_parts(const error_measures *m, const model_errors *errors, double mse,
                      sdm_verdict *v)
{
    double *part = v->part_mm2;
    error_pair network = m->network, bases = m->bases;
    if (m->other_voxels || (m->corrects && network.heldout > mse)) {
        // the ratios on other voxels: a sample, or a correction's grid, which reaches farther
        const double scale = mse / network.heldout;
        network.training *= scale, bases.training *= scale;
        network.heldout = mse;
    }
    const double fitted = isfinite(bases.training) ? fmin(bases.training, network.training) : 0;
    if (isfinite(bases.training)) part[SDM_CAUSE_BASES] = fitted;
    if (isfinite(network.training)) {
        part[SDM_CAUSE_NETWORK] = network.training - fitted;
        part[SDM_CAUSE_MAPS] = network.heldout - network.training;
    }
    const double rest = mse - (isfinite(network.heldout) ? network.heldout : 0);
    if (m->corrects) {
        part[SDM_CAUSE_FAR] = mse > 0 ? rest * errors->far_mm2 / mse : 0;
        part[SDM_CAUSE_TEMPLATE] = rest - part[SDM_CAUSE_FAR];
    } else if (!m->other_voxels) {
        part[SDM_CAUSE_ROUNDING] = rest;
    }
}

static void set_derivatives(const trainer *t, const derivative_check *c, sdm_verdict *v)
{
    size_t n;
    const sdm_param *p = sdm_instance_params(t->shape, &n);
    v->derivative_shapes = (int64_t)c->shapes;
    v->derivative_error = c->slope;
    v->volume_derivative_error = c->volume_slope;
    v->volume_derivative_voxels = v->volume_own_error = NAN;
    if (c->shapes) trainer_list_still(p, c->still, n, v->still_params);
    if (isfinite(c->slope)) trainer_list_derivatives(p, c->slopes, n, v->derivatives_bad);
    if (isfinite(c->volume_slope)) {
        double large[SDM_POD_MAX_PARAMS], small[SDM_POD_MAX_PARAMS];
        for (size_t k = 0; k < n; k++) {
            large[k] = c->volume_small[k] ? NAN : c->volume_own[k];
            small[k] = c->volume_small[k] ? c->volume_own[k] : NAN;
            if (!(c->volume_own[k] <= v->volume_own_error) && isfinite(c->volume_own[k])) {
                v->volume_own_error = c->volume_own[k];
                snprintf(v->volume_own_by, sizeof v->volume_own_by, "%.60s", p[k].name);
            }
        }
        trainer_list_derivatives(p, large, n, v->volume_derivatives_bad);
        trainer_list_causes(p, large, c->voxels_slopes, n, v->volume_causes);
        for (size_t k = 0; k < n; k++)
            v->volume_derivative_voxels = fmax(v->volume_derivative_voxels, c->voxels_slopes[k]);
        trainer_list_small(p, small, n, v->volume_derivatives_small);
    }
    if (isfinite(c->slope))
        snprintf(v->derivative_by, sizeof v->derivative_by, "%.60s", p[c->slope_param].name);
    if (isfinite(c->volume_slope))
        snprintf(v->volume_derivative_by, sizeof v->volume_derivative_by, "%.60s",
                 p[c->volume_slope_param].name);
}

sdm_status trainer_verdict_make(trainer *t, const model_errors *errors, sdm_verdict *out,
                                sdm_error *err)
{
    error_measures m = {.network = {NAN, NAN},
                        .bases = {NAN, NAN},
                        .modes = NAN,
                        .motion_mm = NAN,
                        .warp_mm = NAN,
                        .degree = NAN,
                        .ridge = NAN};
    surface_check surface = {NAN, NAN, NAN, 0, 0, 0};
    size_t triangles;
    history h = {0};
    const dataset *d = &t->data;
    sdm_status s = t->kind->parts(t, &m, err);
    if (!s) s = trainer_surface_check(d, t->n_threads, &surface, err);
    if (!s) s = trainer_find_triangles_param(d, &triangles, err);
    if (!s) s = trainer_history_read(t, &h, err);
    if (s) return s;
    const double floor = isfinite(m.bases.heldout) ? m.bases.heldout : 0;
    *out = (sdm_verdict){.voxel_mm = trainer_dataset_voxel(d),
                         .rmse_mm = t->accuracy.rmse_mm,
                         .rmse_voxel_mm = errors->rmse_voxel_mm,
                         .near_mm = t->accuracy.near_mm,
                         .rmse_near_mm = t->accuracy.rmse_near_mm,
                         .rmse_inside_mm = errors->rmse_inside_mm,
                         .rmse_outside_mm = errors->rmse_outside_mm,
                         .largest_mm = t->accuracy.max_abs_mm,
                         .largest_at_mm = errors->largest_at_mm,
                         .far_largest_mm = errors->far_largest_mm,
                         .dice = errors->dice,
                         .dice_min = errors->dice_min,
                         .heldout = t->accuracy.samples,
                         .modes_mm2 = m.modes,
                         .motion_mm = m.motion_mm,
                         .warp_mm = m.warp_mm,
                         .degree = m.degree,
                         .ridge = m.ridge,
                         .thin = surface.thin,
                         .thickness_mm = surface.thickness_mm,
                         .coarse_mm = sdm_grid_coarsest(d->grid),
                         .cut = surface.cut,
                         .inside_out = surface.inside_out,
                         .open = surface.open,
                         .volume_error = errors->volumes.map,
                         .volume_error_max = errors->volumes.map_max,
                         .surface_volume_error = errors->volumes.surface,
                         .surface_volume_error_max = errors->volumes.surface_max,
                         .saved_seconds = t->saved_seconds,
                         .fall = fmax(trainer_history_fall(&h, SDM_PHASE_MODE_FIT, floor),
                                      trainer_history_fall(&h, SDM_PHASE_REFINE, floor))};
    for (int i = 0; i < SDM_CAUSES; i++) out->part_mm2[i] = NAN;
    out->part_mm2[SDM_CAUSE_GRID] = surface.rms_mm * surface.rms_mm;
    set_parts(&m, errors, t->accuracy.mse_mm2, out);
    const bool fewer = !d->only_holdout && (int64_t)d->n_start < t->config->data.start,
               full = fewer && d->n_slots < d->n_static + (size_t)t->config->data.start;
    const verdict_input in = {.config = t->config,
                              .maps = (double)(d->n_static + d->n_taken),
                              .fixed = (double)d->n_static,
                              .n_params = (double)d->n_params,
                              .cut = fewer && !full && trainer_by_time(t),
                              .full = full,
                              .ended_early = t->saved_seconds > 0,
                              .steps = (double)t->step,
                              .minutes_asked = trainer_minutes_asked(t),
                              .budget = t->turns->budget};
    set_derivatives(t, &errors->derivatives, out);
    if (triangles < d->n_params)
        snprintf(out->triangles_by, sizeof out->triangles_by, "%.60s",
                 sdm_instance_params(t->shape, NULL)[triangles].name);
    trainer_verdict_decide(&in, out);
    trainer_history_dispose(&h);
    return SDM_OK;
}
