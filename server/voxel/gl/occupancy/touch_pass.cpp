#include "server/voxel/gl/occupancy/touch_pass.h"

namespace voxeld {

gpu::Defines touch_rule_defines(Rule rule) {
  if (rule == Rule::kThin) return {{"RULE_THIN", "1"}};
  if (rule == Rule::kCenter) return {{"RULE_CENTER", "1"}};
  return {};
}

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
  gpu::Defines always = touch_rule_defines(rule);
  if (!has_int64_) always.emplace_back("NO_INT64", "1");
  if (pipeline == Pipeline::kRaster) {
    VOXELD_ASSIGN(
        const gpu::Program* program,
        shaders_->get({{"voxelize.vert"}, {"voxelize.geom"}, {"voxelize_touch.frag"}}, always));
    VOXELD_TRY(device_->run_triangles(*program, 0, window.triangle_count(), {}));
    return device_->context().check("finding touched cells");
  }
  // Ranges of one class are consecutive, whatever their images, so one dispatch takes them all.
  for (size_t r = 0; r < window.ranges.size();) {
    const TouchClass touch_class = window.ranges[r].touch_class;
    const size_t first = window.ranges[r].first;
    size_t count = 0;
    for (; r < window.ranges.size() && window.ranges[r].touch_class == touch_class; ++r) {
      count += window.ranges[r].count;
    }
    // Only rule touch takes all cells of a row. Other rules test such triangles like other small
    // ones.
    const bool is_tested = rule != Rule::kTouch && touch_class == TouchClass::kRows;
    const TouchClass program_class = is_tested ? TouchClass::kSmall : touch_class;
    gpu::Defines defines;
    // The shader's default is two words, so no define is needed for them.
    if (has_int64_ || program_class != TouchClass::kLarge) {
      defines = touch_class_defines(program_class);
    }
    defines.insert(defines.end(), always.begin(), always.end());
    VOXELD_ASSIGN(const gpu::Program* program, shaders_->get({{"voxelize_touch.comp"}}, defines));
    VOXELD_TRY(device_->run_items(*program, first, count, {}));
  }
  return device_->context().check("finding touched cells");
}

}  // namespace voxeld
