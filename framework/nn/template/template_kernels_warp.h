/* The kernels of warps: displacements by cubic B-splines, and their inverse at the stations, LANES
   stations at a time. Included by template_kernels_simd.h. */
#pragma once

/* A number of each of LANES points. */
enum { LANES = VW / 2 };
typedef double lanes __attribute__((vector_size(4 * VW)));
typedef int64_t masks __attribute__((vector_size(4 * VW)));
typedef float four_floats __attribute__((vector_size(16)));

static inline lanes all_of(double v) { return v - (lanes){0}; }
static inline lanes lanes_at(const double *p)
{
    lanes v;
    memcpy(&v, p, sizeof v);
    return v;
}
static inline lanes choose(masks mask, lanes a, lanes b)
{
    return (lanes)((mask & (masks)a) | (~mask & (masks)b));
}

// The compiler converts vectors in halves, through memory, unless it is told the instruction.
#if VW == 8
static inline lanes truncated(lanes v) { return _mm256_cvtepi32_pd(_mm256_cvttpd_epi32(v)); }
static inline void narrow(lanes v, float to[LANES]) { _mm_storeu_ps(to, _mm256_cvtpd_ps(v)); }
// out[3] = the first columns of LANES rows of four.
static inline void columns(const float *const from[LANES], lanes out[3])
{
    const __m128 a = _mm_loadu_ps(from[0]), b = _mm_loadu_ps(from[1]), c = _mm_loadu_ps(from[2]),
                 d = _mm_loadu_ps(from[3]), ab = _mm_unpacklo_ps(a, b), cd = _mm_unpacklo_ps(c, d);
    out[0] = _mm256_cvtps_pd(_mm_movelh_ps(ab, cd));
    out[1] = _mm256_cvtps_pd(_mm_movehl_ps(cd, ab));
    out[2] = _mm256_cvtps_pd(_mm_movelh_ps(_mm_unpackhi_ps(a, b), _mm_unpackhi_ps(c, d)));
}
#else
static inline lanes truncated(lanes v)
{
    return (lanes){(double)(int32_t)v[0], (double)(int32_t)v[1]};
}
static inline void narrow(lanes v, float to[LANES]) { EACH(l, LANES) to[l] = (float)v[l]; }
static inline void columns(const float *const from[LANES], lanes out[3])
{
    EACH(i, 3) out[i] = (lanes){(double)from[0][i], (double)from[1][i]};
}
#endif

/* Polynomials in t of the weights of four control points, and of their derivatives: coefficients of
   1, t, t^2, t^3. */
#define SIXTH (1.0f / 6)
#define THIRDS (2.0f / 3)
static const float CUBIC[4][8] = {{SIXTH, THIRDS, SIXTH, 0, -0.5f, 0, 0.5f, 0},
                                  {-0.5f, 0, 0.5f, 0, 1, -2, 1, 0},
                                  {0.5f, -1, 0.5f, 0, -0.5f, 1.5f, -1.5f, 0.5f},
                                  {-SIXTH, 0.5f, -0.5f, SIXTH, 0, 0, 0, 0}};

static inline void find_places(const template_warp *w, const lanes y[3], template_place p[LANES])
{
    const double per_mm = 1 / w->spacing;
    float t[3][LANES], slope[3][LANES];
    lanes first[3];
    EACH(a, 3)
    {
        const double end = w->n[a] - 2;
        lanes u = (y[a] - all_of(w->origin[a])) * all_of(per_mm);
        const masks inside = (u >= all_of(1)) & (u <= all_of(end));
        u = choose(u > all_of(1), u, all_of(1));
        u = choose(u < all_of(end), u, all_of(end));
        lanes at = truncated(u);
        at = choose(at < all_of(end - 1), at, all_of(end - 1));
        narrow(u - at, t[a]);
        narrow(choose(inside, all_of(per_mm), all_of(0)), slope[a]);
        first[a] = at - all_of(1);
    }
    const lanes node = first[0] + all_of(w->n[0]) * (first[1] + all_of(w->n[1]) * first[2]);
    EACH(l, LANES)
    {
        p[l].first = 4 * (int32_t)node[l];
        EACH(a, 3) EACH(h, 8 / VW)
        {
            static const float value[8] = {1, 1, 1, 1}, by_t[8] = {0, 0, 0, 0, 1, 1, 1, 1};
            const int at = VW * h;
            const vec x = splat(t[a][l]),
                      sum = load(CUBIC[0] + at) +
                            x * (load(CUBIC[1] + at) +
                                 x * (load(CUBIC[2] + at) + x * load(CUBIC[3] + at)));
            store(p[l].weights[a][0] + at,
                  sum * (load(value + at) + splat(slope[a][l]) * load(by_t + at)));
        }
    }
}

