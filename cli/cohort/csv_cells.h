/* Tables of texts in CSV files (RFC 4180): a header line with names, then a line for each row. */
#pragma once

#include <stddef.h>

#include "sdm/status.h"

/* Cells without the spaces around them; a cell in double quotes may hold commas and "" for a quote.
 * Empty lines and lines that begin with # are left out. cli_cells_dispose() frees. */
typedef struct cli_cells {
    char *text;        /* storage of the cells */
    const char **cell; /* [n_rows + 1][n_columns]; the first row is the header */
    int *line;         /* [n_rows + 1] number of the line of each row in the file, from 1 */
    size_t n_rows, n_columns;
} cli_cells;

/* Reads a table. SDM_E_FORMAT with file and line: another number of cells than in the header, a
 * quote without an end, no row. SDM_E_IO, SDM_E_NOMEM. On error *out needs no disposal. */
sdm_status cli_cells_read(const char *path, cli_cells *out, sdm_error *err);
void cli_cells_dispose(cli_cells *cells);
