/* Fuzz target of containers: the sections of one that is accepted lie inside of it, and one that is
 * built of them is accepted again. The bytes are tried as they are and with right checksums. */
#include <stdlib.h>
#include <string.h>

#include "fuzz_reader.h"
#include "sdm/internal/container.h"
#include "sdm/memory.h"

typedef struct parsed {
    sdm_section sections[SDM_CONTAINER_MAX_SECTIONS];
    char names[SDM_CONTAINER_MAX_SECTIONS][24];
    size_t n;
} parsed;

static sdm_status parse(const uint8_t *bytes, size_t size, parsed *out)
{
    uint64_t checksum;
    sdm_error err = {0};
    const sdm_status s =
        sdm_container_parse(bytes, size, out->sections, out->names, &out->n, &checksum, &err);
    fuzz_check_status(s, &err);
    return s;
}

static void try(const uint8_t *bytes, size_t size)
{
    parsed first, second;
    uint8_t *built = NULL;
    size_t built_size = 0;
    if (parse(bytes, size, &first)) return;
    for (size_t i = 0; i < first.n; i++) {
        const sdm_section *s = &first.sections[i];
        const size_t at = (size_t)((const uint8_t *)s->data - bytes);
        fuzz_require(at <= size && s->size <= size - at && s->name == first.names[i]);
    }
    fuzz_require(!sdm_container_build(first.sections, first.n, &built, &built_size, NULL));
    fuzz_require(!parse(built, built_size, &second) && second.n == first.n);
    for (size_t i = 0; i < first.n; i++) {
        const sdm_section *a = &first.sections[i], *b = &second.sections[i];
        fuzz_require(!strcmp(a->name, b->name) && a->size == b->size);
        fuzz_require(!memcmp(a->data, b->data, a->size));
    }
    sdm_free(built);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    uint8_t *bytes = fuzz_copy(data, size);
    try(bytes, size);
    fuzz_repair_container(bytes, size);
    try(bytes, size);
    free(bytes);
    return 0;
}
