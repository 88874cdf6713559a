/* Parameters of a template network -> numbers g -> frames of the parts, with derivatives; points
   that are carried by them. */
#include <string.h>

#include "sdm/internal/mat3.h"
#include "sdm/internal/rotation.h"
#include "sdm/memory.h"
#include "sdm/pose.h"
#include "template_internal.h"

size_t sdm_template_numbers_scratch(const sdm_model *model)
{
    const template_network *k = model->network;
    return k->n_terms * (1 + model->info.n_params);
}

void sdm_template_numbers(const sdm_model *model, const double *p, float *scratch, double *g,
                          double *dg)
{
    const template_network *k = model->network;
    const size_t n_params = model->info.n_params, terms = k->n_terms;
    float *phi = scratch, *dphi = scratch + terms;
    double x[SDM_POD_MAX_PARAMS], unit[SDM_POD_MAX_PARAMS];
    for (size_t i = 0; i < n_params; i++) {
        const sdm_model_param *q = &model->params[i];
        unit[i] = 2 / (q->max - q->min);
        x[i] = (p[i] - q->min) * unit[i] - 1;
    }
    sdm_poly_eval(k->exponents, terms, n_params, k->degree, x, phi, dg ? dphi : NULL);
    for (size_t i = 0; i < k->n_numbers; i++) {
        const double *f = k->functions + i * terms;
        double sum = 0;
        for (size_t t = 0; t < terms; t++) sum += f[t] * (double)phi[t];
        g[i] = sum;
        for (size_t d = 0; d < n_params && dg; d++) {
            double slope = 0;
            for (size_t t = 0; t < terms; t++) slope += f[t] * (double)dphi[d * terms + t];
            dg[d * k->n_numbers + i] = slope * unit[d];
        }
    }
}

// s[9] = I + S for the stretch S of an affine frame, from its six numbers; with `unit` 0 only S
static void stretch_matrix(const double *n, double unit, double s[9])
{
    const double m[9] = {unit + n[0], n[5], n[4], n[5], unit + n[1], n[3], n[4], n[3], unit + n[2]};
    memcpy(s, m, sizeof m);
}

