#include "server/render/gl_renderer.h"

#include <algorithm>
#include <string>

#include "server/base/check.h"
#include "server/gpu/objects.h"
#include "server/render/image_blocks.h"
#include "server/render/packed_grid.h"
#include "server/render/raymarch_params.h"

namespace voxeld {
namespace {

// Loop iterations of a ray besides its steps. They are the sample loop; for colour and normal, the
// rank of the voxel in its brick's mask and the mean of eight voxels; and the estimated normal: its
// neighbourhood (octants, each of up to eight entries) and squarings.
constexpr int kShadingSteps = 1 + 2 * (17 + 8) + 27 * 9 + 3;

// The most rays of a block. A draw can neither be cancelled nor give its time slice back, so it
// must be short. A GPU draws whole blocks in the defaults of each style. A software driver takes
// twice as long as the CPU, whose times are in docs/performance.md.
constexpr int64_t kBlockRaysMax = int64_t{1} << 25, kSoftwareBlockRaysMax = int64_t{1} << 19;
constexpr int kBlockRowsMin = 4;

// Rays of a sample. An outline compares four points.
int looks_of(const RenderOptions& options) {
  return options.style == Style::kBlueprint ? 4 : 1;
}

// The most rays of a pixel: to what it shows, and from there or from the ground to light.
int64_t pixel_rays_max(const RenderOptions& options, int samples_per_side) {
  const int64_t samples = int64_t{samples_per_side} * samples_per_side;
  int64_t rays = looks_of(options) * samples;
  if (options.occlusion) rays += std::max<int64_t>(RAYMARCH_OCCLUSION_RAYS, 4 * samples);
  if (options.shadow) rays += std::max<int64_t>(RAYMARCH_SHADOW_RAYS, 2 * samples);
  if (options.ground) rays += 2 * std::max<int64_t>(RAYMARCH_GROUND_RAYS, 4 * samples);
  return rays;
}

// Rows of a block: fewer, the more rays its pixels have.
int block_rows(const RenderOptions& options, int samples_per_side, int64_t rays_max) {
  const int64_t row_rays =
      std::min(options.width, kImageBlockSide) * pixel_rays_max(options, samples_per_side);
  int rows = kImageBlockSide;
  while (rows > kBlockRowsMin && rows * row_rays > rays_max) rows /= 2;
  return rows;
}

// The most loop iterations of all secondary rays of a hit.
int64_t light_steps_max(const RenderOptions& options, int samples_per_side) {
  const int samples = samples_per_side * samples_per_side;
  const auto rays = [&](int per_pixel, int per_sample) {
    return int64_t{std::max(per_pixel / samples, per_sample)};
  };
  int64_t steps = 0;
  if (options.occlusion) steps += rays(RAYMARCH_OCCLUSION_RAYS, 4) * (RAYMARCH_OCCLUSION_STEPS + 1);
  if (options.shadow) steps += rays(RAYMARCH_SHADOW_RAYS, 2) * (RAYMARCH_SHADOW_STEPS + 1);
  if (options.ground) {
    steps += rays(RAYMARCH_GROUND_RAYS, 4) * (RAYMARCH_OCCLUSION_STEPS + RAYMARCH_SHADOW_STEPS + 2);
  }
  return steps;
}

}  // namespace

struct GlRenderer::Impl {
  Impl(gpu::Context& c, gpu::ShaderLibrary& s)
      : context(c), shaders(s), vertices(gpu::VertexArray::create(c)) {}

  gpu::Context& context;
  gpu::ShaderLibrary& shaders;
  RenderQuality quality;
  gpu::VertexArray vertices;
  gpu::Buffer params, nodes, bricks, colors, normals;
  PackedGrid grid;  // the uploaded grid, without its tables

