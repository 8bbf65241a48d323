#include "server/voxel/gl/touch_pass.h"

namespace voxeld {
namespace {

gpu::Defines rule_defines(Rule rule) {
  if (rule == Rule::kThin) return {{"RULE_THIN", "1"}};
  if (rule == Rule::kCenter) return {{"RULE_CENTER", "1"}};
  return {};
}

}  // namespace

gpu::Defines touch_class_defines(TouchClass touch_class) {
  switch (touch_class) {
    case TouchClass::kRows:
      return {{"TOUCH_ROWS", "1"}};
    case TouchClass::kSmall:
      return {{"TOUCH_INT", "int"}, {"TOUCH_INT3", "ivec3"}};
    case TouchClass::kLarge:
      break;
  }
  return {{"TOUCH_INT", "int64_t"}, {"TOUCH_INT3", "i64vec3"}};
}

Status TouchPass::run(const TileWindow& window, Pipeline pipeline, Rule rule) {
  if (rule == Rule::kNone) return {};
  if (pipeline == Pipeline::kRaster) {
    VOXELD_ASSIGN(const gpu::Program* program,
                  shaders_->get({{"voxelize.vert"}, {"voxelize.geom"}, {"voxelize_touch.frag"}},
                                rule_defines(rule)));
    VOXELD_TRY(device_->run_triangles(*program, 0, window.triangle_count(), {}));
    return device_->context().check("finding touched cells");
  }
  // Ranges of one class lie side by side, whatever their images: one dispatch takes them all.
  for (size_t r = 0; r < window.ranges.size();) {
    const TouchClass touch_class = window.ranges[r].touch_class;
    const size_t first = window.ranges[r].first;
    size_t count = 0;
    for (; r < window.ranges.size() && window.ranges[r].touch_class == touch_class; ++r) {
      count += window.ranges[r].count;
    }
    // By other rules than touch, triangles in one row of cells are tested like other small ones.
    const bool is_tested = rule != Rule::kTouch && touch_class == TouchClass::kRows;
    gpu::Defines defines = touch_class_defines(is_tested ? TouchClass::kSmall : touch_class);
    for (const auto& define : rule_defines(rule)) defines.push_back(define);
    VOXELD_ASSIGN(const gpu::Program* program, shaders_->get({{"voxelize_touch.comp"}}, defines));
    device_->run_items(*program, first, count, {});
  }
  return device_->context().check("finding touched cells");
}

}  // namespace voxeld
