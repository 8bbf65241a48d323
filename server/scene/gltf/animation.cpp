#include "server/scene/gltf/animation.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <utility>

#include "proto/range_text.h"
#include "server/scene/mesh_error.h"

namespace voxeld {
namespace {

using Json = nlohmann::json;

std::optional<GltfProperty> property_of(std::string_view path) {
  if (path == "translation") return GltfProperty::kTranslation;
  if (path == "rotation") return GltfProperty::kRotation;
  if (path == "scale") return GltfProperty::kScale;
  if (path == "weights") return GltfProperty::kWeights;
  return std::nullopt;
}

bool is_finite_float(double x) {
  return std::isfinite(static_cast<float>(x));
}

class AnimationReader {
 public:
  AnimationReader(std::string_view name, const GltfDocument& document, GltfAccessors& accessors,
                  const MorphTargetCount& morph_target_count, Scene& scene)
      : name_(name),
        document_(document),
        accessors_(accessors),
        morph_target_count_(morph_target_count),
        scene_(scene) {}

  Result<GltfAnimation> read(const Json& from, size_t index) {
    GltfAnimation animation;
    animation.name = from.value("name", std::string());
    if (animation.name.empty()) animation.name = "animation " + std::to_string(index);
    const std::string path = "animations[" + std::to_string(index) + "]";
    std::set<std::pair<uint32_t, GltfProperty>> moved;
    const Json& channels = from.at("channels");
    for (size_t c = 0; c < channels.size(); ++c) {
      const std::string at = path + ".channels[" + std::to_string(c) + "]";
      GltfChannel channel;
      VOXELD_ASSIGN(const bool is_read, read_target(channels[c].at("target"), at, channel));
      if (!is_read) continue;
      if (!moved.emplace(channel.node, channel.property).second) {
        return malformed_mesh(name_, at + ".target", "two channels move one property of a node",
                              "one", "nodes[" + std::to_string(channel.node) + "]");
      }
      VOXELD_TRY(read_sampler(from.at("samplers"), channels[c].at("sampler").get<uint64_t>(), path,
                              at, channel));
      animation.duration_s = std::max(animation.duration_s, double{channel.keys.times.back()});
      animation.channels.push_back(std::move(channel));
    }
    return animation;
  }

 private:
  // Returns false for a target that is ignored.
  Result<bool> read_target(const Json& target, const std::string& at, GltfChannel& channel) {
    const auto& path = target.at("path").get_ref<const std::string&>();
    const auto property = property_of(path);
    const auto ignored = [&](const std::string& why) {
      add_warning(scene_, "ignored-channel", std::string(name_) + " " + at + ": " + why);
      return false;
    };
    if (!property) return ignored("the path " + shown(path) + " is not read");
    if (!target.contains("node")) return ignored("names no node");
    channel.node = target.at("node").get<uint32_t>();
    channel.property = *property;
    if (*property == GltfProperty::kWeights) {
      channel.keys.width = morph_target_count_(channel.node);
      if (channel.keys.width == 0) return ignored("its node shows no morph targets");
      return true;
    }
    channel.keys.width = *property == GltfProperty::kRotation ? 4 : 3;
    if (document_.nodes[channel.node].has_matrix) {
      return malformed_mesh(name_, at + ".target.node", "an animated node has a matrix",
                            "translation, rotation and scale",
                            "nodes[" + std::to_string(channel.node) + "].matrix");
    }
    return true;
  }

  Status read_sampler(const Json& samplers, uint64_t index, const std::string& path,
                      const std::string& channel_path, GltfChannel& channel) {
    if (index >= samplers.size()) {
      return malformed_mesh(name_, channel_path + ".sampler", "wrong value",
                            index_text(samplers.size(), "samplers"), std::to_string(index));
    }
    const Json& sampler = samplers[index];
    const std::string at = path + ".samplers[" + std::to_string(index) + "]";
    GltfKeys& keys = channel.keys;
    VOXELD_TRY(read_interpolation(sampler, at, keys));
    VOXELD_TRY(read_times(sampler.at("input").get<int>(), at, keys));
    return read_values(sampler.at("output").get<int>(), at, channel);
  }