// m[9], b[3] = the relative frame of a part
static void relative_frame(const sdm_template_part *part, const double *g, double m[9], double b[3])
{
    const double unit[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    memcpy(m, unit, sizeof unit);
    memset(b, 0, 3 * sizeof *b);
    if (part->frame == SDM_FRAME_NONE) return;
    const double *n = g + part->numbers;
    const sdm_pose pose = {.rotation = {n[0], n[1], n[2]}};
    sdm_pose_matrix(&pose, m);
    if (part->frame == SDM_FRAME_AFFINE) {
        double s[9], r[9];
        memcpy(r, m, sizeof r);
        stretch_matrix(n + 6, 1, s);
        m3_product(r, s, m);
    }
    double turned[3];
    m3_apply(m, part->pivot, turned);
    for (int i = 0; i < 3; i++) b[i] = part->pivot[i] + n[3 + i] - turned[i];
}

void sdm_template_frames(const template_network *k, const double *g, part_pose *pose)
{
    for (size_t c = 0; c < k->n_parts; c++) {
        const sdm_template_part *part = &k->parts[c];
        part_pose *to = &pose[c];
        double m[9], b[3];
        relative_frame(part, g, m, b);
        if (part->parent >= 0) {
            const part_pose *parent = &pose[part->parent];
            m3_product(parent->m, m, to->m);
            m3_apply(parent->m, b, to->b);
            for (int i = 0; i < 3; i++) to->b[i] += parent->b[i];
        } else {
            memcpy(to->m, m, sizeof m);
            memcpy(to->b, b, sizeof b);
        }
        m3_inverse(to->m, to->inverse);
    }
}

// dm[9], db[3] = derivative of the relative frame of a part along dg
static void relative_slope(const sdm_template_part *part, const double *g, const double *dg,
                           double dm[9], double db[3])
{
    memset(dm, 0, 9 * sizeof *dm);
    memset(db, 0, 3 * sizeof *db);
    if (part->frame == SDM_FRAME_NONE) return;
    const double *n = g + part->numbers, *dn = dg + part->numbers;
    // d R = [J dw]x R with the left Jacobian J
    const sdm_pose pose = {.rotation = {n[0], n[1], n[2]}};
    double r[9], j[9], w[3], dr[9];
    sdm_pose_matrix(&pose, r);
    sdm_rotation_jacobian(n, j);
    m3_apply(j, dn, w);
    const double cross[9] = {0, -w[2], w[1], w[2], 0, -w[0], -w[1], w[0], 0};
    m3_product(cross, r, dr);
    if (part->frame == SDM_FRAME_AFFINE) {
        double s[9], ds[9], a[9], b[9];
        stretch_matrix(n + 6, 1, s);
        stretch_matrix(dn + 6, 0, ds);
        m3_product(dr, s, a);
        m3_product(r, ds, b);
        for (int i = 0; i < 9; i++) dm[i] = a[i] + b[i];
    } else {
        memcpy(dm, dr, sizeof dr);
    }
    double turned[3];
    m3_apply(dm, part->pivot, turned);
    for (int i = 0; i < 3; i++) db[i] = dn[3 + i] - turned[i];
}

void sdm_template_frames_slope(const template_network *k, const double *g, const double *dg,
                               const part_pose *pose, double (*dm)[9], double (*db)[3])
{
    for (size_t c = 0; c < k->n_parts; c++) {
        const sdm_template_part *part = &k->parts[c];
        relative_slope(part, g, dg, dm[c], db[c]);
        if (part->parent < 0) continue;
        const part_pose *parent = &pose[part->parent];
        double m[9], b[3], first[9], second[9], u[3], v[3];
        relative_frame(part, g, m, b);
        // T = T_parent . R: d m = dM m + M dm, d b = dM b + M db + dB
        m3_product(dm[part->parent], m, first);
        m3_product(parent->m, dm[c], second);
        m3_apply(dm[part->parent], b, u);
        m3_apply(parent->m, db[c], v);
        for (int i = 0; i < 9; i++) dm[c][i] = first[i] + second[i];
        for (int i = 0; i < 3; i++) db[c][i] = u[i] + v[i] + db[part->parent][i];
    }
}

sdm_status sdm_template_carry(const sdm_model *m, const double *params, const double *y, size_t n,
                              double *x, sdm_error *err)
{
    const template_network *k = m->network;
    const sdm_template_part *part = &k->parts[0];
    float *phi = NULL, *control = NULL;
    double *g = NULL;
    part_pose *pose = NULL;
    sdm_status s = SDM_ALLOC(&phi, sdm_template_numbers_scratch(m), "pose", err);
    if (!s) s = SDM_ALLOC(&g, k->n_numbers, "pose", err);
    if (!s) s = SDM_ALLOC(&pose, k->n_parts, "pose", err);
    if (!s && part->n_modes)
        s = SDM_ALLOC(&control, 4 * sdm_lattice_count(&part->warp), "pose", err);
    if (!s) {
        sdm_template_numbers(m, params, phi, g, NULL);
        sdm_template_frames(k, g, pose);
        if (part->n_modes) sdm_template_control(part, g + part->amplitudes, control);
        for (size_t i = 0; i < n; i++) {
            double u[3] = {0}, at[3];
            if (part->n_modes)
                sdm_template_displacement(&part->warp, control, y + 3 * i, u, NULL, NULL);
            for (int a = 0; a < 3; a++) at[a] = y[3 * i + (size_t)a] + u[a];
            m3_apply(pose[0].m, at, x + 3 * i);
            for (int a = 0; a < 3; a++) x[3 * i + (size_t)a] += pose[0].b[a];
        }
    }
    sdm_free(control);
    sdm_free(pose);
    sdm_free(g);
    sdm_free(phi);
    return s;
}
