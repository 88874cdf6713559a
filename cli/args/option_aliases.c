/* Words that other programs use for an option which has another name here. */
#include <string.h>

#include "options.h"

/* A word and the name of an option, or of a key of the configuration with an example of its value:
 * a name with '='. A word may stand in several rows: each that suits the command is suggested. */
static const char *const ALIASES[][2] = {{"center", "start-centre"},
                                         {"centre", "start-centre"},
                                         {"start", "start-centre"},
                                         {"start", "start-axis"},
                                         {"axis", "start-axis"},
                                         {"fix", "keep"},
                                         {"fixed", "keep"},
                                         {"resolution", "spacing"},
                                         {"voxel", "spacing"},
                                         {"voxelsize", "spacing"},
                                         {"voxel-size", "spacing"},
                                         {"resolution", "grid.spacing=0.5"},
                                         {"voxel", "grid.spacing=0.5"},
                                         {"voxelsize", "grid.spacing=0.5"},
                                         {"voxel-size", "grid.spacing=0.5"},
                                         {"budget", "train.minutes=3"},
                                         {"minutes", "train.minutes=3"},
                                         {"out", "output"},
                                         {"output", "out"}};

const char *cli_alias_next(const char *word, size_t *row)
{
    while (*row < sizeof ALIASES / sizeof *ALIASES) {
        const char *const *alias = ALIASES[(*row)++];
        if (!strcmp(alias[0], word)) return alias[1];
    }
    return NULL;
}
