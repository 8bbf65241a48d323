// Limits of a tenant of a shared daemon, and how they are written.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "proto/result.h"

namespace voxeld {

inline constexpr int64_t kRequestsPerMinuteMax = 60'000'000;
inline constexpr int64_t kQueuedJobsLimitMax = 1'000'000'000;
inline constexpr int64_t kBytesLimitMax = int64_t{1} << 53;
inline constexpr int64_t kCellsLimitMax = int64_t{1} << 53;

// 0: no limit. They stand with each key; those of a tenant's newest live key count.
struct TenantLimits {
  int64_t requests_per_minute = 0;  // more: too-many-requests
  int64_t queued_jobs = 0;          // that wait at a time; more: too-many-requests
  // Bytes of assets, results, grids and sequences, each counted once per tenant, also if others
  // have the same ones, and of rows: of assets, results, frames and jobs. More: quota-exceeded;
  // payload-too-large for an upload that can never fit.
  int64_t bytes = 0;
  int64_t cells = 0;  // of one job, all frames; more: grid-too-large
  bool operator==(const TenantLimits&) const = default;
};

struct TenantUsage {
  int64_t queued_jobs = 0, running_jobs = 0;
  int64_t bytes = 0;         // as TenantLimits::bytes
  int64_t record_bytes = 0;  // of rows that the sweep may remove: of jobs, and of deleted assets
};

// "10", "10/s" or "30/m" -> requests per minute; "0": none. Errors: invalid-option.
Result<int64_t> parse_rate(std::string_view text);
// The shortest of these forms; "-" for none.
std::string rate_text(int64_t requests_per_minute);

}  // namespace voxeld
