// Writes MagicaVoxel's .vox, version 150: chunks of id, content bytes, children bytes. A scene
// graph places models of at most 256 cells a side. The file has one palette of 255 colours: the
// request's in its order, or one chosen from the grid's colours.
//
//   VOX 150 MAIN { (SIZE XYZI)*  nTRN 0 -> nGRP 1 -> (nTRN -> nSHP)*  RGBA }
//
// In the file z points up: cell (x, y, z) of the grid becomes (x, -z, y), which keeps handedness.
// If a grid has labels or materials and no colour, each id has a colour (id_color()). Voxels
// without colour or id (those of full nodes, and all of a grid without either) get the mean colour
// of the others, or a neutral grey. The root node's attributes hold dims, origin and voxel_size.
#include <array>
#include <string>

#include "server/formats/formats.h"
#include "server/formats/output_file.h"
#include "server/formats/vox_parts.h"

namespace voxeld {
namespace {

constexpr int kSceneSideMax = 2000;  // the editor's world is 2000 x 2000 x 1000
constexpr int kSceneHeightMax = 1000;
constexpr uint32_t kVoxVersion = 150;

// Writes the root transform, the group, and a transform and a shape per model; node ids follow file
// order.
void add_scene_graph(vox::Bytes& out, const vox::Models& models, const Grid& grid) {
  vox::add_root(out, grid, models.size());
  int index = 0;
  for (const auto& [place, voxels] : models) {
    vox::add_transform(out, 2 + 2 * index, place, vox::scene_size(grid.spec));
    vox::Bytes shape;
    shape.i32(3 + 2 * index);
    shape.dict({});
    shape.u32(1);
    shape.i32(index);
    shape.dict({});
    out.chunk("nSHP", shape);
    ++index;
  }
}

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
  if (models.empty()) models[{0, 0, 0}] = {};
  vox::Bytes children;
  for (const auto& [place, voxels] : models) {
    vox::add_model(children, place, voxels, vox::scene_size(grid.spec));
  }
  add_scene_graph(children, models, grid);
  vox::add_palette(children, palette);
  VOXELD_TRY(vox::check_length(children.size()));

  vox::Bytes out;
  vox::add_file_header(out, kVoxVersion, static_cast<uint32_t>(children.size()));
  out.raw(children.bytes());
  return file.append(out.bytes());
}

}  // namespace voxeld
