// A job's mesh on the device, for passes that read it triangle by triangle.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/gpu/objects.h"
#include "server/voxel/bin.h"
#include "server/voxel/snap.h"

namespace voxeld {

// Pairs of a batch's tiles and triangles, tile after tile; a part of each bin.
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

// Vertices and triangles, uploaded once for the job where storage buffers can hold them; else those
// of each window are gathered and uploaded with it.
class ResidentMesh {
 public:
  explicit ResidentMesh(const gpu::Context& context) : context_(&context) {}

  // storage_bytes: of one buffer. `mesh` must outlive the job.
  Status begin_job(const SnappedMesh& mesh, int64_t storage_bytes);
  void end_job();

  // Pairs of one window at most.
  size_t pairs_max() const { return pairs_max_; }
  // Uploads the window's pairs, and its triangles where they are not resident. Binds nothing.
  Status upload(const PairWindow& window);
  // Groups of pairs of the uploaded window.
  size_t group_count() const { return group_count_; }
  // BATCH_VERTICES to BATCH_GROUPS.
  void bind() const;
  bool is_resident() const { return is_resident_; }
  // Of all buffers now.
  int64_t bytes() const;
  // Of the last upload(), and of begin_job().
  int64_t uploaded_bytes() const { return uploaded_bytes_; }

 private:
  Status upload_groups(const PairWindow& window);
  Status upload_gathered(const PairWindow& window);

  const gpu::Context* context_;
  const SnappedMesh* mesh_ = nullptr;
  gpu::Buffer vertices_, triangles_, pairs_, groups_;
  bool is_resident_ = false;
  size_t pairs_max_ = 0, group_count_ = 0;
  int64_t uploaded_bytes_ = 0;
};

}  // namespace voxeld
