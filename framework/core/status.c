/* Names of status codes, formatting of error messages. */
#include "sdm/status.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

sdm_status sdm_fail(sdm_error *err, sdm_status status, const char *fmt, ...)
{
    if (!err) return status;
    err->status = status;
    va_list args;
    va_start(args, fmt);
    if (vsnprintf(err->text, sizeof err->text, fmt, args) < 0) err->text[0] = '\0';
    va_end(args);
    return status;
}

sdm_status sdm_fail_in(sdm_error *err, sdm_status status, const char *fmt, ...)
{
    if (!err) return status;
    char prefix[512];
    va_list args;
    va_start(args, fmt);
    if (vsnprintf(prefix, sizeof prefix, fmt, args) < 0) prefix[0] = '\0';
    va_end(args);

    // move the old text right to make room for the prefix; cut its end if it does not fit
    const size_t n = strlen(prefix), room = sizeof err->text - n - 3;
    size_t old = strnlen(err->text, sizeof err->text - 1);
    if (old > room) old = room;
    memmove(err->text + n + 2, err->text, old);
    memcpy(err->text, prefix, n);
    memcpy(err->text + n, ": ", 2);
    err->text[n + 2 + old] = '\0';
    err->status = status;
    return status;
}

const char *sdm_status_name(sdm_status status)
{
    switch (status) {
    case SDM_OK:
        return "ok";
    case SDM_E_ARG:
        return "argument";
    case SDM_E_NOMEM:
        return "memory";
    case SDM_E_IO:
        return "input/output";
    case SDM_E_FORMAT:
        return "format";
    case SDM_E_CONFIG:
        return "config";
    case SDM_E_MESH:
        return "mesh";
    case SDM_E_PLUGIN:
        return "plug-in";
    case SDM_E_RANGE:
        return "range";
    case SDM_E_UNSUPPORTED:
        return "unsupported";
    case SDM_E_CANCELLED:
        return "cancelled";
    case SDM_E_QUALITY:
        return "quality";
    case SDM_E_INTERNAL:
        return "internal";
    }
    return "unknown";
}
