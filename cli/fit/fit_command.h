/* The state of a fit of a shape to an image, labels or points, and the steps of `sdmgen fit`. */
#pragma once

#include "args/options.h"
#include "measure/measures.h"
#include "sdm/fit.h"
#include "sdm/volume.h"

/* largest number of options -O of a shape whose mirror image is fitted, too */
enum { CLI_OPTIONS_MAX = 64 };

/* Comparison of the fitted shape with labels, within the field of view of the image. */
typedef struct cli_overlap {
    bool measured;
    size_t n_fit, n_reference, n_both; /* voxels inside, on the reference's grid */
    size_t n_beyond;                   /* labelled voxels farther outside than the margin */
    double beyond[3], beyond_mm;       /* the nearest of them (LPS mm), its distance */
    double dice;
    bool has_surface;                     /* both surfaces have vertices in the field of view */
    double mean_mm, q95_mm, hausdorff_mm; /* distances between the surfaces, in both directions */
} cli_overlap;

/* A place that --find has found, and the fit from there. */
typedef struct cli_candidate {
    double place[3]; /* middle of the shape at the start, LPS mm */
    double score;    /* see sdm_fit_candidate */
    bool other_side; /* as of cli_fit, after the fit; `side` and `better`, too */
    char side[64];
    double better;
    sdm_fit_result result;
    sdm_error doubt;
} cli_candidate;

/* The state of one fit. Zero-initialise all members but args; cli_fit_dispose() frees. */
typedef struct cli_fit {
    const cli_args *args;
    const char *path;       /* file of the image, labels, mesh or points */
    const char *model_path; /* NULL: without a model */

    /* fit_source.c: the maps are made by a network, the exact engine or both */
    sdm_registry *registry;
    sdm_instance *shape;
    /* a fit with a network alone: its shape, where it is known, for the checks; else NULL */
    sdm_registry *judge_registry;
    sdm_instance *judge_shape;
    bool shape_changed; /* it was changed after the training, and is none of the two */
    sdm_model *model;
    const char *shape_name;
    sdm_param *params; /* [n_params] */
    size_t n_params;
    double *start;      /* [n_params] parameters at the start */
    bool start_clamped; /* the start was clamped to the range of the parameters */
    bool *kept;         /* [n_params] --keep NAME; NULL: none */
    double pivot[3];    /* middle of the shape at the start, in the shape's frame, mm */
    sdm_fit_source source;

    /* fit_grid.c: thickness (mm) of the thinnest part, for which the grid of exact maps was made
     * finer; 0: it was not */
    double thinnest;

    /* fit_finer.c: voxels (mm) of the maps of the first fit, after which one with finer maps
     * followed, and beside which part of the shape or the data they are coarse; 0: none followed */
    double coarse_mm;
    char coarse_beside[64];
    bool was_nearly_coarse; /* these had passed, and explained a figure a little beyond its limit */
    /* fit_finer.c: voxels of the maps that the fit would have gone on with, and the largest number
     * that it takes by itself; 0: these were not too many */
    double too_many, many_at_most;

    /* fit_target.c: the image, labels or points to fit to */
    sdm_volume image;
    float *mask;    /* [nz][ny][nx] labels, 1 inside, 0 outside; NULL: the target is no label map */
    double *points; /* [n_points][3] mm; NULL: the target is a volume */
    bool of_surface; /* the points were spread over the surface of a mesh */
    sdm_fit_target target;
    const char *suspicion; /* why a fit may fail: the end of its error; NULL: no suspicion */

    sdm_fit_opts opts;

    size_t n_fits;  /* fits begun, that of the mirror image, too */
    bool at_mirror; /* the present one is that of the mirror image */

    /* fit_mirror.c: the fit of the mirror image of the shape */
    const char *mirror;        /* option that mirrors the shape; NULL: none is tried */
    char side[64];             /* its value in the result; "" where the shape is a model's */
    double better;             /* by how much the result is better; see sdm_fit_compare() */
    sdm_instance *other_shape; /* the shape of the side that `shape` is not; NULL: not needed yet */
    bool other_side;           /* `shape` is not that of the command line but its mirror image */

    /* fit_candidates.c: --find */
    cli_candidate *candidates;      /* [n_candidates] accepted ones first */
    size_t n_candidates, candidate; /* candidate: number of the one that is fitted, from 1 */

    /* fit_compare.c: labels to compare the fitted shape with */
    sdm_grid reference_grid;
    float *reference;         /* [reference_grid] 1 inside, 0 outside; NULL: none */
    bool reference_is_target; /* reference == mask: the labels of the target itself */

    /* fit_truth.c: true parameters, NaN: not known; NULL: none are */
    double *truth; /* [n_params] */
    bool has_truth_pose;
    sdm_pose truth_pose;
    bool truth_same;   /* the true rotation is another one with the same surface */
    double truth_turn; /* degrees; > 0: a symmetry of the shape, by which truth_pose was turned */

    /* fit_result.c */
    sdm_fit_result result;
    bool found;      /* result holds an estimate */
    sdm_error doubt; /* status SDM_E_QUALITY: why the estimate is not trustworthy; SDM_OK: it is
                        trustworthy */
    bool exchanged;  /* fit_contrast.c: exchanged values of the tissues are the reason */
    sdm_fit_source map_source; /* source of `map`: the one of the last iterations */
    bool by_network;           /* the network makes `map`: the estimate is in its trained range */
    sdm_grid map_grid;         /* grid of map_source, in the estimated pose */
    float *map;                /* [map_grid] signed distance, mm */
    sdm_mesh surface;          /* zero level set of the map, in the world */
    cli_overlap overlap;

    /* fit_measures.c: --measure */
    cli_depths depths;
    sdm_measures measures;
} cli_fit;

