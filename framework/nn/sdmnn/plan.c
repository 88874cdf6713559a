/* The plan of an sdmnn network: from the architecture to steps and offsets; checks, counts and
   random initial weights. */
#include "plan.h"

#include <math.h>
#include <string.h>

#include "sdm/internal/rng.h"

static size_t half(size_t n) { return (n + 1) / 2; }

static size_t channels_of(const sdm_sdmnn_arch *a, size_t level)
{
    const size_t c = a->channels << level;
    return c < SDM_SDMNN_MAX_CHANNELS ? c : SDM_SDMNN_MAX_CHANNELS;
}

static size_t voxels(const sdm_fmap *g) { return g->n[0] * g->n[1] * g->n[2]; }

sdm_status sdm_sdmnn_check(const sdm_sdmnn_arch *a, sdm_error *err)
{
    if (a->n_params < 1 || a->n_params > 65536)
        return sdm_fail(err, SDM_E_ARG, "%zu parameters: need 1 .. 65536", a->n_params);
    if (a->depth < 1 || a->depth > SDM_SDMNN_MAX_DEPTH)
        return sdm_fail(err, SDM_E_ARG, "depth %zu: sdmnn needs 1 .. %d levels of pooling",
                        a->depth, SDM_SDMNN_MAX_DEPTH);
    if (a->channels < 1 || a->channels > SDM_SDMNN_MAX_CHANNELS)
        return sdm_fail(err, SDM_E_ARG, "%zu channels: need 1 .. %d", a->channels,
                        SDM_SDMNN_MAX_CHANNELS);
    if (a->width < 1 || a->width > 65536)
        return sdm_fail(err, SDM_E_ARG, "a dense layer of width %zu: need 1 .. 65536", a->width);
    if (a->block < 1 || a->block > 64)
        return sdm_fail(err, SDM_E_ARG, "block %zu: need 1 .. 64", a->block);
    if (a->activation < 0 || a->activation > 2)
        return sdm_fail(err, SDM_E_ARG, "activation %d: need 0 .. 2", a->activation);
    if (!(a->dropout >= 0 && a->dropout < 1))
        return sdm_fail(err, SDM_E_ARG, "drop-out %g: need 0 or more, below 1", a->dropout);

    // grid
    size_t n[3] = {a->n[0], a->n[1], a->n[2]};
    for (int i = 0; i < 3; i++)
        if (n[i] < 1 || n[i] > 1048576)
            return sdm_fail(err, SDM_E_ARG, "%zu voxels: need 1 .. 1048576", n[i]);
    // limit far below SIZE_MAX, so that no size of the plan overflows; allocation may still fail
    const double all = 16.0 * ((double)n[0] + 2) * ((double)n[1] + 2) * ((double)n[2] + 2) *
                       ((double)a->channels + 1);
    if (!(all < fmin(0x1p44, (double)(SIZE_MAX / 16))))
        return sdm_fail(err, SDM_E_ARG,
                        "%zu x %zu x %zu voxels and %zu channels are too much for one network",
                        n[0], n[1], n[2], a->channels);

    // levels
    for (size_t l = 0; l < a->depth; l++) {
        if (n[0] * n[1] * n[2] == 1)
            return sdm_fail(err, SDM_E_ARG,
                            "depth %zu: a grid of %zu x %zu x %zu voxels is a single voxel after "
                            "%zu poolings; use fewer",
                            a->depth, a->n[0], a->n[1], a->n[2], l);
        for (int i = 0; i < 3; i++) n[i] = half(n[i]);
    }
    return SDM_OK;
}

// appends a feature map to the maps; returns its offset
static size_t add_buffer(sdmnn_plan *p, const sdm_fmap *g, size_t level, size_t channels)
{
    const size_t offset = p->floats + g->lead;
    p->buffers[p->n_buffers++] = (sdmnn_buffer){level, channels, offset};
    p->floats += (sdm_fmap_floats(g, channels) + 15) / 16 * 16;
    return offset;
}

static size_t add_map(sdmnn_plan *p, size_t level, size_t channels)
{
    return add_buffer(p, &p->level[level], level, channels);
}

