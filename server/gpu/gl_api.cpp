#include "server/gpu/gl_api.h"

#include <cstdio>

namespace voxeld::gpu {

Result<GlApi> load_gl_api(const GetGlProc& get_proc) {
  GlApi api;
#define VOXELD_GL_LOAD(type, name)                                                     \
  api.name = reinterpret_cast<type>(get_proc("gl" #name));                             \
  if (api.name == nullptr) {                                                           \
    return Error{ErrorCode::kDeviceUnavailable, "the driver has no function gl" #name, \
                 "OpenGL 4.5 core", "an older or incomplete driver"};                  \
  }
  VOXELD_GL_FUNCTIONS(VOXELD_GL_LOAD)
#undef VOXELD_GL_LOAD
  return api;
}

std::string gl_error_name(GLenum error) {
  switch (error) {
    case GL_NO_ERROR:
      return "GL_NO_ERROR";
    case GL_INVALID_ENUM:
      return "GL_INVALID_ENUM";
    case GL_INVALID_VALUE:
      return "GL_INVALID_VALUE";
    case GL_INVALID_OPERATION:
      return "GL_INVALID_OPERATION";
    case GL_INVALID_FRAMEBUFFER_OPERATION:
      return "GL_INVALID_FRAMEBUFFER_OPERATION";
    case GL_OUT_OF_MEMORY:
      return "GL_OUT_OF_MEMORY";
    case GL_STACK_OVERFLOW:
      return "GL_STACK_OVERFLOW";
    case GL_STACK_UNDERFLOW:
      return "GL_STACK_UNDERFLOW";
    case GL_CONTEXT_LOST:
      return "GL_CONTEXT_LOST";
    default: {
      char text[16];
      std::snprintf(text, sizeof text, "0x%x", error);
      return text;
    }
  }
}

}  // namespace voxeld::gpu