/* Opens the model or the shape; sets the start parameters and the source of the maps. SDM_E_ARG,
 * SDM_E_RANGE, errors of opening. */
sdm_status cli_fit_open_source(cli_fit *f, sdm_error *err);

/* After cli_fit_read_target(): without a network, sets the grid of the exact maps, which holds the
 * shape over its ranges: that of --like, --size or --spacing; that of the model; or 64 voxels along
 * its longest edge and, for volumes, up to 128 where the thinnest part of the start shape would
 * have less than three voxels across it. SDM_E_ARG; errors of making the shape. */
sdm_status cli_fit_make_grid(cli_fit *f, sdm_error *err);

/* *out = the grid of exact maps with voxels of `spacing` mm that holds the shape at the parameters,
 * and with any of them at an end of its range. SDM_E_ARG; errors of making the shape. */
sdm_status cli_fit_finer_grid(const cli_fit *f, const double *params, double spacing, sdm_grid *out,
                              sdm_error *err);

/* After a fit: the edge (mm) of the voxels of finer exact maps that may pass where this fit is in
 * doubt: those that `map voxels` advises; or, if that check has passed but the maps are nearly too
 * coarse, and residuals or the values of a tissue are a little beyond their limits, 0.8 times the
 * present ones. NaN: finer maps are not the remedy. */
double cli_fit_finer_voxel(const cli_fit *f);

/* After cli_fit_run(): where the command line leaves the voxels of exact maps open and nothing but
 * them leaves, or may leave, the fit in doubt, goes on once from its result with voxels of
 * cli_fit_finer_voxel(), and f->result is that of the second fit. Nothing where a prior of the pose
 * is given, nor where these are too many: f->too_many then holds their number. Where the second fit
 * ends with an error other than SDM_E_QUALITY, the first result stays, and a warning tells why.
 * SDM_E_CANCELLED. */
sdm_status cli_fit_go_finer(cli_fit *f, sdm_error *err);

/* After cli_fit_open_source(): reads --depth. With --measure it measures the shape at the start, so
 * that a mistake ends the command before the fit. SDM_E_ARG, SDM_E_PLUGIN. */
sdm_status cli_fit_prepare_measures(cli_fit *f, sdm_error *err);

/* After the fit: with --measure fills f->measures. */
sdm_status cli_fit_measure(cli_fit *f, sdm_error *err);

/* Reads the image, label map, mesh or points. SDM_E_ARG, SDM_E_FORMAT, SDM_E_IO. */
sdm_status cli_fit_read_target(cli_fit *f, sdm_error *err);

