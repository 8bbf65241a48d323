// Reads .npy version 1.0 by its specification, for tests alone.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <optional>
#include <regex>
#include <span>
#include <sstream>
#include <string>
#include <vector>

#include "server/formats/formats.h"
#include "server/formats/npy/dense_array.h"

namespace voxeld::test {

// The .npy file of a channel, from its pieces; the last one first.
inline std::vector<uint8_t> npy_of(const Grid& grid, std::optional<Channel> channel,
                                   const OutputOptions& options) {
  const DenseArray array(grid, channel, options);
  std::vector<uint8_t> npy = array.header();
  const size_t header_bytes = npy.size();
  npy.resize(header_bytes + array.bytes(), 0xa5);
  for (size_t i = array.piece_count(); i-- > 0;) {
    array.fill(i,
               std::span(npy).subspan(header_bytes + array.piece_begin(i), array.piece_bytes(i)));
  }
  return npy;
}

inline Result<std::vector<uint8_t>> encode_as(Format format, const Grid& grid,
                                              OutputOptions options = {}) {
  options.format = format;
  return encode(grid, options);
}

struct NpyArray {
  std::string dict;   // the header's text, without padding
  std::string descr;  // "|u1"
  bool fortran = false;
  std::vector<int64_t> shape;
  std::vector<uint8_t> data;

  template <typename T>
  std::vector<T> as() const {
    std::vector<T> values(data.size() / sizeof(T));
    std::memcpy(values.data(), data.data(), values.size() * sizeof(T));
    return values;
  }
  // Index of a sample in `data`, in samples.
  size_t at(const std::vector<int64_t>& position) const {
    size_t index = 0;
    for (size_t i = 0; i < shape.size(); ++i) {
      const size_t axis = fortran ? shape.size() - 1 - i : i;
      index = index * static_cast<size_t>(shape[axis]) + static_cast<size_t>(position[axis]);
    }
    return index;
  }
};

inline NpyArray read_npy(const std::vector<uint8_t>& bytes) {
  NpyArray array;
  if (bytes.size() < 10 || std::memcmp(bytes.data(), "\x93NUMPY\x01\x00", 8) != 0) {
    ADD_FAILURE() << "not an .npy of version 1.0";
    return array;
  }
  const size_t begin = 10, size = bytes[8] | static_cast<size_t>(bytes[9]) << 8;
  EXPECT_LE(begin + size, bytes.size());
  EXPECT_EQ((begin + size) % 64, 0u) << "samples are aligned to 64 bytes";
  const std::string text(bytes.begin() + 10,
                         bytes.begin() + static_cast<std::ptrdiff_t>(10 + size));
  EXPECT_EQ(text.back(), '\n');
  array.dict = text.substr(0, text.find_last_not_of(" \n") + 1);
  static const std::regex kDict(
      R"(\{'descr': '([^']+)', 'fortran_order': (True|False), 'shape': \(((?:\d+, )+)\), \})");
  std::smatch match;
  if (!std::regex_match(array.dict, match, kDict)) {
    ADD_FAILURE() << "header: " << array.dict;
    return array;
  }
  array.descr = match[1];
  array.fortran = match[2] == "True";
  std::istringstream sides(match[3]);
  for (std::string side; std::getline(sides, side, ',') && side != " ";) {
    array.shape.push_back(std::stoll(side));
  }
  array.data.assign(bytes.begin() + static_cast<std::ptrdiff_t>(begin + size), bytes.end());
  size_t expected = array.descr == "<f8"   ? 8
                    : array.descr == "<i8" ? 8
                    : array.descr == "<i4" ? 4
                    : array.descr == "<f4" ? 4
                    : array.descr == "<u2" ? 2
                                           : 1;
  for (const int64_t side : array.shape) expected *= static_cast<size_t>(side);
  EXPECT_EQ(array.data.size(), expected);
  return array;
}

}  // namespace voxeld::test
