// The part of the option table that images have.
#pragma once

#include <vector>

#include "proto/options/table.h"

namespace voxeld {

// The options of each image.
std::vector<Option> image_options();
// The options of several images in one file.
std::vector<Option> several_images_options();

}  // namespace voxeld
