#include "server/render/cpu/raymarch_pixel.h"

#include <algorithm>
#include <cmath>

#include "server/render/cpu/ray_lanes.h"
#include "shaders/glsl_float.h"

namespace voxeld {
// The namespace is hidden, so that functions can be inlined in spite of -fPIC.
#pragma GCC visibility push(hidden)
// The text is compiled with and without secondary rays, and for outlines. The shader's other
// variants would only save work that SIMD drivers execute for nothing.
#define RAYMARCH_ATTRIBUTES 1
#define RAYMARCH_SMOOTH 1
#define RAYMARCH_LIGHT 0
#define RAYMARCH_GROUND 0
#define RAYMARCH_OUTLINE 0
#define RAYMARCH_LANES 1
namespace raymarch_colors {
using namespace glsl;       // NOLINT(google-build-using-namespace)
using namespace ray_lanes;  // NOLINT(google-build-using-namespace)
#include "raymarch_frag.h"
}  // namespace raymarch_colors

#undef RAYMARCH_OUTLINE
#define RAYMARCH_OUTLINE 1
namespace raymarch_outlines {
using namespace glsl;       // NOLINT(google-build-using-namespace)
using namespace ray_lanes;  // NOLINT(google-build-using-namespace)
#include "raymarch_frag.h"
}  // namespace raymarch_outlines

#undef RAYMARCH_OUTLINE
#define RAYMARCH_OUTLINE 0
#undef RAYMARCH_LIGHT
#define RAYMARCH_LIGHT 1
#undef RAYMARCH_GROUND
#define RAYMARCH_GROUND 1
namespace raymarch_lit_colors {
using namespace ray_lanes;  // NOLINT(google-build-using-namespace)
using namespace glsl;       // NOLINT(google-build-using-namespace)
#include "raymarch_frag.h"
}  // namespace raymarch_lit_colors
#undef RAYMARCH_LANES

#define RAYMARCH_HITS 1
namespace raymarch_hits {
using namespace glsl;  // NOLINT(google-build-using-namespace)
#include "raymarch_frag.h"
}  // namespace raymarch_hits
#pragma GCC visibility pop

namespace {

// The shader's parameters have the same bytes under GLM's type names.
template <typename Params>
const Params& params_as(const shared::RaymarchParams& params) {
  static_assert(sizeof(Params) == sizeof(shared::RaymarchParams));
  static_assert(offsetof(Params, image) == offsetof(shared::RaymarchParams, image));
  return reinterpret_cast<const Params&>(params);
}

template <typename Invocation, typename Params>
Invocation bind(const RaymarchBindings& bindings, int x, int y) {
  const PackedGrid& grid = bindings.grid;
  return {.params = params_as<Params>(bindings.params),
          .nodes = grid.nodes.data(),
          .bricks = grid.bricks.data(),
          .colors = grid.colors.data(),
          .normals = grid.normals.data(),
          .gl_FragCoord = {static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f, 0.0f, 1.0f}};
}

// The functions that main() calls are the same in all variants but that with a ground.
using Plain = raymarch_colors::RaymarchInvocation;
using PlainParams = raymarch_colors::RaymarchParams;
using Lit = raymarch_lit_colors::RaymarchInvocation;
using LitParams = raymarch_lit_colors::RaymarchParams;
using Outlines = raymarch_outlines::RaymarchInvocation;
using OutlinesParams = raymarch_outlines::RaymarchParams;

}  // namespace

struct [[gnu::visibility("hidden")]] RaymarchPixels::Impl {
  explicit Impl(const RaymarchBindings& all)
      : bindings(all),
        lanes(all.kernel),
        plain(lanes, invocation<Plain, PlainParams>(0, 0)),
        lit(lanes, invocation<Lit, LitParams>(0, 0)) {}

  template <typename Invocation, typename Params>
  Invocation invocation(int x, int y) {
    Invocation made = bind<Invocation, Params>(bindings, x, y);
    made.lanes = &lanes;
    return made;
  }

  const RaymarchBindings bindings;
  ray_lanes::PixelLanes lanes;
  ray_lanes::SampleRays<Plain, false> plain;
  ray_lanes::SampleRays<Lit, true> lit;
};

RaymarchPixels::RaymarchPixels(const RaymarchBindings& bindings)
    : impl_(std::make_unique<Impl>(bindings)) {}
RaymarchPixels::~RaymarchPixels() = default;

void RaymarchPixels::seen(int x, int y, int count, glm::vec4* sums) {
  if (impl_->bindings.variant.outline) {
    for (int i = 0; i < count; ++i) {
      sums[i] = impl_->invocation<Outlines, OutlinesParams>(x + i, y).seen_in_pixel();
    }
  } else if (impl_->bindings.variant.light) {
    impl_->lit.find([&](int i) { return impl_->invocation<Lit, LitParams>(x + i, y); }, count,
                    sums);
  } else {
    impl_->plain.find([&](int i) { return impl_->invocation<Plain, PlainParams>(x + i, y); }, count,
                      sums);
  }
}

float RaymarchPixels::ground(int x, int y) {
  Lit invocation = impl_->invocation<Lit, LitParams>(x, y);
  return invocation.ground_at(glm::vec2(invocation.gl_FragCoord));
}

std::array<uint8_t, 4> RaymarchPixels::color(int x, int y, const glm::vec4& seen,
                                             float ground) const {
  Plain invocation = bind<Plain, PlainParams>(impl_->bindings, x, y);
  const glm::vec4 color = invocation.over_background(invocation.with_ground(seen, ground));
  std::array<uint8_t, 4> rgba{};
  for (int i = 0; i < 4; ++i) {
    const float value = std::clamp(color[i], 0.0f, 1.0f);
    rgba[static_cast<size_t>(i)] = static_cast<uint8_t>(std::floor(255.0f * value + 0.5f));
  }
  return rgba;
}

Hit raymarch_hit(const RaymarchBindings& bindings, int x, int y) {
  using namespace raymarch_hits;  // NOLINT(google-build-using-namespace)
  auto invocation = bind<RaymarchInvocation, RaymarchParams>(bindings, x, y);
  invocation.main();
  return {{invocation.out_hit.x, invocation.out_hit.y, invocation.out_hit.z}, invocation.out_hit.w};
}

}  // namespace voxeld
