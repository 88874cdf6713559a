/* Fuzz target of tables of parameters (.csv): every row that is accepted has the number of its
 * line. */
#include "fuzz_reader.h"
#include "inputs/setup.h"
#include "sdm/memory.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const sdm_param params[3] = {
        {"a", "mm", 0, 1, 0.5, ""}, {"alpha", "rad", 0, 1, 0.5, ""}, {"turns", "", 0, 3, 2.5, ""}};
    static const double base[3] = {0.5, 0.5, 2.5};
    double *values = NULL;
    int *lines = NULL;
    size_t n = 0;
    sdm_error err = {0};
    const sdm_status s = cli_read_rows(fuzz_file("fuzz.csv", data, size), params, 3, base,
                                       &(cli_list){0}, &values, &lines, &n, &err);
    fuzz_check_status(s, &err);
    fuzz_require((s == SDM_OK) == (values != NULL && n > 0));
    for (size_t i = 0; !s && i < n; i++) fuzz_require(lines[i] > (i ? lines[i - 1] : 0));
    sdm_free(values);
    sdm_free(lines);
    return 0;
}
