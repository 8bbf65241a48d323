#include "server/descriptors.h"

#include <sys/resource.h>

#include <algorithm>
#include <limits>
#include <string>

#include "server/base/log.h"

namespace voxeld {
namespace {

constexpr int kConnectionsPerThread = 2;  // where threads have to be fewer, too
constexpr int64_t kAdminPart = 16;

int64_t needed(const DescriptorPlan& plan, int workers) {
  return kDescriptorsOfProcess + int64_t{kDescriptorsOfWorker} * workers + plan.admin_connections +
         int64_t{kDescriptorsOfThread} * plan.request_threads +
         int64_t{kDescriptorsOfConnection} * plan.connections;
}

int most_of_one_address(const DescriptorPlan& wanted, int connections) {
  return std::min(wanted.connections_per_address, std::max(1, connections / 2));
}

}  // namespace

Result<DescriptorPlan> fit_descriptors(const DescriptorPlan& wanted, int workers) {
  DescriptorPlan plan = wanted;
  plan.admin_connections =
      static_cast<int>(std::min<int64_t>(wanted.admin_connections, wanted.limit / kAdminPart));
  DescriptorPlan least = plan;
  least.request_threads = std::min(wanted.request_threads, kRequestThreadsMin);
  least.connections = std::min(wanted.connections, kConnectionsMin);
  if (needed(least, workers) > wanted.limit) {
    return Error{ErrorCode::kInvalidOption, "limit on open files (ulimit -n)",
                 "at least " + std::to_string(needed(least, workers)) + " for " +
                     std::to_string(workers) + " workers",
                 std::to_string(wanted.limit)};
  }
  DescriptorPlan none = plan;
  none.request_threads = none.connections = 0;
  const int64_t left = wanted.limit - needed(none, workers);
  constexpr int kWithConnections =
      kDescriptorsOfThread + kConnectionsPerThread * kDescriptorsOfConnection;
  const auto threads = std::max<int64_t>(left / kWithConnections, least.request_threads);
  plan.request_threads = static_cast<int>(std::min<int64_t>(wanted.request_threads, threads));
  const int64_t connections =
      (left - int64_t{kDescriptorsOfThread} * plan.request_threads) / kDescriptorsOfConnection;
  plan.connections = static_cast<int>(std::min<int64_t>(wanted.connections, connections));
  if (wanted.connections_per_address > 0) {
    plan.connections_per_address = most_of_one_address(wanted, plan.connections);
  }
  return plan;
}

Result<DescriptorPlan> share_out_descriptors(DescriptorPlan wanted, int workers) {
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) != 0) {
    return Error{ErrorCode::kInternal, "cannot read the limit on open files", "", ""};
  }
  // Half of few connections is no matter of the limit on open files.
  if (wanted.connections_per_address > 0) {
    wanted.connections_per_address = most_of_one_address(wanted, wanted.connections);
  }
  const auto most = static_cast<rlim_t>(needed(wanted, workers));
  if (limit.rlim_cur < most) {
    const rlim_t before = limit.rlim_cur;
    limit.rlim_cur = std::min(limit.rlim_max, most);
    if (::setrlimit(RLIMIT_NOFILE, &limit) != 0) limit.rlim_cur = before;
  }
  wanted.limit = static_cast<int64_t>(
      std::min<rlim_t>(limit.rlim_cur, rlim_t{std::numeric_limits<int32_t>::max()}));
  VOXELD_ASSIGN(const DescriptorPlan plan, fit_descriptors(wanted, workers));
  const bool fits = plan == wanted;
  log::write(fits ? log::Level::kInfo : log::Level::kWarn,
             fits ? "descriptors shared out"
                  : "the limit on open files is too low for all connections that are wanted",
             {{"limit", plan.limit},
              {"connections", plan.connections},
              {"per_address", plan.connections_per_address},
              {"request_threads", plan.request_threads},
              {"wanted", static_cast<int64_t>(most)}});
  return plan;
}

}  // namespace voxeld
