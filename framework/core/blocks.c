/* Memory of a narrow-band map in blocks. */
#include "sdm/blocks.h"

#include <string.h>

#include "sdm/memory.h"

void sdm_blocks_dispose(sdm_blocks *b)
{
    sdm_free(b->tile);
    sdm_free(b->first);
    sdm_free(b->values);
    memset(b, 0, sizeof *b);
}