static sdmnn_step *add_step(sdmnn_plan *p, sdmnn_op op, size_t level, size_t from, size_t to,
                            sdm_conv conv)
{
    sdmnn_step *s = &p->steps[p->n_steps++];
    *s = (sdmnn_step){
        .op = op, .level = level, .from = from, .to = to, .conv = conv, .weights = p->n_weights};
    if (op == SDMNN_CONV) p->n_weights += sdmnn_conv_weights(s) + conv.out;
    return s;
}

static void conv3(sdmnn_plan *p, size_t level, size_t from, size_t in, size_t to, size_t out,
                  bool drop)
{
    add_step(p, SDMNN_CONV, level, from, to, (sdm_conv){in, out, 27})->drop = drop;
}

void sdm_sdmnn_plan_make(const sdm_sdmnn_arch *a, bool keep, sdmnn_plan *p)
{
    // layouts
    memset(p, 0, sizeof *p);
    p->arch = *a;
    p->level[0] = sdm_fmap_layout(a->n);
    for (size_t l = 1; l <= a->depth; l++) {
        const size_t *n = p->level[l - 1].n;
        p->level[l] = sdm_fmap_layout((const size_t[]){half(n[0]), half(n[1]), half(n[2])});
    }
    for (int i = 0; i < 3; i++) p->n_cells[i] = (a->n[i] + a->block - 1) / a->block;
    p->cells = p->n_cells[0] * p->n_cells[1] * p->n_cells[2];
    p->cell = sdm_fmap_layout(p->n_cells);
    p->n_weights = sdmnn_dense1(p) + sdmnn_dense2(p);
    p->volume = add_buffer(p, &p->cell, SDMNN_LEVELS, 1);
    p->input = add_map(p, 0, 1);

    // Way down. first[l], merged[l]: offsets of the results of the two convolutions of level l.
    // merged[l] has room for 2 c channels: the way up writes c channels after the c channels of the
    // way down.
    size_t first[SDMNN_LEVELS], merged[SDMNN_LEVELS];
    size_t in = p->input, n_in = 1;
    for (size_t l = 0; l <= a->depth; l++) {
        const size_t c = channels_of(a, l);
        first[l] = add_map(p, l, c);
        merged[l] = add_map(p, l, l < a->depth ? 2 * c : c);
        conv3(p, l, in, n_in, first[l], c, false);
        conv3(p, l, first[l], c, merged[l], c, l + 1 >= a->depth);
        if (l == a->depth) break;
        in = add_map(p, l + 1, c);
        n_in = c;
        add_step(p, SDMNN_POOL, l + 1, merged[l], in, (sdm_conv){c, c, 0});
    }

    // way up
    in = merged[a->depth], n_in = channels_of(a, a->depth);
    for (size_t l = a->depth; l-- > 0;) {
        const size_t c = channels_of(a, l);
        // The 1 x 1 x 1 convolution comes before the up-sampling. The result is the same as in the
        // reverse order, because up-sampling only repeats voxels, but the convolution has an eighth
        // of the voxels.
        const size_t reduced = keep ? add_map(p, l + 1, c) : first[l + 1];
        add_step(p, SDMNN_CONV, l + 1, in, reduced, (sdm_conv){n_in, c, 1});
        add_step(p, SDMNN_UPSAMPLE, l, reduced, merged[l] + c * p->level[l].stride,
                 (sdm_conv){c, c, 0});
        const size_t second = keep ? add_map(p, l, c) : first[l],
                     third = keep ? add_map(p, l, c) : merged[l];
        conv3(p, l, merged[l], 2 * c, second, c, false);
        conv3(p, l, second, c, third, c, false);
        in = third, n_in = c;
    }
    p->output = add_map(p, 0, 1);
    add_step(p, SDMNN_CONV, 0, in, p->output, (sdm_conv){n_in, 1, 1})->linear = true;
}

void sdm_sdmnn_plan_clear(const sdmnn_plan *p, float *maps)
{
    for (const sdmnn_buffer *b = p->buffers; b < p->buffers + p->n_buffers; b++)
        sdm_fmap_clear_gaps(b->level < SDMNN_LEVELS ? &p->level[b->level] : &p->cell, b->channels,
                            maps + b->offset);
}

