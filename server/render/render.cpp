#include "server/render/render.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <string>

#include "server/base/check.h"
#include "server/gpu/objects.h"
#include "server/render/packed_grid.h"
#include "shaders/shared/raymarch.h"

namespace voxeld {
namespace {

// Pixels to a side of the part of a picture that is drawn at once: bounds how long the device is
// busy before the next request to cancel is heard.
constexpr int kBlockSide = 512;

// Loop iterations of a ray besides its steps: the sample loop, the rank of the voxel in its brick's
// mask, and the neighbourhood and squarings of the estimated normal.
constexpr int kNormalSide = 2 * RAYMARCH_NORMAL_RADIUS + 1;
constexpr int kShadingSteps = 1 + 16 + kNormalSide * kNormalSide * kNormalSide + 3;

shared::vec4 to_vec4(const glm::dvec4& v) {
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z),
          static_cast<float>(v.w)};
}

double linear_from_srgb(uint8_t value) {
  const double c = value / 255.0;
  return c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
}

// world plane -> grid plane.
glm::dvec4 section_in_grid(const std::array<double, 4>& plane, const GridSpec& spec) {
  const glm::dvec3 normal(plane[0], plane[1], plane[2]);
  return {normal * spec.voxel_size, glm::dot(normal, spec.origin_world) + plane[3]};
}

// More steps than any ray can take: every step crosses one grid plane of voxels, bricks or blocks
// for good, and a ray crosses each plane once.
int ray_steps_max(const PackedGrid& grid) {
  const auto sum = [](const glm::ivec3& v) { return v.x + v.y + v.z; };
  return sum(grid.spec.dims) + sum(grid.brick_dims) + sum(grid.block_dims) + 8;
}

// How much of the hit face is mixed into a normal that is estimated from the neighbourhood, by the
// width of a voxel in pixels: voxels of a few pixels shade as a smooth surface, larger ones show
// that they are cubes.
double face_share(double voxel_pixels) {
  const double t = std::clamp((voxel_pixels - 2.0) / 6.0, 0.0, 1.0);
  return 0.6 * t * t * (3.0 - 2.0 * t);
}

}  // namespace

struct Renderer::Impl {
  Impl(gpu::Context& c, gpu::ShaderLibrary& s)
      : context(c), shaders(s), vertices(gpu::VertexArray::create(c)) {}

  gpu::Context& context;
  gpu::ShaderLibrary& shaders;
  RenderQuality quality;
  gpu::VertexArray vertices;
  gpu::Buffer params, block_bits, brick_index, brick_masks, brick_offsets, colors, normals;
  PackedGrid grid;  // what was uploaded, without its tables
  bool has_color = false, has_normal = false;

  Result<int> samples_per_side(const RenderOptions& options) const;
  Status upload_params(const RenderOptions& options, int samples);
  void bind_grid() const;
  Status upload(gpu::Buffer& buffer, std::vector<uint32_t>& words, std::string_view label);
  Status draw_block(int x, int y, int width, int height) const;
  Status draw(const RenderOptions& options, int samples, const gpu::Defines& defines,
              const gpu::Framebuffer& target, const BlockProgress& progress);
};

Renderer::Renderer(gpu::Context& context, gpu::ShaderLibrary& shaders)
    : impl_(std::make_unique<Impl>(context, shaders)) {}
Renderer::~Renderer() = default;

void Renderer::set_quality(const RenderQuality& quality) {
  VOXELD_CHECK(quality.samples_per_side >= 1 && quality.samples_per_side <= 4,
               "samples_per_side is 1 to 4");
  impl_->quality = quality;
}

Status Renderer::Impl::upload(gpu::Buffer& buffer, std::vector<uint32_t>& words,
                              std::string_view label) {
  buffer = gpu::Buffer();
  VOXELD_ASSIGN(buffer, gpu::Buffer::create(context, words.size() * sizeof(uint32_t), label));
  buffer.upload<uint32_t>(0, words);
  words = {};
  return context.check("uploading " + std::string(label));
}

Status Renderer::set_grid(const Grid& grid) {
  Impl& impl = *impl_;
  VOXELD_ASSIGN(PackedGrid packed, pack_grid(grid));
  VOXELD_TRY(impl.upload(impl.brick_index, packed.brick_index, "ray march brick table"));
  VOXELD_TRY(impl.upload(impl.block_bits, packed.block_bits, "ray march block table"));
  VOXELD_TRY(impl.upload(impl.brick_masks, packed.brick_masks, "ray march brick masks"));
  VOXELD_TRY(impl.upload(impl.brick_offsets, packed.brick_offsets, "ray march brick offsets"));
  VOXELD_TRY(impl.upload(impl.colors, packed.colors, "ray march colours"));
  VOXELD_TRY(impl.upload(impl.normals, packed.normals, "ray march normals"));
  impl.has_color = grid.has_color;
  impl.has_normal = grid.has_normal;
  impl.grid = std::move(packed);
  return {};
}

