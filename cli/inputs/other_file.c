/* Tells what a file that is no model is, and which command takes it. */
#include "other_file.h"

#include <stdio.h>
#include <sys/stat.h>

#include "report/files.h"

/* Endings of files, and the commands that take such files. */
static const struct {
    const char *endings, *text;
} TYPES[] = {
    {CLI_MESH_ENDINGS, "; a mesh: `sdmgen mesh --mesh FILE --audit` checks it, `sdmgen exact "
                       "--mesh FILE` makes its distance map"},
    {".nii .nii.gz .nrrd .nhdr .mha .mhd", "; an image: `sdmgen info` and `sdmgen verify` take it, "
                                           "and `sdmgen fit MODEL IMAGE` after a model"},
    {".vdb", "; a level set: `sdmgen info` and `sdmgen verify` take it"},
    {".yaml .yml", "; a configuration: `sdmgen config FILE` checks it, `sdmgen train FILE` makes a "
                   "model of it"},
    {".ssm", "; a statistical shape model: `sdmgen info` takes it, and the shape 'statistical' "
             "by -O model=FILE"},
    {".onnx", "; a network for other programs, from `sdmgen export`: give the model (.sdm) that "
              "it was made of"},
};

const char *cli_other_file(const char *path, char buf[256])
{
    struct stat st;
    const bool there = !stat(path, &st);
    if (there && S_ISDIR(st.st_mode)) {
        char inner[4096];
        const bool run = snprintf(inner, sizeof inner, "%s/model.sdm", path) < (int)sizeof inner &&
                         !stat(inner, &st);
        snprintf(buf, 256, "; it is a folder%s%.200s", run ? ": its model is " : "",
                 run ? inner : "");
        return buf;
    }
    if (there && S_ISREG(st.st_mode) && !st.st_size) return "; the file is empty";
    for (size_t i = 0; i < sizeof TYPES / sizeof *TYPES; i++)
        if (cli_ends_with_any(path, TYPES[i].endings)) return TYPES[i].text;
    return "";
}
