/* Prints the figures of a mesh audit and judges the mesh. */
#include "report_audit.h"

#include <math.h>
#include <stdio.h>

#include "json_values.h"
#include "sdm/internal/shape_survey.h"
#include "sdm/internal/units.h"
#include "sdm/internal/vec3.h"
#include "terminal.h"

/* Parts in the table, in JSON and in a line of text. */
enum { ROWS = 20, JSON_PARTS = 1000, NAMED = 4 };

bool cli_part_inside_out(const sdm_part_audit *a, size_t i)
{
    const sdm_part *p = &a->part[i];
    if (p->state == SDM_PART_INSIDE_OUT) return !(p->volume > 0);
    return p->state == SDM_PART_SOLID && a->mesh.inverted && a->inside_out > 0 && p->volume < 0;
}

typedef bool part_test(const sdm_part_audit *a, size_t index);

static size_t count_parts(const sdm_part_audit *a, part_test *counts)
{
    size_t n = 0;
    for (size_t i = 0; i < a->n; i++) n += counts(a, i);
    return n;
}

/* Name of a part's state in the mesh as given. */
static const char *state_name(const sdm_part_audit *a, size_t i)
{
    static const char *const names[] = {[SDM_PART_SOLID] = "solid",
                                        [SDM_PART_CAVITY] = "cavity",
                                        [SDM_PART_INSIDE_OUT] = "subtracted",
                                        [SDM_PART_FLAT] = "flat",
                                        [SDM_PART_OPEN] = "open"};
    return cli_part_inside_out(a, i) ? "inside out" : names[a->part[i].state];
}

static void print_parts(const sdm_part_audit *a)
{
    printf("\nparts:\n  %-6s  %-9s  %-18s  %-10s  %-6s  %-8s  %-12s  %s\n", "number", "triangles",
           "vertices", "state", "turned", "overlaps", "volume mm^3", "box mm");
    for (size_t i = 0; i < a->n && i < ROWS; i++) {
        const sdm_part *p = &a->part[i];
        char range[48], volume[32];
        snprintf(range, sizeof range, "%zu .. %zu", p->first_vert, p->last_vert);
        printf("  %-6zu  %-9zu  %-18s  %-10s  %-6s  %-8s  %-12s  %.6g %.6g %.6g .. %.6g %.6g "
               "%.6g\n",
               i + 1, p->n_tri, range, state_name(a, i), p->turned ? "yes" : "no",
               p->met ? "yes" : "no", cli_number(p->volume, 6, volume), p->min[0], p->min[1],
               p->min[2], p->max[0], p->max[1], p->max[2]);
    }
    if (a->n > ROWS) printf("  and %zu more\n", a->n - ROWS);
}

void cli_print_audit(const sdm_part_audit *audit)
{
    const sdm_audit *a = &audit->mesh;
    printf("vertices             %zu\n", a->n_vert);
    printf("unused vertices      %zu\n", audit->unused);
    printf("triangles            %zu\n", a->n_tri);
    printf("parts                %zu\n", audit->n);
    printf("closed               %s\n", a->closed ? "yes" : "no");
    printf("manifold             %s\n", a->manifold ? "yes" : "no");
    const size_t wrong = count_parts(audit, cli_part_inside_out);
    if (wrong > 0 && audit->n > 1)
        printf("inside out           %zu of %zu parts\n", wrong, audit->n);
    else
        printf("inside out           %s\n", a->inverted ? "yes" : "no");
    printf("boundary edges       %zu\n", a->boundary_edges);
    printf("non-manifold edges   %zu\n", a->nonmanifold_edges);
    printf("misoriented edges    %zu\n", a->misoriented_edges);
    printf("degenerate triangles %zu\n", a->degenerate);
    printf("duplicate triangles  %zu\n", a->duplicate);
    printf("self-intersections   %zu\n", a->self_intersections);
    char number[32];
    printf("volume               %s mm^3, the sum over all triangles: overlaps count twice\n",
           cli_number(a->volume, 6, number));
    printf("area                 %s mm^2\n", cli_number(a->area, 6, number));
    if (isfinite(audit->union_volume)) {
        printf("volume of the union  %s mm^3\n", cli_number(audit->union_volume, 6, number));
        printf("area of the union    %s mm^2\n", cli_number(audit->union_area, 6, number));
    }
    printf("box                  %.6g %.6g %.6g .. %.6g %.6g %.6g mm\n", a->min[0], a->min[1],
           a->min[2], a->max[0], a->max[1], a->max[2]);
    print_parts(audit);
    const bool fine = cli_audit_verdict(audit, "", NULL) == SDM_OK;
    const double size = sqrt(v3_dist2(a->min, a->max));
    if (size > 0 && (size < SDM_SURVEY_SIZE_MIN || size > SDM_SURVEY_SIZE_MAX))
        printf("\nunits: the mesh measures %.3g mm across: is it in %s? lengths are mm\n", size,
               sdm_unit_near(size < SDM_SURVEY_SIZE_MIN ? 1e3 : 1e-3, NULL));
    if (fine)
        printf("\nfine: the mesh is closed%s%s\n",
               a->inverted ? "; it is inside out, which maps put right" : "",
               a->self_intersections ? "; it overlaps itself, and the union counts" : "");
}

