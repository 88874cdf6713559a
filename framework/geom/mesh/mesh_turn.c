/* Measures by how much the triangles of a mesh turn. */
#include "sdm/internal/mesh_turn.h"

#include <math.h>
#include <string.h>

#include "sdm/internal/mat3.h"
#include "sdm/internal/vec3.h"

/* A triangle is rigid if its edges move as a rotation moves them, up to this share of the motion.
 */
static const double RIGID = 1e-3;
/* An angle is the right one up to this share. */
static const double SAME = 5e-3;
/* Triangles that turn by less than this share of the angle count as not turning. */
static const double STILL = 1e-3;

/* Adds the edge to the sums of turn_of(): a rotation by the angle a about the unit vector u takes
 * the edge with the mean `mean` before and after to its `change` = 2 tan(a / 2) u x mean. */
static void add_edge(const double mean[3], const double change[3], double left[9], double right[3])
{
    double moment[3];
    v3_cross(mean, change, moment);
    for (int i = 0; i < 3; i++) {
        right[i] += moment[i];
        for (int k = 0; k < 3; k++)
            left[3 * i + k] += (i == k ? v3_dot(mean, mean) : 0) - mean[i] * mean[k];
    }
}

/* The angle by which triangle t turns, rad; -1: its edges change their lengths or angles. */
static double turn_of(const sdm_mesh *from, const sdm_mesh *to, size_t t)
{
    const uint32_t *tri = from->tri + 3 * t;
    double mean[2][3], change[2][3], left[9] = {0}, right[3] = {0}, inverse[9], turn[3];
    double moved = 0, missed = 0;
    for (int e = 0; e < 2; e++) {
        double a[3], b[3];
        v3_sub(from->vert + 3 * (size_t)tri[e + 1], from->vert + 3 * (size_t)tri[0], a);
        v3_sub(to->vert + 3 * (size_t)tri[e + 1], to->vert + 3 * (size_t)tri[0], b);
        for (int i = 0; i < 3; i++) mean[e][i] = 0.5 * (a[i] + b[i]), change[e][i] = b[i] - a[i];
        add_edge(mean[e], change[e], left, right);
    }
    if (!(m3_inverse(left, inverse) > 0)) return -1;
    m3_apply(inverse, right, turn);
    for (int e = 0; e < 2; e++) {
        double rigid[3];
        v3_cross(turn, mean[e], rigid);
        moved += v3_dot(change[e], change[e]);
        missed += v3_dist2(rigid, change[e]);
    }
    return missed <= RIGID * RIGID * moved ? 2 * atan(0.5 * v3_norm(turn)) : -1;
}

double sdm_mesh_turned(const sdm_mesh *from, const sdm_mesh *to, double angle, size_t *vertex)
{
    double all = 0, same = 0;
    if (from->n_vert != to->n_vert || from->n_tri != to->n_tri ||
        (from->n_tri && memcmp(from->tri, to->tri, 3 * from->n_tri * sizeof *from->tri) != 0))
        return 0;
    for (size_t t = 0; t < from->n_tri; t++) {
        const uint32_t *tri = from->tri + 3 * t;
        const double turn = turn_of(from, to, t);
        double normal[3];
        if (!(turn > STILL * angle)) continue;
        v3_triangle_normal(from->vert + 3 * (size_t)tri[0], from->vert + 3 * (size_t)tri[1],
                           from->vert + 3 * (size_t)tri[2], normal);
        const double area = v3_norm(normal);
        all += area;
        if (!(fabs(turn - angle) <= SAME * angle)) continue;
        if (same <= 0) *vertex = tri[0];
        same += area;
    }
    return all > 0 ? same / all : 0;
}
