// Encodings of text before UTF-8, in which older systems write names of files.
#pragma once

#include <cstddef>
#include <iterator>
#include <optional>
#include <string>
#include <string_view>

namespace voxeld {

// As encoding_tables.py has them; those of two bytes first.
inline constexpr std::string_view kTextEncodings[] = {"GBK",    "Shift-JIS", "Big5",  "EUC-KR",
                                                      "CP1252", "CP850",     "CP437", "CP1250",
                                                      "CP852",  "CP1251",    "CP866"};
inline constexpr size_t kTextEncodingCount = std::size(kTextEncodings);
// Has a letter for every byte: clients send names that are not UTF-8 as it reads them.
inline constexpr size_t kCp437 = 6;
static_assert(kTextEncodings[kCp437] == "CP437");

// Converts text of encoding number `encoding`; nullopt if it is not valid there.
std::optional<std::string> utf8_from(size_t encoding, std::string_view text);

}  // namespace voxeld
