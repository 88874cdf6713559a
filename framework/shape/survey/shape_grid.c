/* A grid around a box, in numbers that are easy to read; how far points lie beyond a grid, and how
 * much larger than a box a grid is. */
#include <math.h>

#include "sdm/internal/mesh_box.h"
#include "sdm/internal/shape_box.h"
#include "two_digits.h"

sdm_status sdm_grid_around(const double low[3], const double high[3], int voxels,
                           const double spacing[3], sdm_grid *out, sdm_error *err)
{
    double longest = 0;
    for (int i = 0; i < 3; i++) {
        if (!(low[i] <= high[i])) return sdm_fail(err, SDM_E_ARG, "the box of a grid is empty");
        longest = fmax(longest, high[i] - low[i]);
    }
    const int cells = voxels - 1 - 2 * SDM_GRID_MARGIN;
    if (!spacing && !(longest > 0 && longest < 1e9 && cells > 0))
        return sdm_fail(err, SDM_E_ARG, "a box of %g mm and %d voxels do not make a grid", longest,
                        voxels);
    sdm_grid g = {.dir = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    for (int i = 0; i < 3; i++) {
        double h = spacing ? spacing[i] : longest / cells;
        const int power = second_digit(h);
        if (!spacing) h = decimal(ceil(in_units(h, power) - 1e-9), power);
        const double count = ceil((high[i] - low[i]) / h - 1e-9) + 1 + 2 * SDM_GRID_MARGIN;
        if (!(count <= 1 << 20))
            return sdm_fail(err, SDM_E_ARG,
                            "a spacing of %g mm makes over 2^20 voxels along an edge of %g mm: "
                            "need a larger one",
                            h, high[i] - low[i]);
        const double origin = 0.5 * (low[i] + high[i] - (count - 1) * h);
        g.n[i] = (int64_t)count;
        g.spacing[i] = h;
        g.origin[i] = decimal(nearbyint(in_units(origin, power)), power);
    }
    *out = g;
    return sdm_grid_check(out, err);
}

double sdm_grid_beyond(const sdm_grid *g, const double x[3], double beyond[3][2])
{
    double index[3], most = 0;
    sdm_grid_index(g, x, index);
    for (int a = 0; a < 3; a++) {
        const double mm[2] = {-index[a] * g->spacing[a],
                              (index[a] - (double)(g->n[a] - 1)) * g->spacing[a]};
        for (int side = 0; side < 2; side++) {
            most = fmax(most, mm[side]);
            if (beyond) beyond[a][side] = fmax(beyond[a][side], mm[side]);
        }
    }
    return most;
}

double sdm_grid_mesh_beyond(const sdm_grid *g, const sdm_mesh *m, double beyond[3][2])
{
    sdm_box box = SDM_BOX_EMPTY;
    double most = 0;
    sdm_box_add_mesh(&box, m);
    for (int corner = 0; corner < 8; corner++) {
        double x[3];
        for (int a = 0; a < 3; a++) x[a] = corner >> a & 1 ? box.max[a] : box.min[a];
        most = fmax(most, sdm_grid_beyond(g, x, NULL));
    }
    if (!(most > 0)) return 0; // a grid that holds the box holds the mesh
    most = 0;
    for (size_t i = 0; i < 3 * m->n_tri; i++)
        most = fmax(most, sdm_grid_beyond(g, m->vert + 3 * (size_t)m->tri[i], beyond));
    return most;
}

double sdm_grid_surplus(const sdm_grid *g, const double low[3], const double high[3],
                        double along[3])
{
    double first[3] = {INFINITY, INFINITY, INFINITY}, last[3] = {-INFINITY, -INFINITY, -INFINITY},
           product = 1;
    for (int corner = 0; corner < 8; corner++) {
        double x[3], index[3];
        for (int a = 0; a < 3; a++) x[a] = corner >> a & 1 ? high[a] : low[a];
        sdm_grid_index(g, x, index);
        for (int a = 0; a < 3; a++) {
            first[a] = fmin(first[a], index[a]);
            last[a] = fmax(last[a], index[a]);
        }
    }
    for (int a = 0; a < 3; a++) {
        along[a] = low[a] <= high[a]
                       ? (double)g->n[a] / (last[a] - first[a] + 1 + 2 * SDM_GRID_MARGIN)
                       : NAN;
        product *= along[a];
    }
    return product;
}
