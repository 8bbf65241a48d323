#include "server/scene/gltf/animation.h"

#include <algorithm>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <set>
#include <string_view>
#include <utility>

#include "proto/text/number_text.h"
#include "server/scene/core/mesh_error.h"

namespace voxeld::gltf {
namespace {

class AnimationReader {
 public:
  AnimationReader(const Document& document, Accessors& accessors,
                  const MorphTargetCount& morph_target_count, Scene& scene)
      : document_(document),
        accessors_(accessors),
        morph_target_count_(morph_target_count),
        scene_(scene) {}

  Result<Animation> read(size_t index) {
    const AnimationSource& from = document_.animations[index];
    const std::string path = at_index("animations", index);
    Animation animation;
    animation.name = from.name;
    if (animation.name.empty()) animation.name = "animation " + std::to_string(index);
    std::set<std::pair<uint32_t, Property>> moved;
    for (size_t c = 0; c < from.channels.size(); ++c) {
      const ChannelSource& source = from.channels[c];
      const std::string at = at_index(path + ".channels", c);
      Channel channel;
      VOXELD_ASSIGN(const bool is_read, read_target(source, at, channel));
      if (!is_read) continue;
      if (!moved.emplace(channel.node, channel.property).second) {
        return document_.malformed(at + ".target", "two channels move one property of a node",
                                   "one", at_index("nodes", channel.node));
      }
      if (source.sampler >= from.samplers.size()) {
        return document_.malformed(at + ".sampler", "wrong value",
                                   index_text(from.samplers.size(), "samplers"),
                                   std::to_string(source.sampler));
      }
      const KeySampler& sampler = from.samplers[source.sampler];
      const std::string sampler_path = at_index(path + ".samplers", source.sampler);
      VOXELD_TRY(read_interpolation(sampler, sampler_path, channel.keys));
      VOXELD_TRY(read_times(sampler.times, sampler_path + ".input", channel.keys));
      VOXELD_TRY(read_values(sampler.values, sampler_path + ".output", channel));
      animation.duration_s = std::max(animation.duration_s, double{channel.keys.times.back()});
      animation.channels.push_back(std::move(channel));
    }
    return animation;
  }

 private:
  // Returns false for a target that is ignored.
  Result<bool> read_target(const ChannelSource& source, const std::string& at, Channel& channel) {
    constexpr std::pair<std::string_view, Property> kProperties[] = {
        {"translation", Property::kTranslation},
        {"rotation", Property::kRotation},
        {"scale", Property::kScale},
        {"weights", Property::kWeights}};
    const auto ignored = [&](const std::string& why) {
      add_warning(scene_, "ignored-channel", document_.name + " " + at + ": " + why);
      return false;
    };
    const auto* property =
        std::find_if(std::begin(kProperties), std::end(kProperties),
                     [&](const auto& known) { return known.first == source.path; });
    if (property == std::end(kProperties)) {
      return ignored("the path " + shown(source.path) + " is not read");
    }
    if (source.node < 0) return ignored("names no node");
    channel.node = static_cast<uint32_t>(source.node);
    channel.property = property->second;
    if (channel.property == Property::kWeights) {
      channel.keys.width = morph_target_count_(channel.node);
      return channel.keys.width > 0 || ignored("its node shows no morph targets");
    }
    channel.keys.width = channel.property == Property::kRotation ? 4 : 3;
    if (!document_.nodes[channel.node].has_matrix) return true;
    return document_.malformed(at + ".target.node", "an animated node has a matrix",
                               "translation, rotation and scale",
                               at_index("nodes", channel.node) + ".matrix");
  }

  Status read_interpolation(const KeySampler& sampler, const std::string& at, Keys& keys) const {
    if (sampler.interpolation == "LINEAR") {
      keys.interpolation = Interpolation::kLinear;
    } else if (sampler.interpolation == "STEP") {
      keys.interpolation = Interpolation::kStep;
    } else if (sampler.interpolation == "CUBICSPLINE") {
      keys.interpolation = Interpolation::kCubicSpline;
    } else {
      return document_.malformed(at + ".interpolation", "unknown interpolation",
                                 "LINEAR, STEP or CUBICSPLINE", shown(sampler.interpolation));
    }
    return {};
  }

  Status count_numbers(uint64_t count, const std::string& at) {
    number_count_ += count;
    if (number_count_ <= kKeyNumbersMax) return {};
    return over_limit(document_.name, at, "numbers of all animations", kKeyNumbersMax,
                      static_cast<int64_t>(number_count_));
  }

