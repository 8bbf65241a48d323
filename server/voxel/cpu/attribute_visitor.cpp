#include "server/voxel/cpu/attribute_visitor.h"

#include <algorithm>
#include <bit>

#include "proto/codec/sparse_tile.h"
#include "server/grid/color/color_tables.h"
#include "server/voxel/attributes/nearest_point.h"
#include "shaders/glsl.h"

namespace voxeld {
// The namespace has a name because not every function in it is used. It is hidden, so that
// functions can be inlined in spite of -fPIC.
#pragma GCC visibility push(hidden)
namespace attribute_visitor {

using namespace glsl;  // NOLINT(google-build-using-namespace)
#include "shaders/lib/attribute_area.glsl"
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
  Visitor(const AttributeKernel& kernel, PairMemory& memory, const AttributeSource& source,
          const AttributeTarget& target)
      : kernel_(kernel),
        memory_(memory),
        source_(source),
        target_(target),
        flags_(source.words[ATTRIBUTE_FLAGS]),
        is_textured_(target.channels.color && !source.levels.empty() && !is_flat()) {}

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
    if (target_.nearest != nullptr) {
      visit(t);
    } else {
      add_pairs(t);
    }
  }

 private:
  static PairSide pair_side(const AttributeSide& side) {
    return {side.a, side.b, side.rest, side.shift, side.is_right, pair_line(side.line)};
  }
  static PairLine pair_line(const RowLine& line) {
    return {line.b, line.span, line.shift, line.reciprocal};
  }

  void set_triangle() {
    PairTriangle& out = memory_.triangle;
    out.sides[0] = pair_side(shape_.side0);
    out.sides[1] = pair_side(shape_.side1);
    out.sides[2] = pair_side(shape_.side2);
    out.slope_i = shape_.slope_i;
    out.slope_j = shape_.slope_j;
    out.depth = shape_.depth;
    out.level = pair_line(shape_.level);
    out.factor = shape_.factor;
    for (int c = 0; c < 2; ++c) {
      out.box_min[c] = shape_.box_min[c];
      out.box_max[c] = shape_.box_max[c];
    }
    out.low = shape_.low;
    out.high = shape_.high;
    out.form1 = {shape_.form1.x, shape_.form1.y, shape_.rest1};
    out.form2 = {shape_.form2.x, shape_.form2.y, shape_.rest2};
    out.limit = shape_.limit;
    out.reciprocal = shape_.reciprocal;
    out.weight = source_.words[ATTRIBUTE_WEIGHT];
    // Equal values need no weights; a mesh without normals has the face's at all corners.
    out.is_flat = !is_textured_;
    out.value_count = 0;
    if (target_.channels.color) add_values(colors_, target_.channels.alpha ? 4 : 3);
    if (target_.channels.normal) add_values(normals_, 3);
  }

  void set_touch(const TouchTriangle& t) {
    PairTouch& out = memory_.touch;
    const std::array<std::array<const ivec3*, 3>, 3> edges = {
        {{&t.xy0, &t.xy1, &t.xy2}, {&t.yz0, &t.yz1, &t.yz2}, {&t.zx0, &t.zx1, &t.zx2}}};
    for (int c = 0; c < 3; ++c) {
      out.cell_min[c] = t.cell_min[c];
      out.cell_max[c] = t.cell_max[c];
      out.normal[c] = static_cast<double>(t.normal[c]);
      for (size_t e = 0; e < 3; ++e) {
        out.xy[e][c] = (*edges[0][e])[c];
        out.yz[e][c] = (*edges[1][e])[c];
        out.zx[e][c] = (*edges[2][e])[c];
      }
    }
    out.plane = static_cast<double>(t.plane);
    out.above = static_cast<double>(t.above);
    out.below = static_cast<double>(t.below);
    out.base_z = t.base_z;
    out.axis = source_.axis;
  }

  void add_pairs(const TouchTriangle& t) {
    set_triangle();
    set_touch(t);
    const PairVoxels voxels = {target_.mask.data(), target_.word_offsets.data(),
                               target_.voxel_first};
    if (!is_textured_) {
      kernel_.add(memory_.triangle, memory_.touch, voxels, memory_.pairs, target_.sums);
      return;
    }
    const auto add = [](void* visitor) { static_cast<const Visitor*>(visitor)->add_textured(); };
    kernel_.measure(memory_.triangle, memory_.touch, voxels, memory_.pairs, memory_.areas, add,
                    this);
  }

  void add_textured() const {
    for (size_t n = 0; n < static_cast<size_t>(memory_.pairs.count); ++n) add_textured(n);
  }

  void add_values(const std::array<uvec4, 3>& corners, int channels) {
    PairTriangle& out = memory_.triangle;
    for (int c = 0; c < channels; ++c) {
      uint32_t* values = out.values[out.value_count++];
      for (const uvec4& corner : corners) *values++ = corner[c];
    }
    out.is_flat = out.is_flat && corners[0] == corners[1] && corners[0] == corners[2];
  }

  void read_corners(size_t word, std::array<uvec4, 3>& out) const {
    for (uvec4& corner : out) {
      const uint32_t low = source_.words[word++], high = source_.words[word++];
      corner = uvec4(low & 0xffffu, low >> 16, high & 0xffffu, high >> 16);
    }
  }

