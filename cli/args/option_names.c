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

/* Each name of the C interface, and the option that replaces it in messages of the program. The
 * option must not be longer than the name, because the text is changed in place. */
static const char *const NAMES[][2] = {{"sdm_fit_source.grid", "--exact --spacing"},
                                       {"sdm_registry_load()", "--plugin FILE"},
                                       {"sdm_fit_opts.start_params", "-p NAME=VALUE"},
                                       {"sdm_fit_opts.kept", "--keep NAME"},
                                       {"sdm_fit_opts.keep_appearance", "--keep appearance"},
                                       {"sdm_fit_opts.max_polish_iterations", "--polish"}};

/* The pair of names that begins at `at`; NULL: none. */
static const char *const *find_name(const char *at)
{
    for (size_t i = 0; i < sizeof NAMES / sizeof *NAMES; i++)
        if (!strncmp(at, NAMES[i][0], strlen(NAMES[i][0]))) return NAMES[i];
    return NULL;
}

void cli_name_options(char *text)
{
    char *to = text;
    for (const char *at = text; *at;) {
        const char *const *name = find_name(at);
        if (name) {
            at += strlen(name[0]);
            for (const char *o = name[1]; *o;) *to++ = *o++;
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
