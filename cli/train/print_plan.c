/* Prints the plan of a training, as text or JSON. */
#include "print_plan.h"

#include <math.h>
#include <stdio.h>

#include "report/terminal.h"

enum { NODES_MAX = 1024 };

/* Writes a number of bytes as "2.1 GB" into buf; returns buf. */
static const char *format_bytes(double bytes, char buf[32])
{
    static const char *const units[] = {"B", "kB", "MB", "GB", "TB", "PB"};
    size_t unit = 0;
    for (; bytes >= 999.5 && unit + 1 < sizeof units / sizeof *units; unit++) bytes /= 1000;
    snprintf(buf, 32, "%.3g %s", bytes, units[unit]);
    return buf;
}

static double total_seconds(const sdm_train_work *w, int nodes, int cores)
{
    sdm_train_plan plan;
    sdm_train_plan_make(w, nodes, cores, &plan);
    return plan.all_seconds;
}

/* What the run does in a stage. */
static const char *stage_text(sdm_plan_stage stage)
{
    static const char *const texts[SDM_PLAN_STAGES] = {
        [SDM_PLAN_TRIALS] = "short trainings that choose between template and pod, about",
        [SDM_PLAN_DESIGN] = "the preparation of the template or the grid",
        [SDM_PLAN_MAPS] = "exact maps for training and held-out ones",
        [SDM_PLAN_BASES] = "basis functions of the maps",
        [SDM_PLAN_MODES] = "modes of their coefficients",
        [SDM_PLAN_FIT] = "training of the perceptron by the modes",
        [SDM_PLAN_REFINE] = "training of all weights by the maps"};
    return texts[stage];
}

static void print_stages(const sdm_train_work *w, const sdm_train_plan *p)
{
    char time[32], bytes[32], count[64];
    printf("  %-8s %-16s %10s  %-18s  %s\n", "stage", "work", "time", "received by a node",
           "what it is");
    for (int i = 0; i < SDM_PLAN_STAGES; i++) {
        const double n = i == SDM_PLAN_TRIALS   ? w->trial_maps
                         : i == SDM_PLAN_MAPS   ? w->n_maps + w->n_holdout
                         : i == SDM_PLAN_FIT    ? w->steps
                         : i == SDM_PLAN_REFINE ? w->refine_steps
                                                : 0;
        if (!(p->seconds[i] > 0)) continue;
        char words[32] = "";
        if (n > 0)
            snprintf(words, sizeof words, "%.20s %s", cli_format_count((int64_t)n, count),
                     i == SDM_PLAN_TRIALS || i == SDM_PLAN_MAPS ? "maps" : "steps");
        printf("  %-8s %-16s %10s  %-18s  %s\n", sdm_plan_stage_name((sdm_plan_stage)i), words,
               cli_format_seconds(p->seconds[i], time), format_bytes(p->received[i], bytes),
               stage_text((sdm_plan_stage)i));
    }
    printf("  %-8s %-16s %10s  %-18s  %s\n", "total", "", cli_format_seconds(p->all_seconds, time),
           format_bytes(p->all_received, bytes), "the sum of these lines");
}

/* Says what a budget of time is for, and how many maps of the table it holds. */
static void print_budget(const sdm_config *c, const sdm_train_work *w, const sdm_train_plan *p)
{
    char a[32], b[32], made[64], all[64], later[64];
    // a template without a correction needs held-out maps only
    const double online = w->n_maps > 0 ? (double)c->data.online : 0,
                 before = w->n_holdout + w->n_maps - online,
                 seconds = p->seconds[SDM_PLAN_DESIGN] +
                           p->seconds[SDM_PLAN_MAPS] * before / (w->n_holdout + w->n_maps),
                 half = 30 * c->train.minutes;
    if (!(c->train.minutes > 0)) return;
    const bool longer = p->all_seconds > 1.01 * 2 * half;
    printf("  budget   train.minutes is %.4g%s", c->train.minutes,
           longer ? ", less than `total`, and ends the run: " : ": ");
    if (seconds <= half) {
        printf("the maps before training take %s of it, the rest is for as many steps as fit\n",
               cli_format_seconds(seconds, a));
        return;
    }
    printf("after half of it (%s) training begins with %s of the %s maps that it asks for",
           cli_format_seconds(half, a), cli_format_count((int64_t)(before * half / seconds), made),
           cli_format_count((int64_t)before, all));
    if (online > 0)
        printf(" (the other %s of the table, data.online, are made while it trains)",
               cli_format_count((int64_t)online, later));
    printf(
        "; all of them take %s: raise train.minutes to %.4g, or lower data.start or data.static\n",
        cli_format_seconds(seconds, b), ceil(10 * seconds / 30) / 10);
}

