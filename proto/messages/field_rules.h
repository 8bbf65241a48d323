// Rules of the values in field lists (json_fields.h). A rule returns an error without a name.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "proto/blob_id.h"
#include "proto/messages/json_fields.h"
#include "proto/options/values.h"

namespace voxeld {

// A number from `min` to `max`.
constexpr auto within(int64_t min, int64_t max) {
  return [=](int64_t value) -> Status {
    if (value >= min && value <= max) return {};
    return unfit(std::to_string(min) + " to " + std::to_string(max), std::to_string(value));
  };
}

constexpr auto text_up_to(size_t bytes_max) {
  return [=](std::string_view text) -> Status {
    if (text.size() <= bytes_max) return {};
    return unfit("at most " + std::to_string(bytes_max) + " bytes", std::to_string(text.size()));
  };
}

// A text that appears in headers, labels and log lines.
constexpr auto plain_text_up_to(size_t bytes_max) {
  return [=](std::string_view text) -> Status {
    VOXELD_TRY(text_up_to(bytes_max)(text));
    const bool is_plain = std::ranges::none_of(
        text, [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; });
    if (is_plain) return {};
    return unfit("text without control characters", text);
  };
}

// One of `words`, which must outlive the rule; `expected` names them.
constexpr auto one_of(std::span<const std::string_view> words, std::string_view expected) {
  return [=](std::string_view text) -> Status {
    if (std::ranges::find(words, text) != words.end()) return {};
    return unfit(std::string(expected), text);
  };
}

// The id of a blob: "sha256-" and 64 hex digits. `expected` says of what.
constexpr auto blob_id(std::string_view expected) {
  return [=](std::string_view text) -> Status {
    if (is_blob_id(text)) return {};
    return unfit(std::string(expected), text);
  };
}

constexpr auto seconds_from_0() {
  return [](double seconds) -> Status {
    if (std::isfinite(seconds) && seconds >= 0) return {};
    return unfit("seconds from 0 on", option_values::to_text(seconds));
  };
}

// A list of at most this many.
constexpr auto count_up_to(size_t count_max) {
  return [=](const auto& list) -> Status {
    if (list.size() <= count_max) return {};
    return unfit("at most " + std::to_string(count_max), std::to_string(list.size()));
  };
}

// A list of 1 to `max` `things`.
constexpr auto count_from_1(size_t count_max, std::string_view things) {
  return [=](const auto& list) -> Status {
    if (!list.empty() && list.size() <= count_max) return {};
    return unfit("1 to " + std::to_string(count_max) + " " + std::string(things),
                 std::to_string(list.size()));
  };
}

}  // namespace voxeld
