#include "server/voxel/gl/solid/slice_map.h"

#include <array>
#include <utility>

#include "shaders/shared/solid.h"

namespace voxeld {
namespace {

constexpr GLsizei kSide = SOLID_TILE_CELLS;

}  // namespace

Result<SliceMap> SliceMap::create(const gpu::Context& context) {
  VOXELD_TRY(context.check("before creating the slice map"));
  const gpu::GlApi& gl = context.gl();
  SliceMap map;
  map.context_ = &context;
  gl.CreateFramebuffers(1, &map.framebuffer_);
  gl.ObjectLabel(GL_FRAMEBUFFER, map.framebuffer_, -1, "slice map");
  std::array<GLenum, 2> targets{};
  for (GLuint i = 0; i < 2; ++i) {
    uint32_t& texture = i == 0 ? map.low_ : map.high_;
    gl.CreateTextures(GL_TEXTURE_2D, 1, &texture);
    gl.TextureStorage2D(texture, 1, GL_RGBA32UI, kSide, kSide);
    gl.TextureParameteri(texture, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    gl.TextureParameteri(texture, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    gl.ObjectLabel(GL_TEXTURE, texture, -1, "slice map");
    targets[i] = GL_COLOR_ATTACHMENT0 + i;
    gl.NamedFramebufferTexture(map.framebuffer_, targets[i], texture, 0);
  }
  gl.NamedFramebufferDrawBuffers(map.framebuffer_, 2, targets.data());
  const GLenum state = gl.CheckNamedFramebufferStatus(map.framebuffer_, GL_DRAW_FRAMEBUFFER);
  VOXELD_TRY(context.check("creating the slice map"));
  if (state != GL_FRAMEBUFFER_COMPLETE) {
    return Error{ErrorCode::kInternal, "the slice map's framebuffer is incomplete",
                 "GL_FRAMEBUFFER_COMPLETE", gpu::gl_error_name(state)};
  }
  map.vertex_array_ = gpu::VertexArray::create(context);
  return map;
}

SliceMap::~SliceMap() {
  if (framebuffer_ == 0) return;
  context_->gl().DeleteFramebuffers(1, &framebuffer_);
  context_->gl().DeleteTextures(1, &low_);
  context_->gl().DeleteTextures(1, &high_);
}

SliceMap::SliceMap(SliceMap&& other) noexcept
    : context_(other.context_),
      framebuffer_(std::exchange(other.framebuffer_, 0)),
      low_(std::exchange(other.low_, 0)),
      high_(std::exchange(other.high_, 0)),
      vertex_array_(std::move(other.vertex_array_)) {}

SliceMap& SliceMap::operator=(SliceMap&& other) noexcept {
  std::swap(context_, other.context_);
  std::swap(framebuffer_, other.framebuffer_);
  std::swap(low_, other.low_);
  std::swap(high_, other.high_);
  std::swap(vertex_array_, other.vertex_array_);
  return *this;
}

void SliceMap::clear() {
  const std::array<GLuint, 4> zero{};
  for (GLint i = 0; i < 2; ++i) {
    context_->gl().ClearNamedFramebufferuiv(framebuffer_, GL_COLOR, i, zero.data());
  }
}

Status SliceMap::draw(gpu::ShaderLibrary& shaders, size_t triangles) {
  VOXELD_ASSIGN(const gpu::Program* program,
                shaders.get({{"solid_slices.vert"}, {"solid_slices.geom"}, {"solid_slices.frag"}}));
  const gpu::GlApi& gl = context_->gl();
  gl.BindFramebuffer(GL_FRAMEBUFFER, framebuffer_);
  gl.Viewport(0, 0, kSide, kSide);
  vertex_array_.bind();
  for (const GLenum off : {GL_CULL_FACE, GL_DEPTH_TEST, GL_STENCIL_TEST, GL_SCISSOR_TEST, GL_BLEND,
                           GL_RASTERIZER_DISCARD}) {
    gl.Disable(off);
  }
  gl.Enable(GL_COLOR_LOGIC_OP);
  gl.LogicOp(GL_XOR);
  program->use();
  gl.DrawArrays(GL_TRIANGLES, 0, static_cast<GLsizei>(3 * triangles));
  gl.Disable(GL_COLOR_LOGIC_OP);
  return context_->check("drawing the slice map");
}

void SliceMap::bind_textures() const {
  context_->gl().BindTextureUnit(SOLID_SLICES_LOW, low_);
  context_->gl().BindTextureUnit(SOLID_SLICES_HIGH, high_);
}

}  // namespace voxeld
