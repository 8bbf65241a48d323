#include "server/formats/vdb/bytes.h"

#include <libdeflate.h>

#include <algorithm>
#include <bit>
#include <memory>

#include "server/formats/vdb/tree_order.h"

namespace voxeld::vdb {
namespace {

static_assert(std::endian::native == std::endian::little);

// A leaf's values are a few hundred bytes. Higher levels take up to twice the time for 1% less.
constexpr int kVdbZipLevel = 1;

struct CompressorDeleter {
  void operator()(libdeflate_compressor* compressor) const {
    libdeflate_free_compressor(compressor);
  }
};

// Makes the blocks of one thread.
class BlockMaker {
 public:
  std::span<const uint8_t> make(std::span<const uint8_t> raw, size_t value_bytes) {
    const size_t count = raw.size() / value_bytes;
    const bool is_repeated =
        count > 0 && count <= LeafMask::kBits &&
        std::equal(raw.begin() + static_cast<std::ptrdiff_t>(value_bytes), raw.end(), raw.begin());
    if (!is_repeated) {
      compress(block_, raw);
      return block_;
    }
    const auto value = raw.first(value_bytes);
    if (!std::ranges::equal(value, repeated_)) {
      repeated_.assign(value.begin(), value.end());
      for (Bytes& block : blocks_) block.clear();
    }
    Bytes& block = blocks_[count - 1];
    if (block.empty()) compress(block, raw);
    return block;
  }

 private:
  void compress(Bytes& block, std::span<const uint8_t> raw) {
    block.resize(sizeof(int64_t) + raw.size());
    uint8_t* const begin = block.data() + sizeof(int64_t);
    size_t bytes = 0;  // none: the stream is no smaller
    if (raw.size() > 1 && compressor_) {
      bytes = libdeflate_zlib_compress(compressor_.get(), raw.data(), raw.size(), begin,
                                       raw.size() - 1);
    }
    if (bytes == 0) std::ranges::copy(raw, begin);
    const auto length =
        bytes == 0 ? -static_cast<int64_t>(raw.size()) : static_cast<int64_t>(bytes);
    std::memcpy(block.data(), &length, sizeof length);
    if (bytes > 0) block.resize(sizeof(int64_t) + bytes);
  }

  const std::unique_ptr<libdeflate_compressor, CompressorDeleter> compressor_{
      libdeflate_alloc_compressor(kVdbZipLevel)};
  Bytes block_;
  // Blocks of one value again and again, by their number less 1: those of most leaves of density
  // and ids.
  Bytes repeated_;
  std::array<Bytes, LeafMask::kBits> blocks_;
};

}  // namespace

void put_block(Bytes& out, std::span<const uint8_t> raw, size_t value_bytes) {
  static thread_local const auto maker = std::make_unique<BlockMaker>();
  const std::span<const uint8_t> block = maker->make(raw, value_bytes);
  out.insert(out.end(), block.begin(), block.end());
}

}  // namespace voxeld::vdb
