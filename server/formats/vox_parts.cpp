#include "server/formats/vox_parts.h"

#include <algorithm>
#include <utility>

#include "proto/options/values.h"
#include "server/base/cancel_point.h"

namespace voxeld::vox {
namespace {

uint32_t key_of(const uint8_t* color) {
  return color[0] | uint32_t{color[1]} << 8 | uint32_t{color[2]} << 16;
}

std::array<int, 3> model_size(const Place& model, const std::array<int, 3>& scene) {
  std::array<int, 3> size{};
  for (size_t c = 0; c < 3; ++c) size[c] = std::min(kModelSide, scene[c] - model[c] * kModelSide);
  return size;
}

void add_transform_node(Bytes& out, int node, int child, const Dict& node_attributes,
                        const Dict& frame) {
  Bytes content;
  content.i32(node);
  content.dict(node_attributes);
  content.i32(child);
  content.i32(-1);  // reserved
  content.i32(-1);  // layer
  content.i32(1);   // frames
  content.dict(frame);
  out.chunk("nTRN", content);
}

}  // namespace

Colors::Colors(const Grid& grid)
    : has_color_(grid.channels.color),
      ids_(coloring_ids(grid)),
      other_(key_of(mean_color(grid).data())) {}

uint32_t Colors::of(const SparseTile& tile, size_t voxel) const {
  if (voxel == kNoAttributes) return other_;
  if (has_color_) return key_of(&tile.color[4 * voxel]);
  return ids_ ? key_of(id_color(id_samples(tile, *ids_)[voxel]).data()) : other_;
}

void count_colors(const Grid& grid, const Colors& colors, ColorCounts& counts) {
  for (const SparseTile& tile : grid.tiles) {
    cancel_point();
    const size_t voxels = tile.attribute_count();
    for (size_t voxel = 0; voxel < voxels; ++voxel) ++counts[colors.of(tile, voxel)];
    const uint64_t others = tile.voxel_count() - voxels;
    if (others > 0) counts[colors.other()] += others;
  }
}

Palette palette_of(ColorCounts counts, const Colors& colors, const OutputOptions& options) {
  if (!options.palette.empty()) return {options.palette, {}};
  if (counts.empty()) counts[colors.other()] = 1;
  return make_palette(counts, options.palette_max);
}

std::array<int, 3> scene_size(const GridSpec& spec) {
  return {spec.dims.x, spec.dims.z, spec.dims.y};
}

VoxelEntries entries_of(const Grid& grid, const Colors& colors, const Palette& palette,
                        Dither dither) {
  if (dither != Dither::kNone || palette.index_of.empty()) {
    return choose_entries(grid, palette.colors, dither, [&](const SparseTile& tile, size_t voxel) {
      return colors.of(tile, voxel);
    });
  }
  VoxelEntries entries;
  entries.tiles.resize(grid.tiles.size());
  for (size_t i = 0; i < grid.tiles.size(); ++i) {
    cancel_point();
    const SparseTile& tile = grid.tiles[i];
    entries.tiles[i].resize(tile.attribute_count());
    for (size_t voxel = 0; voxel < entries.tiles[i].size(); ++voxel) {
      entries.tiles[i][voxel] = palette.index_of.at(colors.of(tile, voxel));
    }
  }
  const auto other = palette.index_of.find(colors.other());
  if (other != palette.index_of.end()) entries.other = other->second;
  return entries;
}

Models models_of(const Grid& grid, const VoxelEntries& entries) {
  Models models;
  Place last_model = {-1, -1, -1};
  std::vector<Voxel>* last = nullptr;  // of last_model; a map's elements do not move
  const auto add = [&](int x, int y, int z, uint8_t entry) {
    const std::array<int, 3> p = {x, grid.spec.dims.z - 1 - z, y};
    const Place model = {p[0] / kModelSide, p[1] / kModelSide, p[2] / kModelSide};
    if (model != last_model) last = &models[last_model = model];
    last->push_back({static_cast<uint8_t>(p[0] % kModelSide),
                     static_cast<uint8_t>(p[1] % kModelSide),
                     static_cast<uint8_t>(p[2] % kModelSide), static_cast<uint8_t>(entry + 1)});
  };
  for (size_t i = 0; i < grid.tiles.size(); ++i) {
    cancel_point();
    for_each_voxel(grid.tiles[i],
                   [&](int x, int y, int z, size_t voxel) { add(x, y, z, entries.of(i, voxel)); });
  }
  return models;
}

void add_file_header(Bytes& out, uint32_t version, uint32_t children_bytes) {
  out.raw(std::array<uint8_t, 4>{'V', 'O', 'X', ' '});
  out.u32(version);
  out.raw(std::array<uint8_t, 4>{'M', 'A', 'I', 'N'});
  out.u32(0);
  out.u32(children_bytes);
}

void add_model(Bytes& out, const Place& place, const std::vector<Voxel>& voxels,
               const std::array<int, 3>& scene) {
  Bytes size;
  for (const int side : model_size(place, scene)) size.i32(side);
  out.chunk("SIZE", size);
  Bytes cells;
  cells.u32(static_cast<uint32_t>(voxels.size()));
  for (const Voxel& v : voxels) {
    for (const uint8_t byte : {v.x, v.y, v.z, v.color}) cells.u8(byte);
  }
  out.chunk("XYZI", cells);
}

void add_root(Bytes& out, const Grid& grid, size_t models) {
  const GridHeader header = container_header(grid);
  add_transform_node(
      out, 0, 1,
      {{"dims", std::to_string(header.dims[0]) + "," + std::to_string(header.dims[1]) + "," +
                    std::to_string(header.dims[2])},
       {"origin", option_values::to_text(header.origin)},
       {"voxel_size", option_values::to_text(header.voxel_size)}},
      {});
  Bytes group;
  group.i32(1);
  group.dict({});
  group.u32(static_cast<uint32_t>(models));
  for (int i = 0; i < static_cast<int>(models); ++i) group.i32(2 + 2 * i);
  out.chunk("nGRP", group);
}

void add_transform(Bytes& out, int node, const Place& place, const std::array<int, 3>& scene) {
  const std::array<int, 3> size = model_size(place, scene);
  std::string text;
  for (size_t c = 0; c < 3; ++c) {
    // A model's pivot is its middle. The scene is centred and stands on the floor.
    const int centre = c == 2 ? 0 : scene[c] / 2;
    if (c != 0) text += ' ';
    text += std::to_string(place[c] * kModelSide + size[c] / 2 - centre);
  }
  add_transform_node(out, node, node + 1, {}, {{"_t", text}});
}

void add_palette(Bytes& out, const Palette& palette) {
  Bytes content;
  for (size_t i = 0; i < 256; ++i) {
    const Rgb color = i < palette.colors.size() ? palette.colors[i] : Rgb{};
    for (const uint8_t channel : color) content.u8(channel);
    content.u8(255);
  }
  out.chunk("RGBA", content);
}

Status check_length(uint64_t bytes) {
  if (bytes <= kChunkBytesMax) return {};
  return Error{ErrorCode::kGridTooLarge, "vox: too many voxels for the file's 32-bit lengths",
               "at most " + std::to_string(kChunkBytesMax) + " bytes", std::to_string(bytes)};
}

}  // namespace voxeld::vox
