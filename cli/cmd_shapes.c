/* sdmgen shapes: lists the known shapes, or the parameters and options of one; calls the
 * subcommands. */
#include <stdio.h>
#include <string.h>

#include "commands.h"
#include "inputs/setup.h"
#include "report/json_values.h"
#include "report/terminal.h"
#include "sdm/internal/distribution.h"
#include "sdm/internal/mesh_measures.h"
#include "sdm/memory.h"
#include "shapes/shapes_command.h"

static const char *option_type(const sdm_option *o)
{
    switch (o->type) {
    case SDM_OPTION_REAL:
        return "number";
    case SDM_OPTION_INT:
        return "whole number";
    case SDM_OPTION_CHOICE:
        return "choice";
    default:
        return "file";
    }
}

/* A printed table with aligned columns: each column is as wide as its widest cell. */
enum { COLUMNS = 5 };
typedef struct cell {
    const char *text; /* a text of the shape, of any length, or `buffer` */
    int length;
    char buffer[128]; /* a number, or a range with a distribution */
} cell;
typedef struct table {
    cell (*row)[COLUMNS];
    size_t n;
} table;

static void cell_set(cell *c, const char *text)
{
    c->text = text ? text : "";
    c->length = (int)strlen(c->text);
}

static void cell_set_number(cell *c, double value)
{
    snprintf(c->buffer, sizeof c->buffer, "%.6g", value);
    cell_set(c, c->buffer);
}

/* d: distribution within the range; NULL: none is known. A uniform one is not named. */
static void cell_set_range(cell *c, double min, double max, const sdm_distribution *d)
{
    char text[80];
    const bool named = d && d->kind != SDM_DISTRIBUTION_UNIFORM;
    snprintf(c->buffer, sizeof c->buffer, "%.6g .. %.6g%s%s", min, max, named ? ", " : "",
             named ? sdm_distribution_text(d, text) : "");
    cell_set(c, c->buffer);
}

static sdm_status table_start(table *t, size_t n_rows, sdm_error *err)
{
    static const char *const titles[COLUMNS] = {"name", "unit", "range", "default", "meaning"};
    t->n = 1;
    const sdm_status s = sdm_alloc((void **)&t->row, n_rows + 1, sizeof *t->row, "table", err);
    for (size_t k = 0; k < COLUMNS && !s; k++) cell_set(&t->row[0][k], titles[k]);
    return s;
}

/* Prints the table and frees it. */
static void table_print(table *t, const char *title)
{
    int width[COLUMNS] = {0};
    for (size_t i = 0; i < t->n; i++)
        for (size_t k = 0; k + 1 < COLUMNS; k++)
            if (t->row[i][k].length > width[k]) width[k] = t->row[i][k].length;
    printf("\n%s:\n", title);
    for (size_t i = 0; i < t->n; i++) {
        for (size_t k = 0; k + 1 < COLUMNS; k++)
            printf("  %-*.*s", width[k], t->row[i][k].length, t->row[i][k].text);
        printf("  %s\n", t->row[i][COLUMNS - 1].text);
    }
    sdm_free(t->row);
}

/* distributions: [n], or NULL if they are not known. */
static sdm_status print_params(const sdm_param *params, const sdm_distribution *distributions,
                               size_t n, sdm_error *err)
{
    table t;
    const sdm_status s = n > 0 ? table_start(&t, n, err) : SDM_OK;
    if (s || n == 0) return s;
    for (size_t i = 0; i < n; i++) {
        const sdm_param *p = &params[i];
        cell *row = t.row[t.n++];
        cell_set(&row[0], p->name);
        cell_set(&row[1], p->unit);
        cell_set_range(&row[2], p->min, p->max, distributions ? &distributions[i] : NULL);
        cell_set_number(&row[3], p->def);
        cell_set(&row[4], p->help);
    }
    table_print(&t, "parameters");
    return SDM_OK;
}

static sdm_status print_options(const sdm_shape *shape, sdm_error *err)
{
    table t;
    const sdm_status s = shape->n_options > 0 ? table_start(&t, shape->n_options, err) : SDM_OK;
    if (s || shape->n_options == 0) return s;
    for (uint32_t i = 0; i < shape->n_options; i++) {
        const sdm_option *o = &shape->options[i];
        cell *row = t.row[t.n++];
        cell_set(&row[0], o->name);
        cell_set(&row[1], o->unit);
        cell_set(&row[3], "");
        if (o->type == SDM_OPTION_REAL || o->type == SDM_OPTION_INT) {
            cell_set_range(&row[2], o->min, o->max, NULL);
            cell_set_number(&row[3], o->def);
        } else if (o->type == SDM_OPTION_CHOICE) {
            cell_set(&row[2], o->choices);
            cell_set(&row[3], o->choices);
            row[3].length = (int)strcspn(o->choices, "|"); // the first choice is the default
        } else {
            cell_set(&row[2], "file");
        }
        cell_set(&row[4], o->help);
    }
    table_print(&t, "options");
    return SDM_OK;
}

