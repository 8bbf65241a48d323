#include "proto/messages/json_fields.h"

#include "proto/messages/job_fields.h"
#include "proto/text/client_texts.h"

namespace voxeld {

Status read_value(const nlohmann::json& json, std::string& value) {
  if (!json.is_string()) return unfit("a text", json.type_name());
  value = json.get_ref<const std::string&>();
  return {};
}

Status read_value(const nlohmann::json& json, int64_t& value) {
  if (!json.is_number_integer()) return unfit("an integer", json.type_name());
  // nlohmann's parser makes an unsigned number above the range of int64_t, and get() would wrap.
  if (json.is_number_unsigned() && !std::in_range<int64_t>(json.get<uint64_t>())) {
    return unfit("an integer of 64 bits", json.dump());
  }
  value = json.get<int64_t>();
  return {};
}

Status read_value(const nlohmann::json& json, uint64_t& value) {
  int64_t number = 0;
  VOXELD_TRY(read_value(json, number));
  if (number < 0) return unfit("0 or more", std::to_string(number));
  value = static_cast<uint64_t>(number);
  return {};
}

Status read_value(const nlohmann::json& json, int& value) {
  int64_t wide = 0;
  VOXELD_TRY(read_value(json, wide));
  if (!std::in_range<int>(wide)) return unfit("an integer of 32 bits", std::to_string(wide));
  value = static_cast<int>(wide);
  return {};
}

Status read_value(const nlohmann::json& json, double& value) {
  if (!json.is_number()) return unfit("a number", json.type_name());
  value = json.get<double>();
  return {};
}

Status read_value(const nlohmann::json& json, bool& value) {
  if (!json.is_boolean()) return unfit("true or false", json.type_name());
  value = json.get<bool>();
  return {};
}

Status read_value(const nlohmann::json& json, std::vector<std::string>& value) {
  const bool are_texts = json.is_array() && std::ranges::all_of(json, [](const nlohmann::json& v) {
                           return v.is_string();
                         });
  if (!are_texts) return unfit("a list of texts", json.type_name());
  value = json.get<std::vector<std::string>>();
  return {};
}

Status read_value(const nlohmann::json& json, StageTimes& value) {
  if (!json.is_array()) return unfit("a list", json.type_name());
  value.clear();
  for (const nlohmann::json& entry : json) {
    if (!entry.is_array() || entry.size() != 2 || !entry[0].is_string() || !entry[1].is_number()) {
      return unfit("pairs of stage and milliseconds", "");
    }
    value.emplace_back(entry[0].get<std::string>(), entry[1].get<double>());
  }
  return {};
}

Status read_value(const nlohmann::json& json, Error& value) {
  value = {};
  if (const Status status = read_fields(json, value); !status) {
    value = {ErrorCode::kInternal, "not a problem document: " + status.error().message(), "", ""};
  }
  return {};
}

void FieldReader::type(std::string_view type) {
  name_ = "message";
  if (error_) return;
  const auto it = object_.find("type");
  std::string got;
  if (it != object_.end()) {
    if (Status status = read_value(*it, got); !status) {
      return fail("type", std::move(status).error());
    }
  }
  if (got != type) return fail("type", unfit(std::string(type), got));
  name_ = type;
}

Status FieldReader::finish() {
  if ((!error_ || is_missing_) && unlisted_ == Unlisted::kRefuse) {
    for (const auto& [name, value] : object_.items()) {
      if (std::ranges::find(names_, name) != names_.end()) continue;
      std::string listed;
      for (const std::string_view one : names_) {
        listed += (listed.empty() ? "" : ", ") + std::string(one);
      }
      error_ = unfit(listed, echoed(name));
      error_->detail = ": no such member";
      break;
    }
  }
  if (!error_) return {};
  return within_member(name_, *std::move(error_));
}

}  // namespace voxeld
