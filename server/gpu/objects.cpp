#include "server/gpu/objects.h"

#include <algorithm>
#include <optional>
#include <string>

#include "server/base/check.h"

namespace voxeld::gpu {
namespace {

void label_object(const Context& context, GLenum kind, uint32_t id, std::string_view label) {
  context.gl().ObjectLabel(kind, id, static_cast<GLsizei>(label.size()), label.data());
}

Error over_limit(const Context& context, std::string_view label, std::string_view what,
                 int64_t limit, int64_t got, std::string_view unit) {
  return Error{ErrorCode::kGridTooLarge,
               std::string(label) + ": " + std::string(what) + " is too large for " +
                   device_name(context.info().device),
               "at most " + std::to_string(limit) + " " + std::string(unit),
               std::to_string(got) + " " + std::string(unit)};
}

}  // namespace

BufferMapping::~BufferMapping() {
  if (buffer_ != 0) context_->gl().UnmapNamedBuffer(buffer_);
}
BufferMapping::BufferMapping(BufferMapping&& other) noexcept
    : context_(other.context_), buffer_(std::exchange(other.buffer_, 0)), bytes_(other.bytes_) {}
BufferMapping& BufferMapping::operator=(BufferMapping&& other) noexcept {
  std::swap(context_, other.context_);
  std::swap(buffer_, other.buffer_);
  std::swap(bytes_, other.bytes_);
  return *this;
}

Status BufferMapping::unmap() {
  bytes_ = {};
  if (context_->gl().UnmapNamedBuffer(std::exchange(buffer_, 0)) == GL_TRUE) return {};
  return Error{ErrorCode::kDeviceUnavailable, "the driver lost the contents of a mapped buffer", "",
               ""};
}

Result<Buffer> Buffer::create(const Context& context, size_t bytes, std::string_view label) {
  return create(context, bytes, label, GL_DYNAMIC_STORAGE_BIT);
}

Result<Buffer> Buffer::create_mappable(const Context& context, size_t bytes,
                                       std::string_view label) {
  return create(context, bytes, label, GL_DYNAMIC_STORAGE_BIT | GL_MAP_READ_BIT | GL_MAP_WRITE_BIT);
}

Result<Buffer> Buffer::create(const Context& context, size_t bytes, std::string_view label,
                              uint32_t flags) {
  const int64_t limit = context.info().ssbo_bytes_max;
  if (bytes > static_cast<uint64_t>(limit)) {
    return over_limit(context, label, "a buffer", limit, static_cast<int64_t>(bytes), "bytes");
  }
  VOXELD_TRY(context.check("before creating buffer " + std::string(label)));
  const GlApi& gl = context.gl();
  Buffer buffer;
  buffer.context_ = &context;
  buffer.bytes_ = bytes;
  gl.CreateBuffers(1, &buffer.id_);
  // OpenGL has no empty storage and clears only whole words. Nothing may read the padding.
  const auto storage_bytes = static_cast<GLsizeiptr>((std::max<size_t>(bytes, 1) + 15) / 16 * 16);
  gl.NamedBufferStorage(buffer.id_, storage_bytes, nullptr, flags);
  label_object(context, GL_BUFFER, buffer.id_, label);
  VOXELD_TRY(context.check("creating buffer " + std::string(label) + " of " +
                           std::to_string(bytes) + " bytes"));
  const uint32_t zero = 0;
  gl.ClearNamedBufferData(buffer.id_, GL_R32UI, GL_RED_INTEGER, GL_UNSIGNED_INT, &zero);
  VOXELD_TRY(context.check("clearing buffer " + std::string(label) + " of " +
                           std::to_string(bytes) + " bytes"));
  return buffer;
}

Buffer::~Buffer() {
  if (id_ != 0) context_->gl().DeleteBuffers(1, &id_);
}
Buffer::Buffer(Buffer&& other) noexcept
    : context_(other.context_),
      id_(std::exchange(other.id_, 0)),
      bytes_(std::exchange(other.bytes_, 0)) {}
Buffer& Buffer::operator=(Buffer&& other) noexcept {
  std::swap(context_, other.context_);
  std::swap(id_, other.id_);
  std::swap(bytes_, other.bytes_);
  return *this;
}

void Buffer::upload(size_t offset_bytes, std::span<const uint8_t> data) {
  VOXELD_CHECK(offset_bytes + data.size() <= bytes_, "upload past the end of a buffer");
  if (data.empty()) return;
  context_->gl().NamedBufferSubData(id_, static_cast<GLintptr>(offset_bytes),
                                    static_cast<GLsizeiptr>(data.size()), data.data());
}

void Buffer::read(size_t offset_bytes, std::span<uint8_t> out) const {
  VOXELD_CHECK(offset_bytes + out.size() <= bytes_, "read past the end of a buffer");
  if (out.empty()) return;
  context_->gl().GetNamedBufferSubData(id_, static_cast<GLintptr>(offset_bytes),
                                       static_cast<GLsizeiptr>(out.size()), out.data());
}

Result<BufferMapping> Buffer::map(size_t offset_bytes, size_t bytes) {
  VOXELD_CHECK(bytes > 0 && offset_bytes + bytes <= bytes_, "mapping past the end of a buffer");
  void* memory = context_->gl().MapNamedBufferRange(id_, static_cast<GLintptr>(offset_bytes),
                                                    static_cast<GLsizeiptr>(bytes),
                                                    GL_MAP_READ_BIT | GL_MAP_WRITE_BIT);
  // The check may report an error of an earlier call though the buffer is mapped.
  std::optional<BufferMapping> mapping;
  if (memory != nullptr)
    mapping.emplace(*context_, id_, std::span(static_cast<uint8_t*>(memory), bytes));
  VOXELD_TRY(context_->check("mapping a buffer"));
  if (mapping) return std::move(*mapping);
  return Error{ErrorCode::kDeviceUnavailable, "the driver did not map a buffer", "", ""};
}

void Buffer::clear(size_t offset_bytes, size_t bytes, uint32_t value) {
  VOXELD_CHECK(offset_bytes % 4 == 0 && bytes % 4 == 0 && offset_bytes + bytes <= bytes_,
               "clear takes whole 32-bit words inside the buffer");
  if (bytes == 0) return;
  context_->gl().ClearNamedBufferSubData(id_, GL_R32UI, static_cast<GLintptr>(offset_bytes),
                                         static_cast<GLsizeiptr>(bytes), GL_RED_INTEGER,
                                         GL_UNSIGNED_INT, &value);
}

void Buffer::bind_storage(uint32_t binding) const {
  // A range, so that an unsized array's length() does not count the padding.
  bind_storage(binding, 0, bytes_);
}

void Buffer::bind_storage(uint32_t binding, size_t offset_bytes, size_t bytes) const {
  VOXELD_CHECK(offset_bytes + bytes <= bytes_, "binding past the end of a buffer");
  context_->gl().BindBufferRange(GL_SHADER_STORAGE_BUFFER, binding, id_,
                                 static_cast<GLintptr>(offset_bytes),
                                 static_cast<GLsizeiptr>(bytes == 0 ? 4 : bytes));
}

void Buffer::bind_uniform(uint32_t binding) const {
  context_->gl().BindBufferBase(GL_UNIFORM_BUFFER, binding, id_);
}

void Buffer::bind_indirect() const {
  context_->gl().BindBuffer(GL_DISPATCH_INDIRECT_BUFFER, id_);
}

Status ensure_size(Buffer& buffer, const Context& context, size_t bytes, std::string_view label) {
  if (buffer.id() != 0 && buffer.size_bytes() >= bytes) return {};
  buffer = Buffer();  // freed first, so that both need not fit at once
  VOXELD_ASSIGN(buffer, Buffer::create(context, bytes, label));
  return {};
}

Status ensure_mappable(Buffer& buffer, const Context& context, size_t bytes,
                       std::string_view label) {
  if (buffer.id() != 0 && buffer.size_bytes() >= bytes) return {};
  buffer = Buffer();
  VOXELD_ASSIGN(buffer, Buffer::create_mappable(context, bytes, label));
  return {};
}

Result<Texture2D> Texture2D::create_rgba8ui(const Context& context, int width, int height,
                                            int levels, std::string_view label) {
  const int limit = context.info().texture_side_max;
  if (width > limit || height > limit) {
    return over_limit(context, label, "a texture", limit, std::max(width, height), "texels a side");
  }
  VOXELD_TRY(context.check("before creating texture " + std::string(label)));
  const GlApi& gl = context.gl();
  Texture2D texture;
  texture.context_ = &context;
  texture.width_ = width;
  texture.height_ = height;
  texture.levels_ = levels;
  gl.CreateTextures(GL_TEXTURE_2D, 1, &texture.id_);
  gl.TextureStorage2D(texture.id_, levels, GL_RGBA8UI, width, height);
  // Integer textures are complete only with nearest filters.
  gl.TextureParameteri(texture.id_, GL_TEXTURE_MIN_FILTER,
                       levels > 1 ? GL_NEAREST_MIPMAP_NEAREST : GL_NEAREST);
  gl.TextureParameteri(texture.id_, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
  label_object(context, GL_TEXTURE, texture.id_, label);
  VOXELD_TRY(context.check("creating texture " + std::string(label) + " of " +
                           std::to_string(width) + "x" + std::to_string(height)));
  return texture;
}

Texture2D::~Texture2D() {
  if (id_ != 0) context_->gl().DeleteTextures(1, &id_);
}
Texture2D::Texture2D(Texture2D&& other) noexcept
    : context_(other.context_),
      id_(std::exchange(other.id_, 0)),
      width_(other.width_),
      height_(other.height_),
      levels_(other.levels_) {}
Texture2D& Texture2D::operator=(Texture2D&& other) noexcept {
  std::swap(context_, other.context_);
  std::swap(id_, other.id_);
  std::swap(width_, other.width_);
  std::swap(height_, other.height_);
  std::swap(levels_, other.levels_);
  return *this;
}

void Texture2D::upload_level(int level, std::span<const uint8_t> rgba) {
  const int width = std::max(1, width_ >> level), height = std::max(1, height_ >> level);
  VOXELD_CHECK(level < levels_ && rgba.size() == size_t{4} * width * height,
               "a level takes exactly its texels");
  context_->gl().TextureSubImage2D(id_, level, 0, 0, width, height, GL_RGBA_INTEGER,
                                   GL_UNSIGNED_BYTE, rgba.data());
}

void Texture2D::bind(uint32_t unit) const {
  context_->gl().BindTextureUnit(unit, id_);
}

Result<Framebuffer> Framebuffer::create(const Context& context, uint32_t internal_format, int width,
                                        int height, std::string_view label) {
  const int limit = std::min(context.info().framebuffer_side_max, context.info().texture_side_max);
  if (width > limit || height > limit) {
    return over_limit(context, label, "a framebuffer", limit, std::max(width, height),
                      "pixels a side");
  }
  VOXELD_TRY(context.check("before creating framebuffer " + std::string(label)));
  const GlApi& gl = context.gl();
  Framebuffer framebuffer;
  framebuffer.context_ = &context;
  framebuffer.width_ = width;
  framebuffer.height_ = height;
  gl.CreateFramebuffers(1, &framebuffer.id_);
  label_object(context, GL_FRAMEBUFFER, framebuffer.id_, label);
  if (internal_format != GL_NONE) {
    gl.CreateTextures(GL_TEXTURE_2D, 1, &framebuffer.color_);
    gl.TextureStorage2D(framebuffer.color_, 1, internal_format, width, height);
    label_object(context, GL_TEXTURE, framebuffer.color_, label);
    gl.NamedFramebufferTexture(framebuffer.id_, GL_COLOR_ATTACHMENT0, framebuffer.color_, 0);
  } else {
    gl.NamedFramebufferParameteri(framebuffer.id_, GL_FRAMEBUFFER_DEFAULT_WIDTH, width);
    gl.NamedFramebufferParameteri(framebuffer.id_, GL_FRAMEBUFFER_DEFAULT_HEIGHT, height);
    gl.NamedFramebufferDrawBuffer(framebuffer.id_, GL_NONE);
  }
  const GLenum state = gl.CheckNamedFramebufferStatus(framebuffer.id_, GL_DRAW_FRAMEBUFFER);
  VOXELD_TRY(context.check("creating framebuffer " + std::string(label) + " of " +
                           std::to_string(width) + "x" + std::to_string(height)));
  if (state != GL_FRAMEBUFFER_COMPLETE) {
    return Error{ErrorCode::kInternal, "framebuffer " + std::string(label) + " is incomplete",
                 "GL_FRAMEBUFFER_COMPLETE", gl_error_name(state)};
  }
  return framebuffer;
}

Result<Framebuffer> Framebuffer::create_rgba8(const Context& context, int width, int height,
                                              std::string_view label) {
  return create(context, GL_RGBA8, width, height, label);
}
Result<Framebuffer> Framebuffer::create_rgba32i(const Context& context, int width, int height,
                                                std::string_view label) {
  return create(context, GL_RGBA32I, width, height, label);
}
Result<Framebuffer> Framebuffer::create_empty(const Context& context, int width, int height,
                                              std::string_view label) {
  return create(context, GL_NONE, width, height, label);
}

Framebuffer::~Framebuffer() {
  if (color_ != 0) context_->gl().DeleteTextures(1, &color_);
  if (id_ != 0) context_->gl().DeleteFramebuffers(1, &id_);
}
Framebuffer::Framebuffer(Framebuffer&& other) noexcept
    : context_(other.context_),
      id_(std::exchange(other.id_, 0)),
      color_(std::exchange(other.color_, 0)),
      width_(other.width_),
      height_(other.height_) {}
Framebuffer& Framebuffer::operator=(Framebuffer&& other) noexcept {
  std::swap(context_, other.context_);
  std::swap(id_, other.id_);
  std::swap(color_, other.color_);
  std::swap(width_, other.width_);
  std::swap(height_, other.height_);
  return *this;
}

void Framebuffer::bind() const {
  context_->gl().BindFramebuffer(GL_FRAMEBUFFER, id_);
  context_->gl().Viewport(0, 0, width_, height_);
}

void Framebuffer::read_rgba8(std::span<uint8_t> out) const {
  read_rgba8(0, 0, width_, height_, out);
}

void Framebuffer::read_rgba8(int x, int y, int width, int height, std::span<uint8_t> out) const {
  VOXELD_CHECK(out.size() == size_t{4} * width * height, "4 bytes per pixel");
  context_->gl().BindFramebuffer(GL_READ_FRAMEBUFFER, id_);
  context_->gl().ReadPixels(x, y, width, height, GL_RGBA, GL_UNSIGNED_BYTE, out.data());
}

void Framebuffer::read_rgba32i(std::span<int32_t> out) const {
  VOXELD_CHECK(out.size() == size_t{4} * width_ * height_, "4 integers per pixel");
  context_->gl().BindFramebuffer(GL_READ_FRAMEBUFFER, id_);
  context_->gl().ReadPixels(0, 0, width_, height_, GL_RGBA_INTEGER, GL_INT, out.data());
}

VertexArray VertexArray::create(const Context& context) {
  VertexArray array;
  array.context_ = &context;
  context.gl().CreateVertexArrays(1, &array.id_);
  return array;
}
VertexArray::~VertexArray() {
  if (id_ != 0) context_->gl().DeleteVertexArrays(1, &id_);
}
VertexArray::VertexArray(VertexArray&& other) noexcept
    : context_(other.context_), id_(std::exchange(other.id_, 0)) {}
VertexArray& VertexArray::operator=(VertexArray&& other) noexcept {
  std::swap(context_, other.context_);
  std::swap(id_, other.id_);
  return *this;
}
void VertexArray::bind() const {
  context_->gl().BindVertexArray(id_);
}

}  // namespace voxeld::gpu
