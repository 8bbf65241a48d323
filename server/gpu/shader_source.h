// Shader text without GL: #include resolved by ourselves (Mesa 22.3.6 refuses the include directive
// of glslang), and driver logs turned back to file names. No #line directives: Mesa refuses them
// with a string, and with a number its compiler still reports file 0 for every location that spans
// more than one token, so an error in an included file would be told in the wrong file. Instead the
// text keeps its own numbering, and ResolvedShader::lines says where each line came from.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "proto/result.h"

namespace voxeld::gpu {

using Defines = std::vector<std::pair<std::string, std::string>>;

// A variant for devices without DeviceInfo::has_int64: its head does not ask for the extension, so
// what needs it does not compile.
inline constexpr std::string_view kNoInt64Define = "NO_INT64";

// Source with #include expanded once each, version and defines at the head.
struct ResolvedShader {
  struct Line {
    size_t file = 0;  // index into files
    int number = 0;   // from 1; 0 for the head that the resolver writes
  };
  std::string text;
  std::vector<std::string> files;
  std::vector<Line> lines;  // of each line of text
};

// The text of a file by its name below shaders/, e.g. "lib/dda.glsl". Errors: internal.
using ShaderReader = std::function<Result<std::string>(std::string_view name)>;

// Expands `file`. Names in #include "..." are below shaders/; a leading "shaders/" is dropped, so
// that files of shared/ can include each other from C++ too. #pragma once and #include <...> (of
// files that C++ reads as well) become empty lines. Files have no #version of their own.
// Errors: internal, "raymarch.frag line 3: cannot include lib/x.glsl: ...".
Result<ResolvedShader> resolve_shader(std::string_view file, const Defines& defines,
                                      const ShaderReader& read);

// Replaces line numbers in a compiler's log: "0:57(5): error" (Mesa), "0(57) : error" (NVIDIA) and
// "ERROR: 0:57:" (glslang) become "lib/dda.glsl:17…"; other lines stay.
std::string name_files_in_log(std::string_view log, const ResolvedShader& shader);

// The sources that are built into the binary.
Result<std::string> read_embedded_shader(std::string_view name);

}  // namespace voxeld::gpu