/* Prints measures[n] with names of one width. */
static void print_measures(const sdm_measure *m, size_t n, int width)
{
    for (size_t i = 0; i < n; i++)
        printf("  %-*s  %-4s  %s\n", width, m[i].name, m[i].unit, m[i].help);
}

/* Prints the measures that --measure prints: the shape's own, then those of its mesh. */
static void print_all_measures(const sdm_shape *shape)
{
    int width = 8; // of the names of the mesh's measures
    for (uint32_t i = 0; i < shape->n_measures; i++) {
        const int length = (int)strlen(shape->measures[i].name);
        if (length > width) width = length;
    }
    printf("\nmeasures (--measure):\n");
    print_measures(shape->measures, shape->n_measures, width);
    print_measures(sdm_mesh_measures, SDM_MESH_MEASURES, width);
}

static void json_measures(sdm_json *j, const sdm_measure *m, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        sdm_json_open(j, NULL, '{');
        sdm_json_text(j, "name", m[i].name);
        sdm_json_text(j, "unit", m[i].unit);
        sdm_json_bool(j, "of_depth", m[i].of_depth);
        sdm_json_text(j, "help", m[i].help);
        sdm_json_close(j, '}');
    }
}

static void json_params(sdm_json *j, const sdm_param *params, const sdm_distribution *distributions,
                        size_t n)
{
    sdm_json_open(j, "parameters", '[');
    for (size_t i = 0; i < n; i++) {
        sdm_json_open(j, NULL, '{');
        const sdm_param *p = &params[i];
        sdm_json_parameter(j, p->name, p->unit, p->min, p->max, p->def);
        if (distributions) sdm_json_distribution(j, &distributions[i]);
        sdm_json_text(j, "help", p->help ? p->help : "");
        sdm_json_close(j, '}');
    }
    sdm_json_close(j, ']');
}

static void json_options(sdm_json *j, const sdm_shape *shape)
{
    sdm_json_open(j, "options", '[');
    for (uint32_t i = 0; i < shape->n_options; i++) {
        const sdm_option *o = &shape->options[i];
        sdm_json_open(j, NULL, '{');
        sdm_json_text(j, "name", o->name);
        sdm_json_text(j, "type", option_type(o));
        sdm_json_text(j, "unit", o->unit ? o->unit : "");
        if (o->type == SDM_OPTION_REAL || o->type == SDM_OPTION_INT) {
            sdm_json_real(j, "min", o->min);
            sdm_json_real(j, "max", o->max);
            sdm_json_real(j, "default", o->def);
        }
        if (o->type == SDM_OPTION_CHOICE) sdm_json_text(j, "choices", o->choices);
        sdm_json_text(j, "help", o->help ? o->help : "");
        sdm_json_close(j, '}');
    }
    sdm_json_close(j, ']');
}

typedef sdm_status (*command_function)(const cli_args *args, sdm_error *err);

static const struct {
    const char *word;
    command_function run;
} subcommands[] = {{"new", cli_shapes_new}, {"check", cli_shapes_check}, {"test", cli_shapes_test}};
enum { N_SUBCOMMANDS = sizeof subcommands / sizeof *subcommands };

/* The subcommand that the first word names; NULL: none. */
static command_function find_subcommand(const cli_args *args)
{
    for (size_t i = 0; i < N_SUBCOMMANDS && args->files.n > 0; i++)
        if (!strcmp(args->files.items[0], subcommands[i].word)) return subcommands[i].run;
    return NULL;
}

/* Fails with the subcommand that the first word is nearly; SDM_OK: it is none. */
static sdm_status suggest_subcommand(const cli_args *args, sdm_error *err)
{
    const char *names[N_SUBCOMMANDS], *word = args->files.items[0];
    for (size_t i = 0; i < N_SUBCOMMANDS; i++) names[i] = subcommands[i].word;
    const char *near = sdm_nearest_name(word, names, N_SUBCOMMANDS);
    return near ? sdm_fail(err, SDM_E_ARG,
                           "shapes: no shape and no subcommand '%.100s'; did you mean 'shapes %s'?",
                           word, near)
                : SDM_OK;
}

/* Prints the parameters and options of one shape. With -O the parameters are those of an instance
 * with these options: the parameters of some shapes depend on them. The distributions are those of
 * an instance, too; a shape that cannot be made without options is printed without them. */