void cli_json_audit(sdm_json *json, const sdm_audit *a)
{
    sdm_json_int(json, "vertices", (int64_t)a->n_vert);
    sdm_json_int(json, "triangles", (int64_t)a->n_tri);
    sdm_json_int(json, "components", (int64_t)a->components);
    sdm_json_bool(json, "closed", a->closed);
    sdm_json_bool(json, "manifold", a->manifold);
    sdm_json_bool(json, "inverted", a->inverted);
    sdm_json_int(json, "boundary_edges", (int64_t)a->boundary_edges);
    sdm_json_int(json, "nonmanifold_edges", (int64_t)a->nonmanifold_edges);
    sdm_json_int(json, "misoriented_edges", (int64_t)a->misoriented_edges);
    sdm_json_int(json, "degenerate", (int64_t)a->degenerate);
    sdm_json_int(json, "duplicate", (int64_t)a->duplicate);
    sdm_json_int(json, "self_intersections", (int64_t)a->self_intersections);
    sdm_json_real(json, "volume_mm3", a->volume);
    sdm_json_real(json, "area_mm2", a->area);
    sdm_json_reals(json, "min", a->min, 3);
    sdm_json_reals(json, "max", a->max, 3);
}

void cli_json_parts(sdm_json *json, const sdm_part_audit *a)
{
    sdm_json_real(json, "union_volume_mm3", a->union_volume);
    sdm_json_real(json, "union_area_mm2", a->union_area);
    sdm_json_int(json, "unused_vertices", (int64_t)a->unused);
    sdm_json_int(json, "parts_inside_out", (int64_t)count_parts(a, cli_part_inside_out));
    sdm_json_text(json, "verdict", cli_verdict_name(cli_audit_verdict(a, "", NULL)));
    sdm_json_open(json, "parts", '[');
    for (size_t i = 0; i < a->n && i < JSON_PARTS; i++) {
        const sdm_part *p = &a->part[i];
        sdm_json_open(json, NULL, '{');
        sdm_json_text(json, "state", state_name(a, i));
        sdm_json_bool(json, "turned", p->turned);
        sdm_json_int(json, "triangles", (int64_t)p->n_tri);
        sdm_json_int(json, "first_triangle", (int64_t)p->first_tri);
        sdm_json_int(json, "first_vertex", (int64_t)p->first_vert);
        sdm_json_int(json, "last_vertex", (int64_t)p->last_vert);
        sdm_json_int(json, "open_edges", (int64_t)p->open_edges);
        sdm_json_int(json, "meets_others", (int64_t)p->met);
        sdm_json_real(json, "volume_mm3", p->volume);
        sdm_json_real(json, "area_mm2", p->area);
        sdm_json_reals(json, "min", p->min, 3);
        sdm_json_reals(json, "max", p->max, 3);
        sdm_json_close(json, '}');
    }
    sdm_json_close(json, ']');
}

