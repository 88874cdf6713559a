/* Parameters of which the data know only a sum or a difference. */
#include <math.h>
#include <stdio.h>

#include "fit_command.h"

/* Least correlation of two parameters that is told, in absolute value. */
#define CORRELATED 0.95
/* Weights of the two parameters whose ratio is nearer to 1 than this count as equal. */
#define EQUAL 0.1

/* Is its standard deviation that of a fitted parameter in its range? */
static bool is_fitted(const sdm_fit_result *r, size_t k) { return r->sd[k] > 0 && !r->at_bound[k]; }

/* The standard deviations of the two weigh what is well determined: x / sd(x) + y / sd(y). */
static void print_pair(const sdm_param *x, const sdm_param *y, double weight, double correlation)
{
    const bool sum = correlation < 0;
    printf("  %s and %s: only ", x->name, y->name);
    if (fabs(weight - 1) < EQUAL)
        printf("their %s", sum ? "sum" : "difference");
    else
        printf("%s %c %.2g %s", x->name, sum ? '+' : '-', weight, y->name);
    printf(" is well determined (correlation %.2f)\n", correlation);
}

void cli_fit_print_correlated(const cli_fit *f)
{
    const sdm_fit_result *r = &f->result;
    const size_t size = f->n_params + 6;
    for (size_t i = 0; i < f->n_params; i++)
        for (size_t j = i + 1; j < f->n_params; j++) {
            const double c = r->correlation[i * size + j];
            if (is_fitted(r, i) && is_fitted(r, j) && fabs(c) > CORRELATED)
                print_pair(&f->params[i], &f->params[j], r->sd[i] / r->sd[j], c);
        }
}
