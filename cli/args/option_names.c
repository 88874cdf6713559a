/* Texts of the library name options of C; here they become options of the command line. */
#include <ctype.h>
#include <string.h>

#include "options.h"

/* Length of the name of a structure of options with its dot at `at`, "sdm_fit_opts."; 0: none. */
static size_t structure_length(const char *at)
{
    if (strncmp(at, "sdm_", 4)) return 0;
    size_t n = 4;
    while (islower((unsigned char)at[n]) || at[n] == '_') n++;
    return at[n] == '.' && islower((unsigned char)at[n + 1]) && !strncmp(at + n - 5, "_opts", 5)
               ? n + 1
               : 0;
}

/* The option of the command line for the grid of a fit's exact maps. */
static const char GRID[] = "sdm_fit_source.grid", GRID_OPTIONS[] = "--exact --spacing";

void cli_name_options(char *text)
{
    char *to = text;
    for (const char *at = text; *at;) {
        if (!strncmp(at, GRID, sizeof GRID - 1)) {
            at += sizeof GRID - 1;
            for (const char *o = GRID_OPTIONS; *o;) *to++ = *o++;
            continue;
        }
        const size_t skip = structure_length(at);
        if (!skip) {
            *to++ = *at++;
            continue;
        }
        at += skip;
        *to++ = '-', *to++ = '-';
        for (; islower((unsigned char)*at) || *at == '_'; at++) *to++ = *at == '_' ? '-' : *at;
    }
    *to = '\0';
}
