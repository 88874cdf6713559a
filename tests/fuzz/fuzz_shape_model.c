/* Fuzz target of the models of Statismo and Scalismo; FUZZ_ENDING is .h5 or .h5.json. A model that
 * is read has right indices. */
#include "fuzz_reader.h"
#include "ssm/import_ssm.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static cli_args args;
    sdm_ssm model = {0};
    sdm_error err = {0};
    const sdm_status s =
        cli_ssm_statismo(&args, fuzz_file("fuzz" FUZZ_ENDING, data, size), &model, &err);
    fuzz_check_status(s, &err);
    for (size_t i = 0; !s && i < 3 * model.n_tri; i++) fuzz_require(model.tri[i] < model.n_vert);
    sdm_ssm_dispose(&model);
    return 0;
}
