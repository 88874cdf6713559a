/* Level sets with OpenVDB: converts maps to grids, writes metadata, verifies files. The files
   vdb*.cc are the only C++ files and the only users of OpenVDB; no exception leaves them. */
#include "sdm/vdb.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cinttypes>
#include <cmath>
#include <cstring>
#include <mutex>
#include <new>
#include <string>

#include "band.h"
#include "headroom.h"
#include "sdm/internal/block_border.h"
#include "sdm/internal/foreign.h"
#include "sdm/internal/text.h"
#include "sdm/memory.h"
#include "seal.h"
#include "vdb_parts.h"

using namespace vdb_parts;

namespace
{

using Leaf = Grid::TreeType::LeafNodeType;

/* Marks OpenVDB as the library that is at work until the end of a block; `library` NULL: marks that
   it is not, while it calls back. */
class at_work
{
  public:
    at_work(const char *library, const char *path)
        : before(sdm_foreign_enter(sdm_foreign{library, path}))
    {
    }
    ~at_work() { sdm_foreign_enter(before); }
    at_work(const at_work &) = delete;
    at_work &operator=(const at_work &) = delete;

  private:
    sdm_foreign before;
};

/* Sets up OpenVDB and TBB, before there is a tree: TBB without memory for its set-up would wait for
   itself for ever at its next use, in the destructor of a tree. OpenVDB swallows allocations that
   fail while it makes the names of its types, and would write files with other names. */
void initialize_once(const char *path, sdm_error *err)
{
    static std::once_flag once;
    static std::atomic<bool> unusable{false};
    if (unusable)
        need(sdm_fail(err, SDM_E_NOMEM,
                      "%s: memory ended while OpenVDB was set up; start the program again", path));
    std::call_once(once, [] {
        unusable = true;
        errno = 0;
        try {
            openvdb::initialize();
            tbb::parallel_for(0, 2, [](int) {});
        } catch (const std::exception &) { // no memory, or no thread
            throw std::bad_alloc();
        }
        if (errno == ENOMEM || Grid::gridType() != "Tree_float_5_4_3") throw std::bad_alloc();
        unusable = false;
    });
}

/* Runs f; an exception becomes a status, that of an I/O error of OpenVDB becomes
   when_unreadable. */
template <typename F>
sdm_status guarded(const char *path, sdm_status when_unreadable, sdm_error *err, F f)
{
    try {
        const at_work mark("OpenVDB", path);
        initialize_once(path, err);
        f();
        return SDM_OK;
    } catch (const failure &e) {
        return e.status;
    } catch (const std::bad_alloc &) {
        return sdm_fail(err, SDM_E_NOMEM, "%s: no memory for the level set", path);
    } catch (const openvdb::IoError &e) {
        return sdm_fail(err, when_unreadable, "%s: %s", path, e.what());
    } catch (const std::exception &e) {
        return sdm_fail(err, when_unreadable == SDM_E_IO ? SDM_E_INTERNAL : when_unreadable,
                        "%s: %s", path, e.what());
    } catch (...) {
        return sdm_fail(err, SDM_E_INTERNAL, "%s: unknown exception of OpenVDB", path);
    }
}

// ---- metadata

bool starts_with(const std::string &s, const char *prefix)
{
    return s.compare(0, std::strlen(prefix), prefix) == 0;
}

bool is_reserved(const std::string &name)
{
    static const char *const names[] = {
        "name",    "class",    "creator",     "sdm_frame",           "sdm_unit",       "sdm_sign",
        "sdm_cut", "sdm_hash", SDM_SEAL_MARK, "sdm_adjusted_voxels", "sdm_adjusted_mm"};
    for (const char *n : names)
        if (name == n) return true;
    return starts_with(name, "file_") || starts_with(name, "is_");
}

void add_text(Grid &grid, const std::string &name, const std::string &value)
{
    grid.insertMeta(name, openvdb::StringMetadata(value));
}

void add_metadata(Grid &grid, const sdm_vdb_opts &o, const sdm_vdb_report &r, sdm_error *err)
{
    for (size_t i = 0; i < o.n_metadata; i++) {
        const char *name = o.metadata[i].name, *value = o.metadata[i].value;
        if (!name || !*name || !value)
            need(sdm_fail(err, SDM_E_ARG, "metadata entry %zu has no name or no value", i));
        if (is_reserved(name) || grid[name])
            need(sdm_fail(err, SDM_E_ARG, "metadata \"%s\" is %s", name,
                          is_reserved(name) ? "written by the program itself" : "given twice"));
        add_text(grid, name, value);
    }
    char number[32], hash[32];
    grid.setCreator("sdmgen " SDM_VERSION_TEXT);
    add_text(grid, "sdm_frame", "LPS");
    add_text(grid, "sdm_unit", "mm");
    add_text(grid, "sdm_sign", "negative inside");
    add_text(grid, SDM_SEAL_MARK, "a checksum of all bytes follows the data");
    std::snprintf(hash, sizeof hash, "%016" PRIx64, r.hash);
    add_text(grid, "sdm_hash", hash);
    if (r.cut) add_text(grid, "sdm_cut", "the surface leaves the grid and is closed at its border");
    if (r.adjusted_voxels) {
        add_text(grid, "sdm_adjusted_voxels", std::to_string(r.adjusted_voxels));
        add_text(grid, "sdm_adjusted_mm", sdm_format_real(r.adjusted_mm, number));
    }
}

// ---- map to grid

/* Largest number of units in the last place by which the voxel size of a rotated grid is increased
   until OpenVDB takes the voxels for uniform. */
const int ROUNDINGS_MAX = 64;

/* Smallest background that can be stored and whose quotient by the voxel size, which checkLevelSet
   computes, is not below the band. */
float background_value(double band_voxels, double voxel, bool half)
{
    float b = static_cast<float>(band_voxels * voxel), stored = as_stored(b, half);
    while (!(static_cast<double>(stored) / voxel >= band_voxels))
        stored = as_stored(b = std::nextafter(b, INFINITY), half);
    return stored;
}

/* OpenVDB multiplies row vectors from the left: row a of the matrix is axis a, the last row the
   origin. */
openvdb::math::Transform::Ptr linear_transform(const openvdb::Vec3d axis[3],
                                               const openvdb::Vec3d &size, const double origin[3])
{
    openvdb::Mat4d m = openvdb::Mat4d::identity();
    for (int a = 0; a < 3; a++)
        for (int x = 0; x < 3; x++) m(a, x) = axis[a][x] * size[a];
    for (int x = 0; x < 3; x++) m(3, x) = origin[x];
    return openvdb::math::Transform::createLinearTransform(m);
}

/* Index-to-world transform; a level set gets the same voxel size on all axes (the spacings agree to
   1e-6 of their size). */
openvdb::math::Transform::Ptr transform_of(const sdm_grid &g, bool level_set)
{
    // axes: columns of dir, orthonormalised to the last digit
    openvdb::Vec3d axis[3], size(g.spacing[0], g.spacing[1], g.spacing[2]);
    for (int a = 0; a < 3; a++) {
        axis[a] = openvdb::Vec3d(g.dir[a], g.dir[3 + a], g.dir[6 + a]);
        for (int b = 0; b < a; b++) axis[a] -= axis[b] * axis[a].dot(axis[b]);
        axis[a].normalize();
    }
    if (level_set) size = openvdb::Vec3d(g.spacing[0]);
    if (axis[0][0] == 1 && axis[1][1] == 1 && axis[2][2] == 1 && size[0] == size[1] &&
        size[0] == size[2]) {
        auto t = openvdb::math::Transform::createLinearTransform(size[0]);
        t->postTranslate(openvdb::Vec3d(g.origin[0], g.origin[1], g.origin[2]));
        return t;
    }
    auto t = linear_transform(axis, size, g.origin);
    // hasUniformScale() of rotated axes fails by roundings of 1e-15: enlarge the voxels by single
    // units in the last place until it holds
    for (int i = 0; level_set && i < ROUNDINGS_MAX && !t->hasUniformScale(); i++) {
        size = openvdb::Vec3d(std::nextafter(size[0], INFINITY));
        t = linear_transform(axis, size, g.origin);
    }
    return t;
}

/* Adds one leaf of 8^3 voxels to the tree, with values from `box`. Its voxels are active where
   abs(value) < background, or all of them if dense. */
void fill_block(Grid &grid, Grid::Accessor &acc, const sdm_band &box, const Coord &corner,
                bool dense, bool half)
{
    const float background = grid.background();
    Leaf leaf(corner, background, false);
    bool inside = false;
    for (openvdb::Index32 at = 0; at < Leaf::SIZE; at++) {
        const Coord c = leaf.offsetToGlobalCoord(at).offsetBy(box.pad);
        if (c[0] < 0 || c[1] < 0 || c[2] < 0 || c[0] >= box.n[0] || c[1] >= box.n[1] ||
            c[2] >= box.n[2])
            continue;
        const float v = as_stored(box.values[(c[2] * box.n[1] + c[1]) * box.n[0] + c[0]], half);
        if (dense || std::fabs(v) < background)
            leaf.setValueOn(at, v);
        else if (v < 0)
            leaf.setValueOff(at, -background);
        inside = inside || v < 0;
    }
    if (leaf.onVoxelCount())
        acc.addLeaf(new Leaf(leaf));
    else if (inside)
        // no voxel near the surface, all inside: a tile instead of a leaf
        acc.addTile(1, corner, -background, false);
}

/* An empty grid. */
Grid::Ptr new_grid(const openvdb::math::Transform::Ptr &transform, float background, bool dense,
                   bool half)
{
    Grid::Ptr grid = Grid::create(background);
    grid->setName(GRID_NAME);
    grid->setTransform(transform);
    grid->setGridClass(dense ? openvdb::GRID_UNKNOWN : openvdb::GRID_LEVEL_SET);
    grid->setSaveFloatAsHalf(half);
    return grid;
}

Grid::Ptr grid_of(const openvdb::math::Transform::Ptr &transform, const sdm_band &box,
                  float background, bool dense, bool half, sdm_error *err)
{
    const int64_t count = box.n[0] * box.n[1] * box.n[2];
    need(sdm_vdb_headroom(static_cast<uint64_t>(std::count_if(
                              box.values, box.values + count,
                              [=](float v) { return dense || std::fabs(v) < background; })),
                          err));
    Grid::Ptr grid = new_grid(transform, background, dense, half);
    Grid::Accessor acc = grid->getAccessor();
    const int low = -box.pad & ~7, dim = 8;
    for (int k = low; k < box.n[2] - box.pad; k += dim)
        for (int j = low; j < box.n[1] - box.pad; j += dim)
            for (int i = low; i < box.n[0] - box.pad; i += dim)
                fill_block(*grid, acc, box, Coord(i, j, k), dense, half);
    if (!dense) grid->tree().prune(); // merges equal tiles
    return grid;
}

// ---- from map to level set

struct owned_band {
    sdm_band band = {};
    ~owned_band() { sdm_band_dispose(&band); }
};

double band_of(const sdm_vdb_opts &o) { return o.band_voxels != 0 ? o.band_voxels : 3.0; }

void check_options(const sdm_grid &g, const sdm_vdb_opts &o, sdm_error *err)
{
    if (o.band_voxels != 0 && !(o.band_voxels >= 3 && o.band_voxels <= 100))
        need(sdm_fail(err, SDM_E_ARG, "band of %g voxels, need 3 to 100", o.band_voxels));
    if (o.n_metadata && !o.metadata)
        need(sdm_fail(err, SDM_E_ARG, "%zu metadata entries at NULL", o.n_metadata));
    const double h = g.spacing[0];
    // OpenVDB treats a voxel volume below 3e-15 as zero
    if (!(h * g.spacing[1] * g.spacing[2] > 4e-15))
        need(sdm_fail(err, SDM_E_ARG,
                      "spacing %g x %g x %g mm is too small for OpenVDB, need at least 2e-5 mm", h,
                      g.spacing[1], g.spacing[2]));
    if (!o.dense &&
        !(std::fabs(g.spacing[1] - h) <= 1e-6 * h && std::fabs(g.spacing[2] - h) <= 1e-6 * h))
        need(sdm_fail(err, SDM_E_ARG,
                      "spacing %g x %g x %g mm: a level set needs voxels of one size; write the "
                      "map itself instead (sdm_vdb_opts.dense)",
                      g.spacing[0], g.spacing[1], g.spacing[2]));
    // keeps a margin below the largest number, because the background is rounded up
    if (!o.dense && !(band_of(o) * h < (o.half ? 65000.0 : 3e38)))
        need(sdm_fail(err, SDM_E_ARG, "spacing %g mm is too large for the number format", h));
}

/* Demands values that fit into 16-bit floats, whose range ends at 65504. */
void check_half(const sdm_band &box, sdm_error *err)
{
    const size_t count = static_cast<size_t>(box.n[0] * box.n[1] * box.n[2]);
    for (size_t i = 0; i < count; i++)
        if (!(std::fabs(box.values[i]) <= 65504.0f))
            need(sdm_fail(err, SDM_E_ARG,
                          "value %g mm does not fit into 16 bits, need at most 65504",
                          static_cast<double>(box.values[i])));
}

/* The transform of a level set. */
openvdb::math::Transform::Ptr uniform_transform(const sdm_grid &g, sdm_error *err)
{
    const auto transform = transform_of(g, true);
    if (!transform->hasUniformScale())
        need(sdm_fail(err, SDM_E_ARG,
                      "to OpenVDB voxels of %g mm on turned axes are not uniform; write the map "
                      "itself instead (sdm_vdb_opts.dense)",
                      g.spacing[0]));
    return transform;
}

Grid::Ptr make_level_set(const sdm_grid &g, const float *values, const sdm_vdb_opts &o,
                         sdm_vdb_report &report, sdm_error *err)
{
    const auto transform = uniform_transform(g, err);
    const float background = background_value(band_of(o), transform->voxelSize()[0], o.half);
    owned_band box;
    {
        const at_work ours(nullptr, nullptr); // o.map() may call a plug-in
        need(sdm_band_close(&g, values, background, &o, &box.band, err));
    }
    report.cut = box.band.cut;
    report.estimated_voxels = box.band.estimated;
    Grid::Ptr grid = grid_of(transform, box.band, background, false, o.half, err);
    mend_creases(*grid, o, report, err);
    return grid;
}

/* The leaf of one block; whether one of its values is negative. */
Leaf *leaf_of(const sdm_blocks &b, size_t i, float background, bool half, bool &inside)
{
    const Coord corner(b.first[i][0], b.first[i][1], b.first[i][2]);
    Leaf *leaf = new Leaf(corner, background, false);
    for (openvdb::Index32 at = 0; at < Leaf::SIZE; at++) {
        const Coord c = Leaf::offsetToLocalCoord(at);
        const float v =
            as_stored(b.values[i][(c[2] * SDM_BLOCK_SIZE + c[1]) * SDM_BLOCK_SIZE + c[0]], half);
        inside = inside || v < 0;
        if (std::fabs(v) < background)
            leaf->setValueOn(at, v);
        else if (v < 0)
            leaf->setValueOff(at, -background);
    }
    return leaf;
}

Grid::Ptr make_from_blocks(const sdm_blocks &b, const sdm_vdb_opts &o, sdm_vdb_report &report,
                           sdm_error *err)
{
    const auto transform = uniform_transform(b.grid, err);
    const float background = background_value(band_of(o), transform->voxelSize()[0], o.half);
    if (static_cast<float>(b.band_mm) != background)
        need(sdm_fail(err, SDM_E_ARG, "blocks with a band of %g mm, need %g mm (sdm_vdb_band())",
                      b.band_mm, static_cast<double>(background)));
    if (sdm_blocks_reach_border(&b))
        need(sdm_fail(err, SDM_E_ARG,
                      "the band leaves the grid: blocks cannot be closed at its border; write the "
                      "whole map"));
    need(sdm_vdb_headroom(static_cast<uint64_t>(b.n_block) * Leaf::SIZE / 3, err));
    Grid::Ptr grid = new_grid(transform, background, false, o.half);
    Grid::Accessor acc = grid->getAccessor();
    bool inside = false;
    for (size_t i = 0; i < b.n_block; i++) acc.addLeaf(leaf_of(b, i, background, o.half, inside));
    for (int64_t t = 0; t < b.n[0] * b.n[1] * b.n[2]; t++) {
        if (b.tile[t] != SDM_TILE_INSIDE) continue;
        inside = true;
        const Coord corner(static_cast<int>(t % b.n[0] * SDM_BLOCK_SIZE),
                           static_cast<int>(t / b.n[0] % b.n[1] * SDM_BLOCK_SIZE),
                           static_cast<int>(t / b.n[0] / b.n[1] * SDM_BLOCK_SIZE));
        acc.addTile(1, corner, -background, false);
    }
    if (!inside)
        need(sdm_fail(
            err, SDM_E_ARG,
            "no voxel of the map is inside the surface: there is no level set to write; "
            "use a grid that holds the shape, with smaller voxels, or write the map itself "
            "(sdm_vdb_opts.dense)"));
    grid->tree().prune();
    mend_creases(*grid, o, report, err);
    return grid;
}

Grid::Ptr make_dense(const sdm_grid &g, const float *values, const sdm_vdb_opts &o,
                     sdm_vdb_report &report, sdm_error *err)
{
    owned_band box;
    need(sdm_band_copy(&g, values, &box.band, err));
    if (o.half) check_half(box.band, err);
    const size_t count = sdm_grid_count(&g);
    const float background = as_stored(*std::max_element(values, values + count), o.half);
    for (size_t i = 0; i < count && !report.cut; i++) {
        const int64_t at[3] = {static_cast<int64_t>(i) % g.n[0],
                               static_cast<int64_t>(i) / g.n[0] % g.n[1],
                               static_cast<int64_t>(i) / g.n[0] / g.n[1]};
        for (int a = 0; a < 3; a++)
            report.cut = report.cut || (values[i] < 0 && (at[a] == 0 || at[a] == g.n[a] - 1));
    }
    return grid_of(transform_of(g, false), box.band, background, true, o.half, err);
}

// ---- reading

void check_hash(const Grid &grid, const char *path, sdm_error *err)
{
    char hash[32];
    std::snprintf(hash, sizeof hash, "%016" PRIx64, hash_of(grid));
    const std::string stored = text_of(grid, "sdm_hash");
    if (!stored.empty() && stored != hash)
        need(sdm_fail(err, SDM_E_FORMAT, "%s: damaged: hash of the values is %s, stored is %s",
                      path, hash, stored.c_str()));
}

std::string numbers(const openvdb::Vec3d &v)
{
    char b[3][32];
    return std::string(sdm_format_real(v[0], b[0])) + " " + sdm_format_real(v[1], b[1]) + " " +
           sdm_format_real(v[2], b[2]);
}

std::string numbers(const Coord &c)
{
    return std::to_string(c[0]) + " " + std::to_string(c[1]) + " " + std::to_string(c[2]);
}

std::string describe(const Grid &grid, bool sealed)
{
    const openvdb::CoordBBox box = grid.evalActiveVoxelBoundingBox();
    const bool level_set = grid.getGridClass() == openvdb::GRID_LEVEL_SET;
    char number[32];
    std::string t = "grid          " + grid.getName() + "\nclass         " +
                    (level_set ? "level set" : "not set (whole map)");
    t += "\nvoxel size    " + numbers(grid.voxelSize()) + " mm\norigin        " +
         numbers(grid.indexToWorld(Coord(0))) + " mm";
    t += "\nactive voxels " + std::to_string(grid.activeVoxelCount()) + "\nactive box    " +
         numbers(box.min()) + " to " + numbers(box.max());
    t += std::string("\nbackground    ") +
         sdm_format_real(static_cast<double>(grid.background()), number) + " mm";
    t += std::string("\nnumbers       ") + (grid.saveFloatAsHalf() ? "16-bit" : "32-bit") +
         " floats";
    t += std::string("\nchecksum      ") + (sealed ? "right" : "none in the file") +
         (text_of(grid, "sdm_hash").empty() ? "" : ", hash right");
    t += level_set ? "\ncheckLevelSet passed\n" : "\ncheckLevelSet not asked\n";
    for (auto m = grid.beginMeta(); m != grid.endMeta(); ++m)
        if (m->second->typeName() == "string" && !starts_with(m->first, "file_") &&
            m->first != "name" && m->first != "class")
            t += m->first + ": " + m->second->str() + "\n";
    return t;
}

// ---- writing

/* Checks the grid, adds the metadata and writes the file. */
void finish(const char *path, const Grid::Ptr &g, const sdm_vdb_opts &o, sdm_vdb_report &r,
            sdm_error *err)
{
    check_cancelled(o, err);
    if (!o.dense) check_level_set(*g, path, SDM_E_QUALITY, err);
    r.active_voxels = static_cast<int64_t>(g->activeVoxelCount());
    r.hash = hash_of(*g);
    add_metadata(*g, o, r, err);
    check_cancelled(o, err);
    write_grid(path, g, err);
}

} // namespace

