/* Level sets through OpenVDB: the only file that knows it, and the only one in C++. No exception leaves it. */
#include "sdm/vdb.h"

#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/Diagnostics.h>

#include <algorithm>
#include <cinttypes>
#include <cmath>
#include <cstring>
#include <map>
#include <mutex>
#include <new>
#include <string>
#include <vector>

#include "band.h"
#include "sdm/checksum.h"
#include "sdm/file.h"
#include "sdm/memory.h"
#include "sdm/text.h"
#include "seal.h"

namespace
{

using Grid = openvdb::FloatGrid;
using Leaf = Grid::TreeType::LeafNodeType;
using openvdb::Coord;

const char *const GRID_NAME = "surface";

// a status on its way through C++ code; the text is in the caller's sdm_error
struct failure {
    sdm_status status;
};

void need(sdm_status s)
{
    if (s) throw failure{s};
}

void initialize_once()
{
    static std::once_flag once;
    std::call_once(once, [] { openvdb::initialize(); });
}

// runs f and turns whatever it throws into a status
template <typename F> sdm_status guarded(const char *path, sdm_status when_unreadable, sdm_error *err, F f)
{
    try {
        initialize_once();
        f();
        return SDM_OK;
    } catch (const failure &e) {
        return e.status;
    } catch (const std::bad_alloc &) {
        return sdm_fail(err, SDM_E_NOMEM, "%s: no memory for the level set", path);
    } catch (const openvdb::IoError &e) {
        return sdm_fail(err, when_unreadable, "%s: %s", path, e.what());
    } catch (const std::exception &e) {
        return sdm_fail(err, when_unreadable == SDM_E_IO ? SDM_E_INTERNAL : when_unreadable, "%s: %s", path, e.what());
    } catch (...) {
        return sdm_fail(err, SDM_E_INTERNAL, "%s: unknown exception of OpenVDB", path);
    }
}

// ---- metadata

bool starts_with(const std::string &s, const char *prefix) { return s.compare(0, std::strlen(prefix), prefix) == 0; }

bool is_reserved(const std::string &name)
{
    static const char *const names[] = {"name",           "class",   "creator",  "sdm_frame",   "sdm_unit",
                                        "sdm_sign",       "sdm_cut", "sdm_hash", SDM_SEAL_MARK, "sdm_adjusted_voxels",
                                        "sdm_adjusted_mm"};
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
        if (!name || !*name || !value) need(sdm_fail(err, SDM_E_ARG, "metadata entry %zu has no name or no value", i));
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

float as_stored(float v, bool half) { return half ? openvdb::io::truncateRealToHalf(v) : v; }

// smallest background that can be stored and is not below the band (checkLevelSet divides it by the voxel size)
float background_value(double band_voxels, double voxel, bool half)
{
    float b = static_cast<float>(band_voxels * voxel), stored = as_stored(b, half);
    while (!(static_cast<double>(stored) / voxel >= band_voxels))
        stored = as_stored(b = std::nextafter(b, INFINITY), half);
    return stored;
}

openvdb::math::Transform::Ptr transform_of(const sdm_grid &g)
{
    // axes a: columns of dir, made orthonormal to the last digit, times the spacing
    openvdb::Vec3d axis[3];
    for (int a = 0; a < 3; a++) {
        axis[a] = openvdb::Vec3d(g.dir[a], g.dir[3 + a], g.dir[6 + a]);
        for (int b = 0; b < a; b++) axis[a] -= axis[b] * axis[a].dot(axis[b]);
        axis[a].normalize();
    }
    if (axis[0][0] == 1 && axis[1][1] == 1 && axis[2][2] == 1 && g.spacing[0] == g.spacing[1] &&
        g.spacing[0] == g.spacing[2]) {
        auto t = openvdb::math::Transform::createLinearTransform(g.spacing[0]);
        t->postTranslate(openvdb::Vec3d(g.origin[0], g.origin[1], g.origin[2]));
        return t;
    }
    openvdb::Mat4d m =
        openvdb::Mat4d::identity(); // OpenVDB multiplies row vectors: row a is axis a, the last row the origin
    for (int a = 0; a < 3; a++)
        for (int x = 0; x < 3; x++) m(a, x) = axis[a][x] * g.spacing[a];
    for (int x = 0; x < 3; x++) m(3, x) = g.origin[x];
    return openvdb::math::Transform::createLinearTransform(m);
}

// one 8^3 block of the tree from the box; active where |value| < band (everywhere when dense)
void fill_block(Grid &grid, Grid::Accessor &acc, const sdm_band &box, const Coord &corner, bool dense, bool half)
{
    const float background = grid.background();
    Leaf leaf(corner, background, false);
    bool inside = false;
    for (openvdb::Index32 at = 0; at < Leaf::SIZE; at++) {
        const Coord c = leaf.offsetToGlobalCoord(at).offsetBy(box.pad);
        if (c[0] < 0 || c[1] < 0 || c[2] < 0 || c[0] >= box.n[0] || c[1] >= box.n[1] || c[2] >= box.n[2]) continue;
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
        acc.addTile(1, corner, -background, false); // far inside: no voxel of the block is near the surface
}

Grid::Ptr grid_of(const sdm_grid &g, const sdm_band &box, float background, bool dense, bool half)
{
    Grid::Ptr grid = Grid::create(background);
    grid->setName(GRID_NAME);
    grid->setTransform(transform_of(g));
    grid->setGridClass(dense ? openvdb::GRID_UNKNOWN : openvdb::GRID_LEVEL_SET);
    grid->setSaveFloatAsHalf(half);
    Grid::Accessor acc = grid->getAccessor();
    const int low = -box.pad & ~7, dim = 8;
    for (int k = low; k < box.n[2] - box.pad; k += dim)
        for (int j = low; j < box.n[1] - box.pad; j += dim)
            for (int i = low; i < box.n[0] - box.pad; i += dim)
                fill_block(*grid, acc, box, Coord(i, j, k), dense, half);
    if (!dense) grid->tree().prune(); // joins inside tiles
    return grid;
}

// ---- creases

// CheckEikonal refuses squared gradients outside [0.5, 1.5]; the margin is for the rounding of the check itself
const float SQUARE_LOW = 0.52f, SQUARE_HIGH = 1.48f;
// how far within it a gradient is brought, for what its neighbours ask, and the part of the way at a time
const float SQUARE_INSET = 0.05f, RELAXATION = 0.7f;
// a map that is wrong at a larger share of its zero crossings is no distance
const double CREASES_MOST = 0.5;
// every so many rounds go by first differences, and from such a round on all of the stencil may change, against cycles
const int ROUNDS_MOST = 300, PLAIN_EVERY = 6, WIDE_FROM = 24;
// in voxels: most that a value changes at a time, and least that is left of one that was not smaller
const float STEP_MOST = 0.25f, SIZE_LEAST = 0.1f;
// values of less of the squared slope stay
const float SHARE_LEAST = 1e-3f;

// that of the check: a voxel and three on each side along x, y, z
using Stencil = openvdb::math::WenoStencil<const Grid>;
const int STENCIL_SIZE = Stencil::SIZE;

// place of value n of the stencil
Coord stencil_place(const Coord &at, int n)
{
    static const int along[] = {-3, -2, -1, 1, 2, 3};
    Coord c = at;
    if (n) c[(n - 1) / 6] += along[(n - 1) % 6];
    return c;
}

bool on_crease(const Stencil &stencil)
{
    if (!stencil.zeroCrossing()) return false;
    const float square = stencil.normSqGrad();
    return !(square >= SQUARE_LOW && square <= SQUARE_HIGH);
}

// squared gradient by first differences, in voxels: at a zero crossing it never vanishes
float plain_square(const Stencil &stencil, float voxel)
{
    const float here = stencil.getValue(0), side = here > 0 ? 1.0f : -1.0f;
    float sum = 0;
    for (const unsigned below : {3u, 9u, 15u}) {
        const float low = std::min(side * stencil.getValue(below), side * stencil.getValue(below + 1));
        const float slope = std::max(side * here - low, 0.0f) / voxel;
        sum += slope * slope;
    }
    return sum;
}

std::vector<Coord> find_creases(const Grid &grid)
{
    std::vector<Coord> found;
    size_t crossings = 0;
    Stencil stencil(grid);
    for (auto v = grid.cbeginValueOn(); v; ++v) {
        stencil.moveTo(v.getCoord());
        crossings += stencil.zeroCrossing();
        if (on_crease(stencil)) found.push_back(v.getCoord());
    }
    if (static_cast<double>(found.size()) > CREASES_MOST * static_cast<double>(crossings)) found.clear();
    return found;
}

// the same where the stencil reaches what was changed: stencils of creases of before
std::vector<Coord> find_creases_near(const Grid &grid, const std::vector<Coord> &before)
{
    std::vector<Coord> near, found;
    near.reserve(before.size() * STENCIL_SIZE * STENCIL_SIZE);
    for (const Coord &c : before)
        for (int n = 0; n < STENCIL_SIZE * STENCIL_SIZE; n++)
            near.push_back(stencil_place(stencil_place(c, n / STENCIL_SIZE), n % STENCIL_SIZE));
    std::sort(near.begin(), near.end());
    near.erase(std::unique(near.begin(), near.end()), near.end());
    Stencil stencil(grid);
    Grid::ConstAccessor acc = grid.getConstAccessor();
    for (const Coord &c : near) {
        if (!acc.isValueOn(c)) continue;
        stencil.moveTo(c);
        if (on_crease(stencil)) found.push_back(c);
    }
    return found;
}

// the first value seen of each voxel that is changed
using originals = std::map<Coord, float>;

struct sweep_limits {
    float voxel, most; // mm
    bool half;
};

float square_at(Stencil &stencil, const Coord &at, bool plain, float voxel)
{
    stencil.moveTo(at);
    return plain ? plain_square(stencil, voxel) : stencil.normSqGrad();
}

// derivative of the squared gradient at a voxel by the value of another, times the size of a voxel; away from 0, where signs stay
float derivative(Grid::Accessor &acc, Stencil &stencil, const Coord &at, const Coord &by, bool plain, float voxel)
{
    const float v = acc.getValue(by), part = std::copysign(1.0f / 1024, v),
                before = square_at(stencil, at, plain, voxel);
    acc.setValueOnly(by, v + part * voxel);
    const float after = square_at(stencil, at, plain, voxel);
    acc.setValueOnly(by, v);
    return (after - before) / part;
}

/* The least change of a voxel and its neighbours, or of the whole stencil, that brings the squared gradient back to where it is
   allowed, to first order (Kaczmarz 1937). Signs stay, and with them the voxels that are inside. */
void project(Grid::Accessor &acc, Stencil &stencil, const Coord &at, int round, const sweep_limits &l,
             originals &original)
{
    stencil.moveTo(at);
    if (!on_crease(stencil)) return; // by what was done beside it
    const float square = stencil.normSqGrad();
    const float missing = (square < SQUARE_LOW ? SQUARE_LOW + SQUARE_INSET : SQUARE_HIGH - SQUARE_INSET) - square;
    float slope[STENCIL_SIZE], sum = 0;
    for (int n = 0; n < STENCIL_SIZE; n++) {
        const Coord c = stencil_place(at, n);
        const bool next = n == 0 || (n - 1) % 6 / 2 == 1, free = acc.isValueOn(c) && (next || round >= WIDE_FROM);
        slope[n] = free ? derivative(acc, stencil, at, c, round % PLAIN_EVERY == 0, l.voxel) : 0;
        sum += slope[n] * slope[n];
    }
    for (int n = 0; n < STENCIL_SIZE; n++) {
        if (!(slope[n] * slope[n] > SHARE_LEAST * sum)) continue;
        const Coord c = stencil_place(at, n);
        const float v = acc.getValue(c), first = original.emplace(c, v).first->second;
        const float step = std::min(std::max(RELAXATION * missing * slope[n] / sum, -STEP_MOST), STEP_MOST) * l.voxel;
        const float least = std::min(std::fabs(first), SIZE_LEAST * l.voxel);
        const float size = std::min(std::max(first < 0 ? -v - step : v + step, least), l.most);
        acc.setValueOnly(c, as_stored(first < 0 ? -size : size, l.half));
    }
}

// mends creases until checkLevelSet has nothing to object to (it is asked by the caller, this may end without success)
void mend_creases(Grid &grid, bool half, sdm_vdb_report &report)
{
    originals original;
    Grid::Accessor acc = grid.getAccessor();
    Stencil stencil(grid);
    const sweep_limits limits = {static_cast<float>(grid.voxelSize()[0]),
                                 std::nextafter(as_stored(grid.background() * 0.999f, half), 0.0f), half};
    std::vector<Coord> found = find_creases(grid);
    for (int round = 1; round <= ROUNDS_MOST && !found.empty(); round++) {
        for (const Coord &c : found) project(acc, stencil, c, round, limits, original);
        found = find_creases_near(grid, found);
    }
    for (const auto &[c, v] : original) {
        const double change = std::fabs(static_cast<double>(acc.getValue(c)) - static_cast<double>(v));
        if (change > 0) report.adjusted_voxels++;
        report.adjusted_mm = std::max(report.adjusted_mm, change);
    }
}

// ---- hash

// coordinates, extents and bits of all values in the order of the tree, tiles included
uint64_t hash_of(const Grid &grid)
{
    struct record {
        int32_t low[3], high[3];
        uint32_t bits, active;
    };
    std::vector<record> piece;
    uint64_t crc = 0;
    const auto add = [&](const openvdb::CoordBBox &b, float value, bool active) {
        record r = {{b.min()[0], b.min()[1], b.min()[2]}, {b.max()[0], b.max()[1], b.max()[2]}, 0, active};
        std::memcpy(&r.bits, &value, sizeof r.bits);
        piece.push_back(r);
        if (piece.size() < 4096) return;
        crc = sdm_crc64(crc, piece.data(), piece.size() * sizeof piece[0]);
        piece.clear();
    };
    add(openvdb::CoordBBox(Coord(0), Coord(0)), grid.background(), false);
    for (auto v = grid.cbeginValueAll(); v; ++v) add(v.getBoundingBox(), v.getValue(), v.isValueOn());
    return sdm_crc64(crc, piece.data(), piece.size() * sizeof piece[0]);
}

// ---- files

Grid::Ptr read_grid(const char *path, bool *sealed, sdm_error *err)
{
    need(sdm_seal_check(path, sealed, err));
    openvdb::io::File file(path);
    file.open(false); // whole, not mapped: what was checked is what is used
    if (!file.hasGrid(GRID_NAME)) need(sdm_fail(err, SDM_E_FORMAT, "%s: has no grid named \"%s\"", path, GRID_NAME));
    Grid::Ptr grid = openvdb::gridPtrCast<Grid>(file.readGrid(GRID_NAME));
    if (!grid) need(sdm_fail(err, SDM_E_FORMAT, "%s: grid \"%s\" does not hold 32-bit floats", path, GRID_NAME));
    return grid;
}

std::string text_of(const Grid &grid, const char *name)
{
    const auto meta = grid.getMetadata<openvdb::StringMetadata>(name);
    return meta ? meta->value() : std::string();
}

void check_hash(const Grid &grid, const char *path, sdm_error *err)
{
    char hash[32];
    std::snprintf(hash, sizeof hash, "%016" PRIx64, hash_of(grid));
    const std::string stored = text_of(grid, "sdm_hash");
    if (!stored.empty() && stored != hash)
        need(sdm_fail(err, SDM_E_FORMAT, "%s: damaged: hash of the values is %s, stored is %s", path, hash,
                      stored.c_str()));
}

void check_level_set(const Grid &grid, const char *path, sdm_status status, sdm_error *err)
{
    std::string said = openvdb::tools::checkLevelSet(grid);
    for (char &c : said)
        if (c == '\n') c = ' ';
    if (!said.empty())
        need(sdm_fail(err, status,
                      "%s: not a valid level set: %s(parts thinner than a voxel? use smaller voxels, or --dense)", path,
                      said.c_str()));
}

// writes, reads back and compares before the file gets its name
void write_file(const char *path, const Grid::Ptr &grid, sdm_error *err)
{
    struct output {
        sdm_outfile *file = nullptr;
        ~output() { sdm_outfile_discard(&file); }
    } out;
    need(sdm_outfile_open(path, &out.file, err));
    const std::string temp = sdm_outfile_temp_path(out.file);
    {
        openvdb::io::File file(temp);
        file.write(openvdb::GridCPtrVec{grid});
    }
    need(sdm_seal_append(temp.c_str(), err));
    bool sealed = false;
    const Grid::Ptr back = read_grid(temp.c_str(), &sealed, err);
    if (!sealed || hash_of(*back) != hash_of(*grid))
        need(sdm_fail(err, SDM_E_IO, "%s: reads back different from what was written", path));
    if (grid->getGridClass() == openvdb::GRID_LEVEL_SET) check_level_set(*back, path, SDM_E_QUALITY, err);
    need(sdm_outfile_commit(&out.file, err));
}

struct owned_band {
    sdm_band band = {};
    ~owned_band() { sdm_band_dispose(&band); }
};

void check_options(const sdm_grid &g, const sdm_vdb_opts &o, sdm_error *err)
{
    if (o.band_voxels != 0 && !(o.band_voxels >= 3 && o.band_voxels <= 100))
        need(sdm_fail(err, SDM_E_ARG, "band of %g voxels, need 3 to 100", o.band_voxels));
    if (o.n_metadata && !o.metadata) need(sdm_fail(err, SDM_E_ARG, "%zu metadata entries at NULL", o.n_metadata));
    const double h = g.spacing[0];
    if (!o.dense && !(std::fabs(g.spacing[1] - h) <= 1e-6 * h && std::fabs(g.spacing[2] - h) <= 1e-6 * h))
        need(
            sdm_fail(err, SDM_E_ARG,
                     "spacing %g x %g x %g mm: a level set needs voxels of one size; write the map itself with --dense",
                     g.spacing[0], g.spacing[1], g.spacing[2]));
}

// the half format ends at 65504
void check_half(const sdm_band &box, sdm_error *err)
{
    const size_t count = static_cast<size_t>(box.n[0] * box.n[1] * box.n[2]);
    for (size_t i = 0; i < count; i++)
        if (!(std::fabs(box.values[i]) <= 65504.0f))
            need(sdm_fail(err, SDM_E_ARG, "value %g mm does not fit into 16 bits, need at most 65504",
                          static_cast<double>(box.values[i])));
}

Grid::Ptr make_level_set(const sdm_grid &g, const float *values, const sdm_vdb_opts &o, sdm_vdb_report &report,
                         sdm_error *err)
{
    const float background = background_value(o.band_voxels != 0 ? o.band_voxels : 3.0, g.spacing[0], o.half);
    if (!std::isfinite(background))
        need(sdm_fail(err, SDM_E_ARG, "spacing %g mm is too large for the number format", g.spacing[0]));
    owned_band box;
    need(sdm_band_close(&g, values, background, &o, &box.band, err));
    report.cut = box.band.cut;
    Grid::Ptr grid = grid_of(g, box.band, background, false, o.half);
    mend_creases(*grid, o.half, report);
    return grid;
}

Grid::Ptr make_dense(const sdm_grid &g, const float *values, const sdm_vdb_opts &o, sdm_vdb_report &report,
                     sdm_error *err)
{
    owned_band box;
    need(sdm_band_copy(&g, values, &box.band, err));
    if (o.half) check_half(box.band, err);
    const size_t count = sdm_grid_count(&g);
    const float background = as_stored(*std::max_element(values, values + count), o.half);
    for (size_t i = 0; i < count && !report.cut; i++) {
        const int64_t at[3] = {static_cast<int64_t>(i) % g.n[0], static_cast<int64_t>(i) / g.n[0] % g.n[1],
                               static_cast<int64_t>(i) / g.n[0] / g.n[1]};
        for (int a = 0; a < 3; a++) report.cut = report.cut || (values[i] < 0 && (at[a] == 0 || at[a] == g.n[a] - 1));
    }
    return grid_of(g, box.band, background, true, o.half);
}

// ---- description

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
    std::string t =
        "grid          " + grid.getName() + "\nclass         " + (level_set ? "level set" : "not set (whole map)");
    t += "\nvoxel size    " + numbers(grid.voxelSize()) + " mm\norigin        " + numbers(grid.indexToWorld(Coord(0))) +
         " mm";
    t += "\nactive voxels " + std::to_string(grid.activeVoxelCount()) + "\nactive box    " + numbers(box.min()) +
         " to " + numbers(box.max());
    t += std::string("\nbackground    ") + sdm_format_real(static_cast<double>(grid.background()), number) + " mm";
    t += std::string("\nnumbers       ") + (grid.saveFloatAsHalf() ? "16-bit" : "32-bit") + " floats";
    t += std::string("\nchecksum      ") + (sealed ? "right" : "none in the file") +
         (text_of(grid, "sdm_hash").empty() ? "" : ", hash right");
    t += level_set ? "\ncheckLevelSet passed\n" : "\ncheckLevelSet not asked\n";
    for (auto m = grid.beginMeta(); m != grid.endMeta(); ++m)
        if (m->second->typeName() == "string" && !starts_with(m->first, "file_") && m->first != "name" &&
            m->first != "class")
            t += m->first + ": " + m->second->str() + "\n";
    return t;
}

} // namespace

sdm_status sdm_vdb_write(const char *path, const sdm_grid *grid, const float *values, const sdm_vdb_opts *opts,
                         sdm_vdb_report *report, sdm_error *err)
{
    if (!path || !*path || !grid || !values)
        return sdm_fail(err, SDM_E_ARG, "level set: path, grid and values are needed");
    const sdm_status s = sdm_grid_check(grid, err);
    if (s) return s;
    return guarded(path, SDM_E_IO, err, [&] {
        const sdm_vdb_opts o = opts ? *opts : sdm_vdb_opts();
        sdm_vdb_report r = {};
        check_options(*grid, o, err);
        Grid::Ptr g = o.dense ? make_dense(*grid, values, o, r, err) : make_level_set(*grid, values, o, r, err);
        if (!o.dense) check_level_set(*g, path, SDM_E_QUALITY, err);
        r.active_voxels = static_cast<int64_t>(g->activeVoxelCount());
        r.hash = hash_of(*g);
        add_metadata(*g, o, r, err);
        write_file(path, g, err);
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
        if (grid->getGridClass() == openvdb::GRID_LEVEL_SET) check_level_set(*grid, path, SDM_E_FORMAT, err);
        if (!text) return;
        const std::string t = describe(*grid, sealed);
        void *block = nullptr;
        need(sdm_alloc(&block, t.size() + 1, 1, "description", err));
        std::memcpy(block, t.c_str(), t.size() + 1);
        *text = static_cast<char *>(block);
    });
}

sdm_status sdm_vdb_sample(const char *path, const int32_t *index, size_t n, float *values, sdm_error *err)
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
