// W3C Trace Context: links work to the request that caused it, across services.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace voxeld {

struct TraceContext {
  std::string trace_id;  // 32 hex digits, not all 0
  std::string span_id;   // 16 hex digits, not all 0
  uint8_t flags = 0;     // 1: sampled
};

// Parses the header traceparent, as strictly as its specification demands. nullopt: the caller
// starts a new trace.
std::optional<TraceContext> parse_traceparent(std::string_view text);
// A new trace with random ids, not sampled.
TraceContext new_trace();
// A new span of the same trace.
TraceContext child_span(const TraceContext& parent);
// A text such as "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01".
std::string traceparent_text(const TraceContext& trace);

}  // namespace voxeld