void cli_warn_audit(const sdm_audit *a)
{
    // parts that share an edge are fine where as many triangles run one way as the other
    if (a->nonmanifold_edges > 0 && !a->closed)
        cli_notice("%zu %s more than two triangles", a->nonmanifold_edges,
                   a->nonmanifold_edges == 1 ? "edge has" : "edges have");
    if (a->misoriented_edges > 0)
        cli_warn("%zu %s two triangles that run along it in the same direction",
                 a->misoriented_edges, a->misoriented_edges == 1 ? "edge has" : "edges each have");
    if (a->degenerate > 0)
        cli_notice("%zu degenerate triangle%s", a->degenerate, a->degenerate == 1 ? "" : "s");
    if (a->duplicate > 0)
        cli_notice("%zu duplicate triangle%s", a->duplicate, a->duplicate == 1 ? "" : "s");
}

/* Appends "vertices 8 .. 15, box 0 0 0 .. 1 1 2 mm". */
static void add_place(const sdm_part *p, sdm_text *text)
{
    sdm_text_add(text, "vertices %zu .. %zu, box %.4g %.4g %.4g .. %.4g %.4g %.4g mm",
                 p->first_vert, p->last_vert, p->min[0], p->min[1], p->min[2], p->max[0], p->max[1],
                 p->max[2]);
}

void cli_name_part(const sdm_part_audit *a, size_t index, sdm_text *text)
{
    const sdm_part *p = &a->part[index];
    sdm_text_add(text, "part %zu of %zu (%zu triangles, ", index + 1, a->n, p->n_tri);
    add_place(p, text);
    sdm_text_add(text, ") ");
}

/* Volume of the solid parts of a group, mm^3; 0: there are none. */
static double group_volume(const sdm_part_audit *a, size_t group)
{
    double volume = 0;
    for (size_t i = 0; i < a->n; i++)
        if (a->part[i].group == group && a->part[i].state == SDM_PART_SOLID)
            volume += fabs(a->part[i].volume);
    return volume;
}

/* Appends the names of the parts of a group, "part 2 of 9 (...) " or "parts 2 (...), 3 (...) and 5
 * more of 9 ". Returns the number of parts of the group. */
static size_t add_group(const sdm_part_audit *a, size_t group, sdm_text *text)
{
    size_t n = 0, told = 0;
    for (size_t i = 0; i < a->n; i++) n += a->part[i].group == group;
    if (n == 1) {
        cli_name_part(a, group, text);
        return n;
    }
    for (size_t i = group; i < a->n && told < NAMED; i++) {
        if (a->part[i].group != group) continue;
        sdm_text_add(text, "%s%zu (", told++ ? ", " : "parts ", i + 1);
        add_place(&a->part[i], text);
        sdm_text_add(text, ")");
    }
    if (n > told) sdm_text_add(text, " and %zu more", n - told);
    sdm_text_add(text, " of %zu ", a->n);
    return n;
}

void cli_describe_apart(const sdm_mesh *mesh, const sdm_part_audit *audit, sdm_text *text)
{
    size_t at = audit->n; // the lowest part of the smallest group
    double least = INFINITY;
    for (size_t i = 0; i < audit->n; i++) {
        const double volume = audit->part[i].group == i ? group_volume(audit, i) : 0;
        if (volume > 0 && volume < least) least = volume, at = i;
    }
    if (at == audit->n || audit->bodies < 2) return;
    const double gap = sdm_part_gap(mesh, audit, at);
    const size_t around = gap < 0 ? sdm_part_around(audit, at) : audit->n;
    const bool many = add_group(audit, at, text) > 1;
    if (around < audit->n)
        sdm_text_add(text,
                     "%s inside part %zu and %s nothing; if %s to be a cavity, reverse the "
                     "vertices of %s triangles",
                     many ? "lie" : "lies", around + 1, many ? "change" : "changes",
                     many ? "they are" : "it is", many ? "their" : "its");
    else if (isfinite(gap))
        sdm_text_add(text,
                     "%s %.2g mm from the others; where they belong together, let them overlap",
                     many ? "lie" : "lies", fabs(gap));
    else
        sdm_text_add(text, "%s no other; where they belong together, let them overlap",
                     many ? "meet" : "meets");
}

