/* Fuzz target of tables of points (.csv): the coordinates of points that are accepted are finite,
 * and each point has the number of its line. */
#include <math.h>

#include "fuzz_reader.h"
#include "inputs/points_file.h"
#include "sdm/memory.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    double *x = NULL;
    size_t n = 0, *lines = NULL;
    sdm_error err = {0};
    const sdm_status s = cli_read_points(fuzz_file("fuzz.csv", data, size), &x, &lines, &n, &err);
    fuzz_check_status(s, &err);
    fuzz_require((s == SDM_OK) == (x != NULL));
    for (size_t i = 0; !s && i < 3 * n; i++) fuzz_require(isfinite(x[i]));
    for (size_t i = 1; lines && i < n; i++) fuzz_require(lines[i] > lines[i - 1]);
    sdm_free(lines);
    sdm_free(x);
    return 0;
}
