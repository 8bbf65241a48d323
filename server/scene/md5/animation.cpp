#include "server/scene/md5/animation.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>
#include <map>
#include <optional>
#include <utility>

#include "server/base/cancel_point.h"
#include "server/base/pieces.h"
#include "server/scene/core/mesh_error.h"

namespace voxeld {
namespace {

constexpr uint32_t kAllComponents = 63;
constexpr int64_t kNumberBytesMin = 2;  // "0 "
constexpr size_t kListedJointsMax = 10;

class Md5AnimReader {
 public:
  Md5AnimReader(std::string_view name, std::string_view text) : lexer_(name, text) {}

  Result<Md5Anim> read() {
    VOXELD_TRY(read_md5_head(lexer_));
    for (;;) {
      VOXELD_ASSIGN(const Md5Token token, lexer_.next());
      if (token.kind == Md5Token::kEnd) break;
      VOXELD_TRY(read_statement(token));
    }
    if (anim_.joints.empty()) {
      return malformed_mesh(lexer_.name(), "", "no joints", "hierarchy { … }", "");
    }
    if (!has_base_frame_) return malformed_mesh(lexer_.name(), "", "no baseframe", "baseframe", "");
    if (frame_numbers_.empty())
      return malformed_mesh(lexer_.name(), "", "no frames", "frame 0", "");
    VOXELD_TRY(sort_frames());
    anim_.frame_count = frame_numbers_.size();
    warn_count("numJoints", joint_count_, anim_.joints.size());
    warn_count("numFrames", frame_count_, anim_.frame_count);
    return std::move(anim_);
  }

 private:
  void warn_count(std::string_view keyword, int64_t said, size_t there) {
    if (said < 0 || said == static_cast<int64_t>(there)) return;
    anim_.warnings.push_back({"wrong-count", lexer_.name() + ": " + std::string(keyword) +
                                                 " says " + std::to_string(said) +
                                                 ", the file has " + std::to_string(there)});
  }

  Status read_statement(const Md5Token& token) {
    if (token.is("numFrames") || token.is("numberOfFrames")) {
      VOXELD_ASSIGN(frame_count_, lexer_.integer("numFrames", 0, kMd5FramesMax));
    } else if (token.is("numJoints") || token.is("numberOfJoints")) {
      VOXELD_ASSIGN(joint_count_, lexer_.integer("numJoints", 0, kMd5JointsMax));
    } else if (token.is("frameRate")) {
      return read_frame_rate();
    } else if (token.is("numAnimatedComponents") || token.is("numberOfAnimatedComponents")) {
      return read_component_count();
    } else if (token.is("hierarchy")) {
      return read_hierarchy(token);
    } else if (token.is("bounds")) {
      return skip_bounds();
    } else if (token.is("baseframe")) {
      return read_base_frame();
    } else if (token.is("frame")) {
      return read_frame(token);
    } else {
      return lexer_.wrong("unknown keyword",
                          "numFrames, numJoints, frameRate, numAnimatedComponents, hierarchy, "
                          "bounds, baseframe or frame",
                          token);
    }
    return {};
  }

  Status read_frame_rate() {
    VOXELD_ASSIGN(const Md5Token token, lexer_.peek());
    VOXELD_ASSIGN(anim_.frame_rate, lexer_.number("frameRate"));
    if (anim_.frame_rate > 0) return {};
    return lexer_.wrong("frameRate", "frames per second, above 0", token);
  }

  Status read_component_count() {
    VOXELD_ASSIGN(const int64_t count,
                  lexer_.integer("numAnimatedComponents", 0, 6 * kMd5JointsMax));
    if (!frame_numbers_.empty() && count != anim_.component_count) {
      return malformed_mesh(lexer_.name(), "", "numAnimatedComponents behind the frames",
                            "before them", "");
    }
    anim_.component_count = static_cast<uint32_t>(count);
    return check_components();
  }

