// Content negotiation: which offered type a header Accept prefers.
#include "server/api/accept.h"

#include <gtest/gtest.h>

#include <array>
#include <string>
#include <string_view>
#include <utility>

namespace voxeld::api {
namespace {

constexpr std::array<std::string_view, 3> kOffered = {"application/vnd.voxeld.grid",
                                                      "application/x-npy", "text/x-xyz"};

// The preferred type, or "none".
std::string preferred(std::string_view accept) {
  const auto index = preferred_type(accept, kOffered);
  return index ? std::string(kOffered.at(*index)) : "none";
}

TEST(Accept, the_type_with_the_highest_weight_is_preferred) {
  for (const auto& [accept, expected] :
       {std::pair{"application/x-npy", "application/x-npy"},
        {"APPLICATION/X-NPY", "application/x-npy"},
        {"text/html, application/x-npy", "application/x-npy"},
        {"application/x-npy;q=0.5, text/x-xyz;q=0.6", "text/x-xyz"},
        {"application/x-npy ; q=0.6 , text/x-xyz;level=1; Q=0.5", "application/x-npy"},
        {"text/*", "text/x-xyz"},
        {"*/*;q=0.1, application/x-npy", "application/x-npy"}}) {
    EXPECT_EQ(preferred(accept), expected) << accept;
  }
}

TEST(Accept, the_first_offer_is_preferred_among_equals) {
  for (const char* accept : {"", " ", "*/*", "application/*", "text/html, */*;q=0.8",
                             "application/x-npy, application/vnd.voxeld.grid"}) {
    EXPECT_EQ(preferred(accept), kOffered[0]) << accept;
  }
}

TEST(Accept, a_more_specific_range_decides_the_weight_of_its_types) {
  EXPECT_EQ(preferred("application/*;q=0.9, application/vnd.voxeld.grid;q=0.1"),
            "application/x-npy");
  EXPECT_EQ(preferred("*/*, application/*;q=0"), "text/x-xyz");
}

TEST(Accept, none_is_preferred_if_no_range_matches_or_its_weight_is_0) {
  for (const char* accept : {"text/html", "application/x-npy;q=0", "application/x-npy;q=2",
                             "application/x-npy;q=", "application/x-npy;q=nan", "application", "/",
                             "*", ",;,", "*/x-npy", "application/x-np"}) {
    EXPECT_EQ(preferred(accept), "none") << accept;
  }
  EXPECT_FALSE(preferred_type("*/*", {}));
}

}  // namespace
}  // namespace voxeld::api
