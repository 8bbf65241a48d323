#include "tests/reference/gltf_skinning_oracle.h"

#include <algorithm>
#include <cstring>
#include <functional>
#include <nlohmann/json.hpp>
#include <utility>

namespace voxeld::reference {
namespace {

using Json = nlohmann::json;
using Numbers = std::vector<double>;

size_t width_of(const std::string& type) {
  if (type == "SCALAR") return 1;
  return type == "MAT4" ? 16 : static_cast<size_t>(type.back() - '0');
}

double number_at(const uint8_t* at, int type, bool normalized) {
  const auto read = [&](auto value, double one) {
    std::memcpy(&value, at, sizeof value);
    const auto number = static_cast<double>(value);
    return normalized ? std::max(number / one, -1.0) : number;
  };
  switch (type) {
    case 5120:
      return read(int8_t{}, 127);
    case 5121:
      return read(uint8_t{}, 255);
    case 5122:
      return read(int16_t{}, 32767);
    case 5123:
      return read(uint16_t{}, 65535);
    case 5125:
      return read(uint32_t{}, 4294967295.0);
    default:
      return read(float{}, 1);
  }
}

size_t size_of(int type) {
  return type < 5122 ? 1 : type < 5125 ? 2 : 4;
}

class File {
 public:
  File(const Json& json, const std::vector<std::vector<uint8_t>>& buffers)
      : json(json), buffers_(buffers) {}

  const Json& json;

  // All numbers of an accessor, one element after the other.
  Numbers numbers(size_t accessor) const {
    const Json& a = json["accessors"][accessor];
    const size_t width = width_of(a["type"]), count = a["count"];
    Numbers out(width * count, 0.0);
    if (a.contains("bufferView")) {
      for (size_t i = 0; i < count; ++i) {
        read(a, a["bufferView"], a.value("byteOffset", size_t{0}), i, &out[i * width]);
      }
    }
    if (!a.contains("sparse")) return out;
    const Json& sparse = a["sparse"];
    Json index_type = {{"componentType", sparse["indices"]["componentType"]}, {"type", "SCALAR"}};
    for (size_t i = 0; i < sparse["count"].get<size_t>(); ++i) {
      double target = 0;
      read(index_type, sparse["indices"]["bufferView"],
           sparse["indices"].value("byteOffset", size_t{0}), i, &target);
      read(a, sparse["values"]["bufferView"], sparse["values"].value("byteOffset", size_t{0}), i,
           &out[static_cast<size_t>(target) * width]);
    }
    return out;
  }

 private:
  void read(const Json& accessor, size_t view_index, size_t offset, size_t i, double* out) const {
    const Json& view = json["bufferViews"][view_index];
    const int type = accessor["componentType"];
    const size_t width = width_of(accessor["type"]);
    const size_t stride = view.value("byteStride", width * size_of(type));
    const size_t begin = view.value("byteOffset", size_t{0}) + offset + i * stride;
    for (size_t c = 0; c < width; ++c) {
      out[c] = number_at(buffers_[view["buffer"].get<size_t>()].data() + begin + c * size_of(type),
                         type, accessor.value("normalized", false));
    }
  }

  const std::vector<std::vector<uint8_t>>& buffers_;
};

// The state of one node at the time.
struct NodeState {
  Affine matrix;
  bool has_matrix = false;
  Vec3 translation{}, scale = {1, 1, 1};
  Mat3 rotation = Affine().turn;
  Numbers weights;

