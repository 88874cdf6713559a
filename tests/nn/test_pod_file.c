/* Files of the pod network: what they keep, the survey of the weights that rounds them, damaged
 * files, and allocations that fail.
 * Tests: container.c model_file.c model_open.c model_quality.c model_use.c pod_build.c pod_open.c
 * pod_quantise.c pod_survey.c
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "model_faults.h"
#include "pod/pod_survey.h"
#include "pod_toy.h"
#include "sdm/internal/container.h"

// A file with a weight that is NaN or infinite is refused, though its checksums are right.
static void weights_must_be_finite(void **state)
{
    (void)state;
    for (int type = SDM_POD_F32; type <= SDM_POD_I8; type++)
        for (int which = 0; which < 6; which++) {
            toy t;
            toy_make(&t, (sdm_pod_type)type, 0);
            (*(float *const[]){t.head, t.basis, t.layer[1]}[which / 2]) =
                which % 2 ? NAN : INFINITY;
            uint8_t *bytes;
            size_t size;
            sdm_model *m;
            sdm_error e = {0};
            assert_int_equal(sdm_pod_build(&t.spec, &bytes, &size, NULL), SDM_OK);
            assert_int_equal(sdm_model_open_memory("toy", bytes, size, &m, &e), SDM_E_FORMAT);
            assert_non_null(strstr(e.text, "is not finite"));
            assert_non_null(strstr(e.text, "of section 'pod."));
            sdm_free(bytes);
            sdm_free(t.memory);
        }
}

static void file_keeps_everything(void **state)
{
    (void)state;
    toy t;
    toy_make(&t, SDM_POD_F16, 0);
    uint8_t *bytes;
    size_t size;
    sdm_model *m;
    sdm_error e;
    assert_int_equal(sdm_pod_build(&t.spec, &bytes, &size, &e), SDM_OK);
    char path[] = "model_XXXXXX";
    close(mkstemp(path));
    assert_int_equal(sdm_container_write(path, bytes, size, &e), SDM_OK);
    assert_int_equal(sdm_model_open(path, &m, &e), SDM_OK);
    const sdm_model_info *i = sdm_model_get_info(m);
    assert_string_equal(i->shape, "toy");
    assert_string_equal(i->kind, "pod");
    assert_string_equal(i->version, SDM_VERSION_TEXT);
    assert_string_equal(i->config, "seed: 77\n");
    assert_int_equal(i->n_params, P);
    assert_string_equal(i->params[2].name, "p2");
    assert_int_equal(sdm_model_param_index(m, "p2"), 2);
    assert_int_equal(sdm_model_param_index(m, "p"), -1);
    assert_int_equal(sdm_model_param_index(m, NULL), -1);
    assert_int_equal(sdm_model_param_index(NULL, "p2"), -1);
    assert_true(i->params[2].min == -3 && i->params[2].max == 4 && i->params[2].def == 0.5);
    assert_int_equal(i->n_options, 2);
    assert_string_equal(i->option_names[1], "ear");
    assert_string_equal(i->option_values[1], "left");
    assert_memory_equal(&i->grid, &t.info.grid, sizeof i->grid);
    assert_memory_equal(&i->accuracy, &t.info.accuracy, sizeof i->accuracy);
    assert_true(i->seed == 77 && i->train_seconds == 1.25 && i->train_samples == 1234 &&
                i->file_bytes == size);
    sdm_model_free(m);
    remove(path);
    assert_int_equal(sdm_model_open(path, &m, &e), SDM_E_IO);
    assert_null(m);
    assert_int_equal(sdm_model_open(NULL, &m, &e), SDM_E_ARG);
    assert_int_equal(sdm_model_open(path, NULL, &e), SDM_E_ARG);
    sdm_free(bytes);
    sdm_free(t.memory);
}

/* Number of times that a word occurs in the bytes. */
static size_t count_word(const uint8_t *bytes, size_t size, const char *word)
{
    size_t n = 0;
    for (size_t i = 0; i + strlen(word) <= size; i++) n += !memcmp(bytes + i, word, strlen(word));
    return n;
}

