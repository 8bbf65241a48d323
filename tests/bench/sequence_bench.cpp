// Sizes of sequences and the time to write and read them:
// sequence_bench [--size N] [--frames N] [--normal] [--native] [--out DIR] FILE
// takes an animated mesh (a zip, or one file), voxelizes frames of its first animation with
// pipeline cpu, colours among the channels, and writes them in every format, the native one also
// without differences, and from the frames' containers; --native: codec fast alone. Bytes and
// milliseconds per frame: on all cores, and how long these worked.
#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "server/base/clock.h"
#include "server/base/disk/file.h"
#include "server/formats/formats.h"
#include "server/formats/sequence_writer.h"
#include "server/scene/core/animated_scene.h"
#include "server/scene/load.h"
#include "server/voxel/voxelize.h"

namespace voxeld {
namespace {

struct Arguments {
  size_t frames = 48;
  VoxelizeOptions options;
  bool native_only = false;
  std::filesystem::path out = std::filesystem::temp_directory_path();
  std::string file;
};

Arguments parse(int argc, char** argv) {
  Arguments arguments;
  arguments.options.pipeline = PipelineChoice::kCpu;
  arguments.options.placement.size = 256;
  for (int i = 1; i < argc; ++i) {
    const std::string text = argv[i];
    const auto value = [&] { return i + 1 < argc ? argv[++i] : "1"; };
    if (text == "--size") {
      arguments.options.placement.size = std::max(1, std::atoi(value()));
    } else if (text == "--frames") {
      arguments.frames = static_cast<size_t>(std::max(1, std::atoi(value())));
    } else if (text == "--normal") {
      arguments.options.channels = ChannelSet{.color = true, .normal = true};
    } else if (text == "--native") {
      arguments.native_only = true;
    } else if (text == "--out") {
      arguments.out = value();
    } else {
      arguments.file = text;
    }
  }
  return arguments;
}

class Frames : public FrameSource {
 public:
  Frames(std::vector<Grid> grids, double fps) : grids_(std::move(grids)), fps_(fps) {
    common_ = grids_.front();
    common_.tiles.clear();
  }
  const Grid& common() const override { return common_; }
  size_t frame_count() const override { return grids_.size(); }
  double time_s(size_t index) const override { return static_cast<double>(index) / fps_; }
  double fps() const override { return fps_; }
  Result<Grid> frame(size_t index) const override { return grids_[index]; }

 private:
  std::vector<Grid> grids_;
  double fps_;
  Grid common_;
};

Result<Frames> voxelized(const Arguments& arguments) {
  VOXELD_ASSIGN(const MappedFile file, MappedFile::open(arguments.file));
  VOXELD_ASSIGN(AnimatedScene animated, load_animated_scene(arguments.file, file.bytes()));
  if (animated.animations.empty()) {
    return Error{ErrorCode::kInvalidOption, arguments.file, "an animation", "none"};
  }
  const AnimationInfo& info = animated.animations[0];
  const double fps = info.frame_rate > 0 ? info.frame_rate : 24;
  const auto count =
      std::min(arguments.frames, static_cast<size_t>(std::floor(info.duration_s * fps + 1e-6)) + 1);
  std::vector<double> times(count);
  for (size_t i = 0; i < count; ++i) times[i] = static_cast<double>(i) / fps;
  VOXELD_ASSIGN(const Box3d box, bounds_over(animated, 0, times, RootMotion::kKeep));
  VoxelizeOptions options = arguments.options;
  options.placement.bounds = {box.min.x, box.min.y, box.min.z, box.max.x, box.max.y, box.max.z};
  Voxelizer voxelizer(nullptr);
  std::vector<Grid> grids;
  for (const double time : times) {
    VOXELD_ASSIGN(FrameVertices vertices, scene_at(animated, 0, time));
    swap_vertices(vertices, animated.scene);
    VOXELD_ASSIGN(Grid grid, voxelizer.voxelize(animated.scene, options, {}, nullptr));
    grids.push_back(std::move(grid));
  }
  return Frames(std::move(grids), fps);
}

// Milliseconds that all cores have worked for this process.
double core_ms() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto ms = [](const timeval& time) {
    return 1e3 * static_cast<double>(time.tv_sec) + 1e-3 * static_cast<double>(time.tv_usec);
  };
  return ms(usage.ru_utime) + ms(usage.ru_stime);
}

struct Time {
  double ms = 0, core_ms = 0;
};
class Clock {
 public:
  Time time() const { return {watch_.ms(), core_ms() - begin_ms_}; }

