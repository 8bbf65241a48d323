#include "server/voxel/cpu/attribute_visitor.h"

#include <algorithm>
#include <bit>

#include "proto/codec/sparse_tile.h"
#include "server/grid/color_tables.h"
#include "server/voxel/attributes/nearest_point.h"
#include "shaders/glsl.h"

namespace voxeld {
// The namespace has a name because not every function in it is used. It is hidden, so that
// functions can be inlined in spite of -fPIC.
#pragma GCC visibility push(hidden)
namespace attribute_visitor {

using namespace glsl;  // NOLINT(google-build-using-namespace)
#include "shaders/lib/attribute_polygon.glsl"
#include "shaders/lib/attributes.glsl"
#include "shaders/lib/touch.glsl"

}  // namespace attribute_visitor
#pragma GCC visibility pop

namespace {

using namespace attribute_visitor;  // NOLINT(google-build-using-namespace)
using glm::ivec2;
using glm::ivec3;
using glm::uvec3;
using glm::uvec4;

constexpr size_t kNone = SIZE_MAX;

// The voxel's number in the box. kNone if the cell is touched but not occupied, under a rule other
// than touch. m: the cell's Morton code in the tile.
size_t voxel_at(const AttributeTarget& target, uint32_t m) {
  const uint32_t word = target.mask[m >> 5], bit = 1u << (m & 31u);
  if ((word & bit) == 0) return kNone;
  const uint32_t below = word & (bit - 1u);
  const size_t voxel = target.word_offsets[m >> 5] + static_cast<uint32_t>(std::popcount(below));
  return voxel - target.voxel_first;
}

class Visitor {
 public:
  Visitor(const AttributeSource& source, const AttributeTarget& target)
      : source_(source), target_(target), flags_(source.words[ATTRIBUTE_FLAGS]) {}

  void run() {
    const ivec3 v0 = touch_swizzle(source_.corners[0], source_.axis);
    const ivec3 v1 = touch_swizzle(source_.corners[1], source_.axis);
    const ivec3 v2 = touch_swizzle(source_.corners[2], source_.axis);
    TouchTriangle t = touch_setup(v0, v1, v2, touch_swizzle(target_.cell_last, source_.axis));
    t.cell_min = glm::max(t.cell_min, touch_swizzle(target_.cell_first, source_.axis));
    if (t.cell_min.x > t.cell_max.x || t.cell_min.y > t.cell_max.y || t.cell_min.z > t.cell_max.z) {
      return;
    }
    const uint32_t* words = source_.words;
    const auto reciprocal = static_cast<int64_t>(uint64_t{words[ATTRIBUTE_RECIPROCAL]} |
                                                 uint64_t{words[ATTRIBUTE_RECIPROCAL + 1]} << 32);
    shape_ = attribute_setup(v0, v1, v2, static_cast<int>(words[ATTRIBUTE_SLOPE_I]),
                             static_cast<int>(words[ATTRIBUTE_SLOPE_J]), reciprocal, flags_);
    if (target_.channels.color) read_corners(ATTRIBUTE_COLORS, colors_);
    if (target_.channels.normal) read_corners(ATTRIBUTE_NORMALS, normals_);
    visit(t);
  }

 private:
  void read_corners(size_t word, std::array<uvec4, 3>& out) const {
    for (uvec4& corner : out) {
      const uint32_t low = source_.words[word++], high = source_.words[word++];
      corner = uvec4(low & 0xffffu, low >> 16, high & 0xffffu, high >> 16);
    }
  }

  void visit(const TouchTriangle& t) {
    const float slope = -static_cast<float>(t.normal.x) * t.inverse_z;
    for (int j = t.cell_min.y; j <= t.cell_max.y; ++j) {
      const ivec2 span = touch_row_span(t, j, t.cell_min.x, t.cell_max.x);
      int64_t s = touch_height(t, span.x, j);
      const float low = -static_cast<float>(s + t.above) * t.inverse_z;
      const float high = static_cast<float>(t.below - s) * t.inverse_z;
      for (int i = span.x; i <= span.y; ++i, s += t.normal.x) {
        if (!touch_column(t, i, j)) continue;
        const float at = slope * static_cast<float>(i - span.x);
        visit_column(t, i, j, touch_depth(t, s, low + at, high + at));
      }
    }
  }

  void visit_column(const TouchTriangle& t, int i, int j, ivec2 depth) {
    if (depth.x > depth.y) return;
    const CellPolygon column = column_polygon(shape_, i, j);
    const int64_t plane = column_depth_at(shape_, i, j);
    for (int k = depth.x; k <= depth.y; ++k) {
      if (!touch_sides(t, i, j, k)) continue;
      const size_t voxel = voxel_at(target_, morton_at(i, j, k));
      if (voxel == kNone) continue;
      if (target_.nearest != nullptr) {
        compare(target_.nearest[voxel], i, j, k);
        continue;
      }
      add(target_.sums + voxel * target_.channels.count(), i, j,
          cell_polygon(shape_, column, plane, k));
    }
  }

