#include "server/render/cpu/cpu_renderer.h"

#include <algorithm>
#include <utility>

#include "server/base/cancel_point.h"
#include "server/base/check.h"
#include "server/base/parallel.h"
#include "server/render/cpu/ground_cells.h"
#include "server/render/cpu/raymarch_pixel.h"
#include "server/render/image_blocks.h"
#include "server/render/raymarch_params.h"
#include "server/render/silhouette.h"

namespace voxeld {

CpuRenderer::CpuRenderer(int threads, CpuIsa isa)
    : threads_(threads > 0 ? threads : static_cast<int>(ThreadPool::shared().threads())),
      kernel_(march_kernel(isa)) {
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

// Rows differ much in cost, so each thread takes the next remaining ones.
template <typename DrawRows>
void CpuRenderer::for_each_rows(int count, int height, const DrawRows& draw_rows) const {
  parallel_for(
      static_cast<size_t>((height + count - 1) / count),
      [&](size_t part) {
        const int first = static_cast<int>(part) * count;
        draw_rows(first, std::min(count, height - first));
      },
      static_cast<size_t>(threads_));
}

Result<RenderImage> CpuRenderer::render(const RenderOptions& options,
                                        const BlockProgress& progress) {
  VOXELD_ASSIGN(const shared::RaymarchParams params,
                raymarch_params(grid_, options, wanted_samples(options, quality_)));
  const RaymarchBindings bindings{params, grid_, raymarch_variant(grid_, options), kernel_};
  RenderImage image{options.width, options.height,
                    std::vector<uint8_t>(size_t{4} * options.width * options.height)};
  const Subject subject = subject_of(grid_);
  const Silhouette silhouette(make_camera(options, subject), subject, options.width,
                              options.height);
  const float samples = static_cast<float>(params.box_high.w * params.box_high.w);
  // A band of a block's rows.
  const auto draw_band = [&](int left, int bottom, int width, int rows) {
    std::vector<glm::vec4> seen(static_cast<size_t>(width) * rows);
    RaymarchPixels pixels(bindings);
    GroundCells ground(width);
    ground.begin();
    for (int row = 0; row < rows; ++row) {
      cancel_point();
      glm::vec4* const sums = &seen[static_cast<size_t>(row) * width];
      const auto [first, end] = silhouette.row(bottom + row);
      const int begin = std::max(first - left, 0), count = std::min(end - left, width) - begin;
      if (count > 0) pixels.seen(left + begin, bottom + row, count, sums + begin);
      for (int x = 0; bindings.variant.ground && x < width; ++x) {
        if (sums[x].w < samples) ground.want(x, row);
      }
    }
    ground.find([&](int x, int row) {
      cancel_point();
      return pixels.ground(left + x, bottom + row);
    });
    for (int row = 0; row < rows; ++row) {
      const size_t y = static_cast<size_t>(options.height - 1 - bottom - row);
      for (int x = 0; x < width; ++x) {
        const glm::vec4& sum = seen[static_cast<size_t>(row) * width + x];
        const float darkness = ground.is_wanted(x, row) ? ground.value(x, row) : 0.0f;
        const auto rgba = pixels.color(left + x, bottom + row, sum, darkness);
        std::ranges::copy(rgba, &image.rgba[4 * (y * options.width + left + x)]);
      }
    }
  };
  VOXELD_TRY(for_each_block(options.width, options.height, kImageBlockSide, progress,
                            [&](int left, int bottom, int width, int height) -> Status {
                              for_each_rows(GroundCells::kSide, height, [&](int first, int rows) {
                                draw_band(left, bottom + first, width, rows);
                              });
                              return {};
                            }));
  return image;
}

Result<std::vector<Hit>> CpuRenderer::render_hits(const RenderOptions& options) {
  VOXELD_ASSIGN(const shared::RaymarchParams params, raymarch_params(grid_, options, 1));
  const RaymarchBindings bindings{params, grid_, {}, kernel_};
  std::vector<Hit> hits(static_cast<size_t>(options.width) * options.height);
  for_each_rows(1, options.height, [&](int y, int) {
    const size_t row = static_cast<size_t>(options.height - 1 - y) * options.width;
    for (int x = 0; x < options.width; ++x) hits[row + x] = raymarch_hit(bindings, x, y);
  });
  return hits;
}

}  // namespace voxeld
