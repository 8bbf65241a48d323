#include "server/render/cpu/raymarch_pixel.h"

#include <algorithm>
#include <cmath>

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
namespace raymarch_colors {
using namespace glsl;  // NOLINT(google-build-using-namespace)
#include "raymarch_frag.h"
}  // namespace raymarch_colors

#undef RAYMARCH_OUTLINE
#define RAYMARCH_OUTLINE 1
namespace raymarch_outlines {
using namespace glsl;  // NOLINT(google-build-using-namespace)
#include "raymarch_frag.h"
}  // namespace raymarch_outlines

#undef RAYMARCH_OUTLINE
#define RAYMARCH_OUTLINE 0
#undef RAYMARCH_LIGHT
#define RAYMARCH_LIGHT 1
#undef RAYMARCH_GROUND
#define RAYMARCH_GROUND 1
namespace raymarch_lit_colors {
using namespace glsl;  // NOLINT(google-build-using-namespace)
#include "raymarch_frag.h"
}  // namespace raymarch_lit_colors

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

template <typename Invocation, typename Params>
std::array<uint8_t, 4> color_of(const RaymarchBindings& bindings, int x, int y) {
  auto invocation = bind<Invocation, Params>(bindings, x, y);
  invocation.main();
  std::array<uint8_t, 4> rgba{};
  for (int i = 0; i < 4; ++i) {
    const float value = std::clamp(invocation.out_color[i], 0.0f, 1.0f);
    rgba[static_cast<size_t>(i)] = static_cast<uint8_t>(std::floor(255.0f * value + 0.5f));
  }
  return rgba;
}

}  // namespace

std::array<uint8_t, 4> raymarch_color(const RaymarchBindings& bindings, int x, int y) {
  if (bindings.variant.outline) {
    using namespace raymarch_outlines;  // NOLINT(google-build-using-namespace)
    return color_of<RaymarchInvocation, RaymarchParams>(bindings, x, y);
  }
  if (bindings.variant.light || bindings.variant.ground) {
    using namespace raymarch_lit_colors;  // NOLINT(google-build-using-namespace)
    return color_of<RaymarchInvocation, RaymarchParams>(bindings, x, y);
  }
  using namespace raymarch_colors;  // NOLINT(google-build-using-namespace)
  return color_of<RaymarchInvocation, RaymarchParams>(bindings, x, y);
}

Hit raymarch_hit(const RaymarchBindings& bindings, int x, int y) {
  using namespace raymarch_hits;  // NOLINT(google-build-using-namespace)
  auto invocation = bind<RaymarchInvocation, RaymarchParams>(bindings, x, y);
  invocation.main();
  return {{invocation.out_hit.x, invocation.out_hit.y, invocation.out_hit.z}, invocation.out_hit.w};
}

}  // namespace voxeld
