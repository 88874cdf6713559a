/* Which parts of a shape each parameter moves: shows a parameter that mesh() reads from the wrong
 * place of its array, which no other test can find. */
#pragma once

#include "sdm/internal/text.h"
#include "sdm/registry.h"

/* More parts or parameters make no table that is read. */
enum { CLI_MOVES_PARTS = 10, CLI_MOVES_PARAMS = 16 };

typedef struct cli_part_moves {
    size_t n_params, n_parts; /* n_parts 0: no table */
    /* The longest way of a vertex of the part between the ends of the range of the parameter, with
       the other parameters at their defaults, mm; NaN: there is no mesh, or it has other
       triangles. */
    double mm[CLI_MOVES_PARAMS][CLI_MOVES_PARTS];
    double range[CLI_MOVES_PARAMS]; /* length of the range, in the unit of the parameter */
} cli_part_moves;

/* range[n_params][2]: the ends of the ranges, NULL: those of the shape. Measures a shape of 2 to
   CLI_MOVES_PARTS parts, in the order of their first triangles; other shapes, and one whose default
   shape has no mesh, get no table. SDM_E_NOMEM. */
sdm_status cli_part_moves_make(const sdm_instance *shape, const double (*range)[2],
                               cli_part_moves *out, sdm_error *err);

/* Prints a heading and a line for each parameter, and a question about each length that moves a
 * part ten or a hundred times as far as it changes; nothing without a table. */
void cli_part_moves_print(const cli_part_moves *m, const sdm_param *params);

/* The member `moves`: for each parameter its name and `parts_mm`; empty without a table. */
void cli_part_moves_json(const cli_part_moves *m, const sdm_param *params, sdm_json *j);