/* Sets f->opts from the command line, except for lengths, the start pose and the rotations.
 * SDM_E_ARG. */
sdm_status cli_fit_read_options(cli_fit *f, sdm_error *err);

/* After cli_fit_read_target(): sets the lengths of f->opts, from the command line or from the
 * voxels. */
void cli_fit_default_lengths(cli_fit *f);

/* After cli_fit_read_target(): refuses options that do nothing for this kind of target. SDM_E_ARG
 * with the options that apply. */
sdm_status cli_fit_check_options(const cli_fit *f, sdm_error *err);

/* Warns if labels or points are more than five times as large as the start shape, or as small, or
 * if an image is too small or too coarse for the shape, and names the unit that would explain it.
 * SDM_E_ARG, unless --force is given: so it is with the smallest or largest shape of the ranges,
 * too. Errors of making the shape. */
sdm_status cli_fit_check_size(const cli_fit *f, sdm_error *err);

/* Images: says which values of the tissues a fit starts from if the command line does not give
 * them, unless the shape is the one for which they are made; sets f->suspicion. */
void cli_fit_notice_tissues(cli_fit *f);

/* Prints a notice if --keep parameters is given without -p: the shape then keeps the default values
 * of its parameters. */
void cli_fit_notice_kept(const cli_fit *f);

/* Sets the start pose and the rotations to try. SDM_E_ARG; SDM_E_FORMAT: a bad file of points. */
sdm_status cli_fit_read_start(cli_fit *f, sdm_error *err);

/* values[v->grid] = 1 where a voxel has one of the labels, else 0. words: values of labels, or
 * names of segments; an empty list selects all segments, or all voxels that are not 0. SDM_E_ARG:
 * no such label; SDM_E_FORMAT: no voxel has the label. */
sdm_status cli_fit_label_mask(const char *path, const sdm_volume *v, const cli_list *words,
                              float *values, sdm_error *err);

/* found[] = the different values of the volume, ascending; returns their number, or most + 1 if
 * there are more than `most` or one is no whole number. NaN does not count. */
size_t cli_fit_distinct(const sdm_volume *v, size_t most, float *found);

/* *many = the volume has more different values than labels have, or fractions. SDM_E_NOMEM. */
sdm_status cli_fit_many_values(const sdm_volume *v, bool *many, sdm_error *err);

/* Prints a warning that the file `path` has so many values. mend: the end of the warning, which
 * says what to do. */
void cli_fit_warn_many_values(const char *path, const char *mend);

/* With --label-close: morphological closing of values[grid] (1 and 0) by a ball of that radius. */
sdm_status cli_fit_close_labels(const cli_fit *f, const sdm_grid *grid, float *values,
                                sdm_error *err);

/* Longest edge of a voxel of the maps, mm. */
double cli_fit_map_voxel(const cli_fit *f);

/* Before the fit: reads the labels of --reference; without this option the labels of the target are
 * the reference. SDM_E_ARG, SDM_E_FORMAT, SDM_E_IO. */
sdm_status cli_fit_read_reference(cli_fit *f, sdm_error *err);

/* Before the fit: fills f->truth and, where the file has one, f->truth_pose from the file of
 * --truth, if it is given. SDM_E_ARG: the truth of another shape; SDM_E_FORMAT, SDM_E_IO. */
sdm_status cli_fit_read_truth(cli_fit *f, sdm_error *err);

/* After cli_fit_make_map(): where the pose of --truth differs from the fitted one by a turn to the
 * same surface, sets f->truth_same and, if the turn is a symmetry about an axis of the shape's
 * frame, turns f->truth_pose by it and sets f->truth_turn. Errors of making the map. */
sdm_status cli_fit_compare_truth(cli_fit *f, sdm_error *err);

/* After the fit: prints how far the pose is from that of --truth; adds it to a JSON object. Nothing
 * where the file has no pose. */
void cli_fit_print_truth_pose(const cli_fit *f);
void cli_fit_json_truth_pose(const cli_fit *f, sdm_json *json);

/* After the fit: the distance (mm) between the centres of the shape in its pose and in that of
 * --truth; NaN where the file has no pose. */
