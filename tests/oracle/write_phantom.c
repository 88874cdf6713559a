/* Writes an asymmetric test image into a folder in every image format, and prints its geometry, for
 * check_images.py. */
#include <stdio.h>

#include "io/image_phantom.h"
#include "sdm/image.h"

static int write_one(const char *folder, int mirror)
{
    static const char *const ext[] = {".nii", ".nii.gz", ".nrrd", ".mha", ".npy"};
    const sdm_grid g = phantom_grid(mirror);
    float v[PHANTOM_COUNT];
    char path[1024];
    sdm_error err;
    phantom_values(v);
    for (size_t i = 0; i < sizeof ext / sizeof *ext; i++) {
        snprintf(path, sizeof path, "%s/phantom%d%s", folder, mirror, ext[i]);
        if (sdm_image_write(path, &g, v, "a phantom", &err)) {
            fprintf(stderr, "%s\n", err.text);
            return 1;
        }
    }
    /* the geometry: number of voxels along each axis, then the 3 x 4 affine map from voxel index to
     * LPS mm, row by row */
    printf("%d %lld %lld %lld", mirror, (long long)g.n[0], (long long)g.n[1], (long long)g.n[2]);
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++) printf(" %.17g", g.dir[3 * r + c] * g.spacing[c]);
        printf(" %.17g", g.origin[r]);
    }
    printf("\n");
    return 0;
}

int main(int argc, char **argv)
{
    if (argc != 2) {
        fprintf(stderr, "usage: write_phantom FOLDER\n");
        return 2;
    }
    return write_one(argv[1], 0) || write_one(argv[1], 1);
}