  // Checks the hierarchy against the component count, once both were read, in either order.
  Status check_components() const {
    for (const Md5AnimJoint& joint : anim_.joints) {
      const uint64_t end =
          uint64_t{joint.first_component} + static_cast<uint64_t>(std::popcount(joint.flags));
      if (joint.flags != 0 && end > anim_.component_count) {
        return malformed_mesh(lexer_.name(), "",
                              "joint " + shown(joint.name) + " has components beyond a frame's",
                              "numAnimatedComponents of " + std::to_string(end) + " at least",
                              std::to_string(anim_.component_count));
      }
    }
    return {};
  }

  Status read_hierarchy(const Md5Token& at) {
    if (!anim_.joints.empty()) return lexer_.wrong("a second hierarchy", "one", at);
    VOXELD_TRY(lexer_.expect('{', "hierarchy"));
    for (;;) {
      VOXELD_ASSIGN(const Md5Token token, lexer_.peek());
      if (token.is('}')) break;
      if (anim_.joints.size() == static_cast<size_t>(kMd5JointsMax)) {
        return over_limit(lexer_.name(), "line " + std::to_string(token.line), "too many joints",
                          kMd5JointsMax, kMd5JointsMax + 1);
      }
      Md5AnimJoint joint;
      VOXELD_TRY(read_md5_joint_name(lexer_, anim_.joints.size(), joint.name, joint.parent));
      VOXELD_ASSIGN(const int64_t flags, lexer_.integer("flags of a joint", 0, kAllComponents));
      VOXELD_ASSIGN(const int64_t first,
                    lexer_.integer("first component of a joint", 0, 6 * kMd5JointsMax));
      joint.flags = static_cast<uint32_t>(flags);
      joint.first_component = static_cast<uint32_t>(first);
      anim_.joints.push_back(std::move(joint));
    }
    VOXELD_TRY(lexer_.expect('}', "hierarchy"));
    return check_components();
  }

  // The boxes of the file are not tight; voxeld computes them from the posed vertices.
  Status skip_bounds() {
    VOXELD_TRY(lexer_.expect('{', "bounds"));
    for (;;) {
      VOXELD_ASSIGN(const Md5Token token, lexer_.peek());
      if (token.is('}')) return lexer_.expect('}', "bounds");
      double corner[3];
      VOXELD_TRY(lexer_.numbers("a corner of bounds", corner, 3));
    }
  }

  Status read_base_frame() {
    VOXELD_TRY(lexer_.expect('{', "baseframe"));
    for (size_t j = 0; j < anim_.joints.size(); ++j) {
      Md5AnimJoint& joint = anim_.joints[j];
      VOXELD_ASSIGN(const Md5Token token, lexer_.peek());
      if (token.is('}')) {
        return lexer_.wrong("baseframe ends at joint " + std::to_string(j),
                            std::to_string(anim_.joints.size()) + " joints", token);
      }
      VOXELD_TRY(lexer_.numbers("position of a joint", &joint.base_position.x, 3));
      VOXELD_TRY(lexer_.numbers("orientation of a joint", &joint.base_orientation.x, 3));
    }
    has_base_frame_ = true;
    return lexer_.expect('}', "baseframe of " + std::to_string(anim_.joints.size()) + " joints");
  }

