// The pass that sums the attributes of a tile's occupied cells.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/gpu/shader_library.h"
#include "server/voxel/attributes/attribute_records.h"
#include "server/voxel/estimates/pipeline.h"
#include "server/voxel/gl/occupancy/tile_device.h"

namespace voxeld {

// The size of the buffer of sums: 2 million voxels with all channels. A tile with more voxels is
// summed in several runs.
inline constexpr size_t kSumsBytesMax = size_t{64} << 20;

class AttributePass {
 public:
  AttributePass(TileDevice& device, gpu::ShaderLibrary& shaders)
      : device_(&device), shaders_(&shaders) {}

  // Uploads the levels of the scene's images that triangles use. textures_key is
  // VoxelizePlan::textures_key; what was uploaded for the same key is used again.
  Status begin_job(const Scene& scene, const AttributeRecords& records,
                   const AttributeChannels& channels, uint64_t textures_key);
  // Sets the channels that the following runs sum: the job's or fewer.
  void set_channels(const AttributeChannels& channels) { channels_ = channels; }
  // Frees the images, unless they are shared by frames.
  void end_job() {
    if (textures_key_ == 0) textures_.clear();
  }
  void end_frames() {
    textures_.clear();
    textures_key_ = 0;
  }

  // word_offsets: number of each mask word's first voxel, for the words of `blocks`.
  Status begin_tile(std::span<const uint32_t> word_offsets, uint64_t blocks);
  // The most voxels that one run can sum.
  size_t voxels_max() const;
  // The following run() calls sum voxels [first, first + count), starting from 0.
  Status begin_voxels(size_t first, size_t count);
  // words: AttributeRecords::fill() of the window, which must be the uploaded one.
  Status run(const TileWindow& window, std::span<const uint32_t> words, Pipeline pipeline);
  // Reads channels.count() words per voxel. `carries` stays empty if no sum carried.
  void read(std::vector<uint32_t>& sums, std::vector<uint32_t>& carries);

  int64_t bytes() const;

 private:
  Status upload_textures(const Scene& scene, const AttributeRecords& records);
  Status run_image(const TileWindow& window, int image, Pipeline pipeline);
  gpu::Defines defines(bool textured) const;
  void bind() const;

  TileDevice* device_;
  gpu::ShaderLibrary* shaders_;
  gpu::Buffer attributes_, word_offsets_, sums_, carries_, linear_;
  std::vector<gpu::Texture2D> textures_;  // per image of the scene; empty where unused
  uint64_t textures_key_ = 0;             // key of textures_; 0: none
  bool is_summing_ = false;               // sums were begun and not read: carries_ may not be 0
  AttributeChannels channels_;
  shared::VoxelizeParams params_;
};

}  // namespace voxeld
