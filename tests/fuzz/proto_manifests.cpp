// Manifests of sequences, from a worker, and of bundles, from anybody. An accepted sequence
// is written as a text that is accepted again and gives the same bytes. A bundle's names stay
// inside it.
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "proto/blob_id.h"
#include "proto/limits.h"
#include "proto/messages/bundle_manifest.h"
#include "proto/messages/sequence.h"
#include "server/base/check.h"

namespace {

void check_sequence(std::string_view text) {
  const auto manifest = voxeld::parse_sequence(text);
  if (!manifest) {
    VOXELD_CHECK(!manifest.error().detail.empty(), "an error says what");
    return;
  }
  VOXELD_CHECK(!manifest->frames.empty(), "a sequence has frames");
  const std::string written = voxeld::sequence_json(*manifest);
  const auto again = voxeld::parse_sequence(written);
  VOXELD_CHECK(again.ok(), "what is written is taken");
  VOXELD_CHECK(voxeld::sequence_json(*again) == written, "the same manifest gives the same bytes");
}

void check_bundle(std::string_view text) {
  const auto files = voxeld::parse_bundle_manifest(text);
  if (!files) {
    VOXELD_CHECK(!files.error().detail.empty(), "an error says what");
    return;
  }
  VOXELD_CHECK(
      !files->empty() && files->size() <= static_cast<size_t>(voxeld::limits::kBundleEntriesMax),
      "a bundle has files");
  for (const voxeld::BundleFile& file : *files) {
    VOXELD_CHECK(voxeld::is_blob_id(file.asset), "an asset is an id");
    const std::string path = "/" + file.name + "/";
    VOXELD_CHECK(path.find("/../") == std::string::npos && path.find("//") == std::string::npos,
                 "a name stays inside its bundle");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  check_sequence(text);
  check_bundle(text);
  return 0;
}
