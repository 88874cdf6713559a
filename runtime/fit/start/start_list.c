/* Insertion into a short sorted list. */
#include "start_list.h"

void sdm_fit_start_insert(fit_start *list, size_t *n, size_t most, const fit_start *one)
{
    if (*n == most && !(one->log_likelihood > list[most - 1].log_likelihood)) return;
    size_t at = *n < most ? (*n)++ : most - 1;
    for (; at > 0 && list[at - 1].log_likelihood < one->log_likelihood; at--)
        list[at] = list[at - 1];
    list[at] = *one;
}
