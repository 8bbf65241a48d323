#include "server/voxel/gl/skin/skin_pass.h"

#include <algorithm>
#include <cstddef>
#include <initializer_list>

#include "server/base/check.h"
#include "server/base/log.h"
#include "server/scene/core/mesh_error.h"
#include "server/voxel/gl/skin/skin_check.h"

namespace voxeld {
namespace {

static_assert(sizeof(Influence) == sizeof(shared::SkinInfluence) &&
              offsetof(Influence, weight) == offsetof(shared::SkinInfluence, weight));
static_assert(sizeof(glm::dvec3) == 24);

// The length of the longest range [firsts[v], firsts[v + 1]).
size_t longest_range(std::span<const uint32_t> firsts) {
  size_t longest = 0;
  for (size_t v = 0; v + 1 < firsts.size(); ++v) {
    longest = std::max<size_t>(longest, firsts[v + 1] - firsts[v]);
  }
  return longest;
}

std::vector<shared::SkinMorph> morphs_of(const SkinTable& table) {
  std::vector<shared::SkinMorph> morphs;
  morphs.reserve(table.morphs.size());
  for (const MorphDelta& morph : table.morphs) {
    // Converted to double here, because drivers may flush small floats to 0.
    const glm::dvec3 delta(morph.position);
    morphs.push_back({morph.weight, 0, delta.x, delta.y, delta.z});
  }
  return morphs;
}

void append(std::vector<double>& words, std::initializer_list<glm::dvec3> vectors) {
  for (const glm::dvec3& v : vectors) words.insert(words.end(), {v.x, v.y, v.z});
}

// Appends the upper three rows.
void append(std::vector<double>& words, const glm::dmat4& m) {
  append(words, {glm::dvec3(m[0]), glm::dvec3(m[1]), glm::dvec3(m[2]), glm::dvec3(m[3])});
}

}  // namespace

bool SkinPass::fits(const SkinTable& table, int64_t storage_bytes) {
  const auto limit = static_cast<size_t>(storage_bytes);
  const size_t firsts = table.first_influence.size() + table.first_morph.size();
  const bool fits = table.points.size() <= limit / sizeof(glm::dvec3) &&
                    table.vertex_count() <= limit / sizeof(glm::dvec3) &&
                    table.influences.size() <= limit / sizeof(shared::SkinInfluence) &&
                    table.morphs.size() <= limit / sizeof(shared::SkinMorph) &&
                    firsts <= limit / sizeof(uint32_t);
  return fits && longest_range(table.first_influence) + longest_range(table.first_morph) <=
                     size_t{SKIN_LOOP_MAX};
}

Result<bool> SkinPass::is_exact() {
  if (is_exact_) return *is_exact_;
  const Result<bool> checked = skins_exactly(*context_, *this);
  end_frames();
  is_exact_ = checked.ok() && *checked;
  if (!*is_exact_) {
    log::warn("vertices of animations are moved by the cpu",
              {{"device", context_->info().renderer},
               {"why", checked.ok() ? "64-bit floats that differ" : checked.error().message()}});
  }
  return *is_exact_;
}

template <typename T>
Status SkinPass::put(gpu::Buffer& buffer, const std::vector<T>& values, const char* label) {
  const auto all = std::span<const T>(values);
  VOXELD_TRY(gpu::ensure_size(buffer, *context_, all.size_bytes(), label));
  buffer.upload(0, all);
  table_bytes_ += static_cast<int64_t>(all.size_bytes());
  return {};
}

Status SkinPass::begin_frames(const SkinTable& table, uint64_t key) {
  if (key != 0 && key == key_) return {};
  key_ = 0;
  table_bytes_ = 0;
  is_point_per_influence_ = table.is_point_per_influence;
  has_morphs_ = !table.first_morph.empty();
  std::vector<uint32_t> firsts = table.first_influence;
  firsts.insert(firsts.end(), table.first_morph.begin(), table.first_morph.end());
  VOXELD_TRY(put(points_, table.points, "points to skin"));
  VOXELD_TRY(put(firsts_, firsts, "ranges of influences"));
  VOXELD_TRY(put(influences_, table.influences, "influences"));
  VOXELD_TRY(put(morphs_, morphs_of(table), "morphs"));
  key_ = key;
  return context_->check("uploading what vertices follow");
}

void SkinPass::end_frames() {
  key_ = 0;
  for (gpu::Buffer* buffer : {&points_, &firsts_, &influences_, &morphs_, &positions_}) {
    *buffer = gpu::Buffer();
  }
}

Status SkinPass::upload_frame(const SkinFrame& frame) {
  const GridSpec& spec = frame.spec;
  const glm::dvec3 per_voxel = 1.0 / spec.voxel_size;
  words_.clear();
  append(words_, frame.world_from_file);
  append(words_, {spec.origin_world, spec.voxel_size, per_voxel});
  words_.push_back(kCoordinateAbsMax);
  VOXELD_CHECK(words_.size() == SKIN_MATRICES, "the frame's head is laid out in skin.h");
  for (const glm::dmat4& matrix : frame.pose.world_from_bound) append(words_, matrix);
  shared::SkinParams params{};
  params.dims = {spec.dims.x, spec.dims.y, spec.dims.z, 0};
  params.vertex_count = static_cast<uint32_t>(frame.table.vertex_count());
  params.is_turned = frame.world_from_file == glm::dmat4(1.0) ? 0 : 1;
  params.writes_positions = frame.wants_positions ? 1 : 0;
  params.morph_weights = static_cast<uint32_t>(words_.size());
  const auto& weights = frame.pose.morph_weights;
  words_.insert(words_.end(), weights.begin(), weights.end());
  const auto words = std::span<const double>(words_);
  const size_t positions = frame.wants_positions ? frame.table.vertex_count() : 1;
  VOXELD_TRY(gpu::ensure_size(frame_, *context_, words.size_bytes(), "pose"));
  VOXELD_TRY(gpu::ensure_size(positions_, *context_, positions * sizeof(glm::dvec3), "positions"));
  VOXELD_TRY(gpu::ensure_size(state_, *context_, sizeof(uint32_t), "state of vertices"));
  VOXELD_TRY(gpu::ensure_size(params_, *context_, sizeof(params), "skin parameters"));
  frame_.upload(0, words);
  params_.upload(0, std::span<const shared::SkinParams>(&params, 1));
  state_.clear(0, sizeof(uint32_t));
  uploaded_bytes_ = static_cast<int64_t>(words.size_bytes() + sizeof(params)) + table_bytes_;
  table_bytes_ = 0;
  return context_->check("uploading a pose");
}

void SkinPass::bind(const gpu::Buffer& vertices) const {
  params_.bind_uniform(SKIN_PARAMS);
  vertices.bind_storage(SKIN_VERTICES);
  positions_.bind_storage(SKIN_POSITIONS);
  points_.bind_storage(SKIN_POINTS);
  firsts_.bind_storage(SKIN_FIRSTS);
  influences_.bind_storage(SKIN_INFLUENCES);
  morphs_.bind_storage(SKIN_MORPH_DELTAS);
  frame_.bind_storage(SKIN_FRAME);
  state_.bind_storage(SKIN_STATE);
}

Result<const gpu::Program*> SkinPass::program() const {
  return shaders_->get({{"skin.comp"}},
                       {{"SKIN_POINT_PER_INFLUENCE", is_point_per_influence_ ? "1" : "0"},
                        {"SKIN_MORPHS", has_morphs_ ? "1" : "0"}});
}

Result<bool> SkinPass::run(const SkinFrame& frame, const gpu::Buffer& vertices,
                           gpu::PassTimer& timer) {
  VOXELD_ASSIGN(const gpu::Program* made, program());
  VOXELD_TRY(upload_frame(frame));
  bind(vertices);
  const auto count = static_cast<int64_t>(frame.table.vertex_count());
  {
    const gpu::PassTimer::Pass pass = timer.measure("skin");
    made->use();
    made->dispatch((count + SKIN_GROUP_SIZE - 1) / SKIN_GROUP_SIZE);
  }
  context_->gl().MemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
  uint32_t state = 0;
  state_.read(0, std::span(&state, 1));
  VOXELD_TRY(context_->check("skinning"));
  return state == 0;
}

void SkinPass::read_positions(size_t first, std::span<glm::dvec3> positions) const {
  positions_.read(first * sizeof(glm::dvec3), positions);
}

int64_t SkinPass::bytes() const {
  size_t bytes = 0;
  for (const gpu::Buffer* buffer :
       {&points_, &firsts_, &influences_, &morphs_, &frame_, &positions_, &state_, &params_}) {
    bytes += buffer->size_bytes();
  }
  return static_cast<int64_t>(bytes);
}

}  // namespace voxeld
