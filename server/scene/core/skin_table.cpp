#include "server/scene/core/skin_table.h"

#include <algorithm>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "proto/thread_pool.h"
#include "server/base/cancel_point.h"
#include "server/base/parallel.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/core/normals.h"

namespace voxeld {
namespace {

// Starting a thread costs as much as some thousand vertices, so small scenes use one.
constexpr size_t kVerticesPerThreadMin = 8192;
constexpr size_t kThreadsMax = 8;

// Appends the ends of one part, shifted behind those of the parts before.
void append_ends(std::vector<uint32_t>& firsts, const std::vector<uint32_t>& ends) {
  const uint32_t base = firsts.back();
  make_room_in_pieces(firsts, ends.size());
  for_each_in_pieces(std::span(ends), [&](uint32_t end) { firsts.push_back(base + end); });
}

template <typename T>
void append(std::vector<T>& to, std::vector<T>& from) {
  if (to.empty()) {
    to = std::move(from);
    return;
  }
  make_room_in_pieces(to, from.size());
  for_each_in_pieces(std::span<const T>(from), [&](const T& value) { to.push_back(value); });
  free_in_pieces(from);
}

// Transforms a point by the upper three rows of world_from_bound.
glm::dvec3 moved(const glm::dmat4& m, const glm::dvec3& p) {
  return glm::dvec3(m[0]) * p.x + glm::dvec3(m[1]) * p.y + glm::dvec3(m[2]) * p.z +
         glm::dvec3(m[3]);
}

glm::dvec3 turned(const glm::dmat4& m, const glm::dvec3& n) {
  return glm::dvec3(m[0]) * n.x + glm::dvec3(m[1]) * n.y + glm::dvec3(m[2]) * n.z;
}

struct MovedVertex {
  glm::dvec3 position{0.0}, normal{0.0};
};

MovedVertex skin_by_influence(const SkinTable& table, const Pose& pose, size_t vertex) {
  MovedVertex out;
  for (uint32_t i = table.first_influence[vertex]; i < table.first_influence[vertex + 1]; ++i) {
    const Influence& influence = table.influences[i];
    const glm::dmat4& matrix = pose.world_from_bound[influence.matrix];
    out.position += influence.weight * moved(matrix, table.points[i]);
    out.normal += influence.weight * turned(matrix, glm::dvec3(table.normals[i]));
  }
  return out;
}

MovedVertex skin_by_vertex(const SkinTable& table, const Pose& pose, size_t vertex) {
  glm::dvec3 point = table.points[vertex];
  glm::dvec3 normal(table.normals[vertex]);
  if (!table.first_morph.empty()) {
    for (uint32_t i = table.first_morph[vertex]; i < table.first_morph[vertex + 1]; ++i) {
      const MorphDelta& morph = table.morphs[i];
      const double weight = pose.morph_weights[morph.weight];
      point += weight * glm::dvec3(morph.position);
      normal += weight * glm::dvec3(morph.normal);
    }
  }
  const uint32_t begin = table.first_influence[vertex], end = table.first_influence[vertex + 1];
  if (end == begin + 1) {
    const glm::dmat4& matrix = pose.world_from_bound[table.influences[begin].matrix];
    return {moved(matrix, point), world_normal(matrix, normal)};
  }
  glm::dmat4 blend(0.0);
  for (uint32_t i = begin; i < end; ++i) {
    const Influence& influence = table.influences[i];
    blend += influence.weight * pose.world_from_bound[influence.matrix];
  }
  return {moved(blend, point), world_normal(blend, normal)};
}

bool is_place(const glm::dvec3& p) {
  return is_coordinate(p.x) && is_coordinate(p.y) && is_coordinate(p.z);
}

// The findings of one thread.
struct ChunkReport {
  std::optional<size_t> lost_vertex;  // the first without a finite position
  bool has_vanished_normal = false;
};

ChunkReport skin_range(const SkinTable& table, const Pose& pose, size_t begin, size_t end,
                       FrameVertices& out) {
  ChunkReport report;
  const auto& firsts = table.part_first_vertex;
  const auto after = std::upper_bound(firsts.begin(), firsts.end(), begin);
  auto part = static_cast<size_t>(after - firsts.begin()) - 1;
  for (size_t v = begin; v < end; ++v) {
    cancel_point();
    while (v >= firsts[part + 1]) ++part;
    const MovedVertex vertex = table.is_point_per_influence ? skin_by_influence(table, pose, v)
                                                            : skin_by_vertex(table, pose, v);
    if (!is_place(vertex.position)) {
      report.lost_vertex = v;
      return report;
    }
    FrameVertices::Part& to = out.parts[part];
    const size_t at = v - firsts[part];
    to.positions[at] = vertex.position;
    if (to.normals.empty()) continue;
    to.normals[at] = direction_of(vertex.normal);
    report.has_vanished_normal |= to.normals[at] == glm::vec3(0.0f);
  }
  return report;
}

std::vector<ChunkReport> skin_all(const SkinTable& table, const Pose& pose, FrameVertices& out) {
  const size_t count = table.vertex_count();
  const size_t threads = std::min(ThreadPool::shared().threads(), kThreadsMax);
  const size_t chunks = std::clamp<size_t>(count / kVerticesPerThreadMin, 1, threads);
  std::vector<ChunkReport> reports(chunks);
  parallel_for(chunks, [&](size_t chunk) {
    reports[chunk] =
        skin_range(table, pose, count * chunk / chunks, count * (chunk + 1) / chunks, out);
  });
  return reports;
}

Error lost(const SkinTable& table, const Scene& bind, size_t vertex) {
  const auto& firsts = table.part_first_vertex;
  const auto after = std::upper_bound(firsts.begin(), firsts.end(), vertex);
  const auto part = static_cast<size_t>(after - firsts.begin()) - 1;
  return malformed_mesh("the animation", "part " + std::to_string(part),
                        "vertex " + std::to_string(vertex - firsts[part]) + " of " +
                            shown(bind.parts[part].name) + " gets to no finite place",
                        "coordinates of at most 1e30 in size", "");
}

}  // namespace

SkinTable join_skin_parts(std::vector<SkinPart> parts, bool is_point_per_influence) {
  SkinTable table;
  table.is_point_per_influence = is_point_per_influence;
  table.first_influence.push_back(0);
  table.first_morph.push_back(0);
  for (SkinPart& part : parts) {
    table.part_first_vertex.push_back(static_cast<uint32_t>(table.vertex_count()));
    append_ends(table.first_influence, part.influence_ends);
    append_ends(table.first_morph, part.morph_ends);
    append(table.influences, part.influences);
    append(table.morphs, part.morphs);
    append(table.points, part.points);
    append(table.normals, part.normals);
  }
  table.part_first_vertex.push_back(static_cast<uint32_t>(table.vertex_count()));
  if (table.morphs.empty()) table.first_morph = {};
  return table;
}

Status skin_vertices(const SkinTable& table, const Scene& bind, const Pose& pose,
                     FrameVertices& out) {
  out.parts.resize(bind.parts.size());
  for (size_t p = 0; p < bind.parts.size(); ++p) {
    out.parts[p].positions.resize(table.part_first_vertex[p + 1] - table.part_first_vertex[p]);
    out.parts[p].normals.resize(bind.parts[p].normals.empty() ? 0 : out.parts[p].positions.size());
  }
  bool has_vanished_normal = false;
  for (const ChunkReport& report : skin_all(table, pose, out)) {
    if (report.lost_vertex) return lost(table, bind, *report.lost_vertex);
    has_vanished_normal |= report.has_vanished_normal;
  }
  for (size_t p = 0; p < bind.parts.size() && has_vanished_normal; ++p) {
    FrameVertices::Part& part = out.parts[p];
    repair_normals(part.positions, bind.parts[p].indices, part.normals);
    // A vertex that no triangle uses gets (0, 0, 1).
    std::replace(part.normals.begin(), part.normals.end(), glm::vec3(0.0f), glm::vec3(0, 0, 1));
  }
  return {};
}

}  // namespace voxeld
