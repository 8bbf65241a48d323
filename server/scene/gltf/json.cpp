#include "server/scene/gltf/json.h"

#include <algorithm>
#include <charconv>
#include <nlohmann/json.hpp>
#include <string>

#include "proto/limits.h"
#include "server/scene/gltf/extensions.h"
#include "server/scene/mesh_error.h"

namespace voxeld {
namespace {

std::string byte_of(size_t at) {
  return "byte " + std::to_string(at);
}

// Counts brackets and commas outside strings. This needs no parser: text that nests deeper than the
// limit, or has more values, has at least that many brackets or commas.
Status check_shape(std::string_view name, std::string_view text) {
  int depth = 0;
  size_t value_count = 1;
  bool in_string = false;
  for (size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string) {
      if (c == '\\') ++i;
      if (c == '"') in_string = false;
      continue;
    }
    if (c == '"') in_string = true;
    if (c == '}' || c == ']') --depth;
    if (c == '{' || c == '[') {
      ++value_count;
      if (++depth > limits::kGltfJsonDepthMax) {
        return over_limit(name, byte_of(i), "depth of the JSON", limits::kGltfJsonDepthMax, depth);
      }
    }
    if (c == ',' && ++value_count > kGltfJsonValuesMax) {
      return malformed_mesh(name, byte_of(i), "values in the JSON",
                            "at most " + std::to_string(kGltfJsonValuesMax), "more");
    }
  }
  return {};
}

// Shortens "[json.exception.parse_error.101] parse error at line 1, column 5: syntax error …" by
// the brackets and the place.
std::string short_reason(std::string_view what) {
  if (const size_t end = what.find("] "); end != what.npos) what.remove_prefix(end + 2);
  const size_t at = what.find("column ");
  const size_t colon = at == what.npos ? what.npos : what.find(": ", at);
  return printable(colon == what.npos ? what : what.substr(colon + 2));
}

bool is_version_2(std::string_view version) {
  int major = 0;
  const auto [end, error] = std::from_chars(version.data(), version.data() + version.size(), major);
  return error == std::errc() && major == 2 &&
         (end == version.data() + version.size() || *end == '.');
}

}  // namespace

std::string printable(std::string_view message) {
  std::string text(message.substr(0, 200));
  for (char& c : text) {
    if (c < 0x20 || c > 0x7e) c = '?';
  }
  return text;
}

Result<nlohmann::json> parse_gltf_json(std::string_view name, std::string_view text) {
  VOXELD_TRY(check_shape(name, text));
  try {
    nlohmann::json document = nlohmann::json::parse(text.begin(), text.end());
    if (!document.is_object()) {
      return malformed_mesh(name, "", "the JSON is no object", "{\"asset\": …}",
                            document.type_name());
    }
    return document;
  } catch (const nlohmann::json::parse_error& e) {
    return malformed_mesh(name, byte_of(e.byte), "not JSON: " + short_reason(e.what()));
  } catch (const nlohmann::json::exception& e) {  // numbers beyond double
    return malformed_mesh(name, "", "not JSON: " + short_reason(e.what()));
  }
}

Status check_gltf_version(std::string_view name, const nlohmann::json& document) {
  const auto asset = document.find("asset");
  if (asset == document.end() || !asset->is_object() || !asset->contains("version") ||
      !asset->at("version").is_string()) {
    return malformed_mesh(name, "asset.version", "the file does not say its version", "\"2.0\"",
                          "nothing");
  }
  for (const char* key : {"version", "minVersion"}) {
    const auto version = asset->find(key);
    if (version == asset->end() || !version->is_string()) continue;
    const auto& text = version->get_ref<const std::string&>();
    const bool is_newer = key == std::string_view("minVersion") && text != "2.0";
    if (!is_version_2(text) || is_newer) {
      return Error{ErrorCode::kUnsupportedFeature,
                   std::string(name) + " asset." + key + ": version of glTF", "2.0", shown(text)};
    }
  }
  const auto required = document.find("extensionsRequired");
  if (required == document.end() || !required->is_array()) return {};
  for (const nlohmann::json& extension : *required) {
    if (!extension.is_string()) continue;
    const auto& text = extension.get_ref<const std::string&>();
    if (is_read_extension(text) || is_texture_extension(text)) continue;
    return unread_extension(name, "", "the file requires the glTF extension " + shown(text), text);
  }
  return {};
}

}  // namespace voxeld
