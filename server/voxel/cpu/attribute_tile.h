// Colours and normals of a tile's voxels on the CPU: the sums that ../README.md defines. They come
// from the functions that the shaders run (shaders/lib), compiled as C++.
//
// A tile is cut into 512 octants of 32^3 cells, each a task from zeroed sums to finished bytes. The
// voxels of an octant are neighbours in Morton order and few enough for their sums to stay in a
// core's cache. No two threads add to the same sum.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "proto/codec/sparse_tile.h"
#include "server/base/parallel.h"
#include "server/voxel/attributes/id_fold.h"
#include "server/voxel/attributes/mip_chain.h"
#include "server/voxel/cpu/attribute_visitor.h"
#include "server/voxel/pipelines/tile_pipeline.h"
#include "server/voxel/triangles/bin.h"

namespace voxeld {

// The levels of one image, numbered as the attribute words number them.
using TextureLevels = std::vector<MipLevel>;

class CpuAttributes {
 public:
  CpuAttributes(ThreadTeam& team, CpuIsa isa)
      : team_(&team), workers_(static_cast<size_t>(team.threads()), Worker(isa)) {}

  // Builds the levels of the images that triangles use, unless the previous frame left them. The
  // plan must outlive the job.
  void begin_job(const VoxelizePlan& plan);
  void end_job();
  // Frees the levels that were stored for further frames.
  void end_frames();

  // Writes colour and normal of `tile`, whose bricks must be the touched cells. mask, word_offsets:
  // from compact_mask().
  void run(const TileBin& bin, std::span<const uint32_t> mask,
           std::span<const uint32_t> word_offsets, SparseTile& tile);
  // Computes only what a device leaves to the CPU. The tile's channels must have their full size.
  void finish(const TileBin& bin, std::span<const uint32_t> mask,
              std::span<const uint32_t> word_offsets, SparseTile& tile);

 private:
  // Octants that a triangle's box reaches, inclusive on each axis. None if a last one is less.
  struct OctantBox {
    std::array<int16_t, 3> first, last;
  };
  struct Octant {
    uint32_t morton = 0;  // Morton index in the tile
    size_t voxel_first = 0, voxel_count = 0;
  };
  // A tile, as run() and finish() take it.
  struct TileInput {
    const TileBin& bin;
    std::span<const uint32_t> mask, word_offsets;
    bool is_started;  // a device has done its part
  };
  struct Worker {
    explicit Worker(CpuIsa isa) : visitor(isa) {}
    AttributeVisitor visitor;
    std::vector<uint64_t> sums;
    std::vector<NearestColor> nearest;
    std::vector<uint32_t> triangles;  // triangles that may touch the octant
    IdFold fold;
  };

  void find_octants(const TileInput& input, const SparseTile& tile);
  void find_boxes(const TileBin& bin);
  void sort_triangles(const TileBin& bin);
  void add_triangle(const TileBin& bin, uint32_t triangle, const AttributeTarget& target,
                    AttributeVisitor& visitor) const;
  std::span<const uint32_t> octant_triangles(const Octant& octant, Worker& worker) const;
  // Adds the leading triangles, up to the first with another id; returns the index of that one.
  size_t sum_id(const TileBin& bin, const IdChannel& channel, size_t first,
                const AttributeTarget& target, Worker& worker) const;
  // Finds the id with the largest weight in each voxel of the octant. Sorts worker.triangles.
  // target: the octant's.
  void fold_ids(const TileBin& bin, const Octant& octant, const IdChannel& channel,
                AttributeTarget target, Worker& worker, SparseTile& tile) const;
  // Computes color=nearest. target: the octant's.
  void find_nearest(const TileBin& bin, const Octant& octant, AttributeTarget target,
                    Worker& worker, SparseTile& tile) const;
  void run_octants(const TileInput& input, SparseTile& tile);
  // True if there are fewer octants than threads, and enough triangles in one to be worth several
  // threads.
  bool shares_octants(const TileInput& input) const;
  // Each thread adds a part of every octant's triangles to its own sums.
  void run_shared_octants(const TileInput& input, SparseTile& tile);
  AttributeTarget target_of(const TileInput& input, const Octant& octant) const;
  void run_octant(const TileInput& input, const Octant& octant, Worker& worker,
                  SparseTile& tile) const;

  ThreadTeam* team_;
  std::vector<Worker> workers_;
  const VoxelizePlan* plan_ = nullptr;
  std::vector<TextureLevels> textures_;  // per image; empty where unused
  uint64_t textures_key_ = 0;            // VoxelizePlan::textures_key of textures_; 0: none
  std::vector<Octant> octants_;          // octants that have voxels
  // Triangles by octant: list_[starts_[o]..starts_[o + 1]). Triangles that reach more than a few
  // octants are in wide_ instead.
  std::vector<uint32_t> starts_, list_, wide_;
  std::vector<OctantBox> boxes_;  // of the bin's triangles
};

}  // namespace voxeld