size_t sdm_sdmnn_count(const sdm_sdmnn_arch *a)
{
    sdmnn_plan p;
    sdm_sdmnn_plan_make(a, false, &p);
    return p.n_weights;
}

double sdm_sdmnn_work(const sdm_sdmnn_arch *a)
{
    sdmnn_plan p;
    sdm_sdmnn_plan_make(a, false, &p);
    double n = (double)a->width * (double)(a->n_params + p.cells);
    for (const sdmnn_step *s = p.steps; s < p.steps + p.n_steps; s++)
        if (s->op == SDMNN_CONV)
            n += (double)voxels(&p.level[s->level]) * (double)sdmnn_conv_weights(s);
    return n;
}

// Sets the weights of a layer, from index `at` on, to normal random numbers with variance
// gain / inputs, and the biases after them to zero.
static void random_layer(uint64_t seed, uint64_t stream, size_t at, size_t outputs, size_t inputs,
                         double gain, float *w)
{
    const double sd = sqrt(gain / (double)inputs);
    for (size_t i = 0; i < outputs * inputs; i++)
        w[at + i] = (float)(sd * sdm_rng_normal(seed, stream, at + i));
    memset(w + at + outputs * inputs, 0, outputs * sizeof *w);
}

// Sets the weights of a convolution of level 0 such that it passes the volume v on: the weights of
// its channels 0 and 1, which become f(v) and f(-v), or those of the one channel of the last
// convolution, which becomes f(v) - f(-v) = v.
static void pass_volume_on(const sdmnn_step *s, float *w)
{
    const size_t row = s->conv.in * s->conv.taps, centre = s->conv.taps / 2;
    for (size_t o = 0; o < s->conv.out && o < 2; o++) {
        float *to = w + s->weights + o * row, sign = o ? -1.0f : 1.0f;
        memset(to, 0, row * sizeof *to);
        to[centre] = sign;
        if (s->conv.in > 1) to[s->conv.taps + centre] = -sign;
    }
}

// bias[cells] = the means of map[V] over the cells of the volume
static void cell_means(const sdmnn_plan *p, const float *map, float *bias)
{
    const size_t *n = p->arch.n, *m = p->n_cells, b = p->arch.block;
    for (size_t i = 0; i < p->cells; i++) {
        const size_t cell[3] = {i % m[0], i / m[0] % m[1], i / m[0] / m[1]};
        double sum = 0;
        size_t count = 0;
        for (size_t z = cell[2] * b; z < n[2] && z < (cell[2] + 1) * b; z++)
            for (size_t y = cell[1] * b; y < n[1] && y < (cell[1] + 1) * b; y++)
                for (size_t x = cell[0] * b; x < n[0] && x < (cell[0] + 1) * b; x++, count++)
                    sum += (double)map[(z * n[1] + y) * n[0] + x];
        bias[i] = (float)(sum / (double)count);
    }
}

void sdm_sdmnn_init(const sdm_sdmnn_arch *a, const float *mean, uint64_t seed, uint64_t stream,
                    float *weights)
{
    sdmnn_plan p;
    sdm_sdmnn_plan_make(a, false, &p);
    const size_t second = sdmnn_dense1(&p);
    const bool looks_linear = a->channels > 1 && a->activation != 1; // not with tanh
    random_layer(seed, stream, 0, a->width, a->n_params, 2, weights);
    // with biases of zero, all hidden units would bend at the middle of the parameter ranges
    for (size_t i = second - a->width; i < second; i++)
        weights[i] = (float)sdm_rng_normal(seed, stream, i);
    random_layer(seed, stream, second, p.cells, a->width, 0.01, weights);
    if (mean) cell_means(&p, mean, weights + second + p.cells * a->width);
    for (const sdmnn_step *s = p.steps; s < p.steps + p.n_steps; s++) {
        if (s->op != SDMNN_CONV) continue;
        random_layer(seed, stream, s->weights, s->conv.out, s->conv.in * s->conv.taps,
                     s->linear ? 1 : 2, weights);
        if (s->level == 0 && looks_linear) pass_volume_on(s, weights);
    }
}
