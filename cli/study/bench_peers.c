/* Finds and starts "peers", other programs that make the same map, and reads their results. For the
 * protocol see bench/peers/peer.h. */
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <math.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "bench.h"
#include "report/terminal.h"
#include "sdm/image.h"
#include "sdm/memory.h"
#include "sdm/meshfile.h"

#define PREFIX "sdmgen-peer-"
enum { N_ARGUMENTS = 15, OUTPUT_MAX = 65536, PATH_SIZE = PATH_MAX };

extern char **environ;

/* The peers of this project, in the order of the table, and the packages they need. */
static const struct {
    const char *name, *packages;
} known[] = {{"vtk", "python3-vtk9"},           {"cgal", "libcgal-dev"},
             {"embree", "libembree-dev"},       {"openvdb", "libopenvdb-dev"},
             {"itk", "libinsighttoolkit5-dev"}, {"scipy", "python3-scipy python3-vtk9"}};
enum { N_KNOWN = sizeof known / sizeof *known };

/* ---- folders ---- */

static bool is_folder(const char *path)
{
    struct stat st;
    return stat(path, &st) == 0 && S_ISDIR(st.st_mode);
}

static int is_peer(const struct dirent *e) { return !strncmp(e->d_name, PREFIX, strlen(PREFIX)); }

/* *names = the sorted names of the peers in a folder; returns their number. free_names() frees. */
static int list_peers(const char *folder, struct dirent ***names)
{
    *names = NULL;
    const int n = scandir(folder, names, is_peer, alphasort);
    return n < 0 ? 0 : n;
}

static void free_names(struct dirent **names, int n)
{
    for (int i = 0; i < n; i++) free(names[i]);
    free(names);
}

/* folder = the folder of this program if it holds peers, as in a build; else libexec/sdmgen, as
 * after an installation. */
static void find_folder(char folder[PATH_SIZE])
{
    char self[PATH_SIZE / 2];
    const ssize_t length = readlink("/proc/self/exe", self, sizeof self - 1);
    self[length > 0 ? length : 0] = '\0';
    char *slash = strrchr(self, '/');
    if (slash) *slash = '\0';
    snprintf(folder, PATH_SIZE, "%s", self);
    struct dirent **names;
    const int n = list_peers(folder, &names);
    free_names(names, n);
    if (n == 0) snprintf(folder, PATH_SIZE, "%s/%s", self, SDM_PEER_FOLDER);
}

/* ---- one line of JSON ---- */

/* out[size] = the text or number of `key` in a flat object, without quotes; false: no such key. */
static bool json_value(const char *line, const char *key, char *out, size_t size)
{
    char quoted[64];
    snprintf(quoted, sizeof quoted, "\"%s\":", key);
    const char *at = strstr(line, quoted);
    if (!at) return false;
    at += strlen(quoted);
    at += strspn(at, " ");
    const bool text = *at == '"';
    if (text) at++;
    size_t n = 0;
    for (; *at && n + 1 < size && (text ? *at != '"' : !strchr(",} \n", *at)); at++) {
        if (text && *at == '\\' && at[1]) at++;
        out[n++] = *at;
    }
    out[n] = '\0';
    return true;
}

static bool json_number(const char *line, const char *key, double *out)
{
    char word[64];
    return json_value(line, key, word, sizeof word) && sdm_parse_real(word, out);
}

/* ---- one program ---- */

/* Runs a program; output = its stdout and stderr, cut at OUTPUT_MAX. Returns its exit code, -1 if
 * it cannot be started or was killed. */
