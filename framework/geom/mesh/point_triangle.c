/* Point-triangle distance in the triangle's own coordinate frame. */
#include "point_triangle.h"

#include <math.h>

#include "sdm/internal/vec3.h"

/* (*ex, *ey) = unit vector along (dx, dy), or (-1, 0) for the zero vector; returns the length. */
static double unit_direction(double dx, double dy, double *ex, double *ey)
{
    const double len = sqrt(dx * dx + dy * dy);
    *ex = len > 0 ? dx / len : -1;
    *ey = len > 0 ? dy / len : 0;
    return len;
}

void sdm_frame_build(const double a[3], const double b[3], const double c[3], sdm_frame *f)
{
    // rotate the corners so that the longest edge comes first
    const double *corner[5] = {a, b, c, a, b};
    const double l0 = v3_dist2(a, b), l1 = v3_dist2(b, c), l2 = v3_dist2(c, a);
    const int rotation = l0 >= l1 && l0 >= l2 ? 0 : l1 >= l2 ? 1 : 2;
    const double *p0 = corner[rotation], *p1 = corner[rotation + 1], *p2 = corner[rotation + 2];
    double ab[3], ac[3];
    v3_sub(p1, p0, ab);
    v3_sub(p2, p0, ac);
    const double length = v3_norm(ab);
    for (int i = 0; i < 3; i++) {
        f->a[i] = p0[i];
        f->u[i] = length > 0 ? ab[i] / length : i == 0;
    }

    // v = direction of the component of ac perpendicular to u. The part along u is projected out
    // twice (Gram-Schmidt with reorthogonalisation), so that v is orthogonal to u for needles as
    // well.
    double w[3] = {ac[0], ac[1], ac[2]};
    double cx = 0;
    for (int pass = 0; pass < 2; pass++) {
        const double along = v3_dot(w, f->u);
        cx += along;
        v3_along(w, -along, f->u, w);
    }
    const double cy = v3_norm(w);
    // a remainder below the rounding error of ac: the triangle has no area and no normal
    const int flat = !(cy > 2.3e-16 * length);
    if (flat) {
        v3_perpendicular(f->u, f->v);
    } else {
        for (int i = 0; i < 3; i++) f->v[i] = w[i] / cy;
        const double along = v3_dot(f->v, f->u);
        v3_along(f->v, -along, f->u, f->v);
        const double len = v3_norm(f->v);
        for (int i = 0; i < 3; i++) f->v[i] /= len;
    }
    v3_cross(f->u, f->v, f->n);

    // the other two edges as lines in the frame
    const double y = flat ? 0 : v3_dot(ac, f->v);
    const double x = flat ? v3_dot(ac, f->u) : cx;
    const double len1 = unit_direction(x - length, y, &f->e1x, &f->e1y);
    const double len2 = unit_direction(-x, -y, &f->e2x, &f->e2y);
    f->half[0] = 0.5 * length;
    f->half[1] = 0.5 * len1;
    f->half[2] = 0.5 * len2;
    f->kt1 = f->e1x * 0.5 * (length + x) + f->e1y * 0.5 * y;
    f->kh1 = f->e1y * length;
    f->kt2 = f->e2x * 0.5 * x + f->e2y * 0.5 * y;
    f->rotation = rotation;
    f->flat = flat;
}

double sdm_frame_height(const sdm_frame *f)
{
    // y coordinate of the third corner, (2 half[0], 0) + 2 half[1] (e1x, e1y)
    return 2 * f->half[1] * fabs(f->e1y);
}

/* A point in the coordinates of a frame: (x, y, z) along u, v, n; t_k and h_k of sdm_frame for the
 * three edges. */
typedef struct position {
    double x, y, z, t[3], h[3];
} position;

static position locate(const sdm_frame *f, const double p[3])
{
    double w[3];
    v3_sub(p, f->a, w);
    const double x = v3_dot(w, f->u), y = v3_dot(w, f->v);
    return (position){
        .x = x,
        .y = y,
        .z = v3_dot(w, f->n),
        .t = {x - f->half[0], f->e1x * x + f->e1y * y - f->kt1, f->e2x * x + f->e2y * y - f->kt2},
        .h = {-y, f->e1y * x - f->e1x * y - f->kh1, f->e2y * x - f->e2x * y}};
}

int sdm_frame_above(const sdm_frame *f, const double p[3])
{
    const position s = locate(f, p);
    return f->flat == 0 && s.h[0] <= 0 && s.h[1] <= 0 && s.h[2] <= 0 && fabs(s.t[0]) <= f->half[0];
}

double sdm_frame_distance2(const sdm_frame *f, const double p[3])
{
    const position s = locate(f, p);
    double d[3], beyond[3];
    for (int k = 0; k < 3; k++) {
        const double t = fabs(s.t[k]) - f->half[k];
        beyond[k] = t > 0 ? t : 0;
        d[k] = beyond[k] * beyond[k] + s.h[k] * s.h[k];
    }
    // p projects into the face when it lies inside all three edge lines. beyond[0] is then 0,
    // except for needles, whose edge lines nearly coincide far beyond the ends of the longest edge.
    if (s.h[0] < 0 && s.h[1] < 0 && s.h[2] < 0) return beyond[0] * beyond[0] + s.z * s.z;
    const double least = d[0] < d[1] ? d[0] : d[1];
    return (least < d[2] ? least : d[2]) + s.z * s.z;
}

double sdm_frame_closest(const sdm_frame *f, const double p[3], double q[3], int *feature)
{
    const position s = locate(f, p);
    const int turn = (int)f->rotation;
    const double ex[3] = {1, f->e1x, f->e2x}, ey[3] = {0, f->e1y, f->e2y};
    double best = INFINITY, x = s.x, y = s.y;
    *feature = SDM_FACE;
    if (s.h[0] < 0 && s.h[1] < 0 && s.h[2] < 0 && fabs(s.t[0]) <= f->half[0]) {
        best = 0;
    } else {
        for (int k = 0; k < 3; k++) {
            const double t = fmax(fmin(s.t[k], f->half[k]), -f->half[k]);
            const double beyond = s.t[k] - t;
            const double d = beyond * beyond + s.h[k] * s.h[k];
            if (!(d < best)) continue;
            best = d;
            // the outward normal of edge k in the plane is (ey, -ex)
            x = s.x - beyond * ex[k] - s.h[k] * ey[k];
            y = s.y - beyond * ey[k] + s.h[k] * ex[k];
            const int at = beyond > 0 ? (k + 1) % 3 : k;
            *feature = beyond != 0 ? SDM_CORNER_0 + (at + turn) % 3 : SDM_EDGE_0 + (k + turn) % 3;
        }
    }
    for (int i = 0; i < 3; i++) q[i] = f->a[i] + x * f->u[i] + y * f->v[i];
    return best + s.z * s.z;
}