  Status read_interpolation(const Json& sampler, const std::string& at, GltfKeys& keys) const {
    const std::string text = sampler.value("interpolation", std::string("LINEAR"));
    if (text == "LINEAR") {
      keys.interpolation = Interpolation::kLinear;
    } else if (text == "STEP") {
      keys.interpolation = Interpolation::kStep;
    } else if (text == "CUBICSPLINE") {
      keys.interpolation = Interpolation::kCubicSpline;
    } else {
      return malformed_mesh(name_, at + ".interpolation", "unknown interpolation",
                            "LINEAR, STEP or CUBICSPLINE", shown(text));
    }
    return {};
  }

  Status count_numbers(uint64_t count, const std::string& at) {
    number_count_ += count;
    if (number_count_ <= kGltfKeyNumbersMax) return {};
    return over_limit(name_, at, "numbers of all animations",
                      static_cast<int64_t>(kGltfKeyNumbersMax),
                      static_cast<int64_t>(number_count_));
  }

  Status read_times(int accessor, const std::string& at, GltfKeys& keys) {
    VOXELD_ASSIGN(const GltfReader reader,
                  accessors_.open(accessor, {"times of keys", 1, 1, GltfExpected::kFloat}));
    if (reader.count() == 0)
      return malformed_mesh(name_, at + ".input", "no keys", "1 or more", "0");
    VOXELD_TRY(count_numbers(reader.count(), at + ".input"));
    keys.times.reserve(reader.count());
    for (uint64_t i = 0; i < reader.count(); ++i) {
      const double time = reader.vector(i).x;
      const bool ascends = i == 0 || time >= double{keys.times.back()};
      if (!std::isfinite(time) || !ascends) {
        return malformed_mesh(name_, at + ".input", "time of key " + std::to_string(i),
                              "finite, and not before the key in front",
                              std::isfinite(time) ? std::to_string(time) : "not finite");
      }
      keys.times.push_back(static_cast<float>(time));
    }
    return {};
  }

  Status read_values(int accessor, const std::string& at, GltfChannel& channel) {
    GltfKeys& keys = channel.keys;
    const bool is_number = channel.property == GltfProperty::kWeights;
    const bool may_be_small = is_number || channel.property == GltfProperty::kRotation;
    const int components = is_number ? 1 : static_cast<int>(keys.width);
    VOXELD_ASSIGN(const GltfReader reader,
                  accessors_.open(accessor, {"values of keys", components, components,
                                             may_be_small ? GltfExpected::kFloatOrSmall
                                                          : GltfExpected::kFloat}));
    const uint64_t per_key = (keys.interpolation == Interpolation::kCubicSpline ? 3 : 1) *
                             (is_number ? uint64_t{keys.width} : 1);
    const uint64_t expected = per_key * keys.times.size();
    if (reader.count() != expected) {
      return malformed_mesh(
          name_, at + ".output", "elements",
          std::to_string(expected) + " for " + std::to_string(keys.times.size()) + " keys",
          std::to_string(reader.count()));
    }
    VOXELD_TRY(count_numbers(expected * static_cast<uint64_t>(components), at + ".output"));
    keys.values.reserve(expected * static_cast<uint64_t>(components));
    for (uint64_t i = 0; i < reader.count(); ++i) {
      const glm::dvec4 value = reader.unit_vector(i);
      for (int c = 0; c < components; ++c) {
        if (!is_finite_float(value[c])) {
          return malformed_mesh(name_, at + ".output", "element " + std::to_string(i),
                                "finite numbers", "not finite");
        }
        keys.values.push_back(static_cast<float>(value[c]));
      }
    }
    return {};
  }

