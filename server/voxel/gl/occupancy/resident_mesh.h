// A job's mesh on the device, for passes that read it triangle by triangle.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/gpu/objects.h"
#include "server/voxel/triangles/bin.h"
#include "server/voxel/triangles/snap.h"

namespace voxeld {

// Pairs of a tile and a triangle for part of a batch, tile after tile. It holds a part of each bin.
struct PairWindow {
  struct Part {
    uint32_t slot = 0;
    std::span<const uint32_t> triangles;
  };
  std::vector<Part> parts;
  size_t pair_count = 0;
};

// Cuts the bins of a batch into windows of at most `pairs_max` pairs.
std::vector<PairWindow> cut_pairs(std::span<const TileBin> bins, size_t pairs_max);

// Vertices and triangles on the device. They are uploaded once per job if storage buffers can hold
// them; else those of each window are gathered and uploaded with it. Triangles of frames stay for
// the next frame.
class ResidentMesh {
 public:
  explicit ResidentMesh(const gpu::Context& context) : context_(&context) {}

  // True if a mesh fits on the device in buffers of `storage_bytes`.
  static bool fits(size_t vertices, size_t triangles, int64_t storage_bytes);
  // The buffer to which a device may write q of `count` vertices before the next job, which then
  // passes has_vertices. They must fit.
  Result<const gpu::Buffer*> vertices(size_t count);

  // storage_bytes: size of one buffer. `mesh` must outlive the job. key: VoxelizePlan::mesh_key.
  // has_vertices: the vertices were written to vertices() after the last job.
  Status begin_job(const SnappedMesh& mesh, uint64_t key, bool has_vertices, int64_t storage_bytes);
  void end_job();
  // Forgets the keys, so that nothing uploaded before is used again.
  void end_frames() { triangles_key_ = pairs_key_ = 0; }

  // The most pairs of one window.
  size_t pairs_max() const { return pairs_max_; }
  // Uploads the window's pairs, unless they are the previous frame's, and its triangles, unless
  // they are resident. Binds nothing.
  Status upload(const PairWindow& window);
  // Number of groups of pairs of the uploaded window.
  size_t group_count() const { return group_count_; }
  // Binds BATCH_VERTICES to BATCH_GROUPS.
  void bind() const;
  // Bytes of all buffers now.
  int64_t bytes() const;
  // Bytes uploaded since begin_job(), its own included.
  int64_t uploaded_bytes() const { return uploaded_bytes_; }

 private:
  bool is_whole_mesh(const PairWindow& window) const;
  Status upload_groups(const PairWindow& window);
  Status upload_gathered(const PairWindow& window);

  const gpu::Context* context_;
  const SnappedMesh* mesh_ = nullptr;
  gpu::Buffer vertices_, triangles_, pairs_, groups_;
  bool is_resident_ = false;
  size_t pairs_max_ = 0, group_count_ = 0;
  int64_t uploaded_bytes_ = 0;
  // Keys of triangles_, and of pairs_ and groups_, if they hold all triangles. 0: they belong to
  // one job alone.
  uint64_t triangles_key_ = 0, pairs_key_ = 0;
};

}  // namespace voxeld
