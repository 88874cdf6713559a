/* Writes random closed meshes without overlap, query points and their distances by the exact engine
 * as text for check_vtk.py: a line "mesh V T P FAMILY", V lines with the coordinates of a vertex, T
 * lines with the vertices of a triangle, P lines with a point and its signed distance. */
#include <stdio.h>

#include "oracle/random_meshes.h"
#include "sdm/exact.h"

static int write_mesh(uint64_t number)
{
    enum { POINTS = 200 };
    sdm_mesh m = {0};
    sdm_exact *e = NULL;
    sdm_error err = {0};
    const random_family *f = random_mesh(&m, 2027, number);
    dice d = {2028, number, 0};
    if (f->kind != SURFACE_BOUNDARY || sdm_exact_create(&m, NULL, &e, &err)) {
        sdm_mesh_dispose(&m);
        if (err.text[0]) fprintf(stderr, "%s\n", err.text);
        return err.text[0] != 0;
    }
    printf("mesh %zu %zu %d %s\n", m.n_vert, m.n_tri, POINTS, f->name);
    for (size_t v = 0; v < m.n_vert; v++)
        printf("%.17g %.17g %.17g\n", m.vert[3 * v], m.vert[3 * v + 1], m.vert[3 * v + 2]);
    for (size_t t = 0; t < m.n_tri; t++)
        printf("%u %u %u\n", m.tri[3 * t], m.tri[3 * t + 1], m.tri[3 * t + 2]);
    for (int i = 0; i < POINTS; i++) {
        double x[3];
        random_point(&m, &d, x);
        printf("%.17g %.17g %.17g %.17g\n", x[0], x[1], x[2],
               sdm_exact_point(e, x, NULL, NULL, NULL));
    }
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);
    return 0;
}

int main(void)
{
    for (uint64_t i = 0; i < 8 * RANDOM_FAMILIES; i++)
        if (write_mesh(i)) return 1;
    return 0;
}
