// docs/voxel.md promises these numbers to scripts.
#include "client/cli/exit_status.h"

#include <gtest/gtest.h>

#include <map>
#include <string>

#include "proto/error_code.h"

namespace voxeld::cli {
namespace {

int status_of(std::string_view code) {
  return exit_status_of(client::Error(std::string(code), 0, "detail"));
}

TEST(ExitStatus, every_code_of_the_api_has_its_number) {
  const std::map<std::string_view, int> numbers = {{"bad-request", 1},
                                                   {"unknown-option", 2},
                                                   {"invalid-option", 2},
                                                   {"unauthorized", 2},
                                                   {"forbidden", 2},
                                                   {"not-found", 2},
                                                   {"method-not-allowed", 1},
                                                   {"not-acceptable", 1},
                                                   {"conflict", 1},
                                                   {"gone", 2},
                                                   {"length-required", 1},
                                                   {"payload-too-large", 4},
                                                   {"unsupported-media-type", 3},
                                                   {"range-not-satisfiable", 1},
                                                   {"malformed-mesh", 3},
                                                   {"empty-mesh", 3},
                                                   {"unsupported-feature", 3},
                                                   {"malformed-image", 3},
                                                   {"malformed-bundle", 3},
                                                   {"idempotency-mismatch", 1},
                                                   {"grid-too-large", 4},
                                                   {"too-many-requests", 5},
                                                   {"cancelled", 6},
                                                   {"internal", 1},
                                                   {"worker-crashed", 6},
                                                   {"device-unavailable", 5},
                                                   {"shutting-down", 5},
                                                   {"queue-full", 5},
                                                   {"deadline-exceeded", 6},
                                                   {"quota-exceeded", 4},
                                                   {"storage-full", 4}};
  EXPECT_EQ(numbers.size(), all_error_codes().size());
  for (const ErrorCodeInfo& info : all_error_codes()) {
    ASSERT_TRUE(numbers.contains(info.name)) << "a new code: decide its exit status: " << info.name;
    EXPECT_EQ(status_of(info.name), numbers.at(info.name)) << info.name;
  }
}

TEST(ExitStatus, the_clients_own_codes_have_theirs) {
  EXPECT_EQ(status_of("some-failed"), 7);
  EXPECT_EQ(status_of("unreachable"), 5);
  EXPECT_EQ(status_of("timeout"), 5);
  EXPECT_EQ(status_of("bad-response"), 5);
  EXPECT_EQ(status_of("content-mismatch"), 5);
  EXPECT_EQ(status_of("file"), 1);
  EXPECT_EQ(status_of("interrupted"), 130);
}

TEST(ExitStatus, a_code_that_is_not_known_is_a_failure) {
  EXPECT_EQ(status_of("a-code-of-a-later-daemon"), 1);
  EXPECT_EQ(status_of(""), 1);
}

}  // namespace
}  // namespace voxeld::cli
