// One stream on its way into a sequence container. Shared by the two source files of
// SequenceWriter.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "server/formats/sequence_writer.h"

namespace voxeld {

// The error for data that this server made but cannot write.
inline Error no_container(const std::string& detail) {
  return {ErrorCode::kInternal, "sequence container: " + detail, "", ""};
}

// A stream to write. Sources of one tile share its canonical form. A known stream is stored once.
struct SequenceWriter::Source {
  std::shared_ptr<const SparseTile> tile;  // null: copied from a container
  Place place;
  std::string key;
  Contents contents;  // the input of codec fast; null: no such stream, or it is known
  uint32_t number = sequence_layout::kNoStream;
  bool is_new = false;
  // Only for new streams:
  uint32_t base = sequence_layout::kNoStream;
  Contents base_contents;
  bool was_tried = false;          // as a difference
  std::span<const uint8_t> whole;  // the container's, or `encoded`
  std::vector<uint8_t> encoded, difference;

  bool exists() const { return contents != nullptr; }
};

}  // namespace voxeld