Result<int> Renderer::Impl::samples_per_side(const RenderOptions& options) const {
  const int64_t loop_max = context.info().loop_iterations_max;
  const int64_t steps = ray_steps_max(grid);
  const int64_t pixels = int64_t{options.width} * options.height;
  int side = pixels > quality.supersampled_pixels_max ? 1 : quality.samples_per_side;
  while (loop_max > 0 && side > 1 && int64_t{side} * side * (steps + kShadingSteps) > loop_max)
    --side;
  if (loop_max > 0 && steps + kShadingSteps > loop_max) {
    return Error{ErrorCode::kGridTooLarge, "the grid's sides are too long to render on this device",
                 "at most " + std::to_string(loop_max) + " steps of a ray", std::to_string(steps)};
  }
  return side;
}

Status Renderer::Impl::upload_params(const RenderOptions& options, int samples) {
  const glm::dvec3 low = grid.spec.world_from_grid(glm::dvec3(grid.occupied_min));
  const glm::dvec3 high = grid.spec.world_from_grid(glm::dvec3(grid.occupied_max));
  VOXELD_ASSIGN(const PictureRays rays,
                picture_rays(make_camera(options, low, high), grid.spec, 0.5 * (low + high)));
  shared::RaymarchParams block;
  block.near_0 = to_vec4(rays.near_plane[0]);
  block.near_x = to_vec4(rays.near_plane[1]);
  block.near_y = to_vec4(rays.near_plane[2]);
  block.far_0 = to_vec4(rays.far_plane[0]);
  block.far_x = to_vec4(rays.far_plane[1]);
  block.far_y = to_vec4(rays.far_plane[2]);
  if (options.section) block.section = to_vec4(section_in_grid(*options.section, grid.spec));
  const glm::dvec3 voxel = grid.spec.voxel_size;
  const double voxel_max = std::max(voxel.x, std::max(voxel.y, voxel.z));
  block.voxel_size = to_vec4(glm::dvec4(voxel, voxel_max));
  // Over the viewer's right shoulder, so that what is seen is lit and still has relief.
  block.light_world =
      to_vec4(glm::dvec4(glm::normalize(rays.to_eye + 0.45 * rays.right + 0.65 * rays.up),
                         face_share(voxel_max / rays.world_per_pixel(options.width))));
  block.background =
      to_vec4({linear_from_srgb(options.background[0]), linear_from_srgb(options.background[1]),
               linear_from_srgb(options.background[2]), options.background[3] / 255.0});
  const glm::ivec3 dims = grid.spec.dims;
  block.dims = {dims.x, dims.y, dims.z, ray_steps_max(grid)};
  block.brick_dims = {grid.brick_dims.x, grid.brick_dims.y, grid.brick_dims.z, samples};
  block.block_dims = {grid.block_dims.x, grid.block_dims.y, grid.block_dims.z, 0};
  const uint32_t flags = (has_color ? RAYMARCH_HAS_COLOR : 0u) |
                         (has_normal ? RAYMARCH_HAS_NORMAL : 0u) |
                         (options.section ? RAYMARCH_HAS_SECTION : 0u) |
                         (options.light == Light::kPhong ? RAYMARCH_PHONG : 0u);
  block.picture = {options.width, options.height, static_cast<int32_t>(flags), 0};
  VOXELD_TRY(gpu::ensure_size(params, context, sizeof block, "ray march parameters"));
  params.upload<shared::RaymarchParams>(0, std::span(&block, 1));
  return {};
}

void Renderer::Impl::bind_grid() const {
  params.bind_uniform(RAYMARCH_PARAMS);
  brick_index.bind_storage(RAYMARCH_BRICK_INDEX);
  brick_masks.bind_storage(RAYMARCH_BRICK_MASKS);
  brick_offsets.bind_storage(RAYMARCH_BRICK_OFFSETS);
  colors.bind_storage(RAYMARCH_COLORS);
  normals.bind_storage(RAYMARCH_NORMALS);
  block_bits.bind_storage(RAYMARCH_BLOCK_BITS);
}

