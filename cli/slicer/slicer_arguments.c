/* Translates the command line of a module into that of sdmgen. */
#include <stdio.h>
#include <string.h>

#include "sdm/internal/heap.h"
#include "slicer.h"

static void push(slicer_line *line, char *word) { line->argv[line->argc++] = word; }

/* Keeps a copy of word[length] and appends it to the line. */
static void push_copy(slicer_line *line, const char *word, size_t length)
{
    sdm_text *t = &line->words[line->n_words++];
    sdm_text_add(t, "%.*s", (int)length, word);
    push(line, t->data);
}

static void push_text(slicer_line *line, const char *word) { push_copy(line, word, strlen(word)); }

static void push_flag(slicer_line *line, const char *name)
{
    sdm_text *t = &line->words[line->n_words++];
    sdm_text_add(t, "--%s", name);
    push(line, t->data);
}

/* Slicer's regions are centre and half edges; those of sdmgen are two corners. */
static sdm_status push_region(slicer_line *line, const char *value, sdm_error *err)
{
    double v[6];
    char form[200];
    int end = 0;
    if (sscanf(value, "%lf,%lf,%lf,%lf,%lf,%lf%n", v, v + 1, v + 2, v + 3, v + 4, v + 5, &end) !=
            6 ||
        value[end])
        return sdm_fail(err, SDM_E_ARG, "--region '%s': need six numbers, centre and half edges",
                        value);
    int used = 0;
    for (int side = -1; side <= 1; side += 2)
        for (int a = 0; a < 3; a++)
            used += snprintf(form + used, sizeof form - (size_t)used, "%s%.9g", used ? "," : "",
                             v[a] + side * v[3 + a]);
    push_text(line, form);
    return SDM_OK;
}

/* One option and value for each part of a list "a=4.2; alpha=0.6". */
static void push_list(slicer_line *line, const char *name, const char *value)
{
    for (const char *at = value; *at;) {
        const size_t length = strcspn(at, ";");
        const char *from = at + strspn(at, " ");
        size_t n = (size_t)(at + length - from);
        while (n > 0 && from[n - 1] == ' ') n--;
        if (from <= at + length && n > 0) {
            push_flag(line, name);
            push_copy(line, from, n);
        }
        at += length + (at[length] == ';');
    }
}

static sdm_status push_option(slicer_line *line, const cli_option *o, char *value, sdm_error *err)
{
    if (o->kind == CLI_LIST) {
        push_list(line, o->name, value);
        return SDM_OK;
    }
    if (o->kind == CLI_CHOICE && !strcmp(value, "default")) return SDM_OK;
    push_flag(line, o->name);
    if (o->kind == CLI_REAL6) return push_region(line, value, err);
    push(line, value);
    return SDM_OK;
}

/* The files without an option, in the order of sdmgen's positional arguments. */
typedef struct positions {
    char *model, *target;
    bool labels;
} positions;

static sdm_status set_position(const slicer_module *m, const slicer_file *f, char *value,
                               positions *at, sdm_error *err)
{
    if (!strcmp(f->flag, "model")) {
        at->model = value;
        return SDM_OK;
    }
    if (at->target)
        return sdm_fail(err, SDM_E_ARG,
                        "%s: more than one of image, labels and surface: '%s', '%s'", m->name,
                        at->target, value);
    at->target = value;
    at->labels = !strcmp(f->flag, "labels");
    return SDM_OK;
}

/* Translates the argument argv[*i], and its value, which advances *i. */
static sdm_status add_argument(const slicer_module *m, int argc, char **argv, int *i,
                               slicer_line *line, positions *at, sdm_error *err)
{
    char *word = argv[*i];
    const bool is_flag = !strncmp(word, "--", 2);
    const char *name = is_flag ? word + 2 : "";
    const slicer_file *f = is_flag ? slicer_find_file(m, name, strlen(name)) : NULL;
    const cli_option *o = is_flag && !f ? cli_find_option(m->command, name, strlen(name)) : NULL;
    if ((!f && !o) || (o && o->kind == CLI_FLAG)) {
        push(line, word); // sdmgen's own check refuses a wrong one
        return SDM_OK;
    }
    if (*i + 1 >= argc) return sdm_fail(err, SDM_E_ARG, "%s needs a value", word);
    char *value = argv[++*i];
    if (!*value) return SDM_OK;
    if (!f) return push_option(line, o, value, err);
    if (!f->option) return set_position(m, f, value, at, err);
    push_flag(line, f->option);
    push(line, value);
    return SDM_OK;
}

sdm_status slicer_translate(const slicer_module *m, int argc, char **argv, slicer_line *out,
                            sdm_error *err)
{
    // a list has at most as many parts as characters, each with a flag and a value
    size_t most = 16;
    for (int i = 0; i < argc; i++) most += 2 + 2 * strlen(argv[i]);
    positions at = {0};
    bool labelled = false;
    *out = (slicer_line){0};
    sdm_status s = SDM_ALLOC(&out->argv, most, "command line", err);
    if (!s) s = SDM_ALLOC(&out->words, most, "command line", err);
    if (s) return s;
    push_text(out, "sdmgen");
    push_text(out, cli_commands[m->command].name);
    for (int i = 1; i < argc && !s; i++) {
        labelled = labelled || !strcmp(argv[i], "--label");
        s = add_argument(m, argc, argv, &i, out, &at, err);
    }
    if (at.labels && !labelled) push_text(out, "--label"), push_text(out, "1");
    if (at.model) push(out, at.model);
    if (at.target) push(out, at.target);
    push_text(out, "--progress");
    push_text(out, "slicer");
    for (size_t i = 0; i < out->n_words && !s; i++)
        if (out->words[i].failed) s = sdm_fail(err, SDM_E_NOMEM, "out of memory");
    return s;
}

void slicer_line_dispose(slicer_line *line)
{
    for (size_t i = 0; i < line->n_words; i++) sdm_text_dispose(&line->words[i]);
    sdm_free(line->words);
    sdm_free((void *)line->argv);
    *line = (slicer_line){0};
}
