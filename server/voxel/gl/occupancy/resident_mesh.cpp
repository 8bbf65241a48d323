#include "server/voxel/gl/occupancy/resident_mesh.h"

#include <algorithm>
#include <numeric>

#include "shaders/shared/voxelize_batch.h"

namespace voxeld {
namespace {

static_assert(sizeof(glm::ivec3) == 12 && sizeof(SnappedTriangle) == 16);

constexpr size_t kVertexBytes = sizeof(glm::ivec3);
// A gathered triangle has three vertices of its own.
constexpr size_t kGatheredBytes = 3 * kVertexBytes;
// The most pairs of a window if the mesh is resident: 64 MiB of work items at one per pair.
constexpr size_t kPairsMax = size_t{1} << 23;

// An entry of BATCH_GROUPS.
struct Group {
  uint32_t first = 0;
  uint32_t slot_and_count = 0;
};

}  // namespace

std::vector<PairWindow> cut_pairs(std::span<const TileBin> bins, size_t pairs_max) {
  std::vector<PairWindow> windows(1);
  for (size_t slot = 0; slot < bins.size(); ++slot) {
    for (std::span<const uint32_t> rest = bins[slot].triangles; !rest.empty();) {
      if (windows.back().pair_count == pairs_max) windows.emplace_back();
      PairWindow& window = windows.back();
      const size_t count = std::min(rest.size(), pairs_max - window.pair_count);
      window.parts.push_back({static_cast<uint32_t>(slot), rest.first(count)});
      window.pair_count += count;
      rest = rest.subspan(count);
    }
  }
  return windows;
}

bool ResidentMesh::fits(size_t vertices, size_t triangles, int64_t storage_bytes) {
  const auto limit = static_cast<size_t>(storage_bytes);
  return vertices <= limit / kVertexBytes && triangles <= limit / sizeof(SnappedTriangle);
}

Result<const gpu::Buffer*> ResidentMesh::vertices(size_t count) {
  VOXELD_TRY(gpu::ensure_size(vertices_, *context_, count * kVertexBytes, "vertices"));
  return &vertices_;
}

Status ResidentMesh::begin_job(const SnappedMesh& mesh, uint64_t key, bool has_vertices,
                               int64_t storage_bytes) {
  mesh_ = &mesh;
  uploaded_bytes_ = 0;
  const auto limit = static_cast<size_t>(storage_bytes);
  const auto vertices = std::span<const glm::ivec3>(mesh.vertices.data(), mesh.vertices.size());
  const auto triangles =
      std::span<const SnappedTriangle>(mesh.triangles.data(), mesh.triangles.size());
  is_resident_ = has_vertices || fits(vertices.size(), triangles.size(), storage_bytes);
  pairs_max_ = std::max<size_t>(1, std::min(kPairsMax, limit / kGatheredBytes));
  if (!is_resident_) {
    end_frames();
    return {};
  }
  if (!has_vertices) {
    VOXELD_TRY(gpu::ensure_size(vertices_, *context_, vertices.size_bytes(), "vertices"));
    vertices_.upload(0, vertices);
    uploaded_bytes_ += static_cast<int64_t>(vertices.size_bytes());
  }
  if (key == 0 || key != triangles_key_) {
    end_frames();
    VOXELD_TRY(gpu::ensure_size(triangles_, *context_, triangles.size_bytes(), "triangles"));
    triangles_.upload(0, triangles);
    uploaded_bytes_ += static_cast<int64_t>(triangles.size_bytes());
    triangles_key_ = key;
  }
  return context_->check("uploading the mesh");
}

void ResidentMesh::end_job() {
  mesh_ = nullptr;
}

// True if the window has the pairs of a grid of one tile: all triangles, in their order.
bool ResidentMesh::is_whole_mesh(const PairWindow& window) const {
  return is_resident_ && window.parts.size() == 1 && window.parts.front().slot == 0 &&
         window.pair_count == mesh_->triangles.size();
}

Status ResidentMesh::upload(const PairWindow& window) {
  const uint64_t key = is_whole_mesh(window) ? triangles_key_ : 0;
  if (key != 0 && key == pairs_key_) return {};
  pairs_key_ = 0;
  VOXELD_TRY(gpu::ensure_size(pairs_, *context_, 4 * window.pair_count, "pairs"));
  VOXELD_TRY(upload_groups(window));
  if (!is_resident_) return upload_gathered(window);
  size_t at = 0;
  for (const PairWindow::Part& part : window.parts) {
    pairs_.upload(at, part.triangles);
    at += part.triangles.size_bytes();
  }
  pairs_key_ = key;
  return context_->check("uploading pairs");
}

Status ResidentMesh::upload_groups(const PairWindow& window) {
  std::vector<Group> groups;
  uint32_t first = 0;
  for (const PairWindow::Part& part : window.parts) {
    for (size_t done = 0; done < part.triangles.size(); done += BATCH_GROUP_SIZE) {
      const size_t count = std::min<size_t>(part.triangles.size() - done, BATCH_GROUP_SIZE);
      groups.push_back({first, part.slot | static_cast<uint32_t>(count - 1) << 8});
      first += static_cast<uint32_t>(count);
    }
  }
  group_count_ = groups.size();
  const auto words = std::span<const Group>(groups);
  VOXELD_TRY(gpu::ensure_size(groups_, *context_, words.size_bytes(), "groups of pairs"));
  groups_.upload(0, words);
  uploaded_bytes_ += static_cast<int64_t>(4 * window.pair_count + words.size_bytes());
  return {};
}

Status ResidentMesh::upload_gathered(const PairWindow& window) {
  std::vector<glm::ivec3> vertices;
  std::vector<SnappedTriangle> triangles;
  vertices.reserve(3 * window.pair_count);
  triangles.reserve(window.pair_count);
  for (const PairWindow::Part& part : window.parts) {
    for (const uint32_t index : part.triangles) {
      const SnappedTriangle& triangle = mesh_->triangles[index];
      const auto first = static_cast<uint32_t>(vertices.size());
      for (const uint32_t vertex : triangle.vertices) vertices.push_back(mesh_->vertices[vertex]);
      triangles.push_back({{first, first + 1, first + 2}, triangle.part});
    }
  }
  std::vector<uint32_t> pairs(window.pair_count);
  std::iota(pairs.begin(), pairs.end(), 0u);
  const auto vertex_words = std::span<const glm::ivec3>(vertices);
  const auto triangle_words = std::span<const SnappedTriangle>(triangles);
  VOXELD_TRY(gpu::ensure_size(vertices_, *context_, vertex_words.size_bytes(), "vertices"));
  VOXELD_TRY(gpu::ensure_size(triangles_, *context_, triangle_words.size_bytes(), "triangles"));
  vertices_.upload(0, vertex_words);
  triangles_.upload(0, triangle_words);
  pairs_.upload(0, std::span<const uint32_t>(pairs));
  uploaded_bytes_ += static_cast<int64_t>(vertex_words.size_bytes() + triangle_words.size_bytes());
  return context_->check("uploading a window of triangles");
}

void ResidentMesh::bind() const {
  vertices_.bind_storage(BATCH_VERTICES);
  triangles_.bind_storage(BATCH_TRIANGLES);
  pairs_.bind_storage(BATCH_PAIRS);
  groups_.bind_storage(BATCH_GROUPS);
}

int64_t ResidentMesh::bytes() const {
  return static_cast<int64_t>(vertices_.size_bytes() + triangles_.size_bytes() +
                              pairs_.size_bytes() + groups_.size_bytes());
}

}  // namespace voxeld
