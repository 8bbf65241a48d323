// The input is an OBJ file, and after the first NUL byte, if any, its material file.
#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "tests/fuzz/scene_fuzz.h"

namespace {

// Every reference is the material file.
class OneFileBundle final : public voxeld::Bundle {
 public:
  explicit OneFileBundle(std::vector<uint8_t> bytes)
      : entries_{{"a.png", static_cast<int64_t>(bytes.size())}}, bytes_(std::move(bytes)) {}
  const std::vector<Entry>& entries() const override { return entries_; }
  voxeld::Result<std::optional<std::vector<uint8_t>>> find(std::string_view,
                                                           std::string_view) const override {
    return std::optional(bytes_);
  }

 private:
  std::vector<Entry> entries_;
  std::vector<uint8_t> bytes_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const uint8_t* end = data + size;
  const uint8_t* mark = std::find(data, end, uint8_t{0});
  const OneFileBundle bundle({mark == end ? mark : mark + 1, end});
  const auto scene = voxeld::load_obj("fuzz.obj", {data, mark}, bundle, {.decode_images = false});
  if (!scene) {
    VOXELD_CHECK(!scene.error().detail.empty(), "an error says what");
    VOXELD_CHECK(scene.error().code != voxeld::ErrorCode::kInternal,
                 "input is never an internal error");
    return 0;
  }
  for (const auto& part : scene->parts) voxeld::fuzz::check_part(*scene, part);
  return 0;
}
