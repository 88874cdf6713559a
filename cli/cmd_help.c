/* sdmgen help: prints the help texts, a manual page or a completion script. */
#include <string.h>

#include "args/help.h"
#include "commands.h"
#include "report/terminal.h"

static void add_completion(const char *shell, sdm_text *out)
{
    if (!strcmp(shell, "bash"))
        cli_complete_bash(out);
    else if (!strcmp(shell, "zsh"))
        cli_complete_zsh(out);
    else
        cli_complete_fish(out);
}

sdm_status cmd_help(const cli_args *args, sdm_error *err)
{
    sdm_text text = {0};
    const bool one = args->files.n == 1;
    const cli_command *command = one ? cli_find_command(args->files.items[0], err) : NULL;
    if (one && !command) return SDM_E_ARG;
    if (args->man && command)
        cli_man_command(command, &text);
    else if (args->man)
        cli_man(&text);
    else if (command)
        cli_help_command(command, &text);
    else if (args->completion)
        add_completion(args->completion, &text);
    else if (args->markdown)
        cli_help_markdown(&text);
    else
        cli_help_all(&text);
    return cli_print_text(&text, err);
}
