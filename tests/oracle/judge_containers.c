/* judge_containers FILE...: prints a line for each file, "sound N" with its number of sections, or
 * "refused". For check_container.py. */
#include <stdio.h>

#include "sdm/internal/container.h"
#include "sdm/internal/file.h"
#include "sdm/memory.h"

int main(int argc, char **argv)
{
    for (int i = 1; i < argc; i++) {
        static sdm_section sections[SDM_CONTAINER_MAX_SECTIONS];
        static char names[SDM_CONTAINER_MAX_SECTIONS][24];
        uint8_t *bytes;
        size_t size, n = 0;
        uint64_t sum;
        if (sdm_file_read(argv[i], 1 << 30, &bytes, &size, NULL)) return 1;
        if (sdm_container_parse(bytes, size, sections, names, &n, &sum, NULL))
            puts("refused");
        else
            printf("sound %zu\n", n);
        sdm_free(bytes);
    }
    return 0;
}
