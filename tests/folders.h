// Folders by which tests find files. One file alone is compiled with a path of the checkout: others
// are the same for a compiler cache wherever the sources lie.
#pragma once

#include <filesystem>

namespace voxeld::test {

std::filesystem::path source_dir();
// The folder of the program that runs, and of those that were built with it.
std::filesystem::path program_dir();

}  // namespace voxeld::test
