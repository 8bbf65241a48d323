// The ray march without a GL context.
#pragma once

#include <vector>

#include "server/render/packed_grid.h"
#include "server/render/render.h"

namespace voxeld {

// Runs the text of shaders/raymarch.frag, compiled as C++, on all cores. Memory is its only limit.
class CpuRenderer final : public Renderer {
 public:
  // threads: 0 means one per hardware thread.
  explicit CpuRenderer(int threads = 0);

  Status set_grid(const Grid& grid) override;
  Result<RenderImage> render(const RenderOptions& options, const BlockProgress& progress) override;
  void set_quality(const RenderQuality& quality) override;
  Result<std::vector<Hit>> render_hits(const RenderOptions& options) override;

 private:
  template <typename DrawRow>
  void for_each_row(int first, int count, const DrawRow& draw_row) const;

  const int threads_;
  RenderQuality quality_;
  PackedGrid grid_;
};

}  // namespace voxeld
