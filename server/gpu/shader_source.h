// Shader text without GL: #include resolved by ourselves (Mesa 22.3.6 refuses both the include
// directive of glslang and #line with a string), and driver logs turned back to file names.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "proto/result.h"

namespace voxeld::gpu {

using Defines = std::vector<std::pair<std::string, std::string>>;

// Source with #include expanded once each, "#line N <file index>" at seams, version and defines at
// the head.
struct ResolvedShader {
  std::string text;
  std::vector<std::string> files;  // index -> name
};

// The text of a file by its name below shaders/, e.g. "lib/dda.glsl". Errors: internal.
using ShaderReader = std::function<Result<std::string>(std::string_view name)>;

// Expands `file`. Names in #include "..." are below shaders/; a leading "shaders/" is dropped, so
// that files of shared/ can include each other from C++ too. #pragma once and #include <...> (of
// files that C++ reads as well) become empty lines. Files have no #version of their own.
// Errors: internal, "raymarch.frag line 3: cannot include lib/x.glsl: ...".
Result<ResolvedShader> resolve_shader(std::string_view file, const Defines& defines,
                                      const ShaderReader& read);

// Replaces file numbers in a compiler's log: "2:17(5): error" (Mesa), "2(17) : error" (NVIDIA) and
// "ERROR: 2:17:" (glslang) become "lib/dda.glsl:17…".
std::string name_files_in_log(std::string_view log, const std::vector<std::string>& files);

// The sources that are built into the binary.
Result<std::string> read_embedded_shader(std::string_view name);

}  // namespace voxeld::gpu
