#include "server/voxel/frames/shared_frames.h"

#include <algorithm>
#include <atomic>

#include "server/scene/core/animated_scene.h"

namespace voxeld {
namespace {

uint64_t next_key() {
  static std::atomic<uint64_t> last = 0;
  return ++last;
}

}  // namespace

SharedFrames::SharedFrames(const GridSpec& spec)
    : spec_(spec), mesh_key_(next_key()), textures_key_(next_key()) {}

const WantedChannels& SharedFrames::channels(const Scene& scene, const VoxelizeOptions& options) {
  if (!channels_) channels_ = wanted_channels(scene, options);
  return *channels_;
}

Status SharedFrames::move_vertices() {
  if (!posed_ || posed_->is_moved) return {};
  FrameVertices vertices;
  // The properties that do not move are read from the bind pose, which the scene always holds.
  VOXELD_TRY(skin_vertices(*posed_->table, *posed_->scene, *posed_->pose, vertices));
  swap_vertices(vertices, *posed_->scene);
  posed_->is_moved = true;
  return {};
}

void SharedFrames::unite_levels(std::vector<ImageLevels>& of_frame) {
  levels_.resize(of_frame.size());
  bool grew = false;
  for (size_t i = 0; i < of_frame.size(); ++i) {
    ImageLevels& all = levels_[i];
    const ImageLevels united{std::min(all.first, of_frame[i].first),
                             std::max(all.last, of_frame[i].last)};
    grew |= united.first != all.first || united.last != all.last;
    all = of_frame[i] = united;
  }
  if (grew) textures_key_ = next_key();
}

}  // namespace voxeld
