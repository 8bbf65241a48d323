// The ray march as a fragment shader.
#pragma once

#include <memory>
#include <vector>

#include "server/gpu/context.h"
#include "server/gpu/shader_library.h"
#include "server/render/render.h"

namespace voxeld {

// A renderer on a GL context. Only the context's thread may use it.
class GlRenderer final : public Renderer {
 public:
  GlRenderer(gpu::Context& context, gpu::ShaderLibrary& shaders);
  ~GlRenderer() override;

  Status set_grid(const Grid& grid) override;
  size_t table_bytes_max() const override;
  size_t device_bytes() const override;
  Result<RenderImage> render(const RenderOptions& options, const BlockProgress& progress) override;
  void set_quality(const RenderQuality& quality) override;
  Result<std::vector<Hit>> render_hits(const RenderOptions& options) override;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace voxeld
