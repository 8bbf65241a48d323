// Shader text without GL: #include expansion, and driver logs mapped back to file names. #include
// is resolved here because Mesa 22.3.6 refuses the include directive of glslang. There are no #line
// directives. Mesa refuses them with a string. With a number, its compiler still reports file 0 for
// every location that spans more than one token, so an error in an included file would be reported
// in the wrong file. Instead the text keeps its own numbering, and ResolvedShader::lines maps each
// line to its source.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "proto/result.h"

namespace voxeld::gpu {

using Defines = std::vector<std::pair<std::string, std::string>>;

// A variant for devices without DeviceInfo::has_int64. Its head does not request the extension, so
// code that needs it does not compile.
inline constexpr std::string_view kNoInt64Define = "NO_INT64";

// Source with each #include expanded once, and version and defines at the head.
struct ResolvedShader {
  struct Line {
    size_t file = 0;  // index into files
    int number = 0;   // from 1; 0 for the head, which the resolver writes
  };
  std::string text;
  std::vector<std::string> files;
  std::vector<Line> lines;  // one per line of text
};

// Returns the text of a file by its name below shaders/, as "raymarch/dda.glsl". Errors: internal.
using ShaderReader = std::function<Result<std::string>(std::string_view name)>;

// Expands `file`. Names in #include "..." are below shaders/; a leading "shaders/" is dropped, so
// that C++ can include the files of shared/ too. #pragma once and #include <...> (in files that C++
// also reads) become empty lines. Files must not contain #version. Errors: internal, "raymarch.frag
// line 3: cannot include lib/x.glsl: ...".
Result<ResolvedShader> resolve_shader(std::string_view file, const Defines& defines,
                                      const ShaderReader& read);

// Replaces line numbers in a compiler's log: "0:57(5): error" (Mesa), "0(57) : error" (NVIDIA) and
// "ERROR: 0:57:" (glslang) become "raymarch/dda.glsl:17…". Other lines stay.
std::string name_files_in_log(std::string_view log, const ResolvedShader& shader);

// Reads a source that is built into the binary.
Result<std::string> read_embedded_shader(std::string_view name);

}  // namespace voxeld::gpu
