// A valid glTF document with some of its values replaced and its buffer filled from the input.
// Random text is refused as JSON long before it reaches the checks of ranges; this goes around
// that.
//
//   input: u8 count of replacements, then (u8 which value, u8 by what) for each, then the buffer
#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace voxeld::fuzz {

using Json = nlohmann::json;

inline const std::vector<Json>& replacements() {
  static const std::vector<Json> values = {nullptr,
                                           true,
                                           false,
                                           -1,
                                           0,
                                           1,
                                           2,
                                           3,
                                           4,
                                           5,
                                           6,
                                           7,
                                           8,
                                           12,
                                           16,
                                           17,
                                           31,
                                           127,
                                           128,
                                           252,
                                           255,
                                           256,
                                           5120,
                                           5121,
                                           5122,
                                           5123,
                                           5124,
                                           5125,
                                           5126,
                                           65535,
                                           2147483647,
                                           4294967295,
                                           4294967296,
                                           int64_t{1} << 53,
                                           UINT64_MAX,
                                           INT64_MIN,
                                           0.5,
                                           -0.0,
                                           1e-300,
                                           1e30,
                                           1e300,
                                           "SCALAR",
                                           "VEC2",
                                           "VEC3",
                                           "VEC4",
                                           "MAT4",
                                           "",
                                           Json::array(),
                                           Json::object(),
                                           Json::array({0, 1, 2, 3})};
  return values;
}

inline std::vector<Json::json_pointer> all_paths(const char* document) {
  std::vector<Json::json_pointer> paths;
  const Json leaves = Json::parse(document).flatten();
  for (const auto& [path, value] : leaves.items()) {
    paths.emplace_back(path);
    if (!paths.back().empty()) paths.push_back(paths.back().parent_pointer());
  }
  return paths;
}

// The GLB of a document under the input; `buffer_bytes`: of its only buffer.
inline std::string changed_glb(const char* text_of_document, size_t buffer_bytes,
                               const uint8_t* data, size_t size) {
  static const std::vector<Json::json_pointer> paths = all_paths(text_of_document);
  Json document = Json::parse(text_of_document);
  size_t at = 1;
  for (int i = 0; size > 0 && i < data[0] % 8 && at + 2 <= size; ++i, at += 2) {
    const Json::json_pointer& path = paths[(data[at] * 4u + data[0] / 64u) % paths.size()];
    // A replacement before may have taken the place away.
    if (!document.contains(path)) continue;
    document[path] = replacements()[data[at + 1] % replacements().size()];
  }
  std::string text = document.dump();
  text.append((4 - text.size() % 4) % 4, ' ');
  std::string bin(size > at ? reinterpret_cast<const char*>(data) + at : "",
                  size > at ? size - at : 0);
  bin.resize(buffer_bytes);
  std::string glb = "glTF";
  const auto put = [&](size_t value) {
    for (int shift = 0; shift < 32; shift += 8) glb += static_cast<char>(value >> shift);
  };
  put(2);
  put(28 + text.size() + bin.size());
  put(text.size());
  glb += "JSON" + text;
  put(bin.size());
  glb += std::string("BIN\0", 4) + bin;
  return glb;
}

}  // namespace voxeld::fuzz
