// Reads the chunks of MagicaVoxel's .vox, versions 150 and 200. Specification:
// https://github.com/ephtracy/voxel-model/blob/master/MagicaVoxel-file-format-vox.txt and
// MagicaVoxel-file-format-vox-extension.txt beside it.
//
//   file    "VOX ", i32 version, chunk MAIN whose children are all others
//   chunk   4 bytes id, i32 bytes of content, i32 bytes of children, content, children
//   SIZE    i32[3] cells in x, y, z of the model whose XYZI follows; z is up
//   XYZI    i32 count, count times u8[4]: x, y, z, number of the colour (0: empty)
//   RGBA    256 times u8[4]: the colours 1 to 255; the last entry is not used. Without this chunk
//           a default palette applies
//   nTRN    i32 id, DICT attributes, i32 child, i32 reserved, i32 layer, i32 frames, a DICT each:
//           _t "x y z": translation in cells; _r "n": rotation, see vox_rotation()
//   nGRP    i32 id, DICT attributes, i32 count, i32[count] children
//   nSHP    i32 id, DICT attributes, i32 count, (i32 model, DICT)[count]: models by frame
//   LAYR    i32 id, DICT attributes, i32 reserved
//   DICT    i32 count, (STRING key, STRING value)[count];  STRING: i32 bytes, bytes
//
// A node or a layer whose attribute _hidden is "1" is not shown. Other chunks are skipped: PACK,
// as models are counted; MATL and MATT, materials; IMAP, which orders colours in the editor alone;
// rOBJ, rCAM, NOTE, META. Bytes of a chunk after what is listed here are skipped, too.
//
// Alpha is that of the chunk RGBA, and 255 where the chunk has 0: many programs write 0 for colours
// that are opaque, and none has a voxel that cannot be seen.
#include "server/volumes/vox_chunks.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <string>
#include <utility>

#include "proto/limits.h"
#include "proto/options/values.h"
#include "proto/palette.h"
#include "proto/text/hex.h"
#include "proto/text/number_text.h"
#include "server/base/cancel_point.h"
#include "server/base/pieces.h"
#include "server/volumes/volume_error.h"

namespace voxeld::volumes {
namespace {

constexpr size_t kVoxPaletteBytes = size_t{256} * 4;
// The largest magnitude of an origin and of a voxel's side, as of the coordinates of meshes.
constexpr double kVoxWorldAbsMax = 1e30;

std::string shown_vox_text(std::string_view text) {
  constexpr size_t kShownBytes = 40;
  std::string out = "\"";
  for (const char c : text.substr(0, kShownBytes)) {
    if (c >= 0x20 && c < 0x7f) {
      out += c;
    } else {
      out += "\\x";
      append_hex(out, static_cast<uint8_t>(c));
    }
  }
  return out + (text.size() > kShownBytes ? "…\"" : "\"");
}

// Reads the fields of a range of bytes of the file. After the first failure all further fields are
// 0 or empty; status() has the error.
class VoxCursor {
 public:
  VoxCursor(std::string_view name, std::span<const uint8_t> file, size_t begin, size_t end,
            std::string_view chunk)
      : name_(name), file_(file), at_(begin), end_(end), chunk_(chunk) {}

  size_t at() const { return at_; }
  size_t left() const { return end_ - at_; }
  bool ok() const { return status_.ok(); }
  Status status() const { return status_; }

  int32_t i32() {
    int32_t value = 0;
    const auto bytes = take(sizeof value, "cut off");
    if (!bytes.empty()) std::memcpy(&value, bytes.data(), sizeof value);
    return value;
  }
  std::string_view text() {
    const auto size = static_cast<uint32_t>(i32());
    const auto bytes = take(size, "a text is cut off");
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }
  // A number of items that have at least `item_bytes` each.
  uint32_t count(size_t item_bytes, std::string_view items) {
    const size_t place = at_;
    const auto value = static_cast<uint32_t>(i32());
    if (value <= left() / item_bytes) return value;
    fail(place, "more " + std::string(items) + " than the chunk can hold",
         "at most " + std::to_string(left() / item_bytes), std::to_string(value));
    return 0;
  }
  std::span<const uint8_t> take(size_t size, std::string_view what) {
    if (size > left()) {
      fail(at_, what, std::to_string(size) + " bytes", std::to_string(left()));
    }
    if (!ok()) return {};
    at_ += size;
    return file_.subspan(at_ - size, size);
  }
  // Calls visit(key, value) for each pair.
  template <typename Visit>
  void dict(Visit&& visit) {
    const uint32_t pairs = count(2 * sizeof(int32_t), "pairs");
    for (uint32_t i = 0; i < pairs && ok(); ++i) {
      cancel_point();
      const std::string_view key = text();
      const std::string_view value = text();
      if (ok()) visit(key, value);
    }
  }
  void fail(size_t place, std::string_view what, std::string expected, std::string got) {
    if (!ok()) return;
    std::string where = "byte " + std::to_string(place);
    if (!chunk_.empty()) where.append(", chunk ").append(chunk_);
    status_ = malformed_volume(name_, where, what, std::move(expected), std::move(got));
  }