static sdm_status print_shape(const cli_args *args, const sdm_registry *registry, sdm_error *err)
{
    // the shape
    const char *name = args->files.items[0];
    const char *near = NULL;
    if (!sdm_registry_find(registry, name, &near) && !near && suggest_subcommand(args, err))
        return SDM_E_ARG;
    const sdm_shape *shape = cli_find_shape(registry, name, err);
    if (!shape) return SDM_E_ARG;
    sdm_instance *instance = NULL;
    const bool asked = args->options.n > 0;
    if (asked || !shape->describe) {
        const sdm_status s =
            cli_create_shape(registry, name, &args->options, &instance, asked ? err : NULL);
        if (s && asked) return s;
    }
    size_t n = shape->n_params;
    const sdm_param *params = instance ? sdm_instance_params(instance, &n) : shape->params;
    const sdm_distribution *distributions = instance ? sdm_instance_distributions(instance) : NULL;
    // print it
    sdm_status s = SDM_OK;
    if (args->json) {
        sdm_json json = {0};
        sdm_json_open(&json, NULL, '{');
        sdm_json_text(&json, "name", shape->name);
        sdm_json_text(&json, "summary", shape->summary ? shape->summary : "");
        json_params(&json, params, distributions, n);
        json_options(&json, shape);
        sdm_json_open(&json, "measures", '[');
        json_measures(&json, shape->measures, shape->n_measures);
        json_measures(&json, sdm_mesh_measures, SDM_MESH_MEASURES);
        sdm_json_close(&json, ']');
        sdm_json_close(&json, '}');
        s = cli_print_json(&json, err);
    } else {
        printf("%s - %s\n", shape->name, shape->summary ? shape->summary : "");
        s = print_params(params, distributions, n, err);
        if (!s && !instance && shape->describe)
            printf("\nits parameters depend on its options: set them with -O\n");
        if (!s) s = print_options(shape, err);
        if (!s) print_all_measures(shape);
    }
    sdm_instance_free(instance);
    return s;
}

static sdm_status print_list(const cli_args *args, const sdm_registry *registry, sdm_error *err)
{
    const size_t n = sdm_registry_count(registry);
    if (!args->json) {
        for (size_t i = 0; i < n; i++) {
            const sdm_shape *shape = sdm_registry_at(registry, i);
            printf("%-14s %s\n", shape->name, shape->summary ? shape->summary : "");
        }
        return SDM_OK;
    }
    sdm_json json = {0};
    sdm_json_open(&json, NULL, '{');
    sdm_json_open(&json, "shapes", '[');
    for (size_t i = 0; i < n; i++) {
        const sdm_shape *shape = sdm_registry_at(registry, i);
        sdm_json_open(&json, NULL, '{');
        sdm_json_text(&json, "name", shape->name);
        sdm_json_text(&json, "summary", shape->summary ? shape->summary : "");
        sdm_json_text(&json, "origin", sdm_registry_origin(registry, i));
        json_params(&json, shape->params, NULL, shape->n_params);
        sdm_json_close(&json, '}');
    }
    sdm_json_close(&json, ']');
    sdm_json_close(&json, '}');
    return cli_print_json(&json, err);
}

/* The command line without a subcommand: `sdmgen shapes [NAME]`. */
static sdm_status check_arguments(const cli_args *args, sdm_error *err)
{
    if (args->files.n > 1 && suggest_subcommand(args, err)) return SDM_E_ARG;
    if (args->files.n > 1)
        return sdm_fail(err, SDM_E_ARG, "shapes: unexpected argument '%s'; usage: sdmgen shapes %s",
                        args->files.items[1], args->command->synopsis);
    if (args->out) return sdm_fail(err, SDM_E_ARG, "shapes: --out needs `shapes new`");
    if (args->outputs.n > 0) return sdm_fail(err, SDM_E_ARG, "shapes: -o needs `shapes check`");
    if (args->samples >= 0 || args->seed >= 0)
        return sdm_fail(err, SDM_E_ARG, "shapes: --%s needs `shapes check`",
                        args->samples >= 0 ? "samples" : "seed");
    if (args->files.n == 0 && args->options.n > 0)
        return sdm_fail(err, SDM_E_ARG, "shapes: -O needs the NAME of a shape");
    return SDM_OK;
}

sdm_status cmd_shapes(const cli_args *args, sdm_error *err)
{
    const command_function run = find_subcommand(args);
    if (run && args->files.n > 1) return run(args, err);
    sdm_registry *registry = NULL;
    sdm_status s = run ? SDM_OK : check_arguments(args, err);
    if (!s) s = cli_open_registry(args, &registry, err);
    // the word of a subcommand alone may be the name of a shape
    const bool shape = run && !s && sdm_registry_find(registry, args->files.items[0], NULL);
    if (!s && run && !shape)
        s = run(args, err);
    else if (!s)
        s = args->files.n > 0 ? print_shape(args, registry, err) : print_list(args, registry, err);
    sdm_registry_free(registry);
    return s;
}
