/* What a function prints to stdout. */
#pragma once

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <unistd.h>

#include <cmocka.h>

/* Sends what follows on stdout to a file; *before: the stdout until now, for captured_end(). */
static inline FILE *captured_begin(int *before)
{
    FILE *file = tmpfile();
    fflush(stdout);
    *before = dup(STDOUT_FILENO);
    assert_true(file && *before >= 0 && dup2(fileno(file), STDOUT_FILENO) >= 0);
    return file;
}

/* Ends it: the file is at its beginning. The caller closes it. */
static inline void captured_end(FILE *file, int before)
{
    fflush(stdout);
    dup2(before, STDOUT_FILENO);
    close(before);
    rewind(file);
}
