/* sdmgen help: prints the help texts, the manual page or the bash completion. */
#include "args/help.h"
#include "commands.h"
#include "report/terminal.h"

sdm_status cmd_help(const cli_args *args, sdm_error *err)
{
    sdm_text text = {0};
    const bool one = args->files.n == 1;
    const cli_command *command = one ? cli_find_command(args->files.items[0], err) : NULL;
    if (one && !command) return SDM_E_ARG;
    if (command)
        cli_help_command(command, &text);
    else if (args->man)
        cli_help_man(&text);
    else if (args->completion)
        cli_help_completion(&text);
    else if (args->markdown)
        cli_help_markdown(&text);
    else
        cli_help_all(&text);
    return cli_print_text(&text, err);
}
