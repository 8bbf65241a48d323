// Shader programs: sources embedded at build time (or read from --shader-dir), with #include
// resolved, compiled and cached. Parameters go through uniform buffers, because default-block
// uniforms are stale on Zink over lavapipe.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/result.h"
#include "server/gpu/context.h"
#include "server/gpu/shader_source.h"

namespace voxeld::gpu {

class Program {
 public:
  Program() = default;
  Program(const Context& context, uint32_t id) : context_(&context), id_(id) {}
  ~Program();
  Program(Program&& other) noexcept;
  Program& operator=(Program&& other) noexcept;
  uint32_t id() const { return id_; }
  void use() const;
  // Runs the given number of work groups in x. More than dispatch_groups_max are folded into y: the
  // shader computes group = gl_WorkGroupID.x + gl_WorkGroupID.y * gl_NumWorkGroups.x and checks it
  // against its count.
  void dispatch(int64_t groups) const;
  // Reads work groups in x, y, z from three words of the buffer that Buffer::bind_indirect() bound.
  void dispatch_indirect(size_t offset_bytes) const;

 private:
  const Context* context_ = nullptr;
  uint32_t id_ = 0;
};

struct ShaderStage {
  std::string file;  // "voxelize_touch.comp"; the extension is the stage: comp vert geom frag
};

class ShaderLibrary {
 public:
  // shader_dir: empty means the embedded sources.
  explicit ShaderLibrary(const Context& context, std::string shader_dir = "");

  // Compiles a program, or returns the cached one of the same files and defines. NO_INT64
  // (shader_source.h) is added on devices without 64-bit integers. The pointer stays valid as long
  // as the library. Errors: internal with the driver's log, its line numbers mapped back to
  // "raymarch/dda.glsl:17".
  Result<const Program*> get(const std::vector<ShaderStage>& stages, const Defines& defines = {});

  // A hash of all sources, those of other programs included. "sha256-<64 hex>".
  std::string sources_hash() const;

  // Source with #include expanded, as the compiler gets it. Public for tests.
  using Resolved = ResolvedShader;
  Result<Resolved> resolve(std::string_view file, const Defines& defines) const;

 private:
  Result<std::string> read_source(std::string_view name) const;
  Result<uint32_t> compile(const ShaderStage& stage, const Defines& defines) const;
  Result<uint32_t> link(const std::vector<ShaderStage>& stages, const Defines& defines) const;

  const Context* context_;
  std::string shader_dir_;
  std::map<std::string, Program> programs_;
};

}  // namespace voxeld::gpu