// A normal distribution has a line in the description; without lines, as in files of the first
// versions, all parameters are uniform.
static void distributions_are_kept(void **state)
{
    (void)state;
    toy t;
    uint8_t *bytes;
    size_t size;
    sdm_model *m;
    sdm_error e = {0};
    for (int normal = 0; normal < 2; normal++) {
        toy_make(&t, SDM_POD_I8, 0);
        if (normal)
            t.params[1].distribution = (sdm_distribution){SDM_DISTRIBUTION_NORMAL, 0.1, 1.0 / 3};
        assert_int_equal(sdm_pod_build(&t.spec, &bytes, &size, &e), SDM_OK);
        assert_int_equal(count_word(bytes, size, "param.normal="), normal);
        assert_int_equal(sdm_model_open_memory("toy", bytes, size, &m, &e), SDM_OK);
        const sdm_model_info *i = sdm_model_get_info(m);
        for (int k = 0; k < P; k++) {
            const sdm_distribution *d = &i->params[k].distribution;
            assert_int_equal(d->kind,
                             normal && k == 1 ? SDM_DISTRIBUTION_NORMAL : SDM_DISTRIBUTION_UNIFORM);
            assert_true(d->kind == SDM_DISTRIBUTION_UNIFORM ||
                        (d->mean == 0.1 && d->deviation == 1.0 / 3));
            assert_true(i->params[k].def == 0.5);
        }
        sdm_model_free(m);
        sdm_free(bytes);
        sdm_free(t.memory);
    }
    // figures that no training writes
    const double bad[][2] = {{0, -1}, {0, 0}, {1e6, 1}, {0, 1e9}};
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        toy_make(&t, SDM_POD_F16, 0);
        t.params[2].distribution =
            (sdm_distribution){SDM_DISTRIBUTION_NORMAL, bad[k][0], bad[k][1]};
        assert_int_equal(sdm_pod_build(&t.spec, &bytes, &size, &e), SDM_OK);
        assert_int_equal(sdm_model_open_memory("toy", bytes, size, &m, &e), SDM_E_FORMAT);
        assert_non_null(
            strstr(e.text, "toy: damaged: the description lacks a valid 'param.normal'"));
        sdm_free(bytes);
        sdm_free(t.memory);
    }
}

// The survey weights coefficients by the distributions, but finds their extremes in the whole
// range. Latents 1 to 3 are sqrt(3) times the scaled parameters, in some order.
static void survey_follows_the_distributions(void **state)
{
    (void)state;
    toy t;
    survey s;
    toy_make(&t, SDM_POD_I8, 0);
    const double half = 0.5 * (t.params[1].max - t.params[1].min);
    t.params[1].distribution = (sdm_distribution){
        SDM_DISTRIBUTION_NORMAL, 0.5 * (t.params[1].max + t.params[1].min), 0.1 * half};
    assert_int_equal(sdm_pod_survey(&t.spec, &s, NULL), SDM_OK);
    const coefficient_stats *latent = s.stats + s.coefficients_at[t.spec.arch.levels.n];
    int n_uniform = 0, n_normal = 0;
    for (int k = 1; k <= P; k++) {
        // 256 samples: the relative error of a mean square is about 6 % (uniform), 9 % (normal)
        n_uniform += fabs(latent[k].square - 1) < 0.3;
        n_normal += fabs(latent[k].square - 0.03) < 0.3 * 0.03;
        assert_true(fabs(latent[k].largest - sqrt(3)) < 1e-6);
    }
    assert_true(n_uniform == P - 1 && n_normal == 1);
    sdm_pod_survey_dispose(&s);
    sdm_free(t.memory);
}

static void damage_is_refused_with(sdm_pod_type type)
{
    toy t;
    toy_make(&t, type, 0);
    uint8_t *bytes;
    size_t size;
    assert_int_equal(sdm_pod_build(&t.spec, &bytes, &size, NULL), SDM_OK);
    const size_t header = 24 + 8 * 48 + 8;
    // Truncation: at every byte of the header and at a sample of the others.
    for (size_t n = 0; n < size; n += n < header + 64 ? 1 : 97)
        expect_damaged(bytes, n, "truncation", n);
    expect_damaged(bytes, size - 1, "truncation", size - 1);
    // Flipped bits: all of the header, a sample of the sections, their gaps and the trailer.
    for (size_t i = 0; i < size; i += i < header + 64 || i > size - 10 ? 1 : 61)
        for (int bit = 0; bit < 8; bit++) {
            bytes[i] ^= (uint8_t)(1 << bit);
            expect_damaged(bytes, size, "flipped bit", i);
            bytes[i] ^= (uint8_t)(1 << bit);
        }
    // Extra bytes after the end.
    uint8_t *longer;
    assert_int_equal(SDM_ALLOC(&longer, size + 64, "longer", NULL), 0);
    memcpy(longer, bytes, size);
    expect_damaged(longer, size + 64, "longer", size);
    sdm_free(longer);
    // A newer version of the format is reported as such.
    sdm_error e;
    sdm_model *m;
    bytes[8] = SDM_CONTAINER_VERSION + 1;
    assert_int_equal(sdm_model_open_memory("new", bytes, size, &m, &e), SDM_E_FORMAT);
    assert_non_null(strstr(e.text, "newer"));
    bytes[8] = 1;
    assert_int_equal(sdm_model_open_memory("old", bytes, size, &m, &e), SDM_E_FORMAT);
    assert_non_null(strstr(e.text, "before the first release"));
    sdm_free(bytes);
    sdm_free(t.memory);
}