 private:
  std::string_view name_;
  std::span<const uint8_t> file_;
  size_t at_, end_;
  std::string_view chunk_;
  Status status_;
};

// The rotation of a number's bits: 0-1 the column of the entry that is not zero in row 0, 2-3 that
// in row 1, 4-6 the signs of rows 0 to 2, set for -1. False: no rotation.
bool vox_rotation(std::string_view text, VoxTransform& transform) {
  const auto bits = parse_number<int>(text, 0, 127);
  if (!bits) return false;
  const int first = *bits & 3, second = *bits >> 2 & 3;
  if (first > 2 || second > 2 || first == second) return false;
  transform.axis = {static_cast<uint8_t>(first), static_cast<uint8_t>(second),
                    static_cast<uint8_t>(3 - first - second)};
  for (size_t c = 0; c < 3; ++c) transform.sign[c] = (*bits >> (4 + c) & 1) != 0 ? -1 : 1;
  return true;
}

// Three integers that blanks separate.
bool vox_translation(std::string_view text, VoxTransform& transform) {
  for (size_t c = 0; c < 3; ++c) {
    text.remove_prefix(std::min(text.find_first_not_of(' '), text.size()));
    const size_t end = std::min(text.find(' '), text.size());
    const auto value = parse_number<int32_t>(text.substr(0, end));
    if (!value) return false;
    transform.offset[c] = *value;
    text.remove_prefix(end);
  }
  return text.find_first_not_of(' ') == std::string_view::npos;
}

// Collects the attributes of the root that voxeld writes.
class VoxPlacementReader {
 public:
  void read(std::string_view key, std::string_view value) {
    if (key == "dims") dims_ = numbers(value);
    if (key == "origin") origin_ = numbers(value);
    if (key == "voxel_size") voxel_size_ = numbers(value);
  }
  // Nothing unless all are there and are what a grid can have.
  std::optional<VoxPlacement> placement() const {
    if (!dims_ || !origin_ || !voxel_size_) return std::nullopt;
    VoxPlacement placement{{}, *origin_, *voxel_size_};
    for (size_t c = 0; c < 3; ++c) {
      const double side = (*dims_)[c];
      if (!(side >= 1 && side <= limits::kGridSideMax && side == std::floor(side))) return {};
      placement.dims[c] = static_cast<int32_t>(side);
      if (std::abs(placement.origin[c]) > kVoxWorldAbsMax) return std::nullopt;
      if (!(placement.voxel_size[c] > 0 && placement.voxel_size[c] <= kVoxWorldAbsMax)) return {};
    }
    return placement;
  }

 private:
  using Numbers = std::optional<std::array<double, 3>>;
  static Numbers numbers(std::string_view text) {
    auto values = option_values::numbers<3>("", text);
    return values ? Numbers(*values) : std::nullopt;
  }
  Numbers dims_, origin_, voxel_size_;
};

class VoxChunks {
 public:
  VoxChunks(std::string_view name, std::span<const uint8_t> bytes) : name_(name), bytes_(bytes) {}

  Result<VoxFile> read() {
    set_default_colors();
    VoxCursor head(name_, bytes_, 0, bytes_.size(), {});
    const auto magic = head.take(4, "the header is cut off");
    const int32_t version = head.i32();
    VOXELD_TRY(head.status());
    if (std::memcmp(magic.data(), "VOX ", 4) != 0) {
      return malformed_volume(name_, "byte 0", "not a MagicaVoxel file", "\"VOX \"",
                              shown_vox_text({reinterpret_cast<const char*>(magic.data()), 4}));
    }
    if (version != 150 && version != 200) {
      return unsupported_volume(name_, "byte 4", "a version that is not read", "150 or 200",
                                std::to_string(version));
    }
    VOXELD_TRY(read_main(head));
    VOXELD_TRY(sort_nodes());
    cancellable_sort(file_.hidden_layers.begin(), file_.hidden_layers.end(), std::less<>());
    if (file_.models.empty()) {
      return malformed_volume(name_, "", "the file has no model", "a chunk XYZI", "none");
    }
    return std::move(file_);
  }

