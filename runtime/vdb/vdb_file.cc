/* Files of level sets: hash, reading with check of the seal, writing with verification. */
#include <openvdb/io/File.h>
#include <openvdb/tools/Diagnostics.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <vector>

#include "sdm/internal/checksum.h"
#include "sdm/internal/file.h"
#include "seal.h"
#include "vdb_parts.h"

using namespace vdb_parts;

const char *const vdb_parts::GRID_NAME = "surface";

uint64_t vdb_parts::hash_of(const Grid &grid)
{
    struct record {
        int32_t low[3], high[3];
        uint32_t bits, active;
    };
    std::vector<record> piece;
    uint64_t crc = 0;
    const auto add = [&](const openvdb::CoordBBox &b, float value, bool active) {
        record r = {
            {b.min()[0], b.min()[1], b.min()[2]}, {b.max()[0], b.max()[1], b.max()[2]}, 0, active};
        std::memcpy(&r.bits, &value, sizeof r.bits);
        piece.push_back(r);
        if (piece.size() < 4096) return;
        crc = sdm_crc64(crc, piece.data(), piece.size() * sizeof piece[0]);
        piece.clear();
    };
    add(openvdb::CoordBBox(Coord(0), Coord(0)), grid.background(), false);
    for (auto v = grid.cbeginValueAll(); v; ++v)
        add(v.getBoundingBox(), v.getValue(), v.isValueOn());
    return sdm_crc64(crc, piece.data(), piece.size() * sizeof piece[0]);
}

Grid::Ptr vdb_parts::read_grid(const char *path, bool *sealed, sdm_error *err)
{
    need(sdm_seal_check(path, sealed, err));
    openvdb::io::File file(path);
    // read at once instead of memory-mapped: what is used is what was checked
    file.open(false);
    if (!file.hasGrid(GRID_NAME))
        need(sdm_fail(err, SDM_E_FORMAT, "%s: has no grid named \"%s\"", path, GRID_NAME));
    Grid::Ptr grid = openvdb::gridPtrCast<Grid>(file.readGrid(GRID_NAME));
    if (!grid)
        need(sdm_fail(err, SDM_E_FORMAT, "%s: grid \"%s\" does not hold 32-bit floats", path,
                      GRID_NAME));
    return grid;
}

std::string vdb_parts::text_of(const Grid &grid, const char *name)
{
    const auto meta = grid.getMetadata<openvdb::StringMetadata>(name);
    return meta ? meta->value() : std::string();
}

void vdb_parts::check_level_set(const Grid &grid, const char *path, sdm_status status,
                                sdm_error *err)
{
    std::string said = openvdb::tools::checkLevelSet(grid);
    for (char &c : said)
        if (c == '\n') c = ' ';
    if (!said.empty())
        need(sdm_fail(err, status,
                      "%s: not a valid level set: %s(parts thinner than a voxel? use smaller "
                      "voxels, or write the map itself: sdm_vdb_opts.dense)",
                      path, said.c_str()));
}

namespace
{

// an archive that writes to any stream, in the format of openvdb::io::File, which drops the errors
// of its own stream
class archive : public openvdb::io::Archive
{
  public:
    void write_to(std::ostream &to, const Grid::Ptr &grid) const
    {
        openvdb::io::Archive::write(to, openvdb::GridCPtrVec{grid}, true);
    }
};

// writes the grid to `temp`; the message of an error names `path` and the reason of the system
void write_archive(const char *path, const std::string &temp, const Grid::Ptr &grid, sdm_error *err)
{
    std::ofstream to;
    errno = 0;
    try {
        to.exceptions(std::ios::badbit | std::ios::failbit);
        to.open(temp, std::ios::binary | std::ios::trunc);
        archive().write_to(to, grid);
        to.close();
    } catch (const std::ios_base::failure &) {
        need(sdm_fail(err, SDM_E_IO, "%s: cannot write: %s", path,
                      errno ? std::strerror(errno) : "the disk reports no reason"));
    }
}

} // namespace

namespace
{

// Reads the level set back from `temp`, the file that will be renamed to `path`. Null: the file is
// damaged.
Grid::Ptr read_back(const char *path, const std::string &temp, sdm_error *err)
{
    bool sealed = false;
    Grid::Ptr back;
    errno = 0;
    try {
        back = read_grid(temp.c_str(), &sealed, err);
    } catch (const failure &e) {
        if (e.status != SDM_E_FORMAT) throw;
    }
    // the streams of OpenVDB swallow allocations that fail
    if (!back && errno == ENOMEM)
        need(sdm_fail(err, SDM_E_NOMEM, "%s: no memory for the level set", path));
    return sealed ? back : nullptr;
}

// whether the values, their places and the metadata of `grid` are those of `back`
bool is_same(const Grid &grid, const Grid &back)
{
    for (auto m = grid.beginMeta(); m != grid.endMeta(); ++m) {
        const auto other = back[m->first];
        if (!other || *other != *m->second) return false;
    }
    return hash_of(back) == hash_of(grid) && back.constTransform() == grid.constTransform();
}

} // namespace

void vdb_parts::write_grid(const char *path, const Grid::Ptr &grid, sdm_error *err)
{
    struct output {
        sdm_outfile *file = nullptr;
        ~output() { sdm_outfile_discard(&file); }
    } out;
    need(sdm_outfile_open(path, &out.file, err));
    const std::string temp = sdm_outfile_temp_path(out.file);
    write_archive(path, temp, grid, err);
    need(sdm_seal_append(temp.c_str(), err));
    const Grid::Ptr back = read_back(path, temp, err);
    if (!back || !is_same(*grid, *back))
        need(sdm_fail(err, SDM_E_IO, "%s: reads back different from what was written", path));
    if (grid->getGridClass() == openvdb::GRID_LEVEL_SET)
        check_level_set(*back, path, SDM_E_QUALITY, err);
    need(sdm_outfile_commit(&out.file, err));
}
