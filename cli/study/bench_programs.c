/* Other programs that a benchmark compares with (peers): finds them in a folder, starts them, and
 * reads the times that they print. */
#include "bench_programs.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "sdm/internal/text.h"
#include "sdm/memory.h"
#include "sdm/meshfile.h"

#define PREFIX "sdmgen-peer-"
enum { OUTPUT_MAX = 65536, ARGUMENTS_MAX = 16, NAME_SIZE = 256 };

extern char **environ;

/* The peers of this project, in the order of the table, and the packages they need. */
static const struct {
    const char *name, *packages;
} known[] = {{"vtk", "python3-vtk9"},           {"cgal", "libcgal-dev"},
             {"embree", "libembree-dev"},       {"openvdb", "libopenvdb-dev"},
             {"itk", "libinsighttoolkit5-dev"}, {"scipy", "python3-scipy python3-vtk9"}};
enum { N_KNOWN = sizeof known / sizeof *known };

static size_t find_known(const char *name)
{
    size_t k = 0;
    while (k < N_KNOWN && strcmp(known[k].name, name) != 0) k++;
    return k;
}

const char *cli_peers_known(size_t i) { return i < N_KNOWN ? known[i].name : NULL; }

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
static void find_folder(char folder[CLI_PEER_PATH])
{
    char self[CLI_PEER_PATH / 2];
    const ssize_t length = readlink("/proc/self/exe", self, sizeof self - 1);
    self[length > 0 ? length : 0] = '\0';
    char *slash = strrchr(self, '/');
    if (slash) *slash = '\0';
    snprintf(folder, CLI_PEER_PATH, "%s", self);
    struct dirent **names;
    const int n = list_peers(folder, &names);
    free_names(names, n);
    if (n == 0) snprintf(folder, CLI_PEER_PATH, "%s/%s", self, SDM_PEER_FOLDER);
}

/* Sets p->names; the names of other peers stand behind them in the same memory. */
static sdm_status set_names(cli_peers *p, sdm_error *err)
{
    struct dirent **found;
    const int n = list_peers(p->folder, &found);
    const size_t most = N_KNOWN + (size_t)n;
    sdm_status s = sdm_alloc((void **)&p->names, most, sizeof *p->names + NAME_SIZE,
                             "names of other programs", err);
    char *text = s ? NULL : (char *)(p->names + most);
    for (size_t k = 0; k < N_KNOWN && !s; k++) p->names[p->n++] = known[k].name;
    for (int i = 0; i < n && !s; i++) {
        const char *name = found[i]->d_name + strlen(PREFIX);
        if (find_known(name) < N_KNOWN) continue;
        snprintf(text, NAME_SIZE, "%s", name);
        p->names[p->n++] = text;
        text += NAME_SIZE;
    }
    free_names(found, n);
    return s;
}

sdm_status cli_peers_open(const char *folder, const sdm_mesh *mesh, cli_peers *p, sdm_error *err)
{
    const char *temporary = getenv("TMPDIR");
    if (folder && !is_folder(folder))
        return sdm_fail(err, SDM_E_ARG,
                        "--peers '%.200s': no such folder (none: run no other programs)", folder);
    if (folder)
        snprintf(p->folder, sizeof p->folder, "%s", folder);
    else
        find_folder(p->folder);
    const sdm_status s = set_names(p, err);
    if (s) return s;
    snprintf(p->work, sizeof p->work, "%.1000s/sdmgen-bench-XXXXXX",
             temporary && *temporary ? temporary : "/tmp");
    if (!mkdtemp(p->work))
        return sdm_fail(err, SDM_E_IO, "cannot make a folder for temporary files: %s: %s", p->work,
                        strerror(errno));
    snprintf(p->mesh_path, sizeof p->mesh_path, "%s/mesh.ply", p->work);
    snprintf(p->points_path, sizeof p->points_path, "%s/points.npy", p->work);
    snprintf(p->values_path, sizeof p->values_path, "%s/values.npy", p->work);
    return sdm_mesh_write(p->mesh_path, mesh, err);
}

void cli_peers_close(cli_peers *p)
{
    sdm_free(p->names);
    if (!*p->values_path) return;
    (void)unlink(p->mesh_path);
    (void)unlink(p->points_path);
    (void)unlink(p->values_path);
    (void)rmdir(p->work);
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

/* Fills *answer from the JSON line. */
static void read_answer(const char *line, int code, cli_peer_answer *answer)
{
    char version[64] = "", note[160] = "", band[8] = "";
    double kb = -1;
    if (json_value(line, "error", answer->note, sizeof answer->note)) return;
    if (code != 0 || !json_number(line, "prepare_ms", &answer->ms_prepare) ||
        !json_number(line, "map_ms", &answer->ms_map) ||
        !json_number(line, "share", &answer->share) || !(answer->share > 0)) {
        snprintf(answer->note, sizeof answer->note, "no result, exit code %d: %.180s", code, line);
        return;
    }
    (void)json_number(line, "peak_kb", &kb);
    answer->peak_mb = kb < 0 ? NAN : kb / 1024;
    (void)json_value(line, "version", version, sizeof version);
    (void)json_value(line, "note", note, sizeof note);
    answer->band = !json_value(line, "band", band, sizeof band) || !strcmp(band, "true");
    snprintf(answer->note, sizeof answer->note, "%s: %s", version, note);
    answer->done = true;
}

sdm_status cli_peers_run(const cli_peers *p, const char *name, char *const *argument, size_t n,
                         cli_peer_answer *answer, sdm_error *err)
{
    char program[CLI_PEER_PATH + 300], *arguments[ARGUMENTS_MAX + 1] = {0}, *output = NULL;
    *answer = (cli_peer_answer){.done = false};
    snprintf(program, sizeof program, "%s/" PREFIX "%s", p->folder, name);
    const size_t k = find_known(name);
    if (k < N_KNOWN && access(program, F_OK) != 0) {
        snprintf(answer->note, sizeof answer->note,
                 "not built: install %s and configure with -DSDM_PEERS=ON", known[k].packages);
        return SDM_OK;
    }
    const sdm_status s = SDM_ALLOC(&output, OUTPUT_MAX, "output of another program", err);
    if (s) return s;
    arguments[0] = program;
    arguments[1] = (char *)p->mesh_path;
    for (size_t i = 0; i < n && i + 3 < ARGUMENTS_MAX; i++) arguments[2 + i] = argument[i];
    arguments[2 + n] = (char *)p->values_path;
    (void)unlink(p->values_path);
    const int code = run_program(arguments, output);
    read_answer(result_line(output), code, answer);
    sdm_free(output);
    return SDM_OK;
}
