// The meta of a grid, beside its voxels: a JSON object in containers, results and arrays. It is
// parsed once, where a container is read, and written once, where one is made.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

namespace voxeld {

// An immutable object whose copies share it. A member of another type than its function's counts as
// absent.
class GridMeta {
 public:
  GridMeta();  // no members
  // Anything but an object gives no members.
  explicit GridMeta(nlohmann::json members);
  static GridMeta parse(std::string_view text);

  const nlohmann::json& members() const { return *members_; }
  std::string text() const;
  // The same with the members of `more`, an object, added or replaced.
  GridMeta with(const nlohmann::json& more) const;

  std::string content_hash() const;  // empty: unknown
  int algorithm_version() const;     // of the program that made the voxels; 0: unknown
  bool is_band() const;              // only the voxels near the surface have distances
  bool is_solid() const;
  // The thickness of a band to each side, in voxels of this grid; 0 if dilate, erode or hollow
  // changed it.
  double band_voxels() const;
  GridMeta with_band_voxels(double thickness) const;
  // Whether a cell without a voxel has the sign of the distance of each neighbour that has one
  // (server/voxel/README.md).
  bool tells_sides() const {
    return is_band() && band_voxels() >= (has_world_distances() ? 1 : 0.75);
  }
  bool has_world_distances() const;  // rather than distances in voxels
  bool operator==(const GridMeta& other) const { return *members_ == *other.members_; }

 private:
  std::shared_ptr<const nlohmann::json> members_;  // an object
};

}  // namespace voxeld
