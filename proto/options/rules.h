// Rules across options: defaults that depend on other options, and combinations that are refused.
#pragma once

#include <set>
#include <string_view>

#include "proto/options/options.h"
#include "proto/result.h"

namespace voxeld {

// The names of the options that a request gives.
using GivenOptions = std::set<std::string_view>;

// Fills in dependent defaults, then applies every rule that needs no knowledge of the input.
// Errors: invalid-option of the first rule that is broken.
Status apply_option_rules(RequestOptions& options, OptionScope scope, const GivenOptions& given);

}  // namespace voxeld
