/* Open motions: eigenvectors of the information of the pose, and finite motions along them. */
#include "open_motions.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "sdm/internal/mat3.h"
#include "sdm/internal/rotation.h"
#include "sdm/internal/vec3.h"

#define PI 3.14159265358979324
// angles (rad) of the finite motions; a shape with teeth looks the same after some angles, but not
// after all of these
#define N_ANGLES 3
static const double ANGLES[N_ANGLES] = {0.2, 0.45, 0.7};
// a motion is open, too, if its sd is larger than about this angle
#define ANGLE_MAX 0.5
// cosine of the largest angle between the axis of an open rotation and an axis of the shape's frame
// for which the latter is tried, too
#define ALIKE 0.996
// the precision that stops a motion, over that which the data have for the pose
#define STOP 1e4

void sdm_fit_eigen(size_t n, double *a, double *value, double *vector)
{
    for (size_t i = 0; i < n * n; i++) vector[i] = i % (n + 1) == 0;
    for (int sweep = 0; sweep < 30; sweep++)
        for (size_t i = 0; i < n; i++)
            for (size_t j = i + 1; j < n; j++) {
                // the rotation of rows and columns i, j that makes a[i][j] zero
                if (!(fabs(a[i * n + j]) > 0)) continue;
                const double angle = 0.5 * atan2(2 * a[i * n + j], a[j * n + j] - a[i * n + i]),
                             c = cos(angle), s = sin(angle);
                for (size_t k = 0; k < n; k++) {
                    const double x = a[i * n + k], y = a[j * n + k];
                    a[i * n + k] = c * x - s * y, a[j * n + k] = s * x + c * y;
                }
                for (size_t k = 0; k < n; k++) {
                    const double x = a[k * n + i], y = a[k * n + j];
                    a[k * n + i] = c * x - s * y, a[k * n + j] = s * x + c * y;
                    const double u = vector[i * n + k], v = vector[j * n + k];
                    vector[i * n + k] = c * u - s * v, vector[j * n + k] = s * u + c * v;
                }
            }
    for (size_t i = 0; i < n; i++) value[i] = a[i * (n + 1)];
    // sort by insertion
    for (size_t i = 1; i < n; i++)
        for (size_t j = i; j > 0 && value[j] < value[j - 1]; j--) {
            const double v = value[j];
            value[j] = value[j - 1], value[j - 1] = v;
            for (size_t k = 0; k < n; k++) {
                const double x = vector[j * n + k];
                vector[j * n + k] = vector[(j - 1) * n + k], vector[(j - 1) * n + k] = x;
            }
        }
}

// a rotation is measured in rad, a translation in units of the reach of the shape
static double unit(const fit_problem *p, size_t i) { return i < 3 ? 1 : p->extent.reach; }

void sdm_fit_move_along(const fit_state *from, const double m[6], double angle, fit_state *to)
{
    sdm_pose turn = {.rotation = {angle * m[0], angle * m[1], angle * m[2]}};
    double r[9], j[9], shift[3];
    *to = *from;
    sdm_pose_matrix(&turn, r);
    m3_product(r, from->rotation, to->rotation);
    sdm_rotation_jacobian(turn.rotation, j);
    m3_apply(j, m + 3, shift);
    for (int k = 0; k < 3; k++) to->translation[k] += angle * shift[k];
}

double sdm_fit_slope_squared(const fit_problem *p, size_t sample)
{
    const fit_samples *s = &p->samples;
    const float *shift =
        s->jacobian + s->row[sample] * s->n_columns + fit_at_translation(p->n_params);
    double sum = 0;
    for (int k = 0; k < 3; k++) sum += (double)shift[k] * (double)shift[k];
    return sum;
}

double sdm_fit_surface_motion(const fit_problem *p, const fit_state *to)
{
    double square = 0, slope = 0;
    for (size_t i = 0; i < p->samples.n; i++) {
        if (p->samples.row[i] == SIZE_MAX) continue;
        const double change =
            sdm_fit_maps_at(&p->maps, to, p->samples.world + 3 * i) - p->samples.field[i];
        square += change * change;
        slope += sdm_fit_slope_squared(p, i);
    }
    return slope > 0 ? sqrt(square / slope) : 0;
}

// whether the field stays the same along the motion m[6]
static bool is_open(const fit_problem *p, const double m[6])
{
    const double *h = p->maps.grid.spacing, voxel = fmax(h[0], fmax(h[1], h[2]));
    for (int a = 0; a < N_ANGLES; a++)
        for (int sign = -1; sign <= 1; sign += 2) {
            fit_state to;
            sdm_fit_move_along(&p->state, m, sign * ANGLES[a], &to);
            if (!(sdm_fit_surface_motion(p, &to) < FIT_MOTION_MIN * voxel)) return false;
        }
    return true;
}

/* Shapes are mostly symmetric about an axis of their own frame, while samples show the axis of an
   open rotation to some degrees alone: m turns about the axis of the frame, if this is open, too.
 */