 private:
  const Stopwatch watch_;
  const double begin_ms_ = core_ms();
};

void print(const char* name, const Frames& frames, uint64_t bytes, const Time& writing,
           const Time& reading) {
  const auto count = static_cast<double>(frames.frame_count());
  std::printf("%-16s %10.0f bytes, written in %7.1f ms (%7.1f of cores)", name,
              static_cast<double>(bytes) / count, writing.ms / count, writing.core_ms / count);
  if (reading.ms > 0) {
    std::printf(", read in %6.1f ms (%6.1f)", reading.ms / count, reading.core_ms / count);
  }
  std::printf("\n");
}

// How a frame gets to the writer.
using AddFrame = std::function<Result<std::vector<uint8_t>>(SequenceWriter&, size_t)>;

// Writes and reads the container in memory.
Status measure_native(const char* name, const Frames& frames, Codec codec, uint32_t chain_max,
                      const AddFrame& add) {
  GridHeader header = container_header(frames.common());
  header.codecs = StreamCodecs::all(codec);
  const Clock writing;
  VOXELD_ASSIGN(auto writer, SequenceWriter::open(header, frames.fps(), {.chain_max = chain_max}));
  std::vector<uint8_t> out = writer.front();
  for (size_t i = 0; i < frames.frame_count(); ++i) {
    VOXELD_ASSIGN(const auto bytes, add(writer, i));
    out.insert(out.end(), bytes.begin(), bytes.end());
  }
  VOXELD_ASSIGN(const SequenceWriter::End end, writer.finish());
  out.insert(out.end(), end.index.begin(), end.index.end());
  std::copy(end.header.begin(), end.header.end(), out.begin());
  const Time written = writing.time();
  const Clock reading;
  VOXELD_ASSIGN(const SequenceReader reader, SequenceReader::open(out));
  RawStreams streams;
  for (size_t i = 0; i < reader.frame_count(); ++i) {
    VOXELD_ASSIGN(const auto tiles, reader.decode_frame(i, &streams));
    if (tiles.empty()) return Error{ErrorCode::kInternal, "an empty frame", "", ""};
  }
  print(name, frames, out.size(), written, reading.time());
  return {};
}

// The frames' own containers, and sequences whose streams are theirs.
Status measure_stored(const Frames& frames) {
  const Clock writing;
  std::vector<std::vector<uint8_t>> containers;
  uint64_t bytes = 0;
  for (size_t i = 0; i < frames.frame_count(); ++i) {
    VOXELD_ASSIGN(const Grid frame, frames.frame(i));
    VOXELD_ASSIGN(std::vector<uint8_t> container, encode(frame, {}));
    bytes += container.size();
    containers.push_back(std::move(container));
  }
  print("containers", frames, bytes, writing.time(), {});
  const AddFrame take = [&](SequenceWriter& writer, size_t i) -> Result<std::vector<uint8_t>> {
    VOXELD_ASSIGN(const GridReader reader, GridReader::open(containers[i]));
    std::vector<StoredTile> tiles;
    for (size_t t = 0; t < reader.tile_count(); ++t) {
      tiles.push_back(stored_tile(containers[i], reader, t));
    }
    VOXELD_TRY(writer.begin_frame(frames.time_s(i)));
    auto out = writer.add_stored(tiles);
    writer.end_frame();
    return out;
  };
  VOXELD_TRY(measure_native("taken over, whole", frames, Codec::kFast, 1, take));
  return measure_native("taken over", frames, Codec::kFast, kStreamChainMax, take);
}

Status measure_file(Format format, const Frames& frames, const std::filesystem::path& folder) {
  OutputOptions options;
  options.format = format;
  const std::filesystem::path path =
      folder / ("sequence_bench" + std::string(sequence_extension(format)));
  const Clock writing;
  VOXELD_TRY(write_sequence(frames, options, path));
  print(format_name(format).data(), frames, std::filesystem::file_size(path), writing.time(), {});
  std::filesystem::remove(path);
  return {};
}

Status run(const Arguments& arguments) {
  VOXELD_ASSIGN(const Frames frames, voxelized(arguments));
  const GridSpec& spec = frames.common().spec;
  uint64_t voxels = 0;
  for (size_t i = 0; i < frames.frame_count(); ++i) {
    VOXELD_ASSIGN(const Grid frame, frames.frame(i));
    voxels += frame.voxel_count();
  }
  std::printf("%zu frames of %d x %d x %d, %.0f voxels; per frame:\n", frames.frame_count(),
              spec.dims.x, spec.dims.y, spec.dims.z,
              static_cast<double>(voxels) / static_cast<double>(frames.frame_count()));
  VOXELD_TRY(measure_stored(frames));
  const AddFrame encode_frame = [&](SequenceWriter& writer,
                                    size_t i) -> Result<std::vector<uint8_t>> {
    VOXELD_ASSIGN(const Grid frame, frames.frame(i));
    return writer.add(frames.time_s(i), frame.tiles);
  };
  VOXELD_TRY(measure_native("fast, whole", frames, Codec::kFast, 1, encode_frame));
  VOXELD_TRY(measure_native("fast", frames, Codec::kFast, kStreamChainMax, encode_frame));
  if (arguments.native_only) return {};
  VOXELD_TRY(measure_native("small", frames, Codec::kSmall, kStreamChainMax, encode_frame));
  for (const Format format : {Format::kVox, Format::kNpz}) {
    VOXELD_TRY(measure_file(format, frames, arguments.out));
  }
  return {};
}

}  // namespace
}  // namespace voxeld

int main(int argc, char** argv) {
  if (const auto status = voxeld::run(voxeld::parse(argc, argv)); !status) {
    std::fprintf(stderr, "%s\n", status.error().message().c_str());
    return 1;
  }
  return 0;
}
