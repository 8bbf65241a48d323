#include "server/scene/md5/materials.h"

#include <algorithm>
#include <cctype>
#include <utility>
#include <vector>

#include "proto/text/text_file.h"
#include "server/scene/core/text_cursor.h"
#include "server/scene/md5/lexer.h"

namespace voxeld {
namespace {

constexpr std::string_view kImageExtensions[] = {".tga", ".png", ".jpg", ".jpeg", ".dds", ".bmp"};
// Image functions may be nested. The limit stops a hostile file that nests them without end.
constexpr int kExpressionTokensMax = 64;

// The form in which material names are compared.
std::string folded(std::string_view name) {
  std::string text(name);
  for (char& c : text) {
    c = c == '\\' ? '/' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return text;
}

bool is_word(const Md5Token& token, std::string_view word) {
  return token.kind == Md5Token::kWord && equals_ignoring_case(token.text, word);
}

std::string_view without_commas(std::string_view text) {
  while (!text.empty() && text.back() == ',') text.remove_suffix(1);
  while (!text.empty() && text.front() == ',') text.remove_prefix(1);
  return text;
}

// Reads a path, or a function of paths, of which the first counts.
std::string read_image(Md5Lexer& lexer) {
  for (int i = 0; i < kExpressionTokensMax; ++i) {
    const auto token = lexer.next();
    if (!token || token->kind == Md5Token::kEnd || token->is('}')) return "";
    if (token->is('(')) continue;
    const auto after = lexer.peek();
    if (after && after->is('(')) continue;  // the name of a function
    const std::string_view path = without_commas(token->text);
    if (!path.empty()) return std::string(path);
  }
  return "";
}

// Reads the inside of "name { … }" up to its end. `image` keeps the first diffuse one.
void read_material(Md5Lexer& lexer, std::string& image) {
  int depth = 1;
  bool in_diffuse_stage = false;
  std::string stage_map;
  const auto keep = [&](const std::string& found) {
    if (image.empty()) image = found;
  };
  while (depth > 0) {
    const auto token = lexer.next();
    if (!token || token->kind == Md5Token::kEnd) return;
    if (token->is('{')) {
      ++depth;
      in_diffuse_stage = false;
      stage_map.clear();
    } else if (token->is('}')) {
      --depth;
      if (in_diffuse_stage) keep(stage_map);
      in_diffuse_stage = false;
    } else if (depth == 1 && is_word(*token, "diffusemap")) {
      keep(read_image(lexer));
    } else if (depth == 2 && is_word(*token, "blend")) {
      const auto how = lexer.next();
      in_diffuse_stage = how && is_word(*how, "diffusemap");
    } else if (depth == 2 && is_word(*token, "map")) {
      stage_map = read_image(lexer);
    }
  }
}

}  // namespace

std::map<std::string, std::string> parse_mtr(std::string_view text) {
  std::map<std::string, std::string> images;
  Md5Lexer lexer("", text);
  std::string name;
  for (;;) {
    const auto token = lexer.next();
    if (!token || token->kind == Md5Token::kEnd) return images;
    if (!token->is('{')) {
      // "material name {" is allowed, so the last word is the name.
      name = folded(token->text);
      continue;
    }
    std::string image;
    read_material(lexer, image);
    if (!name.empty() && !image.empty()) images.emplace(std::exchange(name, ""), std::move(image));
  }
}

Md5Images::Md5Images(const Bundle& bundle, std::string from)
    : bundle_(bundle), from_(std::move(from)) {
  for (const Bundle::Entry& entry : bundle.entries()) {
    const std::string name = folded(entry.name);
    if (!name.ends_with(".mtr")) continue;
    const auto bytes = bundle.find(entry.name, "");
    std::string storage;
    if (bytes && *bytes) materials_.merge(parse_mtr(plain_text(**bytes, storage)));
  }
}

std::optional<std::string> Md5Images::find_image(std::string_view name) const {
  const std::string path(name);
  const size_t dot = path.rfind('.'), slash = path.find_last_of("/\\");
  const bool has_extension = dot != path.npos && (slash == path.npos || dot > slash);
  const std::string stem = has_extension ? path.substr(0, dot) : path;
  std::vector<std::string> candidates;
  if (has_extension) candidates.push_back(path);
  for (const std::string& start : {path, stem, stem + "_d"}) {
    for (const std::string_view extension : kImageExtensions) {
      candidates.push_back(start + std::string(extension));
    }
  }
  for (const std::string& candidate : candidates) {
    const auto found = bundle_.resolve(candidate, from_);
    if (found) return bundle_.entries()[found->index].name;
  }
  return std::nullopt;
}

std::optional<std::string> Md5Images::find(std::string_view shader) const {
  if (shader.empty()) return std::nullopt;
  const auto material = materials_.find(folded(shader));
  if (material != materials_.end()) {
    if (auto image = find_image(material->second)) return image;
  }
  return find_image(shader);
}

}  // namespace voxeld