  // For color=nearest.
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
    for (int k = depth.x; k <= depth.y; ++k) {
      if (!touch_sides(t, i, j, k)) continue;
      const size_t voxel = voxel_at(target_, morton_at(i, j, k));
      if (voxel != kNone) compare(target_.nearest[voxel], i, j, k);
    }
  }

  void add_textured(size_t n) const {
    const PairAreas& areas = memory_.areas;
    const uint32_t weight = areas.weight[n];
    const ivec3 weights((1 << ATTRIBUTE_WEIGHT_BITS) - areas.w1[n] - areas.w2[n], areas.w1[n],
                        areas.w2[n]);
    uint64_t* sums = target_.sums + size_t{memory_.pairs.voxel[n]} * target_.channels.count();
    *sums++ += weight;
    const uvec4 color = times_texel(weights, sample_texture(n, weights));
    const int channels = target_.channels.alpha ? 4 : 3;
    for (int c = 0; c < channels; ++c) *sums++ += uint64_t{weight} * color[c];
    if (!target_.channels.normal) return;
    const uvec4 normal = blend(normals_, weights);
    for (int c = 0; c < 3; ++c) *sums++ += uint64_t{weight} * normal[c];
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
    if (!is_textured_) return blend(colors_, weights);
    return times_texel(weights, sample_tap(weights, level_max()));
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
  // weights: those at the centroid of pair n.
  uvec4 sample_texture(size_t n, const ivec3& weights) const {
    const PairAreas& areas = memory_.areas;
    const uint32_t length = areas.length[n];
    if (length == 0) return sample_tap(weights, level_max());
    const int level = part_level(areas.area[n], level_max());
    if (tap_fits(weights, level)) return sample_tap(weights, level);
    const ivec2 column(memory_.pairs.i[n], memory_.pairs.j[n]);
    CellArea cell{};
    cell.low = areas.low[n];
    cell.spacing = areas.spacing[n];
    uint32_t done = 0;
    uvec4 sum(1u << 15);
    for (const PairAreas::Strip& strip : areas.strips) {
      const RowSums sums{strip.length[n], strip.x[n], strip.y[n], strip.squares[n]};
      const uint32_t share = length_share(done + sums.lengths, length) - length_share(done, length);
      done += sums.lengths;
      if (share != 0) sum += sample_strip(cell, sums, column) * share;
    }
    return sum >> 16u;
  }

  uvec4 sample_strip(const CellArea& cell, const RowSums& sums, const ivec2& column) const {
    const ivec2 centre = row_centroid(cell, sums);
    const int spread = row_spread(sums);
    const uint32_t half = rows_area(cell, sums) >> 1;
    const ivec2 inner(spread >> 1, 0);
    return sample_half(centre - ivec2(spread, 0), inner, half, column) +
           sample_half(centre + ivec2(spread, 0), inner, half, column);
  }

  uvec4 sample_half(const ivec2& centre, const ivec2& spread, uint32_t area,
                    const ivec2& column) const {
    const int level = part_level(area, level_max());
    const auto weights_at = [&](const ivec2& point) {
      return weights_in_column(shape_, column.x, column.y, point);
    };
    const ivec3 weights = weights_at(centre);
    if (tap_fits(weights, level)) return sample_tap(weights, level);
    return (sample_tap(weights_at(centre - spread), level - 1) +
            sample_tap(weights_at(centre + spread), level - 1) + 1u) >>
           1u;
  }

  bool tap_fits(const ivec3& weights, int level) const {
    return tap_level(weights, source_.words[ATTRIBUTE_ALTITUDE], level) + 1 >= level;
  }

  // Bilinear sample in linear light. The fraction has 8 bits, so that 65535 * 65536 fits. A level
  // finer than asked for has its four texels averaged.
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
    const bool is_finer = number < level_max;
    const uint32_t fx = is_finer ? 128 : static_cast<uint32_t>(u & 255);
    const uint32_t fy = is_finer ? 128 : static_cast<uint32_t>(v & 255);
    const std::array<uint32_t, 4> shares = {(256u - fx) * (256u - fy), fx * (256u - fy),
                                            (256u - fx) * fy, fx * fy};
    uvec4 sum(0);
    for (size_t t = 0; t < 4; ++t) {
      if (!target_.channels.alpha) {
        for (int c = 0; c < 3; ++c) sum[c] += linear_[texels[t][c]] * shares[t];
        continue;
      }
      const uint32_t alpha = texels[t][3] * 257u;
      for (int c = 0; c < 3; ++c) sum[c] += product16(linear_[texels[t][c]], alpha) * shares[t];
      sum.w += alpha * shares[t];
    }
    return sum >> 16u;
  }

  const AttributeKernel& kernel_;
  PairMemory& memory_;
  const AttributeSource& source_;
  const AttributeTarget& target_;
  uint32_t flags_;
  bool is_textured_;
  const std::array<uint32_t, 256>& linear_ = linear16_from_srgb8();
  AttributeTriangle shape_{};
  std::array<uvec4, 3> colors_{}, normals_{};
};

}  // namespace

void AttributeVisitor::add(const AttributeSource& source, const AttributeTarget& target) {
  Visitor(*kernel_, memory_, source, target).run();
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