static void damage_is_refused(void **state)
{
    (void)state;
    damage_is_refused_with(SDM_POD_F16);
    damage_is_refused_with(SDM_POD_I8);
}

// Right checksums, but sizes far too large for the sections.
static void hostile_sections(void **state)
{
    (void)state;
    static const char meta[] =
        "kind=pod\nversion=0.1.0\nshape=x\ngrid.size=1048576 1048576 1048576\n";
    const sdm_section sections[] = {
        {"meta", meta, sizeof meta - 1}, {"config", "", 0}, {"pod.ranks", "", 0}};
    uint8_t *bytes;
    size_t size;
    assert_int_equal(sdm_container_build(sections, 3, &bytes, &size, NULL), SDM_OK);
    expect_damaged(bytes, size, "hostile", 0);
    sdm_free(bytes);
    sdm_error e;
    assert_int_equal(sdm_container_build(sections, 0, &bytes, &size, &e), SDM_E_INTERNAL);
    const sdm_section long_name = {"a name of more than twenty-three bytes", "", 0};
    assert_int_equal(sdm_container_build(&long_name, 1, &bytes, &size, &e), SDM_E_INTERNAL);
    static const char checkpoint[] = "kind=checkpoint\n";
    const sdm_section parts[] = {{"meta", checkpoint, sizeof checkpoint - 1},
                                 {"checkpoint", "", 0}};
    sdm_model *m;
    assert_int_equal(sdm_container_build(parts, 2, &bytes, &size, NULL), SDM_OK);
    assert_int_equal(sdm_model_open_memory("c", bytes, size, &m, &e), SDM_E_FORMAT);
    assert_non_null(strstr(e.text, "--resume"));
    sdm_free(bytes);
}

static sdm_status build(const void *spec, uint8_t **bytes, size_t *size, sdm_error *err)
{
    return sdm_pod_build(spec, bytes, size, err);
}

static void every_allocation_may_fail(void **state)
{
    (void)state;
    static const sdm_pod_type types[] = {SDM_POD_F32, SDM_POD_I8};
    for (int i = 0; i < 2; i++) {
        toy t;
        toy_make(&t, types[i], 0);
        sdm_model_free(open_with_failing_allocations(build, &t.spec, 4, 6));
        sdm_model_free(NULL);
        sdm_free(t.memory);
    }
}

/* A refused use names the parameter with the largest error that the training printed, and this
 * error. Volumes of surfaces blame voxels only where those of
 * maps are much better. */
