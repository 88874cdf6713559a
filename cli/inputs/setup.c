/* Opens the shapes, models and mesh files of the command line; reads parameters and grids. */
#include "setup.h"

#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "other_file.h"
#include "report/files.h"
#include "report/terminal.h"
#include "sdm/builtin_shapes.h"
#include "sdm/internal/isolation.h"
#include "sdm/internal/model_hash.h"
#include "sdm/internal/same_triangles.h"
#include "sdm/internal/skipped.h"
#include "sdm/internal/text.h"
#include "sdm/memory.h"
#include "sdm/meshfile.h"

static void tell(const char *text) { cli_notice("%s", text); }

static sdm_isolation isolation_of(const cli_args *args)
{
    return (sdm_isolation){
        .program = "/proc/self/exe",
        .seconds = args->isolate_seconds > 0 ? args->isolate_seconds : 10,
        .bytes = (uint64_t)(1e9 * (args->isolate_memory > 0 ? args->isolate_memory : 2)),
        .notice = tell};
}

sdm_repeat_process cli_other_process(const cli_args *args, const sdm_registry *r,
                                     const sdm_instance *shape)
{
    const char *name = sdm_instance_shape(shape)->name;
    sdm_repeat_process process = {.how = isolation_of(args)};
    process.how.notice = NULL; // what the plug-in prints is to be seen already
    for (size_t i = 0; i < sdm_registry_count(r); i++)
        if (!strcmp(sdm_registry_at(r, i)->name, name) && sdm_registry_origin(r, i)[0] == '/')
            process.plugin = sdm_registry_origin(r, i);
    return process;
}

/* The options --isolate. */
static sdm_status isolate(const cli_args *args, sdm_registry *r, sdm_error *err)
{
    if (!args->isolate && (args->isolate_seconds > 0 || args->isolate_memory > 0))
        return sdm_fail(err, SDM_E_ARG, "--isolate-%s needs --isolate",
                        args->isolate_seconds > 0 ? "seconds" : "memory");
    const sdm_isolation how = isolation_of(args);
    return args->isolate ? sdm_registry_isolate(r, &how, err) : SDM_OK;
}

/* Tells of file number i in SDMGEN_PLUGIN_PATH that was skipped. given: so many of the first shapes
 * are built in or from --plugin, which comes before the path. */
static void tell_skipped(const sdm_registry *r, size_t i, size_t given)
{
    const char *skipped = sdm_registry_skipped(r, i), *end = strstr(skipped, ": shape '");
    for (size_t k = 0; k < given && end; k++) {
        const char *origin = sdm_registry_origin(r, k);
        char clash[PATH_MAX + 200];
        const char *name = sdm_registry_at(r, k)->name;
        snprintf(clash, sizeof clash, ": shape '%s' is there already (%s): ", name, origin);
        if (origin[0] != '/' || strncmp(end, clash, strlen(clash)) != 0) continue;
        cli_notice("shape '%s' is from --plugin, not from %.*s in SDMGEN_PLUGIN_PATH", name,
                   (int)(end - skipped), skipped);
        return;
    }
    cli_notice("skipped a file in SDMGEN_PLUGIN_PATH: %s", skipped);
}

sdm_status cli_open_registry(const cli_args *args, sdm_registry **out, sdm_error *err)
{
    sdm_status s = sdm_registry_create(out, err);
    if (!s) s = sdm_builtin_shapes_add(*out, err);
    if (!s) s = isolate(args, *out, err);
    for (size_t i = 0; i < args->plugins.n && !s; i++)
        s = sdm_registry_load(*out, args->plugins.items[i], err);
    const size_t given = s ? 0 : sdm_registry_count(*out);
    if (!s) s = sdm_registry_load_path(*out, getenv("SDMGEN_PLUGIN_PATH"), err);
    if (s) {
        sdm_registry_free(*out);
        *out = NULL;
    }
    const char *skipped;
    for (size_t i = 0; (skipped = sdm_registry_skipped(*out, i)); i++)
        if (sdm_registry_skipped_folder(*out, i))
            cli_warn("SDMGEN_PLUGIN_PATH: %s", skipped);
        else
            tell_skipped(*out, i, given);
    return s;
}

/* The message about a file in SDMGEN_PLUGIN_PATH that is called like the shape and was skipped;
 * NULL: there is none. */
static const char *find_skipped(const sdm_registry *r, const char *name)
{
    char file[128];
    snprintf(file, sizeof file, "/%.100s.so", name);
    const char *skipped;
    for (size_t i = 0; (skipped = sdm_registry_skipped(r, i)); i++)
        if (strstr(skipped, file)) return skipped;
    return NULL;
}

