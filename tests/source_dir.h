// The folder of the sources. One file alone is compiled with its path: others are the same for a
// compiler cache wherever the sources lie.
#pragma once

#include <filesystem>

namespace voxeld::test {

std::filesystem::path source_dir();

}  // namespace voxeld::test
