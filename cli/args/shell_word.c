/* Quotes words for a shell. */
#include "shell_word.h"

#include <string.h>

void cli_add_shell_word(sdm_text *t, const char *word)
{
    static const char plain[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
                                "-_=+.,:/@%";
    if (*word && !word[strspn(word, plain)]) {
        sdm_text_add(t, "%s", word);
        return;
    }
    sdm_text_add(t, "'");
    for (; *word; word++) sdm_text_add(t, *word == '\'' ? "'\\''" : "%c", *word);
    sdm_text_add(t, "'");
}

void cli_add_next_word(sdm_text *command, const char *word)
{
    sdm_text_add(command, " ");
    cli_add_shell_word(command, word);
}
