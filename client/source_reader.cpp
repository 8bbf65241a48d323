#include "client/source_reader.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <memory>
#include <system_error>

#include "client/include/voxeld/client.h"

namespace voxeld::client {

SourceReader file_reader(const std::filesystem::path& path) {
  std::error_code error;
  const auto bytes = std::filesystem::file_size(path, error);
  auto file = std::make_shared<std::ifstream>(path, std::ios::binary);
  if (error || !*file) {
    throw Error("file", 0, path.string() + ": " + (error ? error.message() : std::strerror(errno)));
  }
  return {[file](std::span<std::byte> buffer) {
            file->read(reinterpret_cast<char*>(buffer.data()),
                       static_cast<std::streamsize>(buffer.size()));
            return static_cast<size_t>(file->gcount());
          },
          static_cast<long long>(bytes)};
}

SourceReader memory_reader(std::span<const std::byte> bytes) {
  auto left = std::make_shared<std::span<const std::byte>>(bytes);
  return {[left](std::span<std::byte> buffer) {
            const size_t count = std::min(buffer.size(), left->size());
            std::ranges::copy(left->first(count), buffer.begin());
            *left = left->subspan(count);
            return count;
          },
          static_cast<long long>(bytes.size())};
}

SourceReader text_reader(const std::string& text) {
  return memory_reader(std::as_bytes(std::span(text)));
}

}  // namespace voxeld::client
