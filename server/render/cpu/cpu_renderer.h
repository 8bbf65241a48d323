// The ray march without a GL context.
#pragma once

#include <vector>

#include "server/render/cpu/kernels/march_kernel.h"
#include "server/render/packed_grid.h"
#include "server/render/render.h"

namespace voxeld {

// Runs the text of shaders/raymarch.frag, compiled as C++, on all cores. Memory is its only limit.
class CpuRenderer final : public Renderer {
 public:
  // threads: 0 means one per hardware thread. Images do not depend on the instruction set.
  explicit CpuRenderer(int threads = 0, CpuIsa isa = best_cpu_isa());

  Status set_grid(const Grid& grid) override;
  Result<RenderImage> render(const RenderOptions& options, const BlockProgress& progress) override;
  void set_quality(const RenderQuality& quality) override;
  Result<std::vector<Hit>> render_hits(const RenderOptions& options) override;

 private:
  // Calls draw_rows(first, rows) for parts of `count` rows, the last one fewer, on all threads.
  template <typename DrawRows>
  void for_each_rows(int count, int height, const DrawRows& draw_rows) const;

  const int threads_;
  const MarchKernel& kernel_;
  RenderQuality quality_;
  PackedGrid grid_;
};

}  // namespace voxeld
