#include "proto/file_names/text_encodings.h"

#include "proto/file_names/encoding_tables.h"
#include "proto/text/text_file.h"

namespace voxeld {

std::optional<std::string> utf8_from(size_t encoding, std::string_view text) {
  constexpr size_t kDoubleCount = 4;  // encodings of kDoubleBytes
  std::string out;
  for (size_t i = 0; i < text.size(); ++i) {
    const auto first = static_cast<unsigned char>(text[i]);
    uint32_t character = first < 0x80 ? first : kSingleBytes[encoding][first - 0x80];
    if (character == 0 && first > 0x80 && first < 0xff && encoding < kDoubleCount &&
        ++i < text.size()) {
      const auto second = static_cast<unsigned char>(text[i]);
      if (second >= 0x40 && second < 0xff) {
        character = kDoubleBytes[encoding][(first - 0x81) * 191 + (second - 0x40)];
      }
    }
    if (character == 0) return std::nullopt;
    append_utf8(character, out);
  }
  return out;
}

}  // namespace voxeld
