/* Fuzz target of the reader of NumPy arrays: all values of an array that is accepted can be read.
 */
#include "fuzz_reader.h"
#include "sdm/image.h"
#include "sdm/memory.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    double *values = NULL;
    size_t shape[4], same = 0;
    int n_dim;
    sdm_error err = {0};
    const sdm_status s =
        sdm_npy_read(fuzz_file("fuzz.npy", data, size), &values, shape, &n_dim, &err);
    fuzz_check_status(s, &err);
    fuzz_require((s == SDM_OK) == (values != NULL));
    if (s) return 0;
    const size_t n = shape[0] * shape[1] * shape[2] * shape[3];
    for (size_t i = 0; i < n; i++) same += values[i] == values[i];
    fuzz_require(n_dim >= 1 && n_dim <= 4 && same <= n);
    sdm_free(values);
    return 0;
}
