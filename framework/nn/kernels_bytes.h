/* Kernels for weights as bytes (sdm/kernels.h), a part of kernels_simd.h. A lane of 32 bits holds two neighbouring inputs of one output
   as integers of 16 bits. From the instruction set: LOAD_PAIRS(p), bytes to such lanes, and MADD(a, b), the two products of each lane added. */

// the two inputs of a lane
static inline veci first_of(veci v) { return (veci)((vecu)v << 16) >> 16; }
static inline veci second_of(veci v) { return v >> 16; }

#ifndef MADD
#define MADD(a, b) (first_of(a) * first_of(b) + second_of(a) * second_of(b))
#endif

#ifndef LOAD_PAIRS
static inline veci load_pairs(const int8_t *p)
{
    int8_t bytes __attribute__((vector_size(2 * VW)));
    typedef int16_t shorts __attribute__((vector_size(4 * VW)));
    memcpy(&bytes, p, sizeof bytes);
    return (veci) __builtin_convertvector(bytes, shorts);
}
#define LOAD_PAIRS(p) load_pairs(p)
#endif

static inline veci splat_pair(const int16_t *p)
{
    int32_t pair;
    memcpy(&pair, p, sizeof pair);
    return pair - (veci){0};
}

enum { PAIRS = 2 * SDM_PANEL }; // bytes of two inputs of a panel

// where register j of the outputs has its weights, in bytes from panel o / 16 on
#define BYTES_AT(j) ((size_t)((j)*VW / SDM_PANEL) * panel + (size_t)((j)*VW % SDM_PANEL) * 2)

// acc[rows][n] += `pairs` pairs of inputs
#define BYTES_SUM(rows, n, pairs)                                                                                      \
    for (size_t p = 0; p < (pairs); p++, w += PAIRS) {                                                                 \
        veci weight[n];                                                                                                \
        for (int j = 0; j < n; j++) weight[j] = LOAD_PAIRS(w + BYTES_AT(j));                                           \
        for (int i = 0; i < rows; i++) {                                                                               \
            const veci s = splat_pair(x + (size_t)i * ldx + 2 * p);                                                    \
            for (int j = 0; j < n; j++) acc[i][j] += (vecu)MADD(s, weight[j]);                                         \
        }                                                                                                              \
    }

// `rows` rows of x times `n` registers of outputs
#define BYTES_BLOCK(rows, n)                                                                                           \
    static void bytes_##rows##x##n(size_t coarse, size_t fine, const int8_t *w, const int16_t *x, size_t ldx,          \
                                   const float *scale, float *y, size_t ldy)                                           \
    {                                                                                                                  \
        const size_t panel = (coarse + fine) * PAIRS;                                                                  \
        vecu acc[rows][n];                                                                                             \
        for (int i = 0; i < rows; i++)                                                                                 \
            for (int j = 0; j < n; j++) acc[i][j] = (vecu){0};                                                         \
        if (coarse) {                                                                                                  \
            BYTES_SUM(rows, n, coarse)                                                                                 \
            for (int i = 0; i < rows; i++)                                                                             \
                for (int j = 0; j < n; j++) acc[i][j] <<= 8;                                                           \
        }                                                                                                              \
        BYTES_SUM(rows, n, fine)                                                                                       \
        for (int i = 0; i < rows; i++) {                                                                               \
            const vec s = splat(scale[i]);                                                                             \
            for (int j = 0; j < n; j++)                                                                                \
                store(y + (size_t)i * ldy + (size_t)(j * VW), s * __builtin_convertvector((veci)acc[i][j], vec));      \
        }                                                                                                              \
    }

#define BYTES_STEP(rows, n)                                                                                            \
    for (; o + n * VW <= outputs; o += n * VW)                                                                         \
        bytes_##rows##x##n(coarse, fine, w + o / SDM_PANEL * (coarse + fine) * PAIRS + o % SDM_PANEL * 2, x, ldx,      \
                           scale, y + o, ldy);

BYTES_BLOCK(1, 4)
BYTES_BLOCK(1, 2)
BYTES_BLOCK(1, 1)
BYTES_BLOCK(2, 4)
BYTES_BLOCK(2, 2)
BYTES_BLOCK(2, 1)
BYTES_BLOCK(3, 4)
BYTES_BLOCK(3, 2)
BYTES_BLOCK(3, 1)
BYTES_BLOCK(4, 2)
BYTES_BLOCK(4, 1)
BYTES_BLOCK(5, 2)
BYTES_BLOCK(5, 1)
BYTES_BLOCK(6, 2)
BYTES_BLOCK(6, 1)

static void bytes_rows(size_t rows, size_t outputs, size_t coarse, size_t fine, const int8_t *w, const int16_t *x,
                       size_t ldx, const float *scale, float *y, size_t ldy)
{
    size_t o = 0;
    switch (rows) {
    case 1:
        BYTES_STEP(1, 4)
        BYTES_STEP(1, 2)
        BYTES_STEP(1, 1)
        break;
    case 2:
        BYTES_STEP(2, 4)
        BYTES_STEP(2, 2)
        BYTES_STEP(2, 1)
        break;
    case 3:
        BYTES_STEP(3, 4)
        BYTES_STEP(3, 2)
        BYTES_STEP(3, 1)
        break;
    case 4:
        BYTES_STEP(4, 2)
        BYTES_STEP(4, 1)
        break;
    case 5:
        BYTES_STEP(5, 2)
        BYTES_STEP(5, 1)
        break;
    default:
        BYTES_STEP(6, 2)
        BYTES_STEP(6, 1)
        break;
    }
}

