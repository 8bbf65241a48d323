// Characters of kTextEncodings as numbers below 65,536; 0: none. Made by encoding_tables.py.
#pragma once

#include <cstdint>

namespace voxeld {

// Bytes 0x80 to 0xff.
extern const uint16_t kSingleBytes[][128];
// Pairs of 0x81 to 0xfe and 0x40 to 0xfe, of the encodings that have them.
extern const uint16_t kDoubleBytes[][126 * 191];

}  // namespace voxeld
