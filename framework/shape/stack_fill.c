/* Fills the stack below the caller, so that a variable that is never set has a known value. */
#include "shape_internal.h"

enum { STACK_BYTES = 1 << 16 };

#if defined(__GNUC__)
__attribute__((noinline))
#endif
static uint64_t
fill_own_stack(int fill)
{
    volatile uint64_t area[STACK_BYTES / sizeof(uint64_t)];
    for (size_t i = 0; i < STACK_BYTES / sizeof(uint64_t); i++)
        area[i] = UINT64_C(0x0101010101010101) * (unsigned)fill;
    return area[0];
}

void sdm_fill_stack(int fill) { (void)fill_own_stack(fill); }
