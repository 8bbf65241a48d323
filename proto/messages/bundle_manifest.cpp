#include "proto/messages/bundle_manifest.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "proto/asset_id.h"
#include "proto/blob_id.h"
#include "proto/client_texts.h"
#include "proto/limits.h"
#include "proto/messages/job.h"

namespace voxeld {
namespace {

using Json = nlohmann::json;

Error malformed(std::string where, std::string_view expected, std::string_view got) {
  return {ErrorCode::kMalformedBundle, "bundle" + std::move(where), std::string(expected),
          std::string(got.substr(0, 80))};
}

// Whether other files can refer to the name: parts between slashes, none empty, "." or "..".
bool is_plain_path(std::string_view name) {
  if (name.empty()) return false;
  const auto is_refused = [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == '\\'; };
  if (std::ranges::any_of(name, is_refused)) return false;
  if (name.size() > 1 && name[1] == ':') return false;  // a drive
  for (;;) {
    const size_t slash = name.find('/');
    const std::string_view part = name.substr(0, slash);
    if (part.empty() || part == "." || part == "..") return false;
    if (slash == std::string_view::npos) return true;
    name.remove_prefix(slash + 1);
  }
}

// References find files without regard to case, so names must differ in more than case.
std::string lower_case(std::string text) {
  for (char& c : text) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return text;
}

Status check_members(const Json& object, const std::string& where,
                     std::initializer_list<std::string_view> names, std::string_view expected) {
  if (!object.is_object()) return malformed(where, "an object", object.type_name());
  for (const auto& [name, value] : object.items()) {
    if (std::find(names.begin(), names.end(), name) == names.end()) {
      return malformed(where, std::string(expected), "a member \"" + name.substr(0, 40) + "\"");
    }
  }
  return {};
}

Result<std::string> text_member(const Json& object, const std::string& where, const char* name) {
  const auto it = object.find(name);
  if (it == object.end()) return malformed(where + "." + name, "it to be there", "nothing");
  if (!it->is_string()) return malformed(where + "." + name, "a text", it->type_name());
  return it->get<std::string>();
}

Result<BundleFile> parse_file(const Json& entry, const std::string& where) {
  VOXELD_TRY(check_members(entry, where, {"name", "asset"}, "name and asset"));
  BundleFile file;
  VOXELD_ASSIGN(file.name, text_member(entry, where, "name"));
  VOXELD_ASSIGN(file.asset, text_member(entry, where, "asset"));
  VOXELD_TRY(check_length(client_texts::kBundleFileName, "bundle" + where + ".name", file.name));
  if (!is_plain_path(file.name)) {
    return malformed(where + ".name",
                     "a relative path with / and without \\, empty parts, \".\" and \"..\"",
                     "\"" + file.name.substr(0, 60) + "\"");
  }
  const AssetId asset = AssetId::parse(file.asset);
  if (!is_blob_id(asset.blob)) {
    return malformed(where + ".asset", "the id of an uploaded asset",
                     "\"" + file.asset.substr(0, 60) + "\"");
  }
  file.asset = asset.blob;  // the name in the manifest decides how it is read, not the id's reading
  return file;
}

}  // namespace

Result<std::vector<BundleFile>> parse_bundle_manifest(std::string_view json) {
  auto body = parse_json_bounded(json);
  if (!body) {
    Error error = std::move(body).error();
    if (error.code == ErrorCode::kBadRequest) error.code = ErrorCode::kMalformedBundle;
    return error;
  }
  VOXELD_TRY(check_members(*body, "", {"files"}, "files and nothing else"));
  const auto list = body->find("files");
  if (list == body->end()) return malformed(".files", "it to be there", "nothing");
  if (!list->is_array()) return malformed(".files", "a list", list->type_name());
  constexpr auto kMax = static_cast<size_t>(limits::kBundleEntriesMax);
  if (list->empty() || list->size() > kMax) {
    return malformed(".files", "1 to " + std::to_string(kMax) + " files",
                     std::to_string(list->size()));
  }
  std::vector<BundleFile> files;
  std::set<std::string> names;
  for (const Json& entry : *list) {
    const std::string where = ".files[" + std::to_string(files.size()) + "]";
    VOXELD_ASSIGN(BundleFile file, parse_file(entry, where));
    if (!names.insert(lower_case(file.name)).second) {
      return malformed(where + ".name", "distinct names, also without regard to case",
                       "\"" + file.name.substr(0, 60) + "\" again");
    }
    files.push_back(std::move(file));
  }
  return files;
}

}  // namespace voxeld
