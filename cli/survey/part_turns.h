/* Finds where a part of a shape turns inside out, and why. */
#pragma once

#include "sdm/internal/shape_survey.h"

typedef enum cli_turn_cause {
    CLI_TURN_LENGTH,   /* its volume goes through 0: a length becomes negative */
    CLI_TURN_ORDER,    /* the triangles have other vertices there */
    CLI_TURN_VERTICES, /* its volume jumps, but the triangles stay: the vertices change places */
} cli_turn_cause;

/* A parameter that turns the part back by itself, while the others are those of the shape in which
 * it is inside out. */
typedef struct cli_turn_param {
    size_t param;
    /* The part is inside out where the parameter is above `value`; above is false: below `value`.
     */
    double value;
    bool above;
    /* Where it turns back, on the way from `value` to the end of the surveyed range. NaN: nowhere
     * that was looked at. */
    double back;
    /* Of CLI_TURN_LENGTH: beyond this value, on the other side than `above` tells, the part is
     * right also where the other parameters have the worst ends of their ranges. NaN: nowhere, or
     * not looked for: `back` is finite for one of the list. */
    double safe;
} cli_turn_param;

/* A part that is inside out in one shape of a survey and right in another. */
typedef struct cli_part_turn {
    size_t part;  /* index of the part, in all meshes */
    size_t right; /* index of the shape in which it is right */
    cli_turn_cause cause;
    cli_turn_param by[3]; /* [n] the first parameters that turn it back by themselves */
    size_t n;             /* 0: no single one does */
} cli_part_turn;

/* *out = about the first part that is inside out in shape `wrong` of the survey, of which `audit`
 * is the audit. After the time `end` of the clock, s, it looks for no further parameter and for no
 * `safe`. false: no other shape was found in which it is right. */
bool cli_find_part_turn(const sdm_instance *shape, const sdm_shape_survey *found, size_t wrong,
                        const sdm_part_audit *audit, double end, cli_part_turn *out);
