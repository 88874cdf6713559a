/* Runs sdm_vdb_verify() in a child process. */
#include "vdb_child.h"

#include <string.h>

#include "reader_child.h"
#include "sdm/vdb.h"

static sdm_status verify(const void *user, const char *path, char **text, size_t *size,
                         sdm_error *err)
{
    (void)user;
    const sdm_status s = sdm_vdb_verify(path, text, err);
    *size = s ? 0 : strlen(*text);
    return s;
}

sdm_status cli_vdb_verify(const char *path, char **text, sdm_error *err)
{
    size_t size;
    return cli_read_in_child(path, "OpenVDB", verify, NULL, text, &size, err);
}
