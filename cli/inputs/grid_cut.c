/* Warns of a grid that cuts a shape, by the vertices of its mesh or by its map. */
#include "grid_cut.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "report/terminal.h"
#include "sdm/internal/shape_box.h"

/* beyond[axis][side]: how far the shape reaches beyond the first and the last voxel, mm; least:
 * these are lower bounds. */
static void warn(const char *where, double beyond[3][2], bool least, const char *mend)
{
    char faces[240] = "";
    for (int a = 0; a < 3; a++)
        for (int side = 0; side < 2; side++) {
            const size_t used = strlen(faces);
            if (beyond[a][side] > 0)
                snprintf(faces + used, sizeof faces - used, "%s%c%c (%s%.2g mm)", used ? ", " : "",
                         side ? '+' : '-', "xyz"[a], least ? "at least " : "", beyond[a][side]);
        }
    if (*faces)
        cli_warn("%sthe surface leaves the grid and ends open there; it reaches beyond %s; %s",
                 where, faces, mend);
}

void cli_warn_cut_shape(const sdm_grid *g, const double *vertex, size_t n, const char *mend)
{
    double beyond[3][2] = {{0}};
    for (size_t v = 0; v < n; v++) sdm_grid_beyond(g, vertex + 3 * v, beyond);
    warn("", beyond, false, mend);
}

void cli_warn_cut_map(const char *where, const sdm_grid *g, const float *values, const char *mend)
{
    double beyond[3][2] = {{0}};
    for (int a = 0; a < 3; a++)
        for (int side = 0; side < 2; side++) {
            // the voxels of one face
            const int u = (a + 1) % 3, v = (a + 2) % 3;
            int64_t at[3];
            at[a] = side ? g->n[a] - 1 : 0;
            for (at[u] = 0; at[u] < g->n[u]; at[u]++)
                for (at[v] = 0; at[v] < g->n[v]; at[v]++) {
                    const double d = (double)values[sdm_grid_voxel(g, at[0], at[1], at[2])];
                    beyond[a][side] = fmax(beyond[a][side], -d);
                }
        }
    warn(where, beyond, true, mend);
}
