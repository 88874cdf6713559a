/* Fuzz target of the files of statistical shape models, with right checksums: a model that is
 * accepted also passes the check of its numbers or is refused by it. */
#include <stdlib.h>

#include "fuzz_reader.h"
#include "sdm/internal/ssm.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    sdm_ssm model = {0};
    sdm_error err = {0};
    uint8_t *bytes = fuzz_copy(data, size);
    fuzz_repair_container(bytes, size);
    const sdm_status s = sdm_ssm_parse("fuzz.ssm", bytes, size, &model, &err);
    fuzz_check_status(s, &err);
    if (!s) fuzz_check_status(sdm_ssm_check("fuzz.ssm", &model, &err), &err);
    sdm_ssm_dispose(&model);
    free(bytes);
    return 0;
}
