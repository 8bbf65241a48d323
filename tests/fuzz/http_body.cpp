// The input is a chunked body, after two bytes that say where it is split. However it arrives, the
// chunk decoder gives the same body or the same refusal, and the body decoder agrees.
#include <algorithm>
#include <span>
#include <string>
#include <string_view>

#include "server/base/check.h"
#include "server/http/message/body_decoder.h"

namespace {

using namespace voxeld::http;

constexpr int64_t kBodyBytesMax = 4096;

struct Decoded {
  std::string body, rest;
  bool done = false, failed = false;
};

// Feeds `text` in pieces of `step` bytes, the first one of `first` bytes.
Decoded decode(std::string_view text, size_t first, size_t step) {
  ChunkDecoder decoder;
  Decoded out;
  for (size_t at = 0, bytes = first; at < text.size(); at += bytes, bytes = step) {
    bytes = std::min(bytes, text.size() - at);
    out.rest += text.substr(at, bytes);
    if (out.done) continue;
    const auto done = decoder.feed(out.rest, [&](std::string_view piece) -> voxeld::Status {
      VOXELD_CHECK(!piece.empty(), "no empty pieces");
      out.body += piece;
      return {};
    });
    if (!done) {
      VOXELD_CHECK(done.error().code == voxeld::ErrorCode::kBadRequest, "the client's fault");
      out.failed = true;
      return out;
    }
    out.done = *done;
  }
  return out;
}

void check_body(std::string_view text, const Decoded& whole) {
  Head head;
  head.method = "POST";
  head.chunked = true;
  BodyDecoder decoder = BodyDecoder::open(head, kBodyBytesMax).value();
  std::string buffer(text), body;
  const auto done = decoder.feed(buffer, [&](std::span<const uint8_t> piece) -> voxeld::Status {
    body.append(reinterpret_cast<const char*>(piece.data()), piece.size());
    return {};
  });
  const bool too_large = static_cast<int64_t>(whole.body.size()) > kBodyBytesMax;
  VOXELD_CHECK((done.ok() && *done) == (whole.done && !too_large), "both are done or not");
  if (done.ok()) {
    VOXELD_CHECK(body == whole.body && buffer == whole.rest, "the same body");
  } else if (too_large) {
    VOXELD_CHECK(done.error().code == voxeld::ErrorCode::kPayloadTooLarge, "over the limit");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size < 2) return 0;
  const std::string_view text(reinterpret_cast<const char*>(data) + 2, size - 2);
  const Decoded whole = decode(text, text.size(), text.size());
  const Decoded split = decode(text, size_t{data[0]} + 1, size_t{data[1]} + 1);
  VOXELD_CHECK(split.done == whole.done && split.failed == whole.failed, "the same outcome");
  VOXELD_CHECK(!whole.done || split.rest == whole.rest, "the same rest");
  VOXELD_CHECK(split.body == whole.body, "the same body");
  check_body(text, whole);
  return 0;
}
