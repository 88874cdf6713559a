/* Fuzz target of the configuration reader: every input must give either a configuration or an error
 * message, and a configuration must survive being dumped and read again. The input is a YAML file,
 * followed by key=value arguments, each preceded by the byte 0x01. Compiled with SDM_FUZZ_REPLAY
 * this is a program that runs the target on files or folders of files. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "sdm/internal/config.h"

enum { OVERRIDES_MAX = 8, INPUT_MAX = 1 << 21 };

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static sdm_config config, again;

static void require(int holds)
{
    if (!holds) abort();
}

static void check_round_trip(void)
{
    sdm_text first = {0}, second = {0};
    sdm_error err;
    sdm_config_dump(&config, &first);
    require(!first.failed);
    require(sdm_config_parse("dump", first.data, first.size, NULL, 0, &again, &err) == SDM_OK);
    sdm_config_dump(&again, &second);
    require(!second.failed && strcmp(first.data, second.data) == 0);
    sdm_text_dispose(&first);
    sdm_text_dispose(&second);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const char *overrides[OVERRIDES_MAX];
    size_t n_overrides = 0;
    if (size > INPUT_MAX) return 0;
    char *text = malloc(size + 1);
    require(text != NULL);
    if (size) memcpy(text, data, size);
    text[size] = 0;

    // the parser gets a block of exactly the file's size, so that AddressSanitizer notices reads
    // past its end
    char *end = memchr(text, 1, size);
    const size_t file_size = end ? (size_t)(end - text) : size;
    char *file = malloc(file_size ? file_size : 1);
    require(file != NULL);
    memcpy(file, text, file_size);
    for (; end && n_overrides < OVERRIDES_MAX; end = strchr(end, 1)) {
        *end++ = 0;
        overrides[n_overrides++] = end;
    }

    sdm_error err;
    err.text[0] = 0;
    const sdm_status s =
        sdm_config_parse("fuzz.yaml", file, file_size, overrides, n_overrides, &config, &err);
    require(s == SDM_OK || s == SDM_E_CONFIG);
    if (s)
        require(strncmp(err.text, "fuzz.yaml:", 10) == 0 ||
                strncmp(err.text, "argument '", 10) == 0);
    else
        check_round_trip();
    free(file);
    free(text);
    return 0;
}

#ifdef SDM_FUZZ_REPLAY
#include <dirent.h>
#include <stdio.h>

static int replay_file(const char *path)
{
    FILE *in = fopen(path, "rb");
    uint8_t *data = malloc(INPUT_MAX);
    const size_t n = in && data ? fread(data, 1, INPUT_MAX, in) : 0;
    const int failed = !in || !data || ferror(in);
    if (failed) fprintf(stderr, "%s: cannot read\n", path);
    if (!failed) LLVMFuzzerTestOneInput(data, n);
    if (in) fclose(in);
    free(data);
    return !failed;
}

static int replay_folder(DIR *folder, const char *path)
{
    int n = 0;
    for (const struct dirent *entry; (entry = readdir(folder));) {
        char name[4096];
        if (entry->d_name[0] == '.') continue;
        if ((size_t)snprintf(name, sizeof name, "%s/%s", path, entry->d_name) >= sizeof name)
            continue;
        n += replay_file(name);
    }
    return n;
}

int main(int argc, char **argv)
{
    int n = 0;
    for (int i = 1; i < argc; i++) {
        DIR *folder = opendir(argv[i]);
        n += folder ? replay_folder(folder, argv[i]) : replay_file(argv[i]);
        if (folder) closedir(folder);
    }
    printf("%d inputs\n", n);
    return n > 0 ? 0 : 1;
}
#endif
