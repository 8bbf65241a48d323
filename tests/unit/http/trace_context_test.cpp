#include "server/http/message/trace_context.h"

#include <gtest/gtest.h>

namespace voxeld {
namespace {

constexpr const char* kGoodTraceparent = "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01";

TEST(TraceContext, a_traceparent_comes_back) {
  const auto trace = parse_traceparent(kGoodTraceparent);
  ASSERT_TRUE(trace);
  EXPECT_EQ(trace->trace_id, "4bf92f3577b34da6a3ce929d0e0e4736");
  EXPECT_EQ(trace->span_id, "00f067aa0ba902b7");
  EXPECT_EQ(trace->flags, 1);
  EXPECT_EQ(traceparent_text(*trace), kGoodTraceparent);
}

TEST(TraceContext, an_invalid_traceparent_starts_a_new_trace) {
  const std::string id = "4bf92f3577b34da6a3ce929d0e0e4736", span = "00f067aa0ba902b7";
  for (const std::string& text :
       {std::string(), std::string("00"), "00-" + id + "-" + span, "00-" + id + "-" + span + "-1",
        "00-" + id + "-" + span + "-01-", "00-" + id + "-" + span + "-01x",
        "ff-" + id + "-" + span + "-01", "0x-" + id + "-" + span + "-01",
        "00-" + id + "-" + span + "-0g", "00_" + id + "-" + span + "-01",
        "00-" + id + "_" + span + "-01", "00-" + id + "-" + span + "_01",
        "00-" + std::string(32, '0') + "-" + span + "-01",
        "00-" + id + "-" + std::string(16, '0') + "-01",
        "00-4BF92F3577B34DA6A3CE929D0E0E4736-" + span + "-01", " 00-" + id + "-" + span + "-01",
        "01-" + id + "-" + span + "-01.more"}) {
    EXPECT_FALSE(parse_traceparent(text)) << text;
  }
}

TEST(TraceContext, a_later_version_may_say_more) {
  const auto trace = parse_traceparent("01-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-ff-x");
  ASSERT_TRUE(trace);
  EXPECT_EQ(traceparent_text(*trace), kGoodTraceparent);
}

TEST(TraceContext, a_child_has_the_trace_and_a_span_of_its_own) {
  const TraceContext parent = new_trace(), child = child_span(parent);
  EXPECT_TRUE(parse_traceparent(traceparent_text(parent)));
  EXPECT_EQ(child.trace_id, parent.trace_id);
  EXPECT_NE(child.span_id, parent.span_id);
  EXPECT_NE(new_trace().trace_id, parent.trace_id);
}

}  // namespace
}  // namespace voxeld
