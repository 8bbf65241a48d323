#include "server/scene/images/textures.h"

#include <algorithm>
#include <utility>

#include "server/base/cancel_point.h"
#include "server/base/pieces.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/core/text_cursor.h"
#include "server/scene/images/image.h"

namespace voxeld {
namespace {

// Adds an image. In an inspection it has a name but no pixels.
int add_image(Scene& scene, Image image) {
  scene.images.push_back(std::move(image));
  return static_cast<int>(scene.images.size()) - 1;
}

uint8_t channel_of(const uint8_t* texel, char channel) {
  switch (channel) {
    case 'r':
      return texel[0];
    case 'g':
      return texel[1];
    case 'b':
      return texel[2];
    case 'm':
      return texel[3];
    default:  // luminance, by the weights of ITU-R BT.709
      return static_cast<uint8_t>((54 * texel[0] + 183 * texel[1] + 19 * texel[2]) >> 8);
  }
}

bool is_opaque(const Image& image) {
  for (size_t i = 3; i < image.rgba.size(); i += 4) {
    cancel_point_at(i - 3);
    if (image.rgba[i] != 255) return false;
  }
  return true;
}

// The row of `from` that row y of `to` takes.
const uint8_t* row_at(const Image& from, int64_t y, const Image& to) {
  return &from.rgba[static_cast<size_t>(4 * (y * from.height / to.height) * from.width)];
}

// Fills `to`, each of whose texels takes those at its place. `color`: null for white.
void combine(const Image* color, const Image& opacity, char channel, Image& to) {
  if (channel == 0) channel = is_opaque(opacity) ? 'l' : 'm';
  uint8_t* texel = to.rgba.data();
  for (int y = 0; y < to.height; ++y) {
    cancel_point();
    const uint8_t* const color_row = color == nullptr ? nullptr : row_at(*color, y, to);
    const uint8_t* const opacity_row = row_at(opacity, y, to);
    for (int64_t x = 0; x < to.width; ++x, texel += 4) {
      if (color != nullptr) std::copy_n(color_row + 4 * (x * color->width / to.width), 3, texel);
      texel[3] = channel_of(opacity_row + 4 * (x * opacity.width / to.width), channel);
    }
  }
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

void prefer_textures(Scene& scene, std::string_view name) {
  size_t count = 0;
  for (MeshPart& part : scene.parts) {
    const bool has_texture = part.material >= 0 && !part.uvs.empty() &&
                             scene.materials[static_cast<size_t>(part.material)].image >= 0;
    if (!has_texture || part.colors.empty()) continue;
    free_in_pieces(part.colors);
    ++count;
  }
  if (count == 0) return;
  add_warning(scene, "ignored-colors",
              std::string(name) + ": vertex colours of " + std::to_string(count) +
                  (count == 1 ? " part" : " parts") + " with a texture were left out");
}

int TextureSet::image_index(std::string_view reference, std::string_view needed_by) {
  const auto found = loaded_.find(reference);
  if (found != loaded_.end()) return found->second;
  const std::string name(reference);
  const int index = load(name, needed_by);
  loaded_.emplace(name, index);
  return index;
}

int TextureSet::with_opacity(int image, int opacity, char channel, std::string_view needed_by) {
  if (opacity < 0 || (image == opacity && (channel == 0 || channel == 'm'))) return image;
  const auto [found, is_new] = with_opacity_.try_emplace({image, opacity, channel}, image);
  if (!is_new || !options_.decode_images) return found->second;
  const Image& mask = scene_.images[static_cast<size_t>(opacity)];
  const Image* const color = image < 0 ? nullptr : &scene_.images[static_cast<size_t>(image)];
  const Image& shown = color == nullptr ? mask : *color;
  Image made{.name = shown.name,
             .width = std::max(shown.width, mask.width),
             .height = std::max(shown.height, mask.height),
             .rgba = {}};
  if (!budget_.take(made.name, made.width, made.height,
                    std::max(shown.rgba.size(), mask.rgba.size()))) {
    too_many(made.name, needed_by);
    return image;
  }
  resize_in_pieces(made.rgba,
                   size_t{4} * static_cast<size_t>(made.width) * static_cast<size_t>(made.height),
                   uint8_t{255});
  combine(color, mask, channel, made);
  return found->second = add_image(scene_, std::move(made));
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
