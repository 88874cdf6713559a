/* Picks from a list of which only a part is looked at. */
#pragma once

#include <math.h>
#include <stddef.h>

/* The k-th pick from a list: one of `step` entries that follow each other, not always the same one,
   since points in the order of a scan or of triangles would leave stripes bare. The multiples of
   the golden ratio fill 0 .. 1 evenly. */
static inline size_t fit_pick(size_t step, size_t k)
{
    const double turn = 0.61803398874989485 * (double)k;
    return k * step + (size_t)((turn - floor(turn)) * (double)step);
}