  std::string_view name_;
  const GltfDocument& document_;
  GltfAccessors& accessors_;
  const MorphTargetCount& morph_target_count_;
  Scene& scene_;
  uint64_t number_count_ = 0;
};

// The place of a time: at a key, or between it and the next.
struct KeyPlace {
  size_t key = 0;
  bool is_between = false;
  double share = 0.0;   // in (0, 1): fraction of the way to the next key
  double length = 0.0;  // seconds to the next key
};

KeyPlace place_of(const GltfKeys& keys, double seconds) {
  const auto after = std::upper_bound(keys.times.begin(), keys.times.end(), seconds,
                                      [](double t, float time) { return t < double{time}; });
  if (after == keys.times.begin()) return {};
  KeyPlace place{.key = static_cast<size_t>(after - keys.times.begin()) - 1};
  if (after == keys.times.end()) return place;
  const double begin = keys.times[place.key];
  place.length = double{*after} - begin;
  place.share = (seconds - begin) / place.length;
  place.is_between = place.share > 0.0 && keys.interpolation != Interpolation::kStep;
  return place;
}

// The numbers of key k: its value, or the tangent towards it (-1) or away from it (+1).
std::span<const float> numbers_of(const GltfKeys& keys, size_t k, int tangent = 0) {
  const bool is_spline = keys.interpolation == Interpolation::kCubicSpline;
  const size_t at = is_spline ? 3 * k + static_cast<size_t>(1 + tangent) : k;
  return std::span(keys.values).subspan(at * keys.width, keys.width);
}

void spline(const GltfKeys& keys, const KeyPlace& place, std::span<double> out) {
  const double s = place.share, s2 = s * s, s3 = s2 * s;
  const auto from = numbers_of(keys, place.key), to = numbers_of(keys, place.key + 1);
  const auto away = numbers_of(keys, place.key, 1), towards = numbers_of(keys, place.key + 1, -1);
  for (size_t i = 0; i < keys.width; ++i) {
    out[i] = (2 * s3 - 3 * s2 + 1) * double{from[i]} +
             place.length * (s3 - 2 * s2 + s) * double{away[i]} +
             (-2 * s3 + 3 * s2) * double{to[i]} + place.length * (s3 - s2) * double{towards[i]};
  }
}

glm::dquat quaternion_of(double x, double y, double z, double w) {
  const glm::dquat q(w, x, y, z);
  const double length = glm::length(q);
  if (!(length > 0.0) || !std::isfinite(length)) return {1.0, 0.0, 0.0, 0.0};
  return q / length;
}

glm::dquat quaternion_of(std::span<const float> v) {
  return quaternion_of(double{v[0]}, double{v[1]}, double{v[2]}, double{v[3]});
}

}  // namespace

void sample_numbers(const GltfKeys& keys, double seconds, std::span<double> out) {
  const KeyPlace place = place_of(keys, seconds);
  if (place.is_between && keys.interpolation == Interpolation::kCubicSpline) {
    return spline(keys, place, out);
  }
  const auto from = numbers_of(keys, place.key);
  std::copy(from.begin(), from.end(), out.begin());
  if (!place.is_between) return;
  const auto to = numbers_of(keys, place.key + 1);
  for (size_t i = 0; i < keys.width; ++i) out[i] += (double{to[i]} - out[i]) * place.share;
}

void sample_rotation(const GltfKeys& keys, double seconds, std::span<double, 4> out) {
  const KeyPlace place = place_of(keys, seconds);
  glm::dquat q;
  if (!place.is_between) {
    q = quaternion_of(numbers_of(keys, place.key));
  } else if (keys.interpolation == Interpolation::kCubicSpline) {
    spline(keys, place, out);
    q = quaternion_of(out[0], out[1], out[2], out[3]);
  } else {
    q = glm::normalize(glm::slerp(quaternion_of(numbers_of(keys, place.key)),
                                  quaternion_of(numbers_of(keys, place.key + 1)), place.share));
  }
  out[0] = q.x;
  out[1] = q.y;
  out[2] = q.z;
  out[3] = q.w;
}

Result<std::vector<GltfAnimation>> read_gltf_animations(
    std::string_view name, const Json& animations, const GltfDocument& document,
    GltfAccessors& accessors, const MorphTargetCount& morph_target_count, Scene& scene) {
  AnimationReader reader(name, document, accessors, morph_target_count, scene);
  std::vector<GltfAnimation> all;
  for (size_t i = 0; i < animations.size(); ++i) {
    VOXELD_ASSIGN(GltfAnimation animation, reader.read(animations[i], i));
    all.push_back(std::move(animation));
  }
  return all;
}

}  // namespace voxeld