static void find_place(const template_warp *w, const double y[3], template_place *out)
{
    const lanes at[3] = {all_of(y[0]), all_of(y[1]), all_of(y[2])};
    template_place all[LANES];
    find_places(w, at, all);
    *out = all[0];
}

/* The four control points of a line are PARTS vectors, as wide as the registers. Along x the first
   and third, the second and fourth control point are summed first: halves of vectors. */
#if defined(__AVX512F__)
#define PARTS 1
#else
#define PARTS (16 / VW)
#endif
typedef float part __attribute__((vector_size(64 / PARTS)));
typedef float part_unaligned __attribute__((vector_size(64 / PARTS), aligned(4)));

static inline part part_of(float v) { return v - (part){0}; }

// to[4] = the sum along x with the weights of the control points w.
static inline void sum_line(const part line[PARTS], const part w[PARTS], float *to)
{
#if PARTS == 1
    const part v = line[0] * w[0];
    const vec sum = __builtin_shufflevector(v, v, 0, 1, 2, 3, 4, 5, 6, 7) +
                    __builtin_shufflevector(v, v, 8, 9, 10, 11, 12, 13, 14, 15);
#elif PARTS == 2
    const vec sum = line[0] * w[0] + line[1] * w[1];
#endif
#if PARTS <= 2
    const four_floats all = __builtin_shufflevector(sum, sum, 0, 1, 2, 3) +
                            __builtin_shufflevector(sum, sum, 4, 5, 6, 7);
#else
    const four_floats all = (line[0] * w[0] + line[2] * w[2]) + (line[1] * w[1] + line[3] * w[3]);
#endif
    memcpy(to, &all, sizeof all);
}

static void displace(const template_warp *w, const template_place *p, float (*sum)[4])
{
    const ptrdiff_t line = 4 * (ptrdiff_t)w->n[0], plane = line * w->n[1];
    const float *const control = w->control + p->first, (*const weights)[2][4] = p->weights;
    part f[PARTS], y[PARTS], z[PARTS]; // sums along y and z: no derivative, by y, by z
    EACH(k, 4)
    {
        part plain[PARTS], by_y[PARTS];
        EACH(j, 4) EACH(h, PARTS)
        {
            const part v = *(const part_unaligned *)(control + k * plane + j * line +
                                                     16 / PARTS * h),
                       a = part_of(weights[1][0][j]) * v, b = part_of(weights[1][1][j]) * v;
            plain[h] = j ? plain[h] + a : a;
            by_y[h] = j ? by_y[h] + b : b;
        }
        EACH(h, PARTS)
        {
            const part a = part_of(weights[2][0][k]) * plain[h],
                       b = part_of(weights[2][0][k]) * by_y[h],
                       c = part_of(weights[2][1][k]) * plain[h];
            f[h] = k ? f[h] + a : a;
            y[h] = k ? y[h] + b : b;
            z[h] = k ? z[h] + c : c;
        }
    }
    part x[2][PARTS];
    EACH(d, 2)
    {
#if PARTS == 1
        const part v = _mm512_broadcast_f32x4(_mm_loadu_ps(weights[0][d]));
        x[d][0] =
            __builtin_shufflevector(v, v, 0, 0, 0, 0, 5, 5, 5, 5, 10, 10, 10, 10, 15, 15, 15, 15);
#else
        EACH(h, PARTS) x[d][h] = repeat_each(weights[0][d] + h * VW / 4);
#endif
    }
    sum_line(f, x[0], sum[0]);
    sum_line(f, x[1], sum[1]);
    sum_line(y, x[0], sum[2]);
    sum_line(z, x[0], sum[3]);
}

