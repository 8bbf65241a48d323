// Detects the format of a mesh file.
#include <algorithm>
#include <cstring>

#include "proto/file_names/file_names.h"
#include "proto/text/text_file.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/core/text_cursor.h"
#include "server/scene/load.h"
#include "server/scene/stl/stl.h"
#include "server/scene/threemf/model.h"

namespace voxeld {
namespace {

constexpr std::string_view kFormatsRead =
    "obj, ply, stl, off, gltf, glb, md5mesh, 3mf, a zip of one of them with its files, or voxels: "
    "voxg, vox, binvox, npy, nrrd";
// Bytes to examine: enough to see "asset" in front of a glTF's buffers, and a statement after a
// long comment.
constexpr size_t kHeadBytes = size_t{64} * 1024;

bool starts_with(std::string_view text, std::string_view prefix) {
  return text.substr(0, prefix.size()) == prefix;
}

// The format, if the first bytes leave no doubt; it wins over any extension.
std::optional<MeshFormat> proven_format(std::string_view text) {
  using namespace std::string_view_literals;
  if (starts_with(text, "glTF"sv)) return MeshFormat::kGlb;
  if (starts_with(text, "PK\3\4"sv) || starts_with(text, "PK\5\6"sv)) return MeshFormat::kZip;
  if (starts_with(text, "ply\n"sv) || starts_with(text, "ply\r"sv)) return MeshFormat::kPly;
  const std::string_view head = text.substr(0, kHeadBytes);
  const std::string_view json =
      trimmed(starts_with(head, "\xef\xbb\xbf"sv) ? head.substr(3) : head);
  if (starts_with(json, "<"sv) && threemf::looks_like_model(json)) return MeshFormat::k3mf;
  if (starts_with(json, "{"sv) && json.find("\"asset\"") != json.npos) return MeshFormat::kGltf;
  return std::nullopt;
}

std::optional<MeshFormat> format_of_extension(std::string_view filename) {
  const std::string_view base = base_name(filename);
  const size_t dot = base.rfind('.');
  if (dot == base.npos) return std::nullopt;
  constexpr std::pair<std::string_view, MeshFormat> kExtensions[] = {
      {"obj", MeshFormat::kObj},     {"ply", MeshFormat::kPly},   {"stl", MeshFormat::kStl},
      {"off", MeshFormat::kOff},     {"gltf", MeshFormat::kGltf}, {"glb", MeshFormat::kGlb},
      {"md5mesh", MeshFormat::kMd5}, {"3mf", MeshFormat::kZip},   {"zip", MeshFormat::kZip}};
  for (const auto& [name, format] : kExtensions) {
    if (equals_ignoring_case(base.substr(dot + 1), name)) return format;
  }
  return std::nullopt;
}

// Accepts "OFF", "COFF", "STCNOFF", "4OFF", "nOFF", "OFF8".
bool is_off_keyword(std::string_view word) {
  const size_t off = word.find("OFF");
  if (off == word.npos) return false;
  const auto only = [](std::string_view part, std::string_view allowed) {
    return part.find_first_not_of(allowed) == part.npos;
  };
  return only(word.substr(0, off), "STCN4n") && only(word.substr(off + 3), "0123456789");
}

// Meshes and animations of MD5 begin with the same word.
bool looks_like_md5(std::string_view text) {
  return TextCursor(text).token() == "MD5Version";
}
bool looks_like_md5_animation(std::string_view text) {
  return looks_like_md5(text) &&
         (text.find("numFrames") != text.npos || text.find("numberOfFrames") != text.npos);
}

// An md5anim file is not a mesh: it is only read together with one.
bool is_md5_animation(std::string_view filename, std::span<const uint8_t> bytes) {
  constexpr std::string_view kExtension = ".md5anim";
  if (filename.size() > kExtension.size() &&
      equals_ignoring_case(filename.substr(filename.size() - kExtension.size()), kExtension)) {
    return true;
  }
  std::string storage;
  return looks_like_md5_animation(
      plain_text(bytes.first(std::min(bytes.size(), kHeadBytes)), storage));
}

// Whether the text has the two statements that every OBJ needs, each with its numbers.
bool looks_like_obj(std::string_view text) {
  bool vertex = false;
  while (!text.empty()) {
    const size_t end = std::min(text.find('\n'), text.size());
    LineCursor line(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
    const std::string_view keyword = line.token();
    if (keyword == "mtllib" && !line.at_end()) return true;
    if (keyword == "v") {
      vertex =
          parse_number(line.token()) && parse_number(line.token()) && parse_number(line.token());
      if (vertex) return true;
    } else if (!keyword.empty() && keyword[0] != '#' && keyword != "o" && keyword != "g" &&
               keyword != "s" && keyword != "usemtl" && keyword != "vn" && keyword != "vt") {
      return false;
    }
  }
  return false;
}

std::optional<MeshFormat> guessed_format(std::span<const uint8_t> bytes) {
  std::string storage;
  const std::string_view head =
      plain_text(bytes.first(std::min(bytes.size(), kHeadBytes)), storage);
  if (is_off_keyword(TextCursor(head, '#').token())) return MeshFormat::kOff;
  if (is_binary_stl(bytes)) return MeshFormat::kStl;
  if (TextCursor(head).token() == "solid") return MeshFormat::kStl;
  if (looks_like_md5(head) && !looks_like_md5_animation(head)) return MeshFormat::kMd5;
  if (looks_like_obj(head)) return MeshFormat::kObj;
  if (is_binary_stl_of_wrong_count(bytes)) return MeshFormat::kStl;
  return std::nullopt;
}

bool is_gzip(std::string_view text) {
  return starts_with(text, "\x1f\x8b");
}

std::string first_bytes(std::string_view text) {
  if (text.empty()) return "no bytes";
  if (is_gzip(text)) return "a gzip file, which has to be unpacked first";
  return "first bytes " + shown(text.substr(0, 16));
}

}  // namespace

Result<MeshFormat> detect_format(std::string_view filename, std::span<const uint8_t> bytes) {
  const std::string_view text = as_text(bytes);
  if (const auto format = proven_format(text)) return *format;
  if (const auto format = format_of_extension(filename); format && !is_gzip(text)) return *format;
  if (const auto format = guessed_format(bytes)) return *format;
  const std::string name = filename.empty() ? "the upload" : std::string(filename);
  if (is_md5_animation(filename, bytes)) {
    return Error{ErrorCode::kUnsupportedMedia,
                 name + ": an MD5 animation, which moves a mesh and has no surface of its own",
                 "a bundle or zip of it with its md5mesh", "an animation alone"};
  }
  return Error{ErrorCode::kUnsupportedMedia, name + ": not a format that voxeld reads",
               std::string(kFormatsRead), first_bytes(text)};
}

std::string_view mesh_format_name(MeshFormat format) {
  switch (format) {
    case MeshFormat::kObj:
      return "obj";
    case MeshFormat::kPly:
      return "ply";
    case MeshFormat::kStl:
      return "stl";
    case MeshFormat::kOff:
      return "off";
    case MeshFormat::kGltf:
      return "gltf";
    case MeshFormat::kGlb:
      return "glb";
    case MeshFormat::kMd5:
      return "md5mesh";
    case MeshFormat::k3mf:
      return "3mf";
    case MeshFormat::kZip:
      return "zip";
  }
  return "";
}

}  // namespace voxeld
