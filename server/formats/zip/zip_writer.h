// A zip writer for members that arrive piece by piece, deflated on all cores. Members need not fit
// into memory or know their length in advance. Dates are fixed, so equal members in equal pieces
// give equal bytes. Members of 4 GiB and more, and such archives, are zip64 (PKWARE's APPNOTE 6.3,
// 4.3.9 and 4.5.3).
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "proto/result.h"
#include "server/formats/output_file.h"
#include "server/formats/zip/deflate.h"
#include "server/formats/zip/deflate_pieces.h"

namespace voxeld {

class ZipWriter {
 public:
  // The file outlives the writer.
  explicit ZipWriter(OutputFile& file) : file_(file) {}

  // Begins a member; added bytes belong to the member begun last. `name`: ASCII.
  Status begin(const std::string& name);
  Status add(std::span<const uint8_t> bytes);
  // Adds `count` pieces, which are made as they are deflated. bytes_of(i): the length of piece i,
  // at most Deflater::kBlockBytesMax. fill(i, bytes) writes them; several threads call it at once.
  Status add_pieces(size_t count, const std::function<size_t(size_t)>& bytes_of,
                    const std::function<void(size_t, std::span<uint8_t>)>& fill,
                    const Repeats& repeats);
  // Adds a whole member as it is, for bytes that are compressed already.
  Status store(const std::string& name, std::span<const uint8_t> bytes);
  // Ends the last member and writes the archive's directory.
  Status finish();

 private:
  struct Member {
    std::string name;
    uint64_t offset = 0;  // of its local header
    uint64_t raw_bytes = 0, stored_bytes = 0;
    uint32_t crc = 0;
    uint16_t method = 0;  // of compression
  };
  Status append_local(const Member& member);
  Status end_member();
  Status deflate_pending();
  Status append(const DeflatedPiece& piece);

  OutputFile& file_;
  std::vector<Member> members_;
  std::vector<uint8_t> pending_;  // less than a batch of pieces
  bool is_open_ = false;
};

}  // namespace voxeld