  Result<int> samples_per_side(const RenderOptions& options) const;
  gpu::Defines variant(const RenderOptions& options) const;
  Status upload_params(const RenderOptions& options, int samples);
  void bind_grid() const;
  Status upload(gpu::Buffer& buffer, std::vector<uint32_t>& words, std::string_view label);
  Status upload(PackedGrid& packed);
  void free_tables() {
    for (gpu::Buffer* table : {&nodes, &bricks, &colors, &normals}) *table = gpu::Buffer();
  }
  Status draw_block(int x, int y, int width, int height) const;
  Status draw(const RenderOptions& options, int samples, const gpu::Defines& defines,
              const gpu::Framebuffer& target, const BlockProgress& progress);
};

GlRenderer::GlRenderer(gpu::Context& context, gpu::ShaderLibrary& shaders)
    : impl_(std::make_unique<Impl>(context, shaders)) {}
GlRenderer::~GlRenderer() = default;

void GlRenderer::set_quality(const RenderQuality& quality) {
  VOXELD_CHECK(quality.samples_per_side >= 1 && quality.samples_per_side <= 4,
               "samples_per_side is 1 to 4");
  impl_->quality = quality;
}

Status GlRenderer::Impl::upload(gpu::Buffer& buffer, std::vector<uint32_t>& words,
                                std::string_view label) {
  VOXELD_ASSIGN(buffer, gpu::Buffer::create(context, words.size() * sizeof(uint32_t), label));
  buffer.upload<uint32_t>(0, words);
  words = {};
  return context.check("uploading " + std::string(label));
}

Status GlRenderer::Impl::upload(PackedGrid& packed) {
  VOXELD_TRY(upload(nodes, packed.nodes, "ray march tables"));
  VOXELD_TRY(upload(bricks, packed.bricks, "ray march bricks"));
  VOXELD_TRY(upload(colors, packed.colors, "ray march colours"));
  return upload(normals, packed.normals, "ray march normals");
}

Status GlRenderer::set_grid(const Grid& grid) {
  Impl& impl = *impl_;
  VOXELD_ASSIGN(PackedGrid packed, pack_grid(grid));
  impl.free_tables();  // first, so that two grids need not fit at once
  Status uploaded = impl.upload(packed);
  if (!uploaded) {
    impl.free_tables();  // others may have the memory until the next grid comes
    return uploaded;
  }
  impl.grid = std::move(packed);
  return {};
}

size_t GlRenderer::table_bytes_max() const {
  return static_cast<size_t>(impl_->context.info().ssbo_bytes_max);
}

size_t GlRenderer::device_bytes() const {
  size_t bytes = 0;
  for (const gpu::Buffer* table :
       {&impl_->nodes, &impl_->bricks, &impl_->colors, &impl_->normals}) {
    bytes += table->size_bytes();
  }
  return bytes;
}

Result<int> GlRenderer::Impl::samples_per_side(const RenderOptions& options) const {
  const int64_t loop_max = context.info().loop_iterations_max;
  const int64_t steps = looks_of(options) * (ray_steps_max(grid) + int64_t{kShadingSteps});
  int side = wanted_samples(options, quality);
  if (loop_max == 0) return side;
  const auto needed = [&](int samples_per_side) {
    return int64_t{samples_per_side} * samples_per_side *
           (steps + light_steps_max(options, samples_per_side));
  };
  while (side > 1 && needed(side) > loop_max) --side;
  if (needed(side) > loop_max) {
    return Error{ErrorCode::kGridTooLarge, "the grid's sides are too long to render on this device",
                 "at most " + std::to_string(loop_max) + " steps of a ray",
                 std::to_string(needed(side))};
  }
  return side;
}

gpu::Defines GlRenderer::Impl::variant(const RenderOptions& options) const {
  const RaymarchVariant variant = raymarch_variant(grid, options);
  const auto digit = [](bool on) { return std::string(on ? "1" : "0"); };
  return {{"RAYMARCH_ATTRIBUTES", digit(variant.attributes)},
          {"RAYMARCH_SMOOTH", digit(variant.smooth)},
          {"RAYMARCH_LIGHT", digit(variant.light)},
          {"RAYMARCH_GROUND", digit(variant.ground)},
          {"RAYMARCH_OUTLINE", digit(variant.outline)}};
}

Status GlRenderer::Impl::upload_params(const RenderOptions& options, int samples) {
  VOXELD_ASSIGN(const shared::RaymarchParams block, raymarch_params(grid, options, samples));
  VOXELD_TRY(gpu::ensure_size(params, context, sizeof block, "ray march parameters"));
  params.upload<shared::RaymarchParams>(0, std::span(&block, 1));
  return {};
}

void GlRenderer::Impl::bind_grid() const {
  params.bind_uniform(RAYMARCH_PARAMS);
  nodes.bind_storage(RAYMARCH_NODES);
  bricks.bind_storage(RAYMARCH_BRICKS);
  colors.bind_storage(RAYMARCH_COLORS);
  normals.bind_storage(RAYMARCH_NORMALS);
}

Status GlRenderer::Impl::draw_block(int x, int y, int width, int height) const {
  const gpu::GlApi& gl = context.gl();
  gl.Enable(GL_SCISSOR_TEST);
  gl.Scissor(x, y, width, height);
  gl.DrawArrays(GL_TRIANGLES, 0, 3);
  gl.Disable(GL_SCISSOR_TEST);
  gl.Finish();
  return context.check("ray march");
}

namespace {

void set_state(const gpu::GlApi& gl) {
  for (const GLenum off : {GL_BLEND, GL_DEPTH_TEST, GL_CULL_FACE, GL_COLOR_LOGIC_OP,
                           GL_RASTERIZER_DISCARD, GL_FRAMEBUFFER_SRGB}) {
    gl.Disable(off);
  }
  gl.ColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
}

// Reverses the order of rows, because GL's start at the bottom.
template <typename T>
void flip_rows(std::vector<T>& rows, int height) {
  const auto row = static_cast<std::ptrdiff_t>(rows.size()) / height;
  for (int y = 0; y < height / 2; ++y) {
    std::swap_ranges(rows.begin() + y * row, rows.begin() + (y + 1) * row,
                     rows.begin() + (height - 1 - y) * row);
  }
}

}  // namespace

Status GlRenderer::Impl::draw(const RenderOptions& options, int samples,
                              const gpu::Defines& defines, const gpu::Framebuffer& target,
                              const BlockProgress& progress) {
  VOXELD_ASSIGN(const gpu::Program* program,
                shaders.get({{"raymarch.vert"}, {"raymarch.frag"}}, defines));
  VOXELD_TRY(upload_params(options, samples));
  set_state(context.gl());
  target.bind();
  vertices.bind();
  bind_grid();
  program->use();
  const int rows = block_rows(options, samples,
                              context.info().is_software ? kSoftwareBlockRaysMax : kBlockRaysMax);
  return for_each_block(
      options.width, options.height, rows, progress,
      [&](int x, int y, int width, int height) { return draw_block(x, y, width, height); });
}

Result<RenderImage> GlRenderer::render(const RenderOptions& options,
                                       const BlockProgress& progress) {
  Impl& impl = *impl_;
  if (impl.nodes.id() == 0) VOXELD_TRY(set_grid(Grid{}));
  VOXELD_ASSIGN(const int samples, impl.samples_per_side(options));
  VOXELD_ASSIGN(
      const gpu::Framebuffer target,
      gpu::Framebuffer::create_rgba8(impl.context, options.width, options.height, "image"));
  VOXELD_TRY(impl.draw(options, samples, impl.variant(options), target, progress));
  RenderImage image{options.width, options.height,
                    std::vector<uint8_t>(size_t{4} * options.width * options.height)};
  target.read_rgba8(image.rgba);
  VOXELD_TRY(impl.context.check("reading the image"));
  flip_rows(image.rgba, options.height);
  return image;
}

Result<std::vector<Hit>> GlRenderer::render_hits(const RenderOptions& options) {
  Impl& impl = *impl_;
  if (impl.nodes.id() == 0) VOXELD_TRY(set_grid(Grid{}));
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