sdm_status sdm_vdb_write(const char *path, const sdm_grid *grid, const float *values,
                         const sdm_vdb_opts *opts, sdm_vdb_report *report, sdm_error *err)
{
    if (!path || !*path || !grid || !values)
        return sdm_fail(err, SDM_E_ARG, "level set: path, grid and values are needed");
    const sdm_status s = sdm_grid_check(grid, err);
    if (s) return s;
    return guarded(path, SDM_E_IO, err, [&] {
        const sdm_vdb_opts o = opts ? *opts : sdm_vdb_opts();
        sdm_vdb_report r = {};
        check_options(*grid, o, err);
        finish(path,
               o.dense ? make_dense(*grid, values, o, r, err)
                       : make_level_set(*grid, values, o, r, err),
               o, r, err);
        if (report) *report = r;
    });
}

sdm_status sdm_vdb_band(const sdm_grid *grid, const sdm_vdb_opts *opts, double *band_mm,
                        sdm_error *err)
{
    if (!grid || !band_mm) return sdm_fail(err, SDM_E_ARG, "band: a grid is needed");
    const sdm_status s = sdm_grid_check(grid, err);
    if (s) return s;
    return guarded("band", SDM_E_ARG, err, [&] {
        const sdm_vdb_opts o = opts ? *opts : sdm_vdb_opts();
        check_options(*grid, o, err);
        const auto transform = uniform_transform(*grid, err);
        *band_mm =
            static_cast<double>(background_value(band_of(o), transform->voxelSize()[0], o.half));
    });
}

