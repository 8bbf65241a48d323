// The manual page and the completions of shells, made from the command line's own description.
#pragma once

#include <string>
#include <string_view>

namespace CLI {
class App;
}

namespace voxeld::cli {

// `document`: "man" (troff, section 1), "bash" or "zsh".
std::string document_text(std::string_view document, const CLI::App& app);

}  // namespace voxeld::cli
