// Writes voxels as comma-separated values (RFC 4180, with LF): a line of names, then a line for
// each voxel in the order of sparse arrays (Morton).
//
//   x,y,z        the cell, from 0
//   px,py,pz     its centre in world units
//   r,g,b,a      sRGB and alpha, 0..255
//   nx,ny,nz     unit normal
//   material     id, 0: none
//   label        likewise
//   distance     in world units; in voxels if those are no cubes, unless distance=world
//   coverage     0..1
//
// The columns of channels are there if the grid has them. Voxels of full nodes have what sparse
// arrays have for them: zeros, coverage 1 and the largest distance inside. Numbers are the shortest
// that read back as the same double (centres) or float.
#include <array>
#include <charconv>
#include <string>
#include <vector>

#include "proto/thread_pool.h"
#include "server/base/cancel_point.h"
#include "server/formats/formats.h"
#include "server/formats/npy/sample_writers.h"
#include "server/formats/output_file.h"
#include "server/formats/points/voxel_points.h"
#include "server/formats/volume/volume_facts.h"

namespace voxeld::points {
namespace {

constexpr size_t kAxisCount = 3;

template <typename Number>
void append_number(std::string& text, Number value) {
  std::array<char, 32> digits{};  // the longest double has 24 characters
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr;
  text.append(digits.data(), end);
}

template <typename Number>
void append_column(std::string& text, Number value) {
  text += ',';
  append_number(text, value);
}

std::string csv_names(const ChannelSet& channels) {
  std::string names = "x,y,z,px,py,pz";
  for (const ChannelInfo& info : kChannels) {
    if (!channels.has(info.channel)) continue;
    switch (info.kind) {
      case ChannelKind::kColor:
        names += ",r,g,b,a";
        break;
      case ChannelKind::kVector:
        names += ",nx,ny,nz";
        break;
      default:
        names += "," + std::string(info.name);
    }
  }
  return names + "\n";
}

// Makes the lines of voxels. A coordinate is one of a few thousand, so its texts are made once.
class CsvLines {
 public:
  explicit CsvLines(const Grid& grid)
      : grid_(grid), distance_scale_(volume::stored_distance_scale(grid)) {
    for (size_t axis = 0; axis < kAxisCount; ++axis) {
      const int i = static_cast<int>(axis);
      const int cells = grid.spec.dims[i];
      for (int cell = 0; cell < cells; ++cell) {
        append_number(cells_[axis].emplace_back(), cell);
        const double center = grid.spec.origin_world[i] + (cell + 0.5) * grid.spec.voxel_size[i];
        append_number(centers_[axis].emplace_back(), center);
      }
    }
    if (grid.channels.distance) deepest_ = -farthest(grid, &SparseTile::distance);
  }

  std::string of_piece(const VoxelPieces& voxels, size_t piece) const {
    std::string text;
    text.reserve(static_cast<size_t>(format_info(Format::kCsv).layout.point_bytes) *
                 (voxels.begin(piece + 1) - voxels.begin(piece)));
    for_each_point(voxels, piece,
                   [&](const SparseTile& tile, const std::array<int32_t, 3>& cell,
                       size_t attribute) { append_line(text, tile, cell, attribute); });
    return text;
  }

 private:
  void append_line(std::string& text, const SparseTile& tile, const std::array<int32_t, 3>& cell,
                   size_t attribute) const {
    for (const auto* const texts : {&cells_, &centers_}) {
      for (size_t axis = 0; axis < kAxisCount; ++axis) {
        text += (*texts)[axis][static_cast<size_t>(cell[axis])];
        text += ',';
      }
    }
    text.pop_back();
    for_each_channel_member([&](auto which, auto member) {
      if (!grid_.channels.has(which)) return;
      constexpr const ChannelInfo& kInfo = channel_info(which);
      for (size_t c = 0; c < kInfo.components; ++c) {
        if (attribute == kNoAttributes) {
          append_inner(text, kInfo.kind);
        } else {
          append_sample(text, kInfo.kind, (tile.*member)[kInfo.components * attribute + c]);
        }
      }
    });
    text += '\n';
  }

  void append_sample(std::string& text, ChannelKind kind, int stored) const {
    switch (kind) {
      case ChannelKind::kVector:
        return append_column(text, static_cast<float>(stored) / INT8_MAX);
      case ChannelKind::kFraction:
        return append_column(text, static_cast<float>(stored) / UINT8_MAX);
      case ChannelKind::kDistance:
        return append_distance(text, static_cast<float>(stored) / kDistanceSteps);
      default:
        append_column(text, stored);
    }
  }

  // The sample of a voxel of a full node.
  void append_inner(std::string& text, ChannelKind kind) const {
    if (kind == ChannelKind::kDistance) return append_distance(text, deepest_);
    append_column(text, kind == ChannelKind::kFraction ? 1 : 0);
  }

  void append_distance(std::string& text, float voxels) const {
    append_column(text, static_cast<float>(voxels * distance_scale_));
  }

  using AxisTexts = std::array<std::vector<std::string>, kAxisCount>;
  const Grid& grid_;
  double distance_scale_;
  AxisTexts cells_, centers_;
  float deepest_ = 0;  // in distance_unit()
};

}  // namespace
}  // namespace voxeld::points

namespace voxeld {

Status encode_csv(const Grid& grid, const OutputOptions& /*options*/, OutputFile& file) {
  using namespace points;
  const VoxelPieces voxels(grid);
  if (voxels.voxel_count() > kXyzPointsMax) {
    return Error{ErrorCode::kGridTooLarge, "csv: too many voxels for lines",
                 "at most " + std::to_string(kXyzPointsMax), std::to_string(voxels.voxel_count())};
  }
  VOXELD_TRY(file.append(volume::text_bytes(csv_names(grid.channels))));
  const CsvLines lines(grid);
  const size_t batch = ThreadPool::shared().threads();
  for (size_t begin = 0; begin < voxels.count(); begin += batch) {
    std::vector<std::string> texts(std::min(batch, voxels.count() - begin));
    ThreadPool::shared().for_each(texts.size(), [&](size_t i) {
      cancel_point();  // on the calling thread
      texts[i] = lines.of_piece(voxels, begin + i);
    });
    for (const std::string& text : texts) VOXELD_TRY(file.append(volume::text_bytes(text)));
  }
  return {};
}

}  // namespace voxeld
