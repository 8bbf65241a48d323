#include "server/scene/gltf/json_text.h"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <string>

#include "proto/limits.h"
#include "server/base/cancel_point.h"
#include "server/base/pieces.h"
#include "server/scene/core/mesh_error.h"

namespace voxeld::gltf {
namespace {

using Json = nlohmann::json;

// Counts brackets and commas outside strings. This needs no parser: text that nests deeper than the
// limit, or has more values, has at least that many brackets or commas.
Status check_shape(std::string_view name, std::string_view text) {
  int depth = 0;
  size_t value_count = 1;
  bool in_string = false;
  for (size_t i = 0, step = 0; i < text.size(); ++i, ++step) {
    cancel_point_at(step);
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
        return over_limit(name, "byte " + std::to_string(i), "depth of the JSON",
                          limits::kGltfJsonDepthMax, depth);
      }
    }
    if (c == ',' && ++value_count > kJsonValuesMax) {
      return malformed_mesh(name, "byte " + std::to_string(i), "values in the JSON",
                            "at most " + std::to_string(kJsonValuesMax), "more");
    }
  }
  return {};
}

// Shortens "[json.exception.parse_error.101] parse error at line 1, column 5: syntax error …" by
// the brackets and the place, and to 200 bytes. Anything but printable ASCII becomes '?', because
// the text quotes the file, which need not be UTF-8.
std::string short_reason(std::string_view what) {
  if (const size_t end = what.find("] "); end != what.npos) what.remove_prefix(end + 2);
  const size_t at = what.find("column ");
  const size_t colon = at == what.npos ? what.npos : what.find(": ", at);
  std::string text(what.substr(colon == what.npos ? 0 : colon + 2, 200));
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c < 0x20 || c > 0x7e; }, '?');
  return text;
}

// The characters of a text, with cancellation points between them: the parser reads all by one
// call.
class JsonText {
 public:
  using iterator_category = std::forward_iterator_tag;
  using value_type = char;
  using difference_type = ptrdiff_t;
  using pointer = const char*;
  using reference = const char&;

  JsonText() = default;
  explicit JsonText(const char* at) : at_(at) {}

  reference operator*() const { return *at_; }
  JsonText& operator++() {
    ++at_;
    cancel_point_at(++count_);
    return *this;
  }
  JsonText operator++(int) {
    const JsonText before = *this;
    ++*this;
    return before;
  }
  bool operator==(const JsonText& other) const { return at_ == other.at_; }

 private:
  const char* at_ = nullptr;
  size_t count_ = 0;
};

}  // namespace

Result<Json> parse_json(std::string_view name, std::string_view text) {
  VOXELD_TRY(check_shape(name, text));
  try {
    Json root = Json::parse(JsonText(text.data()), JsonText(text.data() + text.size()));
    if (root.is_object()) return root;
    return malformed_mesh(name, "", "the JSON is no object", "{\"asset\": …}", root.type_name());
  } catch (const Json::parse_error& e) {
    return malformed_mesh(name, "byte " + std::to_string(e.byte),
                          "not JSON: " + short_reason(e.what()));
  } catch (const Json::exception& e) {  // numbers beyond double
    return malformed_mesh(name, "", "not JSON: " + short_reason(e.what()));
  }
}

void free_json(Json& value) {
  cancel_point();
  if (auto* array = value.get_ptr<Json::array_t*>()) {
    for (; !array->empty(); array->pop_back()) free_json(array->back());
  } else if (auto* object = value.get_ptr<Json::object_t*>()) {
    for (; !object->empty(); object->erase(object->begin())) free_json(object->begin()->second);
  }
}

}  // namespace voxeld::gltf
