#include "proto/file_names/file_names.h"

#include <utf8proc.h>

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <span>
#include <utility>

#include "proto/file_names/text_encodings.h"
#include "proto/text/text_file.h"

namespace voxeld {
namespace {

// References that are tried in all encodings. Further ones are not: 1,000 names take some
// milliseconds for each.
constexpr size_t kEncodedReferencesMax = 256;
// Parts of a path that are tried, from its end.
constexpr size_t kPathPartsMax = 8;

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

std::string normalized_or_base(std::string_view name) {
  return normalized_name(name).value_or(std::string(base_name(name)));
}

// With composed letters (NFC) and without regard to case, beyond ASCII too. macOS decomposes the
// letters of names of files.
std::string folded(const std::string& text) {
  utf8proc_uint8_t* out = nullptr;
  const auto options =
      static_cast<utf8proc_option_t>(UTF8PROC_STABLE | UTF8PROC_COMPOSE | UTF8PROC_CASEFOLD);
  const utf8proc_ssize_t bytes =
      utf8proc_map(reinterpret_cast<const utf8proc_uint8_t*>(text.data()),
                   static_cast<utf8proc_ssize_t>(text.size()), &out, options);
  const std::unique_ptr<utf8proc_uint8_t, decltype(&std::free)> owned(out, std::free);
  return bytes < 0 ? text : std::string(owned.get(), owned.get() + bytes);
}

// The normalized folder of a file, with a slash behind it; empty for the top.
std::string folder_of(std::string_view file) {
  const auto folder = normalized_name(file.substr(0, file.size() - base_name(file).size()));
  return folder ? *folder + '/' : "";
}

// The only name that equals `path`, or that does without regard to case if none equals it. With
// `anywhere`, a name whose last parts are `path` counts, too; it begins with `folder`.
std::optional<size_t> find_one(std::span<const std::string> names, std::string_view path,
                               bool anywhere, std::string_view folder) {
  size_t exact_count = 0, count = 0, exact = 0, found = 0;
  for (size_t i = 0; i < names.size(); ++i) {
    const std::string_view name = names[i];
    if (name.size() < path.size()) continue;
    const size_t begin = name.size() - path.size();
    const bool is_at_part = begin == 0 || (anywhere && name[begin - 1] == '/');
    const std::string_view end = name.substr(begin);
    if (!is_at_part || !name.starts_with(folder) || !equals_ignoring_case(end, path)) continue;
    found = i;
    ++count;
    if (end != path) continue;
    exact = i;
    ++exact_count;
  }
  if (exact_count == 1) return exact;
  if (exact_count == 0 && count == 1) return found;
  return std::nullopt;
}

// Finds `reference` as a path from `folder` or from the top.
std::optional<size_t> find_path(std::span<const std::string> names, std::string_view reference,
                                std::string_view folder) {
  for (const std::string_view start : {folder, std::string_view()}) {
    if (reference.empty() || is_absolute(reference) || reference.front() == '\\') break;
    const auto path = normalized_name(std::string(start) + std::string(reference));
    if (!path) continue;
    const auto found = std::find(names.begin(), names.end(), *path);
    if (found != names.end()) return static_cast<size_t>(found - names.begin());
  }
  return std::nullopt;
}

// The last parts of a path, joined by slashes, from many to one; none if it ends with a slash.
std::vector<std::string> last_parts(std::string_view reference) {
  std::vector<std::string> ends;
  if (base_name(reference).empty()) return ends;
  while (!reference.empty() && ends.size() < kPathPartsMax) {
    const std::string_view part = base_name(reference);
    reference.remove_suffix(std::min(part.size() + 1, reference.size()));
    if (part.empty() || part == ".") continue;
    if (part == ".." || part.ends_with(':')) break;
    ends.push_back(ends.empty() ? std::string(part) : std::string(part) + '/' + ends.back());
  }
  std::reverse(ends.begin(), ends.end());
  return ends;
}

// Finds the last parts of `reference`: beside the mesh, below its folder, and anywhere.
std::optional<size_t> find_last_parts(std::span<const std::string> names,
                                      std::string_view reference, std::string_view folder) {
  const std::vector<std::string> ends = last_parts(reference);
  const auto is_last_part = [&](const std::string& name) {
    return name.size() >= ends.back().size() && equals_ignoring_case(base_name(name), ends.back());
  };
  if (ends.empty() || std::none_of(names.begin(), names.end(), is_last_part)) return std::nullopt;
  for (const std::string& end : ends) {
    if (const auto found = find_one(names, std::string(folder) + end, false, {})) return found;
    if (const auto found = find_one(names, end, true, folder)) return found;
    if (const auto found = find_one(names, end, true, {})) return found;
  }
  return std::nullopt;
}

// Folded names may be equal.
std::optional<size_t> find_folded(std::span<const std::string> names, std::string_view reference,
                                  std::string_view folder) {
  const auto found = find_path(names, reference, folder);
  const bool is_one = found && std::ranges::count(names, names[*found]) == 1;
  return is_one ? found : find_last_parts(names, reference, folder);
}

// How `name` differs from the path that it is taken for; empty if it does not.
std::string difference(std::string_view reference, std::string_view name, std::string_view folder) {
  const std::string path = normalized_name(reference).value_or("");
  const std::string from_folder =
      normalized_name(std::string(folder) + std::string(reference)).value_or("");
  for (const std::string_view whole : {std::string_view(path), std::string_view(from_folder)}) {
    if (name == whole) return "";
    if (equals_ignoring_case(name, whole)) return "the same name in another case";
  }
  const bool is_end = !path.empty() && name.size() > path.size() &&
                      equals_ignoring_case(name.substr(name.size() - path.size()), path);
  return is_end ? "the same name in another folder" : "the end of the path";
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

FileNames::FileNames(std::vector<std::string> names) : names_(std::move(names)) {
  for (const std::string& name : names_) {
    is_utf8_ = is_utf8_ && is_utf8(name);
    as_written_.push_back(normalized_or_base(name));
  }
}

std::optional<NameMatch> FileNames::resolve(std::string_view reference,
                                            std::string_view from) const {
  reference = trimmed(reference);
  if (reference.size() > 1 && reference.front() == '"' && reference.back() == '"') {
    reference = reference.substr(1, reference.size() - 2);
  }
  if (reference.substr(0, 5) == "data:") return std::nullopt;
  const std::string decoded = percent_decoded(reference);
  const std::string folder = folder_of(from);
  // A bundle's names are UTF-8: one that was not has letters of CP437 for its bytes.
  const auto letters = [&](std::string_view path) {
    return is_utf8_ && !is_utf8(path) ? utf8_from(kCp437, path).value_or("") : std::string(path);
  };
  for (const std::string_view path : {reference, std::string_view(decoded)}) {
    if (const auto found = find_path(as_written_, letters(path), folder)) {
      return NameMatch{*found, is_utf8(path) ? "" : "the same bytes, which are not UTF-8"};
    }
  }
  for (const std::string_view path : {reference, std::string_view(decoded)}) {
    if (const auto found = find_last_parts(as_written_, letters(path), folder)) {
      return NameMatch{*found, difference(letters(path), as_written_[*found], folder)};
    }
  }
  return resolve_encoded(decoded, from);
}

const std::vector<FileNames::Reading>& FileNames::readings() const {
  if (!readings_.empty()) return readings_;
  for (size_t e = 0; e < (is_utf8_ ? 1 : kTextEncodingCount); ++e) {
    Reading reading{is_utf8_ ? std::nullopt : std::optional(e), {}};
    for (const std::string& name : names_) {
      const auto text = is_utf8(name) ? name : utf8_from(e, name);
      if (!text) break;
      reading.names.push_back(folded(normalized_or_base(*text)));
    }
    if (reading.names.size() == names_.size()) readings_.push_back(std::move(reading));
  }
  return readings_;
}

// Tries all pairs of encodings, because a zip may have names in one of DOS and a mesh in one of
// Windows.
std::optional<NameMatch> FileNames::resolve_encoded(std::string_view reference,
                                                    std::string_view from) const {
  const bool is_readable = is_utf8(reference);
  const bool is_ascii = std::ranges::all_of(reference, [](char c) { return (c & 0x80) == 0; });
  if (is_ascii) return std::nullopt;
  const std::pair<std::string, std::string> key(reference, from);
  if (const auto known = encoded_.find(key); known != encoded_.end()) return known->second;
  if (encoded_.size() == kEncodedReferencesMax) return std::nullopt;
  std::optional<NameMatch>& result = encoded_[key];
  std::optional<NameMatch> match;
  for (const Reading& reading : readings()) {
    const auto mesh =
        reading.encoding && !is_utf8(from) ? utf8_from(*reading.encoding, from) : std::string(from);
    const std::string start = folded(folder_of(mesh.value_or("")));
    for (size_t e = 0; e < (is_readable ? 1 : kTextEncodingCount); ++e) {
      auto path = is_readable ? std::string(reference) : utf8_from(e, reference);
      if (path) path = folded(*path);
      const auto found = path ? find_folded(reading.names, *path, start) : std::nullopt;
      if (!found) continue;
      if (match && match->index != *found) return std::nullopt;
      if (match) continue;
      std::string guess = difference(*path, reading.names[*found], start);
      if (!is_readable || reading.encoding) {
        guess += guess.empty() ? "read as " : ", read as ";
        if (!is_readable) guess += kTextEncodings[e];
        if (!is_readable && reading.encoding) guess += " and ";
        if (reading.encoding) guess += kTextEncodings[*reading.encoding];
      } else if (guess.empty()) {
        guess = "the same name in another case or Unicode form";
      }
      match = NameMatch{*found, std::move(guess)};
    }
  }
  return result = std::move(match);
}

}  // namespace voxeld
