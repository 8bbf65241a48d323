#include "server/scene/obj/obj_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "proto/limits.h"
#include "server/base/cancel_point.h"
#include "server/base/pieces.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/core/text_cursor.h"

namespace voxeld {
namespace {

// Distinct materials, and other names, in one file. More: malformed-mesh.
constexpr size_t kNamesMax = 65'536;
constexpr size_t kIgnoredWordsMax = 20;
// Bytes of a keyword. A longer word is no statement: malformed-mesh.
constexpr size_t kKeywordBytesMax = 80;
// Bytes of a statement: a face of kPolygonCornersMax corners has some 2 MB. More: malformed-mesh.
// This bounds the work on a number or a name between two cancellation points.
constexpr size_t kObjStatementBytesMax = size_t{1} << 22;
// Bytes of a material's name, which is looked up for each part. More: malformed-mesh.
constexpr size_t kObjMaterialBytesMax = 4096;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
// Statements that do not describe polygonal surfaces; they are skipped silently.
constexpr std::string_view kSkipped[] = {"s",         "l",        "p",       "vp",     "mg",
                                         "lod",       "bevel",    "usemap",  "maplib", "shadow_obj",
                                         "trace_obj", "c_interp", "d_interp"};

class ObjReader {
 public:
  ObjReader(std::string_view name, std::string_view text) : name_(name), left_(text) {
    file_.states.push_back({});
  }

  Result<ObjFile> read() {
    // Common exporters write 30 to 40 bytes per vertex and face.
    file_.positions.reserve(left_.size() / 80);
    file_.corners.reserve(left_.size() / 20);
    file_.faces.reserve(left_.size() / 60);
    while (!left_.empty()) {
      cancel_point();
      VOXELD_TRY(read_statement(next_line()));
    }
    VOXELD_TRY(check_corners());
    take_polypaint();
    warn_dropped();
    return std::move(file_);
  }

 private:
  // Counts dropped items and remembers the first.
  struct Dropped {
    int64_t count = 0;
    std::string first;
    void add(int64_t line, const std::string& expected, const std::string& got) {
      if (count++ > 0) return;
      first = "line " + std::to_string(line) + (expected.empty() ? "" : ", expected " + expected) +
              ", got " + got;
    }
  };

  // A kind of attribute that corners refer to, with its dropped items.
  struct Attribute {
    std::string_view index_name;
    Dropped bad_indices, bad_values;
  };

  void warn(const Dropped& dropped, const std::string& what, std::string_view outcome) {
    if (dropped.count == 0) return;
    file_.warnings.push_back({"dropped-attribute", std::string(name_) + ": " +
                                                       std::to_string(dropped.count) + " " + what +
                                                       " (first: " + dropped.first + "); " +
                                                       std::string(outcome)});
  }

  void warn_dropped() {
    constexpr std::string_view kNone = "their faces have none";
    warn(uv_.bad_indices, "texture coordinate indices are out of range", kNone);
    warn(uv_.bad_values, "texture coordinates are not finite", kNone);
    warn(normal_.bad_indices, "normal indices are out of range", kNone);
    warn(normal_.bad_values, "normals are not finite", kNone);
    warn(bad_colors_, "colours of vertices are not finite", "they are taken as white");
  }

  std::string_view next_physical_line() {
    ++line_;
    const char* const newline = find_newline(left_.data(), left_.data() + left_.size());
    std::string_view line = left_.substr(0, static_cast<size_t>(newline - left_.data()));
    left_.remove_prefix(std::min(line.size() + 1, left_.size()));
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    return line;
  }

  // The next statement. Continuations are joined into `joined_`, if there are any.
  std::string_view next_line() {
    std::string_view line = next_physical_line();
    statement_line_ = line_;
    if (!take_continuation(line)) return line;
    joined_.clear();
    do {
      cancel_point();
      append_in_pieces(joined_, line);
      push_in_pieces(joined_, ' ');
      line = left_.empty() ? std::string_view() : next_physical_line();
    } while (take_continuation(line));
    append_in_pieces(joined_, line);
    return {joined_.data(), joined_.size()};
  }

