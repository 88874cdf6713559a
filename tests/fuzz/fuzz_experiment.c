/* Fuzz target of the reader of experiment files: a file is refused with a message, or each of its
 * rows gives a configuration. fuzz_split() says what the input holds. */
#include "fuzz_reader.h"
#include "sdm/internal/experiment.h"

static sdm_config config;

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    sdm_error err = {0};
    sdm_experiment *e = NULL;
    fuzz_texts t = fuzz_split(data, size);
    const sdm_status s = sdm_experiment_parse("fuzz.yaml", t.file, t.file_size, t.overrides,
                                              t.n_overrides, &e, &err);
    fuzz_check_status(s, &err);
    fuzz_require((s == SDM_OK) == (e != NULL));
    for (size_t row = 0; e && row < e->n_rows; row++)
        fuzz_require(!sdm_experiment_config(e, row, &config, &err));
    sdm_experiment_free(e);
    fuzz_texts_dispose(&t);
    return 0;
}
