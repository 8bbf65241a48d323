#include "server/base/sha256_file.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "server/base/cancel_point.h"
#include "server/base/file.h"
#include "server/base/mapped_pages.h"
#include "server/base/sha256.h"

namespace voxeld {

Result<std::string> sha256_file_id(const std::filesystem::path& path) {
  constexpr size_t kPieceBytes = size_t{8} << 20;
  VOXELD_ASSIGN(const MappedFile file, MappedFile::open(path));
  Sha256 hash;
  for (std::span<const uint8_t> rest = file.bytes(); !rest.empty();) {
    const auto piece = rest.first(std::min(rest.size(), kPieceBytes));
    cancel_point();
    hash.update(piece);
    drop_mapped_pages(piece);
    rest = rest.subspan(piece.size());
  }
  return hash.finish_id();
}

}  // namespace voxeld
