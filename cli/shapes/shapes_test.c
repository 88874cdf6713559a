/* sdmgen shapes test: prints whether a shape keeps the contract of sdm/shape.h. */
#include <stdio.h>
#include <string.h>

#include "inputs/setup.h"
#include "report/files.h"
#include "report/json_values.h"
#include "report/report_audit.h"
#include "report/terminal.h"
#include "sdm/internal/conformance.h"
#include "sdm/memory.h"
#include "shapes_command.h"

enum { SAMPLES = 64 };

static const char *const outcomes[] = {[SDM_TEST_PASSED] = "passed",
                                       [SDM_TEST_SKIPPED] = "skipped",
                                       [SDM_TEST_DOUBTFUL] = "doubtful",
                                       [SDM_TEST_FAILED] = "failed"};

/* ---- output ---- */

static sdm_status print_text(const sdm_instance *shape, const sdm_conformance *c, sdm_error *err)
{
    size_t n;
    const sdm_param *params = sdm_instance_params(shape, &n);
    printf("%s: the default shape, %zu corners of the ranges, %zu random shapes\n",
           sdm_instance_shape(shape)->name, c->n_corners, c->n_samples);
    for (int i = 0; i < SDM_N_TESTS; i++) {
        const sdm_test_result *r = &c->test[i];
        sdm_text at = {0};
        if (r->has_params) {
            sdm_text_add(&at, "; at ");
            cli_add_params(params, n, r->p, &at);
        }
        const bool failed = at.failed;
        cli_print("%-9s%-11s%s%s\n", outcomes[r->outcome], r->name, r->text,
                  at.data ? at.data : "");
        sdm_text_dispose(&at);
        if (failed) return sdm_fail(err, SDM_E_NOMEM, "no memory for a line");
    }
    return SDM_OK;
}

static sdm_status print_json(const sdm_instance *shape, const sdm_conformance *c, sdm_error *err)
{
    size_t n;
    const sdm_param *params = sdm_instance_params(shape, &n);
    sdm_json j = {0};
    sdm_json_open(&j, NULL, '{');
    sdm_json_text(&j, "shape", sdm_instance_shape(shape)->name);
    sdm_json_text(&j, "verdict", cli_verdict_name(sdm_conformance_verdict(c)));
    sdm_json_int(&j, "corners", (int64_t)c->n_corners);
    sdm_json_int(&j, "samples", (int64_t)c->n_samples);
    sdm_json_open(&j, "tests", '[');
    for (int i = 0; i < SDM_N_TESTS; i++) {
        const sdm_test_result *r = &c->test[i];
        sdm_json_open(&j, NULL, '{');
        sdm_json_text(&j, "test", r->name);
        sdm_json_text(&j, "outcome", outcomes[r->outcome]);
        sdm_json_real(&j, "figure", r->figure);
        sdm_json_text(&j, "text", r->text);
        if (r->has_params) cli_json_params(&j, "at", params, n, r->p);
        sdm_json_close(&j, '}');
    }
    sdm_json_close(&j, ']');
    sdm_json_close(&j, '}');
    return cli_print_json(&j, err);
}

static sdm_status give_verdict(const cli_args *args, const char *name, const sdm_conformance *c,
                               sdm_error *err)
{
    const sdm_status verdict = sdm_conformance_verdict(c);
    int failed = 0, doubtful = 0;
    for (int i = 0; i < SDM_N_TESTS; i++) {
        failed += c->test[i].outcome == SDM_TEST_FAILED;
        doubtful += c->test[i].outcome == SDM_TEST_DOUBTFUL;
    }
    if (verdict)
        return sdm_fail(err, verdict, "%s: %d of %d tests failed: %s", name, failed, SDM_N_TESTS,
                        verdict == SDM_E_MESH ? "meshes are broken: mend them first"
                                              : "maps, derivatives or trainings would suffer");
    if (!args->json)
        printf("fine: the shape keeps the contract of sdm/shape.h%s\n",
               doubtful ? ", with doubts" : "");
    return SDM_OK;
}

/* ---- the command ---- */

/* The arguments with the file of a plug-in, in place of a NAME, as one more --plugin. */
typedef struct test_args {
    cli_args args;
    const char **plugins;
    const char *name; /* NULL: the only shape of the plug-ins */
} test_args;

static sdm_status read_args(const cli_args *args, test_args *out, sdm_error *err)
{
    out->args = *args;
    out->args.isolate = true;
    out->name = args->files.n > 1 ? args->files.items[1] : NULL;
    if (args->files.n > 2)
        return sdm_fail(err, SDM_E_ARG, "shapes test: unexpected argument '%s'",
                        args->files.items[2]);
    if (args->outputs.n > 0) return sdm_fail(err, SDM_E_ARG, "shapes: -o needs `shapes check`");
    if (!out->name || !cli_ends_with_any(out->name, ".so")) return SDM_OK;
    const sdm_status s = sdm_alloc((void **)&out->plugins, args->plugins.n + 1,
                                   sizeof *out->plugins, "plug-ins", err);
    if (s) return s;
    out->plugins[0] = out->name; // the first one: it is the one that is meant
    if (args->plugins.n)
        memcpy((void *)(out->plugins + 1), (const void *)args->plugins.items,
               args->plugins.n * sizeof *out->plugins);
    out->args.plugins = (cli_list){.items = out->plugins, .n = args->plugins.n + 1};
    out->name = NULL;
    return SDM_OK;
}

sdm_status cli_shapes_test(const cli_args *args, sdm_error *err)
{
    sdm_conformance_opts opts = {.samples = args->samples >= 0 ? (size_t)args->samples : SAMPLES,
                                 .seed = args->seed >= 0 ? (uint64_t)args->seed : 1,
                                 .n_threads = (int)args->threads,
                                 .cancelled = cli_interrupted};
    test_args t = {.name = NULL};
    sdm_registry *registry = NULL;
    sdm_instance *shape = NULL;
    sdm_conformance *found = NULL;
    sdm_status s = read_args(args, &t, err);
    if (!s) s = cli_open_registry(&t.args, &registry, err);
    if (!s && !t.name) s = cli_only_shape(&t.args, registry, "test NAME|PLUGIN.so", &t.name, err);
    if (!s) s = cli_create_shape(registry, t.name, &args->options, &shape, err);
    if (!s) opts.process = cli_other_process(&t.args, registry, shape);
    if (!s) s = SDM_ALLOC(&found, 1, "results of tests", err);
    if (!s) s = sdm_conformance_make(shape, &opts, found, err);
    if (!s) s = args->json ? print_json(shape, found, err) : print_text(shape, found, err);
    if (!s) s = give_verdict(args, sdm_instance_shape(shape)->name, found, err);
    sdm_free(found);
    sdm_instance_free(shape);
    sdm_registry_free(registry);
    sdm_free((void *)t.plugins);
    return s;
}