  // Removes a backslash from the end of the line. Blanks may follow it; one in a comment is text.
  static bool take_continuation(std::string_view& line) {
    if (line.empty() || (line.back() != '\\' && !is_blank(line.back()))) return false;
    std::string_view text = line;
    for (; !text.empty() && is_blank(text.back()); text.remove_suffix(1)) {
      cancel_point_at(text.size());
    }
    if (text.empty() || text.back() != '\\') return false;
    LineCursor words(text);
    for (std::string_view word = words.token(); !word.empty(); word = words.token()) {
      if (word[0] == '#') return false;
    }
    line = text.substr(0, text.size() - 1);
    return true;
  }

  std::string where() const { return "line " + std::to_string(statement_line_); }

  Error malformed(std::string_view what, std::string expected, std::string got) const {
    return malformed_line(name_, statement_line_, what, std::move(expected), std::move(got));
  }

  Status read_statement(std::string_view text) {
    LineCursor line(text);
    const std::string_view keyword = line.token();
    if (keyword == "#MRGB") read_polypaint(line.token());
    if (keyword.empty() || keyword[0] == '#') return {};
    if (text.size() > kObjStatementBytesMax && !is_skipped(keyword)) {
      return over_limit(name_, where(), "too many bytes of a statement",
                        int64_t{kObjStatementBytesMax}, static_cast<int64_t>(text.size()));
    }
    if (keyword == "v") return read_vertex(line);
    if (keyword == "f" || keyword == "fo") return read_face(line);
    if (keyword == "vt") return read_uv(line);
    if (keyword == "vn") return read_normal(line);
    if (keyword == "usemtl") return set_material(line.rest());
    if (keyword == "o") return set_name(without_remark(line.rest()), state_.object);
    if (keyword == "g") return set_name(joined_words(line), state_.group);
    if (keyword == "mtllib") {
      add_library(line.rest());
      return {};
    }
    return skip(keyword);
  }

  static bool is_skipped(std::string_view keyword) {
    return std::find(std::begin(kSkipped), std::end(kSkipped), keyword) != std::end(kSkipped);
  }

  Status skip(std::string_view keyword) {
    if (is_skipped(keyword)) return {};
    const bool word =
        keyword.size() <= kKeywordBytesMax &&
        keyword.find_first_not_of(
            "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-.:") == keyword.npos;
    if (!word) return malformed("not an OBJ statement", "a keyword such as v or f", shown(keyword));
    if (file_.ignored.size() < kIgnoredWordsMax &&
        std::find(file_.ignored.begin(), file_.ignored.end(), keyword) == file_.ignored.end()) {
      file_.ignored.emplace_back(keyword);
    }
    return {};
  }

  // Some exporters repeat the line for every object, so each is stored once.
  void add_library(std::string_view line) {
    std::vector<std::string>& lines = file_.libraries;
    const bool is_known = std::find(lines.begin(), lines.end(), line) != lines.end();
    if (!is_known && lines.size() < kSceneWarningsMax) lines.emplace_back(line);
  }

  // Reads up to values.size() numbers; fewer than `at_least` are an error. From number `may_be_bad`
  // on, a number that is not finite becomes NaN instead of an error.
  Result<size_t> read_numbers(LineCursor& line, std::string_view what, size_t at_least,
                              size_t may_be_bad, std::span<double> values, Dropped& dropped) {
    bool any_bad = false;
    size_t count = 0;
    while (count < values.size()) {
      const std::string_view word = line.token();
      if (word.empty() || word[0] == '#') break;
      auto number = parse_number_or_nan(word);
      const bool is_bad = number && !is_coordinate(*number);
      if (!number || (is_bad && count < may_be_bad)) {
        return malformed(what, "finite numbers up to 1e30", shown(word));
      }
      if (is_bad && !any_bad) dropped.add(statement_line_, "", shown(word));
      any_bad = any_bad || is_bad;
      values[count++] = is_bad ? kNan : *number;
    }
    if (count < at_least) {
      return malformed(
          what, "at least " + std::to_string(at_least) + (at_least == 1 ? " number" : " numbers"),
          std::to_string(count));
    }
    return count;
  }

