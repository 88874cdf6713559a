/* Fuzz target of a reader of images; FUZZ_ENDING is the ending of the file's name. The grid of an
 * image that is accepted is valid, and so are the layers of its segments. */
#include "fuzz_reader.h"
#include "sdm/volume.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    sdm_volume v = {0};
    sdm_error err = {0};
    const sdm_status s = sdm_volume_read(fuzz_file("fuzz" FUZZ_ENDING, data, size), &v, &err);
    fuzz_check_status(s, &err);
    if (!s) {
        const size_t n = sdm_grid_count(&v.grid) * v.n_layers;
        size_t wrong = 0;
        fuzz_require(!sdm_grid_check(&v.grid, &err));
        for (size_t i = 0; i < n; i++) wrong += !(v.values[i] - v.values[i] == 0);
        fuzz_require(wrong == v.n_nan + v.n_inf && v.min <= v.max);
        for (size_t i = 0; i < v.n_segments; i++) fuzz_require(v.segments[i].layer < v.n_layers);
    }
    sdm_volume_dispose(&v);
    return 0;
}
