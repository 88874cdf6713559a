/* Chooses the grid of a map: the one that --like names, or one that covers the bounding box of the
 * surface. */
#include <math.h>

#include "setup.h"

sdm_status cli_grid_for_box(const cli_args *args, const double min[3], const double max[3],
                            sdm_grid *out, sdm_error *err)
{
    if (args->like) return cli_like_grid(args, out, err);
    const double longest = fmax(max[0] - min[0], fmax(max[1] - min[1], max[2] - min[2]));
    const double margin = 0.1 * longest;
    const bool has_size = args->size[0] > 0, has_spacing = args->spacing[0] > 0;
    if (!has_spacing && !(longest > 0))
        return sdm_fail(err, SDM_E_ARG,
                        "the surface is the single point (%g, %g, %g), and there is no voxel size "
                        "that suits it: give --spacing and --size",
                        min[0], min[1], min[2]);
    // the edge of a voxel along each axis, mm
    double spacing[3];
    int64_t n[3];
    for (int i = 0; i < 3; i++)
        spacing[i] = has_spacing ? args->spacing[i] : (longest + 2 * margin) / 63;
    if (has_size &&
        !has_spacing) { // the smallest uniform spacing with which the grid covers the box
        double need = 0;
        for (int i = 0; i < 3; i++)
            need = fmax(need, (max[i] - min[i] + 2 * margin) /
                                  (double)(args->size[i] > 1 ? args->size[i] - 1 : 1));
        for (int i = 0; i < 3; i++) spacing[i] = need;
    }
    // how many voxels cover the box along each axis
    for (int i = 0; i < 3; i++) {
        const double cells = (max[i] - min[i] + 2 * margin) / spacing[i];
        if (!has_size && !(cells < 1048576))
            return sdm_fail(
                err, SDM_E_ARG,
                "spacing %g mm makes over 2^20 voxels along an edge of %g mm: need a larger one",
                spacing[i], max[i] - min[i]);
        n[i] = has_size ? args->size[i] : (int64_t)ceil(cells - 1e-9) + 1;
    }
    // the centre of the first voxel
    const double centre[3] = {0.5 * (min[0] + max[0]), 0.5 * (min[1] + max[1]),
                              0.5 * (min[2] + max[2])};
    *out = sdm_grid_centred(n, spacing[0], centre);
    for (int i = 0; i < 3; i++) {
        out->spacing[i] = spacing[i];
        out->origin[i] = isfinite(args->origin[0])
                             ? args->origin[i]
                             : centre[i] - 0.5 * spacing[i] * (double)(n[i] - 1);
    }
    return sdm_grid_check(out, err);
}
