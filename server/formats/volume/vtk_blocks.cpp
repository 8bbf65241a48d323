#include "server/formats/volume/vtk_blocks.h"

#include <algorithm>
#include <cstring>
#include <vector>

#include "proto/thread_pool.h"
#include "server/base/cancel_point.h"
#include "server/formats/zip/deflate_stream.h"

namespace voxeld::volume {
namespace {

constexpr size_t kBatchBytes = size_t{32} << 20;  // of pieces that are filled together
constexpr size_t kHeaderNumbers = 3;              // before the lengths of the blocks

// Cuts an array's pieces into blocks of one length and writes them.
class BlockWriter {
 public:
  BlockWriter(OutputFile& file, const ArrayPieces& array) : file_(file), array_(array) {}

  Status write() {
    const uint64_t bytes = array_.bytes();
    const size_t blocks = static_cast<size_t>((bytes + kVtkBlockBytes - 1) / kVtkBlockBytes);
    lengths_ = {blocks, kVtkBlockBytes, bytes % kVtkBlockBytes};
    const uint64_t header_at = file_.size();
    VOXELD_TRY(file_.extend((kHeaderNumbers + blocks) * sizeof(uint64_t)));
    for (size_t piece = 0; piece < array_.piece_count();) {
      piece = fill_from(piece);
      VOXELD_TRY(write_blocks(piece == array_.piece_count()));
    }
    return file_.replace(header_at, {reinterpret_cast<const uint8_t*>(lengths_.data()),
                                     lengths_.size() * sizeof(uint64_t)});
  }

 private:
  // Appends a batch of pieces to the buffer. Returns the first piece after it.
  size_t fill_from(size_t begin) {
    const uint64_t first = array_.piece_begin(begin);
    size_t end = begin + 1;
    while (end < array_.piece_count() && array_.piece_begin(end + 1) - first <= kBatchBytes) ++end;
    const size_t bytes = static_cast<size_t>(array_.piece_begin(end) - first);
    if (buffer_.size() < used_ + bytes) buffer_.resize(used_ + bytes);
    ThreadPool::shared().for_each(end - begin, [&](size_t i) {
      cancel_point();  // on the calling thread
      const auto at = used_ + static_cast<size_t>(array_.piece_begin(begin + i) - first);
      array_.fill(begin + i, std::span(buffer_).subspan(at, array_.piece_bytes(begin + i)));
    });
    used_ += bytes;
    return end;
  }

  // Writes the buffer's whole blocks, or all of it, and moves the rest to its front.
  Status write_blocks(bool is_last) {
    const size_t whole = used_ / kVtkBlockBytes;
    const size_t blocks = whole + (is_last && used_ % kVtkBlockBytes > 0 ? 1 : 0);
    std::vector<std::vector<uint8_t>> streams(blocks);
    ThreadPool::shared().for_each(blocks, [&](size_t i) {
      cancel_point();  // on the calling thread
      const size_t at = i * kVtkBlockBytes;
      const auto raw = std::span(buffer_).subspan(at, std::min(kVtkBlockBytes, used_ - at));
      streams[i] = zlib_stream(raw, array_.repeats());
    });
    for (const std::vector<uint8_t>& stream : streams) {
      lengths_.push_back(stream.size());
      VOXELD_TRY(file_.append(stream));
    }
    const size_t done = std::min(used_, blocks * kVtkBlockBytes);
    std::memmove(buffer_.data(), buffer_.data() + done, used_ - done);
    used_ -= done;
    return {};
  }

  OutputFile& file_;
  const ArrayPieces& array_;
  std::vector<uint64_t> lengths_;  // the array's header
  std::vector<uint8_t> buffer_;
  size_t used_ = 0;  // bytes of it
};

}  // namespace

Status append_vtk_array(OutputFile& file, const ArrayPieces& array) {
  return BlockWriter(file, array).write();
}

}  // namespace voxeld::volume
