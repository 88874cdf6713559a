/* Wrong arguments of the sdmnn network, and damaged model files.
 * Tests: model_text.c plan.c sdmnn_build.c sdmnn_open.c sdmnn_weights.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/internal/container.h"
#include "sdm/internal/heap.h"
#include "sdmnn_toy.h"

static void wrong_arguments_are_refused(void **state)
{
    (void)state;
    static const struct {
        size_t offset, value;
        const char *says;
    } wrong[] = {{offsetof(sdm_sdmnn_arch, n_params), 0, "parameters"},
                 {offsetof(sdm_sdmnn_arch, depth), 0, "depth 0"},
                 {offsetof(sdm_sdmnn_arch, depth), 7, "depth 7"},
                 {offsetof(sdm_sdmnn_arch, depth), 5, "single voxel"},
                 {offsetof(sdm_sdmnn_arch, channels), 0, "channels"},
                 {offsetof(sdm_sdmnn_arch, channels), 513, "channels"},
                 {offsetof(sdm_sdmnn_arch, width), 0, "width"},
                 {offsetof(sdm_sdmnn_arch, block), 0, "block"},
                 {offsetof(sdm_sdmnn_arch, n), 0, "voxels"},
                 {offsetof(sdm_sdmnn_arch, n), SIZE_MAX, "voxels"}};
    sdm_error e;
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        sdm_sdmnn_arch a = ARCH;
        memcpy((char *)&a + wrong[i].offset, &wrong[i].value, sizeof(size_t));
        sdm_sdmnn *net;
        assert_int_equal(sdm_sdmnn_create(&a, 1, NULL, &net, &e), SDM_E_ARG);
        assert_null(net);
        assert_non_null(strstr(e.text, wrong[i].says));
    }
    sdm_sdmnn_arch a = ARCH;
    a.n[0] = a.n[1] = a.n[2] = 1048576;
    assert_int_equal(sdm_sdmnn_check(&a, &e), SDM_E_ARG);
    a = ARCH, a.dropout = 1;
    assert_int_equal(sdm_sdmnn_check(&a, &e), SDM_E_ARG);
    a.dropout = NAN;
    assert_int_equal(sdm_sdmnn_check(&a, &e), SDM_E_ARG);
    // Each allocation fails once.
    for (unsigned long n = 1; n <= 13; n++) {
        sdm_sdmnn *net;
        sdm_alloc_fail_after(n);
        assert_int_equal(sdm_sdmnn_create(&ARCH, 2, NULL, &net, &e),
                         n <= 12 ? SDM_E_NOMEM : SDM_OK);
        sdm_alloc_fail_after(0);
        sdm_sdmnn_free(net);
    }
}

static void damage_is_refused(void **state)
{
    (void)state;
    toy t;
    toy_make(&t, true, 0);
    uint8_t *bytes;
    size_t size;
    sdm_error e;
    sdm_model *m;
    assert_int_equal(sdm_sdmnn_build(&t.spec, &bytes, &size, NULL), SDM_OK);
    for (size_t n = 0; n < size; n += 1 + n / 7) {
        assert_int_equal(sdm_model_open_memory("cut", bytes, n, &m, &e), SDM_E_FORMAT);
        bytes[n] ^= 4;
        assert_int_equal(sdm_model_open_memory("flip", bytes, size, &m, &e), SDM_E_FORMAT);
        bytes[n] ^= 4;
    }
    // Files with right checksums, but sections of contradictory sizes.
    sdm_section sections[SDM_CONTAINER_MAX_SECTIONS], changed[SDM_CONTAINER_MAX_SECTIONS];
    char names[SDM_CONTAINER_MAX_SECTIONS][24];
    size_t n;
    uint64_t checksum;
    assert_int_equal(sdm_container_parse(bytes, size, sections, names, &n, &checksum, &e), SDM_OK);
    assert_int_equal(n, 5);
    for (size_t i = 0; i < n; i++) {
        for (int missing = 0; missing < 2; missing++) {
            if (strcmp(sections[i].name, "config") == 0) continue; // text of any length is valid
            uint8_t *other;
            size_t other_size, k = 0;
            for (size_t j = 0; j < n; j++)
                if (j != i || !missing) changed[k++] = sections[j];
            if (!missing) changed[i].size -= 2;
            assert_int_equal(sdm_container_build(changed, k, &other, &other_size, &e), SDM_OK);
            assert_int_equal(sdm_model_open_memory("wrong", other, other_size, &m, &e),
                             SDM_E_FORMAT);
            assert_non_null(strstr(e.text, "damaged"));
            sdm_free(other);
        }
    }
    // The text describes another network than the one the weights belong to.
    static const char *const lines[][2] = {
        {"sdmnn.depth=2", "sdmnn.depth=1"},       {"sdmnn.depth=2", "sdmnn.depth=6"},
        {"sdmnn.channels=4", "sdmnn.channels=5"}, {"sdmnn.width=70", "sdmnn.width=71"},
        {"sdmnn.block=3", "sdmnn.block=1"},       {"sdmnn.half=1", "sdmnn.half=0"},
        {"sdmnn.channels=4", "sdmnn.channels=0"}};
    for (size_t i = 0; i < sizeof lines / sizeof *lines; i++) {
        memcpy(changed, sections, sizeof sections);
        for (size_t j = 0; j < n; j++) {
            if (strcmp(sections[j].name, "meta")) continue;
            char text[4096];
            assert_true(sections[j].size < sizeof text);
            memcpy(text, sections[j].data, sections[j].size);
            text[sections[j].size] = '\0';
            char *at = strstr(text, lines[i][0]);
            assert_non_null(at);
            memcpy(at, lines[i][1], strlen(lines[i][1]));
            changed[j].data = text;
            uint8_t *other;
            size_t other_size;
            assert_int_equal(sdm_container_build(changed, n, &other, &other_size, &e), SDM_OK);
            assert_int_equal(sdm_model_open_memory("wrong", other, other_size, &m, &e),
                             SDM_E_FORMAT);
            assert_null(m);
            sdm_free(other);
        }
    }
    // A failed allocation is an error.
    for (unsigned long k = 1; k < 12; k++) {
        sdm_alloc_fail_after(k);
        const sdm_status s = sdm_model_open_memory("toy", bytes, size, &m, &e);
        sdm_alloc_fail_after(0);
        assert_true(s == SDM_E_NOMEM || (s == SDM_OK && k > 6));
        sdm_model_free(m);
    }
    sdm_free(bytes);
    sdm_free(t.weights);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(wrong_arguments_are_refused),
                                       cmocka_unit_test(damage_is_refused)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
