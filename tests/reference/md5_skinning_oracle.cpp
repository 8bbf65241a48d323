#include "tests/reference/md5_skinning_oracle.h"

#include <algorithm>
#include <cstdlib>

namespace voxeld::reference {
namespace {

// Words, braces and strings without their quotes; parentheses and comments are dropped.
std::vector<std::string> words_of(const std::string& text) {
  std::vector<std::string> words;
  std::string word;
  const auto end_word = [&] {
    if (!word.empty()) words.push_back(word);
    word.clear();
  };
  for (size_t i = 0; i < text.size(); ++i) {
    if (text.compare(i, 2, "//") == 0) {
      while (i < text.size() && text[i] != '\n') ++i;
      end_word();
    } else if (text[i] == '"') {
      const size_t end = text.find('"', i + 1);
      words.push_back(text.substr(i + 1, end - i - 1));
      i = end;
    } else if (std::string(" \t\r\n()").find(text[i]) != std::string::npos) {
      end_word();
    } else if (text[i] == '{' || text[i] == '}') {
      end_word();
      words.emplace_back(1, text[i]);
    } else {
      word += text[i];
    }
  }
  end_word();
  return words;
}

class Words {
 public:
  explicit Words(const std::string& text) : words_(words_of(text)) {}
  bool at_end() const { return at_ >= words_.size(); }
  std::string next() { return at_end() ? "" : words_[at_++]; }
  bool peek_is(const std::string& word) const { return !at_end() && words_[at_] == word; }
  double number() { return std::strtod(next().c_str(), nullptr); }
  int integer() { return static_cast<int>(number()); }
  size_t count() { return static_cast<size_t>(number()); }
  Vec3 vec3() {
    Vec3 v;
    for (double& x : v) x = number();
    return v;
  }