/* Splits "name=value" into two texts in buf. option: "-p" or "-O", for the message. */
static sdm_status split_word(const char *word, const char *option, char buf[SDM_ERROR_TEXT_MAX],
                             const char **name, const char **value, sdm_error *err)
{
    const size_t length = strlen(word);
    const char *equals = strchr(word, '=');
    if (!equals || equals == word || length >= SDM_ERROR_TEXT_MAX)
        return sdm_fail(err, SDM_E_ARG, "%s '%.200s': need name=value", option, word);
    memcpy(buf, word, length + 1);
    buf[equals - word] = '\0';
    *name = buf;
    *value = buf + (equals - word) + 1;
    return SDM_OK;
}

/* The value of SDMGEN_PLUGIN_PATH if it is set and no shape comes from a file; NULL otherwise. */
static const char *path_without_shapes(const sdm_registry *r)
{
    const char *path = getenv("SDMGEN_PLUGIN_PATH");
    if (!path || !*path) return NULL;
    for (size_t i = 0; i < sdm_registry_count(r); i++)
        if (strchr(sdm_registry_origin(r, i), '/')) return NULL;
    return path;
}

const sdm_shape *cli_find_shape(const sdm_registry *r, const char *name, sdm_error *err)
{
    const char *near = NULL;
    const sdm_shape *shape = sdm_registry_find(r, name, &near);
    if (shape) return shape;
    const char *skipped = find_skipped(r, name), *empty = near ? NULL : path_without_shapes(r);
    if (skipped)
        sdm_fail(err, SDM_E_ARG, "unknown shape '%s'; %s", name, skipped);
    else if (empty)
        sdm_fail(err, SDM_E_ARG,
                 "unknown shape '%s'; SDMGEN_PLUGIN_PATH=%.300s holds no plug-in: name the folder "
                 "in which the .so file lies (folders in it are not searched)",
                 name, empty);
    else
        sdm_fail(err, SDM_E_ARG, "unknown shape '%s'%s%s%s", name,
                 near ? "; did you mean '"
                      : "; sdmgen shapes lists the known ones, --plugin FILE loads others",
                 near ? near : "", near ? "'?" : "");
    return NULL;
}

/* The n options were refused. If one of them has the name of a parameter, replaces the message by
 * one that says so, with -p. The parameters are those that the shape has without options. */
static void explain_option(const sdm_shape *shape, const sdm_named_text *named, size_t n,
                           sdm_error *err)
{
    sdm_instance *plain = NULL;
    size_t n_params = 0;
    if (!err || sdm_instance_create(shape, NULL, 0, NULL, &plain, NULL)) return;
    const sdm_param *params = sdm_instance_params(plain, &n_params);
    for (size_t i = 0; i < n; i++) {
        bool known = false, is_param = false;
        for (size_t k = 0; k < shape->n_options; k++)
            known = known || !strcmp(shape->options[k].name, named[i].name);
        for (size_t k = 0; k < n_params; k++)
            is_param = is_param || !strcmp(params[k].name, named[i].name);
        if (known || !is_param) continue;
        sdm_fail(err, err->status, "shape '%s': %s is a parameter, no option: -p %s=%.100s",
                 shape->name, named[i].name, named[i].name, named[i].value);
        break;
    }
    sdm_instance_free(plain);
}

sdm_status cli_create_shape(const sdm_registry *r, const char *name, const cli_list *options,
                            sdm_instance **out, sdm_error *err)
{
    const sdm_shape *shape = cli_find_shape(r, name, err);
    if (!shape) return SDM_E_ARG;
    sdm_named_text *named = NULL;
    char(*words)[SDM_ERROR_TEXT_MAX] = NULL;
    sdm_status s = SDM_ALLOC(&named, options->n, "shape options", err);
    if (!s) s = sdm_alloc((void **)&words, options->n, sizeof *words, "shape options", err);
    for (size_t i = 0; i < options->n && !s; i++)
        s = split_word(options->items[i], "-O", words[i], &named[i].name, &named[i].value, err);
    if (!s) s = sdm_instance_create(shape, named, options->n, NULL, out, err);
    if (s == SDM_E_CONFIG) { // options come from the command line
        s = SDM_E_ARG;
        if (err) err->status = s;
        explain_option(shape, named, options->n, err);
    }
    sdm_free(words);
    sdm_free(named);
    return s;
}

