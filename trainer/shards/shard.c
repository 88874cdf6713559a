/* Reads and writes shards: containers with the sections meta, shard, params, sums and maps. */
#include "shard.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "sdm/internal/checksum.h"
#include "sdm/internal/container.h"
#include "sdm/internal/file.h"
#include "sdm/internal/heap.h"

/* An open file with the places of its sections. */
typedef struct shard_file {
    const char *path;
    int fd;
    uint64_t size;
    sdm_section_place places[SDM_CONTAINER_MAX_SECTIONS];
    size_t n;
} shard_file;

/* ---- reading ---- */

static sdm_status read_at(const shard_file *f, uint64_t at, void *out, size_t size, sdm_error *err)
{
    for (size_t done = 0; done < size;) {
        const ssize_t got = pread(f->fd, (char *)out + done, size - done, (off_t)(at + done));
        if (got < 0 && errno == EINTR) continue;
        if (got < 0)
            return sdm_fail(err, SDM_E_IO, "%s: cannot read: %s", f->path, strerror(errno));
        if (got == 0)
            return sdm_fail(err, SDM_E_FORMAT, "%s: truncated while it was read", f->path);
        done += (size_t)got;
    }
    return SDM_OK;
}

static sdm_status open_file(const char *path, shard_file *f, sdm_error *err)
{
    struct stat st;
    *f = (shard_file){.path = path, .fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK)};
    if (f->fd < 0) return sdm_fail(err, SDM_E_IO, "%s: cannot open: %s", path, strerror(errno));
    if (fstat(f->fd, &st) || !S_ISREG(st.st_mode))
        return sdm_fail(err, SDM_E_IO, "%s: not a regular file", path);
    f->size = (uint64_t)st.st_size;
    return SDM_OK;
}

static void close_file(shard_file *f)
{
    if (f->fd >= 0) close(f->fd);
}

static sdm_status read_places(shard_file *f, sdm_error *err)
{
    uint8_t head[SDM_CONTAINER_HEAD_BYTES] = {0};
    const size_t n = f->size < sizeof head ? (size_t)f->size : sizeof head;
    sdm_status s = read_at(f, 0, head, n, err);
    if (s) return s;
    s = sdm_container_places(head, f->size, f->places, &f->n, err);
    return s ? sdm_fail_in(err, s, "%s", f->path) : SDM_OK;
}

static const sdm_section_place *find(const shard_file *f, const char *name)
{
    for (size_t i = 0; i < f->n; i++)
        if (!strcmp(f->places[i].name, name)) return &f->places[i];
    return NULL;
}

/* Reads a section of `size` bytes; SIZE_MAX: any up to 1 MB. *out: a new block, followed by a zero
 * byte. */
static sdm_status read_section(const shard_file *f, const char *name, size_t size, void **out,
                               sdm_error *err)
{
    enum { TEXT_BYTES_MAX = 1000000 };
    const sdm_section_place *p = find(f, name);
    if (!p) return sdm_fail(err, SDM_E_FORMAT, "%s: not a shard of maps", f->path);
    if (size == SIZE_MAX ? p->size > TEXT_BYTES_MAX : p->size != size)
        return sdm_fail(err, SDM_E_FORMAT, "%s: damaged: section '%s' has %llu bytes", f->path,
                        name, (unsigned long long)p->size);
    uint8_t *bytes = NULL;
    sdm_status s = SDM_ALLOC(&bytes, (size_t)p->size + 1, f->path, err);
    *out = bytes;
    if (!s) s = read_at(f, p->at, bytes, (size_t)p->size, err);
    if (!s && sdm_crc64(0, bytes, (size_t)p->size) != p->checksum)
        s = sdm_fail(err, SDM_E_FORMAT, "%s: damaged: the checksum of section '%s' is wrong",
                     f->path, name);
    return s;
}

/* Compares the identity of a file with that of the configuration, line by line. */
static sdm_status check_identity(const char *path, const char *there, const char *here,
                                 sdm_error *err)
{
    while (*there || *here) {
        const size_t n = strcspn(there, "\n"), m = strcspn(here, "\n");
        const size_t key = strcspn(there, "=\n"), mine = strcspn(here, "=\n");
        const bool same_key = key == mine && !strncmp(there, here, key);
        if (!same_key)
            return sdm_fail(err, SDM_E_CONFIG,
                            "%s: its maps are those of another configuration: %.*s there, %.*s "
                            "here",
                            path, (int)n, there, (int)m, here);
        if (n != m || strncmp(there, here, n))
            return sdm_fail(err, SDM_E_CONFIG,
                            "%s: its maps are those of another configuration: %.*s is %.*s there, "
                            "%.*s here",
                            path, (int)key, there, (int)(n - key) - (n > key), there + key + 1,
                            (int)(m - key) - (m > key), here + key + 1);
        there += n + (there[n] == '\n');
        here += m + (here[m] == '\n');
    }
    return SDM_OK;
}

