/* Texts made from the tables of commands and options. */
#ifndef CLI_HELP_H
#define CLI_HELP_H

#include "options.h"

void cli_help_all(sdm_text *out);                           /* sdmgen --help */
void cli_help_command(const cli_command *c, sdm_text *out); /* sdmgen COMMAND --help */
void cli_help_man(sdm_text *out);                           /* man(7) source */
void cli_help_completion(sdm_text *out);                    /* bash */
void cli_help_markdown(sdm_text *out);                      /* for docs/command-line.md */

#endif
