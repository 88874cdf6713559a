/* Runs a fuzz target on files or folders of files: fuzz_NAME PATH... Fails if there is none. */
#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>

#include "fuzz_reader.h"

static int replay_file(const char *path)
{
    enum { INPUT_MAX = 1 << 21 };
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
