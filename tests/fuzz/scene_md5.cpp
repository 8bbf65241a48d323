#include <cmath>

#include "server/scene/core/text_cursor.h"
#include "server/scene/md5/animation.h"
#include "server/scene/md5/materials.h"
#include "tests/fuzz/scene_fuzz.h"

namespace {

void check_anim(std::string_view text) {
  const auto anim = voxeld::parse_md5_anim("fuzz.md5anim", text);
  if (!anim) {
    VOXELD_CHECK(!anim.error().detail.empty(), "an error says what");
    return;
  }
  for (const double share : {0.0, 0.37, 1.0}) {
    const auto local = voxeld::md5_local_pose(*anim, share * anim->duration());
    VOXELD_CHECK(local.size() == anim->joints.size(), "a pose for each joint");
    for (const auto& pose : local) {
      VOXELD_CHECK(std::isfinite(pose.position.x + pose.orientation.w), "finite poses");
    }
  }
}

}  // namespace

// A mesh, an animation and a material file.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view text = voxeld::as_text({data, size});
  check_anim(text);
  for (const auto& [name, image] : voxeld::parse_mtr(text)) {
    VOXELD_CHECK(!name.empty() && !image.empty(), "names are not empty");
  }
  return voxeld::fuzz::load("fuzz.md5mesh", data, size);
}
