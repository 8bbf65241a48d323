// Sequences that the tests of the formats write, and what they write them with.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "server/formats/sequence_writer.h"
#include "server/grid/frame_source.h"
#include "tests/unit/formats/sample_grid.h"

namespace voxeld::test {

// Frames that are in memory, 1/fps apart. The first one is number `first` of its animation.
class FramesInMemory : public FrameSource {
 public:
  explicit FramesInMemory(std::vector<Grid> frames, double fps = 24, size_t first = 0)
      : frames_(std::move(frames)), fps_(fps), first_(first), common_(frames_.front()) {
    common_.tiles.clear();
  }
  const Grid& common() const override { return common_; }
  size_t frame_count() const override { return frames_.size(); }
  double time_s(size_t index) const override { return static_cast<double>(first_ + index) / fps_; }
  double fps() const override { return fps_; }
  Result<Grid> frame(size_t index) const override { return frames_[index]; }

 private:
  std::vector<Grid> frames_;
  double fps_;
  size_t first_;
  Grid common_;
};

// A scene that mostly stands still: in frame k, one in `moving_every` voxels is somewhere else.
inline std::vector<Grid> mostly_static(uint32_t seed, const std::array<int, 3>& dims, int voxels,
                                       size_t frames, const ChannelSet& channels,
                                       size_t moving_every = 200) {
  std::mt19937 random(seed);
  std::vector<TestVoxel> all = random_voxels(random, dims, voxels);
  std::vector<Grid> grids;
  for (size_t k = 0; k < frames; ++k) {
    for (size_t i = k % moving_every; k > 0 && i < all.size(); i += moving_every) {
      all[i] = random_voxels(random, dims, 1).front();
    }
    grids.push_back(grid_of(dims, all, channels));
  }
  return grids;
}

// The container of the grids, at times 1/24 s apart.
inline Result<std::vector<uint8_t>> sequence_bytes(const std::vector<Grid>& grids,
                                                   const StreamCodecs& codecs = {},
                                                   const SequenceWriterOptions& options = {}) {
  GridHeader header = container_header(grids.front());
  header.codecs = codecs;
  VOXELD_ASSIGN(SequenceWriter writer, SequenceWriter::open(header, 24, options));
  std::vector<uint8_t> out = writer.front();
  for (size_t i = 0; i < grids.size(); ++i) {
    VOXELD_ASSIGN(const auto bytes, writer.add(static_cast<double>(i) / 24, grids[i].tiles));
    out.insert(out.end(), bytes.begin(), bytes.end());
  }
  VOXELD_ASSIGN(const SequenceWriter::End end, writer.finish());
  out.insert(out.end(), end.index.begin(), end.index.end());
  std::copy(end.header.begin(), end.header.end(), out.begin());
  return out;
}

}  // namespace voxeld::test
