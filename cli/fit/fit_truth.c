/* The true parameters and the true pose of a test image, from the file of `sdmgen phantom --truth`,
 * to compare the fitted ones with. */
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "fit_command.h"
#include "sdm/internal/file.h"
#include "sdm/internal/json_read.h"
#include "sdm/internal/mat3.h"
#include "sdm/internal/shape_box.h"
#include "sdm/internal/vec3.h"
#include "sdm/memory.h"

enum { TRUTH_BYTES_MAX = 1 << 20 };

/* Beyond this angle (degrees) a rotation may lead to the same surface of a symmetric shape; it does
 * if both have this Dice coefficient, and no part of the surfaces lies farther apart than this many
 * voxels. */
#define TURNED_MIN 10.0
#define SAME_DICE 0.96
#define SAME_APART 1.5
/* Symmetries that are tried: up to this many equal turns about an axis. */
#define FOLD_MAX 8
/* An axis of symmetry goes through the origin of the frame if it is nearer to it than this part of
 * a voxel. */
#define AXIS_VOXEL 0.25

/* Degrees in a radian; variance of an angle that may be any, rad^2: pi^2 / 3. */
static const double DEGREES = 57.295779513082321, ANY_ANGLE = 3.2898681336964529,
                    PI = 3.14159265358979324;

/* Is the string at index i the name of a parameter of the shape? */
static bool is_parameter(const cli_fit *f, const sdm_json_document *d, size_t i)
{
    for (size_t k = 0; k < f->n_params; k++)
        if (sdm_json_is(d, i, f->params[k].name)) return true;
    return false;
}

/* f->truth[n_params] = the parameters of the document; those that it lacks are NaN. */
static sdm_status take_truth(cli_fit *f, const char *path, const sdm_json_document *d,
                             sdm_error *err)
{
    const size_t list = sdm_json_member(d, 0, "parameters"), shape = sdm_json_member(d, 0, "shape");
    size_t found = 0;
    if (shape && !sdm_json_is(d, shape, f->shape_name))
        return sdm_fail(err, SDM_E_ARG, "%s: the truth of another shape than '%s': %.*s", path,
                        f->shape_name, (int)d->values[shape].size, d->values[shape].at);
    for (size_t i = 0; i < f->n_params; i++) {
        const size_t at = list ? sdm_json_member(d, list, f->params[i].name) : 0;
        f->truth[i] = NAN;
        found += at && sdm_json_number(d, at, &f->truth[i]);
    }
    const size_t end = list && d->values[list].kind == '{' ? d->values[list].next : 0;
    for (size_t key = list + 1; key < end; key = d->values[key + 1].next)
        if (!is_parameter(f, d, key))
            return sdm_fail(err, SDM_E_ARG, "%s: '%s' has no parameter '%.*s'", path, f->shape_name,
                            (int)d->values[key].size, d->values[key].at);
    return found ? SDM_OK
                 : sdm_fail(err, SDM_E_FORMAT,
                            "%s: no object `parameters` with a parameter of '%s', as `sdmgen "
                            "phantom --truth` and `fit -o FILE.json` write it",
                            path, f->shape_name);
}

/* out[3] = the list of three numbers `key` of the object at index i; false: there is none. */
static bool read_three(const sdm_json_document *d, size_t i, const char *key, double out[3])
{
    const size_t list = sdm_json_member(d, i, key);
    if (!list || d->values[list].kind != '[' || d->values[list].next != list + 4) return false;
    for (size_t a = 0; a < 3; a++)
        if (!sdm_json_number(d, list + 1 + a, &out[a])) return false;
    return true;
}

/* f->truth_pose = the pose of the document, if it has one. */
static sdm_status take_pose(cli_fit *f, const char *path, const sdm_json_document *d,
                            sdm_error *err)
{
    const size_t pose = sdm_json_member(d, 0, "pose");
    if (!pose) return SDM_OK;
    f->has_truth_pose = true;
    if (!read_three(d, pose, "rotation_rad", f->truth_pose.rotation) ||
        !read_three(d, pose, "translation_mm", f->truth_pose.translation))
        return sdm_fail(err, SDM_E_FORMAT,
                        "%s: `pose` needs `rotation_rad` and `translation_mm`, three numbers each, "
                        "as `sdmgen phantom --truth` and `fit -o FILE.json` write it",
                        path);
    const sdm_status s = sdm_pose_check(&f->truth_pose, err);
    return s ? sdm_fail_in(err, s, "%s", path) : SDM_OK;
}

