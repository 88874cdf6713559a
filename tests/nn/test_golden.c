/* Model files of every kind, written by the program (tests/golden/README.md), and the values that
 * it computed from them: every later version reads the same files and computes the same bits.
 * Tests: model_open.c model_read.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/internal/checksum.h"
#include "sdm/internal/processor.h"
#include "sdm/memory.h"
#include "sdm/model.h"

enum { MAPS = 3 };

/* Parameters of three maps: at the beginning, a third and the whole of their ranges. */
static void choose_params(const sdm_model_info *info, double *params)
{
    for (size_t i = 0; i < MAPS * info->n_params; i++) {
        const sdm_model_param *p = &info->params[i % info->n_params];
        const double part[MAPS] = {0, 1.0 / 3, 1};
        params[i] = p->min + part[i / info->n_params] * (p->max - p->min);
    }
}

/* *crc = checksum of the three maps; value[] = their first, middle and last voxels. */
static void compute(const sdm_model *m, uint64_t *crc, float value[3 * MAPS])
{
    const sdm_model_info *info = sdm_model_get_info(m);
    const size_t n = sdm_grid_count(&info->grid);
    double *params = calloc(MAPS * info->n_params, sizeof *params);
    float *values = calloc(n, sizeof *values);
    void *scratch = NULL;
    assert_true(params && values);
    assert_int_equal(sdm_alloc(&scratch, sdm_model_scratch_bytes(m, 1), 1, "scratch", NULL), 0);
    choose_params(info, params);
    *crc = 0;
    for (size_t i = 0; i < MAPS; i++) {
        sdm_model_forward(m, params + i * info->n_params, 1, values, scratch);
        *crc = sdm_crc64(*crc, values, n * sizeof *values);
        for (size_t k = 0; k < 3; k++) value[3 * i + k] = values[k * (n - 1) / 2];
    }
    sdm_free(scratch);
    free(values);
    free(params);
}

/* Opens a model and computes its maps at a level of the instruction set, which networks choose when
 * they are opened. */
static void open_and_compute(const char *path, int level, uint64_t *crc, float value[3 * MAPS])
{
    sdm_error e = {0};
    sdm_model *m;
    sdm_processor_select(level);
    if (sdm_model_open(path, &m, &e)) fail_msg("%s", e.text);
    compute(m, crc, value);
    sdm_model_free(m);
    sdm_processor_select(-1);
}

/* Whether a file's bits are promised at this level of the instruction set: those of `template` and
 * of integer weights everywhere, those of others for the baseline of x86-64, because other
 * processors round sums of floats in another order. */
static bool promised(const char *name, int level)
{
    if (!strncmp(name, "template", 8) || !strcmp(name, "pod_i8") || !strcmp(name, "pod_fine"))
        return true;
#if defined(__x86_64__)
    return level == SDM_PROCESSOR_BASELINE;
#else
    (void)level;
    return false;
#endif
}

static void check_model(const char *name, uint64_t wanted_crc, const float wanted[3 * MAPS])
{
    char path[1024];
    float value[3 * MAPS];
    uint64_t crc = 0;
    snprintf(path, sizeof path, SDM_SOURCE_FOLDER "/tests/golden/%s.sdm", name);
    for (int level = SDM_PROCESSOR_LEVELS - 1; level >= 0; level--) {
        open_and_compute(path, level, &crc, value);
        for (size_t i = 0; i < 3 * MAPS; i++)
            if (!(fabsf(value[i] - wanted[i]) <= 1e-4f))
                fail_msg("%s, level %d: value %zu is %.9g, was %.9g", name, level, i,
                         (double)value[i], (double)wanted[i]);
        if (promised(name, level) && crc != wanted_crc)
            fail_msg("%s, level %d: other bits: %016llx", name, level, (unsigned long long)crc);
    }
}

static void models_of_every_kind_give_their_bits(void **state)
{
    (void)state;
    FILE *f = fopen(SDM_SOURCE_FOLDER "/tests/golden/values.txt", "r");
    assert_non_null(f);
    char name[64];
    unsigned long long crc;
    int n = 0;
    while (fscanf(f, "%63s %llx", name, &crc) == 2) {
        float wanted[3 * MAPS];
        for (size_t i = 0; i < 3 * MAPS; i++) assert_int_equal(fscanf(f, "%f", &wanted[i]), 1);
        check_model(name, crc, wanted);
        n++;
    }
    assert_true(n >= 8 && feof(f));
    fclose(f);
}

/* test_golden FILE...: prints the lines of values.txt. */
static int print_values(int n, char **paths)
{
    for (int i = 0; i < n; i++) {
        uint64_t crc;
        float value[3 * MAPS];
        const char *slash = strrchr(paths[i], '/'), *name = slash ? slash + 1 : paths[i];
        open_and_compute(paths[i], SDM_PROCESSOR_BASELINE, &crc, value);
        printf("%.*s %016llx", (int)strcspn(name, "."), name, (unsigned long long)crc);
        for (size_t k = 0; k < 3 * MAPS; k++) printf(" %.9g", (double)value[k]);
        putchar('\n');
    }
    return 0;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(models_of_every_kind_give_their_bits)};
    if (argc > 1) return print_values(argc - 1, argv + 1);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
