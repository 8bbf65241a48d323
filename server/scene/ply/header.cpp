#include "server/scene/ply/header.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "proto/limits.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/core/text_cursor.h"

namespace voxeld {
namespace {

// Limits of one header: elements, properties of all elements, and texture files. More:
// malformed-mesh.
constexpr size_t kElementsMax = 64;
constexpr size_t kPropertiesMax = 1024;
constexpr size_t kTextureFilesMax = 256;

constexpr std::pair<std::string_view, PlyType> kTypes[] = {
    {"char", PlyType::kInt8},      {"int8", PlyType::kInt8},       {"uchar", PlyType::kUint8},
    {"uint8", PlyType::kUint8},    {"short", PlyType::kInt16},     {"int16", PlyType::kInt16},
    {"ushort", PlyType::kUint16},  {"uint16", PlyType::kUint16},   {"int", PlyType::kInt32},
    {"int32", PlyType::kInt32},    {"uint", PlyType::kUint32},     {"uint32", PlyType::kUint32},
    {"float", PlyType::kFloat32},  {"float32", PlyType::kFloat32}, {"double", PlyType::kFloat64},
    {"float64", PlyType::kFloat64}};

// Replaces "<this>", which MeshLab knows as the name of the PLY file without its extension.
std::string with_own_name(std::string_view text, std::string_view own_name) {
  constexpr std::string_view kThis = "<this>";
  std::string_view stem = own_name.substr(own_name.find_last_of("/\\") + 1);
  stem = stem.substr(0, stem.rfind('.'));
  std::string out;
  for (size_t i = 0; i < text.size();) {
    const bool is_this = equals_ignoring_case(text.substr(i, kThis.size()), kThis);
    out += is_this ? stem : text.substr(i, 1);
    i += is_this ? kThis.size() : 1;
  }
  return out;
}

class PlyHeaderReader {
 public:
  PlyHeaderReader(std::string_view name, std::string_view text) : name_(name), text_(text) {}

  Result<PlyHeader> read() {
    // All lines end as the first one does: in a binary file, the byte after a CR may be data.
    const size_t end = text_.substr(0, 5).find_first_of("\r\n");
    if (text_.substr(0, 3) != "ply" || end != 3) {
      return malformed("wrong first line", "\"ply\"", shown(text_.substr(0, 16)));
    }
    line_end_ = text_.substr(3, 2) == "\r\n" ? "\r\n" : text_.substr(3, 1);
    next_line();
    for (;;) {
      if (offset_ >= text_.size()) {
        return malformed("truncated header", "\"end_header\"", "the end of the file");
      }
      LineCursor words(next_line());
      const std::string_view keyword = words.token();
      if (keyword == "end_header") break;
      VOXELD_TRY(read_statement(keyword, words));
    }
    if (!has_format_) return malformed("no format", "\"format\" before \"end_header\"", "none");
    header_.data_offset = offset_;
    header_.data_line = line_ + 1;
    VOXELD_TRY(check_counts());
    return std::move(header_);
  }

 private:
  std::string_view next_line() {
    ++line_;
    const size_t end = std::min(text_.find(line_end_, offset_), text_.size());
    const std::string_view line = text_.substr(offset_, end - offset_);
    offset_ = std::min(end + line_end_.size(), text_.size());
    return line;
  }

  Error malformed(std::string_view what, std::string expected, std::string got) const {
    return malformed_line(name_, std::max<int64_t>(line_, 1), what, std::move(expected),
                          std::move(got));
  }

  Status read_statement(std::string_view keyword, LineCursor& words) {
    if (keyword == "format") return read_format(words);
    if (keyword == "element") return read_element(words);
    if (keyword == "property") return read_property(words);
    if (keyword == "comment") return read_comment(words);
    // Ignores obj_info, and comments without their keyword, which Blender 2.47 wrote.
    return {};
  }

  Status read_format(LineCursor& words) {
    constexpr std::pair<std::string_view, PlyEncoding> kEncodings[] = {
        {"ascii", PlyEncoding::kAscii},
        {"binary_little_endian", PlyEncoding::kLittleEndian},
        {"binary_big_endian", PlyEncoding::kBigEndian}};
    const std::string_view word = words.token();
    for (const auto& [encoding_name, encoding] : kEncodings) {
      if (word == encoding_name) {
        header_.encoding = encoding;
        has_format_ = true;
        return {};
      }
    }
    return malformed("format", "ascii, binary_little_endian or binary_big_endian", shown(word));
  }

  Status read_comment(LineCursor& words) {
    LineCursor ahead = words;
    if (!equals_ignoring_case(ahead.token(), "TextureFile")) return {};
    const std::string_view file = ahead.rest();
    if (!file.empty() && header_.texture_files.size() < kTextureFilesMax) {
      header_.texture_files.push_back(with_own_name(file, name_));
    }
    return {};
  }