/* Reads the section `shard`: which maps these are. */
static sdm_status read_place(const shard_file *f, shard *s, sdm_error *err)
{
    char *text = NULL, set[16] = "";
    unsigned long long first = 0, n = 0;
    sdm_status status = read_section(f, "shard", SIZE_MAX, (void **)&text, err);
    const bool read = !status && sscanf(text, "version=%31s\nset=%15s\nfirst=%llu\nmaps=%llu\n",
                                        s->version, set, &first, &n) == 4;
    sdm_free(text);
    if (status) return status;
    char name[SHARD_NAME_MAX];
    const char *base = strrchr(f->path, '/');
    s->place = (shard_place){MAP_HOLDOUT, (size_t)first, (size_t)n};
    for (int i = 0; i < MAP_SETS; i++) {
        trainer_shard_name(&(shard_place){(map_set)i, (size_t)first, 0}, name);
        if (strcspn(name, "-") == strlen(set) && !strncmp(name, set, strlen(set)))
            s->place.set = (map_set)i;
    }
    trainer_shard_name(&s->place, name);
    if (!read || n < 1 || n > f->size)
        return sdm_fail(err, SDM_E_FORMAT, "%s: damaged: section 'shard'", f->path);
    if (strcmp(base ? base + 1 : f->path, name))
        return sdm_fail(err, SDM_E_FORMAT, "%s: this is %s under another name: rename it", f->path,
                        name);
    return SDM_OK;
}

static sdm_status read_shard(shard_file *f, const shard_form *form, shard *s, sdm_error *err)
{
    char *identity = NULL;
    sdm_status status = read_places(f, err);
    if (!status) status = read_section(f, "meta", SIZE_MAX, (void **)&identity, err);
    if (!status) status = read_place(f, s, err);
    if (!status) status = check_identity(f->path, identity, form->identity, err);
    sdm_free(identity);
    const size_t n = s->place.n;
    size_t params, maps;
    if (status || (status = sdm_mul(n, form->n_params * sizeof *s->params, &params, err)) ||
        (status = sdm_mul(n, form->n_voxels * sizeof(float), &maps, err)))
        return status;
    status = read_section(f, "params", params, (void **)&s->params, err);
    if (!status) status = read_section(f, "sums", n * sizeof *s->sums, (void **)&s->sums, err);
    if (status) return status;
    const sdm_section_place *p = find(f, "maps");
    if (!p || p->size != maps)
        return sdm_fail(err, SDM_E_FORMAT, "%s: damaged: section 'maps' has another size", f->path);
    s->maps_at = p->at;
    s->bytes = f->size;
    return SDM_OK;
}

/* Compares all checksums of the file. */
static sdm_status check_whole(const char *path, sdm_error *err)
{
    uint8_t *bytes;
    size_t size, n;
    uint64_t checksum;
    char names[SDM_CONTAINER_MAX_SECTIONS][24];
    sdm_section sections[SDM_CONTAINER_MAX_SECTIONS];
    sdm_status s = sdm_file_read(path, UINT64_MAX, &bytes, &size, err);
    if (s) return s;
    s = sdm_container_parse(bytes, size, sections, names, &n, &checksum, err);
    sdm_free(bytes);
    return s ? sdm_fail_in(err, s, "%s", path) : SDM_OK;
}

sdm_status trainer_shard_read(const char *path, const shard_form *form, bool whole, shard *out,
                              sdm_error *err)
{
    shard_file f;
    *out = (shard){.params = NULL};
    sdm_status s = open_file(path, &f, err);
    if (!s) s = read_shard(&f, form, out, err);
    close_file(&f);
    return s || !whole ? s : check_whole(path, err);
}

void trainer_shard_dispose(shard *s)
{
    sdm_free(s->params);
    sdm_free(s->sums);
    *s = (shard){.params = NULL};
}

sdm_status trainer_shard_map(const char *path, const shard *s, const shard_form *form, size_t k,
                             float *map, sdm_error *err)
{
    shard_file f;
    const size_t bytes = form->n_voxels * sizeof *map;
    sdm_status status = open_file(path, &f, err);
    if (!status) status = read_at(&f, s->maps_at + (uint64_t)k * bytes, map, bytes, err);
    close_file(&f);
    if (!status && sdm_crc64(0, map, bytes) != s->sums[k])
        status = sdm_fail(err, SDM_E_FORMAT,
                          "%s: damaged: the checksum of map %zu is wrong: `sdmgen dataset` makes "
                          "the file again",
                          path, s->place.first + k);
    return status;
}

/* ---- writing ---- */

sdm_status trainer_shard_write(const char *path, const shard_form *form, const shard_place *at,
                               const double *params, const float *maps, uint64_t *bytes,
                               sdm_error *err)
{
    char place[128], name[SHARD_NAME_MAX];
    uint8_t *file = NULL;
    uint64_t *sums = NULL;
    size_t size = 0;
    trainer_shard_name(at, name);
    snprintf(place, sizeof place, "version=" SDM_VERSION_TEXT "\nset=%.*s\nfirst=%zu\nmaps=%zu\n",
             (int)strcspn(name, "-"), name, at->first, at->n);
    sdm_status s = SDM_ALLOC(&sums, at->n, "checksums", err);
    const size_t map_bytes = form->n_voxels * sizeof *maps;
    for (size_t k = 0; k < at->n && !s; k++)
        sums[k] = sdm_crc64(0, maps + k * form->n_voxels, map_bytes);
    const sdm_section sections[] = {{"meta", form->identity, strlen(form->identity)},
                                    {"shard", place, strlen(place)},
                                    {"params", params, at->n * form->n_params * sizeof *params},
                                    {"sums", sums, at->n * sizeof *sums},
                                    {"maps", maps, at->n * map_bytes}};
    if (!s)
        s = sdm_container_build(sections, sizeof sections / sizeof *sections, &file, &size, err);
    if (!s) s = sdm_container_write(path, file, size, err);
    *bytes = size;
    sdm_free(file);
    sdm_free(sums);
    return s;
}