 private:
  std::vector<std::string> words_;
  size_t at_ = 0;
};

Mat3 slice_of(const Vec3& xyz) {
  const double rest = 1 - dot(xyz, xyz);
  return rotation_of(xyz[0], xyz[1], xyz[2], rest > 0 ? -std::sqrt(rest) : 0);
}

OracleMd5Part read_part(Words& words) {
  OracleMd5Part part;
  while (!words.peek_is("}")) {
    const std::string word = words.next();
    if (word == "vert") {
      for (int skipped = 0; skipped < 3; ++skipped) words.next();
      const size_t first = words.count();
      part.vertices.push_back({first, words.count()});
    } else if (word == "tri") {
      words.next();
      const size_t a = words.count(), b = words.count();
      part.triangles.push_back({a, b, words.count()});
    } else if (word == "weight") {
      words.next();
      OracleMd5Weight weight;
      weight.joint = words.count();
      weight.bias = words.number();
      weight.place = words.vec3();
      part.weights.push_back(weight);
    }
  }
  words.next();
  return part;
}

// Position and orientation of a joint in its parent in one frame.
struct Local {
  Vec3 place;
  Mat3 turn;
};

Local local_of(const OracleMd5Anim& anim, size_t joint, size_t frame) {
  std::array<double, 6> numbers = anim.base[joint];
  size_t at = static_cast<size_t>(anim.firsts[joint]);
  for (size_t bit = 0; bit < 6; ++bit) {
    if ((anim.flags[joint] & (1 << bit)) != 0) numbers[bit] = anim.frames[frame][at++];
  }
  return {{numbers[0], numbers[1], numbers[2]}, slice_of({numbers[3], numbers[4], numbers[5]})};
}

std::vector<Affine> pose_of(const OracleMd5Anim& anim, double seconds) {
  const double last = static_cast<double>(anim.frames.size() - 1);
  const double at = std::min(std::max(seconds * anim.frame_rate, 0.0), last);
  const size_t before = static_cast<size_t>(std::floor(at));
  const size_t after = std::min(before + 1, anim.frames.size() - 1);
  const double share = at - static_cast<double>(before);
  std::vector<Affine> pose;
  for (size_t j = 0; j < anim.names.size(); ++j) {
    const Local a = local_of(anim, j, before), b = local_of(anim, j, after);
    const Affine local = {between(a.turn, b.turn, share),
                          plus(times(1 - share, a.place), times(share, b.place))};
    pose.push_back(
        anim.parents[j] < 0 ? local : product(pose[static_cast<size_t>(anim.parents[j])], local));
  }
  return pose;
}

Vec3 blended(const OracleMd5Part& part, size_t vertex, const std::vector<Affine>& pose) {
  Vec3 sum = {0, 0, 0};
  for (size_t i = 0; i < part.vertices[vertex][1]; ++i) {
    const OracleMd5Weight& weight = part.weights[part.vertices[vertex][0] + i];
    sum = plus(sum, times(weight.bias, mapped(pose[weight.joint], weight.place)));
  }
  return sum;
}

// Sums of the areas of the faces at each place, in the bind pose.
std::vector<Vec3> bind_normals(const OracleMd5Part& part, const std::vector<Affine>& bind) {
  std::vector<Vec3> places, sums(part.vertices.size(), Vec3{0, 0, 0});
  for (size_t v = 0; v < part.vertices.size(); ++v) places.push_back(blended(part, v, bind));
  for (const auto& [a, b, c] : part.triangles) {
    const Vec3 area =
        cross(plus(places[c], times(-1, places[a])), plus(places[b], times(-1, places[a])));
    for (const size_t corner : {a, b, c}) {
      for (size_t v = 0; v < places.size(); ++v) {
        if (places[v] == places[corner]) sums[v] = plus(sums[v], area);
      }
    }
  }
  return sums;
}

Vec3 y_up(const Vec3& p) {
  return {p[0], p[2], -p[1]};
}

}  // namespace

OracleMd5Mesh read_md5_mesh(const std::string& text) {
  Words words(text);
  OracleMd5Mesh mesh;
  while (!words.at_end()) {
    const std::string word = words.next();
    if (word == "mesh") mesh.parts.push_back(read_part(words));
    if (word != "joints") continue;
    words.next();
    while (!words.peek_is("}")) {
      OracleMd5Joint joint;
      joint.name = words.next();
      joint.parent = words.integer();
      joint.model_from_joint.place = words.vec3();
      joint.model_from_joint.turn = slice_of(words.vec3());
      mesh.joints.push_back(joint);
    }
  }
  return mesh;
}

OracleMd5Anim read_md5_anim(const std::string& text) {
  Words words(text);
  OracleMd5Anim anim;
  while (!words.at_end()) {
    const std::string word = words.next();
    if (word == "frameRate") anim.frame_rate = words.number();
    if (word == "hierarchy") {
      for (words.next(); !words.peek_is("}");) {
        anim.names.push_back(words.next());
        anim.parents.push_back(words.integer());
        anim.flags.push_back(words.integer());
        anim.firsts.push_back(words.integer());
      }
    } else if (word == "baseframe") {
      for (words.next(); !words.peek_is("}");) {
        const Vec3 p = words.vec3(), q = words.vec3();
        anim.base.push_back({p[0], p[1], p[2], q[0], q[1], q[2]});
      }
    } else if (word == "frame") {
      words.next();
      anim.frames.emplace_back();
      for (words.next(); !words.peek_is("}");) anim.frames.back().push_back(words.number());
    }
  }
  return anim;
}

std::vector<OraclePart> md5_frame(const OracleMd5Mesh& mesh, const OracleMd5Anim* anim,
                                  double seconds) {
  std::vector<Affine> bind, pose;
  for (const OracleMd5Joint& joint : mesh.joints) bind.push_back(joint.model_from_joint);
  const std::vector<Affine> moved = anim ? pose_of(*anim, seconds) : bind;
  for (size_t j = 0; j < bind.size(); ++j) {
    size_t from = j;
    if (anim != nullptr) {
      const auto found = std::find(anim->names.begin(), anim->names.end(), mesh.joints[j].name);
      from = static_cast<size_t>(found - anim->names.begin());
    }
    pose.push_back(moved.at(from));
  }
  std::vector<OraclePart> out;
  for (const OracleMd5Part& part : mesh.parts) {
    OraclePart to;
    const std::vector<Vec3> normals = bind_normals(part, bind);
    for (size_t v = 0; v < part.vertices.size(); ++v) {
      to.positions.push_back(y_up(blended(part, v, pose)));
      Vec3 normal = {0, 0, 0};
      for (size_t i = 0; i < part.vertices[v][1]; ++i) {
        const OracleMd5Weight& weight = part.weights[part.vertices[v][0] + i];
        const Mat3 way = product(pose[weight.joint].turn, transposed(bind[weight.joint].turn));
        normal = plus(normal, times(weight.bias, mapped(way, normals[v])));
      }
      to.normals.push_back(y_up(unit(normal)));
    }
    out.push_back(to);
  }
  return out;
}

}  // namespace voxeld::reference
