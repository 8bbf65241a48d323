// Move-only GL objects with direct state access; id 0 is empty. They point to their Context, which
// must outlive them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "server/gpu/context.h"
#include "server/gpu/pass_timer.h"

namespace voxeld::gpu {

// A buffer's memory, readable and writable until unmap() or the end of this object. Until then the
// device must not use the buffer, and the buffer must not be destroyed.
class BufferMapping {
 public:
  BufferMapping(const Context& context, uint32_t buffer, std::span<uint8_t> bytes)
      : context_(&context), buffer_(buffer), bytes_(bytes) {}
  ~BufferMapping();
  BufferMapping(BufferMapping&& other) noexcept;
  BufferMapping& operator=(BufferMapping&& other) noexcept;

  template <typename T>
  std::span<T> as() const {
    return {reinterpret_cast<T*>(bytes_.data()), bytes_.size() / sizeof(T)};
  }
  // Errors: device-unavailable if the driver lost the contents.
  Status unmap();

 private:
  const Context* context_;
  uint32_t buffer_;  // 0: no longer mapped
  std::span<uint8_t> bytes_;
};

// Immutable storage in device memory, written by upload() and read by read().
class Buffer {
 public:
  Buffer() = default;
  // Creates a zeroed buffer. Errors: grid-too-large if over ssbo_bytes_max, device-unavailable if
  // the driver is out of memory.
  static Result<Buffer> create(const Context& context, size_t bytes, std::string_view label);
  // The same with memory for map(): host memory, which software drivers always use.
  static Result<Buffer> create_mappable(const Context& context, size_t bytes,
                                        std::string_view label);
  ~Buffer();
  Buffer(Buffer&& other) noexcept;
  Buffer& operator=(Buffer&& other) noexcept;

  uint32_t id() const { return id_; }
  size_t size_bytes() const { return bytes_; }
  // offset_bytes + data.size() must be <= size_bytes().
  void upload(size_t offset_bytes, std::span<const uint8_t> data);
  template <typename T>
  void upload(size_t offset_bytes, std::span<const T> data) {
    upload(offset_bytes,
           std::span(reinterpret_cast<const uint8_t*>(data.data()), data.size_bytes()));
  }
  void read(size_t offset_bytes, std::span<uint8_t> out) const;
  template <typename T>
  void read(size_t offset_bytes, std::span<T> out) const {
    read(offset_bytes, std::span(reinterpret_cast<uint8_t*>(out.data()), out.size_bytes()));
  }
  // Waits for the device. `bytes` > 0. Errors: as Context::check().
  Result<BufferMapping> map(size_t offset_bytes, size_t bytes);
  // Fills [offset, offset+bytes) with a 32-bit pattern; both multiples of 4.
  void clear(size_t offset_bytes, size_t bytes, uint32_t value = 0);
  void bind_storage(uint32_t binding) const;
  void bind_storage(uint32_t binding, size_t offset_bytes, size_t bytes) const;
  void bind_uniform(uint32_t binding) const;
  // Binds the buffer for Program::dispatch_indirect().
  void bind_indirect() const;

 private:
  static Result<Buffer> create(const Context& context, size_t bytes, std::string_view label,
                               uint32_t flags);
  const Context* context_ = nullptr;
  uint32_t id_ = 0;
  size_t bytes_ = 0;
};

// Makes `buffer` at least `bytes` large. A buffer that is large enough is left alone; the contents
// are lost if it grows.
Status ensure_size(Buffer& buffer, const Context& context, size_t bytes, std::string_view label);
// The same by create_mappable().
Status ensure_mappable(Buffer& buffer, const Context& context, size_t bytes,
                       std::string_view label);

// An RGBA8UI texture with all mips. It is only read by texelFetch, because filtering in the shader
// is the same on all drivers.
class Texture2D {
 public:
  Texture2D() = default;
  static Result<Texture2D> create_rgba8ui(const Context& context, int width, int height, int levels,
                                          std::string_view label);
  ~Texture2D();
  Texture2D(Texture2D&& other) noexcept;
  Texture2D& operator=(Texture2D&& other) noexcept;
  uint32_t id() const { return id_; }
  int width() const { return width_; }
  int height() const { return height_; }
  int levels() const { return levels_; }
  // rgba.size() must be 4 * w * h of that level.
  void upload_level(int level, std::span<const uint8_t> rgba);
  void bind(uint32_t unit) const;

 private:
  const Context* context_ = nullptr;
  uint32_t id_ = 0;
  int width_ = 0, height_ = 0, levels_ = 0;
};

// An RGBA8 colour target, or no attachment for passes that only write storage.
class Framebuffer {
 public:
  Framebuffer() = default;
  static Result<Framebuffer> create_rgba8(const Context& context, int width, int height,
                                          std::string_view label);
  static Result<Framebuffer> create_empty(const Context& context, int width, int height,
                                          std::string_view label);
  ~Framebuffer();
  Framebuffer(Framebuffer&& other) noexcept;
  Framebuffer& operator=(Framebuffer&& other) noexcept;
  // Binds the framebuffer and sets the viewport to its whole size.
  void bind() const;
  // A target of four 32-bit integers per pixel, for passes that return data instead of colours.
  static Result<Framebuffer> create_rgba32i(const Context& context, int width, int height,
                                            std::string_view label);
  // Bottom row first, 4 bytes per pixel.
  void read_rgba8(std::span<uint8_t> out) const;
  // The block [x, x+width) x [y, y+height), bottom row first.
  void read_rgba8(int x, int y, int width, int height, std::span<uint8_t> out) const;
  void read_rgba32i(std::span<int32_t> out) const;
  uint32_t id() const { return id_; }
  int width() const { return width_; }
  int height() const { return height_; }

 private:
  static Result<Framebuffer> create(const Context& context, uint32_t internal_format, int width,
                                    int height, std::string_view label);
  const Context* context_ = nullptr;
  uint32_t id_ = 0, color_ = 0;
  int width_ = 0, height_ = 0;
};

// An empty vertex array (passes pull their vertices from storage buffers).
class VertexArray {
 public:
  VertexArray() = default;
  static VertexArray create(const Context& context);
  ~VertexArray();
  VertexArray(VertexArray&& other) noexcept;
  VertexArray& operator=(VertexArray&& other) noexcept;
  void bind() const;

 private:
  const Context* context_ = nullptr;
  uint32_t id_ = 0;
};

}  // namespace voxeld::gpu
