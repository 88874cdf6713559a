/* Words of commands that users copy into a shell. */
#pragma once

#include "sdm/internal/text.h"

/* Appends a word in the form in which a shell reads it back: in single quotes if it is empty or
 * holds other characters than letters, digits and "-_=+.,:/@%". */
void cli_add_shell_word(sdm_text *t, const char *word);

/* Appends a space and the word to a command. */
void cli_add_next_word(sdm_text *command, const char *word);
