// Grid::save: writes a grid to a file, by the daemon for all formats but the native container.
#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <utility>

#include "client/client_impl.h"
#include "client/grid_impl.h"
#include "proto/output_format.h"
#include "proto/part_file.h"

namespace voxeld::client {
namespace {

// A file beside `path` that replaces it when it is complete.
class PartFile {
 public:
  explicit PartFile(const std::filesystem::path& path) : path_(path) {
    std::error_code error;
    const auto status = std::filesystem::status(path, error);
    // A device or a pipe must not be replaced by a new file.
    is_kept_ = std::filesystem::exists(status) && !std::filesystem::is_regular_file(status);
    if (is_kept_) {
      file_ = std::fopen(path.c_str(), "wb");
    } else {
      open_part();
    }
    if (file_ == nullptr) fail();
  }
  ~PartFile() {
    if (file_ != nullptr) std::fclose(file_);
    std::error_code ignored;
    if (!is_kept_) std::filesystem::remove(part_, ignored);
  }
  PartFile(const PartFile&) = delete;
  PartFile& operator=(const PartFile&) = delete;

  void write(std::span<const std::byte> piece) {
    if (std::fwrite(piece.data(), 1, piece.size(), file_) != piece.size()) fail();
  }
  void keep() {
    const int closed = std::fclose(std::exchange(file_, nullptr));
    if (closed != 0) fail();
    if (!is_kept_ && std::rename(part_.c_str(), target_.c_str()) != 0) fail();
    is_kept_ = true;
  }

 private:
  void open_part() {
    std::error_code error;
    const std::filesystem::path real = std::filesystem::canonical(path_, error);
    target_ = error ? path_ : real;
    const int descriptor = create_part(target_, part_);
    if (descriptor >= 0) file_ = ::fdopen(descriptor, "wb");
  }
  [[noreturn]] void fail() const {
    throw Error("file", 0, path_.string() + ": " + std::strerror(errno));
  }

  std::filesystem::path path_;
  std::filesystem::path target_;  // what path_ leads to
  std::filesystem::path part_;
  std::FILE* file_ = nullptr;
  bool is_kept_ = false;  // there is no part, or none any more
};

// The format that the name's extension tells; null if it tells none.
const FormatInfo* format_of_name(const std::filesystem::path& path) {
  std::string name = path.filename().string();
  std::ranges::transform(name, name.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  const auto formats = output_formats();
  const auto found = std::ranges::find_if(formats, [&](const FormatInfo& info) {
    return name.size() > info.extension.size() && name.ends_with(info.extension);
  });
  return found == formats.end() ? nullptr : &*found;
}

std::string text_of_option(const Options& options, std::string_view name) {
  for (const auto& [known, value] : options.pairs()) {
    if (known == name) return value;
  }
  return "";
}

// The name of the format in which to write the file.
std::string chosen_format(const std::filesystem::path& path, const Options& options) {
  const FormatInfo* by_name = format_of_name(path);
  std::string given = text_of_option(options, "format");
  if (by_name == nullptr && given.empty()) {
    std::string extensions;
    for (const FormatInfo& info : output_formats()) extensions += std::string(info.extension) + " ";
    throw Error(
        "file", 0, path.string(),
        "option format, or one of the extensions " + extensions.substr(0, extensions.size() - 1),
        path.has_extension() ? path.extension().string() : "none");
  }
  if (given.empty()) return std::string(by_name->name);
  if (by_name != nullptr && by_name->name != given) {
    throw Error("file", 0, path.string(),
                "format " + std::string(by_name->name) + " by its extension", given);
  }
  return given;
}

}  // namespace

void Grid::save(const std::filesystem::path& path, const Options& options,
                const ProgressCallback& progress, const std::stop_token& stop) const {
  const std::string format = chosen_format(path, options);
  const bool has_others = options.pairs().size() > (options.has("format") ? 1 : 0);
  if (format == format_name(voxeld::Format::kNative) && !has_others) {
    const auto bytes = checked(encode_grid(impl_->header, impl_->tiles));
    PartFile file(path);
    file.write(std::as_bytes(std::span(bytes)));
    file.keep();
    return;
  }
  if (!impl_->daemon || id().empty()) {
    throw Error("file", 0, path.string() + ": the daemon converts grids",
                "a grid of its own, or format native without options", "a grid without an id");
  }
  PartFile file(path);
  ClientImpl daemon(*impl_->daemon);
  Options named = options;
  named.set("format", format);
  daemon.finish(
      daemon.submit("export", Input::of_grid(id()), named, stop),
      [&](std::span<const std::byte> piece) { file.write(piece); }, progress, stop);
  file.keep();
}

}  // namespace voxeld::client
