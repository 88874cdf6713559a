/* Fuzz target of the reader of JSON: the values of a document that is accepted are in the order and
 * the nesting that its header promises. */
#include <stdlib.h>

#include "fuzz_reader.h"
#include "sdm/internal/json_read.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    sdm_json_document d = {0};
    sdm_error err = {0};
    char *text = malloc(size + 1);
    fuzz_require(text != NULL);
    for (size_t i = 0; i < size; i++) text[i] = (char)data[i];
    text[size] = '\0';
    const sdm_status s = sdm_json_parse("fuzz.json", text, size, &d, &err);
    fuzz_check_status(s, &err);
    for (size_t i = 0; !s && i < d.n; i++) {
        const sdm_json_value *v = &d.values[i];
        double number;
        fuzz_require(v->next > i && v->next <= d.n);
        fuzz_require(v->at >= text && v->at + v->size <= text + size);
        (void)sdm_json_number(&d, i, &number);
        (void)sdm_json_is(&d, i, "name");
        fuzz_require(sdm_json_member(&d, i, "name") < d.n);
    }
    sdm_json_document_dispose(&d);
    free(text);
    return 0;
}
