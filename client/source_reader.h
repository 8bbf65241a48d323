// The bytes that an upload or another request sends, piece by piece.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>

namespace voxeld::client {

struct SourceReader {
  std::function<size_t(std::span<std::byte>)> read;
  std::optional<long long> bytes;
};

// Throws Error "file".
SourceReader file_reader(const std::filesystem::path& path);
// The bytes must outlive the reader.
SourceReader memory_reader(std::span<const std::byte> bytes);
SourceReader text_reader(const std::string& text);

}  // namespace voxeld::client
