// Colours and normals of a tile's voxels on the CPU: the sums that ../README.md defines, from the
// same functions that the shaders run (shaders/lib), compiled as C++.
//
// A tile is cut into 512 octants of 32^3 cells. The voxels of an octant are neighbours in Morton
// order and few enough that their sums stay in a core's cache, and no two threads add to the same
// sum; so each octant is a job of its own, from zeroed sums to finished bytes.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "proto/sparse_tile.h"
#include "server/voxel/bin.h"
#include "server/voxel/cpu/attribute_visitor.h"
#include "server/voxel/cpu/worker_pool.h"
#include "server/voxel/id_fold.h"
#include "server/voxel/mip_chain.h"
#include "server/voxel/tile_pipeline.h"

namespace voxeld {

// Levels of one image, as the attribute words count them.
using TextureLevels = std::vector<MipLevel>;

class CpuAttributes {
 public:
  explicit CpuAttributes(WorkerPool& pool)
      : pool_(&pool), workers_(static_cast<size_t>(pool.threads())) {}

  // Builds the levels of the images that triangles use, where they are not there from the frame
  // before. The plan must outlive the job.
  void begin_job(const VoxelizePlan& plan);
  void end_job();
  // Frees levels that were kept for further frames.
  void end_frames();

  // Fills color and normal of `tile`, whose bricks are what touches say. mask and word_offsets: of
  // compact_mask().
  void run(const TileBin& bin, std::span<const uint32_t> mask,
           std::span<const uint32_t> word_offsets, SparseTile& tile);
  // The same of what a device leaves to the CPU alone; the tile's channels have their full size.
  void finish(const TileBin& bin, std::span<const uint32_t> mask,
              std::span<const uint32_t> word_offsets, SparseTile& tile);

 private:
  struct Octant {
    uint32_t morton = 0;  // in the tile
    size_t voxel_first = 0, voxel_count = 0;
  };
  // A tile as run() and finish() get it.
  struct TileInput {
    const TileBin& bin;
    std::span<const uint32_t> mask, word_offsets;
    bool is_started;  // by a device
  };
  struct Worker {
    std::vector<uint64_t> sums;
    std::vector<NearestColor> nearest;
    std::vector<uint32_t> triangles;  // that may touch the octant
    IdFold fold;
  };

  void find_octants(const SparseTile& tile);
  void sort_triangles(const TileBin& bin);
  void add_triangle(const TileBin& bin, uint32_t triangle, const AttributeTarget& target) const;
  std::span<const uint32_t> octant_triangles(const Octant& octant, Worker& worker) const;
  // Adds the triangles up to the first of another id than the first one's, which is returned.
  size_t sum_id(const TileBin& bin, const IdChannel& channel, size_t first,
                const AttributeTarget& target, const Worker& worker) const;
  // What has the largest weight in each voxel. `target`: of the octant. Sorts worker.triangles.
  void fold_ids(const TileBin& bin, const Octant& octant, const IdChannel& channel,
                AttributeTarget target, Worker& worker, SparseTile& tile) const;
  // color=nearest. `target`: of the octant.
  void find_nearest(const TileBin& bin, const Octant& octant, AttributeTarget target,
                    Worker& worker, SparseTile& tile) const;
  void run_octants(const TileInput& input, SparseTile& tile);
  // Whether there are fewer octants than threads, and more to do for one than a thread is worth.
  bool shares_octants(const TileInput& input) const;
  // All threads add a part of each octant's triangles to sums of their own.
  void run_shared_octants(const TileInput& input, SparseTile& tile);
  AttributeTarget target_of(const TileInput& input, const Octant& octant) const;
  void run_octant(const TileInput& input, const Octant& octant, Worker& worker,
                  SparseTile& tile) const;

  WorkerPool* pool_;
  std::vector<Worker> workers_;
  const VoxelizePlan* plan_ = nullptr;
  std::vector<TextureLevels> textures_;  // per image; empty where unused
  uint64_t textures_key_ = 0;            // VoxelizePlan::textures_key of textures_; 0: none
  std::vector<Octant> octants_;          // with voxels
  // Triangles by octant: list_[starts_[o]..starts_[o + 1]); those that reach more than a few are in
  // wide_ instead.
  std::vector<uint32_t> starts_, list_, wide_;
};

}  // namespace voxeld