sdm_status cli_fit_read_truth(cli_fit *f, sdm_error *err)
{
    const char *path = f->args->fit.truth;
    uint8_t *text = NULL;
    size_t size = 0;
    sdm_json_document d = {0};
    if (!path) return SDM_OK;
    sdm_status s = sdm_file_read(path, TRUTH_BYTES_MAX, &text, &size, err);
    if (!s) s = sdm_json_parse(path, (const char *)text, size, &d, err);
    if (!s) s = SDM_ALLOC(&f->truth, f->n_params, "true parameters", err);
    if (!s) s = take_truth(f, path, &d, err);
    if (!s) s = take_pose(f, path, &d, err);
    sdm_json_document_dispose(&d);
    sdm_free(text);
    return s;
}

/* axis[3] = the axis of the world about which the data leave the rotation open. Returns the number
 * of such axes; axis is set where it is 1. */
static int open_axis(const cli_fit *f, double axis[3])
{
    const size_t n = f->n_params, size = n + 6;
    const double *c = f->result.covariance + n * (size + 1);
    double total = 0;
    size_t most = 0;
    if (!*f->result.open_motions) return 0;
    for (size_t i = 0; i < 3; i++) {
        total += c[i * (size + 1)];
        if (c[i * (size + 1)] > c[most * (size + 1)]) most = i;
    }
    // each open rotation adds ANY_ANGLE times the square of its axis
    for (size_t i = 0; i < 3; i++) axis[i] = c[most * size + i];
    const double length = v3_norm(axis);
    for (size_t i = 0; i < 3; i++) axis[i] /= length;
    return (int)lrint(total / ANY_ANGLE);
}

/* *degrees = angle between the fitted and the true rotation, without that about one open axis; NaN:
 * more are open. Returns the distance (mm) between the centres of the shape in both poses. */
static double compare_pose(const cli_fit *f, double *degrees)
{
    const sdm_pose *fitted = &f->result.pose, inverse = sdm_pose_inverse(&f->truth_pose),
                   between = sdm_pose_compose(fitted, &inverse);
    double axis[3], a[3], b[3];
    const int open = open_axis(f, axis);
    *degrees = open > 1 ? NAN : DEGREES * v3_norm(between.rotation);
    if (open == 1) {
        double r[9];
        sdm_pose_matrix(&between, r);
        m3_apply(r, axis, a);
        v3_cross(axis, a, b);
        *degrees = DEGREES * atan2(v3_norm(b), v3_dot(axis, a));
    }
    sdm_pose_apply(fitted, f->pivot, a);
    sdm_pose_apply(&f->truth_pose, f->pivot, b);
    return sqrt(v3_dist2(a, b));
}

/* The pose less the true one, over its standard deviations: sqrt(e^T C^-1 e / 6) with the
 * differences e and the covariance C of rotation and translation; about 1 where the deviations are
 * right. NaN: C is not positive definite, as that of a pose that was kept, or a motion is open: the
 * axis of an open rotation is not known exactly, so a large turn about it hides small errors. */
static double pose_in_sd(const cli_fit *f)
{
    enum { N = 6 };
    const size_t n = f->n_params, size = n + N;
    const sdm_pose inverse = sdm_pose_inverse(&f->truth_pose),
                   between = sdm_pose_compose(&f->result.pose, &inverse);
    double root[N][N], y[N], sum = 0;
    if (*f->result.open_motions) return NAN;
    for (size_t i = 0; i < N; i++) {
        y[i] = i < 3 ? between.rotation[i]
                     : f->result.pose.translation[i - 3] - f->truth_pose.translation[i - 3];
        for (size_t j = 0; j <= i; j++) {
            double c = f->result.covariance[(n + i) * size + n + j];
            for (size_t k = 0; k < j; k++) c -= root[i][k] * root[j][k];
            if (i == j && !(c > 0)) return NAN;
            root[i][j] = i == j ? sqrt(c) : c / root[j][j];
        }
        for (size_t k = 0; k < i; k++) y[i] -= root[i][k] * y[k];
        y[i] /= root[i][i];
        sum += y[i] * y[i];
    }
    return sqrt(sum / N);
}