/* Makes the mesh twice and compares the bits: a plug-in that keeps something from call to call
 * would give a wrong map without a word. Values outside the ranges are left to the command. */
static sdm_status check_repeats(const cli_shape *shape, sdm_error *err)
{
    sdm_mesh one = {0}, two = {0};
    if (sdm_instance_check(shape->instance, shape->values, NULL)) return SDM_OK;
    sdm_status s = sdm_instance_mesh(shape->instance, shape->values, &one, err);
    if (!s) s = sdm_instance_mesh(shape->instance, shape->values, &two, err);
    if (!s && (!sdm_mesh_same_triangles(&one, &two) ||
               memcmp(one.vert, two.vert, 3 * one.n_vert * sizeof *one.vert) != 0))
        s = sdm_fail(err, SDM_E_PLUGIN,
                     "shape '%s': mesh() gives another mesh when it is called again with the same "
                     "parameters (`sdmgen shapes test` tells more)",
                     sdm_instance_shape(shape->instance)->name);
    sdm_mesh_dispose(&two);
    sdm_mesh_dispose(&one);
    return s;
}

/* SDM_E_ARG if a parameter that is given is an option of the shape. */
static sdm_status refuse_options(const cli_args *args, const cli_shape *shape, sdm_error *err)
{
    const sdm_shape *s = sdm_instance_shape(shape->instance);
    for (size_t i = 0; i < args->params.n; i++) {
        const char *word = args->params.items[i];
        const size_t length = strcspn(word, "=");
        bool is_param = false;
        for (size_t k = 0; k < shape->n_params; k++)
            is_param = is_param || (strlen(shape->params[k].name) == length &&
                                    !strncmp(shape->params[k].name, word, length));
        for (size_t k = 0; k < s->n_options && !is_param; k++)
            if (strlen(s->options[k].name) == length && !strncmp(s->options[k].name, word, length))
                return sdm_fail(err, SDM_E_ARG,
                                "shape '%s': %s is an option, no parameter: -O %.200s", s->name,
                                s->options[k].name, word);
    }
    return SDM_OK;
}

sdm_status cli_shape_open(const cli_args *args, const char *name, const cli_list *options,
                          cli_shape *out, sdm_error *err)
{
    sdm_status s = cli_open_registry(args, &out->registry, err);
    if (!s) s = cli_create_shape(out->registry, name, options, &out->instance, err);
    if (s) return s;
    out->params = sdm_instance_params(out->instance, &out->n_params);
    s = refuse_options(args, out, err);
    if (!s) s = SDM_ALLOC(&out->values, out->n_params, "parameters", err);
    if (!s) s = cli_read_params(out->params, out->n_params, &args->params, out->values, err);
    return s || !args->isolate ? s : check_repeats(out, err);
}

void cli_shape_dispose(cli_shape *shape)
{
    sdm_free(shape->values);
    sdm_instance_free(shape->instance);
    sdm_registry_free(shape->registry);
    *shape = (cli_shape){0};
}

/* SDM_E_ARG unless the value of --expect is a SHA-256. */
static sdm_status check_hash_text(const char *text, sdm_error *err)
{
    const size_t digits = strspn(text, "0123456789abcdef");
    if (digits == SDM_SHA256_TEXT - 1 && !text[digits]) return SDM_OK;
    return sdm_fail(err, SDM_E_ARG,
                    "--expect '%.80s': need a SHA-256, 64 digits 0-9 and a-f, as sha256sum and "
                    "`sdmgen info` print it",
                    text);
}

/* Opens a model; the message about another file tells what it is. */
static sdm_status open_model_file(const char *path, sdm_model **out, sdm_error *err)
{
    char buf[256];
    sdm_error why = {0};
    const sdm_status s = sdm_model_open(path, out, &why);
    if (!s) return SDM_OK;
    const bool other = (s == SDM_E_FORMAT || s == SDM_E_IO) && !cli_ends_with(path, ".sdm");
    return sdm_fail(err, s, "%s%s", why.text, other ? cli_other_file(path, buf) : "");
}

sdm_status cli_open_model(const cli_args *args, const char *path, sdm_model **out, sdm_error *err)
{
    char hash[SDM_SHA256_TEXT];
    *out = NULL;
    sdm_status s = args->expect ? check_hash_text(args->expect, err) : SDM_OK;
    if (!s) s = open_model_file(path, out, err);
    if (s || !args->expect || !strcmp(sdm_model_sha256(*out, hash), args->expect)) return s;
    sdm_model_free(*out);
    *out = NULL;
    return sdm_fail(err, SDM_E_FORMAT, "%s: not the model of --expect: its SHA-256 is %s", path,
                    hash);
}

