#include "server/voxel/cpu/attribute_tile.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>

#include <glm/common.hpp>

#include "server/base/cancel_point.h"
#include "server/grid/color/color_tables.h"
#include "server/voxel/attributes/resolve.h"
#include "server/voxel/attributes/sum_fold.h"
#include "server/voxel/cpu/attribute_visitor.h"
#include "server/voxel/triangles/tile_window.h"
#include "shaders/shared/attributes.h"

namespace voxeld {
namespace {

constexpr int kOctantShift = 5;
constexpr int kOctantSide = 1 << kOctantShift;
constexpr int kOctantsPerSide = limits::kTileSide / kOctantSide;
constexpr size_t kOctantCount = size_t{kOctantsPerSide} * kOctantsPerSide * kOctantsPerSide;
constexpr uint32_t kOctantBricks = 64;
constexpr size_t kBrickMaskWords = 16;
constexpr size_t kBoxGrain = 1 << 12;  // triangles
// Triangles that reach more octants are listed once as wide, and every octant tests them.
constexpr int kListedOctantsMax = 8;
// Octants with fewer triangles are summed by one thread.
constexpr size_t kSharedTrianglesMin = 4096;

struct Box {
  glm::ivec3 first{0}, last{0};  // inclusive; empty if last < first
  bool empty() const { return last.x < first.x || last.y < first.y || last.z < first.z; }
};

std::array<glm::ivec3, 3> corners_in_tile(const SnappedMesh& mesh, uint32_t triangle,
                                          const glm::ivec3& tile_coord) {
  const glm::ivec3 tile_q = tile_coord * (limits::kTileSide * kSubVoxelsPerVoxel);
  const auto& vertices = mesh.triangles[triangle].vertices;
  return {mesh.vertices[vertices[0]] - tile_q, mesh.vertices[vertices[1]] - tile_q,
          mesh.vertices[vertices[2]] - tile_q};
}

// The cells of the triangle's box.
Box cell_box(const std::array<glm::ivec3, 3>& q) {
  return {glm::min(q[0], glm::min(q[1], q[2])) >> 8, glm::max(q[0], glm::max(q[1], q[2])) >> 8};
}

// Calls visit(octant) with the Morton index of each octant of the box.
template <typename OctantBox, typename Visit>
void for_each_octant(const OctantBox& box, const Visit& visit) {
  for (int z = box.first[2]; z <= box.last[2]; ++z) {
    for (int y = box.first[1]; y <= box.last[1]; ++y) {
      for (int x = box.first[0]; x <= box.last[0]; ++x) {
        visit(morton_encode(static_cast<uint32_t>(x), static_cast<uint32_t>(y),
                            static_cast<uint32_t>(z)));
      }
    }
  }
}

// The number of octants in the box.
template <typename OctantBox>
int volume(const OctantBox& box) {
  int product = 1;
  for (size_t c = 0; c < 3; ++c) product *= std::max(box.last[c] - box.first[c] + 1, 0);
  return product;
}

}  // namespace

void CpuAttributes::begin_job(const VoxelizePlan& plan) {
  plan_ = &plan;
  if (plan.textures_key != 0 && plan.textures_key == textures_key_) return;
  textures_key_ = 0;  // until all are made
  textures_.assign(plan.scene.images.size(), {});
  for (size_t i = 0; i < textures_.size(); ++i) {
    const ImageLevels& used = plan.records->image_levels()[i];
    if (used.used()) {
      textures_[i] = build_mip_levels(plan.scene.images[i], used.first, used.last);
    }
  }
  textures_key_ = plan.textures_key;
}

void CpuAttributes::end_job() {
  if (textures_key_ == 0) textures_.clear();
  plan_ = nullptr;
}

void CpuAttributes::end_frames() {
  textures_.clear();
  textures_key_ = 0;
}

void CpuAttributes::find_octants(const TileInput& input, const SparseTile& tile) {
  octants_.clear();
  if (tile.brick_morton.empty()) return;
  for (const uint32_t brick : tile.brick_morton) {
    const uint32_t morton = brick / kOctantBricks;
    if (!octants_.empty() && octants_.back().morton == morton) continue;
    octants_.push_back({morton, input.word_offsets[size_t{brick} * kBrickMaskWords], 0});
  }
  const size_t last_word = (size_t{tile.brick_morton.back()} + 1) * kBrickMaskWords - 1;
  size_t end =
      input.word_offsets[last_word] + static_cast<size_t>(std::popcount(input.mask[last_word]));
  for (auto octant = octants_.rbegin(); octant != octants_.rend(); ++octant) {
    octant->voxel_count = end - octant->voxel_first;
    end = octant->voxel_first;
  }
}

void CpuAttributes::find_boxes(const TileBin& bin) {
  boxes_.resize(bin.triangles.size());
  const size_t chunks = (boxes_.size() + kBoxGrain - 1) / kBoxGrain;
  std::atomic<size_t> next = 0;
  const auto count = static_cast<int>(std::min(chunks, static_cast<size_t>(team_->threads())));
  team_->run(count, [&](int) {
    for (size_t chunk = next++; chunk < chunks; chunk = next++) {
      cancel_point();
      const size_t end = std::min(boxes_.size(), (chunk + 1) * kBoxGrain);
      for (size_t t = chunk * kBoxGrain; t < end; ++t) {
        const Box cells = cell_box(corners_in_tile(plan_->mesh, bin.triangles[t], bin.coord));
        for (int c = 0; c < 3; ++c) {
          const auto axis = static_cast<size_t>(c);
          boxes_[t].first[axis] =
              static_cast<int16_t>(std::clamp(cells.first[c] >> kOctantShift, 0, kOctantsPerSide));
          boxes_[t].last[axis] = static_cast<int16_t>(
              std::clamp(cells.last[c] >> kOctantShift, -1, kOctantsPerSide - 1));
        }
      }
    }
  });
}

// A counting sort, so that the lists keep the order of the bin.
void CpuAttributes::sort_triangles(const TileBin& bin) {
  find_boxes(bin);
  starts_.assign(kOctantCount + 2, 0);
  wide_.clear();
  for (size_t t = 0; t < boxes_.size(); ++t) {
    cancel_point();
    if (volume(boxes_[t]) > kListedOctantsMax) {
      wide_.push_back(bin.triangles[t]);
    } else {
      for_each_octant(boxes_[t], [&](uint32_t octant) { ++starts_[octant + 2]; });
    }
  }
  for (size_t o = 2; o < starts_.size(); ++o) starts_[o] += starts_[o - 1];
  list_.resize(starts_.back());
  // starts_[o + 1] is the place of octant o's next triangle. When the loop ends, it is where octant
  // o + 1 begins.
  for (size_t t = 0; t < boxes_.size(); ++t) {
    cancel_point();
    if (volume(boxes_[t]) > kListedOctantsMax) continue;
    for_each_octant(boxes_[t],
                    [&](uint32_t octant) { list_[starts_[octant + 1]++] = bin.triangles[t]; });
  }
}

void CpuAttributes::add_triangle(const TileBin& bin, uint32_t triangle,
                                 const AttributeTarget& target, AttributeVisitor& visitor) const {
  cancel_point();
  const auto q = corners_in_tile(plan_->mesh, triangle, bin.coord);
  const Box box = cell_box(q);
  const Box common = {glm::max(box.first, target.cell_first), glm::min(box.last, target.cell_last)};
  if (common.empty()) return;
  const bool is_flat = !target.channels.color || plan_->records->has_flat_color(triangle);
  if (is_flat && box.first == box.last && !target.channels.normal && target.nearest == nullptr) {
    OneCellSource source{box.first, one_cell_weight(q), {}};
    if (target.channels.color) source.linear16 = plan_->records->flat_color(triangle);
    add_one_cell(source, target);
    return;
  }
  const CornerOrder order = corner_order(q);
  AttributeSource source;
  source.corners = {q[order.corner[0]], q[order.corner[1]], q[order.corner[2]]};
  source.axis = dominant_axis(source.corners);
  std::array<uint32_t, ATTRIBUTE_WORDS> words{};
  plan_->records->write(triangle, source.corners, source.axis, order, words);
  source.words = words.data();
  const int image = plan_->part_images[plan_->mesh.triangles[triangle].part];
  if (image >= 0) source.levels = textures_[static_cast<size_t>(image)];
  visitor.add(source, target);
}

std::span<const uint32_t> CpuAttributes::octant_triangles(const Octant& octant,
                                                          Worker& worker) const {
  const auto first = list_.begin() + starts_[octant.morton];
  worker.triangles.assign(first, list_.begin() + starts_[octant.morton + 1]);
  worker.triangles.insert(worker.triangles.end(), wide_.begin(), wide_.end());
  return worker.triangles;
}

size_t CpuAttributes::sum_id(const TileBin& bin, const IdChannel& channel, size_t first,
                             const AttributeTarget& target, Worker& worker) const {
  const uint16_t id = channel.id_of(plan_->mesh, worker.triangles[first]);
  size_t end = first;
  for (; end < worker.triangles.size(); ++end) {
    const uint32_t triangle = worker.triangles[end];
    if (channel.id_of(plan_->mesh, triangle) != id) break;
    add_triangle(bin, triangle, target, worker.visitor);
  }
  return end;
}

void CpuAttributes::fold_ids(const TileBin& bin, const Octant& octant, const IdChannel& channel,
                             AttributeTarget target, Worker& worker, SparseTile& tile) const {
  const auto id_of = [&](uint32_t triangle) { return channel.id_of(plan_->mesh, triangle); };
  std::vector<uint32_t>& triangles = worker.triangles;
  std::ranges::sort(triangles, {}, id_of);
  const bool is_one = id_of(triangles.front()) == id_of(triangles.back());
  const bool is_color = channel.channel == Channel::kColor;
  if (is_color && is_one) return;  // resolved from the sums of all ids
  const auto samples = is_color ? std::span<uint16_t>()
                                : std::span(id_samples(tile, channel.channel))
                                      .subspan(octant.voxel_first, octant.voxel_count);
  if (!is_color && is_one) {
    std::ranges::fill(samples, id_of(triangles.front()));
    return;
  }
  if (!is_color) target.channels = {};
  SumFold colors(is_color ? octant.voxel_count : 0, target.channels);
  worker.fold.begin(is_color ? 0 : octant.voxel_count);
  const auto sum_at = [&](size_t at) { return worker.sums[at]; };
  for (size_t first = 0; first < triangles.size();) {
    const uint16_t id = id_of(triangles[first]);
    worker.sums.assign(octant.voxel_count * target.channels.count(), 0);
    target.sums = worker.sums.data();
    first = sum_id(bin, channel, first, target, worker);
    if (is_color) {
      colors.add(sum_at);
    } else {
      worker.fold.add(id, sum_at, samples);
    }
  }
  if (!is_color) return;
  resolve_voxels(colors.sums(), dominant_part(plan_->resolve_options()), octant.voxel_first, tile);
}

void CpuAttributes::find_nearest(const TileBin& bin, const Octant& octant, AttributeTarget target,
                                 Worker& worker, SparseTile& tile) const {
  worker.nearest.assign(octant.voxel_count, {});
  target.nearest = worker.nearest.data();
  target.channels = plan_->channels.recorded();
  for (const uint32_t triangle : worker.triangles)
    add_triangle(bin, triangle, target, worker.visitor);
  const auto& srgb8 = srgb8_from_linear16();
  uint8_t* out = &tile.color[4 * octant.voxel_first];
  for (const NearestColor& point : worker.nearest) {
    const auto& [r, g, b, a] = point.linear16;
    const auto color = straight_mean({r, g, b, a}, 1, plan_->channels.has_alpha);
    for (size_t c = 0; c < 3; ++c) *out++ = srgb8[color[c]];
    *out++ = alpha8(color[3]);
  }
}

AttributeTarget CpuAttributes::target_of(const TileInput& input, const Octant& octant) const {
  const auto place = morton_decode(octant.morton);
  AttributeTarget target;
  target.mask = input.mask;
  target.word_offsets = input.word_offsets;
  target.cell_first = glm::ivec3(place[0], place[1], place[2]) * kOctantSide;
  target.cell_last =
      glm::min(target.cell_first + (kOctantSide - 1), tile_cell_max(plan_->spec, input.bin.coord));
  target.voxel_first = octant.voxel_first;
  target.channels = plan_->channels.summed;
  return target;
}

void CpuAttributes::run_octant(const TileInput& input, const Octant& octant, Worker& worker,
                               SparseTile& tile) const {
  AttributeTarget target = target_of(input, octant);
  const std::span<const uint32_t> triangles = octant_triangles(octant, worker);
  if (!input.is_started && plan_->needs_sums()) {
    worker.sums.assign(octant.voxel_count * target.channels.count(), 0);
    target.sums = worker.sums.data();
    for (const uint32_t triangle : triangles)
      add_triangle(input.bin, triangle, target, worker.visitor);
    resolve_voxels(worker.sums, plan_->resolve_options(), octant.voxel_first, tile);
  }
  if (plan_->channels.nearest) find_nearest(input.bin, octant, target, worker, tile);
  for (const IdChannel& channel : plan_->ids) {
    if (input.is_started && !channel.is_wide) continue;
    fold_ids(input.bin, octant, channel, target, worker, tile);
  }
}

void CpuAttributes::run_octants(const TileInput& input, SparseTile& tile) {
  find_octants(input, tile);
  if (octants_.empty()) return;
  if (shares_octants(input)) {
    run_shared_octants(input, tile);
    return;
  }
  sort_triangles(input.bin);
  std::atomic<size_t> next = 0;
  const auto count =
      static_cast<int>(std::min<size_t>(octants_.size(), static_cast<size_t>(team_->threads())));
  team_->run(count, [&](int worker) {
    for (size_t o = next++; o < octants_.size(); o = next++) {
      run_octant(input, octants_[o], workers_[static_cast<size_t>(worker)], tile);
    }
  });
}

bool CpuAttributes::shares_octants(const TileInput& input) const {
  const bool sums_alone =
      !input.is_started && plan_->needs_sums() && !plan_->channels.nearest && plan_->ids.empty();
  return sums_alone && octants_.size() < static_cast<size_t>(team_->threads()) &&
         input.bin.triangles.size() >= kSharedTrianglesMin;
}

void CpuAttributes::run_shared_octants(const TileInput& input, SparseTile& tile) {
  const auto threads = static_cast<size_t>(team_->threads());
  const std::span<const uint32_t> triangles = input.bin.triangles;
  for (const Octant& octant : octants_) {
    const AttributeTarget target = target_of(input, octant);
    const size_t sum_count = octant.voxel_count * target.channels.count();
    team_->run(team_->threads(), [&](int worker) {
      const auto number = static_cast<size_t>(worker);
      AttributeTarget own = target;
      workers_[number].sums.assign(sum_count, 0);
      own.sums = workers_[number].sums.data();
      const size_t begin = triangles.size() * number / threads;
      const size_t end = triangles.size() * (number + 1) / threads;
      for (size_t t = begin; t < end; ++t)
        add_triangle(input.bin, triangles[t], own, workers_[number].visitor);
    });
    std::vector<uint64_t>& sums = workers_[0].sums;
    for (size_t w = 1; w < threads; ++w) {
      cancel_point();
      for (size_t i = 0; i < sum_count; ++i) sums[i] += workers_[w].sums[i];
    }
    resolve_voxels(sums, plan_->resolve_options(), octant.voxel_first, tile);
  }
}

void CpuAttributes::run(const TileBin& bin, std::span<const uint32_t> mask,
                        std::span<const uint32_t> word_offsets, SparseTile& tile) {
  if (!tile.masks.empty()) resize_channels(tile, plan_->channels.grid);
  run_octants({bin, mask, word_offsets, false}, tile);
}

void CpuAttributes::finish(const TileBin& bin, std::span<const uint32_t> mask,
                           std::span<const uint32_t> word_offsets, SparseTile& tile) {
  run_octants({bin, mask, word_offsets, true}, tile);
}

}  // namespace voxeld