double cli_fit_truth_shift(const cli_fit *f);

/* After cli_fit_compare(): warns where the labels of --reference hardly overlap the shape of a
 * trustworthy fit, and where the pose of --truth is farther from it than its size. */
void cli_fit_warn_mismatch(const cli_fit *f);

/* After cli_fit_make_map(): fills f->overlap, unless there is no reference or no surface. */
sdm_status cli_fit_compare(cli_fit *f, sdm_error *err);

/* After the fit: fits the mirror image, too, if the shape has one and --mirror allows it. Takes the
 * better side if the command line leaves it open; otherwise adds the comparison to the verdict, and
 * f->doubt where the mirror image is better or as good. */
sdm_status cli_fit_mirror(cli_fit *f, sdm_error *err);

/* After cli_fit_open_source(): refuses --mirror no for a shape without a mirror image. SDM_E_ARG.
 */
sdm_status cli_fit_check_mirror(cli_fit *f, sdm_error *err);

/* True where the shape has a mirror image and neither the command line nor a model fixes the side;
 * sets f->mirror. */
bool cli_fit_side_is_open(cli_fit *f);

/* Replaces f->shape by its mirror image, or the mirror image by f->shape. */
sdm_status cli_fit_swap_side(cli_fit *f, sdm_error *err);

/* sdm_fit(), then cli_fit_mirror(). A fit that is not trustworthy is no error: f->doubt. */
sdm_status cli_fit_run(cli_fit *f, sdm_error *err);

/* --find: searches the image, fits the candidates, and takes the best fit that is accepted or, if
 * none is, the best one, with f->doubt. */
sdm_status cli_fit_find(cli_fit *f, sdm_error *err);
void cli_fit_print_candidates(const cli_fit *f);
void cli_fit_json_candidates(const cli_fit *f, sdm_json *json);
void cli_fit_candidates_dispose(cli_fit *f);

/* Writes the file of --returnparameterfile. */
sdm_status cli_fit_write_results(const cli_fit *f, sdm_error *err);

/* "passed", "doubtful" or "failed". */
const char *cli_fit_grade_name(sdm_fit_grade grade);

/* The verdict in a few words with the name of its worst check, for titles; empty: there is none. */
enum { FIT_WORDS_MAX = 80 };
void cli_fit_verdict_words(const cli_fit *f, char text[FIT_WORDS_MAX]);

/* After a fit that only its maps, coarse or a network's, make doubtful or refuse: prints the
 * command that goes on from its result with exact maps of the voxels that are needed, or with a
 * polish; nothing where the exact shape is not known. After a fit that only stopped too early:
 * prints the command that goes on with more iterations or, where the data lack what it needs, with
 * known values that are kept. */
void cli_fit_print_next(const cli_fit *f);

/* Does a check have this grade or a worse one, and at least this figure? */
bool cli_fit_found(const cli_fit *f, sdm_fit_check_kind kind, sdm_fit_grade grade, double figure);

/* Did the fit stop at the largest number of iterations, with nothing else against it? */
bool cli_fit_is_unfinished(const cli_fit *f);

/* Did the fit only fail to converge, because the data hardly determine some of its parameters?
 * Neither another start nor more iterations help it. */
bool cli_fit_lacks_data(const cli_fit *f);

/* Did the fit only fail to converge, and did an unknown go to and fro at the end? More iterations
 * do not help it. */
bool cli_fit_swings(const cli_fit *f);

/* Do residuals refuse the fit, and is another shape their most probable cause? */
bool cli_fit_shows_other(const cli_fit *f);

/* After the fit: a shape that was changed after the training of the network makes the check of the
 * network doubtful. */
void cli_fit_doubt_changed_shape(cli_fit *f);

/* Is there a fitted parameter that the data do not determine? Modes of a statistical model, whose
 * distribution says enough of them, do not count. */
bool cli_fit_has_open(const cli_fit *f);

/* Do the data show a part of the shape, or not determine a parameter, and does this alone decide
 * which values can be used? */
bool cli_fit_knows_usable(const cli_fit *f);