  Status read_frame(const Md5Token& at) {
    VOXELD_ASSIGN(const int64_t number, lexer_.integer("number of a frame", 0, kMd5FramesMax - 1));
    const size_t count = anim_.component_count;
    if (static_cast<int64_t>(count) > static_cast<int64_t>(lexer_.bytes_left()) / kNumberBytesMin) {
      return malformed_line(lexer_.name(), at.line, "truncated: frame " + std::to_string(number),
                            std::to_string(count) + " numbers",
                            std::to_string(lexer_.bytes_left()) + " bytes left");
    }
    if (static_cast<int64_t>(anim_.components.size() + count) > kMd5NumbersMax) {
      return over_limit(lexer_.name(), "line " + std::to_string(at.line), "too many numbers",
                        kMd5NumbersMax, static_cast<int64_t>(anim_.components.size() + count));
    }
    frame_numbers_.push_back(static_cast<uint32_t>(number));
    VOXELD_TRY(lexer_.expect('{', "frame"));
    for (size_t i = 0; i < count; ++i) {
      VOXELD_ASSIGN(const Md5Token token, lexer_.peek());
      if (token.is('}')) {
        return lexer_.wrong(
            "frame " + std::to_string(number) + " ends after " + std::to_string(i) + " numbers",
            std::to_string(count) + " numbers", token);
      }
      VOXELD_ASSIGN(const double value, lexer_.number("a number of a frame"));
      push_in_pieces(anim_.components, static_cast<float>(value));
    }
    return lexer_.expect(
        '}', "frame " + std::to_string(number) + " of " + std::to_string(count) + " numbers");
  }

  Status sort_frames() {
    const size_t frames = frame_numbers_.size(), width = anim_.component_count;
    std::vector<std::optional<uint32_t>> place(frames);
    bool in_order = true;
    for (uint32_t i = 0; i < frames; ++i) {
      const uint32_t number = frame_numbers_[i];
      if (number >= frames || place[number]) {
        return malformed_mesh(
            lexer_.name(), "", number >= frames ? "frames are missing" : "a frame is there twice",
            frames == 1 ? "frame 0" : "frames 0 to " + std::to_string(frames - 1) + ", each once",
            "frame " + std::to_string(number));
      }
      place[number] = i;
      in_order = in_order && number == i;
    }
    if (in_order) return {};
    std::vector<float> sorted;
    sorted.reserve(anim_.components.size());
    for (const auto& from : place) {
      cancel_point();
      const auto begin = anim_.components.begin() + static_cast<ptrdiff_t>(*from * width);
      sorted.insert(sorted.end(), begin, begin + static_cast<ptrdiff_t>(width));
    }
    anim_.components = std::move(sorted);
    return {};
  }

