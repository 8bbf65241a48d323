#include "server/scene/core/bundle_names.h"

#include <algorithm>
#include <array>
#include <vector>

#include "server/scene/core/text_cursor.h"

namespace voxeld {
namespace {

int hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

bool is_absolute(std::string_view path) {
  if (path.front() == '/') return true;
  const char drive = path.front();
  const bool letter = (drive >= 'a' && drive <= 'z') || (drive >= 'A' && drive <= 'Z');
  return letter && path.size() > 1 && path[1] == ':';
}

template <typename Match>
std::optional<size_t> find_name(std::span<const std::string> names, Match match) {
  const auto found = std::find_if(names.begin(), names.end(), match);
  if (found == names.end()) return std::nullopt;
  return static_cast<size_t>(found - names.begin());
}

std::optional<size_t> find_path(std::span<const std::string> names, std::string_view reference,
                                std::string_view folder) {
  // Try the folder of the file first, then the top.
  std::array<std::optional<std::string>, 2> paths;
  if (!reference.empty() && reference[0] != '/' && reference[0] != '\\') {
    paths[0] = normalized_name(std::string(folder) + std::string(reference));
  }
  paths[1] = normalized_name(reference);
  for (const bool any_case : {false, true}) {
    for (const std::optional<std::string>& path : paths) {
      if (!path) continue;
      const auto found = find_name(names, [&](const std::string& name) {
        return any_case ? equals_ignoring_case(name, *path) : name == *path;
      });
      if (found) return found;
    }
  }
  return std::nullopt;
}

std::optional<size_t> find_base_name(std::span<const std::string> names,
                                     std::string_view reference) {
  const std::string_view base = base_name(reference);
  if (base.empty() || base == "." || base == "..") return std::nullopt;
  return find_name(
      names, [&](const std::string& name) { return equals_ignoring_case(base_name(name), base); });
}

}  // namespace

std::optional<std::string> normalized_name(std::string_view name) {
  std::string path(name);
  std::replace(path.begin(), path.end(), '\\', '/');
  if (path.empty() || is_absolute(path)) return std::nullopt;
  std::vector<std::string_view> parts;
  const std::string_view all = path;
  for (size_t begin = 0; begin <= all.size();) {
    const size_t end = std::min(all.find('/', begin), all.size());
    const std::string_view part = all.substr(begin, end - begin);
    begin = end + 1;
    if (part.empty() || part == ".") continue;
    if (part != "..") {
      parts.push_back(part);
    } else if (parts.empty()) {
      return std::nullopt;
    } else {
      parts.pop_back();
    }
  }
  std::string joined;
  for (const std::string_view part : parts) {
    if (!joined.empty()) joined += '/';
    joined += part;
  }
  if (joined.empty()) return std::nullopt;
  return joined;
}

std::string_view base_name(std::string_view name) {
  const size_t slash = name.find_last_of("/\\");
  return slash == name.npos ? name : name.substr(slash + 1);
}

std::string percent_decoded(std::string_view text) {
  std::string out;
  out.reserve(text.size());
  for (size_t i = 0; i < text.size(); ++i) {
    const int high = i + 2 < text.size() && text[i] == '%' ? hex_digit(text[i + 1]) : -1;
    const int low = high >= 0 ? hex_digit(text[i + 2]) : -1;
    if (low >= 0) {
      out += static_cast<char>(high * 16 + low);
      i += 2;
    } else {
      out += text[i];
    }
  }
  return out;
}

std::optional<size_t> resolve_reference(std::span<const std::string> names,
                                        std::string_view reference, std::string_view from) {
  reference = trimmed(reference);
  if (reference.size() > 1 && reference.front() == '"' && reference.back() == '"') {
    reference = reference.substr(1, reference.size() - 2);
  }
  if (reference.substr(0, 5) == "data:") return std::nullopt;
  const std::string_view folder = from.substr(0, from.size() - base_name(from).size());
  const std::string decoded = percent_decoded(reference);
  for (const std::string_view path : {reference, std::string_view(decoded)}) {
    if (const auto found = find_path(names, path, folder)) return found;
  }
  for (const std::string_view path : {reference, std::string_view(decoded)}) {
    if (const auto found = find_base_name(names, path)) return found;
  }
  return std::nullopt;
}

}  // namespace voxeld
