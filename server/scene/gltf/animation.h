// The animations of a glTF document: keys of node properties over time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "proto/result.h"
#include "server/scene/core/scene.h"
#include "server/scene/gltf/accessor.h"
#include "server/scene/gltf/document.h"

namespace voxeld::gltf {

// Times and values of all channels of a file, 1 GiB of floats. More: malformed-mesh.
inline constexpr uint64_t kKeyNumbersMax = uint64_t{1} << 28;

enum class Interpolation { kStep, kLinear, kCubicSpline };

// Values over time. There is at least one key; times ascend and may repeat.
struct Keys {
  Interpolation interpolation = Interpolation::kLinear;
  size_t width = 1;          // numbers per value
  std::vector<float> times;  // seconds
  // width per key; for splines 3 * width: in-tangent, value, out-tangent
  std::vector<float> values;
};

// The value at a time, `width` numbers. Before the first key and after the last, it is that key's
// value. Numbers are interpolated linearly or along cubic Hermite splines (glTF 2.0, appendix C).
void sample_numbers(const Keys& keys, double seconds, std::span<double> out);
// The rotation (x, y, z, w) at a time, of length 1. Linear ones take the short way round at even
// speed (Shoemake 1985). A value of length 0 counts as no rotation.
void sample_rotation(const Keys& keys, double seconds, std::span<double, 4> out);

enum class Property { kTranslation, kRotation, kScale, kWeights };

struct Channel {
  uint32_t node = 0;
  Property property = Property::kTranslation;
  Keys keys;
};

struct Animation {
  std::string name;  // "animation N" if the file has no name
  double duration_s = 0.0;
  std::vector<Channel> channels;  // at most one per property of a node
};

// The number of morph targets of a node's mesh.
using MorphTargetCount = std::function<size_t(uint32_t node)>;

// Reads the document's animations. Channels without a node, with unknown paths (extensions), and
// weights of nodes without morph targets are ignored with a warning ("ignored-channel"). Errors:
// malformed-mesh with the path, for a property that two channels move, a node that has a matrix,
// times that are not finite or descend, and counts that disagree.
Result<std::vector<Animation>> read_animations(const Document& document, Accessors& accessors,
                                               const MorphTargetCount& morph_target_count,
                                               Scene& scene);

}  // namespace voxeld::gltf
