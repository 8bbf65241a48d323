// A scope, then name=value pairs parted by '&', as the query string has them after decoding.
// Accepted options must have a canonical form that is accepted again and gives the same bytes.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "proto/options/options.h"
#include "server/base/check.h"

namespace {

voxeld::OptionPairs pairs_of(std::string_view text) {
  voxeld::OptionPairs pairs;
  while (!text.empty()) {
    const std::string_view pair = text.substr(0, text.find('&'));
    text.remove_prefix(std::min(text.size(), pair.size() + 1));
    const size_t equals = std::min(pair.find('='), pair.size());
    pairs.emplace_back(pair.substr(0, equals), pair.substr(std::min(pair.size(), equals + 1)));
  }
  return pairs;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  const auto scope = static_cast<voxeld::OptionScope>(data[0] % 4);
  const auto options =
      voxeld::parse_options(pairs_of({reinterpret_cast<const char*>(data) + 1, size - 1}), scope);
  if (!options) {
    const voxeld::ErrorCode code = options.error().code;
    VOXELD_CHECK(
        code == voxeld::ErrorCode::kUnknownOption || code == voxeld::ErrorCode::kInvalidOption,
        "the error is one of options");
    // An unknown name may be near to another one, or known to other requests.
    const std::string& detail = options.error().detail;
    const bool is_explained = detail.find("; did you mean '") != std::string::npos ||
                              detail.ends_with(" does not apply to this request");
    VOXELD_CHECK(!options.error().expected.empty() ||
                     (code == voxeld::ErrorCode::kUnknownOption && is_explained),
                 "an error says what is expected");
    return 0;
  }
  const std::string canonical = voxeld::canonical_json(*options, scope);
  const auto again = voxeld::parse_options(nlohmann::json::parse(canonical), scope);
  VOXELD_CHECK(again.ok(), "the canonical form is taken");
  VOXELD_CHECK(voxeld::canonical_json(*again, scope) == canonical,
               "the canonical form of the canonical form is the same");
  return 0;
}