/* Matrices of LANES points, row-major. */

// out = (I + du)^-1, or I if the determinant is near 0.
static inline void inverse_of_warp(const lanes du[9], lanes out[9])
{
    lanes a[9], c[9];
    EACH(i, 3) EACH(j, 3) a[3 * i + j] = du[3 * i + j] + all_of(i == j);
    EACH(i, 3)
    EACH(j, 3)
    {
        const int r = (j + 1) % 3, s = (j + 2) % 3, k = (i + 1) % 3, l = (i + 2) % 3;
        c[3 * i + j] = a[3 * r + k] * a[3 * s + l] - a[3 * r + l] * a[3 * s + k];
    }
    const lanes det = a[0] * c[0] + a[1] * c[3] + a[2] * c[6], factor = all_of(1) / det;
    const masks unfolded = det > all_of(1e-2);
    EACH(i, 3)
    EACH(j, 3)
    out[3 * i + j] = choose(unfolded, c[3 * i + j] * factor, all_of(i == j));
}

static inline bool any(masks mask)
{
    int64_t all = 0;
    EACH(l, LANES) all |= mask[l];
    return all != 0;
}

// Solves y + U(y) = q from y at the points of `active`.
static inline void newton(const template_warp *w, masks active, const lanes q[3], lanes y[3],
                          lanes inverse[9])
{
    enum { ITERATIONS = 12 };
    const lanes stop = all_of(0.005 * w->spacing), longest = all_of(0.5 * w->spacing);
    float sum[LANES][4][4] = {{{0}}};
    for (int n = 0; n < ITERATIONS && any(active); n++) {
        template_place places[LANES];
        lanes u[4][3], du[9], now[9], f[3], d[3], length; // u: the displacement, by x, by y, by z
        find_places(w, y, places);
        EACH(l, LANES) if (active[l]) displace(w, &places[l], sum[l]);
        EACH(k, 4)
        {
            const float *rows[LANES];
            EACH(l, LANES) rows[l] = sum[l][k];
            columns(rows, u[k]);
        }
        EACH(i, 3) EACH(a, 3) du[3 * i + a] = u[1 + a][i];
        inverse_of_warp(du, now);
        EACH(i, 3) f[i] = q[i] - y[i] - u[0][i];
        EACH(i, 3) d[i] = now[3 * i] * f[0] + now[3 * i + 1] * f[1] + now[3 * i + 2] * f[2];
        const lanes square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
        EACH(l, LANES) length[l] = sqrt(square[l]);
        const lanes scale = choose(length > longest, longest / length, all_of(1));
        EACH(i, 3) y[i] = choose(active, y[i] + scale * d[i], y[i]);
        EACH(i, 3)
        EACH(j, 3)
        inverse[3 * i + j] = choose(active, now[3 * i + j], inverse[3 * i + j]);
        active &= ~(length < stop);
    }
}

// y[4] = the start of the station i, from the stations before it along y and z.
static inline void predict(const template_stations *s, size_t i, double y[4])
{
    typedef double four __attribute__((vector_size(32)));
    const float *const p = s->points + 4 * i;
    four before[3]; // along z, combined along y
    EACH(k, 3)
    {
        four at[3] = {{0}};
        for (size_t j = k == 0; j < 3; j++) {
            const float *from = p - 4 * ((size_t)k * s->plane + j * s->line);
#if VW == 8
            at[j] = _mm256_cvtps_pd(_mm_loadu_ps(from));
#else
            at[j] = (four){(double)from[0], (double)from[1], (double)from[2]};
#endif
        }
        before[k] = 2 * at[1] - at[2];
        if (k > 0) before[k] -= at[0];
    }
    const four origin = {s->origin[0], s->origin[1], s->origin[2]},
               start = (before[0] - 2 * before[1] + before[2]) * s->spacing + origin;
    memcpy(y, &start, sizeof start);
}

