#include "proto/messages/bundle_manifest.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "proto/asset_id.h"
#include "proto/blob_id.h"
#include "proto/limits.h"
#include "proto/messages/field_rules.h"
#include "proto/messages/job.h"
#include "proto/messages/json_fields.h"
#include "proto/text/client_texts.h"

namespace voxeld {
namespace {

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

// Errors show a name or an id in quotes.
Error unfit_name(std::string expected, std::string_view name, std::string_view after = "") {
  return unfit(std::move(expected), echoed(name) + std::string(after));
}

Status is_asset(const std::string& asset) {
  if (is_blob_id(AssetId::parse(asset).blob)) return {};
  return unfit_name("the id of an uploaded asset", asset);
}

Status are_files(const std::vector<BundleFile>& files) {
  VOXELD_TRY(count_from_1(size_t{limits::kBundleEntriesMax}, "files")(files));
  std::set<std::string> names;
  for (size_t i = 0; i < files.size(); ++i) {
    if (names.insert(files[i].name).second) continue;
    return within_member(list_index(i) + ".name",
                         unfit_name("distinct names", files[i].name, " again"));
  }
  return {};
}

struct BundleManifest {
  std::vector<BundleFile> files;
};

}  // namespace

Status is_bundle_file_name(const std::string& name) {
  VOXELD_TRY(text_up_to(client_texts::kBundleFileName.bytes_max)(name));
  if (is_plain_path(name)) return {};
  return unfit_name("a relative path with / and without \\, empty parts, \".\" and \"..\"", name);
}

void visit_fields(IsA<BundleFile> auto& file, auto& visit) {
  visit(kRequired, "name", file.name, is_bundle_file_name);
  visit(kRequired, "asset", file.asset, is_asset);
}

namespace {

void visit_fields(IsA<BundleManifest> auto& bundle, auto& visit) {
  visit.name("bundle");
  visit(kRequired, "files", bundle.files, are_files);
}

Status read_bundle(std::string_view json, BundleManifest& bundle) {
  VOXELD_ASSIGN(const nlohmann::json body, parse_json_bounded(json));
  return read_fields(body, bundle, Unlisted::kRefuse);
}

}  // namespace

Result<std::vector<BundleFile>> parse_bundle_manifest(std::string_view json) {
  BundleManifest bundle;
  if (Status status = read_bundle(json, bundle); !status) {
    Error error = std::move(status).error();
    if (error.code == ErrorCode::kBadRequest) error.code = ErrorCode::kMalformedBundle;
    return error;
  }
  // The name in the manifest decides how a file is read, not the reading in the asset's id.
  for (BundleFile& file : bundle.files) file.asset = AssetId::parse(file.asset).blob;
  return std::move(bundle.files);
}

}  // namespace voxeld
