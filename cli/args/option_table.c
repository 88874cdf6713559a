/* The tables of commands and options, each with its help text. */
#include <math.h>

#include "options.h"

#define AT(field) offsetof(cli_args, field)
#define ON(c) CLI_ON(c)
#define ALL (ON(CLI_N_COMMANDS) - 1u)
#define WITH_SHAPES                                                                                \
    (ON(CLI_TRAIN) | ON(CLI_DATASET) | ON(CLI_GENERATE) | ON(CLI_EXACT) | ON(CLI_MESH) |           \
     ON(CLI_EVAL) | ON(CLI_SHAPES) | ON(CLI_VERIFY) | ON(CLI_CONFIG) | ON(CLI_BENCH) |             \
     ON(CLI_EXPERIMENT) | ON(CLI_PHANTOM) | ON(CLI_FIT) | ON(CLI_REPORT) | ON(CLI_EXPORT))
#define REPORTS                                                                                    \
    (ON(CLI_TRAIN) | ON(CLI_DATASET) | ON(CLI_GENERATE) | ON(CLI_EXACT) | ON(CLI_MESH) |           \
     ON(CLI_EVAL) | ON(CLI_SHAPES) | ON(CLI_INFO) | ON(CLI_VERIFY) | ON(CLI_BENCH) |               \
     ON(CLI_EXPERIMENT) | ON(CLI_PHANTOM) | ON(CLI_FIT) | ON(CLI_COLLECT) | ON(CLI_IMPORT))

/* Commands that train networks. */
#define WITH_MODELS                                                                                \
    (ON(CLI_GENERATE) | ON(CLI_EVAL) | ON(CLI_REPORT) | ON(CLI_INFO) | ON(CLI_VERIFY) |            \
     ON(CLI_BENCH) | ON(CLI_FIT) | ON(CLI_EXPORT))
#define TRAININGS (ON(CLI_TRAIN) | ON(CLI_EXPERIMENT))

