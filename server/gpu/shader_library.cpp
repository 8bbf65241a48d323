#include "server/gpu/shader_library.h"

#include <algorithm>
#include <filesystem>

#include "server/base/check.h"
#include "server/base/disk/file.h"
#include "server/base/sha256.h"
#include "shaders/embedded.h"

namespace voxeld::gpu {
namespace {

Result<GLenum> stage_of(std::string_view file) {
  const std::string_view extension = file.substr(std::min(file.rfind('.'), file.size()));
  if (extension == ".comp") return GL_COMPUTE_SHADER;
  if (extension == ".vert") return GL_VERTEX_SHADER;
  if (extension == ".geom") return GL_GEOMETRY_SHADER;
  if (extension == ".frag") return GL_FRAGMENT_SHADER;
  return Error{ErrorCode::kInternal, std::string(file) + ": no shader stage has this extension",
               ".comp, .vert, .geom or .frag", std::string(extension)};
}

std::string program_name(const std::vector<ShaderStage>& stages, const Defines& defines) {
  std::string name;
  for (const ShaderStage& stage : stages) name += (name.empty() ? "" : " ") + stage.file;
  for (const auto& [key, value] : defines) name.append(" ").append(key).append("=").append(value);
  return name;
}

Error driver_error(std::string what, std::string_view log) {
  return Error{
      ErrorCode::kInternal,
      std::move(what) + ":\n" + (log.empty() ? "the driver says nothing" : std::string(log)), "",
      ""};
}

// Deletes shaders at the end of the scope: attached ones, and those that a failed stage leaves.
struct ShaderList {
  const GlApi& gl;
  std::vector<uint32_t> ids;
  ~ShaderList() {
    for (const uint32_t id : ids) gl.DeleteShader(id);
  }
};

}  // namespace

Program::~Program() {
  if (id_ != 0) context_->gl().DeleteProgram(id_);
}
Program::Program(Program&& other) noexcept
    : context_(other.context_), id_(std::exchange(other.id_, 0)) {}
Program& Program::operator=(Program&& other) noexcept {
  std::swap(context_, other.context_);
  std::swap(id_, other.id_);
  return *this;
}

void Program::use() const {
  context_->gl().UseProgram(id_);
}

void Program::dispatch(int64_t groups) const {
  if (groups <= 0) return;
  const int64_t x = std::min(groups, context_->info().dispatch_groups_max);
  const int64_t y = (groups + x - 1) / x;
  VOXELD_CHECK(y <= context_->info().dispatch_groups_max, "more groups than two axes hold");
  use();
  context_->gl().DispatchCompute(static_cast<GLuint>(x), static_cast<GLuint>(y), 1);
}

void Program::dispatch_indirect(size_t offset_bytes) const {
  use();
  context_->gl().DispatchComputeIndirect(static_cast<GLintptr>(offset_bytes));
}

ShaderLibrary::ShaderLibrary(const Context& context, std::string shader_dir)
    : context_(&context), shader_dir_(std::move(shader_dir)) {}

Result<std::string> ShaderLibrary::read_source(std::string_view name) const {
  if (shader_dir_.empty()) return read_embedded_shader(name);
  VOXELD_ASSIGN(const std::vector<uint8_t> bytes,
                read_file(std::filesystem::path(shader_dir_) / name));
  return std::string(bytes.begin(), bytes.end());
}

std::string ShaderLibrary::sources_hash() const {
  Sha256 hash;
  for (const shaders::EmbeddedShader& one : shaders::embedded_shaders()) {
    const auto source = read_source(one.name);
    const std::string text = source ? *source : source.error().message();
    hash.update(std::string(one.name) + " " + std::to_string(text.size()) + "\n" + text);
  }
  return hash.finish_id();
}

Result<ShaderLibrary::Resolved> ShaderLibrary::resolve(std::string_view file,
                                                       const Defines& defines) const {
  return resolve_shader(file, defines, [this](std::string_view name) { return read_source(name); });
}

Result<uint32_t> ShaderLibrary::compile(const ShaderStage& stage, const Defines& defines) const {
  VOXELD_ASSIGN(const GLenum kind, stage_of(stage.file));
  VOXELD_ASSIGN(const Resolved source, resolve(stage.file, defines));
  const GlApi& gl = context_->gl();
  const GLuint shader = gl.CreateShader(kind);
  const char* text = source.text.c_str();
  gl.ShaderSource(shader, 1, &text, nullptr);
  gl.CompileShader(shader);
  GLint compiled = 0, log_bytes = 0;
  gl.GetShaderiv(shader, GL_COMPILE_STATUS, &compiled);
  if (compiled == GL_TRUE) return shader;
  gl.GetShaderiv(shader, GL_INFO_LOG_LENGTH, &log_bytes);
  std::string log(static_cast<size_t>(std::max(log_bytes, 1)), '\0');
  GLsizei written = 0;
  gl.GetShaderInfoLog(shader, static_cast<GLsizei>(log.size()), &written, log.data());
  log.resize(static_cast<size_t>(written));
  gl.DeleteShader(shader);
  return driver_error(
      program_name({stage}, defines) + " does not compile on " + context_->info().renderer,
      name_files_in_log(log, source));
}

Result<uint32_t> ShaderLibrary::link(const std::vector<ShaderStage>& stages,
                                     const Defines& defines) const {
  const GlApi& gl = context_->gl();
  ShaderList shaders{gl, {}};
  for (const ShaderStage& stage : stages) {
    VOXELD_ASSIGN(const uint32_t shader, compile(stage, defines));
    shaders.ids.push_back(shader);
  }
  const std::string name = program_name(stages, defines);
  const GLuint program = gl.CreateProgram();
  for (const uint32_t shader : shaders.ids) gl.AttachShader(program, shader);
  gl.LinkProgram(program);
  for (const uint32_t shader : shaders.ids) gl.DetachShader(program, shader);
  gl.ObjectLabel(GL_PROGRAM, program, static_cast<GLsizei>(std::min<size_t>(name.size(), 200)),
                 name.data());
  GLint linked = 0, log_bytes = 0;
  gl.GetProgramiv(program, GL_LINK_STATUS, &linked);
  if (linked == GL_TRUE) return program;
  gl.GetProgramiv(program, GL_INFO_LOG_LENGTH, &log_bytes);
  std::string log(static_cast<size_t>(std::max(log_bytes, 1)), '\0');
  GLsizei written = 0;
  gl.GetProgramInfoLog(program, static_cast<GLsizei>(log.size()), &written, log.data());
  log.resize(static_cast<size_t>(written));
  gl.DeleteProgram(program);
  return driver_error(name + " does not link on " + context_->info().renderer, log);
}

Result<const Program*> ShaderLibrary::get(const std::vector<ShaderStage>& stages,
                                          const Defines& given) {
  Defines defines = given;
  const auto is_no_int64 = [](const auto& define) { return define.first == kNoInt64Define; };
  if (!context_->info().has_int64 && std::ranges::none_of(defines, is_no_int64)) {
    defines.emplace_back(kNoInt64Define, "1");
  }
  const std::string name = program_name(stages, defines);
  if (const auto found = programs_.find(name); found != programs_.end()) {
    return static_cast<const Program*>(&found->second);
  }
  VOXELD_ASSIGN(const uint32_t id, link(stages, defines));
  Program program(*context_, id);
  VOXELD_TRY(context_->check("building " + name));
  return static_cast<const Program*>(&programs_.emplace(name, std::move(program)).first->second);
}

}  // namespace voxeld::gpu
