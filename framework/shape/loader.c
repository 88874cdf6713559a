/* Loads plug-ins from shared objects. */
#define _XOPEN_SOURCE 700 // for realpath()
#include <dirent.h>
#include <dlfcn.h>
#ifdef __ELF__
#include <elf.h>
#endif
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "isolated_protocol.h"
#include "sdm/internal/file.h"
#include "sdm/memory.h"

#define FILE_SHAPES_MAX 256
#define FILE_BYTES_MAX (UINT64_C(1) << 28)

static void object_close(void *object) { (void)dlclose(object); }

static sdm_status shapes_add_all(sdm_registry *r, sdm_plugin_entry plugin_shape, const char *path,
                                 sdm_error *err)
{
    for (uint32_t i = 0;; i++) {
        const sdm_shape *shape = plugin_shape(i);
        if (!shape && i == 0)
            return sdm_fail(err, SDM_E_PLUGIN,
                            "%s: has no shape: " SDM_PLUGIN_SYMBOL "(0) gives NULL", path);
        if (!shape) return SDM_OK;
        if (i == FILE_SHAPES_MAX)
            return sdm_fail(err, SDM_E_PLUGIN,
                            "%s: more than %d shapes: " SDM_PLUGIN_SYMBOL
                            "() must give NULL behind the last",
                            path, FILE_SHAPES_MAX);
        const sdm_status s = sdm_registry_add(r, shape, path, err);
        if (s) return s;
    }
}

/* True when both files hold the same bytes; unreadable files do not. */
static bool is_same_file(const char *a, const char *b)
{
    if (!strcmp(a, b)) return true;
    struct stat of_a, of_b;
    if (stat(a, &of_a) || stat(b, &of_b) || of_a.st_size != of_b.st_size) return false;
    if (of_a.st_dev == of_b.st_dev && of_a.st_ino == of_b.st_ino) return true;
    uint8_t *bytes_a = NULL, *bytes_b = NULL;
    size_t n_a, n_b;
    const bool same = !sdm_file_read(a, FILE_BYTES_MAX, &bytes_a, &n_a, NULL) &&
                      !sdm_file_read(b, FILE_BYTES_MAX, &bytes_b, &n_b, NULL) && n_a == n_b &&
                      memcmp(bytes_a, bytes_b, n_a) == 0;
    sdm_free(bytes_a);
    sdm_free(bytes_b);
    return same;
}

static bool is_loaded(const sdm_registry *r, const char *path)
{
    const char *kept;
    for (size_t i = 0; (kept = sdm_registry_kept(r, i)); i++)
        if (is_same_file(kept, path)) return true;
    return false;
}

/* Refuses a file that is shorter than the segments that its ELF header announces: dlopen() maps
 * them, and their first use would end the program. Other files are left to dlopen(). */
static sdm_status check_complete(const char *path, sdm_error *err)
{
    uint8_t *bytes = NULL;
    size_t size;
    if (sdm_file_read(path, FILE_BYTES_MAX, &bytes, &size, NULL)) return SDM_OK;
    uint64_t end = 0;
#if defined(__ELF__) && UINTPTR_MAX == UINT64_MAX
    Elf64_Ehdr head;
    if (size >= sizeof head && !memcmp(bytes, ELFMAG, SELFMAG) && bytes[EI_CLASS] == ELFCLASS64) {
        memcpy(&head, bytes, sizeof head);
        end = head.e_phoff + (uint64_t)head.e_phnum * sizeof(Elf64_Phdr);
        for (size_t i = 0; end <= size && i < head.e_phnum; i++) {
            Elf64_Phdr segment;
            memcpy(&segment, bytes + head.e_phoff + i * sizeof segment, sizeof segment);
            if (segment.p_offset + segment.p_filesz > end)
                end = segment.p_offset + segment.p_filesz;
        }
    }
#endif
    sdm_free(bytes);
    return end <= size
               ? SDM_OK
               : sdm_fail(err, SDM_E_PLUGIN, "plug-in %s is not complete: %zu of %llu bytes", path,
                          size, (unsigned long long)end);
}

static sdm_status isolated_load(sdm_registry *r, const char *path, sdm_error *err)
{
    void *object = NULL;
    const size_t before = sdm_registry_count(r);
    sdm_status s = sdm_isolated_load(r, sdm_registry_isolation(r), path, &object, err);
    if (!s) s = sdm_registry_keep(r, path, object, sdm_isolated_close, err);
    if (!s) return SDM_OK;
    sdm_registry_shrink(r, before);
    if (object) sdm_isolated_close(object);
    return s;
}

