// The pass that moves the vertices of an animation's frame and snaps them. It has the bits of
// skin_vertices() and of the vertices of snap_scene() (shaders/skin.comp). The skinning data is
// uploaded once for all frames; each frame uploads only its matrices and morph weights.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "server/gpu/objects.h"
#include "server/gpu/pass_timer.h"
#include "server/gpu/shader_library.h"
#include "server/voxel/pipelines/device_skin.h"
#include "shaders/shared/skin.h"

namespace voxeld {

// Moves vertices. Only the context's thread may use it.
class SkinPass {
 public:
  SkinPass(const gpu::Context& context, gpu::ShaderLibrary& shaders)
      : context_(&context), shaders_(&shaders) {}

  // True if buffers of `storage_bytes`, and loops, are large enough for the table.
  static bool fits(const SkinTable& table, int64_t storage_bytes);
  // True if this device's arithmetic has the CPU's bits. OpenGL leaves much of it open, so it is
  // tested once, on the vertices of skin_check.h. A driver that refuses the shaders counts as
  // inexact.
  Result<bool> is_exact();

  // Uploads the table, unless `key` is the last one's. A key of 0 matches nothing.
  Status begin_frames(const SkinTable& table, uint64_t key);
  // Frees the table's buffers.
  void end_frames();

  // Writes q of each vertex of the table of the last begin_frames() to `vertices`, 12 bytes each.
  // True if all vertices are finite and in cells of the grid. Waits for the device. Times pass
  // "skin".
  Result<bool> run(const SkinFrame& frame, const gpu::Buffer& vertices, gpu::PassTimer& timer);
  // Reads positions of the last run(), which must have wanted them.
  void read_positions(size_t first, std::span<glm::dvec3> positions) const;

  // Bytes uploaded by the last run(), and by the begin_frames() before it if that uploaded the
  // table.
  int64_t uploaded_bytes() const { return uploaded_bytes_; }
  // Bytes of all buffers now.
  int64_t bytes() const;

 private:
  template <typename T>
  Status put(gpu::Buffer& buffer, const std::vector<T>& values, const char* label);
  Result<const gpu::Program*> program() const;
  Status upload_frame(const SkinFrame& frame);
  void bind(const gpu::Buffer& vertices) const;

  const gpu::Context* context_;
  gpu::ShaderLibrary* shaders_;
  gpu::Buffer points_, firsts_, influences_, morphs_;  // the table's data
  gpu::Buffer frame_, positions_, state_, params_;
  uint64_t key_ = 0;  // key of the table; 0: none
  bool is_point_per_influence_ = false, has_morphs_ = false;
  std::vector<double> words_;  // SKIN_FRAME
  int64_t table_bytes_ = 0;    // uploaded and not yet reported
  int64_t uploaded_bytes_ = 0;
  std::optional<bool> is_exact_;
};

}  // namespace voxeld
