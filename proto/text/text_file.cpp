#include "proto/text/text_file.h"

#include <algorithm>
#include <cstring>

#include "proto/work_point.h"

namespace voxeld {
namespace {

char lower_ascii(char c) {
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

constexpr uint32_t kReplacement = 0xfffd;        // for invalid characters
constexpr size_t kPieceBytes = size_t{1} << 20;  // between two work points

// Converts by RFC 2781. A surrogate without its pair becomes U+FFFD. An odd last byte stays as it
// is, because some programs append a single ^Z or NUL.
std::string utf8_from_utf16(std::span<const uint8_t> bytes, bool big_endian) {
  const auto unit_at = [&](size_t i) {
    return big_endian ? uint32_t{bytes[i]} << 8 | bytes[i + 1]
                      : uint32_t{bytes[i + 1]} << 8 | bytes[i];
  };
  std::string out;
  out.reserve(bytes.size() / 2 * 3 + 1);  // the most that units become; a copy would take long
  size_t at = 0;
  for (size_t characters = 0; at + 1 < bytes.size(); ++characters) {
    work_point_at(characters);
    const uint32_t unit = unit_at(at);
    at += 2;
    if (unit < 0xd800 || unit > 0xdfff) {
      append_utf8(unit, out);
      continue;
    }
    const uint32_t next = at + 1 < bytes.size() ? unit_at(at) : 0;
    const bool is_pair = unit < 0xdc00 && next >= 0xdc00 && next <= 0xdfff;
    append_utf8(is_pair ? 0x10000 + ((unit - 0xd800) << 10 | (next - 0xdc00)) : kReplacement, out);
    if (is_pair) at += 2;
  }
  if (at < bytes.size()) out += static_cast<char>(bytes[at]);
  return out;
}

// The first CR at or after `begin` that no LF follows; npos if there is none.
size_t find_lone_cr(std::string_view text, size_t begin) {
  while (begin < text.size()) {
    work_point();
    const size_t bytes = std::min(text.size() - begin, kPieceBytes);
    const void* found = std::memchr(text.data() + begin, '\r', bytes);
    if (found == nullptr) {
      begin += bytes;
      continue;
    }
    const auto at = static_cast<size_t>(static_cast<const char*>(found) - text.data());
    if (at + 1 == text.size() || text[at + 1] != '\n') return at;
    begin = at + 2;
  }
  return text.npos;
}

// Cuts at the first NUL or ^Z that only more of them and blanks follow.
std::string_view without_padding(std::string_view text) {
  size_t end = text.size();
  for (size_t i = text.size(); i > 0; --i) {
    work_point_at(i);
    const char c = text[i - 1];
    if (c == '\0' || c == '\x1a') {
      end = i - 1;
    } else if (c != '\n' && !is_blank(c)) {
      break;
    }
  }
  return text.substr(0, end);
}

std::string copied(std::string_view text) {
  std::string out;
  out.reserve(text.size());
  for (; !text.empty(); text.remove_prefix(std::min(text.size(), kPieceBytes))) {
    work_point();
    out += text.substr(0, kPieceBytes);
  }
  return out;
}

}  // namespace

std::string_view trimmed(std::string_view text) {
  const auto is_cut = [](char c) { return is_blank(c) || c == '\n'; };
  for (; !text.empty() && is_cut(text.front()); text.remove_prefix(1)) work_point_at(text.size());
  for (; !text.empty() && is_cut(text.back()); text.remove_suffix(1)) work_point_at(text.size());
  return text;
}

bool equals_ignoring_case(std::string_view a, std::string_view b) {
  if (a.size() != b.size()) return false;
  for (size_t i = 0; i < a.size(); ++i) {
    if (lower_ascii(a[i]) != lower_ascii(b[i])) return false;
  }
  return true;
}

bool is_utf8(std::string_view text) {
  for (size_t i = 0; i < text.size();) {
    const auto first = static_cast<unsigned char>(text[i++]);
    if (first < 0x80) continue;
    const size_t more = first >= 0xf0 ? 3 : first >= 0xe0 ? 2 : 1;
    if (first < 0xc2 || first > 0xf4 || text.size() - i < more) return false;
    const auto second = static_cast<unsigned char>(text[i]);
    const bool is_out = (first == 0xe0 && second < 0xa0) || (first == 0xed && second > 0x9f) ||
                        (first == 0xf0 && second < 0x90) || (first == 0xf4 && second > 0x8f);
    if (is_out) return false;
    for (const size_t end = i + more; i < end; ++i) {
      if ((static_cast<unsigned char>(text[i]) & 0xc0) != 0x80) return false;
    }
  }
  return true;
}

void append_utf8(uint32_t c, std::string& out) {
  const auto add = [&](uint32_t byte) { out += static_cast<char>(byte); };
  if (c < 0x80) {
    add(c);
  } else if (c < 0x800) {
    add(0xc0 | c >> 6);
    add(0x80 | (c & 0x3f));
  } else if (c < 0x10000) {
    add(0xe0 | c >> 12);
    add(0x80 | (c >> 6 & 0x3f));
    add(0x80 | (c & 0x3f));
  } else {
    add(0xf0 | c >> 18);
    add(0x80 | (c >> 12 & 0x3f));
    add(0x80 | (c >> 6 & 0x3f));
    add(0x80 | (c & 0x3f));
  }
}

std::string_view plain_text(std::span<const uint8_t> bytes, std::string& storage) {
  std::string_view text = as_text(bytes);
  const bool is_utf16_be = text.starts_with("\xfe\xff");
  if (is_utf16_be || text.starts_with("\xff\xfe")) {
    storage = utf8_from_utf16(bytes.subspan(2), is_utf16_be);
    text = storage;
  } else if (text.starts_with("\xef\xbb\xbf")) {
    text.remove_prefix(3);
  }
  text = without_padding(text);
  size_t cr = find_lone_cr(text, 0);
  if (cr == text.npos) return text;
  storage = copied(text);
  for (; cr != storage.npos; cr = find_lone_cr(storage, cr + 1)) storage[cr] = '\n';
  return storage;
}

}  // namespace voxeld
