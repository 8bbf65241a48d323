#include "tests/bench/bench_scene.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <map>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

#include <glm/vec3.hpp>

#include "server/base/disk/file.h"
#include "server/scene/load.h"
#include "tests/bench/waves.h"

namespace voxeld::bench {
namespace {

constexpr int kWaveTrianglesMax = 100'000'000;
constexpr int kWavesLevelsMax = 10;  // 21 million triangles

using Triangle = std::array<uint32_t, 3>;

// All triangles are of about one size near the equator.
Scene wave_scene(int triangles) {
  const int rows = std::max(2, static_cast<int>(std::sqrt(triangles / 4.0)));
  const int columns = 2 * rows;
  Scene scene;
  scene.format = "made";
  MeshPart& part = scene.parts.emplace_back();
  for (int row = 0; row <= rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const double theta = std::numbers::pi * row / rows;
      const double phi = 2.0 * std::numbers::pi * column / columns;
      const double r = 1.0 + 0.1 * std::sin(9.0 * theta) * std::sin(7.0 * phi);
      part.positions.emplace_back(r * std::sin(theta) * std::cos(phi), r * std::cos(theta),
                                  r * std::sin(theta) * std::sin(phi));
    }
  }
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const auto at = [&](int r, int c) {
        return static_cast<uint32_t>(r * columns + c % columns);
      };
      const uint32_t a = at(row, column), b = at(row, column + 1), c = at(row + 1, column);
      const uint32_t d = at(row + 1, column + 1);
      for (const uint32_t index : {a, b, c, b, d, c}) part.indices.push_back(index);
    }
  }
  return scene;
}

Result<int> number_after(const std::string& name, size_t prefix, int low, int high) {
  int value = 0;
  const char* end = name.data() + name.size();
  const auto [rest, error] = std::from_chars(name.data() + prefix, end, value);
  if (error != std::errc() || rest != end || value < low || value > high) {
    return Error{ErrorCode::kInvalidOption, "mesh " + name,
                 "a number in " + std::to_string(low) + ".." + std::to_string(high),
                 name.substr(prefix)};
  }
  return value;
}

Result<Scene> file_scene(const std::string& path) {
  VOXELD_ASSIGN(const MappedFile file, MappedFile::open(path));
  return load_scene(path, file.bytes());
}

void close_part(MeshPart& part) {
  std::map<std::pair<uint32_t, uint32_t>, int> uses;  // of directed edges
  for (size_t i = 0; i < part.indices.size(); i += 3) {
    for (size_t c = 0; c < 3; ++c) {
      ++uses[{part.indices[i + c], part.indices[i + (c + 1) % 3]}];
    }
  }
  std::multimap<uint32_t, uint32_t> open;  // edges that the triangles of a lid will have
  for (const auto& [edge, count] : uses) {
    const auto opposite = uses.find({edge.second, edge.first});
    const int matched = opposite == uses.end() ? 0 : opposite->second;
    for (int i = matched; i < count; ++i) open.emplace(edge.second, edge.first);
  }
  while (!open.empty()) {
    const auto center = static_cast<uint32_t>(part.positions.size());
    glm::dvec3 sum(0.0);
    int corners = 0;
    for (auto edge = open.begin(); edge != open.end();) {
      const auto [from, to] = *edge;
      open.erase(edge);
      for (const uint32_t index : {from, to, center}) part.indices.push_back(index);
      sum += part.positions[from];
      ++corners;
      edge = open.find(to);
    }
    part.positions.push_back(sum / static_cast<double>(corners));
  }
}

}  // namespace

Result<Scene> bench_scene(const std::string& name) {
  if (name == "waves") return wavy_sphere(6);
  if (name.starts_with("waves-")) {
    VOXELD_ASSIGN(const int levels, number_after(name, 6, 0, kWavesLevelsMax));
    return wavy_sphere(levels);
  }
  if (name.starts_with("wave:")) {
    VOXELD_ASSIGN(const int triangles, number_after(name, 5, 1, kWaveTrianglesMax));
    return wave_scene(triangles);
  }
  if (!name.starts_with("closed:")) return file_scene(name);
  VOXELD_ASSIGN(Scene scene, file_scene(name.substr(7)));
  close_holes(scene);
  return scene;
}

void close_holes(Scene& scene) {
  for (MeshPart& part : scene.parts) {
    part.normals.clear();
    part.uvs.clear();
    part.colors.clear();
    close_part(part);
  }
}

void shuffle_triangles(Scene& scene, uint32_t seed) {
  std::mt19937 random(seed);
  for (MeshPart& part : scene.parts) {
    std::vector<Triangle> triangles(part.indices.size() / 3);
    for (size_t t = 0; t < triangles.size(); ++t) {
      std::copy_n(part.indices.begin() + static_cast<ptrdiff_t>(3 * t), 3, triangles[t].begin());
      std::rotate(triangles[t].begin(), triangles[t].begin() + random() % 3, triangles[t].end());
    }
    std::shuffle(triangles.begin(), triangles.end(), random);
    part.indices.clear();
    for (const Triangle& triangle : triangles) {
      part.indices.insert(part.indices.end(), triangle.begin(), triangle.end());
    }
  }
}

Status write_ply(const Scene& scene, const std::string& path) {
  std::ofstream out(path, std::ios::binary);
  out << "ply\nformat binary_little_endian 1.0\nelement vertex " << scene.vertex_count()
      << "\nproperty float x\nproperty float y\nproperty float z\nelement face "
      << scene.triangle_count() << "\nproperty list uchar int vertex_indices\nend_header\n";
  const auto put = [&out](const auto& value) {
    out.write(reinterpret_cast<const char*>(&value), sizeof value);
  };
  for (const MeshPart& part : scene.parts) {
    for (const glm::dvec3& p : part.positions) put(glm::vec3(p));
  }
  uint32_t first = 0;
  for (const MeshPart& part : scene.parts) {
    for (size_t i = 0; i < part.indices.size(); i += 3) {
      put(uint8_t{3});
      for (size_t c = 0; c < 3; ++c) put(first + part.indices[i + c]);
    }
    first += static_cast<uint32_t>(part.positions.size());
  }
  if (out.flush()) return {};
  return Error{ErrorCode::kInternal, "cannot write " + path, "", ""};
}

}  // namespace voxeld::bench