  Status check_count(std::string_view what, size_t count) const {
    if (count < limits::kVerticesMax) return {};
    return over_limit(name_, where(), what, limits::kVerticesMax, limits::kVerticesMax + 1);
  }

  // Reads "v x y z", "v x y z w" (the weight is for curves), "v x y z r g b" or "v x y z r g b a".
  Status read_vertex(LineCursor& line) {
    std::array<double, 7> n{};
    Dropped bad;
    VOXELD_ASSIGN(const size_t count, read_numbers(line, "vertex", 3, 3, n, bad));
    VOXELD_TRY(check_count("too many vertices", file_.positions.size()));
    push_in_pieces(file_.positions, {n[0], n[1], n[2]});
    if (count >= 6 && bad.count > 0 && bad_colors_.count++ == 0) bad_colors_.first = bad.first;
    if (count >= 6 && bad.count == 0) {
      resize_in_pieces(file_.colors, file_.positions.size() - 1, glm::vec4(-1.0f));
      const glm::vec4 color(n[3], n[4], n[5], count == 7 ? n[6] : 1.0);
      push_in_pieces(file_.colors, color);
      file_.color_max = std::max({file_.color_max, color.x, color.y, color.z});
    } else if (!file_.colors.empty()) {
      push_in_pieces(file_.colors, glm::vec4(-1.0f));
    }
    return {};
  }

  // ZBrush's colours: in comments, 8 hexadecimal digits MMRRGGBB for each vertex in their order, at
  // most 64 in a line. MM is a mask.
  void read_polypaint(std::string_view text) {
    constexpr size_t kDigits = 8;
    for (; text.size() >= kDigits; text.remove_prefix(kDigits)) {
      uint32_t value = 0;
      const char* const end = text.data() + kDigits;
      const auto [stop, error] = std::from_chars(text.data(), end, value, 16);
      if (error != std::errc() || stop != end) return;
      push_in_pieces(polypaint_, value);
      cancel_point_at(polypaint_.size());
    }
  }

  void take_polypaint() {
    if (!file_.colors.empty() || polypaint_.size() != file_.positions.size()) return;
    for (const uint32_t color : polypaint_) {
      cancel_point();
      push_in_pieces(
          file_.colors,
          glm::vec4(glm::vec3(color >> 16 & 255, color >> 8 & 255, color & 255) / 255.0f, 1.0f));
    }
  }

  Status read_uv(LineCursor& line) {
    std::array<double, 2> n{};
    VOXELD_TRY(read_numbers(line, "texture coordinate", 1, 0, n, uv_.bad_values));
    VOXELD_TRY(check_count("too many texture coordinates", file_.uvs.size()));
    push_in_pieces(file_.uvs, {static_cast<float>(n[0]), static_cast<float>(n[1])});
    return {};
  }

  Status read_normal(LineCursor& line) {
    VOXELD_TRY(check_count("too many normals", file_.normals.size()));
    std::array<double, 3> n{};
    bool is_bad = false;
    for (double& x : n) {
      // Real exporters write NaN normals for degenerate faces, so they do not fail the file.
      const std::string_view word = line.token();
      const auto number = parse_number(word);
      x = number.value_or(0.0);
      if (number || is_bad) continue;
      is_bad = true;
      normal_.bad_values.add(statement_line_, "", word.empty() ? "fewer numbers" : shown(word));
    }
    if (is_bad) n.fill(0.0);
    push_in_pieces(file_.normals,
                   {static_cast<float>(n[0]), static_cast<float>(n[1]), static_cast<float>(n[2])});
    return {};
  }

  // Reads an index as a 0-based one. The file counts from 1, or from the end: -1 is the last one so
  // far. Errors name the range.
  Result<uint32_t> read_index(std::string_view word, std::string_view what, size_t count) {
    int64_t index = 0;
    const char* end = word.data() + word.size();
    const auto [stop, error] = std::from_chars(word.data(), end, index);
    if (error != std::errc() || stop != end || index == 0) {
      return malformed(what, "a number other than 0", shown(word));
    }
    if (index < 0) index += static_cast<int64_t>(count) + 1;
    if (index < 1 || index >= int64_t{UINT32_MAX}) {
      return index_error(statement_line_, what, count, std::string(word));
    }
    return static_cast<uint32_t>(index - 1);
  }

