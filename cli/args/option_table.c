/* The tables of commands and options. Everything a user can type is a row here. */
#include <math.h>

#include "commands.h"

#define AT(field) offsetof(cli_args, field)
#define ON(c) CLI_ON(c)
#define ALL (ON(CLI_N_COMMANDS) - 1u)
#define WITH_SHAPES                                                                                \
    (ON(CLI_TRAIN) | ON(CLI_GENERATE) | ON(CLI_EXACT) | ON(CLI_MESH) | ON(CLI_EVAL) |              \
     ON(CLI_SHAPES) | ON(CLI_VERIFY) | ON(CLI_CONFIG) | ON(CLI_BENCH) | ON(CLI_EXPERIMENT) |       \
     ON(CLI_PHANTOM) | ON(CLI_FIT))
#define REPORTS                                                                                    \
    (ON(CLI_TRAIN) | ON(CLI_GENERATE) | ON(CLI_EXACT) | ON(CLI_MESH) | ON(CLI_EVAL) |              \
     ON(CLI_SHAPES) | ON(CLI_INFO) | ON(CLI_VERIFY) | ON(CLI_BENCH) | ON(CLI_EXPERIMENT) |         \
     ON(CLI_PHANTOM) | ON(CLI_FIT))

const cli_command cli_commands[CLI_N_COMMANDS] = {
    {"train", "CONFIG [key=value ...]", "train a network on the shape of a configuration",
     "Reads the YAML configuration, makes exact maps, trains and writes a run folder: config.yaml "
     "(resolved),\n"
     "metrics.jsonl, checkpoint.sdmc, model.sdm, loss.png and slices.png. key=value overrides a "
     "key, e.g. "
     "network.depth=4.\n"
     "An interrupt (Ctrl-C) writes a checkpoint and stops; a second one stops at once.\n"
     "A folder that holds a model or a checkpoint is left alone unless --resume or --force is "
     "given.",
     "sdmgen train configs/cochlea.yaml train.minutes=5 --out runs/short", 1, SIZE_MAX, cmd_train},
    {"generate", "MODEL [-p name=value ...] -o FILE", "make distance maps with a trained network",
     "Parameters that are not given take the model's default. The output's type follows its name: "
     ".vdb (level set),\n"
     ".nii .nii.gz .nrrd .mha .npy (image), .ply .stl .obj .off (zero surface), .png .svg .pdf "
     "(three slices).\n"
     "With --params each row of the file makes one output; its number replaces %d (or %04d) in "
     "FILE, or is appended.",
     "sdmgen generate runs/cochlea/model.sdm -p a=4.2 -p alpha=0.6 -o cochlea.vdb -o "
     "cochlea.nii.gz",
     1, 1, cmd_generate},
    {"exact", "--shape NAME | --mesh FILE [-o FILE]", "compute an exact distance map",
     "Computes the signed distance to a shape or to a mesh file (.ply .stl .obj .off, mm) at every "
     "voxel. A surface "
     "that\n"
     "overlaps itself is taken as the union of what it encloses. Without grid options the grid is "
     "fitted to the mesh:\n"
     "64 voxels on the longest edge, a margin of a tenth of it around.",
     "sdmgen exact --shape cochlea -p a=4.2 --size 60,50,50 --spacing 0.2 -o cochlea.nrrd", 0, 0,
     cmd_exact},
    {"mesh", "--shape NAME [-p name=value ...] [-o FILE]", "write the surface mesh of a shape",
     NULL, "sdmgen mesh --shape torus -o torus.ply --audit", 0, 0, cmd_mesh},
    {"eval", "MODEL", "measure a network on fresh random shapes",
     "Draws random shapes the training never saw and compares the network with the exact engine: "
     "errors of the "
     "distance,\n"
     "overlap of the insides (Dice), distances between the zero surfaces, and time per map on one "
     "core.",
     "sdmgen eval runs/cochlea/model.sdm --samples 100 --json", 1, 1, cmd_eval},
    {"shapes", "[NAME]", "list the shapes, or the parameters and options of one", NULL,
     "sdmgen shapes cochlea", 0, 1, cmd_shapes},
    {"info", "FILE", "tell what a model, level set, image or mesh file holds", NULL,
     "sdmgen info runs/cochlea/model.sdm", 1, 1, cmd_info},
    {"verify", "FILE", "check a model, level set or image file",
     "A model: every checksum, then its accuracy is measured again on random shapes, if its shape "
     "is known; exit code "
     "4 if\n"
     "the RMSE is more than 25 % above the stated one. A .vdb: the hash of its values, and "
     "OpenVDB's checkLevelSet.\n"
     "An image (.nii .nrrd .mha ...): that it is whole, and the checksum of gzip or zlib where it "
     "is compressed.",
     "sdmgen verify runs/cochlea/model.sdm --samples 50", 1, 1, cmd_verify},
    {"config", "[CONFIG] [key=value ...]", "check, print or explain a configuration",
     "Checks the configuration, the shape's options and the ranges. --dump prints it with every "
     "key resolved; --keys\n"
     "lists every key with type, range, default and meaning.",
     "sdmgen config configs/cochlea.yaml network.depth=4 --dump", 0, SIZE_MAX, cmd_config},
    {"bench", "exact | network MODEL", "measurements of speed, with ratios",
     "exact: time, memory and error of the exact engine, of the other methods (see exact --method) "
     "and of other "
     "programs for\n"
     "the same map: by default the cochlea on 60 x 50 x 50 voxels of 0.2 mm. One thread each, but "
     "for one row. Other "
     "programs are\n"
     "sdmgen-peer-NAME beside sdmgen or in libexec/sdmgen; what is missing is said.\n"
     "network: one map, a batch and derivatives of a model on one core, against the exact engine, "
     "where the shape is "
     "known and its\n"
     "data files are there.\n"
     "Of several runs the fastest counts.",
     "sdmgen bench exact", 1, 2, cmd_bench},
    {"experiment", "CONFIG [key=value ...]",
     "compare methods in one table, beside the figures of others",
     "Trains the networks of the experiment or loads those that are there, times every method on "
     "one core, measures "
     "the "
     "errors on\n"
     "random shapes no network was trained on, draws slices and surfaces, and writes table.md, "
     "table.csv, table.json "
     "and "
     "log.txt.\n"
     "key=value overrides a key of the experiment (experiment.samples=20) or of every training "
     "(train.minutes=1). A "
     "row "
     "that fails\n"
     "has its reason in the table, the others go on, and the exit code tells. The same command "
     "again goes on where it "
     "stopped.",
     "sdmgen experiment configs/paper.yaml --out runs/paper", 0, SIZE_MAX, cmd_experiment},
    {"phantom", "--shape NAME [-p name=value ...] -o FILE",
     "make a CT-like test image with known truth",
     "The image of a shape in a given or random pose: partial volume, tissue texture, blur and "
     "noise. --label\n"
     "writes the labels, --truth all that is known of the image. Without grid options the grid is "
     "fitted to the\n"
     "shape, 64 voxels on the longest edge. --rotation and --frame are rotation vectors: axis "
     "times angle, in rad.",
     "sdmgen phantom --shape cochlea --random-params --random-pose 20,1 --spacing 0.2 -o ct.nii.gz "
     "--truth truth.json",
     0, 0, cmd_phantom},
    {"fit", "MODEL IMAGE | --shape NAME IMAGE",
     "fit a shape to an image, a label map, a mesh or points",
     "Finds the shape's parameters and pose, with their uncertainty, by the network of MODEL or "
     "(--exact, --shape) "
     "the\n"
     "exact engine. IMAGE: a volume (.nii .nii.gz .nrrd .nhdr .mha .mhd); with --label its labels; "
     "a mesh (.ply .stl\n"
     ".obj .off); points (.csv with the header x,y,z, or .npy). Without a start pose the shape "
     "begins in the middle, "
     "and\n"
     "many rotations are tried. -o writes the fitted shape: .vdb .ply .stl .obj .off in the pose "
     "found; .nii .nii.gz\n"
     ".nrrd .mha .npy distances on the grid of the image; .png .svg .pdf its contour over the "
     "image; "
     ".json the figures.\n"
     "Exit code 4: the fit failed or is not to be trusted; no file is written unless --force is "
     "given.",
     "sdmgen fit runs/cochlea/model.sdm ct.nii.gz --start-centre 4,-2,7 --start-axis 0,0,1 -o "
     "fit.stl -o fit.png",
     1, 2, cmd_fit},
    {"help", "[COMMAND]", "print this text, the manual page or the bash completion", NULL,
     "sdmgen help --completion > ~/.local/share/bash-completion/completions/sdmgen", 0, 1,
     cmd_help},
};