const cli_command cli_commands[CLI_N_COMMANDS] = {
    {"train", "CONFIG [key=value ...]", "train a network on the shape of a configuration",
     "Reads the YAML configuration, makes exact maps, trains the network and writes a run\n"
     "folder: config.yaml (resolved), metrics.jsonl, checkpoint.sdmc, model.sdm, loss.png\n"
     "and slices.png.\n"
     "key=value overrides a key of the configuration, e.g. network.depth=4.\n"
     "An interrupt (Ctrl-C) writes a checkpoint and stops (before the maps are made there is\n"
     "nothing to go on from); a second one stops at once.\n"
     "A folder that holds a model or a checkpoint stays unchanged unless --resume or --force\n"
     "is given.",
     "sdmgen train configs/cochlea.yaml train.minutes=5 --out runs/short", 1, SIZE_MAX},
    {"dataset", "CONFIG [key=value ...] -o DIR", "make exact maps and keep them for trainings",
     "Makes the exact maps of a configuration, held-out ones, static grid and random ones, and\n"
     "keeps them in checksummed files (shards) in DIR, for `sdmgen train --dataset DIR`. The\n"
     "maps are those that the training makes, bit for bit. --part divides the files among\n"
     "machines. The same command goes on: files that are there and whole are kept, damaged\n"
     "ones are made again. DIR holds the maps of one configuration; the kind of network, its\n"
     "size and its training may differ. Exit code 6: some files failed.",
     "sdmgen dataset configs/cochlea.yaml -o shards --part 3/20", 1, SIZE_MAX},
    {"generate", "MODEL [-p name=value ...] -o FILE", "make distance maps with a trained network",
     "Parameters without -p have the model's default. The ending of FILE selects the output:\n"
     ".vdb (level set), .nii .nii.gz .nrrd .mha .npy (image), .ply .stl .obj .off .vtk\n"
     ".vtp (zero surface), .png .svg .pdf (three slices). With --params each row of the table\n"
     "makes one output; the number of the row replaces %d (or %04d) in FILE, or is appended to\n"
     "the name.",
     "sdmgen generate runs/cochlea/model.sdm -p a=4.2 -p alpha=0.6 -o cochlea.vdb -o "
     "cochlea.nii.gz",
     1, 1},
    {"exact", "--shape NAME | --mesh FILE [-o FILE]", "compute an exact distance map",
     "Computes the signed distance of every voxel to a shape or to a mesh file (.ply .stl\n"
     ".obj .off .vtk .vtp, mm). A surface that overlaps itself stands for the union of the\n"
     "volumes it encloses. Without grid options the grid is fitted to the bounding box of the\n"
     "mesh, with a margin of a tenth of its longest edge on every side: 64 voxels along that\n"
     "edge, margins included. With --points FILE, distances at points in any order. A mesh that\n"
     "is not closed, or parts that are inside out, give a warning.",
     "sdmgen exact --shape cochlea -p a=4.2 --size 60,50,50 --spacing 0.2 -o cochlea.nrrd", 0, 0},
    {"mesh", "--shape NAME [-p name=value ...] | --mesh FILE [-o FILE]",
     "write the surface mesh of a shape, or audit and mend a mesh",
     "Makes the mesh of a shape or reads a mesh file (.ply .stl .obj .off .vtk .vtp, mm), and\n"
     "warns of defects. --audit prints the state of every part and the volume of the union.\n"
     "Exit code of --audit and --json 3: the mesh is not closed; 4: vertices belong to no\n"
     "triangle, parts are inside out or pass through themselves, or it encloses no volume;\n"
     "files are written all the same. --turn-parts turns parts that are inside out.",
     "sdmgen mesh --shape torus -o torus.ply --audit", 0, 0},
    {"eval", "MODEL", "measure a network on new random shapes",
     "Draws random shapes that the training did not use and compares the network with the\n"
     "exact engine: errors of the distance, overlap of the volumes inside (Dice), distances\n"
     "between the zero surfaces, and the time per map on one core. With -p: the same for one\n"
     "shape.",
     "sdmgen eval runs/cochlea/model.sdm -p a=4.2 --pictures compare", 1, 1},
    {"report", "MODEL | RUN | FIT.json -o FILE.html",
     "make a page of a model or of a fit, for a browser",
     "Writes one HTML file that needs no network and no other file. It holds the model and\n"
     "the runtime as WebAssembly: a slider for each parameter, the surface, three slices,\n"
     "volume and area, which follow at once; the errors of the network; and, of the folder of\n"
     "a run, plots of its training. Beyond the trained range the exact engine computes the\n"
     "map, if the shape is a built-in one without data files. FIT.json (of `sdmgen fit`):\n"
     "the image with the contour of the fit and its standard deviation, the verdict, and\n"
     "what the image does not determine; model and image are read from where the fit found\n"
     "them, or from the folder of the file, if they have the checksums that it states.",
     "sdmgen report runs/cochlea -o cochlea.html", 1, 1},
    {"shapes", "[NAME] | new NAME | check NAME|CONFIG | test NAME|PLUGIN",
     "list the shapes, describe one, begin a new one, check or test one",
     "Without NAME: lists the shapes. NAME: prints the parameters and options of one.\n"
     "new NAME: writes the folder NAME (or that of --out) with a shape of this name as a\n"
     "plug-in: C source, CMakeLists.txt, a configuration and tests. It builds and passes its\n"
     "tests as it is; replace its shape by yours. The folder must not exist.\n"
     "check: makes meshes all over the ranges of the parameters and looks for what spoils maps\n"
     "and trainings: broken meshes, parts that are inside out, vertices that jump, numbers of\n"
     "vertices that change, a grid that cuts the shapes (with a CONFIG, whose key=value\n"
     "overrides may follow), wrong velocities, results that differ from call to call. -o FILE\n"
     "draws nine shapes. Exit code 3: meshes are broken; 4: maps or trainings suffer. After a\n"
     "\"Segmentation fault\": --isolate or `shapes test` name what the plug-in did.\n"
     "test: tests whether a shape keeps the contract of sdm/shape.h, a plug-in isolated as by\n"
     "--isolate: valid, closed and oriented meshes, the same triangles, no jumps, velocities,\n"
     "the same bits from call to call and from many threads, parameters outside the ranges,\n"
     "options. One line for each test; exit codes as for check.",
     "sdmgen shapes check cochlea -o cochlea.png", 0, SIZE_MAX},
    {"info", "FILE", "describe the content of a model, level set, image, mesh file or shape model",
     NULL, "sdmgen info runs/cochlea/model.sdm", 1, 1},
    {"verify", "FILE ...", "check model, level set or image files",
     "A model: checks all checksums and, if the shape is known, measures the accuracy again\n"
     "on random shapes; exit code 4 if the RMSE is more than 25 % above the stated one, and\n"
     "by more than the scatter between the shapes (two standard errors of the mean square).\n"
     "A .vdb: checks the hash of its values and runs OpenVDB's checkLevelSet.\n"
     "An image (.nii .nrrd .mha ...): checks that it is complete and, if it is compressed,\n"
     "the checksum of gzip or zlib.\n"
     "Of several files each has one line (--json: one object), a failure its error, and the\n"
     "exit code is the highest of all.",
     "sdmgen verify runs/cochlea/model.sdm --samples 50", 1, SIZE_MAX},
    {"config", "[CONFIG] [key=value ...]", "check, print or explain a configuration",
     "Checks the configuration, the options of the shape and the ranges. --dump prints the\n"
     "configuration with every key resolved; --keys lists every key with type, range,\n"
     "default and meaning.",
     "sdmgen config configs/cochlea.yaml network.depth=4 --dump", 0, SIZE_MAX},
    {"bench", "exact | points | network MODEL", "measure speed, as times and ratios",
     "exact: time, memory and error of the exact engine, of the other methods (see exact\n"
     "--method) and of other programs for the same map, by default the cochlea on 60 x 50 x\n"
     "50 voxels of 0.2 mm. All rows but one use a single thread. The other programs are\n"
     "files sdmgen-peer-NAME in the folder of sdmgen or in libexec/sdmgen; missing ones are\n"
     "listed.\n"
     "points: time per point of exact distances in batches, one by one, by brute force and by\n"
     "other programs.\n"
     "network: one map, a batch and derivatives of a model on one core, compared with the\n"
     "exact engine if the shape is known and its data files exist; with --size also a map and\n"
     "a band on that grid, and points.\n"
     "A time is the fastest of several runs.",
     "sdmgen bench exact", 1, 2},
    {"experiment", "CONFIG [key=value ...]",
     "compare methods in one table, beside published figures",
     "Trains the networks of the experiment or loads those that exist, times every method on\n"
     "one core, measures the errors on random shapes that no network was trained on, draws\n"
     "slices and surfaces, and writes table.md, table.csv, table.json and log.txt.\n"
     "key=value overrides a key of the experiment (experiment.samples=20) or of every\n"
     "training (train.minutes=1). A row that fails has its reason in the table, the other\n"
     "rows continue, and the exit code reports the failure. The same command resumes a\n"
     "stopped experiment.",
     "sdmgen experiment configs/paper.yaml --out runs/paper", 0, SIZE_MAX},
    {"phantom", "--shape NAME [-p name=value ...] -o FILE",
     "make a CT-like test image with known truth",
     "Makes an image of a shape in a given or random pose, with partial volume, tissue\n"
     "texture, blur and noise. --label writes the labels, --truth the parameters, pose and\n"
     "settings of the image. Without grid options the grid is fitted to the shape, 64 voxels\n"
     "along the longest edge. --rotation and --frame are rotation vectors: axis times angle,\n"
     "in rad.",
     "sdmgen phantom --shape cochlea --random-params --random-pose 20,1 --spacing 0.2 -o ct.nii.gz "
     "--truth truth.json",
     0, 0},
    {"fit", "MODEL IMAGE | --shape NAME IMAGE | [MODEL] --cases FILE.csv -o DIR",
     "fit a shape to an image, a label map, a mesh or points",
     "Estimates the parameters and the pose of the shape, with their uncertainty, using the\n"
     "network of MODEL or (--exact, --shape) the exact engine. IMAGE is a volume (.nii\n"
     ".nii.gz .nrrd .nhdr .mha .mhd); with --label, a label map or segmentation of these\n"
     "types; a mesh (.ply .stl .obj .off .vtk .vtp); or points (.csv of x,y,z or\n"
     ".npy).\n"
     "Without a start pose the shape starts in the middle of the image, labels or points,\n"
     "and many rotations are tried. Points of a part of the surface: give --start-centre,\n"
     "and keep what they do not show (docs/fitting-points.md has an example).\n"
     "The ending of FILE in -o selects the output: .vdb .ply .stl .obj .off .vtk .vtp the\n"
     "fitted shape in the estimated pose; .nii .nii.gz .nrrd .mha .npy distances on the grid\n"
     "of the image; .png .svg .pdf the contour over the image; .json the results.\n"
     "Exit code 4: the fit failed or is not to be trusted; files are then written only with\n"
     "--force.\n"
     "--cases fits all cases of a table, each into its folder DIR/ID with fit.json, case.json,\n"
     "log.txt and the files of further -o. The same command does what is missing or changed.\n"
     "Exit code 0: each case has a result, accepted or refused; 6: some failed, DIR/failed.csv\n"
     "tells why.",
     "sdmgen fit runs/cochlea/model.sdm ct.nii.gz --start-centre 4,-2,7 --start-axis 0,0,1 -o "
     "fit.stl -o fit.png",
     0, 2},
    {"collect", "DIR [-o FILE.csv]", "make one table of the fits of a cohort",
     "DIR is the folder of `sdmgen fit --cases`. The table has a row for each case, in their\n"
     "order: state, verdict, parameters, pose and measures with their standard deviations,\n"
     "comparison with the reference, evidence, outliers. Without -o it is printed. It does not\n"
     "depend on how the cases were divided or how often a run was interrupted.\n"
     "An outlier is a parameter more than 3.5 robust standard deviations from the median of the\n"
     "accepted fits. Exit code 6: cases failed or are missing.",
     "sdmgen collect out -o cohort-results.csv", 1, 1},
    {"export", "MODEL -o FILE.onnx | --shape NAME -o FILE.glb",
     "write a network or a shape for other programs",
     "MODEL: the network as ONNX (opset 13): input `params` [N][P] in the units of the\n"
     "parameters, output `sdm` [N][nz][ny][nx] in mm. Networks of all kinds. --shape: the mesh\n"
     "as binary glTF 2.0; if it is linear in its parameters, as a statistical shape is, with a\n"
     "morph target for each of its first eight parameters.",
     "sdmgen export runs/cochlea/model.sdm -o cochlea.onnx", 0, 1},
    {"import", "ssm SOURCE -o FILE.ssm", "turn a statistical shape model into a file of sdmgen",
     "SOURCE is a model of Scalismo or Statismo (.h5, or .h5.json), a folder of meshes whose\n"
     "points correspond, or a folder of the particles of ShapeWorks (.particles) with a mesh\n"
     "(--surface): they are aligned, and their principal components become the modes.\n"
     "The shape 'statistical' takes the file by its option model. Prints how much of the\n"
     "variance each mode has.",
     "sdmgen import ssm femur.h5 -o femur.ssm --variance 0.98 --frame ras", 2, 2},
    {"slicer", "[MODULE] [--install DIR]", "make this program a module of 3D Slicer",
     "--install DIR: writes the modules SdmgenFit, SdmgenExact and SdmgenGenerate into DIR. Add\n"
     "DIR to Slicer's additional module paths (Edit, Application Settings, Modules) and start\n"
     "Slicer again: the modules are in the category Shape models. Each is a link to this\n"
     "program and a description, which is made of the options of fit, exact and generate.\n"
     "MODULE: prints the description of this module.",
     "sdmgen slicer --install ~/sdmgen-slicer", 0, 1},
    {"help", "[COMMAND]", "print help, manual pages or completion scripts", NULL,
     "sdmgen help --completion bash > ~/.local/share/bash-completion/completions/sdmgen", 0, 1},
};

