/* Reads --depth; prints the measures of a shape as text and as JSON. */
#include "measures.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "report/terminal.h"

/* Reads the numbers of "10,20.5". */
static sdm_status read_list(const char *text, cli_depths *out, sdm_error *err)
{
    char word[64];
    for (const char *at = text;; at++) {
        const size_t length = strcspn(at, ",");
        if (out->n == CLI_DEPTHS_MAX)
            return sdm_fail(err, SDM_E_ARG, "--depth: more than %d depths", CLI_DEPTHS_MAX);
        snprintf(word, sizeof word, "%.*s", length < sizeof word ? (int)length : 0, at);
        double *depth = &out->mm[out->n++];
        if (!sdm_parse_real(word, depth) || !(*depth >= 0))
            return sdm_fail(err, SDM_E_ARG,
                            "--depth '%.100s': need depths in mm, 0 or more, as in 10,20.5", text);
        at += length;
        if (!*at) return SDM_OK;
    }
}

sdm_status cli_read_depths(const cli_args *args, const sdm_instance *shape, cli_depths *out,
                           sdm_error *err)
{
    sdm_measures names;
    out->n = 0;
    if (!args->depths) return SDM_OK;
    if (!args->measure) return sdm_fail(err, SDM_E_ARG, "--depth belongs to --measure");
    const sdm_status s = read_list(args->depths, out, err);
    return s ? s : sdm_shape_measure(shape, NULL, out->mm, out->n, &names, err);
}

static void print_measure(const sdm_measured *m, bool with_sd)
{
    char number[32], sd[32];
    printf("  %-15s %10s", m->name, isnan(m->value) ? "none" : cli_number(m->value, 5, number));
    if (with_sd && isnan(m->sd) && !isnan(m->value)) printf(" +- %-9s", "unknown");
    if (with_sd && m->sd > 0) printf(" +- %-9s", cli_number(m->sd, 2, sd));
    if (*m->unit) printf(" %s", m->unit);
    if (!isnan(m->depth)) printf(" at %g mm", m->depth);
    if (isnan(m->value)) printf("   (%s)", isnan(m->depth) ? "the mesh is open" : "beyond the end");
    if (m->not_determined)
        printf("   not determined: the standard deviation is over 0.9 of that before the fit");
    printf("\n");
}

void cli_print_measures(const sdm_measures *m, bool with_sd)
{
    printf("measures\n");
    for (size_t i = 0; i < m->n; i++) print_measure(&m->at[i], with_sd);
}

void cli_json_measures(const sdm_measures *m, bool with_sd, sdm_json *json)
{
    sdm_json_open(json, "measures", '[');
    for (size_t i = 0; i < m->n; i++) {
        const sdm_measured *x = &m->at[i];
        sdm_json_open(json, NULL, '{');
        sdm_json_text(json, "name", x->name);
        if (!isnan(x->depth)) sdm_json_real(json, "depth_mm", x->depth);
        sdm_json_real(json, "value", x->value);
        if (with_sd) sdm_json_real(json, "sd", x->sd);
        sdm_json_text(json, "unit", x->unit);
        if (with_sd) sdm_json_bool(json, "not_determined", x->not_determined);
        sdm_json_close(json, '}');
    }
    sdm_json_close(json, ']');
}
