/* File names on the command line: their endings, and checks that outputs can be written. */
#pragma once

#include "args/options.h"

/* Endings of the volumes that can be written, and of mesh files; separated by spaces. */
#define CLI_VOLUME_ENDINGS ".nii .nii.gz .nrrd .mha"
#define CLI_MESH_ENDINGS ".ply .stl .obj .off .vtk .vtp"

/* Ending of a segmentation of 3D Slicer, one of the volumes. */
#define CLI_SEGMENTATION_ENDING ".seg.nrrd"

/* True when the name has this ending, in upper or lower case, after at least one other
 * character. */
bool cli_ends_with(const char *path, const char *suffix);

/* True when the name has one of the endings, which are separated by spaces. */
bool cli_ends_with_any(const char *path, const char *endings);

/* Before any work: checks that every output can be written and that no output is the same file as
 * an input or another output, also under a different name or through a link. outputs NULL: all
 * outputs of the command line. SDM_E_ARG, SDM_E_IO. */
sdm_status cli_check_files(const cli_args *args, const cli_list *outputs, sdm_error *err);
