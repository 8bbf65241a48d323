#include "server/scene/images/textures.h"

#include <utility>

#include "server/base/cancel_point.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/core/text_cursor.h"
#include "server/scene/images/image.h"

namespace voxeld {
namespace {

bool is_image_name(std::string_view name) {
  const size_t dot = name.rfind('.');
  if (dot == name.npos) return false;
  for (const std::string_view extension :
       {"png", "jpg", "jpeg", "tga", "bmp", "dds", "webp", "hdr", "tif", "tiff", "gif"}) {
    if (equals_ignoring_case(name.substr(dot + 1), extension)) return true;
  }
  return false;
}

// Adds an image. In an inspection it has a name but no pixels.
int add_image(Scene& scene, Image image) {
  scene.images.push_back(std::move(image));
  return static_cast<int>(scene.images.size()) - 1;
}

void add_missing(Scene& scene, const std::string& reference, std::string_view needed_by) {
  if (scene.missing_files.size() < kSceneWarningsMax) {
    scene.missing_files.push_back({reference, std::string(needed_by)});
  }
}

}  // namespace

std::optional<std::string> only_image(const Bundle& bundle) {
  std::optional<std::string> found;
  for (const Bundle::Entry& entry : bundle.entries()) {
    if (!is_image_name(entry.name) || entry.name.starts_with("__MACOSX/")) continue;
    if (found) return std::nullopt;
    found = entry.name;
  }
  return found;
}

int TextureSet::image_index(std::string_view reference, std::string_view needed_by) {
  const auto found = loaded_.find(reference);
  if (found != loaded_.end()) return found->second;
  const std::string name(reference);
  const int index = load(name, needed_by);
  loaded_.emplace(name, index);
  return index;
}

int TextureSet::too_many(const std::string& reference, std::string_view needed_by) {
  add_missing(scene_, reference, needed_by);
  add_warning(scene_, "too-many-pixels",
              reference + ", named by " + std::string(needed_by) + ", " + too_many_pixels());
  return -1;
}

int TextureSet::load(const std::string& reference, std::string_view needed_by) {
  const std::string where = reference + ", named by " + std::string(needed_by);
  cancel_point();
  if (budget_.is_spent()) return too_many(reference, needed_by);
  const auto bytes = bundle_.find(reference, from_);
  if (!bytes || !*bytes) {
    add_missing(scene_, reference, needed_by);
    if (!bytes) {
      add_warning(scene_, "broken-texture", where + ": " + bytes.error().message());
    } else {
      add_warning(scene_, "missing-texture", where + ", is not in the upload");
    }
    return -1;
  }
  warn_assumed_file(scene_, bundle_, reference, from_, needed_by);
  if (!options_.decode_images) return add_image(scene_, {.name = reference, .rgba = {}});
  auto image = decode_image(reference, **bytes, &budget_);
  if (!image) {
    if (budget_.is_spent()) return too_many(reference, needed_by);
    add_missing(scene_, reference, needed_by);
    add_warning(scene_, "broken-texture", where + ": " + image.error().message());
    return -1;
  }
  return add_image(scene_, *std::move(image));
}

}  // namespace voxeld