  Affine local() const {
    if (has_matrix) return matrix;
    Affine out = {rotation, translation};
    for (Vec3& row : out.turn) row = {row[0] * scale[0], row[1] * scale[1], row[2] * scale[2]};
    return out;
  }
};

Vec3 vec3_of(const Json& numbers) {
  return {numbers[0], numbers[1], numbers[2]};
}

Affine affine_of(const Numbers& by_columns) {
  Affine out;
  for (size_t r = 0; r < 3; ++r) {
    for (size_t c = 0; c < 3; ++c) out.turn[r][c] = by_columns[4 * c + r];
    out.place[r] = by_columns[12 + r];
  }
  return out;
}

NodeState rest_of(const Json& json, const Json& node) {
  NodeState state;
  if (node.contains("matrix")) {
    state.has_matrix = true;
    state.matrix = affine_of(node["matrix"].get<Numbers>());
  }
  if (node.contains("translation")) state.translation = vec3_of(node["translation"]);
  if (node.contains("scale")) state.scale = vec3_of(node["scale"]);
  if (node.contains("rotation")) {
    const Json& q = node["rotation"];
    state.rotation = rotation_of(q[0], q[1], q[2], q[3]);
  }
  if (!node.contains("mesh")) return state;
  const Json& mesh = json["meshes"][node["mesh"].get<size_t>()];
  const Json& target_holder = mesh["primitives"][0];
  if (target_holder.contains("targets")) state.weights.resize(target_holder["targets"].size());
  const Json& from = node.contains("weights") ? node : mesh;
  if (from.contains("weights")) state.weights = from["weights"].get<Numbers>();
  return state;
}

// Keys k and k + 1 around a time, and where between.
struct Place {
  size_t key = 0;
  double share = 0, length = 0;
};

Place place_of(const Numbers& times, double seconds) {
  if (seconds <= times.front()) return {};
  if (seconds >= times.back()) return {.key = times.size() - 1};
  size_t key = 0;
  while (times[key + 1] <= seconds) ++key;
  const double length = times[key + 1] - times[key];
  return {.key = key, .share = (seconds - times[key]) / length, .length = length};
}

void set(NodeState& state, const std::string& path, const Numbers& value) {
  if (path == "translation") state.translation = {value[0], value[1], value[2]};
  if (path == "scale") state.scale = {value[0], value[1], value[2]};
  if (path == "rotation") state.rotation = rotation_of(value[0], value[1], value[2], value[3]);
  if (path == "weights") state.weights = value;
}

void animate(const File& file, const Json& sampler, const std::string& path, double seconds,
             NodeState& state) {
  const Numbers times = file.numbers(sampler["input"]);
  const Numbers values = file.numbers(sampler["output"]);
  const std::string kind = sampler.value("interpolation", "LINEAR");
  const bool is_cubic = kind == "CUBICSPLINE";
  const size_t width = values.size() / times.size() / (is_cubic ? 3 : 1);
  // part 0 and 2: tangents of a spline.
  const auto key = [&](size_t k, size_t part) {
    const size_t at = is_cubic ? (3 * k + part) * width : k * width;
    return Numbers(values.begin() + static_cast<std::ptrdiff_t>(at),
                   values.begin() + static_cast<std::ptrdiff_t>(at + width));
  };
  const Place place = place_of(times, seconds);
  const Numbers from = key(place.key, 1);
  if (place.share == 0 || kind == "STEP") return set(state, path, from);
  const Numbers to = key(place.key + 1, 1);
  const double s = place.share;
  if (!is_cubic && path == "rotation") {
    state.rotation = between(rotation_of(from[0], from[1], from[2], from[3]),
                             rotation_of(to[0], to[1], to[2], to[3]), s);
    return;
  }
  Numbers value(width);
  for (size_t i = 0; i < width; ++i) {
    value[i] = (1 - s) * from[i] + s * to[i];
    if (!is_cubic) continue;
    // Bernstein's form of the same cubic: its inner points stand a third along the tangents.
    const double a = from[i] + place.length * key(place.key, 2)[i] / 3;
    const double b = to[i] - place.length * key(place.key + 1, 0)[i] / 3;
    const double r = 1 - s;
    value[i] = r * r * r * from[i] + 3 * r * r * s * a + 3 * r * s * s * b + s * s * s * to[i];
  }
  set(state, path, value);
}

// A part of a sum of transforms.
struct Share {
  double weight;
  const Affine* transform;
};

Affine sum_of(const std::vector<Share>& shares) {
  Affine sum = {{{{0, 0, 0}, {0, 0, 0}, {0, 0, 0}}}, {0, 0, 0}};
  double all = 0;
  for (const Share& share : shares) all += share.weight;
  for (const Share& share : shares) {
    sum.turn = mixed(1, sum.turn, share.weight / all, share.transform->turn);
    sum.place = plus(sum.place, times(share.weight / all, share.transform->place));
  }
  return sum;
}

class Frame {
 public:
  Frame(const File& file, int animation, double seconds) : file_(file), json_(file.json) {
    for (const Json& node : json_["nodes"]) states_.push_back(rest_of(json_, node));
    if (animation >= 0) {
      const Json& from = json_["animations"][static_cast<size_t>(animation)];
      for (const Json& channel : from["channels"]) {
        const Json& target = channel["target"];
        animate(file, from["samplers"][channel["sampler"].get<size_t>()], target["path"], seconds,
                states_[target["node"].get<size_t>()]);
      }
    }
    world_.resize(states_.size());
    std::vector<bool> is_child(states_.size());
    for (const Json& node : json_["nodes"]) {
      for (const Json& child : node.value("children", Json::array())) {
        is_child[child.get<size_t>()] = true;
      }
    }
    for (size_t n = 0; n < states_.size(); ++n) {
      if (!is_child[n]) place(n, Affine());
    }
  }

  std::vector<OracleCorners> corners() {
    for (const Json& root : json_["scenes"][json_.value("scene", size_t{0})]["nodes"]) add(root);
    return std::move(out_);
  }

 private:
  void place(size_t node, const Affine& parent) {
    world_[node] = product(parent, states_[node].local());
    for (const Json& child : json_["nodes"][node].value("children", Json::array())) {
      place(child, world_[node]);
    }
  }

