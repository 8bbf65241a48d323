// MagicaVoxel's .vox, version 150: chunks of id, content bytes, children bytes. Models of at most
// 256 cells a side, placed by a scene graph; one palette of 255 colours for the file.
//
//   VOX 150 MAIN { (SIZE XYZI)*  nTRN 0 -> nGRP 1 -> (nTRN -> nSHP)*  RGBA }
//
// z points up there: a cell (x, y, z) of the grid is written at (x, -z, y), which keeps handedness.
// Where a grid has labels or materials and no colour, each id has a colour (id_color()). Voxels
// without colour or id (those of full nodes, and all of a grid without either) get the mean colour
// of the others, or a neutral grey. dims, origin and voxel_size stand in the attributes of
// the root node.
#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <optional>
#include <string>

#include "proto/option_values.h"
#include "server/formats/formats.h"
#include "server/formats/palette.h"

namespace voxeld {
namespace {

constexpr int kModelSide = 256;
constexpr int kSceneSideMax = 2000;  // the editor's world: 2000 x 2000 x 1000
constexpr int kSceneHeightMax = 1000;
constexpr size_t kChunkBytesMax = 0x7fffffff;  // readers take lengths as signed
constexpr uint32_t kVersion = 150;

class Bytes {
 public:
  void u32(uint32_t value) {
    for (int i = 0; i < 4; ++i) bytes_.push_back(static_cast<uint8_t>(value >> (8 * i)));
  }
  void i32(int32_t value) { u32(static_cast<uint32_t>(value)); }
  void u8(uint8_t value) { bytes_.push_back(value); }
  void text(std::string_view value) {
    u32(static_cast<uint32_t>(value.size()));
    bytes_.insert(bytes_.end(), value.begin(), value.end());
  }
  void dict(const std::map<std::string, std::string>& entries) {
    u32(static_cast<uint32_t>(entries.size()));
    for (const auto& [key, value] : entries) {
      text(key);
      text(value);
    }
  }
  void raw(std::span<const uint8_t> bytes) {
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
  }
  void chunk(std::string_view id, const Bytes& content) {
    bytes_.insert(bytes_.end(), id.begin(), id.end());
    u32(static_cast<uint32_t>(content.bytes_.size()));
    u32(0);
    raw(content.bytes_);
  }
  std::vector<uint8_t>& bytes() { return bytes_; }
  size_t size() const { return bytes_.size(); }

 private:
  std::vector<uint8_t> bytes_;
};

struct Voxel {
  uint8_t x, y, z, color;
};

// Cells of one model, by its place in the scene of models.
using Models = std::map<std::array<int, 3>, std::vector<Voxel>>;

uint32_t key_of(const uint8_t* color) {
  return color[0] | uint32_t{color[1]} << 8 | uint32_t{color[2]} << 16;
}

// Gives voxels their colours, as keys of the palette.
class Colors {
 public:
  explicit Colors(const Grid& grid)
      : has_color_(grid.channels.color),
        ids_(coloring_ids(grid)),
        other_(key_of(mean_color(grid).data())) {}

  // `voxel`: its number in the tile, or kNoAttributes.
  uint32_t of(const SparseTile& tile, size_t voxel) const {
    if (voxel == kNoAttributes) return other_;
    if (has_color_) return key_of(&tile.color[4 * voxel]);
    return ids_ ? key_of(id_color(voxel_id(tile, *ids_, voxel)).data()) : other_;
  }
  uint32_t other() const { return other_; }