  Md5Lexer lexer_;
  Md5Anim anim_;
  int64_t joint_count_ = -1, frame_count_ = -1;
  bool has_base_frame_ = false;
  std::vector<uint32_t> frame_numbers_;  // in the order of the file
};

// The joint in one frame. A quaternion that is too long counts as a direction and is normalized.
Md5Pose joint_in_frame(const Md5Anim& anim, const Md5AnimJoint& joint, size_t frame) {
  std::array<double, 6> value = {joint.base_position.x,    joint.base_position.y,
                                 joint.base_position.z,    joint.base_orientation.x,
                                 joint.base_orientation.y, joint.base_orientation.z};
  size_t at = frame * anim.component_count + joint.first_component;
  for (size_t c = 0; c < value.size(); ++c) {
    if ((joint.flags >> c & 1) != 0) value[c] = double{anim.components[at++]};
  }
  const glm::dvec3 xyz(value[3], value[4], value[5]);
  const double w = -std::sqrt(std::max(0.0, 1.0 - glm::dot(xyz, xyz)));
  return {{value[0], value[1], value[2]}, glm::normalize(glm::dquat(w, xyz.x, xyz.y, xyz.z))};
}

// The name of the parent; empty for a root.
template <typename Joint>
std::string_view parent_name(const std::vector<Joint>& joints, int parent) {
  if (parent == kMd5RootParent) return {};
  return joints[static_cast<size_t>(parent)].name;
}

// Lists names for an error: "a", "b" and 3 more.
std::string listed_joints(const std::vector<std::string>& names) {
  std::string text;
  for (size_t i = 0; i < names.size() && i < kListedJointsMax; ++i) {
    text += (i == 0 ? "" : ", ") + shown(names[i]);
  }
  if (names.size() > kListedJointsMax) {
    text += " and " + std::to_string(names.size() - kListedJointsMax) + " more";
  }
  return text;
}

}  // namespace

Result<Md5Anim> parse_md5_anim(std::string_view name, std::string_view text) {
  return Md5AnimReader(name, text).read();
}

std::vector<Md5Pose> md5_local_pose(const Md5Anim& anim, double seconds) {
  const double frames = std::clamp(seconds, 0.0, anim.duration()) * anim.frame_rate;
  const size_t last = anim.frame_count - 1;
  const size_t before = std::min(static_cast<size_t>(frames), last);
  const size_t after = std::min(before + 1, last);
  const double share = frames - static_cast<double>(before);
  std::vector<Md5Pose> poses;
  poses.reserve(anim.joints.size());
  for (const Md5AnimJoint& joint : anim.joints) {
    const Md5Pose a = joint_in_frame(anim, joint, before);
    if (share <= 0.0) {
      poses.push_back(a);
      continue;
    }
    const Md5Pose b = joint_in_frame(anim, joint, after);
    poses.push_back(
        {glm::mix(a.position, b.position, share), glm::slerp(a.orientation, b.orientation, share)});
  }
  return poses;
}

std::vector<Md5Pose> md5_model_pose(const Md5Anim& anim, const std::vector<Md5Pose>& local) {
  std::vector<Md5Pose> model = local;
  for (size_t j = 0; j < model.size(); ++j) {
    if (anim.joints[j].parent == kMd5RootParent) continue;
    const Md5Pose& parent = model[static_cast<size_t>(anim.joints[j].parent)];
    model[j].position = parent.position + parent.orientation * local[j].position;
    model[j].orientation = glm::normalize(parent.orientation * local[j].orientation);
  }
  return model;
}

Result<std::vector<uint32_t>> match_md5_joints(std::string_view mesh_name,
                                               const std::vector<Md5Joint>& mesh_joints,
                                               std::string_view anim_name, const Md5Anim& anim) {
  const auto fail = [&](const std::string& what, const std::vector<std::string>& names,
                        std::string expected) {
    return Error{ErrorCode::kMalformedMesh,
                 std::string(anim_name) + " does not fit " + std::string(mesh_name) + ": " + what,
                 std::move(expected), listed_joints(names)};
  };
  std::map<std::string_view, uint32_t> by_name;
  std::vector<std::string> repeated, missing, extra, moved;
  for (uint32_t j = 0; j < anim.joints.size(); ++j) {
    if (!by_name.emplace(anim.joints[j].name, j).second) repeated.push_back(anim.joints[j].name);
  }
  if (!repeated.empty())
    return fail("joints of the animation with one name", repeated, "names once");
  std::vector<uint32_t> match;
  std::vector<uint8_t> taken(anim.joints.size());
  for (const Md5Joint& joint : mesh_joints) {
    const auto found = by_name.find(joint.name);
    if (found == by_name.end()) {
      missing.push_back(joint.name);
      match.push_back(0);
      continue;
    }
    match.push_back(found->second);
    if (taken[found->second]++ != 0) repeated.push_back(joint.name);
    const std::string_view anim_parent =
        parent_name(anim.joints, anim.joints[found->second].parent);
    const std::string_view mesh_parent = parent_name(mesh_joints, joint.parent);
    if (anim_parent != mesh_parent) moved.push_back(joint.name);
  }
  for (size_t j = 0; j < taken.size(); ++j) {
    if (taken[j] == 0) extra.push_back(anim.joints[j].name);
  }
  if (!missing.empty()) return fail("joints that only the mesh has", missing, "the mesh's joints");
  if (!repeated.empty()) return fail("joints of the mesh with one name", repeated, "names once");
  if (!extra.empty()) return fail("joints that only the animation has", extra, "the mesh's joints");
  if (!moved.empty()) return fail("joints with other parents", moved, "the parents of the mesh");
  return match;
}

}  // namespace voxeld