const cli_option cli_options[] = {
    /* the shape and its parameters */
    {"shape", 0, CLI_TEXT, "NAME", NULL, 0, 0,
     ON(CLI_EXACT) | ON(CLI_MESH) | ON(CLI_BENCH) | ON(CLI_PHANTOM) | ON(CLI_FIT), AT(shape),
     "shape, see `sdmgen shapes`"},
    {"mesh", 0, CLI_TEXT, "FILE", NULL, 0, 0, ON(CLI_EXACT) | ON(CLI_BENCH), AT(mesh),
     "mesh file instead of a shape"},
    {"param", 'p', CLI_LIST, "name=value", NULL, 0, 0,
     ON(CLI_GENERATE) | ON(CLI_EXACT) | ON(CLI_MESH) | ON(CLI_BENCH) | ON(CLI_PHANTOM), AT(params),
     "value of a shape parameter; may be repeated"},
    {"param", 'p', CLI_LIST, "name=value", NULL, 0, 0, ON(CLI_FIT), AT(params),
     "start value of a shape parameter (default: the shape's); may be repeated"},
    {"option", 'O', CLI_LIST, "name=value", NULL, 0, 0,
     ON(CLI_EXACT) | ON(CLI_MESH) | ON(CLI_SHAPES) | ON(CLI_BENCH) | ON(CLI_PHANTOM) | ON(CLI_FIT),
     AT(options), "value of a shape option; may be repeated"},
    {"params", 0, CLI_TEXT, "FILE.csv", NULL, 0, 0, ON(CLI_GENERATE), AT(rows),
     "parameters from a table: a header of names, one output per row"},

    /* the grid */
    {"size", 0, CLI_INT3, "NX,NY,NZ", NULL, 1, 1048576,
     ON(CLI_EXACT) | ON(CLI_BENCH) | ON(CLI_PHANTOM), AT(size), "voxels along x, y, z"},
    {"spacing", 0, CLI_REAL13, "MM", NULL, 1e-9, 1e9,
     ON(CLI_EXACT) | ON(CLI_BENCH) | ON(CLI_PHANTOM), AT(spacing),
     "voxel edge, one number or three"},
    {"origin", 0, CLI_REAL3, "X,Y,Z", NULL, -1e12, 1e12,
     ON(CLI_EXACT) | ON(CLI_BENCH) | ON(CLI_PHANTOM), AT(origin),
     "centre of the first voxel, LPS mm; default: the grid is centred on the mesh"},

    /* how */
    {"spacing", 0, CLI_REAL13, "MM", NULL, 1e-9, 1e9, ON(CLI_FIT), AT(spacing),
     "voxel edge of exact maps, in the shape's frame (default: 64 voxels on the longest edge, or "
     "the model's grid)"},
    {"policy", 0, CLI_CHOICE, NULL, "refuse|clamp|exact", 0, 0, ON(CLI_GENERATE) | ON(CLI_FIT),
     AT(policy),
     "parameters outside the trained range: refuse (default), move to the nearest allowed value, "
     "or use the exact "
     "engine"},
    {"check", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_GENERATE), AT(check),
     "compare the map with exact distances at 1000 voxels near the surface and print the errors; "
     "needs the shape"},
    {"max-error", 0, CLI_REAL, "MM", NULL, 1e-12, 1e9, ON(CLI_GENERATE), AT(max_error),
     "check, and have a map that is worse than this made by the exact engine; with --policy clamp: "
     "exit code 4"},
    {"error-of", 0, CLI_CHOICE, NULL, "max|q95|rmse|mean", 0, 0, ON(CLI_GENERATE), AT(error_of),
     "the figure that --max-error bounds: largest error (default), 95 % quantile, root mean square "
     "or mean"},
    {"method", 0, CLI_CHOICE, NULL, "exact|naive|cells|octree|edt", 0, 0, ON(CLI_EXACT), AT(method),
     "exact: the engine (default); naive: every triangle for every voxel, all surface counted; "
     "cells: uniform cells of "
     "triangles (exact); octree: adaptive samples, off by at most --tolerance; edt: distance "
     "transform, the bound on "
     "its "
     "error is printed"},
    {"narrow", 0, CLI_REAL, "N", NULL, 0.5, 1e6, ON(CLI_EXACT), AT(narrow),
     "narrow band: only distances below N voxels (the smallest edge), all others become N voxels; "
     "cheaper"},
    {"tolerance", 0, CLI_REAL, "MM", NULL, 1e-9, 1e9, ON(CLI_EXACT), AT(tolerance),
     "largest error of the method octree (default: a twentieth of the smallest voxel edge)"},
    {"sign", 0, CLI_CHOICE, NULL, "auto|crossings|pseudonormal|winding", 0, 0, ON(CLI_EXACT),
     AT(sign), "how inside is told from outside (default auto)"},
    {"keep-overlap", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_EXACT), AT(keep_overlap),
     "count surface inside the union too"},
    {"certify", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_EXACT), AT(certify),
     "find the sign of every voxel again along other axes and tell where it differs (method "
     "exact)"},

    /* the output */
    {"output", 'o', CLI_LIST, "FILE", NULL, 0, 0, ON(CLI_GENERATE) | ON(CLI_EXACT), AT(outputs),
     "output: .vdb .nii .nii.gz .nrrd .mha .npy .ply .stl .obj .off .png .svg .pdf; may be "
     "repeated"},
    {"output", 'o', CLI_LIST, "FILE", NULL, 0, 0, ON(CLI_PHANTOM), AT(outputs),
     "the image: .nii .nii.gz .nrrd .mha .npy; may be repeated"},
    {"output", 'o', CLI_LIST, "FILE", NULL, 0, 0, ON(CLI_MESH), AT(outputs),
     "output: .ply .stl .obj .off; may be repeated"},
    {"output", 'o', CLI_LIST, "FILE", NULL, 0, 0, ON(CLI_FIT), AT(outputs),
     "output: .vdb .ply .stl .obj .off .nii .nii.gz .nrrd .mha .npy .png .svg .pdf .json; may "
     "be repeated"},
    {"closest", 0, CLI_TEXT, "FILE.npy", NULL, 0, 0, ON(CLI_EXACT), AT(closest),
     "also write the nearest surface point of every voxel: float32 [z][y][x][3], mm"},
    {"normal", 0, CLI_TEXT, "FILE.npy", NULL, 0, 0, ON(CLI_EXACT), AT(normal),
     "also write the gradient of the distance, a unit vector: float32 [z][y][x][3]"},
    {"triangle", 0, CLI_TEXT, "FILE.npy", NULL, 0, 0, ON(CLI_EXACT), AT(triangle),
     "also write the nearest triangle of the mesh, counted from 0: uint32 [z][y][x]"},
    {"gradient", 0, CLI_TEXT, "FILE.npy", NULL, 0, 0, ON(CLI_GENERATE), AT(gradient),
     "also write the derivatives of the map along x, y, z (LPS): float32 [3][z][y][x]"},
    {"jacobian", 0, CLI_TEXT, "FILE.npy", NULL, 0, 0, ON(CLI_GENERATE) | ON(CLI_EXACT),
     AT(jacobian),
     "also write the derivatives by the shape's parameters: float32 [parameter][z][y][x], mm per "
     "unit"},
    {"audit", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_MESH), AT(audit),
     "examine the mesh and print what was found"},
    {"dense", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_GENERATE) | ON(CLI_EXACT) | ON(CLI_FIT),
     AT(dense), ".vdb: the whole map instead of a level set"},
    {"half", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_GENERATE) | ON(CLI_EXACT) | ON(CLI_FIT),
     AT(half), ".vdb: 16-bit values"},
    {"band", 0, CLI_REAL, "N", NULL, 3, 100, ON(CLI_GENERATE) | ON(CLI_EXACT) | ON(CLI_FIT),
     AT(band), ".vdb: half width of the narrow band in voxels (default 3)"},
    {"out", 0, CLI_TEXT, "DIR", NULL, 0, 0, ON(CLI_TRAIN) | ON(CLI_EXPERIMENT), AT(out),
     "run folder (default: what the configuration says, or runs/NAME)"},
    {"resume", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_TRAIN), AT(resume),
     "go on from the folder's checkpoint"},
    {"force", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_TRAIN) | ON(CLI_EXPERIMENT), AT(force),
     "start anew in a folder that holds a model"},
    {"force", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_FIT), AT(force),
     "write the files of a fit that is not to be trusted, too (the exit code stays 4)"},
    {"dry-run", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_EXPERIMENT), AT(dry_run),
     "print what would be done and how long the trainings take"},

    /* measuring */
    {"samples", 0, CLI_INT, "N", NULL, 1, 1000000, ON(CLI_EVAL), AT(samples),
     "random shapes (default 100)"},
    {"samples", 0, CLI_INT, "N", NULL, 1, 1000000, ON(CLI_VERIFY), AT(samples),
     "random shapes (default 20)"},
    {"naive", 0, CLI_INT, "N", NULL, 0, 1000, ON(CLI_EVAL), AT(naive),
     "shapes on which the naive method is timed (default 2; 0: not at all)"},
    {"max-mse", 0, CLI_REAL, "MM2", NULL, 0, 1e12, ON(CLI_EVAL), AT(max_mse),
     "exit code 4 when the mean squared error is above"},
    {"pictures", 0, CLI_TEXT, "DIR", NULL, 0, 0, ON(CLI_EVAL), AT(pictures),
     "write slices of the worst and the median shape: worst.png, median.png"},

    {"grid", 0, CLI_CHOICE, NULL, "g1|g2", 0, 0, ON(CLI_BENCH), AT(grid),
     "exact: 60 x 50 x 50 voxels of 0.2 mm (g1, default for the cochlea) or 256 x 256 x 192 of "
     "0.047 mm (g2)"},
    {"edge", 0, CLI_REAL, "MM", NULL, 1e-9, 1e9, ON(CLI_BENCH), AT(edge),
     "exact: mean edge length of the shape's mesh, as -O edge=MM"},
    {"band", 0, CLI_REAL, "K", NULL, 0.5, 1000, ON(CLI_BENCH), AT(band),
     "exact: only voxels up to K voxels from the surface count"},
    {"share", 0, CLI_REAL, "F", NULL, 1e-6, 1, ON(CLI_BENCH), AT(share),
     "exact: other programs do this share of the voxels, times are scaled (default 1; above a "
     "million voxels 0.01)"},
    {"repeat", 0, CLI_INT, "N", NULL, 1, 1000, ON(CLI_BENCH), AT(repeat),
     "exact: runs of each, the fastest counts; none is begun after 3 s (default 9)"},
    {"peers", 0, CLI_TEXT, "DIR", NULL, 0, 0, ON(CLI_BENCH) | ON(CLI_EXPERIMENT), AT(peers),
     "folder of the other programs; none: without them"},
    {"growth", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_BENCH), AT(growth),
     "exact: how the time grows, over three grids and three meshes"},

    /* phantoms */
    {"rotation", 0, CLI_REAL3, "X,Y,Z", NULL, -1000, 1000, ON(CLI_PHANTOM) | ON(CLI_FIT),
     AT(phantom.rotation),
     "turn of the shape about the origin of its frame: rotation vector, rad (fit: at the start)"},
    {"translation", 0, CLI_REAL3, "X,Y,Z", NULL, -1e12, 1e12, ON(CLI_PHANTOM) | ON(CLI_FIT),
     AT(phantom.translation), "shift of the shape after the turn, LPS mm (fit: at the start)"},
    {"random-pose", 0, CLI_REAL2, "DEG,MM", NULL, 0, 1e12, ON(CLI_PHANTOM), AT(phantom.random_pose),
     "random turn and shift of at most this, after those given"},
    {"random-params", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_PHANTOM), AT(phantom.random_params),
     "parameters without -p are drawn from their ranges"},
    {"frame", 0, CLI_REAL3, "X,Y,Z", NULL, -1000, 1000, ON(CLI_PHANTOM), AT(phantom.frame),
     "turn of the axes of the image: rotation vector, rad"},
    {"crop", 0, CLI_REAL3, "X,Y,Z", NULL, -0.95, 0.95, ON(CLI_PHANTOM), AT(phantom.crop),
     "cut the grid this share of the shape's extent before its far end, negative: behind its near "
     "end (--size: moved)"},
    {"inside", 0, CLI_REAL2, "MEAN,SD", NULL, -1e6, 1e6, ON(CLI_PHANTOM), AT(phantom.inside),
     "values inside: mean and texture, HU (default 40,80)"},
    {"outside", 0, CLI_REAL2, "MEAN,SD", NULL, -1e6, 1e6, ON(CLI_PHANTOM), AT(phantom.outside),
     "values outside (default 1300,225)"},
    {"air", 0, CLI_REAL2, "MEAN,SD", NULL, -1e6, 1e6, ON(CLI_PHANTOM), AT(phantom.air),
     "values in air cells (default -880,0)"},
    {"air-cells", 0, CLI_REAL3, "SHARE,MM,CLEAR", NULL, 0, 1e6, ON(CLI_PHANTOM),
     AT(phantom.air_cells),
     "air cells outside: share of the places taken (0 .. 1), diameter, distance kept from the "
     "surface (default: none)"},
    {"blur", 0, CLI_REAL13, "MM", NULL, 0, 1e9, ON(CLI_PHANTOM), AT(phantom.blur),
     "standard deviation of the point spread, one number or three (default 0.15)"},
    {"texture", 0, CLI_REAL, "MM", NULL, 0, 1e9, ON(CLI_PHANTOM), AT(phantom.texture),
     "smoothness of the tissues' texture (default 0.4; 0: voxel by voxel)"},
    {"noise", 0, CLI_REAL, "HU", NULL, 0, 1e6, ON(CLI_PHANTOM), AT(phantom.noise),
     "standard deviation of the noise (default 150)"},
    {"white-noise", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_PHANTOM), AT(phantom.white_noise),
     "noise of every voxel by itself (default: as smooth as the blur)"},
    {"supersample", 0, CLI_INT, "N", NULL, 1, 16, ON(CLI_PHANTOM), AT(phantom.supersample),
     "sub-voxels along the shortest edge of a voxel (default 3)"},
    {"type", 0, CLI_CHOICE, NULL, "int16|float32", 0, 0, ON(CLI_PHANTOM), AT(phantom.type),
     "voxels of the image, rounded to whole HU (default) or not; .npy is float32"},
    {"label", 0, CLI_TEXT, "FILE", NULL, 0, 0, ON(CLI_PHANTOM), AT(phantom.label),
     "also write the labels, 1 inside and 0 outside: .nii .nii.gz .nrrd .mha"},
    {"truth", 0, CLI_TEXT, "FILE.json", NULL, 0, 0, ON(CLI_PHANTOM), AT(phantom.truth),
     "also write what the image shows: shape, parameters, pose, grid and all that was chosen"},

    /* fits: what to, from where */
    {"exact", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_FIT), AT(fit.exact),
     "exact maps instead of the network's (with MODEL: of its shape)"},
    {"polish", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_FIT), AT(fit.polish),
     "a few iterations with exact maps after the network's fit; needs the shape"},
    {"label", 0, CLI_LIST, "VALUE|NAME", NULL, 0, 0, ON(CLI_FIT), AT(fit.labels),
     "IMAGE is a label map or a segmentation: fit to the voxels of this value or segment; several "
     "are united"},
    {"label-close", 0, CLI_REAL, "MM", NULL, 1e-9, 1e9, ON(CLI_FIT), AT(fit.label_close),
     "close labels, also those of --reference, by a ball of this radius: walls thinner than twice "
     "of it between "
     "compartments labelled apart are inside, too"},
    {"ras", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_FIT), AT(fit.ras),
     "--start-centre, --start-axis, --region, points and meshes are RAS (x to the right, y to the "
     "front), as viewers "
     "show "
     "them, not LPS"},
    {"start-centre", 0, CLI_REAL3, "X,Y,Z", NULL, -1e12, 1e12, ON(CLI_FIT), AT(fit.start_centre),
     "where the middle of the shape is (default: of the labels, points or region; else of the "
     "image)"},
    {"start-axis", 0, CLI_REAL3, "X,Y,Z", NULL, -1e12, 1e12, ON(CLI_FIT), AT(fit.start_axis),
     "where the z axis of the shape's frame points; turns about it are tried"},
    {"start-points", 0, CLI_TEXT, "FILE.csv", NULL, 0, 0, ON(CLI_FIT), AT(fit.start_points),
     "points of the shape and where they are, header shape_x,shape_y,shape_z,x,y,z; three or more, "
     "not on one line"},
    {"turns", 0, CLI_INT, "N", NULL, 1, 4096, ON(CLI_FIT), AT(fit.turns),
     "rotations tried about the shape's z axis (default 12 with --start-axis, else 1)"},
    {"turns-sphere", 0, CLI_INT, "N", NULL, 1, 4096, ON(CLI_FIT), AT(fit.turns_sphere),
     "rotations tried about every axis (default 60 without a start rotation)"},
    {"region", 0, CLI_REAL6, "X,Y,Z,X,Y,Z", NULL, -1e12, 1e12, ON(CLI_FIT), AT(fit.region),
     "two corners of a box: nothing outside of it is looked at"},
    {"margin", 0, CLI_REAL, "MM", NULL, 1e-9, 1e9, ON(CLI_FIT), AT(fit.margin),
     "voxels farther than this outside of the shape are not looked at (default 1.5)"},
    {"cavity", 0, CLI_REAL, "MM", NULL, 1e-9, 1e9, ON(CLI_FIT), AT(fit.cavity),
     "leave out spaces that look like the inside and hold a ball of this radius: too wide to be "
     "the shape"},

    /* fits: how */
    {"image-model", 0, CLI_CHOICE, NULL, "partial|labels", 0, 0, ON(CLI_FIT), AT(fit.image_model),
     "partial volume (default), or tissue labels with a logistic prior"},
    {"inside", 0, CLI_REAL2, "MEAN,SD", NULL, -1e12, 1e12, ON(CLI_FIT), AT(fit.inside),
     "values inside at the start: mean, standard deviation (default 40,170: fluid, HU)"},
    {"outside", 0, CLI_REAL2, "MEAN,SD", NULL, -1e12, 1e12, ON(CLI_FIT), AT(fit.outside),
     "values outside at the start (default 1300,270: bone, HU)"},
    {"air", 0, CLI_REAL2, "MEAN,SD", NULL, -1e12, 1e12, ON(CLI_FIT), AT(fit.air),
     "a second tissue outside (default -880,150; none where --inside or --outside is given)"},
    {"tissue-places", 0, CLI_REAL, "MM", NULL, 0, 1e9, ON(CLI_FIT), AT(fit.tissue_places),
     "shares of the tissues outside vary in space, over about this length; 0: the same everywhere "
     "(default 1)"},
    {"blur", 0, CLI_REAL, "MM", NULL, 1e-9, 1e9, ON(CLI_FIT), AT(fit.blur),
     "standard deviation of the point spread at the start (default 0.2)"},
    {"l-ref", 0, CLI_REAL, "MM", NULL, 1e-9, 1e9, ON(CLI_FIT), AT(fit.l_ref),
     "scale of the logistic prior of labels (default 0.2)"},
    {"point-sd", 0, CLI_REAL, "MM", NULL, 1e-9, 1e9, ON(CLI_FIT), AT(fit.point_sd),
     "standard deviation of points about the surface at the start (default 0.1)"},
    {"keep", 0, CLI_LIST, "WHAT", NULL, 0, 0, ON(CLI_FIT), AT(fit.keep),
     "do not estimate: parameters, pose, blur or appearance; may be repeated"},
    {"prior-sd", 0, CLI_REAL, "F", NULL, 0, 1e9, ON(CLI_FIT), AT(fit.prior_sd),
     "standard deviation of a parameter before the image is seen, in halves of its range (default "
     "1; 0: no prior)"},
    {"prior-rotation", 0, CLI_REAL, "RAD", NULL, 0, 1e9, ON(CLI_FIT), AT(fit.prior_rotation),
     "the same of the rotation about the start (default 0: no prior)"},
    {"prior-translation", 0, CLI_REAL, "MM", NULL, 0, 1e9, ON(CLI_FIT), AT(fit.prior_translation),
     "the same of the translation (default 0: no prior)"},
    {"eps", 0, CLI_REAL, "F", NULL, 1e-12, 1, ON(CLI_FIT), AT(fit.eps),
     "the fit ends when no unknown changes by more than this share of its range (default 1e-4; "
     "exact maps 3e-6)"},
    {"max-iterations", 0, CLI_INT, "N", NULL, 1, 100000, ON(CLI_FIT), AT(fit.max_iterations),
     "iterations at most (default 60)"},
    {"least-inside", 0, CLI_REAL, "F", NULL, 0, 1, ON(CLI_FIT), AT(fit.least_inside),
     "exit code 4 when less than this share of the fitted shape lies in the image (default 0.5)"},

    /* fits: what comes of it */
    {"reference", 0, CLI_TEXT, "FILE", NULL, 0, 0, ON(CLI_FIT), AT(fit.reference),
     "label map or segmentation to compare with, inside the field of view of the image: Dice, "
     "distances of the "
     "surfaces"},
    {"reference-label", 0, CLI_LIST, "VALUE|NAME", NULL, 0, 0, ON(CLI_FIT),
     AT(fit.reference_labels),
     "its label (default: all segments, or all voxels but 0); several are united"},
    {"label-out", 0, CLI_TEXT, "FILE", NULL, 0, 0, ON(CLI_FIT), AT(fit.label_out),
     "also write the fitted shape as labels on the grid of the image, 1 inside and 0 outside: .nii "
     ".nii.gz .nrrd .mha"},

    /* texts */
    {"dump", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_CONFIG), AT(dump),
     "print the resolved configuration as YAML"},
    {"keys", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_CONFIG) | ON(CLI_EXPERIMENT), AT(keys),
     "list every key (no CONFIG needed)"},
    {"markdown", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_CONFIG) | ON(CLI_EXPERIMENT) | ON(CLI_HELP),
     AT(markdown), "as Markdown"},
    {"man", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_HELP), AT(man), "the manual page, for man(1)"},
    {"completion", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_HELP), AT(completion),
     "the completion script for bash"},

    /* everywhere */
    {"plugin", 0, CLI_LIST, "FILE", NULL, 0, 0, WITH_SHAPES, AT(plugins),
     "load shapes from a shared object; may be repeated"},
    {"threads", 0, CLI_INT, "N", NULL, 0, 1024, ALL & ~ON(CLI_HELP), AT(threads),
     "threads; 0: all (default). Results are the same for every number"},
    {"seed", 0, CLI_INT, "N", NULL, 0, 9007199254740992.0,
     ON(CLI_TRAIN) | ON(CLI_CONFIG) | ON(CLI_EVAL) | ON(CLI_VERIFY) | ON(CLI_BENCH) |
         ON(CLI_PHANTOM),
     AT(seed), "seed of the random numbers (default 1; train, config: the configuration's)"},
    {"json", 0, CLI_FLAG, NULL, NULL, 0, 0, REPORTS, AT(json),
     "print the result as one line of JSON"},
    {"quiet", 'q', CLI_FLAG, NULL, NULL, 0, 0, ALL, AT(quiet), "no progress and no notices"},
    {"help", 'h', CLI_FLAG, NULL, NULL, 0, 0, ALL, AT(help), "print what the command does"},
};
const size_t cli_n_options = sizeof cli_options / sizeof *cli_options;