sdm_status sdm_vdb_write_blocks(const char *path, const sdm_blocks *blocks,
                                const sdm_vdb_opts *opts, sdm_vdb_report *report, sdm_error *err)
{
    if (!path || !*path || !blocks || !blocks->tile)
        return sdm_fail(err, SDM_E_ARG, "level set: path and blocks are needed");
    const sdm_status s = sdm_grid_check(&blocks->grid, err);
    if (s) return s;
    return guarded(path, SDM_E_IO, err, [&] {
        const sdm_vdb_opts o = opts ? *opts : sdm_vdb_opts();
        sdm_vdb_report r = {};
        if (o.dense) need(sdm_fail(err, SDM_E_ARG, "blocks are written as a level set, not dense"));
        check_options(blocks->grid, o, err);
        finish(path, make_from_blocks(*blocks, o, r, err), o, r, err);
        if (report) *report = r;
    });
}

sdm_status sdm_vdb_verify(const char *path, char **text, sdm_error *err)
{
    if (text) *text = nullptr;
    if (!path) return sdm_fail(err, SDM_E_ARG, "level set: a path is needed");
    return guarded(path, SDM_E_FORMAT, err, [&] {
        bool sealed = false;
        const Grid::Ptr grid = read_grid(path, &sealed, err);
        check_hash(*grid, path, err);
        if (grid->getGridClass() == openvdb::GRID_LEVEL_SET)
            check_level_set(*grid, path, SDM_E_FORMAT, err);
        if (!text) return;
        const std::string t = describe(*grid, sealed);
        void *block = nullptr;
        need(sdm_alloc(&block, t.size() + 1, 1, "description", err));
        std::memcpy(block, t.c_str(), t.size() + 1);
        *text = static_cast<char *>(block);
    });
}

sdm_status sdm_vdb_sample(const char *path, const int32_t *index, size_t n, float *values,
                          sdm_error *err)
{
    if (!path || (n && (!index || !values)))
        return sdm_fail(err, SDM_E_ARG, "level set: path, index and values are needed");
    return guarded(path, SDM_E_FORMAT, err, [&] {
        bool sealed = false;
        const Grid::Ptr grid = read_grid(path, &sealed, err);
        auto acc = grid->getConstAccessor();
        for (size_t i = 0; i < n; i++)
            values[i] = acc.getValue(Coord(index[3 * i], index[3 * i + 1], index[3 * i + 2]));
    });
}
