#include "server/voxel/cpu/attribute_visitor.h"

#include <bit>

#include "proto/sparse_tile.h"
#include "server/grid/color_tables.h"
#include "server/voxel/nearest_point.h"
#include "shaders/glsl.h"

namespace voxeld {
// Not unnamed, because not all are used; hidden, so that they can be inlined in spite of -fPIC.
#pragma GCC visibility push(hidden)
namespace attribute_visitor {

using namespace glsl;  // NOLINT(google-build-using-namespace)
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

// In the box; kNone where the cell is touched but not occupied, by another rule than touch. m: the
// cell's Morton code in the tile.
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
    lattice_ = attribute_setup(v0, v1, v2, static_cast<int>(words[ATTRIBUTE_SLOPE_I]),
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
    const uint32_t inside = lattice_inside(lattice_, i, j);
    const int64_t plane = lattice_depth(lattice_, i, j);
    for (int k = depth.x; k <= depth.y; ++k) {
      if (!touch_sides(t, i, j, k)) continue;
      const size_t voxel = voxel_at(target_, morton_at(i, j, k));
      if (voxel == kNone) continue;
      if (target_.nearest != nullptr) {
        compare(target_.nearest[voxel], i, j, k);
        continue;
      }
      const uint32_t points = inside == 0 ? 0 : inside & lattice_in_cell(lattice_, plane, k);
      add(target_.sums + voxel * target_.channels.count(), i, j, points);
    }
  }

  // z of the swizzled cell is the dominant one.
  uint32_t morton_at(int i, int j, int k) const {
    const int axis = source_.axis;
    return morton_spread(static_cast<uint32_t>(i)) << (axis + 1) % 3 |
           morton_spread(static_cast<uint32_t>(j)) << (axis + 2) % 3 |
           morton_spread(static_cast<uint32_t>(k)) << axis;
  }

  // Keeps what is nearer to the cell's centre, and of what is as near the smaller colour.
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
    const uvec4 color = color_at(point.weights, 0, 0, 0);
    NearestColor found{point.squared, {}};
    for (int c = 0; c < 4; ++c) {
      found.linear16[static_cast<size_t>(c)] = static_cast<uint16_t>(color[c]);
    }
    if (point.squared < best.squared || found.linear16 < best.linear16) best = found;
  }

  // points: of column (i, j); with none it is the colour at the weights alone.
  uvec4 color_at(const ivec3& weights, int i, int j, uint32_t points) const {
    uvec4 color = blend(colors_, weights);
    if (source_.levels.empty() || is_flat()) return color;
    const uvec4 texel = sample_texture(weights, i, j, points);
    for (int c = 0; c < 4; ++c) color[c] = product16(color[c], texel[c]);
    return color;
  }

  void add(uint64_t* sums, int i, int j, uint32_t points) const {
    const uint32_t of_points =
        points == 0 ? 1u : static_cast<uint32_t>(std::popcount(points)) * lattice_.factor;
    const uint32_t in_one_cell = source_.words[ATTRIBUTE_WEIGHT];
    const uint32_t weight = in_one_cell != 0 ? in_one_cell : of_points;
    // The corners of a flat triangle are alike: any weights will do.
    const ivec3 weights = is_flat() ? ivec3(1 << ATTRIBUTE_WEIGHT_BITS, 0, 0) : at(i, j, points);
    *sums++ += weight;
    if (target_.channels.color) {
      const uvec4 color = color_at(weights, i, j, points);
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

  static uvec4 linear_texel(const MipLevel& level, int x, int y) {
    const uint8_t* texel =
        &level.rgba[(size_t{4} * static_cast<size_t>(level.width)) * static_cast<size_t>(y) +
                    size_t{4} * static_cast<size_t>(x)];
    const auto& linear = linear16_from_srgb8();
    return {linear[texel[0]], linear[texel[1]], linear[texel[2]], texel[3] * 257u};
  }

  bool is_flat() const { return ((flags_ >> ATTRIBUTE_FLAT_SHIFT) & 1u) != 0; }

  // The mean over a cell's points, as lib/attribute_visit.glsl takes it.
  uvec4 sample_texture(const ivec3& weights, int i, int j, uint32_t points) const {
    const auto level_max = static_cast<int>((flags_ >> ATTRIBUTE_LEVEL_SHIFT) & 15u);
    const auto count = static_cast<uint32_t>(std::popcount(points));
    if (count <= 1 || tap_fits(weights, level_max)) return sample_tap(weights, level_max);
    uvec4 sum(count / 2);
    for (int number = 0; number < 4; ++number) {
      const uint32_t part = tap_points(points, number);
      if (part != 0) sum += sum_quarter(i, j, part, level_max - 1);
    }
    return sum / count;
  }

  uvec4 sum_quarter(int i, int j, uint32_t points, int level_max) const {
    const ivec3 weights = at(i, j, points);
    const auto count = static_cast<uint32_t>(std::popcount(points));
    if (count == 1 || tap_fits(weights, level_max)) return sample_tap(weights, level_max) * count;
    uvec4 sum(0);
    for (uint32_t rest = points; rest != 0; rest &= rest - 1) {
      sum += sample_tap(at(i, j, rest & (~rest + 1)), level_max - 1);
    }
    return sum;
  }

  bool tap_fits(const ivec3& weights, int level_max) const {
    return tap_level(weights, source_.words[ATTRIBUTE_ALTITUDE], level_max) + 1 >= level_max;
  }

  // Weights of the corners at the mean of points of column (i, j).
  ivec3 at(int i, int j, uint32_t points) const {
    return corner_weights(lattice_, sample_position(lattice_, i, j, points));
  }

  // Bilinear in linear light, 8 bits of fraction, so that 65535 * 65536 fits.
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
    const auto fx = static_cast<uint32_t>(u & 255), fy = static_cast<uint32_t>(v & 255);
    const uvec4 sum = linear_texel(level, x0, y0) * ((256u - fx) * (256u - fy)) +
                      linear_texel(level, x1, y0) * (fx * (256u - fy)) +
                      linear_texel(level, x0, y1) * ((256u - fx) * fy) +
                      linear_texel(level, x1, y1) * (fx * fy);
    return sum >> 16u;
  }

  const AttributeSource& source_;
  const AttributeTarget& target_;
  uint32_t flags_;
  AttributeTriangle lattice_{};
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
