/* The checksum of an input, as results of fits and cohorts state it. */
#include "input_checksum.h"

#include <sys/stat.h>

#include "report/files.h"
#include "sdm/internal/checksum.h"
#include "sdm/volume.h"

enum { HEADER_BYTES_MAX = 1 << 20 };

/* Whether the file may be the header of an image whose voxels are in a second file. */
static bool may_be_header(const char *path)
{
    struct stat st;
    return cli_ends_with_any(path, ".mhd .nhdr .mha .nrrd") && !stat(path, &st) &&
           st.st_size <= HEADER_BYTES_MAX;
}

sdm_status cli_input_checksum(const char *path, uint64_t *crc, sdm_error *err)
{
    sdm_volume v = {0};
    const sdm_status s = sdm_file_checksum(path, crc, err);
    if (s || !may_be_header(path)) return s;
    // a file that is no image has no voxels
    if (!sdm_volume_read(path, &v, NULL) && v.detached)
        *crc = sdm_crc64(*crc, v.values, sdm_grid_count(&v.grid) * sizeof *v.values);
    sdm_volume_dispose(&v);
    return SDM_OK;
}