 private:
  bool has_color_;
  std::optional<Channel> ids_;
  uint32_t other_;  // of voxels without
};

Palette palette_of(const Grid& grid, const Colors& colors, int colors_max) {
  ColorCounts counts;
  for (const SparseTile& tile : grid.tiles) {
    const size_t voxels = tile.attribute_count();
    for (size_t voxel = 0; voxel < voxels; ++voxel) ++counts[colors.of(tile, voxel)];
    const uint64_t others = tile.voxel_count() - voxels;
    if (others > 0) counts[colors.other()] += others;
  }
  if (counts.empty()) counts[colors.other()] = 1;
  return make_palette(counts, colors_max);
}

// Size of the scene with z up.
std::array<int, 3> scene_size(const GridSpec& spec) {
  return {spec.dims.x, spec.dims.z, spec.dims.y};
}

Models models_of(const Grid& grid, const Colors& colors, const Palette& palette) {
  Models models;
  std::array<int, 3> last_model = {-1, -1, -1};
  std::vector<Voxel>* last = nullptr;  // of last_model; a map's elements stay where they are
  const auto add = [&](int x, int y, int z, uint8_t entry) {
    const std::array<int, 3> p = {x, grid.spec.dims.z - 1 - z, y};
    const std::array<int, 3> model = {p[0] / kModelSide, p[1] / kModelSide, p[2] / kModelSide};
    if (model != last_model) last = &models[last_model = model];
    last->push_back({static_cast<uint8_t>(p[0] % kModelSide),
                     static_cast<uint8_t>(p[1] % kModelSide),
                     static_cast<uint8_t>(p[2] % kModelSide), static_cast<uint8_t>(entry + 1)});
  };
  for (const SparseTile& tile : grid.tiles) {
    for_each_voxel(tile, [&](int x, int y, int z, size_t voxel) {
      add(x, y, z, palette.index_of.at(colors.of(tile, voxel)));
    });
  }
  if (models.empty()) models[{0, 0, 0}] = {};
  return models;
}

std::array<int, 3> model_size(const std::array<int, 3>& model, const std::array<int, 3>& scene) {
  std::array<int, 3> size{};
  for (size_t c = 0; c < 3; ++c) size[c] = std::min(kModelSide, scene[c] - model[c] * kModelSide);
  return size;
}

void add_transform(Bytes& out, int node, int child,
                   const std::map<std::string, std::string>& node_attributes,
                   const std::map<std::string, std::string>& frame) {
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

// Root transform, group, and a transform and a shape per model; node ids in file order.
void add_scene_graph(Bytes& out, const Models& models, const Grid& grid) {
  const std::array<int, 3> scene = scene_size(grid.spec);
  const GridHeader header = container_header(grid);
  add_transform(out, 0, 1,
                {{"dims", std::to_string(header.dims[0]) + "," + std::to_string(header.dims[1]) +
                              "," + std::to_string(header.dims[2])},
                 {"origin", option_values::to_text(header.origin)},
                 {"voxel_size", option_values::to_text(header.voxel_size)}},
                {});
  Bytes group;
  group.i32(1);
  group.dict({});
  group.u32(static_cast<uint32_t>(models.size()));
  for (int i = 0; i < static_cast<int>(models.size()); ++i) group.i32(2 + 2 * i);
  out.chunk("nGRP", group);

  int index = 0;
  for (const auto& [model, voxels] : models) {
    const std::array<int, 3> size = model_size(model, scene);
    std::string place;
    for (size_t c = 0; c < 3; ++c) {
      // The pivot of a model is its middle; the scene is centred, standing on the floor.
      const int centre = c == 2 ? 0 : scene[c] / 2;
      place += (c == 0 ? "" : " ") + std::to_string(model[c] * kModelSide + size[c] / 2 - centre);
    }
    add_transform(out, 2 + 2 * index, 3 + 2 * index, {}, {{"_t", place}});
    Bytes shape;
    shape.i32(3 + 2 * index);
    shape.dict({});
    shape.u32(1);
    shape.i32(index);
    shape.dict({});
    out.chunk("nSHP", shape);
    ++index;
  }
}

void add_models(Bytes& out, const Models& models, const std::array<int, 3>& scene) {
  for (const auto& [model, voxels] : models) {
    Bytes size;
    for (const int side : model_size(model, scene)) size.i32(side);
    out.chunk("SIZE", size);
    Bytes cells;
    cells.u32(static_cast<uint32_t>(voxels.size()));
    for (const Voxel& v : voxels) {
      for (const uint8_t byte : {v.x, v.y, v.z, v.color}) cells.u8(byte);
    }
    out.chunk("XYZI", cells);
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

}  // namespace

std::vector<Warning> encode_warnings(const GridSpec& spec, const OutputOptions& options) {
  if (options.format != Format::kVox) return {};
  const std::array<int, 3> scene = scene_size(spec);
  if (scene[0] <= kSceneSideMax && scene[1] <= kSceneSideMax && scene[2] <= kSceneHeightMax) {
    return {};
  }
  return {{"outside-world", "vox: MagicaVoxel shows 2000 x 1000 (up) x 2000 cells of " +
                                std::to_string(spec.dims.x) + " x " + std::to_string(spec.dims.y) +
                                " x " + std::to_string(spec.dims.z)}};
}

Result<std::vector<uint8_t>> encode_vox(const Grid& grid, const OutputOptions& options) {
  const std::array<int, 3> scene = scene_size(grid.spec);
  VOXELD_TRY(check_length(sizeof(Voxel) * grid.voxel_count()));  // before any memory is taken
  const Colors colors(grid);
  const Palette palette = palette_of(grid, colors, options.palette_max);
  const Models models = models_of(grid, colors, palette);
  Bytes children;
  add_models(children, models, scene);
  add_scene_graph(children, models, grid);
  add_palette(children, palette);
  VOXELD_TRY(check_length(children.size()));

  Bytes out;
  out.raw(std::array<uint8_t, 4>{'V', 'O', 'X', ' '});
  out.u32(kVersion);
  out.raw(std::array<uint8_t, 4>{'M', 'A', 'I', 'N'});
  out.u32(0);
  out.u32(static_cast<uint32_t>(children.size()));
  out.raw(children.bytes());
  return std::move(out.bytes());
}

}  // namespace voxeld
