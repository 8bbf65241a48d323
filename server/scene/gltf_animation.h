// The animations of a glTF document: keys of node properties over time.
#pragma once

#include <cstdint>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/result.h"
#include "server/scene/gltf_accessor.h"
#include "server/scene/scene.h"

namespace voxeld {

// Times and values of all channels of a file: malformed-mesh above. 1 GiB of floats.
inline constexpr uint64_t kGltfKeyNumbersMax = uint64_t{1} << 28;

enum class Interpolation { kStep, kLinear, kCubicSpline };

// Values over time. At least one key; times ascend and may repeat.
struct GltfKeys {
  Interpolation interpolation = Interpolation::kLinear;
  size_t width = 1;          // numbers of one value
  std::vector<float> times;  // seconds
  std::vector<float>
      values;  // width per key; for splines 3 * width: in-tangent, value, out-tangent
};

// The value at a time, width numbers; before the first key that key's, after the last that one's.
// Numbers go straight, or along cubic Hermite splines (glTF 2.0, appendix C).
void sample_numbers(const GltfKeys& keys, double seconds, std::span<double> out);
// The same of rotations (x, y, z, w), of length 1: straight ones go the short way round at even
// speed (Shoemake 1985). A value of length 0 is no rotation.
void sample_rotation(const GltfKeys& keys, double seconds, std::span<double, 4> out);

enum class GltfProperty { kTranslation, kRotation, kScale, kWeights };

struct GltfChannel {
  uint32_t node = 0;
  GltfProperty property = GltfProperty::kTranslation;
  GltfKeys keys;
};

struct GltfAnimation {
  std::string name;  // "animation N" where the file has none
  double duration_s = 0.0;
  std::vector<GltfChannel> channels;  // one at most for a property of a node
};

// How many morph targets the mesh of a node has.
using MorphTargetCount = std::function<size_t(uint32_t node)>;

// Of "animations", which passed check_gltf_animation_schema(). Channels without a node, of unknown
// paths (extensions), and weights of nodes without morph targets are left out with a warning
// ("ignored-channel"). Errors: malformed-mesh with the path, for a property that two channels move,
// a node that has a matrix, times that are not finite or descend, and counts that do not agree.
Result<std::vector<GltfAnimation>> read_gltf_animations(
    std::string_view name, const nlohmann::json& animations, const GltfDocument& document,
    GltfAccessors& accessors, const MorphTargetCount& morph_target_count, Scene& scene);

}  // namespace voxeld