sdm_status cli_expect_model(const cli_args *args, sdm_error *err)
{
    return args->expect ? sdm_fail(err, SDM_E_ARG, "--expect is the hash of a model: there is none")
                        : SDM_OK;
}

sdm_status cli_refuse_plugins(const cli_args *args, const char *input, sdm_error *err)
{
    return !args->plugins.n && !args->isolate
               ? SDM_OK
               : sdm_fail(err, SDM_E_ARG, "%s: --%s does nothing for %s, which needs no shape",
                          args->command->name, args->plugins.n ? "plugin" : "isolate", input);
}

sdm_status cli_open_unknown(const cli_args *args, const char *path, sdm_model **out, sdm_error *err)
{
    sdm_error why = {0};
    const sdm_status s = cli_open_model(args, path, out, &why);
    if (!s) return s;
    char buf[256];
    const bool other =
        s == SDM_E_FORMAT && !cli_ends_with(path, ".sdm") && !*cli_other_file(path, buf);
    return sdm_fail(err, s, "%s%s", why.text,
                    other
                        ? "; its name is neither that of a level set (.vdb) nor of an image (.nii "
                          ".nii.gz .nrrd .nhdr .mha .mhd)"
                        : "");
}

sdm_status cli_model_params(const sdm_model_info *info, sdm_param **out, sdm_error *err)
{
    const sdm_status s = SDM_ALLOC(out, info->n_params, "parameters", err);
    if (s) return s;
    for (size_t i = 0; i < info->n_params; i++) {
        const sdm_model_param *p = &info->params[i];
        (*out)[i] = (sdm_param){p->name, p->unit, p->min, p->max, p->def, ""};
    }
    return SDM_OK;
}

sdm_range_policy cli_policy(const cli_args *args)
{
    return !strcmp(args->policy, "clamp")   ? SDM_RANGE_CLAMP
           : !strcmp(args->policy, "exact") ? SDM_RANGE_EXACT
                                            : SDM_RANGE_REFUSE;
}

sdm_outside cli_outside(const cli_args *args)
{
    return !strcmp(args->outside, "bound")   ? SDM_OUTSIDE_BOUND
           : !strcmp(args->outside, "exact") ? SDM_OUTSIDE_EXACT
                                             : SDM_OUTSIDE_REFUSE;
}

/* ---- parameters ---- */

/* Like sdm_parse_real(), but accepts NaN and infinities, also as the result of an overflow. */
static bool parse_any_real(const char *text, double *out)
{
    if (sdm_parse_real(text, out)) return true;
    const char *at = text + (*text == '-' || *text == '+');
    const size_t digits = strspn(at, "0123456789.eE+-");
    char *end = NULL;
    const double v = strtod(text, &end);
    if (end == text || *end || isfinite(v)) return false;
    if (at[digits] && strspn(at, "nNaAiIfFtTyY") != strlen(at)) return false;
    *out = v;
    return true;
}

// parameters that a message lists
enum { NAMES_TOLD = 12 };

static sdm_status find_param(const sdm_param *params, size_t n, const char *name, size_t *index,
                             sdm_error *err)
{
    const char *names[SDM_MODEL_NAME_MAX * 4];
    const size_t limit = sizeof names / sizeof *names;
    for (size_t i = 0; i < n; i++) {
        if (i < limit) names[i] = params[i].name;
        if (strcmp(params[i].name, name)) continue;
        *index = i;
        return SDM_OK;
    }
    const char *near = sdm_nearest_name(name, names, n < limit ? n : limit);
    if (near)
        return sdm_fail(err, SDM_E_ARG, "unknown parameter '%.100s'; did you mean '%s'?", name,
                        near);
    sdm_text all = {0};
    for (size_t i = 0; i < n && i < NAMES_TOLD; i++)
        sdm_text_add(&all, "%s%s", i ? ", " : "", params[i].name);
    if (n > NAMES_TOLD) sdm_text_add(&all, " and %zu more", n - NAMES_TOLD);
    const sdm_status s =
        sdm_fail(err, SDM_E_ARG, "unknown parameter '%.100s'; the parameters are %s", name,
                 all.size && !all.failed ? all.data : "none");
    sdm_text_dispose(&all);
    return s;
}

