/* sdmgen help: the texts made from the tables. */
#include <stdio.h>
#include <string.h>

#include "args/help.h"
#include "commands.h"

static sdm_status help_on(const char *name, sdm_text *text, sdm_error *err)
{
    const char *names[CLI_N_COMMANDS];
    for (size_t i = 0; i < CLI_N_COMMANDS; i++) {
        names[i] = cli_commands[i].name;
        if (strcmp(name, names[i])) continue;
        cli_help_command(&cli_commands[i], text);
        return SDM_OK;
    }
    const char *near = sdm_nearest_name(name, names, CLI_N_COMMANDS);
    if (near)
        return sdm_fail(err, SDM_E_ARG, "unknown command '%s'; did you mean '%s'?", name, near);
    return sdm_fail(err, SDM_E_ARG, "unknown command '%s'; see sdmgen --help", name);
}

sdm_status cmd_help(const cli_args *args, sdm_error *err)
{
    sdm_text text = {0};
    sdm_status s = SDM_OK;
    if (args->files.n == 1)
        s = help_on(args->files.items[0], &text, err);
    else if (args->man)
        cli_help_man(&text);
    else if (args->completion)
        cli_help_completion(&text);
    else if (args->markdown)
        cli_help_markdown(&text);
    else
        cli_help_all(&text);
    if (!s && text.failed) s = sdm_fail(err, SDM_E_NOMEM, "out of memory for the help text");
    if (!s) fputs(text.data, stdout);
    sdm_text_dispose(&text);
    return s;
}
