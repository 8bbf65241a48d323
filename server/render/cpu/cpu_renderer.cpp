#include "server/render/cpu/cpu_renderer.h"

#include <algorithm>
#include <utility>

#include "proto/thread_pool.h"
#include "server/base/check.h"
#include "server/render/cpu/raymarch_pixel.h"
#include "server/render/image_blocks.h"
#include "server/render/raymarch_params.h"

namespace voxeld {

CpuRenderer::CpuRenderer(int threads)
    : threads_(threads > 0 ? threads : static_cast<int>(ThreadPool::shared().threads())) {
  VOXELD_CHECK(set_grid(Grid{}).ok(), "an empty grid can be packed");
}

void CpuRenderer::set_quality(const RenderQuality& quality) {
  VOXELD_CHECK(quality.samples_per_side >= 1 && quality.samples_per_side <= 4,
               "samples_per_side is 1 to 4");
  quality_ = quality;
}

Status CpuRenderer::set_grid(const Grid& grid) {
  VOXELD_ASSIGN(grid_, pack_grid(grid));
  return {};
}

// Rows differ much in cost, so each thread takes the next remaining row.
template <typename DrawRow>
void CpuRenderer::for_each_row(int first, int count, const DrawRow& draw_row) const {
  ThreadPool::shared().for_each(
      static_cast<size_t>(count), [&](size_t row) { draw_row(first + static_cast<int>(row)); },
      static_cast<size_t>(threads_));
}

Result<RenderImage> CpuRenderer::render(const RenderOptions& options,
                                        const BlockProgress& progress) {
  VOXELD_ASSIGN(const shared::RaymarchParams params,
                raymarch_params(grid_, options, wanted_samples(options, quality_)));
  const RaymarchBindings bindings{params, grid_, raymarch_variant(grid_, options)};
  RenderImage image{options.width, options.height,
                    std::vector<uint8_t>(size_t{4} * options.width * options.height)};
  VOXELD_TRY(for_each_block(
      options.width, options.height, progress,
      [&](int left, int bottom, int width, int height) -> Status {
        for_each_row(bottom, height, [&](int y) {
          const size_t row = static_cast<size_t>(options.height - 1 - y) * options.width + left;
          for (int x = 0; x < width; ++x) {
            const auto rgba = raymarch_color(bindings, left + x, y);
            std::copy(rgba.begin(), rgba.end(), &image.rgba[4 * (row + x)]);
          }
        });
        return {};
      }));
  return image;
}

Result<std::vector<Hit>> CpuRenderer::render_hits(const RenderOptions& options) {
  VOXELD_ASSIGN(const shared::RaymarchParams params, raymarch_params(grid_, options, 1));
  const RaymarchBindings bindings{params, grid_, {}};
  std::vector<Hit> hits(static_cast<size_t>(options.width) * options.height);
  for_each_row(0, options.height, [&](int y) {
    const size_t row = static_cast<size_t>(options.height - 1 - y) * options.width;
    for (int x = 0; x < options.width; ++x) hits[row + x] = raymarch_hit(bindings, x, y);
  });
  return hits;
}

}  // namespace voxeld
