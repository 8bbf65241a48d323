#include "server/voxel/gl/occupancy/tile_device.h"

#include <algorithm>

#include "server/base/check.h"

namespace voxeld {

Status TileDevice::begin_tile(const glm::ivec3& cell_max) {
  if (mask_.id() == 0) {
    VOXELD_ASSIGN(mask_, gpu::Buffer::create(*context_, kTileMaskBytes, "tile mask"));
    VOXELD_ASSIGN(params_, gpu::Buffer::create(*context_, sizeof(shared::VoxelizeParams),
                                               "voxelize parameters"));
  }
  cell_max_ = {cell_max.x, cell_max.y, cell_max.z, 0};
  cleared_blocks_ = 0;
  other_mask_ = nullptr;
  return {};
}

void TileDevice::use_mask(const gpu::Buffer& masks, size_t offset_bytes) {
  other_mask_ = &masks;
  other_offset_ = offset_bytes;
}

Status TileDevice::upload_window(const TileWindow& window, bool with_items) {
  const auto vertices = std::span<const int32_t>(window.vertices);
  VOXELD_TRY(gpu::ensure_size(triangles_, *context_, vertices.size_bytes(), "triangles"));
  triangles_.upload(0, vertices);
  if (!with_items) return {};
  const auto items = std::span<const WorkItemWords>(window.items);
  VOXELD_TRY(gpu::ensure_size(items_, *context_, items.size_bytes(), "work items"));
  items_.upload(0, items);
  return {};
}

Status TileDevice::clear_mask(uint64_t blocks) {
  if (other_mask_ != nullptr) return {};
  for_each_block_run(blocks & ~cleared_blocks_, [&](size_t first_word, size_t word_count) {
    mask_.clear(first_word * 4, word_count * 4);
  });
  cleared_blocks_ |= blocks;
  return context_->check("clearing the tile mask");
}

void TileDevice::read_mask(uint64_t blocks, std::span<uint32_t> out) const {
  context_->gl().MemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT | GL_SHADER_STORAGE_BARRIER_BIT);
  for_each_block_run(blocks, [&](size_t first_word, size_t word_count) {
    mask_.read(first_word * 4, out.subspan(first_word, word_count));
  });
}

void TileDevice::bind(const shared::VoxelizeParams& params) {
  params_.upload(0, std::span(&params, 1));
  params_.bind_uniform(VOXELIZE_PARAMS);
  triangles_.bind_storage(VOXELIZE_TRIANGLES);
  if (other_mask_ != nullptr) {
    other_mask_->bind_storage(VOXELIZE_MASK, other_offset_, kTileMaskBytes);
  } else {
    mask_.bind_storage(VOXELIZE_MASK);
  }
}

Status TileDevice::run_items(const gpu::Program& program, size_t first, size_t count,
                             shared::VoxelizeParams params) {
  const int side = context_->info().is_software ? VOXELIZE_BLOCK_COLUMNS : kHardwareBlockColumns;
  const size_t step = pace_->items(side * side);
  params.cell_max = cell_max_;
  for (size_t done = 0; done < count; done += step) {
    if (done > 0) VOXELD_TRY(pace_->rest());
    const size_t part = std::min(step, count - done);
    params.item_first = static_cast<uint32_t>(first + done);
    params.item_count = static_cast<uint32_t>(part);
    bind(params);
    items_.bind_storage(VOXELIZE_ITEMS);
    program.use();
    program.dispatch((static_cast<int64_t>(part) + VOXELIZE_GROUP_SIZE - 1) / VOXELIZE_GROUP_SIZE);
  }
  return {};
}

Status TileDevice::run_triangles(const gpu::Program& program, size_t first, size_t count,
                                 shared::VoxelizeParams params) {
  if (framebuffer_.id() == 0) {
    VOXELD_ASSIGN(framebuffer_, gpu::Framebuffer::create_empty(*context_, limits::kTileSide,
                                                               limits::kTileSide, "tile columns"));
    vertex_array_ = gpu::VertexArray::create(*context_);
  }
  params.cell_max = cell_max_;
  const size_t step = pace_->triangles();
  for (size_t done = 0; done < count; done += step) {
    if (done > 0) VOXELD_TRY(pace_->rest());
    params.triangle_first = static_cast<uint32_t>(first + done);
    bind(params);
    draw(program, std::min(step, count - done));
  }
  return {};
}

void TileDevice::draw(const gpu::Program& program, size_t triangles) const {
  framebuffer_.bind();
  vertex_array_.bind();
  const gpu::GlApi& gl = context_->gl();
  for (const GLenum off : {GL_CULL_FACE, GL_DEPTH_TEST, GL_STENCIL_TEST, GL_SCISSOR_TEST, GL_BLEND,
                           GL_RASTERIZER_DISCARD}) {
    gl.Disable(off);
  }
  program.use();
  gl.DrawArrays(GL_TRIANGLES, 0, static_cast<GLsizei>(3 * triangles));
}

int64_t TileDevice::bytes() const {
  return static_cast<int64_t>(triangles_.size_bytes() + items_.size_bytes() + mask_.size_bytes() +
                              params_.size_bytes());
}

}  // namespace voxeld
