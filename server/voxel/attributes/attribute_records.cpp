#include "server/voxel/attributes/attribute_records.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "server/base/floor.h"
#include "server/base/in_pieces.h"
#include "server/base/parallel.h"
#include "server/voxel/attributes/mip_chain.h"
#include "shaders/shared/attributes.h"

namespace voxeld {
namespace {

constexpr size_t kTriangleGrain = 1 << 12;
// A sliver is longer than 2 voxels and thinner than a quarter of one, in the projection. Its
// attributes vary along its longest side alone.
constexpr int64_t kSliverLength = 512;  // 1/256 voxel
constexpr int64_t kSliverAltitude = 64;
constexpr double kUvFraction = 1 << ATTRIBUTE_UV_BITS;
constexpr double kUvMax = 2047.0;  // periods of a texture; coordinates beyond are clamped to it
// Altitudes are stored in units of 1/8 texel and scaled by two thirds, because taps reach 3/2
// texels of their level.
constexpr double kAltitudeFraction = 16.0 / 3.0;
constexpr double kAltitudeMax = 65535.0;

// 65535 times a component in [0, 1]; NaN gives 0.
uint32_t fraction16(double c) {
  return c > 0.0 ? static_cast<uint32_t>(floor_to_int(std::min(c, 1.0) * 65535.0 + 0.5)) : 0u;
}

// A component of a unit vector, biased by 32768. It is never 0, so that a mean of equal components
// is exact.
uint32_t biased16(double n) {
  const double clamped = n >= -1.0 && n <= 1.0 ? n : (n > 1.0 ? 1.0 : n < -1.0 ? -1.0 : 0.0);
  return static_cast<uint32_t>(floor_to_int(clamped * 32767.0 + 0.5) + 32768);
}

int64_t floor_divide(int64_t a, int64_t b) {  // b > 0
  return a >= 0 ? a / b : -((-a + b - 1) / b);
}

glm::dvec3 unit_or_zero(const glm::dvec3& v) {
  const double length = std::sqrt(v.x * v.x + v.y * v.y + v.z * v.z);
  return length > 0.0 && std::isfinite(length) ? v / length : glm::dvec3(0.0);
}

struct Measure {
  uint32_t form = ATTRIBUTE_FORM_AREA;
  int64_t size = 0;  // twice the projected area, or the squared length of the side
};

Measure measure_of(const glm::ivec3& d01, const glm::ivec3& d02, const glm::ivec3& d12, int x,
                   int y, int64_t area) {
  const auto squared = [&](const glm::ivec3& d) {
    return int64_t{d[x]} * d[x] + int64_t{d[y]} * d[y];
  };
  Measure longest{ATTRIBUTE_FORM_01, squared(d01)};
  if (squared(d02) > longest.size) longest = {ATTRIBUTE_FORM_02, squared(d02)};
  if (squared(d12) > longest.size) longest = {ATTRIBUTE_FORM_12, squared(d12)};
  // Above 2^27 the altitude exceeds the limit for any length, and the square would overflow.
  const bool is_thin =
      area < (int64_t{1} << 27) && area * area < kSliverAltitude * kSliverAltitude * longest.size;
  if (area == 0 || (is_thin && longest.size > kSliverLength * kSliverLength)) return longest;
  return {ATTRIBUTE_FORM_AREA, area};
}

uint32_t wrap_code(Wrap wrap) {
  switch (wrap) {
    case Wrap::kRepeat:
      return ATTRIBUTE_WRAP_REPEAT;
    case Wrap::kClamp:
      return ATTRIBUTE_WRAP_CLAMP;
    case Wrap::kMirror:
      break;
  }
  return ATTRIBUTE_WRAP_MIRROR;
}

// Whole periods to subtract, so that coordinates start within the first.
double period_below(Wrap wrap, double least) {
  if (wrap == Wrap::kRepeat) return std::floor(least);
  if (wrap == Wrap::kMirror) return 2.0 * std::floor(least / 2.0);
  return 0.0;
}

uint32_t uv_word(double u) {
  // The comparisons are written so that NaN becomes 0.
  const double bounded = u >= -kUvMax ? std::min(u, kUvMax) : (u < 0.0 ? -kUvMax : 0.0);
  return static_cast<uint32_t>(static_cast<int32_t>(std::floor(bounded * kUvFraction + 0.5)));
}

double cross(const glm::dvec2& a, const glm::dvec2& b) {
  return a.x * b.y - a.y * b.x;
}

// t: corners in texels.
uint32_t altitude_word(const std::array<glm::dvec2, 3>& t) {
  const glm::dvec2 t01 = t[1] - t[0], t02 = t[2] - t[0], t12 = t[2] - t[1];
  const double longest =
      std::sqrt(std::max({glm::dot(t01, t01), glm::dot(t02, t02), glm::dot(t12, t12)}));
  const double altitude = std::abs(cross(t01, t02)) / longest * kAltitudeFraction;
  return altitude > 0.0 ? static_cast<uint32_t>(std::min(altitude, kAltitudeMax)) : 0u;  // NaN: 0
}

// Means of colours that are multiplied by alpha are weighted by it.
glm::dvec4 multiplied(const glm::vec4& color) {
  const glm::dvec4 straight(color);
  return {glm::dvec3(straight) * straight.a, straight.a};
}

bool is_in_one_cell(const glm::ivec3& a, const glm::ivec3& b, const glm::ivec3& c) {
  const glm::ivec3 cell = a >> limits::kSubVoxelBits;
  return (b >> limits::kSubVoxelBits) == cell && (c >> limits::kSubVoxelBits) == cell;
}

}  // namespace

uint32_t one_cell_weight(const std::array<glm::ivec3, 3>& q) {
  if (!is_in_one_cell(q[0], q[1], q[2])) return 0;
  const glm::dvec3 normal = glm::cross(glm::dvec3(q[1] - q[0]), glm::dvec3(q[2] - q[0]));
  const double area = std::sqrt(glm::dot(normal, normal)) / 2.0;  // a face has 2^16
  return std::max(1u, static_cast<uint32_t>(std::floor(area / 16.0 + 0.5)));
}

bool has_transparency(const Scene& scene) {
  for (const Material& material : scene.materials) {
    if (material.base_color.a < 1.0f) return true;
  }
  for (const MeshPart& part : scene.parts) {
    for (const glm::vec4& color : part.colors) {
      cancel_point();
      if (color.a < 1.0f) return true;
    }
  }
  for (const Image& image : scene.images) {
    for (size_t i = 3; i < image.rgba.size(); i += 4) {
      if (i / 4 % kCancelSteps == 0) cancel_point();
      if (image.rgba[i] != 255) return true;
    }
  }
  return false;
}

AttributeRecords::AttributeRecords(const Scene& scene, const SnappedMesh& mesh,
                                   const glm::dmat4& world_from_file, ColorMode mode,
                                   AttributeChannels channels, int texture_side_max,
                                   FlatColors* flat)
    : scene_(scene),
      mesh_(mesh),
      world_from_file_(world_from_file),
      world_from_file_normal_(glm::transpose(glm::inverse(glm::dmat3(world_from_file)))),
      is_mirrored_(glm::determinant(glm::dmat3(world_from_file)) < 0.0),
      mode_(mode),
      channels_(channels),
      image_levels_(scene.images.size()),
      flat_(flat != nullptr && mesh.is_whole ? flat : &own_flat_) {
  if (channels.color && mode != ColorMode::kAxis) find_levels(texture_side_max);
}

AttributeRecords::Corner AttributeRecords::file_corner(const MeshPart& part, uint32_t index) const {
  Corner corner;
  if (channels_.normal && part.normals.empty()) {
    corner.p_world = glm::dvec3(world_from_file_ * glm::dvec4(part.positions[index], 1.0));
  } else if (channels_.normal) {
    corner.normal_world = world_from_file_normal_ * glm::dvec3(part.normals[index]);
  }
  if (!part.colors.empty()) corner.color = multiplied(part.colors[index]);
  if (!part.uvs.empty()) corner.uv = glm::dvec2(part.uvs[index]);
  return corner;
}

AttributeRecords::Corner AttributeRecords::corner_of(const MeshPart& part, uint32_t first_vertex,
                                                     uint32_t vertex) const {
  if (vertex < mesh_.file_vertex_count) return file_corner(part, vertex - first_vertex);
  const ClippedVertex& clipped = mesh_.clipped[vertex - mesh_.file_vertex_count];
  Corner mean{glm::dvec3(0.0), glm::dvec3(0.0), glm::dvec4(0.0), glm::dvec2(0.0)};
  for (size_t i = 0; i < 3; ++i) {
    const Corner corner = file_corner(part, clipped.corners[i] - first_vertex);
    mean.p_world += clipped.weights[i] * corner.p_world;
    mean.normal_world += clipped.weights[i] * corner.normal_world;
    mean.color += clipped.weights[i] * corner.color;
    mean.uv += clipped.weights[i] * corner.uv;
  }
  return mean;
}

std::array<AttributeRecords::Corner, 3> AttributeRecords::corners_of(
    const SnappedTriangle& triangle, const CornerOrder& order) const {
  const MeshPart& part = scene_.parts[triangle.part];
  const uint32_t first_vertex = mesh_.part_first_vertex[triangle.part];
  std::array<Corner, 3> corners;
  for (size_t i = 0; i < 3; ++i) {
    corners[i] = corner_of(part, first_vertex, triangle.vertices[order.corner[i]]);
  }
  return corners;
}

// The level of which one texel is about as large as one voxel. The texture's density s is the
// larger singular value of the map from the snapped triangle to texels. The level is the least l
// with s <= 2^(l + 1/2).
int AttributeRecords::level_of(const SnappedTriangle& triangle, const Image& image) const {
  const auto& vertices = triangle.vertices;
  const std::array<glm::ivec3, 3> q = {mesh_.vertices[vertices[0]], mesh_.vertices[vertices[1]],
                                       mesh_.vertices[vertices[2]]};
  const CornerOrder order = corner_order(q);
  const std::array<Corner, 3> corners = corners_of(triangle, order);
  const glm::dvec2 size(image.width, image.height);
  const glm::ivec3 q0 = q[order.corner[0]];
  const glm::dvec3 e1 = glm::dvec3(q[order.corner[1]] - q0) / double{kSubVoxelsPerVoxel};
  const glm::dvec3 e2 = glm::dvec3(q[order.corner[2]] - q0) / double{kSubVoxelsPerVoxel};
  const glm::dvec2 t1 = (corners[1].uv - corners[0].uv) * size;
  const glm::dvec2 t2 = (corners[2].uv - corners[0].uv) * size;
  const double g11 = glm::dot(e1, e1), g12 = glm::dot(e1, e2), g22 = glm::dot(e2, e2);
  const double t11 = glm::dot(t1, t1), t12 = glm::dot(t1, t2), t22 = glm::dot(t2, t2);
  const double g = g11 * g22 - g12 * g12;
  double density_squared = 0.0;
  if (g > 1e-12 * g11 * g22) {
    const double trace = (g22 * t11 - 2.0 * g12 * t12 + g11 * t22) / g;
    const double determinant = (t11 * t22 - t12 * t12) / g;
    density_squared = 0.5 * (trace + std::sqrt(std::max(0.0, trace * trace - 4.0 * determinant)));
  } else if (std::max(g11, g22) > 0.0) {
    density_squared = g11 >= g22 ? t11 / g11 : t22 / g22;
  }
  const int last = level_count(image.width, image.height) - 1;
  int level = 0;
  for (double bound = 2.0; level < last && !(density_squared <= bound); ++level) bound *= 4.0;
  return level;
}

// Corners at the same position share the mean of their attributes. A position then has one colour,
// whichever of the corners comes first.
void AttributeRecords::merge_equal(const std::array<glm::ivec3, 3>& q,
                                   std::array<Corner, 3>& corners) {
  const auto set_mean = [&](size_t first, size_t last) {
    const double share = 1.0 / static_cast<double>(last - first + 1);
    Corner mean{glm::dvec3(0.0), glm::dvec3(0.0), glm::dvec4(0.0), glm::dvec2(0.0)};
    for (size_t i = first; i <= last; ++i) {
      mean.normal_world += corners[i].normal_world;
      mean.color += corners[i].color;
      mean.uv += corners[i].uv;
    }
    for (size_t i = first; i <= last; ++i) {
      corners[i].normal_world = mean.normal_world * share;
      corners[i].color = mean.color * share;
      corners[i].uv = mean.uv * share;
    }
  };
  if (q[0] == q[1]) return set_mean(0, q[1] == q[2] ? 2 : 1);
  if (q[1] == q[2]) set_mean(1, 2);
}

void AttributeRecords::find_flat_color(uint32_t triangle_index) {
  if (flat_->known[triangle_index] != 0) return;
  const SnappedTriangle& triangle = mesh_.triangles[triangle_index];
  const MeshPart& part = scene_.parts[triangle.part];
  const Material* material =
      part.material >= 0 ? &scene_.materials[static_cast<size_t>(part.material)] : nullptr;
  const glm::dvec4 base = material != nullptr ? multiplied(material->base_color) : glm::dvec4(1.0);
  std::array<FlatCorner, 3> corners;
  const std::array<Corner, 3> of_triangle = corners_of(triangle, {});
  for (size_t i = 0; i < 3; ++i) corners[i] = {of_triangle[i].uv, base * of_triangle[i].color};
  const int image = part_image(scene_, triangle.part);
  flat_->linear16[triangle_index] = mean_color(
      corners, material, image >= 0 ? &scene_.images[static_cast<size_t>(image)] : nullptr);
  flat_->known[triangle_index] = 1;
}

void AttributeRecords::find_levels(int texture_side_max) {
  const size_t count = mesh_.triangles.size();
  levels_.resize(count);
  flat_->resize(count);
  std::vector<std::vector<ImageLevels>> found(chunk_count(count, kTriangleGrain),
                                              std::vector<ImageLevels>(scene_.images.size()));
  parallel_chunks(count, kTriangleGrain, [&](size_t chunk, size_t begin, size_t end) {
    for (size_t t = begin; t < end; ++t) {
      cancel_point();
      // color=nearest needs the colour of a point, not of the whole triangle.
      const auto& vertices = mesh_.triangles[t].vertices;
      if (mode_ != ColorMode::kNearest &&
          is_in_one_cell(mesh_.vertices[vertices[0]], mesh_.vertices[vertices[1]],
                         mesh_.vertices[vertices[2]])) {
        levels_[t] = kFlatLevel;
        find_flat_color(static_cast<uint32_t>(t));
        continue;
      }
      const int image_index = part_image(scene_, mesh_.triangles[t].part);
      if (image_index < 0) continue;
      const Image& image = scene_.images[static_cast<size_t>(image_index)];
      int first = 0;
      while (std::max(image.width, image.height) >> first > texture_side_max) ++first;
      const int level = std::max(first, level_of(mesh_.triangles[t], image));
      levels_[t] = static_cast<uint8_t>(level);
      ImageLevels& levels = found[chunk][static_cast<size_t>(image_index)];
      levels = {first, std::max(levels.last, level)};
    }
  });
  for (const auto& chunk : found) {
    for (size_t i = 0; i < chunk.size(); ++i) {
      image_levels_[i] = {std::min(image_levels_[i].first, chunk[i].first),
                          std::max(image_levels_[i].last, chunk[i].last)};
    }
  }
}

void AttributeRecords::write_geometry(const std::array<glm::ivec3, 3>& q, int axis,
                                      uint32_t* words) {
  const int x = (axis + 1) % 3, y = (axis + 2) % 3;
  const glm::ivec3 d01 = q[1] - q[0], d02 = q[2] - q[0], d12 = q[2] - q[1];
  int64_t nx = int64_t{d01[y]} * d02[axis] - int64_t{d01[axis]} * d02[y];
  int64_t ny = int64_t{d01[axis]} * d02[x] - int64_t{d01[x]} * d02[axis];
  int64_t nz = int64_t{d01[x]} * d02[y] - int64_t{d01[y]} * d02[x];
  if (nz < 0) {
    nx = -nx;
    ny = -ny;
    nz = -nz;
  }
  const Measure measure = measure_of(d01, d02, d12, x, y, nz);
  uint32_t factor = 0;
  if (nz > 0) {
    constexpr int64_t kOne = int64_t{1} << ATTRIBUTE_DEPTH_BITS;
    words[ATTRIBUTE_SLOPE_I] = static_cast<uint32_t>(floor_divide(-nx * kOne, nz));
    words[ATTRIBUTE_SLOPE_J] = static_cast<uint32_t>(floor_divide(-ny * kOne, nz));
    const auto a = static_cast<double>(nx), b = static_cast<double>(ny);
    const auto c = static_cast<double>(nz);
    factor =
        static_cast<uint32_t>(floor_to_int(256.0 * std::sqrt(a * a + b * b + c * c) / c + 0.5));
  }
  const auto reciprocal =
      static_cast<uint64_t>(measure.size > 0 ? (int64_t{1} << 57) / measure.size : 0);
  words[ATTRIBUTE_RECIPROCAL] = static_cast<uint32_t>(reciprocal);
  words[ATTRIBUTE_RECIPROCAL + 1] = static_cast<uint32_t>(reciprocal >> 32);
  words[ATTRIBUTE_FLAGS] = factor | measure.form << ATTRIBUTE_FORM_SHIFT;
}

void AttributeRecords::write_colors(const MeshPart& part, const Corner* corners, int axis,
                                    uint32_t* words) const {
  glm::dvec4 base(1.0);
  if (part.material >= 0) {
    base = multiplied(scene_.materials[static_cast<size_t>(part.material)].base_color);
  }
  for (size_t i = 0; i < 3; ++i) {
    glm::dvec4 color = base * corners[i].color;
    if (mode_ == ColorMode::kAxis) {
      color = glm::dvec4(0.0, 0.0, 0.0, 1.0);
      color[axis] = 1.0;
    }
    words[ATTRIBUTE_COLORS + 2 * i] = fraction16(color.r) | fraction16(color.g) << 16;
    words[ATTRIBUTE_COLORS + 2 * i + 1] = fraction16(color.b) | fraction16(color.a) << 16;
  }
}

void AttributeRecords::write_flat_color(uint32_t triangle, uint32_t* words) const {
  const auto& [r, g, b, a] = flat_color(triangle);
  for (size_t i = 0; i < 3; ++i) {
    words[ATTRIBUTE_COLORS + 2 * i] = r | uint32_t{g} << 16;
    words[ATTRIBUTE_COLORS + 2 * i + 1] = b | uint32_t{a} << 16;
  }
}

void AttributeRecords::write_uvs(const Material& material, const Corner* corners, int level,
                                 uint32_t* words) const {
  const auto image_index = static_cast<size_t>(material.image);
  const Image& image = scene_.images[image_index];
  const int first = image_levels_[image_index].first;
  const glm::dvec2 size(std::max(1, image.width >> first), std::max(1, image.height >> first));
  const double shift_u =
      period_below(material.wrap_u, std::min({corners[0].uv.x, corners[1].uv.x, corners[2].uv.x}));
  const double shift_v =
      period_below(material.wrap_v, std::min({corners[0].uv.y, corners[1].uv.y, corners[2].uv.y}));
  for (size_t i = 0; i < 3; ++i) {
    words[ATTRIBUTE_UVS + 2 * i] = uv_word(corners[i].uv.x - shift_u);
    words[ATTRIBUTE_UVS + 2 * i + 1] = uv_word(corners[i].uv.y - shift_v);
  }
  words[ATTRIBUTE_ALTITUDE] =
      altitude_word({corners[0].uv * size, corners[1].uv * size, corners[2].uv * size});
  const auto level_word = static_cast<uint32_t>(level - first);
  words[ATTRIBUTE_FLAGS] |= wrap_code(material.wrap_u) << ATTRIBUTE_WRAP_U_SHIFT |
                            wrap_code(material.wrap_v) << ATTRIBUTE_WRAP_V_SHIFT |
                            level_word << ATTRIBUTE_LEVEL_SHIFT;
}

void AttributeRecords::write_normals(const MeshPart& part, const Corner* corners, bool reversed,
                                     uint32_t* words) const {
  const auto write = [&](size_t corner, const glm::dvec3& n) {
    words[ATTRIBUTE_NORMALS + 2 * corner] = biased16(n.x) | biased16(n.y) << 16;
    words[ATTRIBUTE_NORMALS + 2 * corner + 1] = biased16(n.z);
  };
  if (!part.normals.empty()) {
    for (size_t i = 0; i < 3; ++i) write(i, unit_or_zero(corners[i].normal_world));
    return;
  }
  const glm::dvec3 face =
      glm::cross(corners[1].p_world - corners[0].p_world, corners[2].p_world - corners[0].p_world);
  const glm::dvec3 unit = unit_or_zero(reversed != is_mirrored_ ? -face : face);
  for (size_t i = 0; i < 3; ++i) write(i, unit);
}

// Gives all corners the mean of their normals.
void AttributeRecords::flatten_normals(uint32_t* words) {
  std::array<uint32_t, 3> sums{};
  for (size_t i = 0; i < 3; ++i) {
    const uint32_t xy = words[ATTRIBUTE_NORMALS + 2 * i], z = words[ATTRIBUTE_NORMALS + 2 * i + 1];
    sums = {sums[0] + (xy & 0xffffu), sums[1] + (xy >> 16), sums[2] + z};
  }
  for (uint32_t& sum : sums) sum = (sum + 1) / 3;
  for (size_t i = 0; i < 3; ++i) {
    words[ATTRIBUTE_NORMALS + 2 * i] = sums[0] | sums[1] << 16;
    words[ATTRIBUTE_NORMALS + 2 * i + 1] = sums[2];
  }
}

void AttributeRecords::write(uint32_t triangle_index, const std::array<glm::ivec3, 3>& q, int axis,
                             const CornerOrder& order, std::span<uint32_t> words) const {
  const SnappedTriangle& triangle = mesh_.triangles[triangle_index];
  const MeshPart& part = scene_.parts[triangle.part];
  write_geometry(q, axis, words.data());
  words[ATTRIBUTE_WEIGHT] = one_cell_weight(q);
  const bool is_inside = is_in_one_cell(q[0], q[1], q[2]);
  if (is_inside && mode_ != ColorMode::kNearest)
    words[ATTRIBUTE_FLAGS] |= 1u << ATTRIBUTE_FLAT_SHIFT;
  const bool is_flat_color = has_flat_color(triangle_index);
  if (is_flat_color) write_flat_color(triangle_index, words.data());
  if (is_flat_color && !channels_.normal) return;
  std::array<Corner, 3> corners = corners_of(triangle, order);
  merge_equal(q, corners);
  if (channels_.normal) write_normals(part, corners.data(), order.reversed, words.data());
  if (channels_.normal && is_inside) flatten_normals(words.data());
  if (!channels_.color || is_flat_color) return;
  write_colors(part, corners.data(), axis, words.data());
  const int image = part_image(scene_, triangle.part);
  if (mode_ != ColorMode::kAxis && image >= 0) {
    write_uvs(scene_.materials[static_cast<size_t>(part.material)], corners.data(),
              levels_[triangle_index], words.data());
  }
}

void AttributeRecords::fill(std::span<const uint32_t> triangles, const TileWindow& window,
                            std::vector<uint32_t>& words) const {
  words.assign(triangles.size() * ATTRIBUTE_WORDS, 0u);
  parallel_chunks(triangles.size(), kTriangleGrain, [&](size_t, size_t begin, size_t end) {
    for (size_t t = begin; t < end; ++t) {
      cancel_point();
      const auto& vertices = mesh_.triangles[triangles[t]].vertices;
      const CornerOrder order = corner_order(
          {mesh_.vertices[vertices[0]], mesh_.vertices[vertices[1]], mesh_.vertices[vertices[2]]});
      const int32_t* at = &window.vertices[9 * t];
      write(triangles[t],
            {glm::ivec3(at[0], at[1], at[2]), {at[3], at[4], at[5]}, {at[6], at[7], at[8]}},
            window.axes[t], order, std::span(words).subspan(t * ATTRIBUTE_WORDS, ATTRIBUTE_WORDS));
    }
  });
}

}  // namespace voxeld