const cli_option cli_options[] = {
    /* the shape and its parameters */
    {"shape", 0, CLI_TEXT, "NAME", NULL, 0, 0,
     ON(CLI_EXACT) | ON(CLI_MESH) | ON(CLI_BENCH) | ON(CLI_PHANTOM) | ON(CLI_FIT) | ON(CLI_EXPORT),
     AT(shape), "name of the shape; `sdmgen shapes` lists them"},
    {"mesh", 0, CLI_TEXT, "FILE", NULL, 0, 0, ON(CLI_EXACT) | ON(CLI_MESH) | ON(CLI_BENCH),
     AT(mesh), "mesh file instead of a shape"},
    {"param", 'p', CLI_LIST, "name=value", NULL, 0, 0,
     ON(CLI_GENERATE) | ON(CLI_EXACT) | ON(CLI_MESH) | ON(CLI_BENCH) | ON(CLI_PHANTOM) |
         ON(CLI_EXPORT),
     AT(params),
     "value of a parameter of the shape (`sdmgen shapes NAME` or `sdmgen info MODEL` lists them; "
     "default: its default); may be repeated"},
    {"param", 'p', CLI_LIST, "name=value", NULL, 0, 0, ON(CLI_FIT), AT(params),
     "start value of a shape parameter (default: the shape's); may be repeated"},
    {"param", 'p', CLI_LIST, "name=value", NULL, 0, 0, ON(CLI_EVAL), AT(params),
     "measure one shape instead of random ones: its parameters; those without -p have the "
     "default; may be repeated"},
    {"option", 'O', CLI_LIST, "name=value", NULL, 0, 0,
     ON(CLI_EXACT) | ON(CLI_MESH) | ON(CLI_SHAPES) | ON(CLI_BENCH) | ON(CLI_PHANTOM) | ON(CLI_FIT) |
         ON(CLI_EXPORT),
     AT(options),
     "value of an option of the shape (`sdmgen shapes NAME` lists them); may be repeated"},
    {"params", 0, CLI_TEXT, "FILE.csv", NULL, 0, 0, ON(CLI_GENERATE), AT(rows),
     "parameters from a table: a header line of names, then one output per row"},

    /* the grid */
    {"size", 0, CLI_INT3, "NX,NY,NZ", NULL, 1, 1048576,
     ON(CLI_EXACT) | ON(CLI_BENCH) | ON(CLI_PHANTOM), AT(size), "number of voxels along x, y, z"},
    {"spacing", 0, CLI_REAL13, "MM", NULL, 1e-9, 1e9,
     ON(CLI_EXACT) | ON(CLI_BENCH) | ON(CLI_PHANTOM), AT(spacing),
     "edge of a voxel, mm: one number, or three for x, y, z"},
    {"origin", 0, CLI_REAL3, "X,Y,Z", NULL, -1e12, 1e12,
     ON(CLI_EXACT) | ON(CLI_BENCH) | ON(CLI_PHANTOM), AT(origin),
     "position of the centre of the first voxel, mm (LPS: x to the left, y to the back, z to the "
     "head); default: the grid is centred on the mesh"},
    {"size", 0, CLI_INT3, "NX,NY,NZ", NULL, 1, 1048576, ON(CLI_GENERATE), AT(size),
     "number of voxels along x, y, z (default: the grid fills the box of the model's voxel "
     "centres). "
     "Without --spacing the voxels are cubes that cover this box; where its proportions are "
     "others, the grid reaches beyond it, which --outside must allow"},
    {"spacing", 0, CLI_REAL13, "MM", NULL, 1e-9, 1e9, ON(CLI_GENERATE), AT(spacing),
     "edge of a voxel, mm: one number, or three for x, y, z (default: the model's; with --size the "
     "smallest one "
     "with which the grid covers the model's box)"},
    {"origin", 0, CLI_REAL3, "X,Y,Z", NULL, -1e12, 1e12, ON(CLI_GENERATE), AT(origin),
     "position of the centre of the first voxel, mm (LPS: x to the left, y to the back, z to the "
     "head); default: the grid has the centre of the model's"},
    {"direction", 0, CLI_REAL9, "XX,XY,...", NULL, -1, 1, ON(CLI_GENERATE), AT(direction),
     "axes of the grid: orthonormal matrix, row by row, whose columns are the axes (default: the "
     "model's)"},
    {"like", 0, CLI_TEXT, "FILE", NULL, 0, 0, ON(CLI_EXACT) | ON(CLI_GENERATE) | ON(CLI_PHANTOM),
     AT(like), "the grid of a model (.sdm) or of an image, whole: size, spacing, place and axes"},
    {"outside", 0, CLI_CHOICE, NULL, "refuse|bound|exact", 0, 0, ON(CLI_GENERATE), AT(outside),
     "voxels outside the box of the model's voxel centres: refuse (default), a lower bound of the "
     "distance, or the exact distance"},

    /* the method */
    {"spacing", 0, CLI_REAL13, "MM", NULL, 1e-9, 1e9, ON(CLI_FIT), AT(spacing),
     "voxel edge of exact maps, in the shape's frame (default: 64 voxels along the longest edge, "
     "for a thin part up to 128, and finer at the end where the data need it; or the grid of the "
     "model)"},
    {"policy", 0, CLI_CHOICE, NULL, "refuse|clamp|exact", 0, 0, ON(CLI_GENERATE) | ON(CLI_FIT),
     AT(policy),
     "parameters outside the trained range: refuse (default), clamp to the nearest allowed value, "
     "or use the exact engine"},
    {"check", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_GENERATE), AT(check),
     "compare the map with exact distances at 1000 voxels near the surface and print the errors; "
     "the shape must be known"},
    {"max-error", 0, CLI_REAL, "MM", NULL, 1e-12, 1e9, ON(CLI_GENERATE), AT(max_error),
     "check the map near the surface, as --check does; if its error there is larger than this, use "
     "the exact engine instead, or with --policy clamp end with exit code 4"},
    {"error-of", 0, CLI_CHOICE, NULL, "max|q95|rmse|mean", 0, 0, ON(CLI_GENERATE), AT(error_of),
     "with --max-error: the error that it limits: largest (default), 95 % quantile, root mean "
     "square or "
     "mean"},
    {"method", 0, CLI_CHOICE, NULL, "exact|naive|cells|octree|edt", 0, 0, ON(CLI_EXACT), AT(method),
     "exact: the engine (default); naive: every triangle for every voxel, also triangles inside "
     "the union; cells: uniform cells of triangles (exact); octree: adaptive samples, error at "
     "most --tolerance; edt: distance transform, prints the bound on its error"},
    {"points", 0, CLI_TEXT, "FILE", NULL, 0, 0, ON(CLI_GENERATE) | ON(CLI_EXACT), AT(points),
     "distances at the points of a file instead of a map: .csv (x,y,z), .npy ([n][3]) or the "
     "vertices of .ply .stl .obj .off .vtk .vtp, LPS mm; -o FILE.csv (x,y,z and the columns) or "
     "FILE.npy (float64, the columns alone), one row a point"},
    {"columns", 0, CLI_TEXT, "LIST", NULL, 0, 0, ON(CLI_EXACT), AT(columns),
     "columns for --points: distance,gradient,closest,triangle,slopes (default distance); slopes: "
     "the derivatives by the parameters of --shape, one column d_NAME each. Where several points "
     "of the surface are equally near, as on a ridge, all but the distance are those of one of "
     "them"},
    {"columns", 0, CLI_TEXT, "LIST", NULL, 0, 0, ON(CLI_GENERATE), AT(columns),
     "columns for --points: distance,gradient,slopes (default distance); slopes: the derivatives "
     "by the parameters, one column d_NAME each"},
    {"narrow", 0, CLI_REAL, "N", NULL, 0.5, 1e6, ON(CLI_EXACT), AT(narrow),
     "narrow band: clamp distances to N voxels (of the smallest edge), which is faster"},
    {"tolerance", 0, CLI_REAL, "MM", NULL, 1e-9, 1e9, ON(CLI_EXACT), AT(tolerance),
     "largest error of the method octree (default: a twentieth of the smallest voxel edge)"},
    {"sign", 0, CLI_CHOICE, NULL, "auto|crossings|pseudonormal|winding", 0, 0, ON(CLI_EXACT),
     AT(sign),
     "how inside and outside are told apart: crossings: along rays (closed meshes); pseudonormal: "
     "by "
     "the normal at the nearest point (meshes without overlap); winding: by winding numbers (any "
     "mesh); auto: crossings for closed meshes, else winding (default)"},
    {"keep-overlap", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_EXACT), AT(keep_overlap),
     "where the surface overlaps itself: measure to all triangles, also to those inside the solid "
     "(default: to the surface of the union)"},
    {"certify", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_EXACT), AT(certify),
     "compute the sign of every voxel again along other axes; exit code 4 when signs differ, or "
     "voxels lie in a part that is inside out (method exact)"},

    /* the output */
    {"output", 'o', CLI_LIST, "FILE", NULL, 0, 0, ON(CLI_GENERATE) | ON(CLI_EXACT), AT(outputs),
     "output: .vdb .nii .nii.gz .nrrd .seg.nrrd (the inside as a segment of 3D Slicer) .mha .npy "
     ".ply .stl .obj .off .vtk .vtp .png .svg .pdf; may "
     "be repeated"},
    {"output", 'o', CLI_LIST, "FILE", NULL, 0, 0, ON(CLI_PHANTOM), AT(outputs),
     "the image: .nii .nii.gz .nrrd .mha .npy; may be repeated"},
    {"output", 'o', CLI_LIST, "FILE", NULL, 0, 0, ON(CLI_MESH), AT(outputs),
     "output: .ply .stl .obj .off .vtk .vtp; may be repeated"},
    {"output", 'o', CLI_LIST, "FILE", NULL, 0, 0, ON(CLI_FIT), AT(outputs),
     "output: .vdb .ply .stl .obj .off .vtk .vtp .nii .nii.gz .nrrd .mha .npy .png .svg .pdf "
     ".json; may be repeated. With --cases the first one is the folder of the results, the others "
     "are files in the folder of each case"},
    {"output", 'o', CLI_LIST, "FILE", NULL, 0, 0, ON(CLI_COLLECT), AT(outputs),
     "the table: .csv; or .html, a page with the outliers first; may be repeated"},
    {"output", 'o', CLI_LIST, "FILE", NULL, 0, 0, ON(CLI_EXPORT), AT(outputs),
     "output: .onnx (MODEL) or .glb (--shape); may be repeated"},
    {"output", 'o', CLI_LIST, "FILE", NULL, 0, 0, ON(CLI_SHAPES), AT(outputs),
     "check: a picture of nine shapes: .png .svg .pdf; may be repeated"},
    {"output", 'o', CLI_LIST, "FILE", NULL, 0, 0, ON(CLI_REPORT), AT(outputs), "the page: .html"},
    {"no-model", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_REPORT), AT(no_model),
     "leave out the model and the runtime: pictures alone"},
    {"changed-files", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_REPORT), AT(changed_files),
     "FIT.json: take the model and the image although their checksums are not those that the file "
     "states"},
    {"report", 0, CLI_TEXT, "FILE.html", NULL, 0, 0, ON(CLI_TRAIN) | ON(CLI_FIT), AT(report),
     "also write a page of the result for a browser (see `sdmgen report`)"},
    {"output", 'o', CLI_LIST, "FILE", NULL, 0, 0, ON(CLI_IMPORT), AT(outputs), "output: .ssm"},
    {"modes", 0, CLI_INT, "N", NULL, 1, 1048576, ON(CLI_IMPORT), AT(import.modes),
     "keep the first N modes (default: all, at most 64)"},
    {"variance", 0, CLI_REAL, "F", NULL, 1e-6, 1, ON(CLI_IMPORT), AT(import.variance),
     "keep the fewest modes with this fraction of the variance, e.g. 0.98"},
    {"frame", 0, CLI_CHOICE, NULL, "lps|ras", 0, 0, ON(CLI_IMPORT), AT(import.frame),
     "axes of the source (default lps); ras: x and y change their signs"},
    {"unit", 0, CLI_CHOICE, NULL, "mm|cm|m|um", 0, 0, ON(CLI_IMPORT), AT(import.unit),
     "unit of the source (default mm)"},
    {"surface", 0, CLI_TEXT, "FILE", NULL, 0, 0, ON(CLI_IMPORT), AT(import.surface),
     "mesh whose triangles are used, for a model without triangles: its vertices are the points; "
     "for particles: the mesh of one shape, which is warped onto the others"},
    {"particles", 0, CLI_TEXT, "FILE", NULL, 0, 0, ON(CLI_IMPORT), AT(import.particles),
     "folder of particles: those on the mesh of --surface (default: NAME_local.particles for "
     "NAME.vtk; else its vertices are the particles)"},
    {"model", 0, CLI_TEXT, "NAME", NULL, 0, 0, ON(CLI_IMPORT), AT(import.model),
     "which model of a file with several (its catalog)"},
    {"scale", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_IMPORT), AT(import.scale),
     "folder: remove differences of size (default: size is a part of shape)"},
    {"closest", 0, CLI_TEXT, "FILE.npy", NULL, 0, 0, ON(CLI_EXACT), AT(closest),
     "also write the nearest surface point of every voxel: float32 [z][y][x][3], mm"},
    {"normal", 0, CLI_TEXT, "FILE.npy", NULL, 0, 0, ON(CLI_EXACT), AT(normal),
     "also write the gradient of the distance, a unit vector: float32 [z][y][x][3]"},
    {"triangle", 0, CLI_TEXT, "FILE.npy", NULL, 0, 0, ON(CLI_EXACT), AT(triangle),
     "also write the nearest triangle of the mesh, counted from 0: uint32 [z][y][x]"},
    {"gradient", 0, CLI_TEXT, "FILE.npy", NULL, 0, 0, ON(CLI_GENERATE), AT(gradient),
     "also write the derivatives of the map along x, y, z (LPS): float32 [3][z][y][x]"},
    {"jacobian", 0, CLI_TEXT, "FILE.npy", NULL, 0, 0, ON(CLI_GENERATE), AT(jacobian),
     "also write the derivatives by the shape's parameters: float32 [parameter][z][y][x], mm per "
     "unit (--points: [point][parameter]); the map of the network then differs by about a "
     "thousandth of a voxel"},
    {"jacobian", 0, CLI_TEXT, "FILE.npy", NULL, 0, 0, ON(CLI_EXACT), AT(jacobian),
     "also write the derivatives by the shape's parameters: float32 [parameter][z][y][x], mm per "
     "unit (--points: [point][parameter])"},
    {"audit", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_MESH), AT(audit),
     "check the mesh and print its properties, defects and parts"},
    {"turn-parts", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_MESH) | ON(CLI_EXACT), AT(turn_parts),
     "turn the parts of the mesh that are inside out, also those that overlap others"},
    {"dense", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_GENERATE) | ON(CLI_EXACT) | ON(CLI_FIT),
     AT(dense),
     ".vdb: the distances of all voxels, instead of a level set with those near the surface"},
    {"half", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_GENERATE) | ON(CLI_EXACT) | ON(CLI_FIT),
     AT(half),
     ".vdb: values as 16-bit floating-point numbers, with three digits (default: 32-bit)"},
    {"band", 0, CLI_REAL, "N", NULL, 3, 100, ON(CLI_GENERATE) | ON(CLI_EXACT) | ON(CLI_FIT),
     AT(band), ".vdb: half width of the narrow band in voxels (default 3)"},
    {"out", 0, CLI_TEXT, "DIR", NULL, 0, 0, ON(CLI_TRAIN) | ON(CLI_EXPERIMENT), AT(out),
     "run folder (default: the folder of the configuration, or runs/NAME)"},
    {"out", 0, CLI_TEXT, "DIR", NULL, 0, 0, ON(CLI_SHAPES), AT(out),
     "new: folder of the plug-in (default: NAME)"},
    {"output", 'o', CLI_LIST, "DIR", NULL, 0, 0, ON(CLI_DATASET), AT(outputs),
     "the folder of the files; it is made if it is missing"},
    {"maps", 0, CLI_INT, "N", NULL, 0, 500000000, ON(CLI_DATASET), AT(maps),
     "number of random maps (default: data.start + data.online of the configuration); held-out "
     "maps and the static grid are made in any case"},
    {"part", 0, CLI_TEXT, "I/N", NULL, 0, 0, ON(CLI_DATASET), AT(part),
     "make only part I of N of the files"},
    {"dataset", 0, CLI_TEXT, "DIR", NULL, 0, 0, ON(CLI_TRAIN), AT(dataset),
     "take the exact maps from this folder (of `sdmgen dataset`) and make only those that are "
     "missing; the model has the same bits as without it"},
    {"plan", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_TRAIN), AT(plan),
     "train nothing: measure the speed of this machine for a few seconds, and print how long the "
     "training takes, how much memory it needs and how many bytes it sends"},
    {"nodes", 0, CLI_INT, "N", NULL, 1, 100000, ON(CLI_TRAIN), AT(nodes),
     "with --plan: number of machines (default 1)"},
    {"cores", 0, CLI_INT, "N", NULL, 1, 4096, ON(CLI_TRAIN), AT(cores),
     "with --plan: cores of each machine (default: the threads of this one)"},
    {"resume", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_TRAIN), AT(resume),
     "continue from the checkpoint in the folder"},
    {"ranks", 0, CLI_INT, "N", NULL, 1, 256, ON(CLI_TRAIN), AT(ranks),
     "processes on this machine that share the work, each with its part of the cores; mpirun "
     "shares "
     "it among machines"},
    {"force", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_TRAIN) | ON(CLI_EXPERIMENT), AT(force),
     "start again in a folder that holds a model"},
    {"compare", 0, CLI_TEXT, "MODEL", NULL, 0, 0, ON(CLI_TRAIN), AT(compare),
     "at the end, measure this model of the same shape and the new one at the same exact surfaces"},
    {"force", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_FIT), AT(force),
     "write the files of a fit that is not to be trusted, too (the exit code stays 4); fit also to "
     "targets whose size the shape cannot have, and to images whose tissues look exchanged at the "
     "start"},
    {"dry-run", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_EXPERIMENT), AT(dry_run),
     "print the planned rows and the duration of the trainings, then stop"},

    /* measuring */
    {"samples", 0, CLI_INT, "N", NULL, 1, 1000000, ON(CLI_EVAL), AT(samples),
     "number of random shapes (default 100)"},
    {"samples", 0, CLI_INT, "N", NULL, 1, 1000000, ON(CLI_VERIFY), AT(samples),
     "number of random shapes (default 20)"},
    {"samples", 0, CLI_INT, "N", NULL, 1, 1000000, ON(CLI_SHAPES), AT(samples),
     "check, test: number of random shapes (default 128; test: 64)"},
    {"naive", 0, CLI_INT, "N", NULL, 0, 1000, ON(CLI_EVAL), AT(naive),
     "number of shapes on which the naive method is timed (default 2; 0: none)"},
    {"max-mse", 0, CLI_REAL, "MM2", NULL, 0, 1e12, ON(CLI_EVAL), AT(max_mse),
     "exit code 4 when the mean squared error is larger"},
    {"pictures", 0, CLI_TEXT, "DIR", NULL, 0, 0, ON(CLI_EVAL), AT(pictures),
     "write slices of exact map, network and error: worst.png and median.png, the shapes with the "
     "largest and the median error; with -p compare.png"},

    {"grid", 0, CLI_CHOICE, NULL, "g1|g2", 0, 0, ON(CLI_BENCH), AT(grid),
     "exact: 60 x 50 x 50 voxels of 0.2 mm (g1, default for the cochlea) or 256 x 256 x 192 of "
     "0.047 mm (g2)"},
    {"edge", 0, CLI_REAL, "MM", NULL, 1e-9, 1e9, ON(CLI_BENCH), AT(edge),
     "exact: mean edge length of the mesh of the shape, like -O edge=MM"},
    {"band", 0, CLI_REAL, "K", NULL, 0.5, 1000, ON(CLI_BENCH), AT(band),
     "exact: measure only voxels within K voxels of the surface"},
    {"share", 0, CLI_REAL, "F", NULL, 1e-6, 1, ON(CLI_BENCH), AT(share),
     "exact: fraction of the voxels that other programs compute; their times are scaled (default "
     "1; above a million voxels 0.01)"},
    {"repeat", 0, CLI_INT, "N", NULL, 1, 1000, ON(CLI_BENCH), AT(repeat),
     "exact: runs of each program, of which the fastest counts; no run starts after 3 s (default "
     "9)"},
    {"peers", 0, CLI_TEXT, "DIR", NULL, 0, 0, ON(CLI_BENCH) | ON(CLI_EXPERIMENT), AT(peers),
     "folder of the other programs; none: do not run them"},
    {"growth", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_BENCH), AT(growth),
     "exact: times for three sizes of the grid and three of the mesh"},

    /* phantoms */
    {"rotation", 0, CLI_REAL3, "X,Y,Z", NULL, -CLI_TURN, CLI_TURN, ON(CLI_PHANTOM) | ON(CLI_FIT),
     AT(pose.rotation),
     "rotation of the shape about the origin of its frame: rotation vector, rad (fit: at the "
     "start)"},
    {"translation", 0, CLI_REAL3, "X,Y,Z", NULL, -1e12, 1e12, ON(CLI_PHANTOM) | ON(CLI_FIT),
     AT(pose.translation),
     "translation of the shape after the rotation, LPS mm (fit: at the start)"},
    {"random-pose", 0, CLI_REAL2, "DEG,MM", NULL, 0, 1e12, ON(CLI_PHANTOM), AT(phantom.random_pose),
     "random rotation of at most DEG degrees and translation of at most MM mm, applied after the "
     "given ones"},
    {"random-params", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_PHANTOM), AT(phantom.random_params),
     "draw the parameters without -p from their distributions"},
    {"frame", 0, CLI_REAL3, "X,Y,Z", NULL, -CLI_TURN, CLI_TURN, ON(CLI_PHANTOM), AT(phantom.frame),
     "rotation of the axes of the image: rotation vector, rad"},
    {"crop", 0, CLI_REAL3, "X,Y,Z", NULL, -0.95, 0.95, ON(CLI_PHANTOM), AT(phantom.crop),
     "end the grid this fraction of the shape's extent before the far end of the shape; negative: "
     "begin it after the near end (with --size the grid moves instead)"},
    {"inside", 0, CLI_REAL2, "MEAN,SD", NULL, -1e6, 1e6, ON(CLI_PHANTOM), AT(phantom.inside),
     "values inside: mean and standard deviation of the texture, HU (default 40,80)"},
    {"outside", 0, CLI_REAL2, "MEAN,SD", NULL, -1e6, 1e6, ON(CLI_PHANTOM), AT(phantom.outside),
     "values outside, as for --inside (default 1300,225)"},
    {"air", 0, CLI_REAL2, "MEAN,SD", NULL, -1e6, 1e6, ON(CLI_PHANTOM), AT(phantom.air),
     "values in air cells, as for --inside (default -880,0)"},
    {"air-cells", 0, CLI_REAL3, "SHARE,MM,CLEAR", NULL, 0, 1e6, ON(CLI_PHANTOM),
     AT(phantom.air_cells),
     "air cells outside, balls on a lattice: probability of each (0 .. 1), diameter, clearance to "
     "the surface (default: none)"},
    {"blur", 0, CLI_REAL13, "MM", NULL, 0, 1e9, ON(CLI_PHANTOM), AT(phantom.blur),
     "standard deviation of the point spread, one number or one per axis (default 0.15)"},
    {"texture", 0, CLI_REAL, "MM", NULL, 0, 1e9, ON(CLI_PHANTOM), AT(phantom.texture),
     "standard deviation of the Gaussian that smooths the texture (default 0.4; 0: white noise)"},
    {"noise", 0, CLI_REAL, "HU", NULL, 0, 1e6, ON(CLI_PHANTOM), AT(phantom.noise),
     "standard deviation of the noise (default 150)"},
    {"white-noise", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_PHANTOM), AT(phantom.white_noise),
     "independent noise in every voxel (default: blurred like the image)"},
    {"supersample", 0, CLI_INT, "N", NULL, 1, 16, ON(CLI_PHANTOM), AT(phantom.supersample),
     "sub-voxels along the shortest edge of a voxel (default 3)"},
    {"type", 0, CLI_CHOICE, NULL, "int16|float32", 0, 0, ON(CLI_PHANTOM), AT(phantom.type),
     "type of the voxels: int16, rounded to whole HU (default), or float32; .npy is float32"},
    {"label", 0, CLI_TEXT, "FILE", NULL, 0, 0, ON(CLI_PHANTOM), AT(phantom.label),
     "also write the labels, 1 inside and 0 outside: .nii .nii.gz .nrrd .seg.nrrd "
     ".mha"},
    {"truth", 0, CLI_TEXT, "FILE.json", NULL, 0, 0, ON(CLI_PHANTOM), AT(phantom.truth),
     "also write the truth: shape, parameters, pose, grid and the settings of the image"},
    {"surface", 0, CLI_TEXT, "FILE", NULL, 0, 0, ON(CLI_PHANTOM), AT(phantom.surface),
     "also write the surface in its pose: .ply .stl .obj .off .vtk .vtp, or points spread evenly "
     "over it: .csv .npy"},
    {"surface-points", 0, CLI_INT, "N", NULL, 1, 100000000, ON(CLI_PHANTOM),
     AT(phantom.surface_points), "number of points of --surface FILE.csv (default 2000)"},
    {"surface-noise", 0, CLI_REAL, "MM", NULL, 0, 1e9, ON(CLI_PHANTOM), AT(phantom.surface_noise),
     "standard deviation of the noise along each axis in the points of --surface FILE.csv (default "
     "0)"},

    /* fits: target and start */
    {"exact", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_FIT), AT(fit.exact),
     "use exact maps instead of the network (with MODEL: of its shape)"},
    {"polish", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_FIT), AT(fit.polish),
     "refine the fit of the network by a few iterations with exact maps; the shape must be known"},
    {"label", 0, CLI_LIST, "VALUE|NAME", NULL, 0, 0, ON(CLI_FIT), AT(fit.labels),
     "IMAGE is a label map or a segmentation: fit to the voxels of this value or segment; several "
     "form a union"},
    {"label-close", 0, CLI_REAL, "MM", NULL, 1e-9, 1e9, ON(CLI_FIT), AT(fit.label_close),
     "apply a morphological closing with a ball of this radius to the labels, also to those of "
     "--reference: walls thinner than twice the radius between labelled compartments become "
     "inside"},
    {"ras", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_FIT), AT(fit.ras),
     "--start-centre, --start-axis, --region, points and meshes are RAS (x to the right, y to the "
     "front), as image viewers show them, instead of LPS"},
    {"start-centre", 0, CLI_REAL3, "X,Y,Z", NULL, -1e12, 1e12, ON(CLI_FIT), AT(fit.start_centre),
     "position of the middle of the shape at the start (default: the middle of the labels, points "
     "or region; else of the image)"},
    {"start-axis", 0, CLI_REAL3, "X,Y,Z", NULL, -1e12, 1e12, ON(CLI_FIT), AT(fit.start_axis),
     "direction of the z axis of the shape's frame at the start; rotations about it are tried"},
    {"start-points", 0, CLI_TEXT, "FILE.csv", NULL, 0, 0, ON(CLI_FIT), AT(fit.start_points),
     "three or more pairs of points, not on one line, in the shape's frame and in the image: the "
     "start pose maps one to the other; header shape_x,shape_y,shape_z,x,y,z"},
    {"turns", 0, CLI_INT, "N", NULL, 1, 4096, ON(CLI_FIT), AT(fit.turns),
     "number of rotations tried about the shape's z axis (default 12 with --start-axis, else 1)"},
    {"turns-sphere", 0, CLI_INT, "N", NULL, 1, 4096, ON(CLI_FIT), AT(fit.turns_sphere),
     "number of rotations tried about all axes (default 60 without a start rotation)"},
    {"find", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_FIT), AT(fit.find),
     "search the whole image for the shape, without a start: fit and judge the best places, print "
     "all of them, and take the accepted one with the most evidence"},
    {"candidates", 0, CLI_INT, "N", NULL, 1, 100, ON(CLI_FIT), AT(fit.candidates),
     "number of places that --find fits and judges (default 4)"},
    {"region", 0, CLI_REAL6, "X,Y,Z,X,Y,Z", NULL, -1e12, 1e12, ON(CLI_FIT), AT(fit.region),
     "two opposite corners of a box: voxels outside are ignored"},
    {"margin", 0, CLI_REAL, "MM", NULL, 1e-9, 1e9, ON(CLI_FIT), AT(fit.margin),
     "ignore voxels farther than this outside of the shape (default 1.5, but 1.5 to 15 voxels)"},
    {"cavity", 0, CLI_REAL, "MM", NULL, 1e-9, 1e9, ON(CLI_FIT), AT(fit.cavity),
     "ignore spaces with values like those inside that hold a ball of this radius: too wide to be "
     "the shape"},
    {"open-end", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_FIT), AT(fit.open_end),
     "the shape (cochlea, duct) is open at its end: the image beyond it says nothing about the "
     "shape"},

    /* fits: model and prior */
    {"image-model", 0, CLI_CHOICE, NULL, "partial|labels", 0, 0, ON(CLI_FIT), AT(fit.image_model),
     "partial: partial volume (default); labels: tissue labels with a logistic prior"},
    {"inside", 0, CLI_REAL2, "MEAN,SD", NULL, -1e12, 1e12, ON(CLI_FIT), AT(fit.inside),
     "values inside: mean and standard deviation, at the start and as a prior of the mean "
     "(default 40,170: fluid, HU)"},
    {"outside", 0, CLI_REAL2, "MEAN,SD", NULL, -1e12, 1e12, ON(CLI_FIT), AT(fit.outside),
     "values outside at the start (default 1300,270: bone, HU)"},
    {"air", 0, CLI_REAL2, "MEAN,SD", NULL, -1e12, 1e12, ON(CLI_FIT), AT(fit.air),
     "values of a second tissue outside (default -880,150; none with --inside or --outside)"},
    {"tissue-places", 0, CLI_REAL, "MM", NULL, 0, 1e9, ON(CLI_FIT), AT(fit.tissue_field),
     "length over which the fractions of the tissues outside vary in space; 0: constant fractions "
     "(default 1, but 1 to 10 voxels)"},
    {"blur", 0, CLI_REAL, "MM", NULL, 1e-9, 1e9, ON(CLI_FIT), AT(fit.blur),
     "standard deviation of the point spread at the start; the fit estimates it, unless --keep "
     "blur (default 0.2, but 0.25 to 2 voxels)"},
    {"l-ref", 0, CLI_REAL, "MM", NULL, 1e-9, 1e9, ON(CLI_FIT), AT(fit.l_ref),
     "scale of the logistic prior of labels (default 0.2, but 0.25 to 2 voxels)"},
    {"point-sd", 0, CLI_REAL, "MM", NULL, 1e-9, 1e9, ON(CLI_FIT), AT(fit.point_sd),
     "standard deviation of points about the surface at the start; the fit estimates it, unless "
     "--keep appearance (default 0.1, but 0.125 to 1 voxel)"},
    {"keep", 0, CLI_LIST, "WHAT", NULL, 0, 0, ON(CLI_FIT), AT(fit.keep),
     "keep at the start value: all parameters, pose, blur or appearance, or the parameter of this "
     "name (its value: -p); may be repeated"},
    {"prior-sd", 0, CLI_REAL, "F", NULL, 0, 1e9, ON(CLI_FIT), AT(fit.prior_sd),
     "standard deviation of the prior of a parameter, in halves of its range or, if its "
     "distribution is normal, in deviations (default 1; 0: no prior)"},
    {"prior-rotation", 0, CLI_REAL, "RAD", NULL, 0, CLI_TURN, ON(CLI_FIT), AT(fit.prior_rotation),
     "standard deviation of the prior of the rotation from the start (default 0: no prior)"},
    {"prior-translation", 0, CLI_REAL, "MM", NULL, 0, 1e9, ON(CLI_FIT), AT(fit.prior_translation),
     "standard deviation of the prior of the translation from the start (default 0: no prior)"},
    {"eps", 0, CLI_REAL, "F", NULL, 1e-12, 1, ON(CLI_FIT), AT(fit.eps),
     "the fit ends when a step changes no unknown by more than this fraction of its range (default "
     "1e-4, exact maps 3e-6, or before that a hundredth of its standard deviation)"},
    {"max-iterations", 0, CLI_INT, "N", NULL, 1, 100000, ON(CLI_FIT), AT(fit.max_iterations),
     "largest number of iterations of a phase (default 60). A fit with exact maps has a second "
     "phase, which averages derivatives; a fit to points is made twice"},
    {"least-inside", 0, CLI_REAL, "F", NULL, 0, 1, ON(CLI_FIT), AT(fit.least_inside),
     "exit code 4 when less than this fraction of the fitted shape lies in the image (default "
     "0.5)"},
    {"tolerance", 0, CLI_REAL, "F", NULL, 0, 1, ON(CLI_FIT), AT(fit.tolerance),
     "share of the volume of the shape that the target may contradict, since organs differ from "
     "the "
     "model (default 0: residuals must be noise; labels and points 0.05)"},
    {"beside", 0, CLI_REAL, "F", NULL, 0, 1e9, ON(CLI_FIT), AT(fit.beside),
     "volume of the inside's material that may lie beside the shape, over that of the shape "
     "(default 0.3)"},
    {"mirror", 0, CLI_CHOICE, NULL, "auto|no", 0, 0, ON(CLI_FIT), AT(fit.mirror),
     "auto (default): fit the mirror image of a shape that has one, too, and tell which fits "
     "better; a side that is not given with -O is that of the better one"},

    /* fits of many cases */
    {"cases", 0, CLI_TEXT, "FILE.csv", NULL, 0, 0, ON(CLI_FIT), AT(cohort.cases),
     "fit the cases of a table: a column id, a column image (an image, labels, a mesh or points), "
     "and others with the names of options, or model, for those that differ from case to case; "
     "relative paths start from the folder of the table"},
    {"part", 0, CLI_TEXT, "I/N", NULL, 0, 0, ON(CLI_FIT), AT(part),
     "fit only part I of N of the cases, contiguous rows of the table"},
    {"claim", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_FIT), AT(cohort.claim),
     "share the cases with other processes that run the same command, on this machine or on others "
     "with the same file system"},

    /* fits: outputs */
    {"reference", 0, CLI_TEXT, "FILE", NULL, 0, 0, ON(CLI_FIT), AT(fit.reference),
     "label map or segmentation to compare with, within the field of view of the image: Dice and "
     "distances between the surfaces"},
    {"truth", 0, CLI_TEXT, "FILE.json", NULL, 0, 0, ON(CLI_FIT), AT(fit.truth),
     "print the true parameters beside the fitted ones, and how far the pose is from the true one: "
     "the file of `phantom --truth`, or of an earlier fit"},
    {"reference-label", 0, CLI_LIST, "VALUE|NAME", NULL, 0, 0, ON(CLI_FIT),
     AT(fit.reference_labels),
     "label in the file of --reference (default: all segments, or all voxels but 0); several form "
     "a "
     "union"},
    {"label-out", 0, CLI_TEXT, "FILE", NULL, 0, 0, ON(CLI_FIT), AT(fit.label_out),
     "also write the fitted shape as labels on the grid of the image, 1 inside and 0 outside: .nii "
     ".nii.gz .nrrd .seg.nrrd .mha"},

    {"measure", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_GENERATE) | ON(CLI_EXACT), AT(measure),
     "print the measures of the shape (of its mesh, not of the map): its own (sdmgen shapes NAME "
     "lists them), volume, area and extents"},
    {"measure", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_FIT), AT(measure),
     "print the measures of the fitted shape with standard deviations: its own (sdmgen shapes NAME "
     "lists them), volume, area and extents"},
    {"depth", 0, CLI_TEXT, "MM[,MM...]", NULL, 0, 0, ON(CLI_GENERATE) | ON(CLI_EXACT) | ON(CLI_FIT),
     AT(depths),
     "with --measure: also the measures at these depths, such as the frequency along the cochlea"},
    {"returnparameterfile", 0, CLI_TEXT, "FILE", NULL, 0, 0,
     ON(CLI_GENERATE) | ON(CLI_EXACT) | ON(CLI_FIT), AT(returns),
     "also write the main results as lines NAME = VALUE, as 3D Slicer reads them"},
    {"install", 0, CLI_TEXT, "DIR", NULL, 0, 0, ON(CLI_SLICER), AT(install),
     "write the modules into this folder, which is made if it is missing"},

    /* printed texts */
    {"dump", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_CONFIG), AT(dump),
     "print the resolved configuration as YAML"},
    {"keys", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_CONFIG) | ON(CLI_EXPERIMENT), AT(keys),
     "list every key (without CONFIG)"},
    {"markdown", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_CONFIG) | ON(CLI_EXPERIMENT) | ON(CLI_HELP),
     AT(markdown), "print Markdown"},
    {"man", 0, CLI_FLAG, NULL, NULL, 0, 0, ON(CLI_HELP), AT(man),
     "print the manual page of sdmgen or of COMMAND, for man(1)"},
    {"completion", 0, CLI_CHOICE, NULL, "bash|zsh|fish", 0, 0, ON(CLI_HELP), AT(completion),
     "print the completion script for this shell"},

    /* all commands */
    {"plugin", 0, CLI_LIST, "FILE", NULL, 0, 0, WITH_SHAPES, AT(plugins),
     "load shapes from a shared object; may be repeated"},
    {"isolate", 0, CLI_FLAG, NULL, NULL, 0, 0, WITH_SHAPES, AT(isolate),
     "run the callbacks of plug-ins in processes of their own: one that crashes, hangs, exits or "
     "takes all memory is an error with its name; results have the same bits"},
    {"isolate-seconds", 0, CLI_REAL, "S", NULL, 0.01, 1e6, WITH_SHAPES, AT(isolate_seconds),
     "with --isolate: longest time of a call, by the clock (default 10)"},
    {"isolate-memory", 0, CLI_REAL, "GB", NULL, 0.05, 1e6, WITH_SHAPES, AT(isolate_memory),
     "with --isolate: memory of a plug-in in each of its processes (default 2)"},
    {"expect", 0, CLI_TEXT, "SHA256", NULL, 0, 0, WITH_MODELS, AT(expect),
     "refuse a model file with another SHA-256 than this (sdmgen info prints it)"},
    {"max-memory", 0, CLI_REAL, "GB", NULL, 0.1, 1e6, ALL & ~ON(CLI_HELP), AT(max_memory),
     "end with an error instead of using more memory than this, for inputs of unknown origin: "
     "limits the address space of the program"},
    {"threads", 0, CLI_INT, "N", NULL, 0, 1024, TRAININGS, AT(threads),
     "number of threads; 0: all (default). Results depend on it with train.minutes only"},
    {"threads", 0, CLI_INT, "N", NULL, 0, 1024, ALL & ~ON(CLI_HELP) & ~ON(CLI_SLICER) & ~TRAININGS,
     AT(threads), "number of threads; 0: all (default). Results do not depend on it"},
    {"seed", 0, CLI_INT, "N", NULL, 0, 9007199254740992.0,
     ON(CLI_TRAIN) | ON(CLI_DATASET) | ON(CLI_CONFIG) | ON(CLI_EVAL) | ON(CLI_SHAPES) |
         ON(CLI_VERIFY) | ON(CLI_BENCH) | ON(CLI_PHANTOM),
     AT(seed),
     "seed of the random numbers (default 1; train, dataset, config: the configuration's)"},
    {"json", 0, CLI_FLAG, NULL, NULL, 0, 0, REPORTS, AT(json),
     "print the result as one line of JSON"},
    {"progress", 0, CLI_CHOICE, NULL, "auto|plain|json|slicer", 0, 0,
     ON(CLI_TRAIN) | ON(CLI_DATASET) | ON(CLI_GENERATE) | ON(CLI_EXACT) | ON(CLI_EVAL) |
         ON(CLI_VERIFY) | ON(CLI_EXPERIMENT) | ON(CLI_FIT),
     AT(progress),
     "form of the progress: a bar on a terminal, plain lines elsewhere (auto, default); plain "
     "lines; every line on stderr as JSON; or the elements on stdout that 3D Slicer reads"},
    {"quiet", 'q', CLI_FLAG, NULL, NULL, 0, 0, ALL, AT(quiet),
     "print no progress and no notices; warnings and errors remain"},
    {"help", 'h', CLI_FLAG, NULL, NULL, 0, 0, ALL, AT(help), "print this text"},
};
const size_t cli_n_options = sizeof cli_options / sizeof *cli_options;
