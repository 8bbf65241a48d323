// The file of API keys and the text of a key in a request. A file that is taken is written as a
// text that is taken again and gives the same bytes.
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "server/base/check.h"
#include "server/jobs/auth/key_file.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const voxeld::PresentedKey key = voxeld::split_key(text);
  VOXELD_CHECK(key.id.empty() == key.secret.empty(), "a key has both parts or none");
  if (!key.id.empty()) {
    VOXELD_CHECK("vxk_" + std::string(key.id) + "_" + std::string(key.secret) == text,
                 "the parts are the key");
  }
  const auto keys = voxeld::parse_keys(text, "keys");
  if (!keys) {
    VOXELD_CHECK(keys.error().detail.starts_with("keys line "), "an error says where");
    return 0;
  }
  const std::string written = voxeld::keys_text(*keys);
  const auto again = voxeld::parse_keys(written, "keys");
  VOXELD_CHECK(again.ok() && voxeld::keys_text(*again) == written, "what is written is taken");
  return 0;
}
