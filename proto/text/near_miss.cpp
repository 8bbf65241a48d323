#include "proto/text/near_miss.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

namespace voxeld {
namespace {

constexpr size_t kNameBytesMax = 40;  // of a client's name that is compared and repeated
constexpr size_t kListedMax = 6;      // more known names are listed in part
constexpr size_t kNearestListed = 3;

std::vector<std::string_view> by_distance(std::string_view name,
                                          std::span<const std::string_view> known) {
  std::vector<std::pair<size_t, std::string_view>> near;
  near.reserve(known.size());
  for (const std::string_view one : known) near.emplace_back(edit_distance(name, one), one);
  std::ranges::stable_sort(near, {}, [](const auto& entry) { return entry.first; });
  std::vector<std::string_view> names;
  names.reserve(near.size());
  for (const auto& [distance, one] : near) names.push_back(one);
  return names;
}

std::string joined(std::span<const std::string_view> names) {
  std::string text;
  for (const std::string_view one : names) text += (text.empty() ? "" : ", ") + std::string(one);
  return text;
}

std::string listed(std::string_view name, std::span<const std::string_view> known) {
  if (known.empty()) return "none";
  if (known.size() <= kListedMax) return joined(known);
  const auto nearest = by_distance(name, known);
  return "one of " + joined(std::span(nearest).first(kNearestListed)) + ", …";
}

}  // namespace

size_t edit_distance(std::string_view a, std::string_view b) {
  // Rows of the table of distances between beginnings: the one before the last, the last, the next.
  std::vector<size_t> older(b.size() + 1), last(b.size() + 1), row(b.size() + 1);
  for (size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (size_t i = 1; i <= a.size(); ++i) {
    std::swap(older, last);
    std::swap(last, row);
    row[0] = i;
    for (size_t j = 1; j <= b.size(); ++j) {
      const size_t replaced = last[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, replaced});
      const bool is_swap = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
      if (is_swap) row[j] = std::min(row[j], older[j - 2] + 1);
    }
  }
  return row[b.size()];
}

std::string_view near_miss(std::string_view name, std::span<const std::string_view> known) {
  const std::string_view start = name.substr(0, kNameBytesMax);
  const auto nearest = by_distance(start, known);
  if (start.size() < 2 || nearest.empty()) return {};
  const size_t edits_max = std::max<size_t>(1, start.size() / 3);
  return edit_distance(start, nearest.front()) <= edits_max ? nearest.front() : std::string_view();
}

Error unknown_name(std::string_view what, std::string_view name,
                   std::span<const std::string_view> known) {
  const std::string_view shown = name.substr(0, kNameBytesMax);
  const std::string detail = "unknown " + std::string(what) + " '" + std::string(shown) + "'";
  const std::string_view near = near_miss(name, known);
  if (near.empty()) return {ErrorCode::kUnknownOption, detail, listed(shown, known), ""};
  return {ErrorCode::kUnknownOption, detail + "; did you mean '" + std::string(near) + "'?", "",
          ""};
}

}  // namespace voxeld