/* *same = the fitted shape has the same surface in this pose as in its own. */
static sdm_status is_same_surface(const cli_fit *f, const sdm_pose *pose, bool *same,
                                  sdm_error *err)
{
    const size_t n = sdm_grid_count(&f->map_grid);
    const double edge = sdm_grid_coarsest(&f->map_grid);
    double both = 0, all = 0, apart = 0;
    float *turned = NULL;
    sdm_status s = SDM_ALLOC(&turned, n, "distance map", err);
    if (!s)
        s = sdm_fit_map(&f->map_source, f->result.params, pose, &f->map_grid, f->opts.n_threads,
                        turned, err);
    for (size_t i = 0; i < n && !s; i++) {
        both += f->map[i] < 0 && turned[i] < 0;
        all += (f->map[i] < 0) + (turned[i] < 0);
        if (fabs((double)f->map[i]) < edge)
            apart = fmax(apart, fabs((double)f->map[i] - (double)turned[i]));
    }
    *same = !s && 2 * both > SAME_DICE * all && apart < SAME_APART * edge;
    sdm_free(turned);
    return s;
}

/* centre[3] = middle of the volume of the fitted shape, in its frame, mm. */
static void middle_of_volume(const cli_fit *f, double centre[3])
{
    const sdm_grid *g = &f->map_grid;
    const sdm_pose inverse = sdm_pose_inverse(&f->result.pose);
    double sum[4] = {0}, world[3];
    size_t v = 0;
    for (int64_t k = 0; k < g->n[2]; k++)
        for (int64_t j = 0; j < g->n[1]; j++)
            for (int64_t i = 0; i < g->n[0]; i++)
                if (f->map[v++] < 0)
                    sum[0] += (double)i, sum[1] += (double)j, sum[2] += (double)k, sum[3]++;
    for (int a = 0; a < 3; a++) sum[a] /= fmax(sum[3], 1);
    sdm_grid_world(g, sum, world);
    sdm_pose_apply(&inverse, world, centre);
}

/* Turn by `angle` about a unit axis of the shape's frame through x. */
static sdm_pose turn_about(const double axis[3], double angle, const double x[3])
{
    sdm_pose p = {0};
    double moved[3];
    for (int a = 0; a < 3; a++) p.rotation[a] = angle * axis[a];
    sdm_pose_apply(&p, x, moved);
    for (int a = 0; a < 3; a++) p.translation[a] = x[a] - moved[a];
    return p;
}

/* *centre = the place through which an axis of symmetry goes: the origin of the frame, if the
 * middle of the volume, which voxels tell to a part of one, lies beside the axis by no more. */
static void centre_of_axis(const cli_fit *f, const double middle[3], const double axis[3],
                           double centre[3])
{
    double off[3];
    v3_cross(axis, middle, off);
    const bool origin = v3_norm(off) < AXIS_VOXEL * sdm_grid_coarsest(&f->map_grid);
    for (int a = 0; a < 3; a++) centre[a] = origin ? 0 : middle[a];
}

static size_t common_divisor(size_t a, size_t b) { return b ? common_divisor(b, a % b) : a; }

/* Turns the true pose by the k-th of n equal turns about an axis of the frame (the 13 directions to
 * the sides, edges and corners of a cube) that brings it nearest to the fitted one. Returns the
 * angle between both, degrees. */
