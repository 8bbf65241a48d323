// JSON from outside: nlohmann's parser is iterative, but copying, comparing and dumping its values
// recurse, so depth is capped while parsing; duplicate keys, which other readers resolve otherwise,
// are refused.
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "proto/job.h"
#include "proto/limits.h"

namespace voxeld {
namespace {

using Json = nlohmann::json;

// A value takes up to a hundred bytes in memory, however short it is in the text: as many are taken
// as the largest text would have if each had so many bytes. More: bad-request.
constexpr int64_t kBytesPerValue = 32;

// Checks only; the value is built by a second pass over the same text.
class BoundedSax : public nlohmann::json_sax<Json> {
 public:
  explicit BoundedSax(int64_t values_max) : values_max_(values_max) {}
  bool null() override { return count(); }
  bool boolean(bool) override { return count(); }
  bool number_integer(number_integer_t) override { return count(); }
  bool number_unsigned(number_unsigned_t) override { return count(); }
  bool number_float(number_float_t, const string_t&) override { return count(); }
  bool string(string_t&) override { return count(); }
  bool binary(binary_t&) override { return count(); }
  bool start_object(size_t) override { return enter(); }
  bool start_array(size_t) override { return enter(); }
  bool end_object() override { return leave(); }
  bool end_array() override { return leave(); }
  bool key(string_t& name) override {
    if (keys_.back().insert(name).second) return true;
    error_ = Error{ErrorCode::kBadRequest, "JSON: key \"" + name + "\" stands twice in an object",
                   "distinct keys", "a duplicate"};
    return false;
  }
  bool parse_error(size_t position, const std::string&, const Json::exception&) override {
    error_ = Error{ErrorCode::kBadRequest, "JSON: syntax error at byte " + std::to_string(position),
                   "a JSON value", ""};
    return false;
  }
  const Error& error() const { return error_; }

 private:
  bool count() {
    if (++values_ <= values_max_) return true;
    error_ = Error{ErrorCode::kBadRequest, "JSON: too many values",
                   "at most " + std::to_string(values_max_), "more"};
    return false;
  }
  bool enter() {
    if (!count()) return false;
    keys_.emplace_back();
    if (keys_.size() <= static_cast<size_t>(limits::kJsonDepthMax)) return true;
    error_ = Error{ErrorCode::kBadRequest, "JSON: depth of nesting is over the limit",
                   "at most " + std::to_string(limits::kJsonDepthMax), "more"};
    return false;
  }
  bool leave() {
    keys_.pop_back();
    return true;
  }

  const int64_t values_max_;
  int64_t values_ = 0;
  std::vector<std::set<std::string>> keys_;
  Error error_;
};

}  // namespace

Result<Json> parse_json_bounded(std::string_view text, int64_t bytes_max) {
  if (text.size() > static_cast<size_t>(bytes_max)) {
    return Error{ErrorCode::kPayloadTooLarge, "JSON body is too large",
                 "at most " + std::to_string(bytes_max) + " bytes", std::to_string(text.size())};
  }
  BoundedSax sax(bytes_max / kBytesPerValue);
  if (!Json::sax_parse(text.begin(), text.end(), &sax)) return sax.error();
  return Json::parse(text.begin(), text.end(), nullptr, /*allow_exceptions=*/false);
}

}  // namespace voxeld