  // Reads the index of an attribute, which may be absent: kNone if it is out of range.
  Result<uint32_t> read_attribute(std::string_view word, Attribute& attribute, size_t count) {
    int64_t index = 0;
    const char* end = word.data() + word.size();
    const auto [stop, error] = std::from_chars(word.data(), end, index);
    if (stop != end || error == std::errc::invalid_argument) {
      return malformed(attribute.index_name, "a number", shown(word));
    }
    if (index < 0) index += static_cast<int64_t>(count) + 1;
    if (error == std::errc() && index >= 1 && index < int64_t{UINT32_MAX}) {
      return static_cast<uint32_t>(index - 1);
    }
    attribute.bad_indices.add(statement_line_, range_of(count), std::string(word.substr(0, 40)));
    return ObjCorner::kNone;
  }

  // The valid indices into `count` things, for an error.
  static std::string range_of(size_t count) {
    if (count == 0) return "none, as none are given";
    if (count == 1) return "1 or -1";
    const std::string n = std::to_string(count);
    return "1.." + n + " or -" + n + "..-1";
  }

  Error index_error(int64_t line, std::string_view what, size_t count, std::string got) const {
    return malformed_line(name_, line, std::string(what) + " out of range", range_of(count),
                          std::move(got));
  }

  // Reads "v", "v/vt", "v//vn" or "v/vt/vn"; empty parts are absent.
  Status read_corner(std::string_view word) {
    ObjCorner corner;
    const size_t first = std::min(word.find('/'), word.size());
    VOXELD_ASSIGN(corner.v,
                  read_index(word.substr(0, first), "vertex index", file_.positions.size()));
    if (first < word.size()) {
      const size_t second = std::min(word.find('/', first + 1), word.size());
      const std::string_view vt = word.substr(first + 1, second - first - 1);
      const std::string_view vn = second < word.size() ? word.substr(second + 1) : "";
      if (!vt.empty()) {
        VOXELD_ASSIGN(corner.vt, read_attribute(vt, uv_, file_.uvs.size()));
      }
      if (!vn.empty()) {
        VOXELD_ASSIGN(corner.vn, read_attribute(vn, normal_, file_.normals.size()));
      }
    }
    push_in_pieces(file_.corners, corner);
    return {};
  }

  Status read_face(LineCursor& line) {
    const size_t first = file_.corners.size();
    for (std::string_view word = line.token(); !word.empty(); word = line.token()) {
      if (word[0] == '#') break;
      VOXELD_TRY(read_corner(word));
    }
    const size_t count = file_.corners.size() - first;
    if (count < 3) {  // a point or line, which has no surface
      ++file_.skipped_face_count;
      file_.corners.resize(first);
      return {};
    }
    if (count > limits::kPolygonCornersMax) {
      return over_limit(name_, where(), "too many corners of a face", limits::kPolygonCornersMax,
                        static_cast<int64_t>(count));
    }
    triangle_count_ += static_cast<int64_t>(count) - 2;
    if (triangle_count_ > limits::kTrianglesMax) {
      return over_limit(name_, where(), "too many triangles", limits::kTrianglesMax,
                        triangle_count_);
    }
    push_in_pieces(file_.faces, {static_cast<uint32_t>(count), current_state(),
                                 static_cast<uint32_t>(statement_line_)});
    return {};
  }

