// Writes MagicaVoxel's animated .vox, version 200. vox.cpp describes what it shares with that of a
// grid.
//
//   VOX 200 MAIN { (SIZE XYZI)*  nTRN 0 -> nGRP 1 -> (nTRN -> nSHP)*  RGBA  META }
//
// A shape has one model for each frame in which its cells change: {"_f": frame}. It is shown until
// the next one. Equal models of any frames are written once. All frames share one palette; frames
// are read twice where it is chosen from their colours. Voxels without colour or id get the mean
// colour of the first frame.
#include <map>
#include <set>
#include <string>
#include <unordered_map>
#include <utility>

#include "server/base/sha256.h"
#include "server/formats/formats.h"
#include "server/formats/output_file.h"
#include "server/formats/vox_parts.h"

namespace voxeld {
namespace {

constexpr uint32_t kVoxAnimationVersion = 200;
constexpr size_t kFileHeaderBytes = 20;

// One nSHP: pairs of first frame and model.
using Shape = std::vector<std::pair<size_t, uint32_t>>;

class VoxSequence {
 public:
  VoxSequence(const FrameSource& source, OutputFile file, const OutputOptions& options)
      : source_(source),
        file_(std::move(file)),
        options_(options),
        scene_(vox::scene_size(source.common().spec)) {}

  Status write() {
    VOXELD_TRY(choose_palette());
    vox::Bytes header;
    vox::add_file_header(header, kVoxAnimationVersion, 0);
    VOXELD_TRY(file_.append(header.bytes()));
    for (size_t i = 0; i < source_.frame_count(); ++i) VOXELD_TRY(add_frame(i));
    VOXELD_TRY(append(scene_graph()));
    vox::Bytes end;
    end.u32(static_cast<uint32_t>(file_.size() - kFileHeaderBytes));
    return file_.replace(kFileHeaderBytes - end.size(), end.bytes());
  }

 private:
  // Chooses the palette from all frames, unless the request has one.
  Status choose_palette() {
    VOXELD_ASSIGN(const Grid first, source_.frame(0));
    colors_.emplace(first);
    ColorCounts counts;
    const size_t counted = options_.palette.empty() ? source_.frame_count() : 0;
    for (size_t i = 0; i < counted; ++i) {
      VOXELD_ASSIGN(const Grid frame, source_.frame(i));
      VOXELD_TRY(check_length(frame));
      vox::count_colors(frame, *colors_, counts);
    }
    palette_ = vox::palette_of(std::move(counts), *colors_, options_);
    return {};
  }

  static Status check_length(const Grid& frame) {
    return vox::check_length(sizeof(vox::Voxel) * frame.voxel_count());
  }

  Status add_frame(size_t index) {
    VOXELD_ASSIGN(const Grid frame, source_.frame(index));
    VOXELD_TRY(check_length(frame));
    vox::Models models =
        vox::models_of(frame, vox::entries_of(frame, *colors_, palette_, options_.dither));
    if (models.empty() && shapes_.empty()) models[{}] = {};
    // A part that becomes empty shows a model without cells.
    for (const auto& [part, shape] : shapes_) models.try_emplace(part);
    for (const auto& [part, voxels] : models) {
      VOXELD_ASSIGN(const uint32_t model, model_of(part, voxels));
      Shape& shape = shapes_[part];
      if (shape.empty() && index > 0) {
        VOXELD_ASSIGN(const uint32_t nothing, model_of(part, {}));
        shape.emplace_back(0, nothing);
      }
      if (shape.empty() || shape.back().second != model) shape.emplace_back(index, model);
    }
    return {};
  }

  // Writes the model unless an equal one was written.
  Result<uint32_t> model_of(const vox::Part& part, const std::vector<vox::Voxel>& voxels) {
    vox::Bytes model;
    vox::add_model(model, part, voxels, scene_);
    const auto next = static_cast<uint32_t>(model_numbers_.size());
    const auto [known, is_new] = model_numbers_.try_emplace(sha256_id(model.bytes()), next);
    if (is_new) VOXELD_TRY(append(model));
    return known->second;
  }

  vox::Bytes scene_graph() const {
    vox::Bytes out;
    std::vector<vox::Part> parts;
    std::vector<const Shape*> shapes;
    for (const auto& [part, shape] : shapes_) {
      parts.push_back(part);
      shapes.push_back(&shape);
    }
    vox::add_scene(out, source_.common(), parts, [&](vox::Bytes& content, size_t part) {
      content.dict({{"_loop", "1"}});
      content.u32(static_cast<uint32_t>(shapes[part]->size()));
      for (const auto& [frame, model] : *shapes[part]) {
        content.u32(model);
        content.dict({{"_f", std::to_string(frame)}});
      }
    });
    vox::add_palette(out, palette_);
    vox::Bytes meta;
    meta.dict({{"_anim_range", "0 " + std::to_string(source_.frame_count() - 1)}});
    out.chunk("META", meta);
    return out;
  }

  Status append(vox::Bytes bytes) {
    VOXELD_TRY(vox::check_length(file_.size() + bytes.size()));
    return file_.append(bytes.bytes());
  }

  const FrameSource& source_;
  OutputFile file_;
  const OutputOptions& options_;
  std::array<int, 3> scene_;
  std::optional<vox::Colors> colors_;
  Palette palette_;
  std::map<vox::Part, Shape> shapes_;
  std::unordered_map<std::string, uint32_t> model_numbers_;  // by the hash of their chunks
};

}  // namespace

Status write_vox_sequence(const FrameSource& source, const OutputOptions& options,
                          const std::filesystem::path& path) {
  VOXELD_ASSIGN(OutputFile file, OutputFile::create(path));
  return VoxSequence(source, std::move(file), options).write();
}

}  // namespace voxeld