Status Renderer::Impl::draw_block(int x, int y, int width, int height) const {
  const gpu::GlApi& gl = context.gl();
  gl.Enable(GL_SCISSOR_TEST);
  gl.Scissor(x, y, width, height);
  gl.DrawArrays(GL_TRIANGLES, 0, 3);
  gl.Disable(GL_SCISSOR_TEST);
  gl.Finish();
  return context.check("ray march");
}

namespace {

// Calls draw(x, y, width, height) for each block of the picture.
template <typename Draw>
Status for_each_block(int width, int height, const BlockProgress& progress, Draw&& draw) {
  const int across = (width + kBlockSide - 1) / kBlockSide;
  const int down = (height + kBlockSide - 1) / kBlockSide;
  for (int block = 0; block < across * down; ++block) {
    const int x = block % across * kBlockSide, y = block / across * kBlockSide;
    VOXELD_TRY(draw(x, y, std::min(kBlockSide, width - x), std::min(kBlockSide, height - y)));
    if (progress && !progress(block + 1, int64_t{across} * down)) {
      return Error{ErrorCode::kCancelled, "the picture was cancelled", "", ""};
    }
  }
  return {};
}

void set_state(const gpu::GlApi& gl) {
  for (const GLenum off : {GL_BLEND, GL_DEPTH_TEST, GL_CULL_FACE, GL_COLOR_LOGIC_OP,
                           GL_RASTERIZER_DISCARD, GL_FRAMEBUFFER_SRGB}) {
    gl.Disable(off);
  }
  gl.ColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
}

// GL's rows start at the bottom.
template <typename T>
void flip_rows(std::vector<T>& rows, int height) {
  const auto row = static_cast<std::ptrdiff_t>(rows.size()) / height;
  for (int y = 0; y < height / 2; ++y) {
    std::swap_ranges(rows.begin() + y * row, rows.begin() + (y + 1) * row,
                     rows.begin() + (height - 1 - y) * row);
  }
}

}  // namespace

Status Renderer::Impl::draw(const RenderOptions& options, int samples, const gpu::Defines& defines,
                            const gpu::Framebuffer& target, const BlockProgress& progress) {
  VOXELD_ASSIGN(const gpu::Program* program,
                shaders.get({{"raymarch.vert"}, {"raymarch.frag"}}, defines));
  VOXELD_TRY(upload_params(options, samples));
  set_state(context.gl());
  target.bind();
  vertices.bind();
  bind_grid();
  program->use();
  return for_each_block(
      options.width, options.height, progress,
      [&](int x, int y, int width, int height) { return draw_block(x, y, width, height); });
}

Result<Picture> Renderer::render(const RenderOptions& options, const BlockProgress& progress) {
  Impl& impl = *impl_;
  if (impl.brick_index.id() == 0) VOXELD_TRY(set_grid(Grid{}));
  VOXELD_ASSIGN(const int samples, impl.samples_per_side(options));
  VOXELD_ASSIGN(
      const gpu::Framebuffer target,
      gpu::Framebuffer::create_rgba8(impl.context, options.width, options.height, "picture"));
  VOXELD_TRY(impl.draw(options, samples, {}, target, progress));
  Picture picture{options.width, options.height,
                  std::vector<uint8_t>(size_t{4} * options.width * options.height)};
  target.read_rgba8(picture.rgba);
  VOXELD_TRY(impl.context.check("reading the picture"));
  flip_rows(picture.rgba, options.height);
  return picture;
}

Result<std::vector<Hit>> Renderer::render_hits(const RenderOptions& options) {
  Impl& impl = *impl_;
  if (impl.brick_index.id() == 0) VOXELD_TRY(set_grid(Grid{}));
  VOXELD_TRY(impl.samples_per_side(options));
  VOXELD_ASSIGN(
      const gpu::Framebuffer target,
      gpu::Framebuffer::create_rgba32i(impl.context, options.width, options.height, "hits"));
  VOXELD_TRY(impl.draw(options, 1, {{"RAYMARCH_HITS", "1"}}, target, {}));
  std::vector<int32_t> values(size_t{4} * options.width * options.height);
  target.read_rgba32i(values);
  VOXELD_TRY(impl.context.check("reading hits"));
  flip_rows(values, options.height);
  std::vector<Hit> hits;
  hits.reserve(values.size() / 4);
  for (size_t i = 0; i < values.size(); i += 4) {
    hits.push_back({{values[i], values[i + 1], values[i + 2]}, values[i + 3]});
  }
  return hits;
}

}  // namespace voxeld