  // Checks all indices at the end, because they may point forward.
  Status check_corners() {
    ObjCorner* corner = file_.corners.data();
    for (const ObjFace& face : file_.faces) {
      cancel_point();
      for (uint32_t i = 0; i < face.corner_count; ++i, ++corner) {
        if (corner->v >= file_.positions.size()) {
          return index_error(face.line, "vertex index", file_.positions.size(),
                             std::to_string(uint64_t{corner->v} + 1));
        }
        check_attribute(face, uv_, file_.uvs.size(), corner->vt);
        check_attribute(face, normal_, file_.normals.size(), corner->vn);
        // Numbers that are not finite were reported at their own line.
        if (corner->vt != ObjCorner::kNone && !is_finite(file_.uvs[corner->vt])) {
          corner->vt = ObjCorner::kNone;
        }
      }
    }
    return {};
  }
  static bool is_finite(const glm::vec2& uv) { return std::isfinite(uv.x) && std::isfinite(uv.y); }
  static void check_attribute(const ObjFace& face, Attribute& attribute, size_t count,
                              uint32_t& index) {
    if (index < count || index == ObjCorner::kNone) return;
    attribute.bad_indices.add(face.line, range_of(count), std::to_string(uint64_t{index} + 1));
    index = ObjCorner::kNone;
  }

  uint32_t current_state() {
    if (!state_changed_) return state_index_;
    state_changed_ = false;
    // Above the limit, names no longer separate parts; materials still do.
    ObjState state = state_;
    if (states_.size() >= kScenePartsMax && !states_.contains(state)) {
      state = {.material = state_.material};
      file_.names_dropped = true;
    }
    const auto [found, is_new] =
        states_.try_emplace(state, static_cast<uint32_t>(file_.states.size()));
    if (is_new) file_.states.push_back(state);
    state_index_ = found->second;
    return state_index_;
  }

  Status set_material(std::string_view material) {
    if (material.size() > kObjMaterialBytesMax) {
      return over_limit(name_, where(), "too many bytes of a material's name",
                        int64_t{kObjMaterialBytesMax}, static_cast<int64_t>(material.size()));
    }
    return set_from(material, material_numbers_, file_.materials, state_.material);
  }
  // A face of several groups ("g arm left") belongs to a group named after all of them.
  static std::string joined_words(LineCursor& line) {
    std::string words;
    for (std::string_view word = line.token(); !word.empty() && word != "#"; word = line.token()) {
      words.append(words.empty() ? "" : " ").append(word);
    }
    return words;
  }
  // "#2" is part of a name, "# 2" is a comment.
  static std::string_view without_remark(std::string_view name) {
    return trimmed(name.substr(0, std::min(name.find(" # "), name.size())));
  }
  Status set_name(std::string_view text, uint32_t& current) {
    // Names beyond the limit are dropped.
    if (file_.names.size() >= kNamesMax && !text.empty() && !name_numbers_.contains(text)) {
      file_.names_dropped = true;
      text = {};
    }
    VOXELD_TRY(set_from(text, name_numbers_, file_.names, current));
    state_.name = current;
    return {};
  }
  Status set_from(std::string_view text, std::map<std::string, uint32_t, std::less<>>& numbers,
                  std::vector<std::string>& list, uint32_t& current) {
    state_changed_ = true;
    if (text.empty()) {
      current = 0;
      return {};
    }
    const auto found = numbers.find(text);
    if (found != numbers.end()) {
      current = found->second;
      return {};
    }
    if (list.size() > kNamesMax) {
      return over_limit(name_, where(), "too many materials", static_cast<int64_t>(kNamesMax),
                        static_cast<int64_t>(list.size()));
    }
    current = static_cast<uint32_t>(list.size());
    numbers.emplace(text, current);
    list.emplace_back(text);
    return {};
  }

  std::string_view name_;
  std::string_view left_;
  int64_t line_ = 0;
  int64_t statement_line_ = 0;  // the first line of a continued statement
  std::vector<char> joined_;
  ObjFile file_;
  ObjState state_;
  uint32_t state_index_ = 0;
  bool state_changed_ = true;
  Attribute uv_{"texture coordinate index", {}, {}}, normal_{"normal index", {}, {}};
  Dropped bad_colors_;
  std::vector<uint32_t> polypaint_;  // MMRRGGBB
  int64_t triangle_count_ = 0;
  std::map<ObjState, uint32_t> states_;
  std::map<std::string, uint32_t, std::less<>> material_numbers_, name_numbers_;
};

}  // namespace

Result<ObjFile> read_obj_file(std::string_view name, std::string_view text) {
  return ObjReader(name, text).read();
}

}  // namespace voxeld
