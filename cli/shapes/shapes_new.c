/* sdmgen shapes new: writes a new plug-in from the files of examples/pebble, which the build puts
 * into this program. */
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "inputs/setup.h"
#include "report/terminal.h"
#include "sdm/internal/file.h"
#include "shapes_command.h"

#define EXAMPLE "pebble"
enum { PATH_SIZE = PATH_MAX };

/* The files of the example; their names and contents have EXAMPLE where the new name comes. */
static const struct {
    const char *name, *content;
    size_t size;
} files[] = {
#include <scaffold_files.inc> // made by cli/CMakeLists.txt
};
enum { N_FILES = sizeof files / sizeof *files };

/* Appends the text with `name` in place of EXAMPLE. */
static void add_renamed(sdm_text *out, const char *text, const char *name)
{
    for (const char *at; (at = strstr(text, EXAMPLE)); text = at + strlen(EXAMPLE))
        sdm_text_add(out, "%.*s%s", (int)(at - text), text, name);
    sdm_text_add(out, "%s", text);
}

/* *out = the path of file `index` of the new shape, to be freed with sdm_text_dispose(). */
static sdm_status make_path(const char *folder, size_t index, const char *name, sdm_text *out,
                            sdm_error *err)
{
    sdm_text_add(out, "%s/", folder);
    add_renamed(out, files[index].name, name);
    return out->failed ? sdm_fail(err, SDM_E_NOMEM, "no memory for a file name") : SDM_OK;
}

static sdm_status write_file(const char *folder, size_t index, const char *name, sdm_error *err)
{
    sdm_text path = {0}, content = {0};
    sdm_status s = make_path(folder, index, name, &path, err);
    add_renamed(&content, files[index].content, name);
    if (!s && content.failed) s = sdm_fail(err, SDM_E_NOMEM, "no memory for %s", path.data);
    if (!s) s = sdm_file_write(path.data, content.data, content.size, err);
    sdm_text_dispose(&content);
    sdm_text_dispose(&path);
    return s;
}

/* Removes the first n files and the folder. */
static void remove_folder(const char *folder, size_t n, const char *name)
{
    for (size_t i = 0; i < n; i++) {
        sdm_text path = {0};
        if (!make_path(folder, i, name, &path, NULL)) (void)unlink(path.data);
        sdm_text_dispose(&path);
    }
    (void)rmdir(folder);
}

static sdm_status write_folder(const char *folder, const char *name, sdm_error *err)
{
    const int failed = mkdir(folder, 0777) != 0 ? errno : 0;
    if (failed == EEXIST)
        return sdm_fail(err, SDM_E_IO, "%s exists already: choose another folder with --out DIR",
                        folder);
    if (failed) return sdm_fail(err, SDM_E_IO, "%s: %s", folder, strerror(failed));
    sdm_status s = SDM_OK;
    for (size_t i = 0; i < N_FILES && !s; i++) {
        s = write_file(folder, i, name, err);
        if (s) remove_folder(folder, i, name);
    }
    return s;
}

static sdm_status check_name(const cli_args *args, const char *name, sdm_error *err)
{
    if (!sdm_is_name(name))
        return sdm_fail(err, SDM_E_ARG, "shapes new: '%.100s' is no name: " SDM_NAME_RULE, name);
    static const char *const targets[] = {"all", "clean", "help", "install", "package", "test"};
    for (size_t i = 0; i < sizeof targets / sizeof *targets; i++)
        if (!strcmp(name, targets[i]))
            return sdm_fail(err, SDM_E_ARG,
                            "shapes new: '%s' is the name of a target of CMake: choose another",
                            name);
    sdm_registry *registry = NULL;
    sdm_status s = cli_open_registry(args, &registry, err);
    if (!s && sdm_registry_find(registry, name, NULL))
        s = sdm_fail(err, SDM_E_ARG,
                     "shapes new: there is a shape '%s' already: choose another name", name);
    sdm_registry_free(registry);
    return s;
}

/* prefix = the folder in which CMake finds the package of this program: two levels above it, after
 * an installation (PREFIX/bin/sdmgen) as well as in a build (BUILD/cli/sdmgen). */
static void find_prefix(char prefix[PATH_SIZE])
{
    const ssize_t length = readlink("/proc/self/exe", prefix, PATH_SIZE - 1);
    prefix[length > 0 ? length : 0] = '\0';
    for (int i = 0; i < 2; i++) {
        char *slash = strrchr(prefix, '/');
        if (slash) *slash = '\0';
    }
    if (!*prefix) strcpy(prefix, "PREFIX");
}

/* Prints the files and the next commands. */
static void print_text(const char *folder, const char *name, const char *prefix)
{
    printf("%s:", folder);
    for (size_t i = 0; i < N_FILES; i++) {
        sdm_text file = {0};
        add_renamed(&file, files[i].name, name);
        if (!file.failed) printf(" %s", file.data);
        sdm_text_dispose(&file);
    }
    printf("\n\nnext:\n"
           "  cmake -S %s -B %s/build -DCMAKE_PREFIX_PATH=%s\n"
           "  cmake --build %s/build\n"
           "  ctest --test-dir %s/build --output-on-failure\n"
           "  sdmgen shapes check %s -o %s.png --plugin %s/build/%s.so\n"
           "  sdmgen exact --shape %s -o %s-slices.png --plugin %s/build/%s.so\n"
           "  sdmgen train %s/%s.yaml --plugin %s/build/%s.so\n",
           folder, folder, prefix, folder, folder, name, name, folder, name, name, name, folder,
           name, folder, name, folder, name);
}

static sdm_status print_json(const char *folder, const char *name, const char *prefix,
                             sdm_error *err)
{
    sdm_json j = {0};
    sdm_json_open(&j, NULL, '{');
    sdm_json_text(&j, "folder", folder);
    sdm_json_text(&j, "prefix", prefix);
    sdm_json_open(&j, "files", '[');
    for (size_t i = 0; i < N_FILES; i++) {
        sdm_text file = {0};
        add_renamed(&file, files[i].name, name);
        if (!file.failed) sdm_json_text(&j, NULL, file.data);
        sdm_text_dispose(&file);
    }
    sdm_json_close(&j, ']');
    sdm_json_close(&j, '}');
    return cli_print_json(&j, err);
}

sdm_status cli_shapes_new(const cli_args *args, sdm_error *err)
{
    if (args->files.n < 2) return sdm_fail(err, SDM_E_ARG, "usage: sdmgen shapes new NAME");
    const char *name = args->files.items[1], *folder = args->out ? args->out : name;
    if (args->files.n > 2)
        return sdm_fail(err, SDM_E_ARG, "shapes new: unexpected argument '%s'",
                        args->files.items[2]);
    if (args->options.n > 0 || args->outputs.n > 0)
        return sdm_fail(err, SDM_E_ARG, "shapes new takes no -O and no -o");
    sdm_status s = check_name(args, name, err);
    if (!s) s = write_folder(folder, name, err);
    if (s) return s;
    char prefix[PATH_SIZE];
    find_prefix(prefix);
    if (args->json) return print_json(folder, name, prefix, err);
    print_text(folder, name, prefix);
    return SDM_OK;
}
