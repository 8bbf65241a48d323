#include "server/api/access/signed_link.h"

#include "proto/text/number_text.h"
#include "proto/text/percent_encoding.h"
#include "server/base/clock.h"

namespace voxeld::api {
namespace {

constexpr std::string_view kExpires = "expires", kKey = "key", kSignature = "signature";
// Lists of numbers have it; encoded, links would be hard to read.
constexpr std::string_view kAlsoPlain = ",";

struct Link {
  std::string_view expires, key, path;
  const OptionPairs& query;  // its own parameters are passed over
};

std::string signed_text(const Link& link) {
  std::string text = "voxeld link 1\nGET\n";
  for (const std::string_view line : {link.expires, link.key, link.path}) {
    text.append(line).append("\n");
  }
  for (const auto& [name, value] : link.query) {
    if (!is_link_parameter(name)) text.append(name).append("\n").append(value).append("\n");
  }
  return text;
}

// The only value of that name; nullptr where there is none or another.
const std::string* only(const Head& head, std::string_view name) {
  const std::string* found = nullptr;
  for (const auto& [key, value] : head.query) {
    if (key != name) continue;
    if (found != nullptr) return nullptr;
    found = &value;
  }
  return found;
}

}  // namespace

bool is_signed_link(const Head& head) {
  return (head.method == "GET" || head.method == "HEAD") && only(head, kSignature) != nullptr;
}

bool is_link_parameter(std::string_view name) {
  return name == kExpires || name == kKey || name == kSignature;
}

Error unknown_link() {
  return {ErrorCode::kNotFound, "no such link", "one as it was given", ""};
}

Result<std::string> SignedLinks::make(std::string_view path, const OptionPairs& query,
                                      std::string_view key_id, int64_t expires_s) const {
  const std::string expires = std::to_string(expires_s);
  VOXELD_ASSIGN(const std::string signature,
                secrets_.sign(signed_text({expires, key_id, path, query})));
  std::string url(path);
  url += '?';
  for (const auto& [name, value] : query) {
    url += percent_encode(name, kAlsoPlain) + "=" + percent_encode(value, kAlsoPlain) + "&";
  }
  return url + "expires=" + expires + "&key=" + std::string(key_id) + "&signature=" + signature;
}

Result<std::string> SignedLinks::verify(const Head& head) const {
  const std::string *expires = only(head, kExpires), *key = only(head, kKey),
                    *signature = only(head, kSignature);
  if (expires == nullptr || key == nullptr || signature == nullptr) return unknown_link();
  if (!secrets_.verify(signed_text({*expires, *key, head.path, head.query}), *signature)) {
    return unknown_link();
  }
  const int64_t expires_s = parse_number<int64_t>(*expires).value_or(0);
  if (unix_time_ms() / 1000 < expires_s) return *key;
  return Error{ErrorCode::kGone, "this link has expired", "", ""};
}

}  // namespace voxeld::api