static void print_text(const sdm_config *config, const sdm_train_work *w, const sdm_train_plan *p,
                       int nodes, int cores)
{
    char a[32], b[32], c[32];
    const int pays = sdm_train_plan_pays(w, cores);
    printf("plan for %d %s of %d cores, from %.2g s on %d threads of this machine: %.3g exact maps "
           "a second on a core",
           nodes, nodes == 1 ? "node" : "nodes", cores, w->measured_seconds, w->threads,
           1 / w->map);
    if (w->fit_step > 0) printf(", %.3g steps a second on a core", 1 / w->fit_step);
    printf("\n");
    print_stages(w, p);
    if (w->only_pod)
        printf("  auto     planned as pod: a template does not suit the shape\n");
    else if (config->network.kind == SDM_NETWORK_AUTO)
        printf("  auto     planned as pod; where the template is kept, seconds may be enough "
               "(--plan network.kind=template)\n");
    print_budget(config, w, p);
    printf("  memory   %s on each node, with one rank on it\n", format_bytes(p->memory, a));
    printf("  files    model %s, checkpoint up to %s; all maps would take %s if they were kept "
           "(sdmgen dataset)\n",
           format_bytes(p->model, a), format_bytes(p->checkpoint, b), format_bytes(p->dataset, c));
    printf("  nodes    1: %s", cli_format_seconds(total_seconds(w, 1, cores), a));
    for (int n = 2; n <= 2 * pays && n <= NODES_MAX; n *= 2)
        printf(", %d: %s", n, cli_format_seconds(total_seconds(w, n, cores), a));
    if (pays == 1)
        printf("; more than one does not pay: two are less than 1.5 times as fast\n");
    else
        printf("; it pays up to %d: twice as many are less than 1.5 times as fast\n", pays);
}

static sdm_status print_json(const sdm_train_work *w, const sdm_train_plan *p, int nodes, int cores,
                             sdm_error *err)
{
    sdm_json j = {0};
    sdm_json_open(&j, NULL, '{');
    sdm_json_int(&j, "nodes", nodes);
    sdm_json_int(&j, "cores", cores);
    sdm_json_real(&j, "seconds", p->all_seconds);
    sdm_json_real(&j, "received_bytes", p->all_received);
    sdm_json_open(&j, "stages", '[');
    for (int i = 0; i < SDM_PLAN_STAGES; i++) {
        sdm_json_open(&j, NULL, '{');
        sdm_json_text(&j, "stage", sdm_plan_stage_name((sdm_plan_stage)i));
        sdm_json_real(&j, "seconds", p->seconds[i]);
        sdm_json_real(&j, "received_bytes", p->received[i]);
        sdm_json_close(&j, '}');
    }
    sdm_json_close(&j, ']');
    sdm_json_int(&j, "maps", (int64_t)w->n_maps);
    sdm_json_int(&j, "heldout", (int64_t)w->n_holdout);
    sdm_json_int(&j, "steps", (int64_t)w->steps);
    sdm_json_int(&j, "refine_steps", (int64_t)w->refine_steps);
    sdm_json_real(&j, "memory_bytes", p->memory);
    sdm_json_real(&j, "model_bytes", p->model);
    sdm_json_real(&j, "checkpoint_bytes", p->checkpoint);
    sdm_json_real(&j, "dataset_bytes", p->dataset);
    sdm_json_real(&j, "maps_per_core_second", 1 / w->map);
    sdm_json_real(&j, "steps_per_core_second", w->fit_step > 0 ? 1 / w->fit_step : NAN);
    sdm_json_real(&j, "measured_seconds", w->measured_seconds);
    sdm_json_int(&j, "pays_to_nodes", sdm_train_plan_pays(w, cores));
    sdm_json_open(&j, "scaling", '[');
    for (int n = 1; n <= NODES_MAX; n *= 2) {
        sdm_json_open(&j, NULL, '{');
        sdm_json_int(&j, "nodes", n);
        sdm_json_real(&j, "seconds", total_seconds(w, n, cores));
        sdm_json_close(&j, '}');
    }
    sdm_json_close(&j, ']');
    sdm_json_close(&j, '}');
    return cli_print_json(&j, err);
}

sdm_status cli_plan_training(const cli_args *args, const sdm_config *config,
                             const sdm_instance *shape, sdm_error *err)
{
    const sdm_train_hooks hooks = {.cancelled = cli_interrupted};
    sdm_train_work work;
    sdm_train_plan plan;
    const sdm_status s = sdm_train_measure(config, shape, &hooks, &work, err);
    if (s) return s;
    const int nodes = args->nodes ? (int)args->nodes : 1,
              cores = args->cores ? (int)args->cores : work.threads;
    sdm_train_plan_make(&work, nodes, cores, &plan);
    if (args->json) return print_json(&work, &plan, nodes, cores, err);
    print_text(config, &work, &plan, nodes, cores);
    return SDM_OK;
}
