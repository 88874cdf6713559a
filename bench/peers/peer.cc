/* Runs a peer program: reads its arguments, measures time and memory, writes the results. */
#include "peer.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <limits>
#include <stdexcept>
#include <vector>
#ifdef __GLIBC__
#include <malloc.h>
#endif

#include "sdm/image.h"
#include "sdm/internal/text.h"
#include "sdm/memory.h"
#include "sdm/meshfile.h"

namespace
{

constexpr double time_limit_s = 3; // no run starts after this

double clock_s(clockid_t clock)
{
    timespec t{};
    (void)clock_gettime(clock, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

/* The number in the line "NAME:  123 kB" of /proc/self/status; -1: no such line. */
long status_kb(const char *name)
{
    FILE *f = std::fopen("/proc/self/status", "r");
    char line[256];
    long kb = -1;
    while (f && std::fgets(line, sizeof line, f))
        if (!std::strncmp(line, name, std::strlen(name)))
            kb = std::strtol(line + std::strlen(name) + 1, nullptr, 10);
    if (f) std::fclose(f);
    return kb;
}

/* Resets the peak of the resident memory (Linux); returns the memory resident now, kB, -1:
 * unknown. */
long start_peak()
{
#ifdef __GLIBC__
    malloc_trim(0);
#endif
    FILE *f = std::fopen("/proc/self/clear_refs", "w");
    if (!f) return -1;
    std::fputs("5", f);
    return std::fclose(f) ? -1 : status_kb("VmRSS");
}

double parse_real(const char *text)
{
    double v = 0;
    if (!sdm_parse_real(text, &v)) throw std::runtime_error(std::string("not a number: ") + text);
    return v;
}

void throw_error(sdm_status s, const sdm_error &err)
{
    if (s) throw std::runtime_error(err.text);
}

void read_points(const char *path, peer::job &j)
{
    double *values = nullptr;
    size_t shape[4] = {0};
    int n_dim = 0;
    sdm_error err{};
    throw_error(sdm_npy_read(path, &values, shape, &n_dim, &err), err);
    const bool right = n_dim == 2 && shape[0] > 0 && shape[1] == 3;
    if (right) j.points.assign(values, values + 3 * shape[0]);
    sdm_free(values);
    if (!right) throw std::runtime_error(std::string(path) + ": not points of [n][3]");
}

void read_job(int argc, char **argv, peer::job &j)
{
    if (argc != 5 && argc != 15)
        throw std::runtime_error(
            "arguments: MESH NX NY NZ OX OY OZ SX SY SZ SHARE BAND REPEAT VALUES.npy, or MESH "
            "POINTS.npy REPEAT VALUES.npy");
    sdm_error err{};
    throw_error(sdm_mesh_read(argv[1], &j.mesh, &err), err);
    if (argc == 5) {
        read_points(argv[2], j);
        j.repeat = static_cast<int>(parse_real(argv[3]));
        return;
    }
    const double zero[3] = {0, 0, 0};
    int64_t n[3];
    for (int i = 0; i < 3; i++) n[i] = static_cast<int64_t>(parse_real(argv[2 + i]));
    j.grid = sdm_grid_centred(n, 1, zero);
    for (int i = 0; i < 3; i++) {
        j.grid.origin[i] = parse_real(argv[5 + i]);
        j.grid.spacing[i] = parse_real(argv[8 + i]);
    }
    throw_error(sdm_grid_check(&j.grid, &err), err);
    j.share = parse_real(argv[11]);
    j.band = parse_real(argv[12]);
    j.repeat = static_cast<int>(parse_real(argv[13]));
}

/* Fraction of the rows for which has_row() is true. */
double row_share(const peer::job &j)
{
    if (!j.points.empty()) return 1;
    const int64_t rows = j.grid.n[1] * j.grid.n[2];
    int64_t done = 0;
    for (int64_t r = 0; r < rows; r++) done += j.has_row(r);
    return static_cast<double>(done) / static_cast<double>(rows);
}

void measure(const char *path, const peer::job &j, const peer::about &a,
             const std::function<peer::map_function(const peer::job &)> &prepare)
{
    // the fastest of several runs
    if (!j.points.empty() && !a.points) throw std::runtime_error("no distances at single points");
    const bool at_points = !j.points.empty();
    std::vector<float> values(at_points ? j.points.size() / 3 : sdm_grid_count(&j.grid),
                              std::numeric_limits<float>::quiet_NaN());
    double prepare_s = HUGE_VAL, map_s = HUGE_VAL;
    const long before = start_peak();
    long peak = -1;
    const double begin = clock_s(CLOCK_MONOTONIC);
    for (int i = 0;
         i < std::max(1, j.repeat) && (i == 0 || clock_s(CLOCK_MONOTONIC) - begin < time_limit_s);
         i++) {
        const double start = clock_s(CLOCK_PROCESS_CPUTIME_ID);
        const peer::map_function map = prepare(j);
        const double ready = clock_s(CLOCK_PROCESS_CPUTIME_ID);
        map(values.data());
        const double end = clock_s(CLOCK_PROCESS_CPUTIME_ID);
        if (end - start < prepare_s + map_s) {
            prepare_s = ready - start;
            map_s = end - ready;
        }
        if (i == 0 && before >= 0) peak = std::max(0L, status_kb("VmHWM") - before);
    }
    // the values
    const size_t shape[3] = {at_points ? values.size() : static_cast<size_t>(j.grid.n[2]),
                             static_cast<size_t>(j.grid.n[1]), static_cast<size_t>(j.grid.n[0])};
    sdm_error err{};
    throw_error(sdm_npy_write(path, values.data(), shape, at_points ? 1 : 3, &err), err);

    // the line of JSON
    sdm_json out{};
    sdm_json_open(&out, nullptr, '{');
    sdm_json_real(&out, "prepare_ms", 1e3 * prepare_s);
    sdm_json_real(&out, "map_ms", 1e3 * map_s);
    sdm_json_real(&out, "share", a.whole ? 1 : row_share(j));
    sdm_json_int(&out, "peak_kb", peak);
    sdm_json_bool(&out, "band", a.band);
    sdm_json_text(&out, "version", a.version.c_str());
    sdm_json_text(&out, "note", a.note.c_str());
    sdm_json_close(&out, '}');
    if (!out.text.failed) std::puts(out.text.data);
    sdm_json_dispose(&out);
}

} // namespace

int peer::run(int argc, char **argv, const about &a,
              const std::function<map_function(const job &)> &prepare)
{
    job j;
    int code = 0;
    try {
        read_job(argc, argv, j);
        measure(argv[argc - 1], j, a, prepare);
    } catch (const std::exception &e) {
        sdm_json out{};
        sdm_json_open(&out, nullptr, '{');
        sdm_json_text(&out, "error", e.what());
        sdm_json_close(&out, '}');
        if (!out.text.failed) std::puts(out.text.data);
        sdm_json_dispose(&out);
        code = 1;
    }
    sdm_mesh_dispose(&j.mesh);
    return code;
}
