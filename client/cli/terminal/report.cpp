#include "client/cli/terminal/report.h"

#include <chrono>
#include <cstdio>

#include "client/cli/terminal/human.h"

namespace voxeld::cli {
namespace {

using Json = nlohmann::json;

constexpr int kJsonIndent = 2;

std::string size_text(const Json& meta) {
  const auto dims = meta.find("dims");
  if (dims == meta.end() || !dims->is_array() || dims->size() != 3) return "";
  std::string text;
  for (const Json& side : *dims) text += (text.empty() ? "" : " x ") + side.dump();
  return text + " cells, ";
}

}  // namespace

Json parsed(const std::string& text) {
  Json value = Json::parse(text, nullptr, false);
  return value.is_discarded() ? Json() : value;
}

void print_json(const Json& value) {
  const std::string text = value.dump(kJsonIndent, ' ', false, Json::error_handler_t::replace);
  std::printf("%s\n", text.c_str());
}

client::Settings settings_of(const Arguments& arguments) {
  client::Settings settings;
  settings.url = arguments.url;
  settings.key = arguments.key;
  settings.timeout = std::chrono::seconds(arguments.timeout_s);
  return settings;
}

void tell_warnings(const Arguments& arguments, const client::JobInfo& job) {
  if (arguments.quiet) return;
  for (const std::string& warning : job.warnings) {
    std::fprintf(stderr, "voxel: warning: %s\n", printable(warning).c_str());
  }
}

std::string result_line(const std::string& output, const client::JobInfo& job, std::int64_t bytes,
                        double seconds) {
  const Json meta = parsed(job.meta_json);
  std::string text = printable(output) + ": ";
  if (meta.is_object() && meta.contains("width") && meta.contains("height")) {
    text += meta["width"].dump() + " x " + meta["height"].dump() + " pixels, ";
  } else if (meta.is_object()) {
    text += size_text(meta);
    if (const Json voxels = meta.value("voxel_count", Json()); voxels.is_number_integer()) {
      text += count_text(voxels.get<std::int64_t>()) + " voxels, ";
    }
  }
  if (job.frames_total > 0) text += count_text(job.frames_total) + " frames, ";
  return text + bytes_text(bytes) + ", " + seconds_text(seconds);
}

}  // namespace voxeld::cli
