/* Help texts, made from the tables of commands and options. Each function appends to *out; a failed
 * allocation sets out->failed. */
#pragma once

#include "options.h"

void cli_help_all(sdm_text *out);                           /* text of sdmgen --help */
void cli_help_command(const cli_command *c, sdm_text *out); /* text of sdmgen COMMAND --help */
void cli_help_man(sdm_text *out);                           /* the manual page, in man(7) */
void cli_help_completion(sdm_text *out);                    /* the bash completion script */
void cli_help_markdown(sdm_text *out);                      /* reference in docs/command-line.md */
