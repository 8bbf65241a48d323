# This file has two uses. If included, voxeld_embed_shaders(<target> files...) makes a library with
# the text of the files. If run with cmake -P (OUTPUT, ROOT and FILES separated by commas), it
# writes that library's source file.

function(voxeld_embed_shaders target)
  set(output ${CMAKE_CURRENT_BINARY_DIR}/embedded.cpp)
  list(TRANSFORM ARGN PREPEND ${CMAKE_CURRENT_SOURCE_DIR}/ OUTPUT_VARIABLE inputs)
  list(JOIN ARGN "," files)
  add_custom_command(
    OUTPUT ${output}
    COMMAND ${CMAKE_COMMAND} -DOUTPUT=${output} -DROOT=${CMAKE_CURRENT_SOURCE_DIR}
            -DFILES=${files} -P ${CMAKE_CURRENT_SOURCE_DIR}/embed.cmake
    DEPENDS ${inputs} ${CMAKE_CURRENT_SOURCE_DIR}/embed.cmake
    COMMENT "Embedding shaders"
    VERBATIM)
  set_source_files_properties(${output} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
  add_library(${target} STATIC ${output})
  voxeld_options(${target})
endfunction()

if(CMAKE_SCRIPT_MODE_FILE)
  # A raw string literal needs no escapes. Its delimiter occurs in no shader.
  set(entries "")
  string(REPLACE "," ";" FILES "${FILES}")
  foreach(file IN LISTS FILES)
    file(READ ${ROOT}/${file} text)
    file(SHA256 ${ROOT}/${file} hash)
    string(APPEND entries
           "    EmbeddedShader{\"${file}\", \"${hash}\", R\"voxeld(${text})voxeld\"},\n")
  endforeach()
  list(LENGTH FILES count)
  file(WRITE ${OUTPUT} "// Made by embed.cmake.
#include \"shaders/embedded.h\"

#include <array>

namespace voxeld::shaders {
namespace {
const std::array<EmbeddedShader, ${count}> kShaders = {
${entries}};
}  // namespace
std::span<const EmbeddedShader> embedded_shaders() { return kShaders; }
}  // namespace voxeld::shaders
")
endif()
