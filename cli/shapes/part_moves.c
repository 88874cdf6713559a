/* Which parts of a shape each parameter moves. */
#include "part_moves.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "sdm/internal/json_describe.h"
#include "sdm/internal/part_audit.h"
#include "sdm/internal/same_triangles.h"

/* Ways shorter than this part of the longest one are rounding. */
static const double ROUNDING = 1e-9;

/* A length moves a part by 10 or 100 mm for each mm to within this share where it is multiplied by
 * this number. */
static const double FACTOR_CHANCE = 0.002;

/* mm[n_parts] = the longest way of a vertex of each part from mesh a to mesh b. part_of: as in the
 * audit of a mesh with the same triangles. */
static void measure_ways(const sdm_mesh *a, const sdm_mesh *b, const uint32_t *part_of,
                         size_t n_parts, double *mm)
{
    double longest = 0;
    for (size_t k = 0; k < n_parts; k++) mm[k] = 0;
    for (size_t t = 0; t < a->n_tri; t++) {
        if (part_of[t] >= n_parts) continue;
        for (size_t c = 0; c < 3; c++) {
            const size_t v = 3 * (size_t)a->tri[3 * t + c];
            const double way =
                hypot(hypot(b->vert[v] - a->vert[v], b->vert[v + 1] - a->vert[v + 1]),
                      b->vert[v + 2] - a->vert[v + 2]);
            mm[part_of[t]] = fmax(mm[part_of[t]], way);
        }
    }
    for (size_t k = 0; k < n_parts; k++) longest = fmax(longest, mm[k]);
    for (size_t k = 0; k < n_parts; k++)
        if (mm[k] < ROUNDING * longest) mm[k] = 0;
}

sdm_status cli_part_moves_make(const sdm_instance *shape, const double (*range)[2],
                               cli_part_moves *out, sdm_error *err)
{
    sdm_mesh middle = {0}, low = {0}, high = {0};
    sdm_part_audit audit = {0};
    double p[CLI_MOVES_PARAMS];
    *out = (cli_part_moves){0};
    const sdm_param *params = sdm_instance_params(shape, &out->n_params);
    if (out->n_params > CLI_MOVES_PARAMS) return SDM_OK;
    for (size_t k = 0; k < out->n_params; k++) p[k] = params[k].def;
    if (sdm_instance_mesh(shape, p, &middle, NULL)) return SDM_OK;
    const sdm_status s = sdm_part_audit_make(&middle, 0, NULL, &audit, err);
    if (!s && audit.n > 1 && audit.n <= CLI_MOVES_PARTS) out->n_parts = audit.n;
    for (size_t k = 0; k < out->n_params && out->n_parts; k++) {
        const double ends[2] = {range ? range[k][0] : params[k].min,
                                range ? range[k][1] : params[k].max};
        out->range[k] = ends[1] - ends[0];
        p[k] = ends[0];
        bool made = !sdm_instance_mesh(shape, p, &low, NULL);
        p[k] = ends[1];
        made = made && !sdm_instance_mesh(shape, p, &high, NULL);
        p[k] = params[k].def;
        if (made && sdm_mesh_same_triangles(&low, &middle) &&
            sdm_mesh_same_triangles(&high, &middle))
            measure_ways(&low, &high, audit.part_of, out->n_parts, out->mm[k]);
        else
            for (size_t i = 0; i < out->n_parts; i++) out->mm[k][i] = NAN;
    }
    sdm_part_audit_dispose(&audit);
    sdm_mesh_dispose(&middle);
    sdm_mesh_dispose(&low);
    sdm_mesh_dispose(&high);
    return s;
}

/* Asks about the parts that a length moves ten or a hundred times as far as it changes. */
static void ask_about_factors(const cli_part_moves *m, const sdm_param *params)
{
    for (size_t k = 0; k < m->n_params; k++)
        for (int factor = 10; factor <= 100 && !strcmp(params[k].unit, "mm"); factor *= 10) {
            bool asks = false;
            for (size_t i = 0; i < m->n_parts; i++) {
                const double way = factor * m->range[k];
                if (!(fabs(m->mm[k][i] - way) < FACTOR_CHANCE * way)) continue;
                if (asks)
                    printf(", %zu", i + 1);
                else
                    printf(
                        "note     1 mm of '%s' moves vertices by %d mm, as if it were in another "
                        "unit: does mesh() multiply it by %d? See part %zu",
                        params[k].name, factor, factor, i + 1);
                asks = true;
            }
            if (asks) printf("\n");
        }
}

void cli_part_moves_print(const cli_part_moves *m, const sdm_param *params)
{
    if (!m->n_parts) return;
    int width = 4;
    for (size_t k = 0; k < m->n_params; k++)
        if ((int)strlen(params[k].name) > width) width = (int)strlen(params[k].name);
    printf(
        "moves    the longest way of a vertex of each part over the range of a parameter, mm; the "
        "parts in the order of mesh():\n         %-*s",
        width, "part");
    for (size_t i = 0; i < m->n_parts; i++) printf(" %7zu", i + 1);
    for (size_t k = 0; k < m->n_params; k++) {
        printf("\n         %-*s", width, params[k].name);
        for (size_t i = 0; i < m->n_parts; i++)
            if (isfinite(m->mm[k][i]))
                printf(" %7.3g", m->mm[k][i]);
            else
                printf(" %7s", "-");
    }
    printf("\n");
    ask_about_factors(m, params);
}

void cli_part_moves_json(const cli_part_moves *m, const sdm_param *params, sdm_json *j)
{
    sdm_json_open(j, "moves", '[');
    for (size_t k = 0; k < m->n_params && m->n_parts; k++) {
        sdm_json_open(j, NULL, '{');
        sdm_json_text(j, "parameter", params[k].name);
        sdm_json_reals(j, "parts_mm", m->mm[k], m->n_parts);
        sdm_json_close(j, '}');
    }
    sdm_json_close(j, ']');
}
