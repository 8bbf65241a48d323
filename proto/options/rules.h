// Options of animations, and of images that show several grids or views: their values and their
// valid combinations.
#pragma once

#include <set>
#include <string_view>

#include "proto/options/options.h"
#include "proto/result.h"

namespace voxeld::option_rules {

// The names of the options that a request gives.
using Given = std::set<std::string_view>;

bool is_animation_option(std::string_view name);
bool is_picture_option(std::string_view name);

// Sets one option by its text. `name` is one of those above. Errors: invalid-option.
Status set_animation(AnimationOptions& animation, std::string_view name, std::string_view text);
Status set_picture(RenderOptions& render, std::string_view name, std::string_view text);

// Fills in the first animation for requests that show frames of a mesh but name none: a frame of an
// image, and images of several grids that are not a turntable.
void complete_animation(RequestOptions& options, OptionScope scope, const Given& given);

// Checks combinations that need no knowledge of the input. Errors: invalid-option.
Status check_animation(const AnimationOptions& animation, const Given& given);
Status check_picture(const RequestOptions& options, OptionScope scope, const Given& given);

}  // namespace voxeld::option_rules