void cli_describe_open(const sdm_part_audit *a, sdm_text *text)
{
    size_t most = 0;
    for (size_t i = 1; i < a->n; i++)
        if (a->part[i].open_edges > a->part[most].open_edges) most = i;
    if (!a->n || !a->part[most].open_edges) return;
    const double *x = a->part[most].open_at;
    cli_name_part(a, most, text);
    sdm_text_add(text,
                 "has %zu edges that are open or badly oriented, the first at %.4g %.4g %.4g mm: "
                 "add the triangles that are missing there, "
                 "let neighbours run the same way around, and give vertices that are the same "
                 "point exactly the same coordinates",
                 a->part[most].open_edges, x[0], x[1], x[2]);
}

void cli_describe_unused(const sdm_part_audit *a, sdm_text *text)
{
    const size_t n = a->unused, run = n ? a->unused_last - a->unused_first + 1 : 0;
    if (!n) return;
    if (n == 1)
        sdm_text_add(text, "vertex %zu belongs", a->unused_first);
    else if (run == 1)
        sdm_text_add(text, "%zu vertices (the first: %zu) belong", n, a->unused_first);
    else
        sdm_text_add(text, "%zu vertices (%s%zu .. %zu) belong", n, run < n ? "the first: " : "",
                     a->unused_first, a->unused_last);
    sdm_text_add(text, " to no triangle: is an offset of vertex indices wrong, so that triangles "
                       "have vertices of another part? If they are left over, remove them");
}

static bool is_lost(const sdm_part_audit *a, size_t i)
{
    return a->part[i].state == SDM_PART_INSIDE_OUT;
}

static bool is_mended(const sdm_part_audit *a, size_t i)
{
    return a->part[i].turned && a->part[i].volume < 0;
}

/* Appends "part 2 of 9 (...) " or "parts 2 (...), 3 (...), 5 (...), 6 (...) and 2 more of 9 ";
 * brief: only the numbers. Returns how many there are. */
static size_t add_parts(const sdm_part_audit *a, part_test *counts, bool brief, sdm_text *text)
{
    const size_t n = count_parts(a, counts);
    size_t told = 0;
    for (size_t i = 0; i < a->n && told < NAMED; i++) {
        if (!counts(a, i)) continue;
        if (n == 1 && !brief) {
            cli_name_part(a, i, text);
            return n;
        }
        sdm_text_add(text, "%s%zu", told++ ? ", " : n > 1 ? "parts " : "part ", i + 1);
        if (brief) continue;
        sdm_text_add(text, " (");
        add_place(&a->part[i], text);
        sdm_text_add(text, ")");
    }
    if (n > told) sdm_text_add(text, " and %zu more", n - told);
    sdm_text_add(text, " of %zu ", a->n);
    return n;
}

void cli_describe_inside_out(const sdm_part_audit *a, sdm_text *text)
{
    size_t first = 0;
    while (first < a->n && !is_lost(a, first)) first++;
    if (first == a->n) return;
    if (a->part[first].volume > 0) {
        const size_t n = add_parts(a, cli_part_inside_out, false, text);
        sdm_text_add(text,
                     "%s inside out and larger than the rest: maps turn the whole mesh for %s, and "
                     "subtract ",
                     n > 1 ? "are" : "is", n > 1 ? "them" : "it");
        const size_t lost = add_parts(a, is_lost, true, text);
        sdm_text_add(text, "from what %s", lost > 1 ? "these overlap" : "that overlaps");
        return;
    }
    const bool many = add_parts(a, is_lost, false, text) > 1, met = a->part[first].met > 0;
    if (many)
        sdm_text_add(text,
                     "are inside out%s: they are subtracted from what they overlap and are not "
                     "solid themselves",
                     met ? " and overlap others" : "");
    else
        sdm_text_add(
            text, "is inside out%s: it is subtracted from what it overlaps and is not solid itself",
            met ? " and overlaps another" : "");
}

