// The pass that moves the vertices of an animation's frame and snaps them: skin_vertices() and the
// vertices of snap_scene(), bit for bit (shaders/skin.comp). What vertices follow is uploaded once
// for all frames; a frame costs its matrices and morph weights.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "server/gpu/objects.h"
#include "server/gpu/pass_timer.h"
#include "server/gpu/shader_library.h"
#include "server/voxel/device_skin.h"
#include "shaders/shared/skin.h"

namespace voxeld {

// One thread: the context's.
class SkinPass {
 public:
  SkinPass(const gpu::Context& context, gpu::ShaderLibrary& shaders)
      : context_(&context), shaders_(&shaders) {}

  // Whether buffers of `storage_bytes`, and loops, are large enough for the table.
  static bool fits(const SkinTable& table, int64_t storage_bytes);
  // Whether this device's arithmetic is the CPU's: OpenGL leaves a lot open, so it is tried, once,
  // on the vertices of skin_check.h. A driver that refuses the shaders is none that has it.
  Result<bool> is_exact();

  // Uploads the table, but under the key of the last one; a key of 0 is nobody's.
  Status begin_frames(const SkinTable& table, uint64_t key);
  // Frees what belongs to the table.
  void end_frames();

  // Writes q of each vertex of the frame's table, that of the last begin_frames(), to `vertices`
  // (12 bytes each). True: all stand in cells of the grid and at finite places. Waits for the
  // device. Pass "skin" of the timer.
  Result<bool> run(const SkinFrame& frame, const gpu::Buffer& vertices, gpu::PassTimer& timer);
  // Of the last run(), where the frame wanted them.
  void read_positions(size_t first, std::span<glm::dvec3> positions) const;

  // Of the last run(), and of the begin_frames() before it if that uploaded the table.
  int64_t uploaded_bytes() const { return uploaded_bytes_; }
  // Of all buffers now.
  int64_t bytes() const;

 private:
  template <typename T>
  Status put(gpu::Buffer& buffer, const std::vector<T>& values, const char* label);
  Result<const gpu::Program*> program() const;
  Status upload_frame(const SkinFrame& frame);
  void bind(const gpu::Buffer& vertices) const;

  const gpu::Context* context_;
  gpu::ShaderLibrary* shaders_;
  gpu::Buffer points_, firsts_, influences_, morphs_;  // of the table
  gpu::Buffer frame_, positions_, state_, params_;
  uint64_t key_ = 0;  // of the table; 0: none
  bool is_point_per_influence_ = false, has_morphs_ = false;
  std::vector<double> words_;  // SKIN_FRAME
  int64_t table_bytes_ = 0;    // uploaded, and not yet told
  int64_t uploaded_bytes_ = 0;
  std::optional<bool> is_exact_;
};

}  // namespace voxeld