  Status read_element(LineCursor& words) {
    PlyElement element;
    element.name = words.token();
    const std::string_view count_word = words.token();
    const auto count = parse_integer(count_word);
    if (element.name.empty() || !count || *count < 0) {
      return malformed("element", "a name and a count", shown(count_word));
    }
    if (header_.element(element.name) != nullptr) {
      return malformed("element " + element.name, "once", "twice");
    }
    if (header_.elements.size() == kElementsMax) {
      return over_limit(name_, "line " + std::to_string(line_), "too many elements",
                        int64_t{kElementsMax}, int64_t{kElementsMax + 1});
    }
    const int64_t limit = element.name == "vertex" ? limits::kVerticesMax : limits::kTrianglesMax;
    if ((element.name == "vertex" || element.name == "face") && *count > limit) {
      return over_limit(name_, "line " + std::to_string(line_), "too many elements " + element.name,
                        limit, *count);
    }
    element.count = static_cast<uint64_t>(*count);
    header_.elements.push_back(std::move(element));
    return {};
  }

  Status read_type(std::string_view word, PlyType& type) const {
    for (const auto& [type_name, known] : kTypes) {
      if (word == type_name) {
        type = known;
        return {};
      }
    }
    return malformed("property type", "char, uchar, short, ushort, int, uint, float or double",
                     shown(word));
  }

  Status read_property(LineCursor& words) {
    if (header_.elements.empty()) return malformed("property", "an element before it", "none");
    if (++property_count_ > kPropertiesMax) {
      return over_limit(name_, "line " + std::to_string(line_), "too many properties",
                        int64_t{kPropertiesMax}, static_cast<int64_t>(property_count_));
    }
    PlyProperty property;
    std::string_view type = words.token();
    if (type == "list") {
      property.is_list = true;
      VOXELD_TRY(read_type(words.token(), property.count_type));
      if (property.count_type == PlyType::kFloat32 || property.count_type == PlyType::kFloat64) {
        return malformed("list length type", "an integer type", "a floating-point type");
      }
      type = words.token();
    }
    VOXELD_TRY(read_type(type, property.type));
    property.name = words.token();
    if (property.name.empty()) return malformed("property", "a name", "none");
    header_.elements.back().properties.push_back(std::move(property));
    return {};
  }

  // The fewest bytes that one element takes.
  uint64_t element_bytes_min(const PlyElement& element) const {
    if (header_.encoding == PlyEncoding::kAscii) return 2 * element.properties.size();
    uint64_t bytes = 0;
    for (const PlyProperty& property : element.properties) {
      bytes += ply_type_bytes(property.is_list ? property.count_type : property.type);
    }
    return bytes;
  }

  Status check_counts() const {
    // The last number of a text needs no separator after it.
    uint64_t left = text_.size() - offset_ + (header_.encoding == PlyEncoding::kAscii ? 1 : 0);
    for (const PlyElement& element : header_.elements) {
      const uint64_t each = element_bytes_min(element);
      if (each == 0) continue;
      if (element.count > left / each) {
        return malformed_mesh(name_, "header",
                              "truncated: " + std::to_string(element.count) + " elements " +
                                  shown(element.name) + " declared",
                              "at least " + std::to_string(each) + " bytes for each",
                              std::to_string(left) + " bytes left");
      }
      left -= element.count * each;
    }
    return {};
  }

  std::string_view name_;
  std::string_view text_;
  std::string_view line_end_ = "\n";
  size_t offset_ = 0;
  int64_t line_ = 0;
  bool has_format_ = false;
  size_t property_count_ = 0;
  PlyHeader header_;
};

}  // namespace

const PlyElement* PlyHeader::element(std::string_view name) const {
  const auto found = std::find_if(elements.begin(), elements.end(),
                                  [&](const PlyElement& e) { return e.name == name; });
  return found == elements.end() ? nullptr : &*found;
}

size_t ply_type_bytes(PlyType type) {
  switch (type) {
    case PlyType::kInt8:
    case PlyType::kUint8:
      return 1;
    case PlyType::kInt16:
    case PlyType::kUint16:
      return 2;
    case PlyType::kInt32:
    case PlyType::kUint32:
    case PlyType::kFloat32:
      return 4;
    case PlyType::kFloat64:
      return 8;
  }
  return 0;
}

Result<PlyHeader> read_ply_header(std::string_view name, std::span<const uint8_t> bytes) {
  return PlyHeaderReader(name, as_text(bytes)).read();
}

}  // namespace voxeld
