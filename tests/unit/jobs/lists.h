// Lists of the job service and its stores as vectors.
#pragma once

#include <gtest/gtest.h>

#include <optional>
#include <type_traits>
#include <vector>

#include "server/jobs/records/asset_store.h"
#include "server/jobs/records/job_store.h"
#include "server/jobs/service/job_service.h"

namespace voxeld::testing {

// At most `limit` jobs, newest first. Lister: JobService, JobStore.
template <typename Lister>
auto jobs_of(Lister& lister, const Caller& caller, int limit,
             std::optional<JobState> state = std::nullopt) {
  constexpr bool kIsService = std::is_base_of_v<JobService, Lister>;
  using Row = std::conditional_t<kIsService, ListedJob, JobRecord>;
  std::vector<std::conditional_t<kIsService, JobStatus, JobRecord>> jobs;
  JobQuery query;
  query.state = state;
  const Status listed = lister.list(caller, query, [&](const Row& job) {
    if constexpr (kIsService) {
      jobs.push_back(job.status);
    } else {
      jobs.push_back(job);
    }
    return static_cast<int>(jobs.size()) < limit;
  });
  EXPECT_TRUE(listed) << listed.error().message();
  return jobs;
}

// Lister: JobService.
inline std::vector<Asset> assets_of(JobService& lister, const Caller& caller) {
  std::vector<Asset> assets;
  const Status listed = lister.list_assets(caller, {}, [&](const Asset& asset) {
    assets.push_back(asset);
    return true;
  });
  EXPECT_TRUE(listed) << listed.error().message();
  return assets;
}

}  // namespace voxeld::testing
