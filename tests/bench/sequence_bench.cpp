// Sizes of sequences and the time to write and read them: sequence_bench [--size N] [--frames N]
// [--normal] [--out DIR] FILE takes an animated mesh (a zip, or one file), voxelizes frames of its
// first animation with pipeline cpu, colours among the channels, and writes them in every format,
// the native one also without differences. Bytes and milliseconds per frame, of all cores.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "server/base/file.h"
#include "server/base/stopwatch.h"
#include "server/formats/sequence_formats.h"
#include "server/formats/sequence_writer.h"
#include "server/scene/animated_scene.h"
#include "server/voxel/voxelize.h"

namespace voxeld {
namespace {

struct Arguments {
  size_t frames = 48;
  VoxelizeOptions options;
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
      arguments.options.channel_normal = true;
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

void print(const char* name, const Frames& frames, uint64_t bytes, double write_ms,
           double read_ms) {
  const auto count = static_cast<double>(frames.frame_count());
  std::printf("%-14s %10.0f bytes, written in %7.1f ms", name, static_cast<double>(bytes) / count,
              write_ms / count);
  if (read_ms > 0) std::printf(", read in %6.1f ms", read_ms / count);
  std::printf("\n");
}

// Writes and reads the container in memory.
Status measure_native(const char* name, const Frames& frames, Codec codec, uint32_t chain_max) {
  GridHeader header = container_header(frames.common());
  header.codecs = StreamCodecs::all(codec);
  const Stopwatch writing;
  VOXELD_ASSIGN(auto writer, SequenceWriter::open(header, frames.fps(), {.chain_max = chain_max}));
  std::vector<uint8_t> out = writer.front();
  for (size_t i = 0; i < frames.frame_count(); ++i) {
    VOXELD_ASSIGN(const Grid frame, frames.frame(i));
    VOXELD_ASSIGN(const auto bytes, writer.add(frames.time_s(i), frame.tiles));
    out.insert(out.end(), bytes.begin(), bytes.end());
  }
  VOXELD_ASSIGN(const SequenceWriter::End end, writer.finish());
  out.insert(out.end(), end.index.begin(), end.index.end());
  std::copy(end.header.begin(), end.header.end(), out.begin());
  const double write_ms = writing.ms();
  const Stopwatch reading;
  VOXELD_ASSIGN(const SequenceReader reader, SequenceReader::open(out));
  RawStreams kept;
  for (size_t i = 0; i < reader.frame_count(); ++i) {
    VOXELD_ASSIGN(const auto tiles, reader.decode_frame(i, &kept));
    if (tiles.empty()) return Error{ErrorCode::kInternal, "an empty frame", "", ""};
  }
  print(name, frames, out.size(), write_ms, reading.ms());
  return {};
}

Status measure_file(Format format, const Frames& frames, const std::filesystem::path& folder) {
  OutputOptions options;
  options.format = format;
  const std::filesystem::path path =
      folder / ("sequence_bench" + std::string(sequence_extension(format)));
  const Stopwatch writing;
  VOXELD_TRY(write_sequence(frames, options, path));
  const double write_ms = writing.ms();
  print(format_name(format).data(), frames, std::filesystem::file_size(path), write_ms, 0);
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
  VOXELD_TRY(measure_native("fast, whole", frames, Codec::kFast, 1));
  VOXELD_TRY(measure_native("fast", frames, Codec::kFast, kStreamChainMax));
  VOXELD_TRY(measure_native("small", frames, Codec::kSmall, kStreamChainMax));
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