static sdm_status read_param(const sdm_param *params, size_t n, const char *word, bool *seen,
                             double *values, sdm_error *err)
{
    char buf[SDM_ERROR_TEXT_MAX];
    const char *name = NULL, *value = NULL;
    size_t index = 0;
    sdm_status s = split_word(word, "-p", buf, &name, &value, err);
    if (!s) s = find_param(params, n, name, &index, err);
    if (s) return s;
    if (seen[index]) return sdm_fail(err, SDM_E_ARG, "parameter '%s' is given twice", name);
    seen[index] = true;
    if (parse_any_real(value, &values[index])) return SDM_OK;
    char comma[64];
    return sdm_fail(err, SDM_E_ARG, "parameter %s: '%.100s' is not a number%s", name, value,
                    sdm_comma_hint(value, comma));
}

sdm_status cli_read_params(const sdm_param *params, size_t n, const cli_list *given, double *values,
                           sdm_error *err)
{
    bool *seen = NULL;
    sdm_status s = SDM_ALLOC(&seen, n, "parameters", err);
    for (size_t i = 0; i < n; i++) values[i] = params[i].def;
    for (size_t i = 0; i < given->n && !s; i++)
        s = read_param(params, n, given->items[i], seen, values, err);
    sdm_free(seen);
    return s;
}

sdm_status cli_check_range(const sdm_param *params, size_t n, const double *values, sdm_error *err)
{
    for (size_t i = 0; i < n; i++) {
        const sdm_param *p = &params[i];
        if (values[i] >= p->min && values[i] <= p->max) continue;
        return sdm_fail_range(p->name, values[i], p->min, p->max, p->unit, err);
    }
    return SDM_OK;
}

/* Whether the exact shape of the model is known here and allows these values. */
static bool exact_allows(const cli_args *args, const sdm_model *m, const double *values,
                         bool *known)
{
    sdm_registry *registry = NULL;
    sdm_instance *shape = NULL;
    *known = !cli_open_registry(args, &registry, NULL) &&
             !sdm_runtime_instance(m, registry, &shape, NULL);
    const bool allows = *known && !sdm_instance_check(shape, values, NULL);
    sdm_instance_free(shape);
    sdm_registry_free(registry);
    return allows;
}

sdm_status cli_check_trained(const cli_args *args, const sdm_model *m, const sdm_param *params,
                             const double *values, sdm_error *err)
{
    const size_t n = sdm_model_get_info(m)->n_params;
    const sdm_status s = cli_check_range(params, n, values, err);
    bool known;
    for (size_t i = 0; i < n && s; i++)
        if (!isfinite(values[i])) return s; // no policy accepts it
    if (!s || !err) return s;
    for (size_t i = 0; i < n; i++)
        if (*sdm_unit_question(values[i], params[i].min, params[i].max, params[i].unit))
            return s; // the unit is to be mended, not the policy
    const char *exact =
        exact_allows(args, m, values, &known) ? ", --policy exact computes exact maps"
        : known ? "; --policy exact does not help: the shape itself does not allow the value"
                : ", --policy exact computes exact maps if the shape is loaded "
                  "(--plugin FILE)";
    snprintf(err->text + strlen(err->text), sizeof err->text - strlen(err->text),
             "; --policy clamp moves it into the range%s", exact);
    return s;
}

bool cli_clamp(const char *begin, const sdm_param *params, size_t n, double *values)
{
    sdm_text moved = {0};
    char from[32], to[32];
    for (size_t i = 0; i < n; i++) {
        const double given = values[i];
        values[i] = fmin(fmax(given, params[i].min), params[i].max);
        if (values[i] != given)
            sdm_text_add(&moved, "%s%s from %s to %s", moved.size ? ", " : "", params[i].name,
                         sdm_format_real(given, from), sdm_format_real(values[i], to));
    }
    const bool any = moved.size > 0;
    if (any && !moved.failed) cli_notice("%s%s", begin, moved.data);
    sdm_text_dispose(&moved);
    return any;
}

void cli_add_params(const sdm_param *params, size_t n, const double *values, sdm_text *out)
{
    char buf[32];
    for (size_t i = 0; i < n; i++)
        sdm_text_add(out, "%s%s=%s", i ? " " : "", params[i].name, sdm_format_real(values[i], buf));
}

sdm_status cli_read_mesh(const char *path, sdm_mesh *out, sdm_error *err)
{
    sdm_status s = sdm_mesh_read(path, out, err);
    if (s == SDM_E_UNSUPPORTED) {
        s = SDM_E_FORMAT;
        if (err) err->status = s;
    }
    return s;
}
