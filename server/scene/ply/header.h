// The header of a PLY file, which describes its layout.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/result.h"

namespace voxeld {

enum class PlyType { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat32, kFloat64 };
enum class PlyEncoding { kAscii, kLittleEndian, kBigEndian };

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::kFloat32;  // of the value, or of a list's items
  bool is_list = false;
  PlyType count_type = PlyType::kUint8;  // of a list's length
};

struct PlyElement {
  std::string name;
  uint64_t count = 0;
  std::vector<PlyProperty> properties;
};

struct PlyHeader {
  PlyEncoding encoding = PlyEncoding::kAscii;
  std::vector<PlyElement> elements;
  std::vector<std::string> texture_files;  // "comment TextureFile NAME"
  size_t data_offset = 0;                  // bytes
  int64_t data_line = 1;                   // first line after the header

  // Returns nullptr if there is none.
  const PlyElement* element(std::string_view name) const;
};

size_t ply_type_bytes(PlyType type);

// Reads the header and checks that the file is large enough for its counts, so readers may allocate
// by them. Errors: malformed-mesh with the line.
Result<PlyHeader> read_ply_header(std::string_view name, std::span<const uint8_t> bytes);

}  // namespace voxeld
