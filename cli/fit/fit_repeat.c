/* What a fit needs to be repeated: the command line, and checksums of the files that it read. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "args/shell_word.h"
#include "fit_command.h"
#include "inputs/input_checksum.h"

/* Adds a file with its checksum; no file of this name: nothing. */
static void add_file(sdm_json *j, const char *path)
{
    uint64_t crc = 0;
    char text[20];
    if (!path || cli_input_checksum(path, &crc, NULL)) return;
    snprintf(text, sizeof text, "%016" PRIx64, crc);
    sdm_json_open(j, NULL, '{');
    sdm_json_text(j, "file", path);
    sdm_json_text(j, "crc64", text);
    sdm_json_close(j, '}');
}

void cli_fit_json_repeat(const cli_fit *f, sdm_json *j)
{
    const cli_args *a = f->args;
    sdm_text command = {0};
    sdm_text_add(&command, "sdmgen");
    for (int i = 1; i < a->argc; i++) cli_add_next_word(&command, a->argv[i]);
    if (command.failed)
        j->text.failed = true;
    else
        sdm_json_text(j, "command", command.data);
    sdm_text_dispose(&command);
    sdm_json_open(j, "inputs", '[');
    add_file(j, f->model_path);
    add_file(j, f->path);
    add_file(j, a->fit.reference);
    add_file(j, a->fit.start_points);
    for (size_t i = 0; i < sdm_registry_count(f->registry); i++) { // plug-ins
        const char *origin = sdm_registry_origin(f->registry, i);
        const bool again = i > 0 && !strcmp(origin, sdm_registry_origin(f->registry, i - 1));
        if (!again) add_file(j, origin);
    }
    for (size_t i = 0; i < a->options.n; i++) { // options of shapes may name files
        const char *value = strchr(a->options.items[i], '=');
        if (value) add_file(j, value + 1);
    }
    sdm_json_close(j, ']');
}