bool cli_describe_folded(const sdm_part_audit *a, sdm_text *text)
{
    size_t most = 0;
    for (size_t i = 1; i < a->n; i++)
        if (sdm_part_tangle(&a->part[i]) > sdm_part_tangle(&a->part[most])) most = i;
    if (!a->n || !(sdm_part_tangle(&a->part[most]) > 0)) return false;
    const sdm_part *p = &a->part[most];
    cli_name_part(a, most, text);
    if (p->folded > SDM_PART_FOLDED_MIN)
        sdm_text_add(text,
                     "passes through itself, and %.2g %% of its surface faces the wrong way: what "
                     "lies behind that is missing; are two of its vertices exchanged, ",
                     100 * p->folded);
    else
        sdm_text_add(text,
                     "passes through itself in %.2g %% of its surface, over %g %%: is its outline "
                     "a loop, does it go round more than once, ",
                     100 * p->crossing, 100 * SDM_PART_CROSSING_MAX);
    sdm_text_add(text, "is the radius of a fillet larger than half of the thickness, a wall "
                       "thicker than the part is wide, or an angle in degrees given to cos() or "
                       "sin()?");
    return true;
}

void cli_add_thin(double thick, double voxel, sdm_text *text)
{
    sdm_text_add(text,
                 "%.2g mm thick, too thin for voxels of %.3g mm: it will be missing or broken in "
                 "surfaces; ",
                 thick, voxel);
    if (sdm_hopelessly_thin(thick, voxel))
        sdm_text_add(text, "no grid of the whole shape shows it: are its vertices, or a length of "
                           "it, in another unit than mm?");
    else
        sdm_text_add(text, "a spacing of at most %.2g mm shows it", 0.5 * thick);
}

void cli_describe_thin(const sdm_part_audit *a, size_t index, double voxel, sdm_text *text)
{
    const sdm_part *p = &a->part[index];
    sdm_text_add(text, "part %zu of %zu (box %.4g..%.4g, %.4g..%.4g, %.4g..%.4g mm) is ", index + 1,
                 a->n, p->min[0], p->max[0], p->min[1], p->max[1], p->min[2], p->max[2]);
    cli_add_thin(p->thick, voxel, text);
}

static void warn_open(const sdm_part_audit *audit)
{
    sdm_text text = {0};
    if (!audit->mesh.boundary_edges) return;
    cli_describe_open(audit, &text);
    cli_warn(
        "the mesh is open: %zu boundary edges; inside is where the winding number exceeds 1/2%s%s",
        audit->mesh.boundary_edges, text.size ? "; " : "", text.size ? text.data : "");
    sdm_text_dispose(&text);
}

static void warn_unused(const sdm_part_audit *audit)
{
    sdm_text text = {0};
    cli_describe_unused(audit, &text);
    if (text.data && !text.failed) cli_warn("%s", text.data);
    sdm_text_dispose(&text);
}

static bool warn_thin(const sdm_part_audit *audit, double voxel)
{
    const size_t i = sdm_part_audit_thinnest(audit);
    if (i == audit->n || !sdm_too_thin(audit->part[i].thick, voxel)) return false;
    sdm_text text = {0};
    cli_describe_thin(audit, i, voxel, &text);
    if (!text.failed) cli_warn("%s", text.data);
    sdm_text_dispose(&text);
    return true;
}

static void warn_inside_out(const sdm_part_audit *audit, const char *mend)
{
    sdm_text text = {0};
    if (!audit->inside_out) return;
    cli_describe_inside_out(audit, &text);
    if (!text.failed) cli_warn("%s; %s", text.data, mend);
    sdm_text_dispose(&text);
}

bool cli_is_turned(const sdm_part_audit *a)
{
    size_t turned = 0;
    for (size_t i = 0; i < a->n; i++) turned += a->part[i].turned;
    return turned > 0 && turned == a->n;
}

void cli_describe_turned(const sdm_part_audit *a, sdm_text *text)
{
    if (cli_is_turned(a))
        sdm_text_add(text, "the whole mesh is inside out; maps turn it");
    else if (count_parts(a, is_mended))
        sdm_text_add(text, add_parts(a, is_mended, false, text) > 1
                               ? "are inside out; maps turn them"
                               : "is inside out; maps turn it");
}

