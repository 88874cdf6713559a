/* Fuzz target of the configuration reader: every input gives either a configuration or an error
 * message with its place, and a configuration survives being dumped and read again. The input is
 * that of fuzz_split(). */
#include <string.h>

#include "fuzz_reader.h"
#include "sdm/internal/config.h"

static sdm_config config, again;

static void check_round_trip(void)
{
    sdm_text first = {0}, second = {0};
    sdm_error err;
    sdm_config_dump(&config, &first);
    fuzz_require(!first.failed);
    fuzz_require(!sdm_config_parse("dump", first.data, first.size, NULL, 0, &again, &err));
    sdm_config_dump(&again, &second);
    fuzz_require(!second.failed && strcmp(first.data, second.data) == 0);
    sdm_text_dispose(&first);
    sdm_text_dispose(&second);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    sdm_error err = {0};
    fuzz_texts t = fuzz_split(data, size);
    const sdm_status s = sdm_config_parse("fuzz.yaml", t.file, t.file_size, t.overrides,
                                          t.n_overrides, &config, &err);
    fuzz_require(s == SDM_OK || s == SDM_E_CONFIG);
    if (s)
        fuzz_require(strncmp(err.text, "fuzz.yaml:", 10) == 0 ||
                     strncmp(err.text, "argument '", 10) == 0);
    else
        check_round_trip();
    fuzz_texts_dispose(&t);
    return 0;
}