  // z of the swizzled cell is the dominant axis.
  uint32_t morton_at(int i, int j, int k) const {
    const int axis = source_.axis;
    return morton_spread(static_cast<uint32_t>(i)) << (axis + 1) % 3 |
           morton_spread(static_cast<uint32_t>(j)) << (axis + 2) % 3 |
           morton_spread(static_cast<uint32_t>(k)) << axis;
  }

  // Keeps the colour that is nearer to the cell's centre. The smaller colour wins a tie.
  void compare(NearestColor& best, int i, int j, int k) const {
    ivec3 cell;
    cell[(source_.axis + 1) % 3] = i;
    cell[(source_.axis + 2) % 3] = j;
    cell[source_.axis] = k;
    std::array<glm::dvec3, 3> corners;
    for (size_t c = 0; c < 3; ++c) {
      corners[c] = glm::dvec3(2 * source_.corners[c] + 1 - (512 * cell + 256));
    }
    const NearestPoint point = nearest_point(corners);
    if (point.squared > best.squared) return;
    const uvec4 color = color_at(point.weights);
    NearestColor found{point.squared, {}};
    for (int c = 0; c < 4; ++c) {
      found.linear16[static_cast<size_t>(c)] = static_cast<uint16_t>(color[c]);
    }
    if (point.squared < best.squared || found.linear16 < best.linear16) best = found;
  }

  uvec4 times_texel(const ivec3& weights, const uvec4& texel) const {
    uvec4 color = blend(colors_, weights);
    for (int c = 0; c < 4; ++c) color[c] = product16(color[c], texel[c]);
    return color;
  }

  // The colour at the weights, from a single sample.
  uvec4 color_at(const ivec3& weights) const {
    if (source_.levels.empty() || is_flat()) return blend(colors_, weights);
    return times_texel(weights, sample_tap(weights, level_max()));
  }

  // The mean colour over the polygon of column (i, j). weights: those at its centroid.
  uvec4 mean_color(const ivec3& weights, int i, int j, const CellPolygon& polygon,
                   uint32_t twice_area) const {
    if (source_.levels.empty() || is_flat()) return blend(colors_, weights);
    return times_texel(weights, sample_texture(weights, i, j, polygon, twice_area));
  }

  void add(uint64_t* sums, int i, int j, const CellPolygon& polygon) const {
    const uint32_t twice_area = twice_polygon_area(polygon);
    const uint32_t in_one_cell = source_.words[ATTRIBUTE_WEIGHT];
    const uint32_t weight = in_one_cell != 0 ? in_one_cell : area_weight(shape_, twice_area);
    *sums++ += weight;
    if (!target_.channels.color && !target_.channels.normal) return;
    // The corners of a flat triangle have equal attributes, so any weights will do.
    const ivec3 weights =
        is_flat() ? ivec3(1 << ATTRIBUTE_WEIGHT_BITS, 0, 0)
                  : corner_weights(shape_, sample_position(shape_, i, j, polygon, twice_area));
    if (target_.channels.color) {
      const uvec4 color = mean_color(weights, i, j, polygon, twice_area);
      const int channels = target_.channels.alpha ? 4 : 3;
      for (int c = 0; c < channels; ++c) *sums++ += uint64_t{weight} * color[c];
    }
    if (target_.channels.normal) {
      const uvec4 normal = blend(normals_, weights);
      for (int c = 0; c < 3; ++c) *sums++ += uint64_t{weight} * normal[c];
    }
  }

  static uvec4 blend(const std::array<uvec4, 3>& corners, const ivec3& weights) {
    const uvec3 w = weights15(weights);
    return (corners[0] * w.x + corners[1] * w.y + corners[2] * w.z) >> 15u;
  }

  static const uint8_t* texel_at(const MipLevel& level, int x, int y) {
    return &level.rgba[size_t{4} * (static_cast<size_t>(level.width) * static_cast<size_t>(y) +
                                    static_cast<size_t>(x))];
  }

  bool is_flat() const { return ((flags_ >> ATTRIBUTE_FLAT_SHIFT) & 1u) != 0; }

  int level_max() const { return static_cast<int>((flags_ >> ATTRIBUTE_LEVEL_SHIFT) & 15u); }

