#include "server/formats/vox_parts.h"

#include <algorithm>
#include <utility>

#include "proto/options/values.h"
#include "server/base/pieces.h"
#include "server/formats/volume/volume_facts.h"

namespace voxeld::vox {
namespace {

uint32_t key_of(const uint8_t* color) {
  return color[0] | uint32_t{color[1]} << 8 | uint32_t{color[2]} << 16;
}

std::array<int, 3> model_size(const Part& part, const std::array<int, 3>& scene) {
  std::array<int, 3> size{};
  for (size_t c = 0; c < 3; ++c) {
    size[c] = std::min(kModelSide, scene[c] - part.place[c] * kModelSide);
  }
  return size;
}

// The translation of a model, whose pivot is its middle. The scene is centred and stands on the
// floor.
std::string translation_text(const Part& part, const std::array<int, 3>& scene) {
  const std::array<int, 3> size = model_size(part, scene);
  std::string text;
  for (size_t c = 0; c < 3; ++c) {
    const int centre = c == 2 ? 0 : scene[c] / 2;
    if (c != 0) text += ' ';
    text += std::to_string(part.place[c] * kModelSide + size[c] / 2 - centre);
  }
  return text;
}

Dict placement_of(const Grid& grid) {
  const GridHeader header = container_header(grid);
  Dict placement = {{"dims", std::to_string(header.dims[0]) + "," + std::to_string(header.dims[1]) +
                                 "," + std::to_string(header.dims[2])},
                    {"origin", option_values::to_text(header.origin)},
                    {"voxel_size", option_values::to_text(header.voxel_size)}};
  if (std::string units = volume::units_of(grid); !units.empty()) {
    placement["units"] = std::move(units);
  }
  return placement;
}

void add_transform(Bytes& out, int node, int child, const Dict& node_attributes,
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

void add_group(Bytes& out, int node, const std::vector<int>& children) {
  Bytes content;
  content.i32(node);
  content.dict({});
  content.u32(static_cast<uint32_t>(children.size()));
  for (const int child : children) content.i32(child);
  out.chunk("nGRP", content);
}

}  // namespace

Colors::Colors(const Grid& grid)
    : has_color_(grid.channels.color),
      ids_(coloring_ids(grid)),
      other_(key_of(mean_color(grid).data())) {}

uint32_t Colors::of(const SparseTile& tile, size_t voxel) const {
  if (voxel == kNoAttributes) return other_;
  if (has_color_) return has_own_color(tile, voxel) ? key_of(&tile.color[4 * voxel]) : other_;
  return ids_ ? key_of(id_color(id_samples(tile, *ids_)[voxel]).data()) : other_;
}

void count_colors(const Grid& grid, const Colors& colors, ColorCounts& counts) {
  for (const SparseTile& tile : grid.tiles) {
    cancel_point();
    const size_t voxels = tile.attribute_count();
    for (size_t voxel = 0; voxel < voxels; ++voxel) {
      cancel_point_at(voxel);
      ++counts[colors.of(tile, voxel)];
    }
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
      const bool is_inner =
          grid.channels.color && voxel != kNoAttributes && !has_own_color(tile, voxel);
      return is_inner ? kNoColorKey : colors.of(tile, voxel);
    });
  }
  VoxelEntries entries;
  entries.tiles.resize(grid.tiles.size());
  for (size_t i = 0; i < grid.tiles.size(); ++i) {
    cancel_point();
    const SparseTile& tile = grid.tiles[i];
    entries.tiles[i].resize(tile.attribute_count());
    for (size_t voxel = 0; voxel < entries.tiles[i].size(); ++voxel) {
      cancel_point_at(voxel);
      entries.tiles[i][voxel] = palette.index_of.at(colors.of(tile, voxel));
    }
  }
  const auto other = palette.index_of.find(colors.other());
  if (other != palette.index_of.end()) entries.other = other->second;
  return entries;
}

