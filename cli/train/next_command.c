/* Writes the command that repeats a training with changes. */
#include "next_command.h"

#include <stdio.h>
#include <string.h>

#include "args/shell_word.h"
#include "sdm/internal/text.h"

/* Appends an option and its value to a command. */
static void add_option(sdm_text *command, const char *option, const char *value)
{
    cli_add_next_word(command, option);
    cli_add_next_word(command, value);
}

/* The same with a number, which is 0 where the option was not given. */
static void add_number(sdm_text *command, const char *option, double value)
{
    char number[32];
    snprintf(number, sizeof number, "%.15g", value);
    if (value > 0) add_option(command, option, number);
}

/* Is the argument "key=value" or "key.member=value", so that the change of this key replaces it? */
static bool sets_key(const char *argument, const char *key)
{
    const size_t n = strlen(key);
    return !strncmp(argument, key, n) && (argument[n] == '=' || argument[n] == '.');
}

/* Appends the files and keys of the command line but those that `v` and the kind replace, and the
 * changes. */
static void add_changes(sdm_text *command, const cli_args *args, const sdm_verdict *v,
                        const char *kind)
{
    // a grid.size or grid.origin of the configuration cuts the shapes, or would with other voxels
    const bool grid = v->cut > 0 || !strncmp(v->key, "grid.", 5), budget = v->minutes > 0;
    char change[80];
    for (size_t i = 0; i < args->files.n; i++) {
        const char *word = args->files.items[i];
        if (!(grid && sets_key(word, "grid")) && !(v->key[0] && sets_key(word, v->key)) &&
            !(budget && sets_key(word, "train.minutes")) &&
            !(kind && sets_key(word, "network.kind")))
            cli_add_next_word(command, word);
    }
    if (grid) cli_add_next_word(command, "grid=auto");
    if (v->key[0]) {
        snprintf(change, sizeof change, "%s=%.6g", v->key, v->to);
        cli_add_next_word(command, change);
    }
    if (budget) {
        snprintf(change, sizeof change, "train.minutes=%.6g", v->minutes);
        cli_add_next_word(command, change);
    }
    if (!kind) return;
    snprintf(change, sizeof change, "network.kind=%s", kind);
    cli_add_next_word(command, change);
}

/* Appends the options of the command line, a folder beside that of the run, whose name is longer by
 * `end`, and the model of the run for a comparison. */
static void add_options(sdm_text *command, const cli_args *args, const sdm_train_report *r,
                        const char *end)
{
    const char *slash = strrchr(r->model_path, '/');
    const int length = slash ? (int)(slash - r->model_path) : 0;
    char folder[sizeof r->model_path + 8];
    snprintf(folder, sizeof folder, "%.*s%s", length, r->model_path, end);
    for (size_t i = 0; i < args->plugins.n; i++)
        add_option(command, "--plugin", args->plugins.items[i]);
    if (args->isolate) cli_add_next_word(command, "--isolate");
    add_number(command, "--isolate-seconds", args->isolate_seconds);
    add_number(command, "--isolate-memory", args->isolate_memory);
    add_number(command, "--ranks", (double)args->ranks);
    if (args->dataset) add_option(command, "--dataset", args->dataset);
    add_option(command, "--out", folder);
    add_option(command, "--compare", r->model_path);
}

bool cli_print_training(const char *begin, const cli_args *args, const sdm_train_report *r,
                        const sdm_verdict *changes, const char *kind, const char *end)
{
    sdm_text command = {0};
    add_changes(&command, args, changes, kind);
    add_options(&command, args, r, end);
    const bool whole = !command.failed;
    if (whole) printf("%ssdmgen train%s\n", begin, command.data);
    sdm_text_dispose(&command);
    return whole;
}
