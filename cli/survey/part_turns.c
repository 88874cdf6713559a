/* Finds where a part of a shape turns inside out, by meshes between a shape in which it is right
 * and one in which it is not. */
#include "part_turns.h"

#include <string.h>

#include "report/report_audit.h"
#include "sdm/internal/config.h"

/* Shapes that are looked through for one in which the part is right; halvings of a range. */
enum { TRIED = 64, HALVINGS = 16 };

/* Has part `part` of `n` a positive volume at these parameters? */
static bool is_right(const sdm_instance *shape, const double *p, size_t n, size_t part)
{
    sdm_mesh mesh = {0};
    sdm_part_audit audit = {0};
    const bool right = !sdm_instance_mesh(shape, p, &mesh, NULL) &&
                       !sdm_part_audit_make(&mesh, SDM_AUDIT_WALLS, NULL, &audit, NULL) &&
                       audit.n == n && audit.part[part].volume > 0;
    sdm_part_audit_dispose(&audit);
    sdm_mesh_dispose(&mesh);
    return right;
}

/* out->param and out->value, from the parameters of the two shapes. */
static void find_param(const sdm_instance *shape, size_t n_params, const double *wrong,
                       const double *right, size_t n_parts, cli_part_turn *out)
{
    double p[SDM_MAX_PARAMS];
    memcpy(p, wrong, n_params * sizeof *p);
    for (out->param = 0; out->param < n_params; out->param++) {
        const size_t k = out->param;
        p[k] = right[k];
        if (right[k] != wrong[k] && is_right(shape, p, n_parts, out->part)) break;
        p[k] = wrong[k];
    }
    if (out->param == n_params) return;
    const size_t k = out->param;
    double bad = wrong[k], good = right[k];
    for (int i = 0; i < HALVINGS; i++) {
        p[k] = 0.5 * (bad + good);
        if (is_right(shape, p, n_parts, out->part))
            good = p[k];
        else
            bad = p[k];
    }
    out->value = 0.5 * (bad + good);
    out->above = bad > good;
}

bool cli_find_part_turn(const sdm_instance *shape, const sdm_shape_survey *found, size_t wrong,
                        const sdm_part_audit *audit, cli_part_turn *out)
{
    const size_t n = found->n_params, most = found->n < TRIED ? found->n : TRIED;
    *out = (cli_part_turn){.param = n};
    while (out->part < audit->n && !cli_part_inside_out(audit, out->part)) out->part++;
    if (out->part == audit->n || n > SDM_MAX_PARAMS) return false;
    while (out->right < most && !is_right(shape, found->p + out->right * n, audit->n, out->part))
        out->right++;
    if (out->right == most) return false;
    find_param(shape, n, found->p + wrong * n, found->p + out->right * n, audit->n, out);
    return true;
}