// Stores the active stations; at[LANES]: their numbers from the first one of the first line.
static inline void set_stations(const template_stations *s, masks active, const size_t at[LANES],
                                const lanes y[3], const lanes inverse[9])
{
    static const int row[6] = {0, 1, 2, 1, 0, 0}, column[6] = {0, 1, 2, 2, 2, 1};
    const lanes per_index = all_of(1 / s->spacing);
    float point[4][LANES] = {{0}}, metric[8][LANES] = {{0}};
    lanes b[9];
    EACH(r, 3)
    EACH(c, 3)
    b[3 * r + c] = inverse[3 * r] * all_of(s->frame[c]) +
                   inverse[3 * r + 1] * all_of(s->frame[3 + c]) +
                   inverse[3 * r + 2] * all_of(s->frame[6 + c]);
    EACH(c, 3) narrow((y[c] - all_of(s->origin[c])) * per_index, point[c]);
    EACH(c, 6)
    {
        const lanes *const i = b + 3 * row[c], *const j = b + 3 * column[c];
        narrow(i[0] * j[0] + i[1] * j[1] + i[2] * j[2], metric[c]);
    }
    EACH(l, LANES)
    {
        if (!active[l]) continue;
        EACH(c, 4) s->points[4 * at[l] + (size_t)c] = point[c][l];
        EACH(c, 8) s->metric[8 * at[l] + (size_t)c] = metric[c][l];
        if (!s->station) continue;
        for (int c = 0; c < 3; c++) s->station[at[l]].y[c] = y[c][l];
        for (int c = 0; c < 9; c++) s->station[at[l]].inverse[c] = inverse[c][l];
    }
}

static const double LANE[4] = {0, 1, 2, 3};

static void invert_line(const template_warp *w, template_stations *s)
{
    for (size_t i = 0; i < s->n; i += LANES) {
        const lanes station = all_of((double)i) + lanes_at(LANE);
        size_t at[LANES];
        double start[LANES][4] = {{0}};
        EACH(l, LANES)
        {
            at[l] = i + (size_t)l;
            if (at[l] < s->n) predict(s, at[l], start[l]);
        }
        lanes q[3], y[3], inverse[9] = {{0}};
        EACH(c, 3)
        {
            q[c] = all_of(s->first[c][0]) + all_of(s->step[c][0]) * station;
            EACH(l, LANES) y[c][l] = start[l][c];
        }
        const masks active = station < all_of((double)s->n);
        newton(w, active, q, y, inverse);
        set_stations(s, active, at, y, inverse);
        for (int c = 0; c < 3 && i == 0; c++) s->shift[c] = y[c][0] - q[c][0];
    }
}

// Inverts up to LANES lines from line `from` on, each a step behind the one before it.
static inline void invert_lines(const template_warp *w, template_stations *s, size_t from)
{
    const size_t left = s->n_lines - from, n_lines = left < LANES ? left : LANES;
    const lanes lane = lanes_at(LANE);
    lanes first[3], step[3], y[3] = {{0}}, inverse[9] = {{0}};
    EACH(c, 3) first[c] = lanes_at(s->first[c] + from), step[c] = lanes_at(s->step[c] + from);
    for (size_t i = 0; i < s->n + n_lines - 1; i++) {
        const lanes station = all_of((double)i) - lane;
        const masks active = (station >= all_of(0)) & (station < all_of((double)s->n)) &
                             (lane < all_of((double)n_lines));
        lanes q[3], start[3];
        size_t at[LANES];
        EACH(l, LANES) at[l] = i - (size_t)l + (from + (size_t)l) * s->line;
        EACH(c, 3)
        {
            const lanes moved = inverse[3 * c] * step[0] + inverse[3 * c + 1] * step[1] +
                                inverse[3 * c + 2] * step[2];
            q[c] = first[c] + step[c] * station;
            start[c] = y[c] + moved;
            if (i < n_lines) start[c][i] = q[c][i] + s->shift[c];
        }
        EACH(c, 3) y[c] = choose(active, start[c], y[c]);
        newton(w, active, q, y, inverse);
        set_stations(s, active, at, y, inverse);
        for (int c = 0; c < 3 && i < n_lines; c++) s->shift[c] = y[c][i] - q[c][i];
    }
}

static void invert_in_turn(const template_warp *w, template_stations *s)
{
    for (size_t l = 0; l < s->n_lines; l += LANES) invert_lines(w, s, l);
}
