#include "server/api/access/wait_limit.h"

#include <gtest/gtest.h>

#include <memory>
#include <vector>

namespace voxeld::api {
namespace {

using Places = std::vector<std::unique_ptr<WaitLimit::Place>>;

// Takes places until there is none for the tenant, and returns their number.
int take_all(WaitLimit& limit, const std::string& tenant, Places& places) {
  int taken = 0;
  while (true) {
    auto place = limit.take(tenant);
    if (!place) {
      EXPECT_EQ(place.error().code, ErrorCode::kTooManyRequests);
      return taken;
    }
    places.push_back(*std::move(place));
    ++taken;
  }
}

TEST(WaitLimit, one_tenant_takes_half_and_others_find_places) {
  WaitLimit limit(1000);
  Places places;
  EXPECT_EQ(take_all(limit, "lab", places), 500);
  EXPECT_EQ(take_all(limit, "studio", places), 250);
  EXPECT_EQ(take_all(limit, "school", places), 125);
}

TEST(WaitLimit, a_place_is_free_again_when_it_is_destroyed) {
  WaitLimit limit(2);
  Places places;
  EXPECT_EQ(take_all(limit, "lab", places), 1);
  const auto refused = limit.take("lab");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().message(),
            "too many requests of this tenant wait at a time: expected fewer than 2, got another");
  places.clear();
  EXPECT_TRUE(limit.take("lab"));
}

}  // namespace
}  // namespace voxeld::api