  Status read_times(int accessor, const std::string& at, Keys& keys) {
    VOXELD_ASSIGN(const Elements times,
                  accessors_.open(accessor, {"times of keys", 1, 1, Expected::kFloat}));
    if (times.count == 0) return document_.malformed(at, "no keys", "1 or more", "0");
    VOXELD_TRY(count_numbers(times.count, at));
    keys.times.reserve(times.count);
    for (uint64_t i = 0; i < times.count; ++i) {
      const double time = times.vector(i).x;
      const bool ascends = i == 0 || time >= double{keys.times.back()};
      if (!std::isfinite(time) || !ascends) {
        return document_.malformed(at, "time of key " + std::to_string(i),
                                   "finite, and not before the key in front",
                                   std::isfinite(time) ? std::to_string(time) : "not finite");
      }
      keys.times.push_back(static_cast<float>(time));
    }
    return {};
  }

  Status read_values(int accessor, const std::string& at, Channel& channel) {
    Keys& keys = channel.keys;
    const bool is_weights = channel.property == Property::kWeights;
    const bool may_be_small = is_weights || channel.property == Property::kRotation;
    const int components = is_weights ? 1 : static_cast<int>(keys.width);
    VOXELD_ASSIGN(
        const Elements values,
        accessors_.open(accessor, {"values of keys", components, components,
                                   may_be_small ? Expected::kFloatOrSmall : Expected::kFloat}));
    const uint64_t per_key = (keys.interpolation == Interpolation::kCubicSpline ? 3 : 1) *
                             (is_weights ? uint64_t{keys.width} : 1);
    const uint64_t expected = per_key * keys.times.size();
    if (values.count != expected) {
      return document_.malformed(
          at, "elements",
          std::to_string(expected) + " for " + std::to_string(keys.times.size()) + " keys",
          std::to_string(values.count));
    }
    VOXELD_TRY(count_numbers(expected * static_cast<uint64_t>(components), at));
    keys.values.reserve(expected * static_cast<uint64_t>(components));
    for (uint64_t i = 0; i < values.count; ++i) {
      const glm::dvec4 value = values.vector(i, Scaling::kAlways);
      for (int c = 0; c < components; ++c) {
        keys.values.push_back(static_cast<float>(value[c]));
        if (std::isfinite(keys.values.back())) continue;
        return document_.malformed(at, "element " + std::to_string(i), "finite numbers",
                                   "not finite");
      }
    }
    return {};
  }

  const Document& document_;
  Accessors& accessors_;
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

KeyPlace place_of(const Keys& keys, double seconds) {
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
std::span<const float> numbers_of(const Keys& keys, size_t k, int tangent = 0) {
  const bool is_spline = keys.interpolation == Interpolation::kCubicSpline;
  const size_t at = is_spline ? 3 * k + static_cast<size_t>(1 + tangent) : k;
  return std::span(keys.values).subspan(at * keys.width, keys.width);
}

void spline(const Keys& keys, const KeyPlace& place, std::span<double> out) {
  const double s = place.share, s2 = s * s, s3 = s2 * s;
  const auto from = numbers_of(keys, place.key), to = numbers_of(keys, place.key + 1);
  const auto away = numbers_of(keys, place.key, 1), towards = numbers_of(keys, place.key + 1, -1);
  for (size_t i = 0; i < keys.width; ++i) {
    out[i] = (2 * s3 - 3 * s2 + 1) * double{from[i]} +
             place.length * (s3 - 2 * s2 + s) * double{away[i]} +
             (-2 * s3 + 3 * s2) * double{to[i]} + place.length * (s3 - s2) * double{towards[i]};
  }
}

// The rotation (x, y, z, w) of any length.
template <typename Number>
glm::dquat quaternion_of(std::span<const Number> v) {
  const glm::dquat q(double{v[3]}, double{v[0]}, double{v[1]}, double{v[2]});
  const double length = glm::length(q);
  if (!(length > 0.0) || !std::isfinite(length)) return {1.0, 0.0, 0.0, 0.0};
  return q / length;
}

}  // namespace

void sample_numbers(const Keys& keys, double seconds, std::span<double> out) {
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

void sample_rotation(const Keys& keys, double seconds, std::span<double, 4> out) {
  const KeyPlace place = place_of(keys, seconds);
  glm::dquat q = quaternion_of(numbers_of(keys, place.key));
  if (place.is_between && keys.interpolation == Interpolation::kCubicSpline) {
    spline(keys, place, out);
    q = quaternion_of(std::span<const double>(out));
  } else if (place.is_between) {
    q = glm::normalize(glm::slerp(q, quaternion_of(numbers_of(keys, place.key + 1)), place.share));
  }
  out[0] = q.x;
  out[1] = q.y;
  out[2] = q.z;
  out[3] = q.w;
}

Result<std::vector<Animation>> read_animations(const Document& document, Accessors& accessors,
                                               const MorphTargetCount& morph_target_count,
                                               Scene& scene) {
  AnimationReader reader(document, accessors, morph_target_count, scene);
  std::vector<Animation> all;
  for (size_t i = 0; i < document.animations.size(); ++i) {
    VOXELD_ASSIGN(all.emplace_back(), reader.read(i));
  }
  return all;
}

}  // namespace voxeld::gltf