static void refusals_quote_the_training(toy *t)
{
    static const struct {
        double error;
        const char *unfit, *text, *end;
    } cases[] = {
        {2.2,
         "volumes of maps: off by 3 %\n"
         "derivatives of the volume by rose: off by 220 %; by height: off by 127 %\n"
         "derivatives of the volume by tilt: off by 822 % of their own size: these parameters\n",
         "derivatives of volumes of its maps are off by 822 % of their own size for tilt, more "
         "than "
         "20 %; by rose: off by 220 %; by height: off by 127 %; take",
         "planes of voxels"},
        {2.2,
         "derivatives of the volume by rose: off by 220 %; by height: off by 127 %\n"
         "derivatives of the volume by tilt: off by 82 % of their own size: these parameters\n",
         "derivatives of volumes of its maps are off by 220 % for rose, more than 20 %; by "
         "height: off by 127 %; take",
         "planes of voxels"},
        {43, "derivatives of the volume by tilt: off by over 1000 %; by a: off by 30 %\n",
         "derivatives of volumes of its maps are off by over 1000 % for tilt, more than 20 %; "
         "by a: off by 30 %; take",
         "planes of voxels"},
        {0.2096,
         "derivatives of the volume by stem: off by 34 % of their own size: this\nits tips\n",
         "derivatives of volumes of its maps are off by 34 % of their own size for stem, more than "
         "20 %; take",
         "planes of voxels"},
        {0.38,
         "derivatives of the volume by wall: off by 30 %; exact maps err by 2 %\n"
         "derivatives of the volume by tilt: off by 380 % of their own size: this parameter\n",
         "derivatives of volumes of its maps are off by 380 % of their own size for tilt, more "
         "than "
         "20 %; by wall: off by 30 %; take",
         "planes of voxels"},
        {0.204, "derivatives of the volume by a: off by 20 %\n",
         "derivatives of volumes of its maps are off by 20.4 % for a, more than 20 %; take",
         "planes of voxels"}};
    sdm_error err;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        t->info.quality = (sdm_model_quality){.grade = "usable",
                                              .volume_error = 0.04,
                                              .surface_volume_error = 0.038,
                                              .volume_derivative_error = cases[i].error};
        snprintf(t->info.quality.unfit, sizeof t->info.quality.unfit, "%s", cases[i].unfit);
        sdm_model *m = toy_open(t);
        assert_int_equal(sdm_model_check_use(m, SDM_USE_VOLUME_DERIVATIVE, &err), SDM_E_QUALITY);
        const size_t n = strlen(err.text), tail = strlen(cases[i].end);
        if (strstr(err.text, cases[i].text) != err.text || n < tail ||
            strcmp(err.text + n - tail, cases[i].end))
            fail_msg("%s", err.text);
        assert_int_equal(sdm_model_check_use(m, SDM_USE_SURFACE_VOLUME, &err), SDM_E_QUALITY);
        assert_non_null(strstr(err.text, "off by 3.8 %, more than 2 %: the network errs"));
        sdm_model_free(m);
    }
}

/* A model whose derivatives of the volume are good enough names beside SDM_OK the parameters that
 * hardly change the volume and whose own error is large; other uses and other lines do not count.
 */
static void small_parameters_beside_ok(toy *t)
{
    static const struct {
        const char *unfit, *text;
    } cases[] = {
        {"volumes of maps: off by 3 %\n"
         "derivatives of the volume by open: off by 395 % of their own size; by pin: off by 42 %: "
         "these parameters hardly change the volume\nits tips\n",
         "do not use the derivatives of the volume by open: off by 395 % of their own size; by "
         "pin: "
         "off by 42 %: these parameters hardly change the volume"},
        {"derivatives of maps by open: off by 30 %\nits tips, off by 3 % of their own size\n", ""},
        {"", ""}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        sdm_error err = {.text = "an earlier error"};
        t->info.quality = (sdm_model_quality){.grade = "usable", .volume_derivative_error = 0.1};
        snprintf(t->info.quality.unfit, sizeof t->info.quality.unfit, "%s", cases[i].unfit);
        sdm_model *m = toy_open(t);
        assert_int_equal(sdm_model_check_use(m, SDM_USE_VOLUME, &err), SDM_OK);
        assert_string_equal(err.text, "an earlier error");
        assert_int_equal(sdm_model_check_use(m, SDM_USE_VOLUME_DERIVATIVE, &err), SDM_OK);
        assert_string_equal(err.text, cases[i].text);
        assert_int_equal(sdm_model_check_use(m, SDM_USE_VOLUME_DERIVATIVE, NULL), SDM_OK);
        sdm_model_free(m);
    }
}

