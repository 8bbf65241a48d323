#include "client/cli/output_name.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>

namespace voxeld::cli {
namespace {

using Kind = OutputName::Kind;

// Files of these names are taken for meshes, images or volumes of other programs.
constexpr std::string_view kForeign[] = {
    ".3ds",  ".3mf",  ".blend", ".bmp",       ".dae", ".exr", ".fbx", ".gltf",
    ".jpeg", ".jpg",  ".json",  ".md5mesh",   ".off", ".raw", ".stl", ".tga",
    ".tif",  ".tiff", ".webp",  ".schematic", ".nii", ".mhd", ".nhdr"};

std::string grid_extensions() {
  std::string text;
  for (const FormatInfo& format : output_formats()) text += std::string(format.extension) + ", ";
  return text + std::string(sequence_extension(Format::kNative));
}

// Whether files of the format, of a grid or a sequence, have the extension.
bool has_extension(const FormatInfo& format, std::string_view extension) {
  return extension == format.extension || extension == format.sequence_extension;
}

// The name's extension, in lower case; of names with two dots the one that a format has: ".nii.gz".
std::string extension_of_name(const std::string& path) {
  const std::string name = lower_case(std::filesystem::path(path).filename().string());
  for (const FormatInfo& format : output_formats()) {
    const std::string_view extension = format.extension;
    if (name.size() > extension.size() && name.ends_with(extension)) return std::string(extension);
  }
  return std::filesystem::path(name).extension().string();
}

[[noreturn]] void refuse(const std::string& message) {
  throw CLI::ValidationError("--output", message);
}

std::string quoted(const std::string& path) {
  return "\"" + path + "\"";
}

}  // namespace

std::string lower_case(std::string text) {
  std::ranges::transform(text, text.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  return text;
}

OutputName OutputName::of(const std::string& path) {
  OutputName name;
  if (path.empty() || path == "-") return name;
  name.extension = extension_of_name(path);
  name.kind = std::ranges::count(kForeign, name.extension) != 0 ? Kind::kForeign : Kind::kOther;
  if (name.extension == ".png" || name.extension == ".gif" || name.extension == ".apng") {
    name.kind = Kind::kImage;
  }
  for (const FormatInfo& format : output_formats()) {
    if (name.kind != Kind::kGrid && has_extension(format, name.extension)) {
      name.kind = Kind::kGrid;
      name.format = format.format;
    }
  }
  return name;
}

std::string format_for(const std::string& path, const std::string& given) {
  const OutputName name = OutputName::of(path);
  switch (name.kind) {
    case Kind::kStdout:
      return given;
    case Kind::kGrid:
      if (given.empty()) return std::string(format_name(name.format));
      if (const auto format = format_from_name(given);
          format && has_extension(format_info(*format), name.extension)) {
        return given;
      }
      refuse("--format " + given + " does not go to a " + name.extension + ", got " + quoted(path));
    case Kind::kImage:
      refuse("voxel render makes images: voxel render MESH -o " + path);
    case Kind::kForeign:
      break;
    case Kind::kOther:
      if (!given.empty()) return given;
  }
  refuse("expected a name that ends in " + grid_extensions() +
         (name.kind == Kind::kForeign ? "" : " (or --format)") + ", got " + quoted(path));
}

void check_extension(const std::string& path, Format format, bool is_sequence) {
  const FormatInfo& info = format_info(format);
  const std::string grid(info.extension), sequence(info.sequence_extension);
  if (grid == sequence || OutputName::of(path).extension != (is_sequence ? grid : sequence)) return;
  refuse(is_sequence ? "an animation's frames go to a " + sequence + ", not a " + grid
                     : "a " + sequence + " holds an animation's frames: name one with --animation");
}

std::string image_for(const std::string& path, const std::string& given) {
  const OutputName name = OutputName::of(path);
  switch (name.kind) {
    case Kind::kStdout:
      return given;
    case Kind::kImage: {
      const bool is_png = name.extension == ".png";  // a PNG, also an animated one
      std::string image = is_png ? given : name.extension.substr(1);
      if (given.empty() || given == image) {
        if (!is_png || given != "gif") return image;
      }
      refuse("--image " + given + " does not go to a " + name.extension + ", got " + quoted(path));
    }
    case Kind::kGrid:
      refuse("voxel without render makes grids: voxel MESH -o " + path);
    case Kind::kForeign:
      break;
    case Kind::kOther:
      if (!given.empty()) return given;
  }
  refuse(std::string("expected a name that ends in .png, .gif or .apng") +
         (name.kind == Kind::kForeign ? "" : " (or --image)") + ", got " + quoted(path));
}

}  // namespace voxeld::cli