/* Prints the line `use`: the parameters that can be used, and those that cannot. Those that are
 * kept are not named. cli_fit_json_usable adds the list of the former to a JSON object. */
void cli_fit_print_usable(const cli_fit *f);
void cli_fit_json_usable(const cli_fit *f, sdm_json *json);

/* Prints the verdict as text; adds it to a JSON object. */
void cli_fit_print_verdict(const cli_fit *f);
void cli_fit_json_verdict(const cli_fit *f, sdm_json *json);

/* Before a fit to an image: SDM_E_QUALITY where the values of the tissues are exchanged at the
 * start pose, unless --force is given: so clearly, and without rotations that are tried; or in an
 * image that cannot be stated right: its border is like the inside, it has about as much of the
 * outside as of the shape, and encloses nothing that is like the inside. Else a notice; where the
 * start or the image shows it so clearly, a refused fit does not search for another start:
 * f->opts.max_restarts becomes 0. A notice, too, where only the border speaks for exchanged values.
 */
sdm_status cli_fit_check_contrast(cli_fit *f, sdm_error *err);

/* After a fit to an image that is not trustworthy: where the image at the start pose looks like the
 * inside around the shape, and clearly more like the outside within it, or a fit with exchanged
 * values finds the shape, makes this the only reason of f->doubt and of the verdict, and sets
 * f->exchanged. Errors of making the map; SDM_E_CANCELLED. */
sdm_status cli_fit_explain_contrast(cli_fit *f, sdm_error *err);

/* After a fit to labels or points that is not trustworthy: text[size] = "; " and why its start is
 * wrong: far from the data, or in another frame; "": no reason is seen. Errors of making the map.
 */
sdm_status cli_fit_astray(const cli_fit *f, char *text, size_t size, sdm_error *err);

/* After a fit that is not trustworthy: text[size] = the end of its error, "; " and what to try; "":
 * nothing to add. Returns text. */
const char *cli_fit_remedy(const cli_fit *f, char *text, size_t size);

/* Do the voxels of the maps explain why the fit is refused: they are too coarse, and nothing but
 * them and residuals refuses it? */
bool cli_fit_voxels_refuse(const cli_fit *f);

/* Is the fit refused, and may a wrong start be the cause? Exchanged tissues and coarse maps are
 * other causes. */
bool cli_fit_start_is_suspect(const cli_fit *f);

/* Computes f->map and f->surface of the estimate. */
sdm_status cli_fit_make_map(cli_fit *f, sdm_error *err);

/* Kind of the target: "image", "labels" or "points". */
const char *cli_fit_kind(const cli_fit *f);

/* Negates x and y of points[n][3]: this converts RAS to LPS and back. */
void cli_fit_negate_xy(double *points, size_t n);

/* Checks the types of the output files, and the options of level sets. SDM_E_ARG. */
sdm_status cli_fit_check_types(const cli_args *args, sdm_error *err);

/* Before any work: checks the types of the output files and that they can be written.
 * SDM_E_ARG, SDM_E_IO. */
sdm_status cli_fit_check_files(const cli_args *args, sdm_error *err);

/* Writes the output files. */
sdm_status cli_fit_write_files(const cli_fit *f, sdm_error *err);

/* Writes slices of the image near the shape with the contour of the fitted shape, and of the
 * reference where --reference gives one. */
sdm_status cli_fit_write_picture(const cli_fit *f, const char *path, sdm_error *err);

/* values[g] at a point of the world, by trilinear interpolation; voxels outside of the grid count
 * as 0. */
double cli_fit_interpolate(const sdm_grid *g, const float *values, const double world[3]);

/* Prints the pairs of parameters of which only a sum or a difference is well determined. */
void cli_fit_print_correlated(const cli_fit *f);

/* Prints the result as text on stdout. */
void cli_fit_print(const cli_fit *f);

/* Adds the result as one JSON object. */
void cli_fit_json(const cli_fit *f, sdm_json *json);

/* Adds the members "command", the command line that repeats the fit, and "inputs", the files that
 * it read with their checksums (CRC-64/XZ). */
void cli_fit_json_repeat(const cli_fit *f, sdm_json *json);

void cli_fit_dispose(cli_fit *f);
