#include "proto/palette_files/palette_files.h"

#include <array>

#include "proto/palette_files/readers.h"
#include "proto/text/client_texts.h"
#include "proto/text/text_file.h"

namespace voxeld {
namespace {

using namespace palette_files;

struct FileFormat {
  std::string_view extension;
  std::string_view signature;  // empty: the extension tells the format
  Status (*read)(Bytes bytes, FileColors& colors);
};

constexpr std::array<FileFormat, 8> kFormats = {{{".gpl", "GIMP Palette", read_gimp},
                                                 {".pal", "JASC-PAL", read_jasc},
                                                 {".pal", "RIFF", read_riff},
                                                 {".ase", "ASEF", read_swatch_exchange},
                                                 {".png", "\x89PNG\r\n\x1a\n", read_png},
                                                 {".act", "", read_color_table},
                                                 {".aco", "", read_color_swatches},
                                                 {".hex", "", read_hex}}};

constexpr std::array<std::string_view, 7> kExtensions = {".gpl", ".pal", ".act", ".aco",
                                                         ".ase", ".hex", ".png"};

// Whether the name ends with the extension, in small or capital ASCII letters.
bool has_extension(std::string_view filename, std::string_view extension) {
  if (filename.size() < extension.size()) return false;
  filename.remove_prefix(filename.size() - extension.size());
  return std::ranges::equal(filename, extension, [](char a, char b) {
    return (a >= 'A' && a <= 'Z' ? static_cast<char>(a - 'A' + 'a') : a) == b;
  });
}

const FileFormat* format_of(Bytes bytes, std::string_view filename) {
  std::string storage;
  const std::string_view text = plain_text(bytes, storage);  // readers of texts do the same
  const auto found = std::ranges::find_if(kFormats, [&](const FileFormat& format) {
    return format.signature.empty() ? has_extension(filename, format.extension)
                                    : text.starts_with(format.signature);
  });
  return found == kFormats.end() ? nullptr : &*found;
}

Error unknown_format(const FileColors& colors, Bytes bytes, std::string_view filename) {
  for (const FileFormat& format : kFormats) {
    if (format.signature.empty() || !has_extension(filename, format.extension)) continue;
    std::string begins = "a file that begins with " + shown(format.signature);
    if (format.extension == ".png") begins = "a PNG image";
    if (format.extension == ".pal") begins = "a file that begins with 'JASC-PAL' or 'RIFF'";
    return colors.error(
        "", begins,
        shown(as_text(bytes.first(std::min<size_t>(bytes.size(), format.signature.size())))));
  }
  std::string known;
  for (const std::string_view extension : kExtensions) {
    known += (known.empty() ? "" : " ") + std::string(extension);
  }
  return colors.error("", "a palette: " + known, "another file");
}

}  // namespace

std::string palette_files::shown(std::string_view text) {
  std::string printable(text.substr(0, kEchoBytesMax));
  for (char& c : printable) {
    if (c < ' ' || c > '~') c = '?';
  }
  return echoed(printable);
}

Result<std::vector<PaletteColor>> read_palette(std::span<const uint8_t> bytes,
                                               std::string_view filename) {
  FileColors colors(filename);
  if (bytes.size() > kPaletteFileBytesMax) {
    return colors.error("", "at most " + std::to_string(kPaletteFileBytesMax) + " bytes",
                        std::to_string(bytes.size()));
  }
  const FileFormat* const format = format_of(bytes, filename);
  if (format == nullptr) return unknown_format(colors, bytes, filename);
  VOXELD_TRY(format->read(bytes, colors));
  std::vector<PaletteColor> read = colors.take();
  if (read.empty()) return colors.error("", "at least one colour", "none");
  return read;
}

}  // namespace voxeld
