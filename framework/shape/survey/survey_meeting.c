/* Finds parts that meet on the surface in some shapes of a family and not in others, and the
 * parameter that decides. */
#include "survey_meeting.h"

#include <math.h>
#include <stdlib.h>

#include "sdm/memory.h"

/* A shape with the value of a parameter. */
typedef struct entry {
    double value;
    bool meets;
} entry;

void sdm_survey_contacts(const sdm_part_audit *a, survey_contacts *out)
{
    const size_t n = a->n < SDM_PART_MEETS ? a->n : SDM_PART_MEETS;
    *out = (survey_contacts){.n = n};
    for (size_t i = 0; i < n; i++) {
        const sdm_part *p = &a->part[i];
        out->meets[i] = p->meets_outside;
        out->partly[i] = p->meets_partly;
        out->covered[i] = p->meets & ~(p->meets_outside | p->meets_partly);
        for (size_t k = 0; k < n; k++)
            if (k != i && !(p->meets >> k & 1) && !sdm_part_is_within(p, &a->part[k]) &&
                !sdm_part_is_within(&a->part[k], p))
                out->apart[i] |= (uint32_t)1 << k;
    }
}

typedef enum relation { UNKNOWN, APART, COVERED, MEET } relation;

/* How parts i and k of a shape meet. grows: their meeting grows out of a further part, so that it
 * neither joins nor splits the surface as long as this part covers a piece of it. */
static relation relation_of(const survey_contacts *c, size_t i, size_t k, bool grows)
{
    if (c->n <= k) return UNKNOWN;
    if (c->meets[i] >> k & 1) return MEET;
    if (c->partly[i] >> k & 1) return grows ? COVERED : MEET;
    if (c->covered[i] >> k & 1) return COVERED;
    return c->apart[i] >> k & 1 ? APART : UNKNOWN;
}

/* Does a further part cover the whole meeting of parts i and k in any of the shapes? */
static bool is_growing(const survey_contacts *contacts, size_t n, size_t i, size_t k)
{
    for (size_t s = 0; s < n; s++)
        if (contacts[s].n > k && contacts[s].covered[i] >> k & 1) return true;
    return false;
}

/* Counts the shapes in which parts i and k meet on the surface, and do not. */
static void count_pair(const survey_contacts *contacts, size_t n, size_t i, size_t k,
                       sdm_survey_meeting *out)
{
    *out = (sdm_survey_meeting){.part = {i, k}};
    const bool grows = is_growing(contacts, n, i, k);
    for (size_t s = n; s-- > 0;) {
        const relation r = relation_of(&contacts[s], i, k, grows);
        if (r == MEET) out->meet++, out->shape[1] = s;
        if (r == APART || r == COVERED) out->apart++, out->shape[0] = s;
    }
}

static int by_value(const void *a, const void *b)
{
    const double x = ((const entry *)a)->value, y = ((const entry *)b)->value;
    return (x > y) - (x < y);
}

/* Finds the value of parameter k that separates the n entries best; keeps it if it does so better
 * than what *out has. */
static void separate(const entry *e, size_t n, size_t k, sdm_survey_meeting *out)
{
    size_t meet = 0; // of those before the value
    for (size_t i = 0; i + 1 < n; i++) {
        meet += e[i].meets;
        if (e[i].value == e[i + 1].value) continue;
        const size_t apart = i + 1 - meet,
                     odd_below = apart + (out->meet - meet), // if they meet below the value
            odd_above = meet + (out->apart - apart),
                     odd = odd_below < odd_above ? odd_below : odd_above;
        if (odd >= out->odd) continue;
        out->odd = odd;
        out->param = k;
        out->value = 0.5 * (e[i].value + e[i + 1].value);
        out->below = odd_below < odd_above;
    }
}

/* Finds the parameter that decides whether the pair of *out meets. */
static void find_param(const survey_contacts *contacts, size_t n, const double *p, size_t n_params,
                       entry *e, sdm_survey_meeting *out)
{
    const size_t i = out->part[0], k = out->part[1];
    const bool grows = is_growing(contacts, n, i, k);
    out->odd = SIZE_MAX;
    for (size_t param = 0; param < n_params; param++) {
        size_t used = 0;
        for (size_t s = 0; s < n; s++) {
            const relation r = relation_of(&contacts[s], i, k, grows);
            if (r != UNKNOWN) e[used++] = (entry){p[s * n_params + param], r == MEET};
        }
        qsort(e, used, sizeof *e, by_value);
        separate(e, used, param, out);
    }
}

sdm_status sdm_survey_find_meeting(const survey_contacts *contacts, size_t n, const double *p,
                                   size_t n_params, sdm_survey_meeting *out, sdm_error *err)
{
    size_t pairs = 0, most = 0;
    *out = (sdm_survey_meeting){0};
    for (size_t i = 0; i < SDM_PART_MEETS; i++)
        for (size_t k = i + 1; k < SDM_PART_MEETS; k++) {
            sdm_survey_meeting m;
            count_pair(contacts, n, i, k, &m);
            const size_t fewer = m.meet < m.apart ? m.meet : m.apart;
            pairs += fewer > 0;
            if (fewer > most) most = fewer, *out = m;
        }
    out->pairs = pairs;
    if (!pairs) return SDM_OK;
    entry *e = NULL;
    const sdm_status s = SDM_ALLOC(&e, n, "parts that meet", err);
    if (!s) find_param(contacts, n, p, n_params, e, out);
    sdm_free(e);
    return s;
}
