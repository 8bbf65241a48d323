// Options that must parse.
#pragma once

#include <gtest/gtest.h>

#include "proto/options/options.h"

namespace voxeld::test {

inline RequestOptions parsed(const OptionPairs& pairs, OptionScope scope) {
  const auto options = parse_options(pairs, scope);
  EXPECT_TRUE(options) << (options ? "" : options.error().message());
  return options ? *options : RequestOptions{};
}

}  // namespace voxeld::test
