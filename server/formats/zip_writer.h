// A zip writer for members that arrive piece by piece, each deflated in slices on all cores.
// Members need not fit into memory or know their length in advance. Dates are fixed, so equal
// members give equal bytes. Members of 4 GiB and more, and
// such archives, are zip64 (PKWARE's APPNOTE 6.3, 4.3.9 and 4.5.3).
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "proto/result.h"
#include "server/formats/sequence_file.h"

namespace voxeld {

class ZipWriter {
 public:
  // The file outlives the writer.
  explicit ZipWriter(SequenceFile& file) : file_(file) {}

  // Begins a member; added bytes belong to the member begun last. `name`: ASCII.
  Status begin(const std::string& name);
  Status add(std::span<const uint8_t> bytes);
  // Ends the last member and writes the archive's directory.
  Status finish();

 private:
  struct Member {
    std::string name;
    uint64_t offset = 0;  // of its local header
    uint64_t raw_bytes = 0, stored_bytes = 0;
    uint32_t crc = 0;
  };
  Status end_member();
  Status deflate_pending(bool is_last);

  SequenceFile& file_;
  std::vector<Member> members_;
  std::vector<uint8_t> pending_;  // less than a batch of slices
  bool is_open_ = false;
};

}  // namespace voxeld