// The verdict of the training is kept; without one the file has no section for it, as the files of
// earlier versions.
static void quality_is_kept(void **state)
{
    (void)state;
    toy t;
    toy_make(&t, SDM_POD_F32, 0);
    sdm_model *m = toy_open(&t);
    const sdm_model_quality *q = &sdm_model_get_info(m)->quality;
    const size_t without = sdm_model_get_info(m)->file_bytes;
    assert_true(!*q->grade && isnan(q->cut) && isnan(q->between_mm));
    assert_int_equal(sdm_model_check_use(m, SDM_USE_SURFACE, NULL), SDM_E_UNSUPPORTED);
    sdm_model_free(m);
    t.info.quality = (sdm_model_quality){.grade = "poor",
                                         .cut = 0.25,
                                         .between_mm = NAN,
                                         .thickness_mm = 0.5,
                                         .mesh_volume_mm3 = 12.5,
                                         .mesh_area_mm2 = 30,
                                         .volume_error = 0.01,
                                         .derivative_error = NAN,
                                         .volume_derivative_error = 0.5,
                                         .surface_volume_error = 0.0202,
                                         .far_error_mm = 7,
                                         .probe_volume_mm3 = {1, 2, NAN},
                                         .probe_area_mm2 = {3, 4, NAN},
                                         .mesh_moment_mm3 = -5,
                                         .probe_moment_mm3 = {6, 0, NAN},
                                         .unfit = "volumes: off by 3 %\nits tips\n"};
    m = toy_open(&t);
    q = &sdm_model_get_info(m)->quality;
    assert_string_equal(q->grade, "poor");
    assert_true(q->cut == 0.25 && isnan(q->between_mm) && q->thickness_mm == 0.5);
    assert_true(q->mesh_volume_mm3 == 12.5 && q->mesh_area_mm2 == 30);
    assert_true(q->volume_error == 0.01 && isnan(q->derivative_error));
    assert_true(q->volume_derivative_error == 0.5);
    assert_true(q->surface_volume_error == 0.0202 && q->far_error_mm == 7);
    assert_true(q->probe_volume_mm3[1] == 2 && q->probe_area_mm2[1] == 4);
    assert_true(isnan(q->probe_volume_mm3[2]) && isnan(q->probe_area_mm2[2]));
    assert_true(q->mesh_moment_mm3 == -5 && q->probe_moment_mm3[0] == 6);
    assert_true(q->probe_moment_mm3[1] == 0 && isnan(q->probe_moment_mm3[2]));
    assert_string_equal(q->unfit, "volumes: off by 3 %\nits tips\n");
    assert_true(sdm_model_get_info(m)->file_bytes > without);
    // uses: a poor grade, a good volume, derivatives not measured, bad derivatives of volumes; the
    // figure is seen to exceed its bound
    sdm_error err;
    assert_int_equal(sdm_model_check_use(m, SDM_USE_SURFACE, &err), SDM_E_QUALITY);
    assert_int_equal(sdm_model_check_use(m, SDM_USE_VOLUME, &err), SDM_OK);
    assert_int_equal(sdm_model_check_use(m, SDM_USE_DERIVATIVE, &err), SDM_E_UNSUPPORTED);
    assert_int_equal(sdm_model_check_use(m, SDM_USE_VOLUME_DERIVATIVE, &err), SDM_E_QUALITY);
    assert_string_equal(err.text,
                        "derivatives of volumes of its maps are off by 50 % for the "
                        "worst parameter, more than 20 %; take differences of volumes of the mesh "
                        "(exact --measure): those of maps swing as faces cross planes of voxels");
    assert_int_equal(sdm_model_check_use(m, SDM_USE_SURFACE_VOLUME, &err), SDM_E_QUALITY);
    assert_string_equal(err.text, "volumes inside the surfaces of its maps are off by 2.02 %, more "
                                  "than 2 %: they cut edges and thin walls between the voxels");
    assert_int_equal(sdm_model_check_use(m, SDM_USE_DISTANCE, &err), SDM_E_QUALITY);
    assert_non_null(strstr(err.text, "from the surface are wrong by up to 7 mm; nearer ones "
                                     "have an RMS error of "));
    assert_int_equal(sdm_model_check_use(m, (sdm_model_use)6, &err), SDM_E_ARG);
    assert_int_equal(sdm_model_check_use(NULL, SDM_USE_VOLUME, &err), SDM_E_ARG);
    sdm_model_free(m);
    refusals_quote_the_training(&t);
    small_parameters_beside_ok(&t);
    // an unknown grade and an impossible share are damage
    const sdm_model_quality wrong[] = {{.grade = "fine"},
                                       {.grade = "good", .cut = 1.5},
                                       {.grade = "good", .between_mm = -1},
                                       {.grade = "good", .thickness_mm = -1},
                                       {.grade = "good", .volume_error = -0.1},
                                       {.grade = "good", .surface_volume_error = -0.1},
                                       {.grade = "good", .far_error_mm = -1}};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        uint8_t *bytes;
        size_t size;
        t.info.quality = wrong[i];
        assert_int_equal(sdm_pod_build(&t.spec, &bytes, &size, NULL), SDM_OK);
        assert_int_equal(sdm_model_open_memory("toy", bytes, size, &m, NULL), SDM_E_FORMAT);
        sdm_free(bytes);
    }
    sdm_free(t.memory);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(weights_must_be_finite),
        cmocka_unit_test(file_keeps_everything),
        cmocka_unit_test(distributions_are_kept),
        cmocka_unit_test(quality_is_kept),
        cmocka_unit_test(survey_follows_the_distributions),
        cmocka_unit_test(damage_is_refused),
        cmocka_unit_test(hostile_sections),
        cmocka_unit_test(every_allocation_may_fail),
    };
    return toy_run(tests);
}
