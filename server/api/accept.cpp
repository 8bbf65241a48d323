#include "server/api/accept.h"

#include <algorithm>
#include <cctype>
#include <string>
#include <utility>
#include <vector>

#include "proto/text/number_text.h"

namespace voxeld::api {
namespace {

// A media range of the header, in lower case, and its weight.
struct Range {
  std::string type;  // "a/b", "a/*" or "*/*"
  double weight = 1;
};

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlanks = " \t";
  const size_t start = text.find_first_not_of(kBlanks);
  if (start == std::string_view::npos) return {};
  return text.substr(start, text.find_last_not_of(kBlanks) - start + 1);
}

std::string lower(std::string_view text) {
  std::string out(text);
  std::ranges::transform(out, out.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return out;
}

// Takes the text up to `separator` from the beginning of `rest`, and the separator.
std::string_view take_part(std::string_view& rest, char separator) {
  const size_t end = rest.find(separator);
  const std::string_view part = trimmed(rest.substr(0, end));
  rest = end == std::string_view::npos ? std::string_view() : rest.substr(end + 1);
  return part;
}

// nullopt for a range whose weight is no number from 0 to 1.
std::optional<Range> parse_range(std::string_view text) {
  Range range{lower(take_part(text, ';'))};
  while (!text.empty()) {
    const std::string parameter = lower(take_part(text, ';'));
    if (!parameter.starts_with("q=")) continue;
    const auto weight = parse_number<double>(std::string_view(parameter).substr(2), 0, 1);
    if (!weight) return std::nullopt;
    range.weight = *weight;
  }
  return range;
}

// 3: the type itself, 2: its family, 1: any; 0: the range does not match.
int specificity(const Range& range, std::string_view type) {
  if (range.type == type) return 3;
  if (range.type == std::string(type.substr(0, type.find('/'))) + "/*") return 2;
  return range.type == "*/*" ? 1 : 0;
}

double weight_of(std::string_view type, const std::vector<Range>& ranges) {
  int best = 0;
  double weight = 0;
  for (const Range& range : ranges) {
    const int now = specificity(range, type);
    if (now == 0 || now < best) continue;
    weight = now > best ? range.weight : std::max(weight, range.weight);
    best = now;
  }
  return weight;
}

}  // namespace

std::optional<size_t> preferred_type(std::string_view accept,
                                     std::span<const std::string_view> offered) {
  if (offered.empty()) return std::nullopt;
  if (trimmed(accept).empty()) return 0;
  std::vector<Range> ranges;
  while (!accept.empty()) {
    const std::string_view text = take_part(accept, ',');
    if (text.empty()) continue;
    if (auto range = parse_range(text)) ranges.push_back(*std::move(range));
  }
  std::optional<size_t> best;
  double best_weight = 0;
  for (size_t i = 0; i < offered.size(); ++i) {
    const double weight = weight_of(offered[i], ranges);
    if (weight <= best_weight) continue;
    best = i;
    best_weight = weight;
  }
  return best;
}

bool accepts_gzip(std::string_view accept_encoding) {
  double any = 0;
  while (!accept_encoding.empty()) {
    const auto range = parse_range(take_part(accept_encoding, ','));
    if (!range) continue;
    if (range->type == "gzip" || range->type == "x-gzip") return range->weight > 0;
    if (range->type == "*") any = range->weight;
  }
  return any > 0;
}

}  // namespace voxeld::api