static int run_program(char **arguments, char output[OUTPUT_MAX])
{
    int ends[2], status = -1;
    pid_t child;
    posix_spawn_file_actions_t actions;
    size_t n = 0;
    // start the program with its output in a pipe
    output[0] = '\0';
    if (pipe(ends)) return -1;
    (void)fcntl(ends[0], F_SETFD, FD_CLOEXEC);
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
    posix_spawn_file_actions_adddup2(&actions, ends[1], STDERR_FILENO);
    posix_spawn_file_actions_addclose(&actions, ends[1]);
    const int failed = posix_spawn(&child, arguments[0], &actions, NULL, arguments, environ);
    posix_spawn_file_actions_destroy(&actions);
    close(ends[1]);
    // read the output
    char block[4096];
    for (ssize_t got; !failed && ((got = read(ends[0], block, sizeof block)) > 0 ||
                                  (got < 0 && errno == EINTR));)
        for (ssize_t i = 0; i < got && n + 1 < OUTPUT_MAX; i++) output[n++] = block[i];
    output[n] = '\0';
    close(ends[0]);
    // get the exit code
    if (failed) {
        snprintf(output, OUTPUT_MAX, "cannot be started: %s", strerror(failed));
        return -1;
    }
    while (waitpid(child, &status, 0) < 0 && errno == EINTR) continue;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

/* Returns the last line that is a JSON object, else the last line. Splits `output` into lines. */
static char *result_line(char *output)
{
    char *json = NULL, *last = output;
    for (char *line = strtok(output, "\n"); line; line = strtok(NULL, "\n")) {
        if (*line == '{') json = line;
        last = line;
    }
    return json ? json : last;
}

/* Stores in *row the figures of the JSON line and the errors of the values, which are read from
   values_path; stores the values in out (may be NULL). After a failure row->done is false and
   row->note is the reason. */
static void read_result(const cli_bench_case *c, const char *line, int code,
                        const char *values_path, float *out, cli_bench_row *row)
{
    char version[64] = "", note[160] = "";
    double kb = -1, *values = NULL;
    size_t shape[4] = {0};
    int n_dim = 0;
    sdm_error err = {0};
    // times
    if (json_value(line, "error", row->note, sizeof row->note)) return;
    if (code != 0 || !json_number(line, "prepare_ms", &row->ms_prepare) ||
        !json_number(line, "map_ms", &row->ms_map) || !json_number(line, "share", &row->share) ||
        !(row->share > 0)) {
        snprintf(row->note, sizeof row->note, "no result, exit code %d: %.180s", code, line);
        return;
    }
    row->ms_map /= row->share;
    // memory and note
    (void)json_number(line, "peak_kb", &kb);
    row->peak_mb = kb < 0 ? NAN : kb / 1024;
    (void)json_value(line, "version", version, sizeof version);
    (void)json_value(line, "note", note, sizeof note);
    char band[8] = "";
    const bool no_band =
        isfinite(c->band_mm) && json_value(line, "band", band, sizeof band) && strcmp(band, "true");
    snprintf(row->note, sizeof row->note, "%s: %s%s", version, note, no_band ? "; whole map" : "");
    // values
    float *single = NULL;
    sdm_status s = sdm_npy_read(values_path, &values, shape, &n_dim, &err);
    const size_t wanted[3] = {(size_t)c->grid.n[2], (size_t)c->grid.n[1], (size_t)c->grid.n[0]};
    if (!s && (n_dim != 3 || memcmp(shape, wanted, sizeof wanted) != 0))
        s = sdm_fail(&err, SDM_E_FORMAT, "its values have another size than the grid");
    if (!s) s = SDM_ALLOC(&single, c->voxels, "values of another program", &err);
    for (size_t i = 0; i < c->voxels && !s; i++) single[i] = (float)values[i];
    // errors
    row->done = !s;
    if (s)
        snprintf(row->note, sizeof row->note, "%.200s", err.text);
    else
        cli_bench_compare(c, single, row);
    if (!s && out) memcpy(out, single, c->voxels * sizeof *out);
    sdm_free(single);
    sdm_free(values);
}

/* The folder of the peers, a temporary folder, and the files in it for the mesh and the values. */
typedef struct workplace {
    char folder[PATH_SIZE], work[PATH_SIZE / 2], mesh_path[PATH_SIZE], values_path[PATH_SIZE];
} workplace;

static sdm_status measure_peer(const cli_bench_case *c, const workplace *w, const char *name,
                               float *values, cli_bench_row *row, sdm_error *err)
{
    char program[PATH_SIZE + 300], number[12][32], *output = NULL;
    sdm_status s = SDM_ALLOC(&output, OUTPUT_MAX, "output of another program", err);
    if (s) return s;
    snprintf(program, sizeof program, "%s/" PREFIX "%s", w->folder, name);
    for (int i = 0; i < 3; i++) {
        snprintf(number[i], sizeof number[i], "%lld", (long long)c->grid.n[i]);
        sdm_format_real(c->grid.origin[i], number[3 + i]);
        sdm_format_real(c->grid.spacing[i], number[6 + i]);
    }
    sdm_format_real(c->share, number[9]);
    sdm_format_real(isfinite(c->band_mm) ? c->band_mm : 0, number[10]);
    snprintf(number[11], sizeof number[11], "%zu", c->repeat);
    char *arguments[N_ARGUMENTS + 1] = {program, (char *)w->mesh_path};
    for (int i = 0; i < 12; i++) arguments[2 + i] = number[i];
    arguments[14] = (char *)w->values_path;
    (void)unlink(w->values_path);
    const int code = run_program(arguments, output);
    read_result(c, result_line(output), code, w->values_path, values, row);
    sdm_free(output);
    return cli_check_interrupt(err);
}

static void note_missing(size_t k, cli_bench_row *row)
{
    const char *packages = k < N_KNOWN ? known[k].packages : "its packages";
    snprintf(row->note, sizeof row->note, "not built: install %s and configure with -DSDM_PEERS=ON",
             packages);
}

/* Measures the known peers in the order of their table, then the others in the folder. */
static sdm_status measure_all(const cli_bench_case *c, const workplace *w, cli_bench_rows *rows,
                              sdm_error *err)
{
    cli_bench_row *row = NULL;
    struct dirent **names;
    const int n = list_peers(w->folder, &names);
    sdm_status s = SDM_OK;
    for (size_t k = 0; k < N_KNOWN && !s; k++) {
        bool found = false;
        for (int i = 0; i < n; i++)
            found |= !strcmp(names[i]->d_name + strlen(PREFIX), known[k].name);
        s = cli_bench_add(rows, known[k].name, &row, err);
        if (!s && found) s = measure_peer(c, w, known[k].name, NULL, row, err);
        if (!s && !found) note_missing(k, row);
    }
    for (int i = 0; i < n && !s; i++) {
        const char *name = names[i]->d_name + strlen(PREFIX);
        bool done = false;
        for (size_t k = 0; k < N_KNOWN; k++) done |= !strcmp(name, known[k].name);
        if (done) continue;
        s = cli_bench_add(rows, name, &row, err);
        if (!s) s = measure_peer(c, w, name, NULL, row, err);
    }
    free_names(names, n);
    return s;
}

static sdm_status open_workplace(const cli_bench_case *c, const char *folder, workplace *w,
                                 sdm_error *err)
{
    const char *temporary = getenv("TMPDIR");
    if (folder && !is_folder(folder))
        return sdm_fail(err, SDM_E_ARG,
                        "--peers '%.200s': no such folder (none: run no other programs)", folder);
    if (folder)
        snprintf(w->folder, sizeof w->folder, "%s", folder);
    else
        find_folder(w->folder);
    snprintf(w->work, sizeof w->work, "%.1000s/sdmgen-bench-XXXXXX",
             temporary && *temporary ? temporary : "/tmp");
    if (!mkdtemp(w->work))
        return sdm_fail(err, SDM_E_IO, "cannot make a folder for temporary files: %s: %s", w->work,
                        strerror(errno));
    snprintf(w->mesh_path, sizeof w->mesh_path, "%s/mesh.ply", w->work);
    snprintf(w->values_path, sizeof w->values_path, "%s/values.npy", w->work);
    return sdm_mesh_write(w->mesh_path, &c->mesh, err);
}

static void close_workplace(const workplace *w)
{
    if (!*w->values_path) return;
    (void)unlink(w->mesh_path);
    (void)unlink(w->values_path);
    (void)rmdir(w->work);
}

sdm_status cli_bench_peers(const cli_bench_case *c, const cli_args *args, cli_bench_rows *rows,
                           sdm_error *err)
{
    workplace w = {.work = ""};
    if (args->peers && !strcmp(args->peers, "none")) return SDM_OK;
    sdm_status s = open_workplace(c, args->peers, &w, err);
    if (!s) s = measure_all(c, &w, rows, err);
    close_workplace(&w);
    return s;
}

/* ---- measuring one peer by its name ---- */

static size_t find_known(const char *name)
{
    size_t k = 0;
    while (k < N_KNOWN && strcmp(known[k].name, name) != 0) k++;
    return k;
}

const char *cli_bench_peer_name(size_t i) { return i < N_KNOWN ? known[i].name : NULL; }

sdm_status cli_bench_peer(const cli_bench_case *c, const cli_args *args, const char *name,
                          float *values, cli_bench_row *row, sdm_error *err)
{
    char program[PATH_SIZE + 300];
    workplace w = {.work = ""};
    if (args->peers && !strcmp(args->peers, "none")) {
        snprintf(row->note, sizeof row->note, "not run: --peers none");
        return SDM_OK;
    }
    sdm_status s = open_workplace(c, args->peers, &w, err);
    snprintf(program, sizeof program, "%s/" PREFIX "%s", w.folder, name);
    if (!s && access(program, X_OK) != 0)
        note_missing(find_known(name), row);
    else if (!s)
        s = measure_peer(c, &w, name, values, row, err);
    close_workplace(&w);
    return s;
}
