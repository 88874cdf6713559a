/* Fuzz target of a reader of meshes; FUZZ_ENDING is the ending of the file's name. A mesh that is
 * accepted can be audited. */
#include "fuzz_reader.h"
#include "sdm/meshfile.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    sdm_mesh mesh = {0};
    sdm_audit audit;
    sdm_error err = {0};
    const sdm_status s = sdm_mesh_read(fuzz_file("fuzz" FUZZ_ENDING, data, size), &mesh, &err);
    fuzz_check_status(s, &err);
    fuzz_check_mesh(&mesh);
    if (!s && mesh.n_tri < 10000) fuzz_check_status(sdm_mesh_audit(&mesh, &audit, &err), &err);
    sdm_mesh_dispose(&mesh);
    return 0;
}
