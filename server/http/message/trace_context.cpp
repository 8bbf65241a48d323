#include "server/http/message/trace_context.h"

#include <algorithm>
#include <array>

#include "proto/text/hex.h"
#include "server/base/check.h"
#include "server/base/random.h"

namespace voxeld {
namespace {

// Layout: version-trace id-span id-flags.
constexpr size_t kTextBytes = 55, kTraceAt = 3, kTraceBytes = 32, kSpanAt = 36, kSpanBytes = 16,
                 kFlagsAt = 53;

bool is_zero(std::string_view text) {
  return text.find_first_not_of('0') == std::string_view::npos;
}

int digit(char c) {
  return c <= '9' ? c - '0' : c - 'a' + 10;
}

// An id that is not all zeros, which the specification forbids.
std::string random_id(size_t digits) {
  std::string id;
  do {
    id = id_hex(digits);
  } while (is_zero(id));
  return id;
}

}  // namespace

std::optional<TraceContext> parse_traceparent(std::string_view text) {
  if (text.size() < kTextBytes) return std::nullopt;
  const std::string_view version = text.substr(0, 2);
  if (!is_hex(version) || version == "ff") return std::nullopt;
  // Future versions may append fields.
  const bool has_more = text.size() > kTextBytes;
  if (has_more && (version == "00" || text[kTextBytes] != '-')) return std::nullopt;
  TraceContext trace{std::string(text.substr(kTraceAt, kTraceBytes)),
                     std::string(text.substr(kSpanAt, kSpanBytes)), 0};
  const std::string_view flags = text.substr(kFlagsAt, 2);
  if (text[kTraceAt - 1] != '-' || text[kSpanAt - 1] != '-' || text[kFlagsAt - 1] != '-' ||
      !is_hex(trace.trace_id) || !is_hex(trace.span_id) || !is_hex(flags) ||
      is_zero(trace.trace_id) || is_zero(trace.span_id)) {
    return std::nullopt;
  }
  trace.flags = static_cast<uint8_t>((digit(flags[0]) << 4) | digit(flags[1]));
  return trace;
}

TraceContext new_trace() {
  return {random_id(kTraceBytes), random_id(kSpanBytes), 0};
}

TraceContext child_span(const TraceContext& parent) {
  // `sampled` is the only known flag.
  return {parent.trace_id, random_id(kSpanBytes), static_cast<uint8_t>(parent.flags & 1)};
}

std::string traceparent_text(const TraceContext& trace) {
  return "00-" + trace.trace_id + "-" + trace.span_id + ((trace.flags & 1) != 0 ? "-01" : "-00");
}

}  // namespace voxeld
