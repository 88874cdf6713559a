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

void cli_add_aliases(const cli_command *command, const char *word, sdm_text *out)
{
    const size_t index = (size_t)(command - cli_commands);
    const bool keys = strstr(command->synopsis, "key=value") != NULL;
    for (size_t i = 0; i < sizeof ALIASES / sizeof *ALIASES; i++) {
        if (strcmp(ALIASES[i][0], word)) continue;
        const char *name = ALIASES[i][1];
        const bool key = strchr(name, '=') != NULL;
        const cli_option *o = key ? NULL : cli_find_option(index, name, strlen(name));
        if (key ? !keys : !o) continue;
        sdm_text_add(out, "%s", out->data ? " or " : "");
        if (key)
            sdm_text_add(out, "%s", name);
        else if (o->letter)
            sdm_text_add(out, "-%c %s", o->letter, o->value);
        else
            sdm_text_add(out, "--%s %s", name, o->value);
    }
}
