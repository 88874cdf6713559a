/* The value of --part. */
#pragma once

#include <stddef.h>

#include "sdm/status.h"

/* Part `part` of `of`, counted from 1. */
typedef struct cli_part {
    size_t part, of;
} cli_part;

/* Reads "I/N"; NULL: part 1 of 1. SDM_E_ARG. */
sdm_status cli_read_part(const char *text, cli_part *out, sdm_error *err);
