/* Reads the lines of metrics.jsonl for the plots of a page. */
#include <math.h>
#include <string.h>

#include "page.h"

/* The number after `key` in a line of this length; NaN if there is none, or null. */
static double find_number(const char *line, size_t length, const char *key)
{
    char text[40];
    const char *at = strstr(line, key);
    if (!at || at >= line + length) return NAN;
    at += strlen(key);
    const size_t n = strspn(at, "0123456789+-.eE");
    double value;
    if (n >= sizeof text) return NAN;
    memcpy(text, at, n);
    text[n] = '\0';
    return sdm_parse_real(text, &value) ? value : NAN;
}

static const char *find_phase(const char *line)
{
    static const char *const starts[] = {"{\"phase\": \"fit\"", "{\"phase\": \"refine\"",
                                         "{\"phase\": \"evaluate\""};
    static const char *const names[] = {"fit", "refine", "evaluate"};
    for (size_t i = 0; i < 3; i++)
        if (!strncmp(line, starts[i], strlen(starts[i]))) return names[i];
    return NULL;
}

void cli_page_history(const char *metrics, sdm_json *json)
{
    sdm_json_open(json, "history", '[');
    for (const char *line = metrics; *line;) {
        const size_t length = strcspn(line, "\n");
        const char *phase = find_phase(line);
        if (phase) {
            sdm_json_open(json, NULL, '{');
            sdm_json_text(json, "phase", phase);
            sdm_json_real(json, "step", find_number(line, length, "\"step\": "));
            sdm_json_real(json, "loss_mm2", find_number(line, length, "\"loss_mm2\": "));
            sdm_json_real(json, "heldout_mse_mm2",
                          find_number(line, length, "\"heldout_mse_mm2\": "));
            sdm_json_real(json, "seconds", find_number(line, length, "\"seconds\": "));
            sdm_json_close(json, '}');
        }
        line += length + (line[length] == '\n');
    }
    sdm_json_close(json, ']');
}