Models models_of(const Grid& grid, const VoxelEntries& entries) {
  Models models;
  std::optional<Part> last_part;
  std::vector<Voxel>* last = nullptr;  // of last_part; a map's elements do not move
  const auto add = [&](int x, int y, int z, uint16_t label, uint8_t entry) {
    cancel_point();
    const std::array<int, 3> p = {x, grid.spec.dims.z - 1 - z, y};
    const Part part{label, {p[0] / kModelSide, p[1] / kModelSide, p[2] / kModelSide}};
    if (part != last_part) last = &models[*(last_part = part)];
    last->push_back({static_cast<uint8_t>(p[0] % kModelSide),
                     static_cast<uint8_t>(p[1] % kModelSide),
                     static_cast<uint8_t>(p[2] % kModelSide), static_cast<uint8_t>(entry + 1)});
  };
  for (size_t i = 0; i < grid.tiles.size(); ++i) {
    cancel_point();
    const std::vector<uint16_t>& labels = grid.tiles[i].label;
    for_each_voxel(grid.tiles[i], [&](int x, int y, int z, size_t voxel) {
      add(x, y, z, voxel < labels.size() ? labels[voxel] : uint16_t{0}, entries.of(i, voxel));
    });
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

void add_model(Bytes& out, const Part& part, const std::vector<Voxel>& voxels,
               const std::array<int, 3>& scene) {
  Bytes size;
  for (const int side : model_size(part, scene)) size.i32(side);
  out.chunk("SIZE", size);
  Bytes cells;
  cells.u32(static_cast<uint32_t>(voxels.size()));
  for (const Voxel& v : voxels) {
    cancel_point();
    for (const uint8_t byte : {v.x, v.y, v.z, v.color}) cells.u8(byte);
  }
  out.chunk("XYZI", cells);
}

void add_scene(Bytes& out, const Grid& grid, std::span<const Part> parts,
               const std::function<void(Bytes& shape, size_t part)>& add_shape) {
  const std::array<int, 3> scene = scene_size(grid.spec);
  const bool has_labels = grid.channels.label;
  constexpr int kFirst = 2;
  // A transform and a group or shape for each label and part.
  const auto group_nodes = [&](size_t begin, size_t end, int first) {
    std::vector<int> nodes;
    for (size_t i = begin; i < end; ++i) nodes.push_back(first + 2 * static_cast<int>(i - begin));
    return nodes;
  };
  const auto end_of_label = [&](size_t begin) {
    size_t end = begin;
    while (end < parts.size() && (!has_labels || parts[end].label == parts[begin].label)) ++end;
    return end;
  };
  const auto add_parts = [&](size_t begin, size_t end, int node) {
    for (size_t i = begin; i < end; ++i, node += 2) {
      add_transform(out, node, node + 1, {}, {{"_t", translation_text(parts[i], scene)}});
      Bytes shape;
      shape.i32(node + 1);
      add_shape(shape, i);
      out.chunk("nSHP", shape);
    }
  };
  add_transform(out, 0, 1, placement_of(grid), {});
  if (!has_labels) {
    add_group(out, 1, group_nodes(0, parts.size(), kFirst));
    return add_parts(0, parts.size(), kFirst);
  }
  std::vector<int> groups;
  int node = kFirst;
  for (size_t i = 0; i < parts.size();) {
    const size_t end = end_of_label(i);
    groups.push_back(node);
    node += kFirst + 2 * static_cast<int>(end - i);
    i = end;
  }
  add_group(out, 1, groups);
  const std::vector<std::string> names = volume::names_of_ids(grid, Channel::kLabel);
  size_t begin = 0;
  for (const int group : groups) {
    const size_t end = end_of_label(begin);
    const uint16_t label = parts[begin].label;
    Dict attributes;
    if (label < names.size() && !names[label].empty()) attributes["_name"] = names[label];
    add_transform(out, group, group + 1, attributes, {});
    add_group(out, group + 1, group_nodes(begin, end, group + 2));
    add_parts(begin, end, group + 2);
    begin = end;
  }
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