static void snap_to_frame(const fit_problem *p, double m[6])
{
    const double turn = v3_norm(m), *r = p->state.rotation;
    if (!(turn >= v3_norm(m + 3) / p->extent.reach)) return;
    for (int a = 0; a < 3; a++) {
        const double cosine = (m[0] * r[a] + m[1] * r[3 + a] + m[2] * r[6 + a]) / turn;
        if (!(fabs(cosine) > ALIKE)) continue;
        // the arm from the axis to the origin of the shape stays as it is
        double arm[3], snapped[6];
        v3_cross(m + 3, m, arm);
        for (int k = 0; k < 3; k++) arm[k] /= turn * turn;
        for (int k = 0; k < 3; k++) snapped[k] = copysign(turn, cosine) * r[3 * k + a];
        v3_cross(snapped, arm, snapped + 3);
        if (is_open(p, snapped)) memcpy(m, snapped, sizeof snapped);
    }
}

void sdm_fit_open_motions_find(fit_problem *p)
{
    const size_t n = p->information.n_unknowns, at = fit_at_rotation(p->n_params);
    double a[36], value[6], vector[36];
    p->n_motions = 0;
    if (p->opts->keep_pose || !p->samples.n_band) return;
    for (size_t i = 0; i < 6; i++)
        for (size_t k = 0; k < 6; k++)
            a[6 * i + k] = p->information.complete[(at + i) * n + at + k] * unit(p, i) * unit(p, k);
    sdm_fit_eigen(6, a, value, vector);
    p->pose_information = value[5];
    for (size_t k = 0; k < 6; k++) {
        double m[6];
        for (size_t i = 0; i < 6; i++) m[i] = vector[6 * k + i] * unit(p, i);
        const bool weak = value[k] * ANGLE_MAX * ANGLE_MAX < p->noise_factor;
        if (!weak && !is_open(p, m)) break; // the next ones are determined even better
        memcpy(p->motion[p->n_motions++], m, sizeof m);
    }
    if (p->n_motions == 1) snap_to_frame(p, p->motion[0]);
}

// the part of a motion for which there is no prior: a motion that mostly turns follows the prior of
// the rotation
static bool is_free(const fit_problem *p, const double m[6])
{
    const double turn = v3_norm(m), shift = v3_norm(m + 3) / p->extent.reach;
    return turn >= shift ? !(p->opts->prior_rotation_sd > 0) : !(p->opts->prior_translation_sd > 0);
}

void sdm_fit_open_motions_stop(const fit_problem *p, double *a)
{
    const size_t n = p->information.n_unknowns, at = fit_at_rotation(p->n_params);
    for (size_t k = 0; k < p->n_motions; k++) {
        const double *m = p->motion[k];
        if (!is_free(p, m)) continue;
        for (size_t i = 0; i < 6; i++)
            for (size_t j = 0; j < 6; j++)
                a[(at + i) * n + at + j] += STOP * p->pose_information * m[i] / pow(unit(p, i), 2) *
                                            m[j] / pow(unit(p, j), 2);
    }
}

void sdm_fit_open_motions_spread(const fit_problem *p, double *c)
{
    const size_t n = p->n_params + 6, at = p->n_params;
    for (size_t k = 0; k < p->n_motions; k++) {
        const double *m = p->motion[k];
        if (!is_free(p, m)) continue;
        // an angle that is uniform in -pi .. pi
        for (size_t i = 0; i < 6; i++)
            for (size_t j = 0; j < 6; j++) c[(at + i) * n + at + j] += PI * PI / 3 * m[i] * m[j];
    }
}

// direction of v with a positive largest component
static void direction(const double v[3], double out[3])
{
    const double length = v3_norm(v);
    size_t most = 0;
    for (size_t k = 1; k < 3; k++)
        if (fabs(v[k]) > fabs(v[most]) * (1 + 1e-6)) most = k;
    for (int k = 0; k < 3; k++) out[k] = copysign(1, v[most]) * v[k] / length + 0.0;
}

void sdm_fit_open_motions_describe(const fit_problem *p, char *text, size_t size)
{
    size_t turns = 0, used = 0;
    double centre[3];
    *text = '\0';
    sdm_fit_to_world(&p->state, p->extent.centre, centre);
    for (size_t k = 0; k < p->n_motions; k++)
        turns += v3_norm(p->motion[k]) >= v3_norm(p->motion[k] + 3) / p->extent.reach;
    if (turns == 3 && p->n_motions == 3) {
        snprintf(text, size, "rotation about any axis through (%.3g, %.3g, %.3g) mm", centre[0],
                 centre[1], centre[2]);
        return;
    }
    for (size_t k = 0; k < p->n_motions && used < size; k++) {
        const double *m = p->motion[k];
        const bool turn = v3_norm(m) >= v3_norm(m + 3) / p->extent.reach;
        double axis[3], shift[3], arm[3], x[3];
        direction(turn ? m : m + 3, axis);
        used += (size_t)snprintf(
            text + used, size - used, "%s%s (%.3g, %.3g, %.3g)", used ? ", " : "",
            turn ? "rotation about the axis" : "translation along", axis[0], axis[1], axis[2]);
        if (!turn || used >= size) continue;
        // the point of the axis next to the middle of the shape
        v3_cross(m, m + 3, shift);
        for (int i = 0; i < 3; i++) x[i] = p->state.translation[i] + shift[i] / v3_dot(m, m);
        v3_sub(centre, x, arm);
        v3_along(x, v3_dot(arm, axis), axis, x);
        used += (size_t)snprintf(text + used, size - used, " through (%.3g, %.3g, %.3g) mm", x[0],
                                 x[1], x[2]);
    }
}
