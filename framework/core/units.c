/* Units of length that are taken for mm by mistake. */
#include "sdm/internal/units.h"

#include <math.h>
#include <stddef.h>

const char *sdm_unit_near(double mm, double *length)
{
    static const struct {
        const char *name;
        double mm;
    } units[] = {{"m", 1000}, {"inches", 25.4}, {"cm", 10}, {"um", 1e-3}};
    const char *best = NULL;
    double least = log(2.5);
    for (size_t i = 0; i < sizeof units / sizeof *units; i++) {
        const double off = fabs(log(mm / units[i].mm));
        if (!(off < least)) continue;
        best = units[i].name, least = off;
        if (length) *length = units[i].mm;
    }
    return best;
}
