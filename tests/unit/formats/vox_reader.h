// Reads MagicaVoxel's .vox by its published description (ephtracy/voxel-model), for tests alone.
// A violation of the format fails the test.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <map>
#include <set>
#include <span>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

namespace voxeld::test {

using VoxDict = std::map<std::string, std::string>;

struct VoxScene {
  struct Model {
    std::array<int, 3> size{};
    std::vector<std::array<uint8_t, 4>> voxels;  // x, y, z, colour index
  };
  struct Transform {
    int child = 0;
    VoxDict attributes, frame;
  };
  std::vector<Model> models;
  std::map<int, Transform> transforms;
  std::map<int, std::vector<int>> groups;
  std::map<int, int> shapes;  // node -> model
  std::vector<std::array<uint8_t, 4>> palette;
  std::vector<std::string> chunks;  // ids in file order

  // World cell -> RGB of every voxel, by walking the scene graph from node 0.
  std::map<std::array<int, 3>, std::array<uint8_t, 3>> cells() const {
    std::set<int> used;
    auto all = cells_below(0, used);
    EXPECT_EQ(used.size(), models.size()) << "every model is placed";
    return all;
  }
  // The same for the voxels below one node; `used` gets their models.
  std::map<std::array<int, 3>, std::array<uint8_t, 3>> cells_below(int node,
                                                                   std::set<int>& used) const {
    std::map<std::array<int, 3>, std::array<uint8_t, 3>> all;
    walk(node, {0, 0, 0}, all, used);
    return all;
  }

 private:
  void walk(int node, std::array<int, 3> place,
            std::map<std::array<int, 3>, std::array<uint8_t, 3>>& all, std::set<int>& used) const {
    if (const auto it = transforms.find(node); it != transforms.end()) {
      if (const auto text = it->second.frame.find("_t"); text != it->second.frame.end()) {
        std::istringstream numbers(text->second);
        for (int& coordinate : place) {
          int offset = 0;
          EXPECT_TRUE(numbers >> offset);
          coordinate += offset;
        }
      }
      walk(it->second.child, place, all, used);
    } else if (const auto group = groups.find(node); group != groups.end()) {
      for (const int child : group->second) walk(child, place, all, used);
    } else {
      ASSERT_TRUE(shapes.contains(node)) << "node " << node;
      const int id = shapes.at(node);
      ASSERT_LT(static_cast<size_t>(id), models.size());
      EXPECT_TRUE(used.insert(id).second) << "model " << id << " is placed once";
      add(models[static_cast<size_t>(id)], place, all);
    }
  }
  void add(const Model& model, const std::array<int, 3>& place,
           std::map<std::array<int, 3>, std::array<uint8_t, 3>>& all) const {
    for (const auto& voxel : model.voxels) {
      std::array<int, 3> cell{};
      for (size_t c = 0; c < 3; ++c) {
        EXPECT_LT(voxel[c], model.size[c]);
        cell[c] = place[c] - model.size[c] / 2 + voxel[c];  // the pivot is the middle
      }
      ASSERT_GT(voxel[3], 0) << "colour 0 is empty space";
      const auto& color = palette.at(voxel[3] - 1u);
      EXPECT_TRUE(all.emplace(cell, std::array{color[0], color[1], color[2]}).second);
    }
  }
};

class VoxReader {
 public:
  static VoxScene read(std::span<const uint8_t> bytes) {
    VoxReader reader(bytes);
    EXPECT_EQ(reader.id(), "VOX ");
    EXPECT_EQ(reader.i32(), 150);
    EXPECT_EQ(reader.id(), "MAIN");
    EXPECT_EQ(reader.i32(), 0) << "MAIN has no content";
    EXPECT_EQ(static_cast<size_t>(reader.i32()), bytes.size() - 20) << "children fill the file";
    while (reader.at_ < bytes.size() && !::testing::Test::HasFatalFailure()) reader.chunk();
    return std::move(reader.scene_);
  }

 private:
  explicit VoxReader(std::span<const uint8_t> bytes) : bytes_(bytes) {}
  uint8_t u8() {
    if (at_ < bytes_.size()) return bytes_[at_++];
    ADD_FAILURE() << "the file is cut off";
    return 0;
  }
  int i32() {
    uint32_t value = 0;
    for (int shift = 0; shift < 32; shift += 8) value |= static_cast<uint32_t>(u8()) << shift;
    return static_cast<int>(value);
  }
  std::string text(int size) {
    std::string value;
    for (int i = 0; i < size; ++i) value += static_cast<char>(u8());
    return value;
  }
  std::string id() { return text(4); }
  VoxDict dict() {
    VoxDict entries;
    for (int i = i32(); i > 0; --i) {
      const std::string key = text(i32());
      EXPECT_TRUE(entries.emplace(key, text(i32())).second) << key;
    }
    return entries;
  }

  void chunk() {
    const std::string name = id();
    const size_t size = static_cast<size_t>(i32());
    EXPECT_EQ(i32(), 0) << name << " has no children";
    const size_t end = at_ + size;
    scene_.chunks.push_back(name);
    content(name);
    ASSERT_EQ(at_, end) << name << " is as long as it says";
  }
  void content(const std::string& name) {
    if (name == "SIZE") {
      auto& model = scene_.models.emplace_back();
      for (int& side : model.size) {
        side = i32();
        EXPECT_TRUE(side >= 1 && side <= 256) << side;
      }
    } else if (name == "XYZI") {
      ASSERT_FALSE(scene_.models.empty()) << "XYZI follows SIZE";
      for (int i = i32(); i > 0; --i) {
        scene_.models.back().voxels.push_back({u8(), u8(), u8(), u8()});
      }
    } else if (name == "nTRN") {
      const int node = i32();
      VoxScene::Transform transform;
      transform.attributes = dict();
      transform.child = i32();
      EXPECT_EQ(i32(), -1) << "reserved";
      i32();  // layer
      ASSERT_EQ(i32(), 1) << "frames";
      transform.frame = dict();
      EXPECT_TRUE(scene_.transforms.emplace(node, transform).second);
    } else if (name == "nGRP") {
      auto& children = scene_.groups[i32()];
      dict();
      for (int i = i32(); i > 0; --i) children.push_back(i32());
    } else if (name == "nSHP") {
      const int node = i32();
      dict();
      ASSERT_EQ(i32(), 1) << "models of a shape";
      EXPECT_TRUE(scene_.shapes.emplace(node, i32()).second);
      dict();
    } else {
      ASSERT_EQ(name, "RGBA");
      for (int i = 0; i < 256; ++i) scene_.palette.push_back({u8(), u8(), u8(), u8()});
    }
  }

  std::span<const uint8_t> bytes_;
  size_t at_ = 0;
  VoxScene scene_;
};

}  // namespace voxeld::test
