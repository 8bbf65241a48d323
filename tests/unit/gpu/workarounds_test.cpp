// The list of driver workarounds and its switch.
#include "server/device/workarounds.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <set>

#include "server/gpu/environment.h"

namespace voxeld::gpu {
namespace {

TEST(Workarounds, are_listed_in_the_order_of_the_enum_with_distinct_names) {
  std::set<std::string_view> names;
  int index = 0;
  ASSERT_FALSE(all_workarounds().empty());
  for (const WorkaroundInfo& info : all_workarounds()) {
    EXPECT_EQ(static_cast<int>(info.workaround), index++);
    EXPECT_TRUE(names.insert(info.name).second) << info.name;
    EXPECT_FALSE(info.summary.empty());
  }
}

TEST(Workarounds, are_on_until_the_list_turns_them_off_by_their_whole_name) {
  const auto loop = Workaround::kLoopIterations65535;
  EXPECT_TRUE(workaround_enabled(loop, ""));
  EXPECT_TRUE(workaround_enabled(loop, "loop_iterations_65535"));
  EXPECT_TRUE(workaround_enabled(loop, "-loop_iterations"));
  EXPECT_TRUE(workaround_enabled(loop, "-timer_query_zero"));
  EXPECT_FALSE(workaround_enabled(loop, "-loop_iterations_65535"));
  EXPECT_FALSE(workaround_enabled(loop, "-timer_query_zero,-loop_iterations_65535,"));
}

TEST(ScopedEnvironment, restores_the_previous_values) {
  ::setenv("VOXELD_TEST_A", "before", 1);
  ::unsetenv("VOXELD_TEST_B");
  {
    ScopedEnvironment environment;
    environment.set("VOXELD_TEST_A", "during");
    environment.set("VOXELD_TEST_B", "during");
    environment.unset("VOXELD_TEST_A");
    EXPECT_EQ(std::getenv("VOXELD_TEST_A"), nullptr);
    EXPECT_STREQ(std::getenv("VOXELD_TEST_B"), "during");
  }
  EXPECT_STREQ(std::getenv("VOXELD_TEST_A"), "before");
  EXPECT_EQ(std::getenv("VOXELD_TEST_B"), nullptr);
  ::unsetenv("VOXELD_TEST_A");
}

TEST(MesaSoftwareEnvironment, drops_a_vector_width_of_512_alone) {
  for (const char* width : {"512", "256"}) {
    ::setenv("LP_NATIVE_VECTOR_WIDTH", width, 1);
    ScopedEnvironment environment;
    set_mesa_software_environment(environment);
    EXPECT_EQ(std::getenv("LP_NATIVE_VECTOR_WIDTH") != nullptr, std::string_view(width) == "256");
  }
  ::unsetenv("LP_NATIVE_VECTOR_WIDTH");
}

}  // namespace
}  // namespace voxeld::gpu
