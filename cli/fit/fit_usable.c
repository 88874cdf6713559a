/* Which parameters can be used: those of which the data know only a sum or a difference, and those
 * that data of a part of the shape determine. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "fit_command.h"
#include "report/terminal.h"
#include "sdm/internal/fit_finding.h"
#include "sdm/internal/hardly_known.h"

/* Least correlation of two parameters that is told, in absolute value. */
#define CORRELATED 0.95
/* Weights of the two parameters whose ratio is nearer to 1 than this count as equal. */
#define EQUAL 0.1

/* Is its standard deviation that of a fitted parameter in its range? */
static bool is_fitted(const sdm_fit_result *r, size_t k) { return r->sd[k] > 0 && !r->at_bound[k]; }

/* Prints the combination of x and y that the data determine well: x + weight y or x - weight y.
 * weight: the standard deviation of x over that of y. */
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

/* With more parameters than this on one side, only the shorter side is named. */
enum { NAMED_MAX = 6 };

/* The names in the text of the check `covered`: from the first one on, and the length of the list.
 * NULL: it names none. */
static const char *covered_names(const cli_fit *f, size_t *length)
{
    static const char before[] = "hardly determine ";
    const sdm_fit_finding *x = sdm_fit_finding_of(&f->result.verdict, SDM_FIT_CHECK_COVERED);
    const char *at = x ? strstr(x->text, before) : NULL;
    if (!at) return NULL;
    at += strlen(before);
    *length = strcspn(at, ":");
    return at;
}

/* Is `name` one of the names, which are separated by ", " and cut at 40 bytes? */
static bool is_among(const char *name, const char *list, size_t length)
{
    const size_t own = strnlen(name, 40);
    for (const char *at = list, *end = list + length; at < end;) {
        const size_t n = strcspn(at, ",:");
        if (n == own && !strncmp(at, name, n)) return true;
        at += n + 2;
    }
    return false;
}

/* Do the data determine the parameter, by itself? */
static bool is_known(const cli_fit *f, size_t k)
{
    const sdm_fit_result *r = &f->result;
    size_t length = 0;
    const char *list = covered_names(f, &length);
    // the range alone says as much: this is the standard deviation of a uniform distribution over
    // it
    const bool vague = r->sd[k] > (f->params[k].max - f->params[k].min) / sqrt(12);
    return !r->by_prior[k] && !r->at_bound[k] && !vague &&
           !(list && is_among(f->params[k].name, list, length));
}

/* Is it known, and no part of a sum or a difference with one that is not? The standard deviation of
 * such a sum holds only as far as the other one is right. A parameter at an end of its range is
 * such a partner, too. */
static bool is_usable(const cli_fit *f, size_t k)
{
    const sdm_fit_result *r = &f->result;
    const size_t size = f->n_params + 6;
    bool usable = is_known(f, k);
    for (size_t j = 0; j < f->n_params && usable; j++)
        usable = j == k || !(r->sd[j] > 0) || is_known(f, j) ||
                 !(fabs(r->correlation[k * size + j]) > CORRELATED);
    return usable;
}

bool cli_fit_has_open(const cli_fit *f)
{
    const bool *kept = f->opts.kept;
    for (size_t k = 0; k < f->n_params && f->result.by_prior && !f->opts.keep_params; k++)
        if (f->result.by_prior[k] && !(kept && kept[k]) && strcmp(f->params[k].unit, "sd"))
            return true;
    return false;
}

bool cli_fit_knows_usable(const cli_fit *f)
{
    const sdm_fit_finding *x = sdm_fit_finding_of(&f->result.verdict, SDM_FIT_CHECK_DATA);
    size_t length = 0;
    if (f->opts.keep_params || !f->result.by_prior ||
        (!cli_fit_found(f, SDM_FIT_CHECK_COVERED, SDM_FIT_DOUBTFUL, -INFINITY) &&
         !cli_fit_has_open(f)))
        return false;
    // a list of names that its text had no room for
    if (covered_names(f, &length) && length >= SDM_FIT_NAMES_MAX - 1) return false;
    // too few points leave no value that is certain
    return !x || x->grade == SDM_FIT_PASSED ||
           (strstr(x->text, "parameters are not determined") && !strstr(x->text, " points "));
}

/* Prints the names of the parameters that can be used, or cannot. */
static void print_names(const cli_fit *f, const bool *kept, bool usable)
{
    const char *comma = "";
    for (size_t k = 0; k < f->n_params; k++) {
        if ((kept && kept[k]) || is_usable(f, k) != usable) continue;
        cli_print("%s%s", comma, f->params[k].name);
        comma = ", ";
    }
}

void cli_fit_print_usable(const cli_fit *f)
{
    const bool *kept = f->opts.kept;
    size_t n[2] = {0}; // that cannot be used, that can
    for (size_t k = 0; k < f->n_params; k++) n[is_usable(f, k)] += !(kept && kept[k]);
    const bool both = n[0] <= NAMED_MAX && n[1] <= NAMED_MAX;
    printf("  %-12s ", "use");
    if (!n[0]) {
        printf("all values, each with its +-");
    } else if (!n[1]) {
        printf("no parameter");
    } else if (both) {
        print_names(f, kept, true);
        printf("; do not use ");
        print_names(f, kept, false);
    } else if (n[1] <= n[0]) {
        printf("only ");
        print_names(f, kept, true);
    } else {
        printf("all values but ");
        print_names(f, kept, false);
    }
    printf("\n");
}

void cli_fit_json_usable(const cli_fit *f, sdm_json *json)
{
    const bool *kept = f->opts.kept;
    sdm_json_open(json, "usable", '[');
    for (size_t k = 0; k < f->n_params; k++)
        if (!(kept && kept[k]) && is_usable(f, k)) sdm_json_text(json, NULL, f->params[k].name);
    sdm_json_close(json, ']');
}
