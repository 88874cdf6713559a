/* One number for all bits of a mesh. */
#include "sdm/internal/checksum.h"
#include "shape_internal.h"

uint64_t sdm_mesh_checksum(const sdm_mesh *m)
{
    const uint64_t sizes[2] = {m->n_vert, m->n_tri};
    uint64_t c = sdm_crc64(0, sizes, sizeof sizes);
    c = sdm_crc64(c, m->vert, 3 * m->n_vert * sizeof *m->vert);
    return sdm_crc64(c, m->tri, 3 * m->n_tri * sizeof *m->tri);
}
