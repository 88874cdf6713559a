/* Reads image files and prints their geometry and values as text, two lines per file, for
 * check_volume.py. */
#include <stdio.h>

#include "sdm/volume.h"

int main(int argc, char **argv)
{
    for (int f = 1; f < argc; f++) {
        sdm_volume v = {0};
        sdm_error err;
        if (sdm_volume_read(argv[f], &v, &err)) {
            fprintf(stderr, "%s\n", err.text);
            return 1;
        }
        /* number of voxels along each axis, the 3 x 4 affine map from voxel index to LPS mm row by
         * row, then the voxel type */
        const sdm_grid *g = &v.grid;
        printf("%lld %lld %lld", (long long)g->n[0], (long long)g->n[1], (long long)g->n[2]);
        for (int r = 0; r < 3; r++) {
            for (int c = 0; c < 3; c++) printf(" %.17g", g->dir[3 * r + c] * g->spacing[c]);
            printf(" %.17g", g->origin[r]);
        }
        printf(" %s\n", sdm_voxel_name(v.stored));
        const size_t n = sdm_grid_count(g);
        for (size_t i = 0; i < n; i++)
            printf("%.9g%c", (double)v.values[i], i + 1 < n ? ' ' : '\n');
        sdm_volume_dispose(&v);
    }
    return 0;
}
