// Small helpers of the loader tests.
#pragma once

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <glm/geometric.hpp>

#include "server/scene/load.h"

namespace voxeld::test {

inline std::span<const uint8_t> bytes_of(std::string_view text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), text.size()};
}

// A bundle of files in memory; names are found as they are.
class MapBundle final : public Bundle {
 public:
  void add(std::string name, std::string content) {
    entries_.push_back({std::move(name), static_cast<int64_t>(content.size())});
    contents_.push_back(std::move(content));
  }
  const std::vector<Entry>& entries() const override { return entries_; }
  Result<std::optional<std::vector<uint8_t>>> find(std::string_view reference,
                                                   std::string_view) const override {
    for (size_t i = 0; i < entries_.size(); ++i) {
      if (entries_[i].name != reference) continue;
      return std::optional<std::vector<uint8_t>>(std::in_place, contents_[i].begin(),
                                                 contents_[i].end());
    }
    return std::optional<std::vector<uint8_t>>();
  }

 private:
  std::vector<Entry> entries_;
  std::vector<std::string> contents_;
};

// The message of `result`'s error; "ok" if there is none.
template <typename T>
std::string message_of(const Result<T>& result) {
  return result ? "ok" : result.error().message();
}

// Loads through the whole way, without decoding images.
inline Result<Scene> load_text(std::string_view filename, std::string_view text) {
  return load_scene(filename, bytes_of(text), {.decode_images = false});
}

// "mesh | node | group" of each part, by their names.
inline std::vector<std::string> origins_of(const Scene& scene) {
  std::vector<std::string> origins;
  for (const MeshPart& part : scene.parts) {
    origins.push_back(scene.meshes.at(part.mesh) + " | " + scene.nodes.at(part.node) + " | " +
                      scene.groups.at(part.group));
  }
  return origins;
}

// "code: detail" of each warning.
inline std::vector<std::string> warnings_of(const Scene& scene) {
  std::vector<std::string> all;
  for (const Warning& warning : scene.warnings) all.push_back(warning.code + ": " + warning.detail);
  return all;
}

inline double area_of(const Scene& scene) {
  double area = 0.0;
  for (const MeshPart& part : scene.parts) {
    for (size_t i = 0; i + 2 < part.indices.size(); i += 3) {
      const glm::dvec3& a = part.positions[part.indices[i]];
      const glm::dvec3& b = part.positions[part.indices[i + 1]];
      const glm::dvec3& c = part.positions[part.indices[i + 2]];
      area += glm::length(glm::cross(b - a, c - a)) / 2.0;
    }
  }
  return area;
}

// Expects the invariants that every loader promises, whatever the input.
inline void expect_consistent(const Scene& scene) {
  EXPECT_GT(scene.triangle_count(), 0u);
  for (const MeshPart& part : scene.parts) {
    EXPECT_EQ(part.indices.size() % 3, 0u);
    for (const uint32_t index : part.indices) ASSERT_LT(index, part.positions.size());
    for (const auto& p : part.positions) {
      ASSERT_TRUE(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z));
    }
    for (const auto& n : part.normals) ASSERT_NEAR(glm::length(n), 1.0f, 1e-4f);
    if (!part.normals.empty()) {
      EXPECT_EQ(part.normals.size(), part.positions.size());
    }
    if (!part.uvs.empty()) {
      EXPECT_EQ(part.uvs.size(), part.positions.size());
    }
    if (!part.colors.empty()) {
      EXPECT_EQ(part.colors.size(), part.positions.size());
    }
    EXPECT_LT(part.material, static_cast<int>(scene.materials.size()));
    EXPECT_LT(part.mesh, scene.meshes.size());
    EXPECT_LT(part.node, scene.nodes.size());
    EXPECT_LT(part.group, scene.groups.size());
  }
  for (const Material& material : scene.materials) {
    EXPECT_LT(material.image, static_cast<int>(scene.images.size()));
  }
}

// Every prefix of `bytes` must give a scene that holds together, or an error that names the file.
inline void expect_truncations_survive(std::string_view filename, std::string_view bytes) {
  for (size_t size = 0; size < bytes.size(); ++size) {
    // A copy of just that size, so that the sanitizer sees a read beyond it.
    const std::vector<uint8_t> prefix(bytes.begin(),
                                      bytes.begin() + static_cast<std::ptrdiff_t>(size));
    const auto scene = load_scene(filename, prefix, {.decode_images = false});
    if (scene) {
      expect_consistent(*scene);
    } else {
      EXPECT_FALSE(scene.error().detail.empty()) << size;
      EXPECT_NE(scene.error().code, ErrorCode::kInternal) << size << scene.error().detail;
    }
  }
}

// Little- or big-endian bytes for hand-made binary files.
class ByteWriter {
 public:
  explicit ByteWriter(bool big_endian = false) : big_endian_(big_endian) {}
  template <typename T>
  ByteWriter& add(T value) {
    char raw[sizeof(T)];
    std::memcpy(raw, &value, sizeof(T));
    const bool swap = big_endian_ == (std::endian::native == std::endian::little);
    for (size_t i = 0; i < sizeof(T); ++i) bytes_ += raw[swap ? sizeof(T) - 1 - i : i];
    return *this;
  }
  ByteWriter& text(std::string_view text) {
    bytes_ += text;
    return *this;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  bool big_endian_;
  std::string bytes_;
};

}  // namespace voxeld::test
