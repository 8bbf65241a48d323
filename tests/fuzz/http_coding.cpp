// The input is a compressed body, after two bytes: which coding, and where it is split. However it
// arrives, the decoder gives the same bytes or refuses it, and never more than the limit.
#include <algorithm>
#include <string>

#include "server/base/check.h"
#include "server/http/message/content_coding.h"

namespace {

using namespace voxeld::http;

constexpr int64_t kBytesMax = 65536;

struct Decoded {
  std::string text;
  bool ok = false;
};

Decoded decode(ContentCoding coding, std::span<const uint8_t> bytes, size_t step) {
  const auto decoder = make_content_decoder(coding, kBytesMax);
  Decoded out;
  const auto sink = [&](std::span<const uint8_t> piece) -> voxeld::Status {
    out.text.append(reinterpret_cast<const char*>(piece.data()), piece.size());
    VOXELD_CHECK(static_cast<int64_t>(out.text.size()) <= kBytesMax, "never more than the limit");
    return {};
  };
  while (!bytes.empty()) {
    const size_t some = std::min(step, bytes.size());
    if (!decoder->feed(bytes.first(some), sink)) return out;
    bytes = bytes.subspan(some);
  }
  out.ok = decoder->finish().ok();
  return out;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size < 2) return 0;
  const ContentCoding coding = data[0] % 2 == 0 ? ContentCoding::kGzip : ContentCoding::kZstd;
  const std::span<const uint8_t> bytes(data + 2, size - 2);
  const Decoded whole = decode(coding, bytes, bytes.size());
  const Decoded split = decode(coding, bytes, size_t{data[1]} + 1);
  VOXELD_CHECK(whole.ok == split.ok, "the same outcome");
  VOXELD_CHECK(!whole.ok || whole.text == split.text, "the same body");
  return 0;
}