/* Loads the file at an absolute path and adds its shapes. */
static sdm_status object_load(sdm_registry *r, const char *path, sdm_error *err)
{
    const sdm_status complete = check_complete(path, err);
    if (complete) return complete;
    if (sdm_registry_isolation(r)) return isolated_load(r, path, err);
    void *object = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!object) {
        const char *why = dlerror();
        return sdm_fail(err, SDM_E_PLUGIN, "plug-in %s cannot be loaded: %s%s", path,
                        why ? why : "unknown reason",
                        why && strstr(why, "ELF") ? "; a plug-in is a compiled shared object (.so)"
                                                  : "");
    }
    // call the entry function for all shapes of the file
    sdm_plugin_entry plugin_shape = NULL;
    *(void **)&plugin_shape = dlsym(object, SDM_PLUGIN_SYMBOL);
    const size_t before = sdm_registry_count(r);
    sdm_status s = plugin_shape ? shapes_add_all(r, plugin_shape, path, err)
                                : sdm_fail(err, SDM_E_PLUGIN,
                                           "%s: exports no function " SDM_PLUGIN_SYMBOL
                                           "(): not a plug-in, or hidden by -fvisibility",
                                           path);
    if (!s) s = sdm_registry_keep(r, path, object, object_close, err);
    if (s) {
        // add all shapes of a file or none
        sdm_registry_shrink(r, before);
        object_close(object);
    }
    return s;
}

sdm_status sdm_registry_load(sdm_registry *r, const char *file, sdm_error *err)
{
    if (!r || !file || !file[0])
        return sdm_fail(err, SDM_E_ARG, "registry and file are needed to load a plug-in");

    // absolute path, because dlopen() searches the system's library folders for a bare name
    char *path = realpath(file, NULL);
    if (!path) return sdm_fail(err, SDM_E_IO, "plug-in %s: %s", file, strerror(errno));
    const sdm_status s = is_loaded(r, path) ? SDM_OK : object_load(r, path, err);
    free(path);
    return s;
}

static int is_shared_object(const struct dirent *e)
{
    const size_t n = strlen(e->d_name);
    return n > 3 && strcmp(e->d_name + n - 3, ".so") == 0;
}

/* Loads a file of a folder; if it cannot be loaded, the registry keeps the reason. */
static sdm_status file_load_or_skip(sdm_registry *r, const char *folder, const char *name,
                                    sdm_error *err)
{
    char file[PATH_MAX];
    if (snprintf(file, sizeof file, "%s/%s", folder, name) >= (int)sizeof file)
        return sdm_fail(err, SDM_E_PLUGIN, "plug-in folder %s: path too long", folder);
    sdm_error why = {0};
    const sdm_status s = sdm_registry_load(r, file, &why);
    if (s == SDM_E_PLUGIN || s == SDM_E_IO) return sdm_registry_skip(r, why.text, false, err);
    return s ? sdm_fail(err, s, "%s", why.text) : SDM_OK;
}

/* Keeps the reason why a folder cannot be read: the other folders count all the same. */
static sdm_status folder_skip(sdm_registry *r, const char *folder, int error, sdm_error *err)
{
    char why[PATH_MAX + 200];
    snprintf(why, sizeof why, "plug-in folder %s: %s", folder, strerror(error));
    return sdm_registry_skip(r, why, true, err);
}

/* Loads in alphabetical order, so that of two files with a shape of the same name the same one is
 * skipped on all systems. */
static sdm_status folder_load(sdm_registry *r, const char *folder, sdm_error *err)
{
    struct dirent **list = NULL;
    const int n = scandir(folder, &list, is_shared_object, alphasort);
    if (n < 0) return folder_skip(r, folder, errno, err);
    sdm_status s = SDM_OK;
    for (int i = 0; i < n; i++) {
        if (!s) s = file_load_or_skip(r, folder, list[i]->d_name, err);
        free(list[i]);
    }
    free(list);
    return s;
}

sdm_status sdm_registry_load_path(sdm_registry *r, const char *path, sdm_error *err)
{
    if (!r) return sdm_fail(err, SDM_E_ARG, "a registry is needed to load plug-ins");
    for (const char *at = path; at && *at;) {
        const size_t n = strcspn(at, ":");
        char folder[PATH_MAX];
        if (n >= sizeof folder)
            return sdm_fail(err, SDM_E_PLUGIN, "plug-in path: a folder of %zu characters", n);
        memcpy(folder, at, n);
        folder[n] = '\0';
        if (n) {
            const sdm_status s = folder_load(r, folder, err);
            if (s) return s;
        }
        at += n + (at[n] == ':');
    }
    return SDM_OK;
}