 private:
  struct Chunk {
    std::string_view id;
    size_t at = 0;       // of its header
    size_t content = 0;  // first byte
    size_t children = 0, end = 0;
  };

  // The default palette is the named one, whose order is that of the specification's table.
  void set_default_colors() {
    const NamedPalette* palette = find_palette("magicavoxel");
    for (size_t i = 1; palette != nullptr && i < file_.colors.size(); ++i) {
      const PaletteColor& color = palette->colors[i - 1];
      file_.colors[i] = {color[0], color[1], color[2], 255};
    }
  }

  // Reads a header and moves the cursor to the content.
  Result<Chunk> next_chunk(VoxCursor& in) const {
    Chunk chunk;
    chunk.at = in.at();
    const auto id = in.take(4, "a chunk's header is cut off");
    chunk.id = {reinterpret_cast<const char*>(id.data()), id.size()};
    const auto content = static_cast<uint32_t>(in.i32());
    const auto children = static_cast<uint32_t>(in.i32());
    VOXELD_TRY(in.status());
    const uint64_t size = uint64_t{content} + children;
    if (size > in.left()) {
      return malformed_volume(name_, "byte " + std::to_string(chunk.at),
                              "the chunk " + shown_vox_text(chunk.id) + " is cut off",
                              std::to_string(size) + " bytes", std::to_string(in.left()));
    }
    chunk.content = in.at();
    chunk.children = chunk.content + content;
    chunk.end = chunk.children + children;
    return chunk;
  }

  Status read_main(VoxCursor& in) {
    VOXELD_ASSIGN(const Chunk main, next_chunk(in));
    if (main.id != "MAIN") {
      return malformed_volume(name_, "byte " + std::to_string(main.at), "not the root chunk",
                              "\"MAIN\"", shown_vox_text(main.id));
    }
    file_.trailing_bytes = bytes_.size() - main.end;
    VoxCursor children(name_, bytes_, main.children, main.end, {});
    while (children.left() > 0) {
      cancel_point();
      VOXELD_ASSIGN(const Chunk chunk, next_chunk(children));
      VOXELD_TRY(read_chunk(chunk));
      children.take(chunk.end - chunk.content, "");
    }
    if (!size_) return {};
    return malformed_volume(name_, "byte " + std::to_string(main.end),
                            "the last chunk SIZE has no voxels", "a chunk XYZI", "none");
  }

  Status read_chunk(const Chunk& chunk) {
    VoxCursor in(name_, bytes_, chunk.content, chunk.children, chunk.id);
    if (chunk.id == "SIZE") {
      read_size(chunk, in);
    } else if (chunk.id == "XYZI") {
      read_voxels(chunk, in);
    } else if (chunk.id == "RGBA") {
      read_colors(in);
    } else if (chunk.id == "nTRN") {
      read_transform(in);
    } else if (chunk.id == "nGRP") {
      read_group(in);
    } else if (chunk.id == "nSHP") {
      read_shape(in);
    } else if (chunk.id == "LAYR") {
      read_layer(in);
    }
    return in.status();
  }

  void read_size(const Chunk& chunk, VoxCursor& in) {
    if (size_) in.fail(chunk.at, "the chunk SIZE before has no voxels", "a chunk XYZI", "SIZE");
    size_.emplace();
    for (int32_t& side : *size_) {
      const size_t place = in.at();
      side = in.i32();
      if (in.ok() && (side < 1 || side > kVoxModelSideMax)) {
        in.fail(place, "the side of a model is out of range", range_text(1, kVoxModelSideMax),
                std::to_string(side));
      }
    }
  }

  void read_voxels(const Chunk& chunk, VoxCursor& in) {
    if (!size_) {
      in.fail(chunk.at, "voxels of a model without size", "a chunk SIZE before it", "none");
      return;
    }
    VoxModel model;
    model.size = *size_;
    const size_t count = in.count(kVoxVoxelBytes, "voxels");
    const size_t begin = in.at();
    model.voxels = in.take(count * kVoxVoxelBytes, "");
    for (size_t i = 0; i < model.voxels.size(); i += kVoxVoxelBytes) {
      if (i / kVoxVoxelBytes % kVoxCancelVoxels == 0) cancel_point();
      const uint8_t* voxel = &model.voxels[i];
      for (size_t c = 0; c < 3; ++c) {
        if (voxel[c] < model.size[c]) continue;
        in.fail(begin + i, "a voxel is outside of its model",
                range_text(0, model.size[c] - 1) + " in " + "xyz"[c], std::to_string(voxel[c]));
        return;
      }
    }
    file_.models.push_back(model);
    size_.reset();
  }

