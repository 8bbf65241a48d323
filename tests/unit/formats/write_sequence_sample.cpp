// write_sequence_sample DIR: two sequences in every format and, as text, what they hold, for
// read_sequence_test.py. "small" has all channels, full nodes, and a frame that was there before;
// "wide" has several tiles that come and go, and an empty frame.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include "server/formats/formats.h"
#include "tests/unit/formats/sample_frames.h"

namespace voxeld {
namespace {

constexpr ChannelSet kAll = channels_of_bits(test::kChannelSets - 1);

bool write(const std::filesystem::path& path, const FrameSource& source,
           const OutputOptions& options) {
  const Status status = write_sequence(source, options, path);
  if (!status) std::fprintf(stderr, "%s\n", status.error().message().c_str());
  return status.ok();
}

void write_voxel(std::ofstream& file, const SparseTile& tile, size_t voxel) {
  const bool inside = voxel == kNoAttributes;
  for (const ChannelInfo& info : kChannels) {
    for (size_t c = 0; c < info.components; ++c) {
      int value = inside && info.channel == Channel::kCoverage ? 255 : 0;
      for_each_channel(tile, [&](Channel channel, const auto& samples) {
        if (channel != info.channel || inside || samples.empty()) return;
        value = samples[voxel * info.components + c];
      });
      file << ' ' << value;
    }
  }
}

// One line per voxel: frame, x y z, r g b a, nx ny nz, material, label, distance, coverage.
bool write_text(const std::filesystem::path& path, const std::vector<Grid>& frames) {
  std::ofstream file(path);
  for (size_t i = 0; i < frames.size(); ++i) {
    for (const SparseTile& tile : frames[i].tiles) {
      for_each_voxel(tile, [&](int x, int y, int z, size_t voxel) {
        file << i << ' ' << x << ' ' << y << ' ' << z;
        write_voxel(file, tile, voxel);
        file << '\n';
      });
    }
  }
  return file.good();
}

bool write_small(const std::filesystem::path& folder) {
  std::vector<Grid> frames = test::mostly_static(5, {70, 40, 50}, 1500, 5, kAll, 30);
  for (size_t i = 0; i < 4; ++i) {
    // A place without a brick.
    SparseTile& tile = frames[i].tiles[0];
    for (uint32_t brick = 0; brick < 64; ++brick) {
      const bool is_taken = std::ranges::binary_search(tile.brick_morton, brick);
      if (!is_taken && tile.full.size() < 2 + i) tile.full.push_back({brick, 0});
    }
  }
  frames.push_back(frames[1]);
  const test::FramesInMemory source(frames, 12.5);
  OutputOptions floats, zyx;
  floats.format = zyx.format = Format::kNpz;
  floats.dtype = DType::kFloat32;
  floats.axes = AxisOrder::kXyz;
  OutputOptions native, vox, npy;
  vox.format = Format::kVox;
  npy.format = Format::kNpy;
  npy.dtype = DType::kBool;
  return write(folder / "small.voxs", source, native) && write(folder / "small.vox", source, vox) &&
         write(folder / "small.npz", source, zyx) && write(folder / "xyz.npz", source, floats) &&
         write(folder / "small.npy", source, npy) && write_text(folder / "small.txt", frames);
}

bool write_wide(const std::filesystem::path& folder) {
  const ChannelSet color = {.color = true};
  std::vector<Grid> frames = test::mostly_static(7, {300, 40, 530}, 2000, 4, color, 30);
  for (Grid& frame : frames) {
    for (SparseTile& tile : frame.tiles) {
      for (size_t i = 0; i < tile.color.size(); ++i) {
        // 64 colours, so that the palette is exact.
        tile.color[i] = i % 4 == 3 ? 255 : static_cast<uint8_t>(tile.color[i] / 64 * 85);
      }
    }
  }
  frames[2].tiles.clear();
  frames[3].tiles.erase(frames[3].tiles.begin());
  frames[0].tiles.pop_back();
  const test::FramesInMemory source(frames);
  OutputOptions native, vox, small;
  vox.format = Format::kVox;
  small.codec = Codec::kSmall;
  return write(folder / "wide.voxs", source, native) && write(folder / "wide.vox", source, vox) &&
         write(folder / "codec_small.voxs", source, small) &&
         write_text(folder / "wide.txt", frames);
}

}  // namespace
}  // namespace voxeld

int main(int argc, char** argv) {
  return argc == 2 && voxeld::write_small(argv[1]) && voxeld::write_wide(argv[1]) ? 0 : 1;
}
