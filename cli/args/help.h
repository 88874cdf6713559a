/* Help texts, made from the tables of commands and options. Each function appends to *out; a failed
 * allocation sets out->failed. */
#pragma once

#include "options.h"

void cli_help_all(sdm_text *out);                           /* text of sdmgen --help */
void cli_help_command(const cli_command *c, sdm_text *out); /* text of sdmgen COMMAND --help */
void cli_help_markdown(sdm_text *out);                      /* reference in docs/command-line.md */

void cli_man(sdm_text *out);                               /* manual page sdmgen(1), in man(7) */
void cli_man_command(const cli_command *c, sdm_text *out); /* manual page sdmgen-COMMAND(1) */

void cli_complete_bash(sdm_text *out); /* completion script for bash */
void cli_complete_zsh(sdm_text *out);  /* completion script for zsh */
void cli_complete_fish(sdm_text *out); /* completion script for fish */

/* Writes the option as in --help, "-o, --output FILE", into buf and returns buf. */
const char *cli_option_form(const cli_option *o, char buf[128]);