  void read_colors(VoxCursor& in) {
    const auto bytes = in.take(kVoxPaletteBytes, "the palette is cut off");
    for (size_t i = 1; i < file_.colors.size() && in.ok(); ++i) {
      std::array<uint8_t, 4>& color = file_.colors[i];
      std::memcpy(color.data(), &bytes[4 * (i - 1)], color.size());
      if (color[3] == 0) color[3] = 255;
    }
  }

  void read_transform(VoxCursor& in) {
    VoxNode node;
    node.id = in.i32();
    VoxPlacementReader placement;
    in.dict([&](std::string_view key, std::string_view value) {
      if (key == "_hidden") node.is_hidden = value == "1";
      if (node.id == 0) placement.read(key, value);
    });
    if (node.id == 0) file_.placement = placement.placement();
    node.children = in.take(sizeof(int32_t), "cut off");
    in.i32();  // reserved
    node.layer = in.i32();
    if (frame_count(in, sizeof(int32_t)) == 0) return;
    in.dict([&](std::string_view key, std::string_view value) {
      if (key == "_r" && !vox_rotation(value, node.transform)) {
        in.fail(in.at() - value.size(), "not a rotation",
                "bits 0-1 and 2-3 that are two of 0, 1, 2, and signs", shown_vox_text(value));
      } else if (key == "_t" && !vox_translation(value, node.transform)) {
        in.fail(in.at() - value.size(), "not a translation", "three integers",
                shown_vox_text(value));
      }
    });
    file_.nodes.push_back(node);
  }

  void read_group(VoxCursor& in) {
    VoxNode node;
    node.kind = VoxNodeKind::kGroup;
    read_id(in, node);
    const size_t children = in.count(sizeof(int32_t), "children");
    node.children = in.take(children * sizeof(int32_t), "");
    file_.nodes.push_back(node);
  }

  void read_shape(VoxCursor& in) {
    VoxNode node;
    node.kind = VoxNodeKind::kShape;
    read_id(in, node);
    if (frame_count(in, 2 * sizeof(int32_t)) == 0) return;
    node.model = in.i32();
    file_.nodes.push_back(node);
  }

  static void read_id(VoxCursor& in, VoxNode& node) {
    node.id = in.i32();
    in.dict([&](std::string_view key, std::string_view value) {
      if (key == "_hidden") node.is_hidden = value == "1";
    });
  }

  // The frames of a node, of which the first is read.
  uint32_t frame_count(VoxCursor& in, size_t frame_bytes) {
    const size_t place = in.at();
    const uint32_t frames = in.count(frame_bytes, "frames");
    if (frames == 0) in.fail(place, "a node without frames", "at least 1", "0");
    if (frames > 1) file_.has_frames = true;
    return frames;
  }

  void read_layer(VoxCursor& in) {
    const int32_t id = in.i32();
    in.dict([&](std::string_view key, std::string_view value) {
      if (key == "_hidden" && value == "1") file_.hidden_layers.push_back(id);
    });
  }

  Status sort_nodes() {
    cancellable_sort(file_.nodes.begin(), file_.nodes.end(),
                     [](const VoxNode& a, const VoxNode& b) { return a.id < b.id; });
    const auto twice = std::ranges::adjacent_find(file_.nodes, {}, &VoxNode::id);
    if (twice == file_.nodes.end()) return {};
    return malformed_volume(name_, "node " + std::to_string(twice->id), "two nodes with this id",
                            "one", "several");
  }

  std::string_view name_;
  std::span<const uint8_t> bytes_;
  std::optional<std::array<int32_t, 3>> size_;  // of a SIZE whose XYZI follows
  VoxFile file_;
};

}  // namespace

const VoxNode* VoxFile::find_node(int32_t id) const {
  const auto found = std::ranges::lower_bound(nodes, id, {}, &VoxNode::id);
  return found != nodes.end() && found->id == id ? &*found : nullptr;
}

bool VoxFile::is_hidden_layer(int32_t layer) const {
  return std::ranges::binary_search(hidden_layers, layer);
}

Result<VoxFile> read_vox_chunks(std::string_view name, std::span<const uint8_t> bytes) {
  return VoxChunks(name, bytes).read();
}

}  // namespace voxeld::volumes
