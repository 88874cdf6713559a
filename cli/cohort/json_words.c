/* Replaces the escapes in the strings of JSON documents. */
#include "json_words.h"

#include <stdlib.h>
#include <string.h>

/* The character of the escape at `at`, behind its backslash; *length = characters of the escape. */
static char unescape(const char *at, size_t left, size_t *length)
{
    static const char letters[] = "bfnrt", values[] = "\b\f\n\r\t";
    *length = 1;
    if (*at == 'u') {
        char digits[5] = "";
        *length = left < 5 ? left : 5;
        memcpy(digits, at + 1, *length - 1);
        const long code = strtol(digits, NULL, 16);
        return code > 0 && code < 128 ? (char)code : '?';
    }
    const char *letter = strchr(letters, *at);
    return letter ? values[letter - letters] : *at;
}

bool cli_json_word(const sdm_json_document *d, size_t i, char *buf, size_t size)
{
    const sdm_json_value *v = &d->values[i];
    size_t n = 0, length;
    if (v->kind != '"') return false;
    for (size_t k = 0; k < v->size; k++) {
        if (n + 1 >= size) return false;
        if (v->at[k] != '\\' || k + 1 == v->size) {
            buf[n++] = v->at[k];
            continue;
        }
        buf[n++] = unescape(v->at + k + 1, v->size - k - 1, &length);
        k += length;
    }
    buf[n] = '\0';
    return true;
}
