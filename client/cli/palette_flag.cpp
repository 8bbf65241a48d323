#include "client/cli/palette_flag.h"

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <system_error>
#include <vector>

#include "proto/palette_files/palette_files.h"

namespace voxeld::cli {
namespace {

std::vector<uint8_t> read_file(const std::string& path) {
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  std::vector<uint8_t> bytes(kPaletteFileBytesMax + 1);  // one more: a longer file is refused
  if (file) {
    file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  }
  if (!file && !file.eof()) {
    const int code = errno == 0 ? EIO : errno;
    throw CLI::ValidationError("--palette", path + ": " + std::generic_category().message(code));
  }
  bytes.resize(static_cast<size_t>(file.gcount()));
  return bytes;
}

}  // namespace

std::string palette_option(const std::string& value) {
  if (value.find_first_of("./") == std::string::npos) return value;
  const std::vector<uint8_t> bytes = read_file(value);
  const auto colors = read_palette(bytes, std::filesystem::path(value).filename().string());
  if (!colors) throw CLI::ValidationError("--palette", colors.error().message());
  return palette_text(*colors);
}

}  // namespace voxeld::cli