  void add(size_t node) {
    const Json& from = json_["nodes"][node];
    if (from.contains("mesh")) {
      for (const Json& primitive : json_["meshes"][from["mesh"].get<size_t>()]["primitives"]) {
        add_primitive(node, primitive);
      }
    }
    for (const Json& child : from.value("children", Json::array())) add(child);
  }

  std::vector<Affine> joints_of(const Json& skin) const {
    std::vector<Affine> joints;
    const Numbers inverse = skin.contains("inverseBindMatrices")
                                ? file_.numbers(skin["inverseBindMatrices"])
                                : Numbers();
    for (size_t j = 0; j < skin["joints"].size(); ++j) {
      joints.push_back(world_[skin["joints"][j].get<size_t>()]);
      if (inverse.empty()) continue;
      const auto begin = inverse.begin() + static_cast<std::ptrdiff_t>(16 * j);
      joints[j] = product(joints[j], affine_of(Numbers(begin, begin + 16)));
    }
    return joints;
  }

  // The transform of each vertex.
  std::vector<Affine> transforms(size_t node, const Json& attributes, size_t count) const {
    const Json& from = json_["nodes"][node];
    std::vector<Affine> out(count, world_[node]);
    if (!from.contains("skin") || !attributes.contains("JOINTS_0")) return out;
    const std::vector<Affine> joints = joints_of(json_["skins"][from["skin"].get<size_t>()]);
    std::vector<std::vector<Share>> shares(count);
    for (int set = 0; attributes.contains("JOINTS_" + std::to_string(set)); ++set) {
      const Numbers numbers = file_.numbers(attributes["JOINTS_" + std::to_string(set)]);
      const Numbers weights = file_.numbers(attributes["WEIGHTS_" + std::to_string(set)]);
      for (size_t i = 0; i < numbers.size(); ++i) {
        if (weights[i] > 0) {
          shares[i / 4].push_back({weights[i], &joints[static_cast<size_t>(numbers[i])]});
        }
      }
    }
    for (size_t v = 0; v < count; ++v) {
      if (!shares[v].empty()) out[v] = sum_of(shares[v]);
    }
    return out;
  }

  Numbers morphed(size_t node, const Json& primitive, const char* attribute) const {
    Numbers sum = file_.numbers(primitive["attributes"][attribute]);
    const Json targets = primitive.value("targets", Json::array());
    for (size_t t = 0; t < targets.size() && t < states_[node].weights.size(); ++t) {
      if (!targets[t].contains(attribute)) continue;
      const Numbers delta = file_.numbers(targets[t][attribute]);
      for (size_t i = 0; i < sum.size(); ++i) sum[i] += states_[node].weights[t] * delta[i];
    }
    return sum;
  }

  void add_primitive(size_t node, const Json& primitive) {
    const Json& attributes = primitive["attributes"];
    const Numbers positions = morphed(node, primitive, "POSITION");
    const bool has_normals = attributes.contains("NORMAL");
    const Numbers normals = has_normals ? morphed(node, primitive, "NORMAL") : Numbers();
    const size_t count = positions.size() / 3;
    const std::vector<Affine> transform = transforms(node, attributes, count);
    Numbers indices(count);
    for (size_t i = 0; i < count; ++i) indices[i] = static_cast<double>(i);
    if (primitive.contains("indices")) indices = file_.numbers(primitive["indices"]);
    OracleCorners corners;
    for (const double index : indices) {
      const auto v = static_cast<size_t>(index);
      const auto at = [&](const Numbers& all) -> Vec3 {
        return {all[3 * v], all[3 * v + 1], all[3 * v + 2]};
      };
      corners.positions.push_back(mapped(transform[v], at(positions)));
      if (!has_normals) continue;
      corners.normals.push_back(unit(mapped(inverse_transposed(transform[v].turn), at(normals))));
    }
    out_.push_back(std::move(corners));
  }

  const File& file_;
  const Json& json_;
  std::vector<NodeState> states_;
  std::vector<Affine> world_;
  std::vector<OracleCorners> out_;
};

}  // namespace

std::vector<OracleCorners> gltf_frame(const Json& document,
                                      const std::vector<std::vector<uint8_t>>& buffers,
                                      int animation, double seconds) {
  const File file(document, buffers);
  return Frame(file, animation, seconds).corners();
}

Json read_glb(const std::vector<uint8_t>& bytes, std::vector<std::vector<uint8_t>>& buffers) {
  uint32_t json_bytes = 0;
  std::memcpy(&json_bytes, bytes.data() + 12, 4);
  const auto begin = bytes.begin() + 20;
  buffers.assign(1, {begin + json_bytes + 8, bytes.end()});
  return Json::parse(begin, begin + json_bytes);
}

}  // namespace voxeld::reference
