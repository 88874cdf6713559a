/* Carries points of the template into the world. */
#include "sdm/internal/mat3.h"
#include "sdm/memory.h"
#include "template_internal.h"

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
