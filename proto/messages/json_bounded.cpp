// Parses JSON from outside within bounds. nlohmann's parser is iterative, but copying, comparing
// and dumping its values recurse, so depth is capped while parsing. Duplicate keys are refused,
// because other readers resolve them in other ways.
#include <iterator>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "proto/limits.h"
#include "proto/messages/job.h"
#include "proto/messages/json_bounds.h"
#include "proto/text/client_texts.h"

namespace voxeld {
namespace {

// Only checks the text; a second pass over the same text builds the value.
class BoundedSax : public nlohmann::json_sax<nlohmann::json> {
 public:
  explicit BoundedSax(const JsonBounds& bounds) : bounds_(bounds) {}
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
    if (std::ssize(keys_.back()) >= bounds_.members_max) {
      return refuse("too many members in one object", bounds_.members_max);
    }
    if (keys_.back().insert(name).second) return true;
    error_ =
        Error{ErrorCode::kBadRequest, "JSON: key " + echoed(name) + " stands twice in an object",
              "distinct keys", "a duplicate"};
    return false;
  }
  bool parse_error(size_t position, const std::string&, const nlohmann::json::exception&) override {
    error_ = Error{ErrorCode::kBadRequest, "JSON: syntax error at byte " + std::to_string(position),
                   "a JSON value", ""};
    return false;
  }
  const Error& error() const { return error_; }

 private:
  bool enter() {
    keys_.emplace_back();
    if (std::ssize(keys_) <= bounds_.depth_max) return count();
    return refuse("depth of nesting is over the limit", bounds_.depth_max);
  }
  bool leave() {
    keys_.pop_back();
    return true;
  }

  bool count() {
    return ++values_ <= bounds_.values_max || refuse("too many values", bounds_.values_max);
  }
  bool refuse(const char* what, int64_t max) {
    error_ = Error{ErrorCode::kBadRequest, std::string("JSON: ") + what,
                   "at most " + std::to_string(max), "more"};
    return false;
  }

  const JsonBounds& bounds_;
  int64_t values_ = 0;
  std::vector<std::set<std::string>> keys_;
  Error error_;
};

}  // namespace

Result<nlohmann::json> parse_json_bounded(std::string_view text, int64_t bytes_max) {
  return parse_json_bounded(text, JsonBounds{.bytes_max = bytes_max});
}

Result<nlohmann::json> parse_json_bounded(std::string_view text, const JsonBounds& bounds) {
  if (std::ssize(text) > bounds.bytes_max) {
    return Error{ErrorCode::kPayloadTooLarge, "JSON body is too large",
                 "at most " + std::to_string(bounds.bytes_max) + " bytes",
                 std::to_string(text.size())};
  }
  BoundedSax sax(bounds);
  if (!nlohmann::json::sax_parse(text.begin(), text.end(), &sax)) return sax.error();
  return nlohmann::json::parse(text.begin(), text.end(), nullptr, /*allow_exceptions=*/false);
}

}  // namespace voxeld