  // Same steps as lib/attribute_visit.glsl, whose comments explain them.
  uvec4 sample_texture(const ivec3& weights, int i, int j, const CellPolygon& polygon,
                       uint32_t twice_area) const {
    if (twice_area == 0) return sample_tap(weights, level_max());
    const int level = part_level(twice_area, level_max());
    if (tap_fits(weights, level)) return sample_tap(weights, level);
    const ivec3 first = weights_in_column(shape_, i, j, polygon_point(polygon.points[0]));
    ivec3 last = weights_in_column(shape_, i, j, polygon_point(polygon.points[1]));
    uint32_t done = 0;
    uvec4 sum(1u << 14);
    for (int n = 1; n + 1 < polygon.count; ++n) {
      const ivec3 next = weights_in_column(shape_, i, j, polygon_point(polygon.points[n + 1]));
      const uint32_t area = twice_fan_area(polygon, n);
      const uint32_t share = area_share(done + area, twice_area) - area_share(done, twice_area);
      done += area;
      if (share != 0) sum += sample_fan(first, last, next, area) * share;
      last = next;
    }
    return sum >> 15u;
  }

  uvec4 sample_fan(const ivec3& a, const ivec3& b, const ivec3& c, uint32_t twice_area) const {
    const int level = part_level(twice_area, level_max());
    const ivec3 centre = centre_weights(a, b, c);
    if (twice_area < TAP_TWICE_AREA_MIN || tap_fits(centre, level)) {
      return sample_tap(centre, level);
    }
    uvec4 sum = sample_tap(centre, level - 1) + 2u;
    for (const ivec3& corner : {a, b, c}) {
      sum += sample_tap(middle_weights(corner, centre), level - 1);
    }
    return sum >> 2u;
  }

  bool tap_fits(const ivec3& weights, int level) const {
    return tap_level(weights, source_.words[ATTRIBUTE_ALTITUDE], level) + 1 >= level;
  }

  // Bilinear sample in linear light. The fraction has 8 bits, so that 65535 * 65536 fits.
  uvec4 sample_tap(const ivec3& weights, int level_max) const {
    const auto uv = [&](int word) { return static_cast<int>(source_.words[ATTRIBUTE_UVS + word]); };
    const int number = tap_level(weights, source_.words[ATTRIBUTE_ALTITUDE], level_max);
    const MipLevel& level = source_.levels[static_cast<size_t>(number)];
    const uint32_t wrap_u = (flags_ >> ATTRIBUTE_WRAP_U_SHIFT) & 3u;
    const uint32_t wrap_v = (flags_ >> ATTRIBUTE_WRAP_V_SHIFT) & 3u;
    const int u = level_coordinate(blend_uv(uv(0), uv(2), uv(4), weights), level.width, wrap_u);
    const int v = level_coordinate(blend_uv(uv(1), uv(3), uv(5), weights), level.height, wrap_v);
    const int x0 = wrap_texel(u >> 8, level.width, wrap_u);
    const int x1 = wrap_texel((u >> 8) + 1, level.width, wrap_u);
    const int y0 = wrap_texel(v >> 8, level.height, wrap_v);
    const int y1 = wrap_texel((v >> 8) + 1, level.height, wrap_v);
    const std::array<const uint8_t*, 4> texels = {texel_at(level, x0, y0), texel_at(level, x1, y0),
                                                  texel_at(level, x0, y1), texel_at(level, x1, y1)};
    const auto fx = static_cast<uint32_t>(u & 255), fy = static_cast<uint32_t>(v & 255);
    const std::array<uint32_t, 4> shares = {(256u - fx) * (256u - fy), fx * (256u - fy),
                                            (256u - fx) * fy, fx * fy};
    uvec4 sum(0);
    for (size_t t = 0; t < 4; ++t) {
      for (int c = 0; c < 3; ++c) sum[c] += linear_[texels[t][c]] * shares[t];
    }
    if (target_.channels.alpha) {
      for (size_t t = 0; t < 4; ++t) sum.w += texels[t][3] * 257u * shares[t];
    }
    return sum >> 16u;
  }

  const AttributeSource& source_;
  const AttributeTarget& target_;
  uint32_t flags_;
  const std::array<uint32_t, 256>& linear_ = linear16_from_srgb8();
  AttributeTriangle shape_{};
  std::array<uvec4, 3> colors_{}, normals_{};
};

}  // namespace

void add_attributes(const AttributeSource& source, const AttributeTarget& target) {
  Visitor(source, target).run();
}

void add_one_cell(const OneCellSource& source, const AttributeTarget& target) {
  const ivec3& cell = source.cell;
  const size_t voxel =
      voxel_at(target, morton_encode(static_cast<uint32_t>(cell.x), static_cast<uint32_t>(cell.y),
                                     static_cast<uint32_t>(cell.z)));
  if (voxel == kNone) return;
  uint64_t* sums = target.sums + voxel * target.channels.count();
  *sums++ += source.weight;
  if (!target.channels.color) return;
  const size_t channels = target.channels.alpha ? 4 : 3;
  for (size_t c = 0; c < channels; ++c) *sums++ += uint64_t{source.weight} * source.linear16[c];
}

}  // namespace voxeld
