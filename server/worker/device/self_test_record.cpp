#include "server/worker/device/self_test_record.h"

#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

#include "server/base/disk/file.h"
#include "server/base/disk/replace_file.h"

namespace voxeld {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

json outcome_json(const SelfTestOutcome& outcome) {
  json faults = json::object();
  for (size_t i = 0; i < kDevicePartCount; ++i) {
    const auto part = static_cast<DevicePart>(i);
    if (!outcome.faults.has(part)) continue;
    faults[std::string(device_part_name(part))] =
        outcome.faults.why(part).substr(0, kFaultBytesMax);
  }
  return {{"device", outcome.device},
          {"key",
           {{"renderer", outcome.key.renderer},
            {"driver", outcome.key.driver},
            {"shaders", outcome.key.shaders},
            {"algorithm_version", outcome.key.algorithm_version}}},
          {"faults", faults}};
}

// Throws json::exception for members that are missing or of another type.
SelfTestOutcome outcome_from(const json& object) {
  SelfTestOutcome outcome;
  outcome.device = object.at("device").get<std::string>();
  const json& key = object.at("key");
  outcome.key = {key.at("renderer").get<std::string>(), key.at("driver").get<std::string>(),
                 key.at("shaders").get<std::string>(), key.at("algorithm_version").get<int>()};
  for (const auto& [name, why] : object.at("faults").items()) {
    const auto part = device_part_from(name);
    // A part that this version does not know was tested by another one, whose key differs.
    if (part && !why.get<std::string>().empty()) outcome.faults.add(*part, why.get<std::string>());
  }
  return outcome;
}

// The first member that differs, as words.
std::string tested_with(const SelfTestKey& was, const SelfTestKey& is) {
  if (was.renderer != is.renderer) return "tested with another renderer: " + was.renderer;
  if (was.driver != is.driver) return "tested with another driver: " + was.driver;
  return "tested with the shaders of another version";
}

}  // namespace

Result<std::vector<SelfTestOutcome>> parse_self_tests(std::string_view text) {
  try {
    const json object = json::parse(text);
    const int version = object.at("version").get<int>();
    if (version != kSelfTestVersion) {
      return Error{ErrorCode::kInternal, "version of the self-tests",
                   std::to_string(kSelfTestVersion), std::to_string(version)};
    }
    std::vector<SelfTestOutcome> outcomes;
    for (const json& one : object.at("devices")) outcomes.push_back(outcome_from(one));
    return outcomes;
  } catch (const json::exception& error) {
    return Error{ErrorCode::kInternal, std::string("self-tests: ") + error.what(), "", ""};
  }
}

std::string self_tests_text(const std::vector<SelfTestOutcome>& outcomes) {
  json list = json::array();
  for (const SelfTestOutcome& outcome : outcomes) list.push_back(outcome_json(outcome));
  const json object = {{"version", kSelfTestVersion}, {"devices", list}};
  return object.dump(2, ' ', false, json::error_handler_t::replace) + "\n";
}

Result<std::vector<SelfTestOutcome>> read_self_tests(const fs::path& data_dir) {
  const fs::path path = data_dir / kSelfTestFileName;
  std::error_code failed;
  if (!fs::exists(path, failed)) return std::vector<SelfTestOutcome>();
  if (const auto bytes = fs::file_size(path, failed); !failed && bytes > kSelfTestBytesMax) {
    return Error{ErrorCode::kInternal, path.string(),
                 "at most " + std::to_string(kSelfTestBytesMax) + " bytes", std::to_string(bytes)};
  }
  VOXELD_ASSIGN(const std::vector<uint8_t> bytes, read_file(path));
  auto outcomes = parse_self_tests({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  if (outcomes) return outcomes;
  Error error = std::move(outcomes).error();
  error.detail = path.string() + ": " + error.detail;
  return error;
}

Status keep_self_test(const fs::path& data_dir, SelfTestOutcome outcome) {
  auto read = read_self_tests(data_dir);
  std::vector<SelfTestOutcome> outcomes = read ? *std::move(read) : std::vector<SelfTestOutcome>();
  std::erase_if(outcomes, [&](const auto& one) { return one.device == outcome.device; });
  outcomes.push_back(std::move(outcome));
  return replace_file(data_dir / kSelfTestFileName, self_tests_text(outcomes));
}

SelfTestLookup find_self_test(const fs::path& data_dir, const std::string& device,
                              const SelfTestKey& key) {
  const auto outcomes = read_self_tests(data_dir);
  if (!outcomes) return {false, {}, outcomes.error().message()};
  for (const SelfTestOutcome& one : *outcomes) {
    if (one.device != device) continue;
    if (one.key == key) return {true, one.faults, ""};
    return {false, {}, tested_with(one.key, key)};
  }
  return {false, {}, "not tested"};
}

}  // namespace voxeld