static double turn_truth(const cli_fit *f, const double middle[3], size_t n, sdm_pose *best)
{
    cli_fit other = *f;
    double least = INFINITY;
    for (int direction = 14; direction < 27; direction++)
        for (size_t k = 1; k < n; k++) {
            double axis[3] = {direction % 3 - 1, direction / 3 % 3 - 1, direction / 9 - 1},
                   centre[3], degrees;
            const double length = v3_norm(axis);
            for (int a = 0; a < 3; a++) axis[a] /= length;
            if (common_divisor(k, n) > 1) continue;
            centre_of_axis(f, middle, axis, centre);
            const sdm_pose turn = turn_about(axis, 2 * PI * (double)k / (double)n, centre);
            other.truth_pose = sdm_pose_compose(&f->truth_pose, &turn);
            (void)compare_pose(&other, &degrees);
            if (degrees < least) least = degrees, *best = turn;
        }
    return least;
}

/* Where the pose differs from the true one by a symmetry of the fitted shape, f->truth_pose becomes
 * the true pose after this symmetry. */
static sdm_status take_symmetry(cli_fit *f, sdm_error *err)
{
    double middle[3];
    sdm_status s = SDM_OK;
    middle_of_volume(f, middle);
    for (size_t n = 2; n <= FOLD_MAX && !f->truth_same && !s; n++) {
        sdm_pose turn = {0};
        if (!(turn_truth(f, middle, n, &turn) < TURNED_MIN)) continue;
        const sdm_pose pose = sdm_pose_compose(&f->result.pose, &turn);
        s = is_same_surface(f, &pose, &f->truth_same, err);
        if (!f->truth_same) continue;
        f->truth_pose = sdm_pose_compose(&f->truth_pose, &turn);
        f->truth_turn = DEGREES * fmin(v3_norm(turn.rotation), 2 * PI - v3_norm(turn.rotation));
    }
    return s;
}

sdm_status cli_fit_compare_truth(cli_fit *f, sdm_error *err)
{
    double degrees, here[3], there[3];
    if (!f->has_truth_pose) return SDM_OK;
    (void)compare_pose(f, &degrees);
    if (!(degrees > TURNED_MIN)) return SDM_OK;
    const sdm_status s = take_symmetry(f, err);
    if (s || f->truth_same) return s;
    // another symmetry: the fitted shape, turned as the true one, about its centre
    sdm_pose pose = f->truth_pose;
    sdm_pose_apply(&f->result.pose, f->pivot, here);
    sdm_pose_apply(&pose, f->pivot, there);
    for (int a = 0; a < 3; a++) pose.translation[a] += here[a] - there[a];
    return is_same_surface(f, &pose, &f->truth_same, err);
}

double cli_fit_truth_shift(const cli_fit *f)
{
    double degrees;
    return f->has_truth_pose ? compare_pose(f, &degrees) : NAN;
}

void cli_fit_print_truth_pose(const cli_fit *f)
{
    double degrees;
    if (!f->has_truth_pose) return;
    const double shift = compare_pose(f, &degrees);
    printf("  pose         off the truth by %.3g mm at the centre of the shape", shift);
    const double sd = pose_in_sd(f);
    if (f->truth_same && !(f->truth_turn > 0))
        printf("; the same surface, turned by %.3g degrees", degrees);
    else if (isfinite(degrees))
        printf(" and %.3g degrees%s", degrees,
               *f->result.open_motions ? " between the open axis and the true one" : "");
    if (isfinite(sd) && (!f->truth_same || f->truth_turn > 0)) printf(", %.2g sd", sd);
    if (f->truth_turn > 0)
        printf(
            "; the true pose was turned by %.3g degrees first, which leaves the surface as it is",
            f->truth_turn);
    printf("\n");
}

void cli_fit_json_truth_pose(const cli_fit *f, sdm_json *j)
{
    double degrees;
    if (!f->has_truth_pose) return;
    const double shift = compare_pose(f, &degrees);
    sdm_json_open(j, "truth_pose_error", '{');
    sdm_json_real(j, "centre_mm", shift);
    sdm_json_real(j, "rotation_deg", degrees);
    sdm_json_real(j, "rms_sd", f->truth_same && !(f->truth_turn > 0) ? NAN : pose_in_sd(f));
    sdm_json_bool(j, "same_surface", f->truth_same);
    sdm_json_real(j, "symmetry_deg", f->truth_turn);
    sdm_json_close(j, '}');
}
