// Finds the file that a mesh refers to, among those of a bundle or a folder. Mesh files name their
// textures with backslashes, absolute paths of the author's disk, another case, as URIs, or in the
// encoding of the author's system. Without this, meshes would lose their colours.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace voxeld {

// The name with slashes for backslashes, without "." parts and doubled slashes, ".." resolved.
// nullopt for a name that is empty, absolute ("/a", "C:/a"), or leaves the bundle.
std::optional<std::string> normalized_name(std::string_view name);
// The part of a path after the last slash or backslash.
std::string_view base_name(std::string_view name);
// Decodes %41 to A. Sequences that are not two hex digits stay as they are.
std::string percent_decoded(std::string_view text);

struct NameMatch {
  size_t index = 0;
  // Why the name is taken although it is not the reference; empty if it is. Such as "the same name
  // in another case".
  std::string guess;
};

// Names of files, in any encoding. Not thread-safe: readings of legacy names are made at first use.
class FileNames {
 public:
  FileNames() = default;
  explicit FileNames(std::vector<std::string> names);

  // The file that `reference` means in the file `from`. The order is: the path from the folder of
  // `from`, or from the top, as written or percent-decoded; then the last parts of the path, as
  // many as fit, in the folder of `from`, below it, or anywhere, without regard to case where
  // exactly one fits; last the same with another Unicode form of letters (NFC, NFD) or case beyond
  // ASCII, and in a legacy encoding of the names, the reference or both, if all encodings that fit
  // give the same file. nullopt if none matches, and for data: URIs.
  std::optional<NameMatch> resolve(std::string_view reference, std::string_view from) const;

 private:
  // The normalized names as one encoding reads them; none: as UTF-8.
  struct Reading {
    std::optional<size_t> encoding;
    std::vector<std::string> names;
  };
  const std::vector<Reading>& readings() const;
  std::optional<NameMatch> resolve_encoded(std::string_view reference, std::string_view from) const;

  std::vector<std::string> names_;         // as given
  std::vector<std::string> as_written_;    // normalized
  bool is_utf8_ = true;                    // all names
  mutable std::vector<Reading> readings_;  // folded, in the encodings that read all names
  // What resolve_encoded() found.
  mutable std::map<std::pair<std::string, std::string>, std::optional<NameMatch>> encoded_;
};

}  // namespace voxeld
