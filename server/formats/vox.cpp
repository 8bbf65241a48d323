// Writes MagicaVoxel's .vox, version 150: chunks of id, content bytes, children bytes. A scene
// graph places models of at most 256 cells a side. The file has one palette of 255 colours: the
// request's in its order, or one chosen from the grid's colours.
//
//   VOX 150 MAIN { (SIZE XYZI)*  nTRN 0 -> nGRP 1 -> (nTRN -> nSHP)*  RGBA }
//
// If the grid has labels, each has its own models, in a group with its name:
// nGRP 1 -> (nTRN -> nGRP -> (nTRN -> nSHP)*)*.
//
// In the file z points up: cell (x, y, z) of the grid becomes (x, -z, y), which keeps handedness.
// If a grid has labels or materials and no colour, each id has a colour (id_color()). Voxels
// without colour or id (inside of solids, and all of a grid without either) get the mean colour of
// the others, or a neutral grey. The root node's attributes hold dims, origin, voxel_size and, if
// they are known, units.
#include <array>
#include <string>
#include <vector>

#include "server/formats/formats.h"
#include "server/formats/output_file.h"
#include "server/formats/vox_parts.h"

namespace voxeld {
namespace {

constexpr int kSceneSideMax = 2000;  // the editor's world is 2000 x 2000 x 1000
constexpr int kSceneHeightMax = 1000;
constexpr uint32_t kVoxVersion = 150;

}  // namespace

std::vector<Warning> vox::scene_warnings(const GridSpec& spec) {
  const std::array<int, 3> scene = scene_size(spec);
  if (scene[0] <= kSceneSideMax && scene[1] <= kSceneSideMax && scene[2] <= kSceneHeightMax) {
    return {};
  }
  return {{"outside-world", "vox: MagicaVoxel shows 2000 x 1000 (up) x 2000 cells of " +
                                std::to_string(spec.dims.x) + " x " + std::to_string(spec.dims.y) +
                                " x " + std::to_string(spec.dims.z)}};
}

Status encode_vox(const Grid& grid, const OutputOptions& options, OutputFile& file) {
  // Checked before memory is allocated.
  VOXELD_TRY(vox::check_length(sizeof(vox::Voxel) * grid.voxel_count()));
  const vox::Colors colors(grid);
  ColorCounts counts;
  if (options.palette.empty()) vox::count_colors(grid, colors, counts);
  const Palette palette = vox::palette_of(std::move(counts), colors, options);
  vox::Models models = vox::models_of(grid, vox::entries_of(grid, colors, palette, options.dither));
  if (models.empty()) models[{}] = {};
  vox::Bytes children;
  std::vector<vox::Part> parts;
  for (const auto& [part, voxels] : models) {
    vox::add_model(children, part, voxels, vox::scene_size(grid.spec));
    parts.push_back(part);
  }
  vox::add_scene(children, grid, parts, [](vox::Bytes& shape, size_t part) {
    shape.dict({});
    shape.u32(1);
    shape.u32(static_cast<uint32_t>(part));
    shape.dict({});
  });
  vox::add_palette(children, palette);
  VOXELD_TRY(vox::check_length(children.size()));

  vox::Bytes out;
  vox::add_file_header(out, kVoxVersion, static_cast<uint32_t>(children.size()));
  out.raw(children.bytes());
  return file.append(out.bytes());
}

}  // namespace voxeld