/* Parts that are inside out and that maps turn. */
static void notice_turned(const sdm_part_audit *audit)
{
    sdm_text text = {0};
    if (audit->inside_out || !count_parts(audit, is_mended)) return;
    cli_describe_turned(audit, &text);
    if (!text.failed) cli_notice("%s", text.data);
    sdm_text_dispose(&text);
}

static void warn_folded(const sdm_part_audit *audit)
{
    sdm_text text = {0};
    if (!audit->inside_out && cli_describe_folded(audit, &text) && !text.failed)
        cli_warn("%s", text.data);
    sdm_text_dispose(&text);
}

bool cli_warn_mesh(const sdm_mesh *mesh, double voxel, const char *mend)
{
    sdm_part_audit audit;
    if (sdm_part_audit_make(mesh, SDM_AUDIT_WALLS, NULL, &audit, NULL)) return false;
    warn_open(&audit);
    warn_unused(&audit);
    cli_warn_audit(&audit.mesh);
    warn_inside_out(&audit, mend);
    notice_turned(&audit);
    warn_folded(&audit);
    const bool thin = warn_thin(&audit, voxel);
    sdm_part_audit_dispose(&audit);
    return thin;
}

const char *cli_verdict_name(sdm_status verdict)
{
    return verdict == SDM_OK ? "fine" : verdict == SDM_E_MESH ? "broken" : "warning";
}

sdm_status cli_audit_verdict(const sdm_part_audit *a, const char *mend, sdm_error *err)
{
    size_t open = 0;
    bool encloses = false;
    for (size_t i = 0; i < a->n; i++) {
        open += a->part[i].open_edges;
        encloses = encloses || a->part[i].state == SDM_PART_SOLID;
    }
    if (open > 0) {
        sdm_text text = {0};
        cli_describe_open(a, &text);
        const sdm_status s = sdm_fail(err, SDM_E_MESH,
                                      "the mesh is not closed: %s; maps take for inside where the "
                                      "winding number exceeds 1/2",
                                      text.failed ? "edges are open" : text.data);
        sdm_text_dispose(&text);
        return s;
    }
    if (a->unused) { // other defects may follow from it
        sdm_text text = {0};
        cli_describe_unused(a, &text);
        const sdm_status s = sdm_fail(err, SDM_E_QUALITY, "%s",
                                      text.failed ? "vertices belong to no triangle" : text.data);
        sdm_text_dispose(&text);
        return s;
    }
    if (a->inside_out) {
        sdm_text text = {0};
        cli_describe_inside_out(a, &text);
        const sdm_status s = sdm_fail(err, SDM_E_QUALITY, "%s; %s",
                                      text.failed ? "a part is inside out" : text.data, mend);
        sdm_text_dispose(&text);
        return s;
    }
    sdm_text text = {0};
    if (cli_describe_folded(a, &text)) {
        const sdm_status s = sdm_fail(err, SDM_E_QUALITY, "%s", text.failed ? "folded" : text.data);
        sdm_text_dispose(&text);
        return s;
    }
    sdm_text_dispose(&text);
    const size_t thin = sdm_part_audit_thinnest(a);
    if (thin < a->n && a->n > 1 && sdm_survey_part_is_flat(a, thin)) {
        sdm_text part = {0};
        cli_name_part(a, thin, &part);
        const sdm_status s = sdm_fail(
            err, SDM_E_QUALITY,
            "%sis %.2g mm thick, less than a thousandth of the mesh: no grid shows it; are "
            "its vertices, or a radius, in m?",
            part.failed ? "a part " : part.data, a->part[thin].thick);
        sdm_text_dispose(&part);
        return s;
    }
    if (!encloses) return sdm_fail(err, SDM_E_QUALITY, "the mesh encloses no volume");
    return SDM_OK;
}

sdm_status cli_turn_parts(sdm_mesh *mesh, sdm_error *err)
{
    size_t n = 0;
    const sdm_status s = sdm_mesh_turn_parts(mesh, &n, err);
    if (!s) cli_notice("parts turned: %zu", n);
    return s;
}
