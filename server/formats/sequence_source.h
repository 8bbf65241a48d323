// A stream on its way into a sequence container, for the two files of SequenceWriter.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "server/formats/sequence_writer.h"

namespace voxeld {

// What comes from this server and cannot be written all the same.
inline Error no_container(const std::string& detail) {
  return {ErrorCode::kInternal, "sequence container: " + detail, "", ""};
}

// Sources of one tile share its canonical form. What is known of a stream already is stored once.
struct SequenceWriter::Source {
  std::shared_ptr<const SparseTile> tile;  // null: taken over from a container
  Place place;
  std::string key;
  Contents contents;  // what codec fast compresses; null: there is no such stream, or it is kept
  uint32_t number = sequence_layout::kNoStream;
  bool is_new = false;
  // Of those that are new:
  uint32_t base = sequence_layout::kNoStream;
  Contents base_contents;
  bool was_tried = false;          // as a difference
  std::span<const uint8_t> whole;  // the container's, or `encoded`
  std::vector<uint8_t> encoded, difference;

  bool exists() const { return contents != nullptr; }
};

}  // namespace voxeld
