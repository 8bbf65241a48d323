// Options of animations and of pictures that show several grids or views: their values, and what
// of them goes together.
#pragma once

#include <set>
#include <string_view>

#include "proto/options.h"
#include "proto/result.h"

namespace voxeld::option_frames {

// Options by the names of the table that are given in a request.
using Given = std::set<std::string_view>;

bool is_animation_option(std::string_view name);
bool is_picture_option(std::string_view name);

// `name` is one of those above. Errors: invalid-option.
Status set_animation(AnimationOptions& animation, std::string_view name, std::string_view text);
Status set_picture(RenderOptions& render, std::string_view name, std::string_view text);

// What shows frames of a mesh without naming an animation shows those of the first one: so do a
// frame of a picture, and pictures of several grids that are no turntable.
void complete_animation(RequestOptions& options, OptionScope scope, const Given& given);

// What is told apart without knowing the input. Errors: invalid-option.
Status check_animation(const AnimationOptions& animation, const Given& given);
Status check_picture(const RequestOptions& options, OptionScope scope, const Given& given);

}  // namespace voxeld::option_frames
