#include "client/cli/terminal/human.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <string_view>

namespace voxeld::cli {
namespace {

constexpr std::int64_t kMinute = 60, kHour = 60 * kMinute, kDay = 24 * kHour;

std::string formatted(const char* format, double value) {
  std::array<char, 48> text{};
  std::snprintf(text.data(), text.size(), format, value);
  return text.data();
}

// Columns of a terminal: bytes of UTF-8 that continue a character take none.
size_t width_of(const std::string& text) {
  return static_cast<size_t>(std::ranges::count_if(
      text, [](char c) { return (static_cast<unsigned char>(c) & 0xc0u) != 0x80u; }));
}

}  // namespace

std::string count_text(std::int64_t count) {
  const std::string digits = std::to_string(count);
  std::string text;
  for (size_t i = 0; i < digits.size(); ++i) {
    const size_t left = digits.size() - i;
    if (left % 3 == 0 && !text.empty() && text != "-") text.push_back(',');
    text.push_back(digits[i]);
  }
  return text;
}

std::string bytes_text(std::int64_t bytes) {
  if (bytes < 1000) return std::to_string(bytes).append(" B");
  double value = static_cast<double>(bytes);
  const char* unit = "";
  for (const char* one : {" kB", " MB", " GB", " TB"}) {
    value /= 1000.0;
    unit = one;
    if (value < 999.5) break;
  }
  return formatted(value < 9.95 ? "%.1f" : "%.0f", value).append(unit);
}

std::string seconds_text(double seconds) {
  if (seconds < 1.0) return formatted("%.3f s", seconds);
  if (seconds < 9.995) return formatted("%.2f s", seconds);
  if (seconds < 59.95) return formatted("%.1f s", seconds);
  const auto whole = std::int64_t{std::llround(seconds)};
  const auto pair = [](std::int64_t large, std::string_view unit, std::int64_t small,
                       std::string_view small_unit) {
    std::string text = std::to_string(large);
    return text.append(unit).append(std::to_string(small)).append(small_unit);
  };
  if (whole < kHour) return pair(whole / kMinute, " min ", whole % kMinute, " s");
  return pair(whole / kHour, " h ", whole % kHour / kMinute, " min");
}

std::int64_t unix_now_ms() {
  const auto since = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::milliseconds>(since).count();
}

std::string age_text(std::int64_t since_ms, std::int64_t now_ms) {
  const std::int64_t seconds = std::max<std::int64_t>(0, (now_ms - since_ms) / 1000);
  const auto text = [](std::int64_t count, std::string_view unit) {
    return std::to_string(count).append(unit);
  };
  if (seconds < kMinute) return text(seconds, " s");
  if (seconds < kHour) return text(seconds / kMinute, " min");
  if (seconds < kDay) return text(seconds / kHour, " h");
  return text(seconds / kDay, " d");
}

std::string printable(std::string_view text) {
  const auto byte = [&](size_t i) {
    return i < text.size() ? static_cast<unsigned char>(text[i]) : 0u;
  };
  std::string safe;
  for (size_t i = 0; i < text.size(); ++i) {
    const bool is_c1 = byte(i) == 0xc2 && byte(i + 1) >= 0x80 && byte(i + 1) < 0xa0;  // in UTF-8
    safe += is_c1 || byte(i) < 0x20 || byte(i) == 0x7f ? '?' : text[i];
    if (is_c1) ++i;
  }
  return safe;
}

void Table::add(std::vector<std::string> cells) {
  for (std::string& cell : cells) cell = printable(cell);
  rows_.push_back(std::move(cells));
}

std::string Table::text() const {
  std::vector<size_t> widths(alignment_.size());
  for (const auto& row : rows_) {
    for (size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], width_of(row[i]));
  }
  std::string text;
  for (const auto& row : rows_) {
    std::string line;
    for (size_t i = 0; i < row.size(); ++i) {
      const std::string space(widths[i] - width_of(row[i]), ' ');
      line.append(i == 0 ? "" : "  ");
      line.append(alignment_[i] == 'r' ? space : row[i])
          .append(alignment_[i] == 'r' ? row[i] : space);
    }
    line.erase(line.find_last_not_of(' ') + 1);
    text += line + "\n";
  }
  return text;
}

}  // namespace voxeld::cli
