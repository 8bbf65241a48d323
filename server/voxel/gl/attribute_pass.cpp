#include "server/voxel/gl/attribute_pass.h"

#include <algorithm>
#include <array>
#include <utility>

#include "server/grid/color/color_tables.h"
#include "server/voxel/attributes/mip_chain.h"
#include "server/voxel/gl/occupancy/touch_pass.h"
#include "shaders/shared/attributes.h"

namespace voxeld {

Status AttributePass::begin_job(const Scene& scene, const AttributeRecords& records,
                                const AttributeChannels& channels, uint64_t textures_key) {
  channels_ = channels;
  if (textures_key == 0 || textures_key != textures_key_) {
    textures_key_ = 0;
    VOXELD_TRY(upload_textures(scene, records));
    textures_key_ = textures_key;
  }
  if (linear_.id() == 0) {
    const auto& table = linear16_from_srgb8();
    VOXELD_ASSIGN(linear_, gpu::Buffer::create(device_->context(), sizeof(table), "linear light"));
    linear_.upload(0, std::span<const uint32_t>(table));
  }
  return device_->context().check("uploading textures");
}

Status AttributePass::upload_textures(const Scene& scene, const AttributeRecords& records) {
  textures_.clear();
  textures_.resize(scene.images.size());
  for (size_t i = 0; i < scene.images.size(); ++i) {
    const ImageLevels& used = records.image_levels()[i];
    if (!used.used() || !channels_.color) continue;
    const auto levels = build_mip_levels(scene.images[i], used.first, used.last);
    VOXELD_ASSIGN(textures_[i], gpu::Texture2D::create_rgba8ui(
                                    device_->context(), levels[0].width, levels[0].height,
                                    static_cast<int>(levels.size()), scene.images[i].name));
    for (size_t level = 0; level < levels.size(); ++level) {
      textures_[i].upload_level(static_cast<int>(level), levels[level].rgba);
    }
  }
  return {};
}

Status AttributePass::begin_tile(std::span<const uint32_t> word_offsets, uint64_t blocks) {
  VOXELD_TRY(gpu::ensure_size(word_offsets_, device_->context(), kTileMaskBytes, "word offsets"));
  for_each_block_run(blocks, [&](size_t first_word, size_t word_count) {
    word_offsets_.upload(first_word * 4, word_offsets.subspan(first_word, word_count));
  });
  return {};
}

size_t AttributePass::voxels_max() const {
  const auto limit = static_cast<size_t>(device_->context().info().ssbo_bytes_max);
  return (std::min(kSumsBytesMax, limit) - 4) / (size_t{4} * channels_.count());
}

Status AttributePass::begin_voxels(size_t first, size_t count) {
  params_ = {};
  params_.voxel_first = static_cast<uint32_t>(first);
  params_.voxel_count = static_cast<uint32_t>(count);
  const size_t bytes = count * channels_.count() * 4;
  VOXELD_TRY(gpu::ensure_size(sums_, device_->context(), bytes, "sums"));
  VOXELD_TRY(gpu::ensure_size(carries_, device_->context(), bytes + 4, "carries"));
  if (std::exchange(is_summing_, true)) {
    // A job ended before read(). Its carries would be added to these sums.
    device_->context().gl().MemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
    carries_.clear(0, carries_.size_bytes());
  }
  sums_.clear(0, bytes);
  return {};
}

void AttributePass::bind() const {
  attributes_.bind_storage(VOXELIZE_ATTRIBUTES);
  word_offsets_.bind_storage(VOXELIZE_WORD_OFFSETS);
  sums_.bind_storage(VOXELIZE_SUMS);
  linear_.bind_storage(VOXELIZE_LINEAR);
  carries_.bind_storage(ATTRIBUTES_CARRIES);
}

gpu::Defines AttributePass::defines(bool textured) const {
  const auto flag = [](bool on) { return on ? "1" : "0"; };
  return {{"ATTRIBUTE_COLOR", flag(channels_.color)},
          {"ATTRIBUTE_ALPHA", flag(channels_.alpha)},
          {"ATTRIBUTE_NORMAL", flag(channels_.normal)},
          {"ATTRIBUTE_TEXTURE", flag(textured)}};
}

Status AttributePass::run(const TileWindow& window, std::span<const uint32_t> words,
                          Pipeline pipeline) {
  VOXELD_TRY(gpu::ensure_size(attributes_, device_->context(), words.size_bytes(), "attributes"));
  attributes_.upload(0, words);
  bind();
  for (const TileWindow::ImageRun& run : window.image_runs) {
    VOXELD_TRY(run_image(window, run.image, pipeline));
  }
  return device_->context().check("summing attributes");
}

Status AttributePass::run_image(const TileWindow& window, int image, Pipeline pipeline) {
  const auto index = static_cast<size_t>(image);
  const bool textured =
      channels_.color && image >= 0 && index < textures_.size() && textures_[index].id() != 0;
  if (textured) textures_[index].bind(VOXELIZE_TEXTURE);
  if (pipeline == Pipeline::kRaster) {
    VOXELD_ASSIGN(const gpu::Program* program,
                  shaders_->get({{"voxelize.vert"}, {"voxelize.geom"}, {"attributes.frag"}},
                                defines(textured)));
    for (const TileWindow::ImageRun& run : window.image_runs) {
      if (run.image != image) continue;
      VOXELD_TRY(device_->run_triangles(*program, run.first, run.count, params_));
    }
    return {};
  }
  for (const ItemRange& range : window.ranges) {
    if (range.image != image) continue;
    gpu::Defines all = defines(textured);
    const TouchClass touch_class =
        range.touch_class == TouchClass::kLarge ? TouchClass::kLarge : TouchClass::kSmall;
    for (const auto& define : touch_class_defines(touch_class)) all.push_back(define);
    VOXELD_ASSIGN(const gpu::Program* program, shaders_->get({{"attributes.comp"}}, all));
    VOXELD_TRY(device_->run_items(*program, range.first, range.count, params_));
  }
  return {};
}

void AttributePass::read(std::vector<uint32_t>& sums, std::vector<uint32_t>& carries) {
  device_->context().gl().MemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  const size_t count = size_t{params_.voxel_count} * channels_.count();
  sums.resize(count);
  sums_.read(0, std::span(sums));
  std::array<uint32_t, 1> carried{};
  carries_.read(0, std::span<uint32_t>(carried));
  carries.clear();
  if (carried[0] != 0) {
    carries.resize(count);
    carries_.read(4, std::span(carries));
    carries_.clear(0, 4 + 4 * count);
  }
  is_summing_ = false;
}

int64_t AttributePass::bytes() const {
  size_t bytes = attributes_.size_bytes() + word_offsets_.size_bytes() + sums_.size_bytes() +
                 carries_.size_bytes() + linear_.size_bytes();
  for (const gpu::Texture2D& texture : textures_) {
    // All levels together are a third larger than the first.
    bytes += size_t{4} * static_cast<size_t>(texture.width()) *
             static_cast<size_t>(texture.height()) * 4 / 3;
  }
  return static_cast<int64_t>(bytes);
}

}  // namespace voxeld
