/* Reads the value of --part. */
#include "part.h"

#include <stdio.h>
#include <string.h>

#include "sdm/internal/text.h"

sdm_status cli_read_part(const char *text, cli_part *out, sdm_error *err)
{
    char word[64];
    int64_t part = 1, of = 1;
    if (text) {
        snprintf(word, sizeof word, "%s", text);
        char *slash = strchr(word, '/');
        if (slash) *slash = '\0';
        if (!slash || !sdm_parse_int(word, &part) || !sdm_parse_int(slash + 1, &of) || of < 1 ||
            of > 1000000 || part < 1 || part > of)
            return sdm_fail(err, SDM_E_ARG,
                            "--part '%s': need I/N, part I of N, counted from 1: 3/5", text);
    }
    *out = (cli_part){(size_t)part, (size_t)of};
    return SDM_OK;
}