// as panel_f32(): a few panels for all rows, then the next
static void panel_i8(size_t batch, size_t outputs, size_t n_coarse, size_t k, const int8_t *w, const int16_t *x,
                     size_t ldx, const float *scale, float *y, size_t ldy)
{
    const size_t coarse = (n_coarse + 1) / 2, fine = (k + 1) / 2;
    if (batch <= 6) {
        bytes_rows(batch, outputs, coarse, fine, w, x, ldx, scale, y, ldy);
        return;
    }
    const size_t some = 2 * VW > SDM_PANEL ? 2 * VW : SDM_PANEL;
    for (size_t o = 0; o < outputs; o += some, w += some / SDM_PANEL * (coarse + fine) * PAIRS)
        for (size_t i = 0; i < batch; i += 6)
            bytes_rows(batch - i < 6 ? batch - i : 6, outputs - o < some ? outputs - o : some, coarse, fine, w,
                       x + i * ldx, ldx, scale + i, y + i * ldy + o, ldy);
}

// x[2 * pairs] += factor times the transpose of `pairs` pairs of n outputs
static void back_pairs(size_t n, size_t pairs, size_t panel, float factor, const int8_t *w, const float *y, float *x)
{
    for (size_t p = 0; p < pairs; p++, w += PAIRS) {
        vec a = {0}, b = {0};
        for (size_t j = 0; j < n; j += VW) {
            const veci weight = LOAD_PAIRS(w + j / SDM_PANEL * panel + j % SDM_PANEL * 2);
            const vec at = load(y + j);
            a += __builtin_convertvector(first_of(weight), vec) * at;
            b += __builtin_convertvector(second_of(weight), vec) * at;
        }
        x[2 * p] += factor * sum_lanes(a);
        x[2 * p + 1] += factor * sum_lanes(b);
    }
}

static void back_i8(size_t outputs, size_t n_coarse, size_t k, const int8_t *w, const float *y, float *x)
{
    const size_t coarse = (n_coarse + 1) / 2, fine = (k + 1) / 2, panel = (coarse + fine) * PAIRS;
    memset(x, 0, 2 * fine * sizeof *x);
    for (size_t o = 0; o < outputs; o += 4 * SDM_PANEL, w += 4 * panel) {
        const size_t n = outputs - o < 4 * SDM_PANEL ? outputs - o : 4 * SDM_PANEL;
        back_pairs(n, coarse, panel, 256, w, y + o, x);
        back_pairs(n, fine, panel, 1, w + coarse * PAIRS, y + o, x);
    }
}

// what is left of y times their factors, filled up with zeros
static vec product_of_rest(size_t n, const float *y, const float *factor)
{
    float some[VW] = {0};
    for (size_t i = 0; i < n; i++) some[i] = factor ? y[i] * factor[i] : y[i];
    return load(some);
}

static inline vec product_at(size_t i, const float *y, const float *factor)
{
    return factor ? load(y + i) * load(factor + i) : load(y + i);
}

// magnitudes compared as integers: those of NaN and infinity are the largest
static inline veci larger_magnitude(veci most, vec v)
{
    const veci bits = (veci)v & 0x7fffffff, more = bits > most;
    return (bits & more) | (most & ~more);
}

typedef uint16_t vec_short __attribute__((vector_size(2 * VW)));

// nearest integers: the last bits of a number near 2^23
static inline vec_short round_to_short(vec v, float to_integer)
{
    return __builtin_convertvector((vecu)(v * to_integer + 12582912.0f), vec_short);
}

static inline float quantise_by(size_t n, const float *y, const float *factor, int limit, int16_t *x)
{
    const size_t whole = n / VW * VW;
    const vec rest = product_of_rest(n - whole, y + whole, factor ? factor + whole : NULL);
    veci most = larger_magnitude((veci){0}, rest);
    for (size_t i = 0; i < whole; i += VW) most = larger_magnitude(most, product_at(i, y, factor));
    int32_t largest_bits = 0;
    for (int j = 0; j < VW; j++) largest_bits = most[j] > largest_bits ? most[j] : largest_bits;
    float largest;
    memcpy(&largest, &largest_bits, sizeof largest);
    const float to_integer = (float)limit / largest;
    if (!(to_integer > 0 && to_integer <= 3e38f)) { // not finite, or zero beside what a float can hold
        memset(x, 0, n * sizeof *x);
        return largest_bits >= 0x7f800000 ? largest - largest : 0;
    }
    for (size_t i = 0; i < whole; i += VW) {
        const vec_short s = round_to_short(product_at(i, y, factor), to_integer);
        memcpy(x + i, &s, sizeof s);
    }
    const vec_short s = round_to_short(rest, to_integer);
    memcpy(x + whole, &s, (n - whole) * sizeof *x);
    return largest / (float)limit;
}

static float quantise(size_t n, const float *y, const float *factor, int limit, int16_t *x)
{
    return factor ? quantise_by(n, y, factor, limit, x) : quantise_by(n, y, NULL, limit, x);
}
