// The flag --palette: colours from a file beside what the daemon's option takes.
#pragma once

#include <string>

namespace voxeld::cli {

// The option for the flag's value: the colours of the palette file that it names, or the value as
// it is. A value with a dot or a slash names a file; other values of the option have neither.
// Throws CLI::ValidationError for a file that cannot be read.
std::string palette_option(const std::string& value);

}  // namespace voxeld::cli
