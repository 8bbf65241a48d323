#include "tests/gpu/protocol/checked_context.h"

#include <span>
#include <utility>

namespace voxeld::gpu {
namespace {

CheckedContext* g_checked = nullptr;  // the one that exists

}  // namespace

// The replaced functions of the table. Each checks, counts and passes on.
struct CheckedCalls {
  using Kind = CheckedContext::Kind;
  static CheckedContext& self() { return *g_checked; }
  static const GlApi& inner() { return g_checked->inner_->gl(); }

  static void APIENTRY CreateQueries(GLenum target, GLsizei count, GLuint* ids) {
    inner().CreateQueries(target, count, ids);
    self().created(Kind::kQuery, count, ids);
  }
  static void APIENTRY DeleteQueries(GLsizei count, const GLuint* ids) {
    for (const GLuint id : std::span(ids, static_cast<size_t>(count))) {
      for (const auto& [target, active] : self().active_queries_) {
        self().expect(active != id, "DeleteQueries", "query " + std::to_string(id) + " is active");
      }
      std::erase_if(self().active_queries_, [&](const auto& one) { return one.second == id; });
    }
    self().deleted(Kind::kQuery, "DeleteQueries", count, ids);
    inner().DeleteQueries(count, ids);
  }
  static void APIENTRY BeginQuery(GLenum target, GLuint id) {
    self().expect_exists(Kind::kQuery, "BeginQuery", id);
    self().expect(!self().active_queries_.contains(target), "BeginQuery",
                  "another query of the target is active");
    self().active_queries_[target] = id;
    inner().BeginQuery(target, id);
  }
  static void APIENTRY EndQuery(GLenum target) {
    self().expect(self().active_queries_.erase(target) == 1, "EndQuery", "no query is active");
    inner().EndQuery(target);
  }
  static void APIENTRY GetQueryObjectui64v(GLuint id, GLenum name, GLuint64* value) {
    self().expect_exists(Kind::kQuery, "GetQueryObjectui64v", id);
    for (const auto& [target, active] : self().active_queries_) {
      self().expect(active != id, "GetQueryObjectui64v", "the query is active");
    }
    ++self().counts_.query_results;
    inner().GetQueryObjectui64v(id, name, value);
  }

  static void APIENTRY CreateBuffers(GLsizei count, GLuint* ids) {
    inner().CreateBuffers(count, ids);
    self().created(Kind::kBuffer, count, ids);
    self().counts_.buffers_created += count;
  }
  static void APIENTRY DeleteBuffers(GLsizei count, const GLuint* ids) {
    for (const GLuint id : std::span(ids, static_cast<size_t>(count))) {
      self().mapped_.erase(id);  // deleting unmaps
      std::erase_if(self().bindings_, [&](const auto& one) { return one.second == id; });
    }
    self().deleted(Kind::kBuffer, "DeleteBuffers", count, ids);
    inner().DeleteBuffers(count, ids);
  }
  static void APIENTRY NamedBufferSubData(GLuint id, GLintptr offset, GLsizeiptr bytes,
                                          const void* data) {
    self().expect_free_buffer("NamedBufferSubData", id);
    ++self().counts_.uploads;
    self().counts_.bytes_up += bytes;
    inner().NamedBufferSubData(id, offset, bytes, data);
  }
  static void APIENTRY GetNamedBufferSubData(GLuint id, GLintptr offset, GLsizeiptr bytes,
                                             void* data) {
    self().expect_free_buffer("GetNamedBufferSubData", id);
    ++self().counts_.blocking_reads;
    self().counts_.bytes_down += bytes;
    inner().GetNamedBufferSubData(id, offset, bytes, data);
  }
  static void APIENTRY ClearNamedBufferData(GLuint id, GLenum format, GLenum of, GLenum type,
                                            const void* data) {
    self().expect_free_buffer("ClearNamedBufferData", id);
    inner().ClearNamedBufferData(id, format, of, type, data);
  }
  static void APIENTRY ClearNamedBufferSubData(GLuint id, GLenum format, GLintptr offset,
                                               GLsizeiptr bytes, GLenum of, GLenum type,
                                               const void* data) {
    self().expect_free_buffer("ClearNamedBufferSubData", id);
    inner().ClearNamedBufferSubData(id, format, offset, bytes, of, type, data);
  }
  static void* APIENTRY MapNamedBufferRange(GLuint id, GLintptr offset, GLsizeiptr bytes,
                                            GLbitfield access) {
    self().expect_free_buffer("MapNamedBufferRange", id);
    self().mapped_.insert(id);
    ++self().counts_.blocking_reads;
    if ((access & GL_MAP_READ_BIT) != 0) self().counts_.bytes_down += bytes;
    return inner().MapNamedBufferRange(id, offset, bytes, access);
  }
  static GLboolean APIENTRY UnmapNamedBuffer(GLuint id) {
    self().expect_exists(Kind::kBuffer, "UnmapNamedBuffer", id);
    self().expect(self().mapped_.erase(id) == 1, "UnmapNamedBuffer", "the buffer is not mapped");
    return inner().UnmapNamedBuffer(id);
  }
  static void APIENTRY BindBuffer(GLenum target, GLuint id) {
    self().expect_exists(Kind::kBuffer, "BindBuffer", id);
    self().bindings_[{target, 0}] = id;
    inner().BindBuffer(target, id);
  }
  static void APIENTRY BindBufferBase(GLenum target, GLuint index, GLuint id) {
    self().expect_exists(Kind::kBuffer, "BindBufferBase", id);
    self().bindings_[{target, index}] = id;
    inner().BindBufferBase(target, index, id);
  }
  static void APIENTRY BindBufferRange(GLenum target, GLuint index, GLuint id, GLintptr offset,
                                       GLsizeiptr bytes) {
    self().expect_exists(Kind::kBuffer, "BindBufferRange", id);
    self().bindings_[{target, index}] = id;
    inner().BindBufferRange(target, index, id, offset, bytes);
  }

  static void APIENTRY CreateTextures(GLenum target, GLsizei count, GLuint* ids) {
    inner().CreateTextures(target, count, ids);
    self().created(Kind::kTexture, count, ids);
  }
  static void APIENTRY DeleteTextures(GLsizei count, const GLuint* ids) {
    self().deleted(Kind::kTexture, "DeleteTextures", count, ids);
    inner().DeleteTextures(count, ids);
  }
  static void APIENTRY BindTextureUnit(GLuint unit, GLuint id) {
    self().expect_exists(Kind::kTexture, "BindTextureUnit", id);
    inner().BindTextureUnit(unit, id);
  }
  static void APIENTRY CreateFramebuffers(GLsizei count, GLuint* ids) {
    inner().CreateFramebuffers(count, ids);
    self().created(Kind::kFramebuffer, count, ids);
  }
  static void APIENTRY DeleteFramebuffers(GLsizei count, const GLuint* ids) {
    self().deleted(Kind::kFramebuffer, "DeleteFramebuffers", count, ids);
    inner().DeleteFramebuffers(count, ids);
  }
  static void APIENTRY BindFramebuffer(GLenum target, GLuint id) {
    self().expect_exists(Kind::kFramebuffer, "BindFramebuffer", id);
    inner().BindFramebuffer(target, id);
  }
  static void APIENTRY CreateVertexArrays(GLsizei count, GLuint* ids) {
    inner().CreateVertexArrays(count, ids);
    self().created(Kind::kVertexArray, count, ids);
  }
  static void APIENTRY DeleteVertexArrays(GLsizei count, const GLuint* ids) {
    self().deleted(Kind::kVertexArray, "DeleteVertexArrays", count, ids);
    inner().DeleteVertexArrays(count, ids);
  }
  static void APIENTRY BindVertexArray(GLuint id) {
    self().expect_exists(Kind::kVertexArray, "BindVertexArray", id);
    inner().BindVertexArray(id);
  }
  static GLuint APIENTRY CreateProgram() {
    const GLuint id = inner().CreateProgram();
    self().created(Kind::kProgram, 1, &id);
    return id;
  }
  static void APIENTRY DeleteProgram(GLuint id) {
    self().deleted(Kind::kProgram, "DeleteProgram", 1, &id);
    inner().DeleteProgram(id);
  }
  static void APIENTRY UseProgram(GLuint id) {
    self().expect_exists(Kind::kProgram, "UseProgram", id);
    self().program_ = id;
    inner().UseProgram(id);
  }
  static GLuint APIENTRY CreateShader(GLenum type) {
    const GLuint id = inner().CreateShader(type);
    self().created(Kind::kShader, 1, &id);
    return id;
  }
  static void APIENTRY DeleteShader(GLuint id) {
    self().deleted(Kind::kShader, "DeleteShader", 1, &id);
    inner().DeleteShader(id);
  }

  static void APIENTRY DispatchCompute(GLuint x, GLuint y, GLuint z) {
    self().before_dispatch("DispatchCompute");
    inner().DispatchCompute(x, y, z);
  }
  static void APIENTRY DispatchComputeIndirect(GLintptr offset) {
    self().before_dispatch("DispatchComputeIndirect");
    self().expect(self().bindings_.contains({GL_DISPATCH_INDIRECT_BUFFER, 0}),
                  "DispatchComputeIndirect", "no buffer with the arguments is bound");
    inner().DispatchComputeIndirect(offset);
  }
  static void APIENTRY DrawArrays(GLenum mode, GLint first, GLsizei count) {
    self().before_dispatch("DrawArrays");
    inner().DrawArrays(mode, first, count);
  }
  static void APIENTRY ReadPixels(GLint x, GLint y, GLsizei width, GLsizei height, GLenum format,
                                  GLenum type, void* data) {
    ++self().counts_.blocking_reads;
    inner().ReadPixels(x, y, width, height, format, type, data);
  }
  static void APIENTRY Finish() {
    ++self().counts_.blocking_reads;
    inner().Finish();
  }
  static GLenum APIENTRY GetError() {
    if (self().failing_check_ == self().counts_.error_checks++) {
      self().failing_check_.reset();
      return GL_OUT_OF_MEMORY;
    }
    return inner().GetError();
  }
};

CheckedContext::CheckedContext(Context& inner) : inner_(&inner) {
  g_checked = this;
  gl_ = inner.gl();
  info_ = inner.info();
  // The hardware's path, whatever the driver is.
  info_.is_software = false;
  info_.has_timer_queries = true;
#define VOXELD_CHECKED_CALL(name) gl_.name = &CheckedCalls::name;
  VOXELD_CHECKED_CALL(CreateQueries)
  VOXELD_CHECKED_CALL(DeleteQueries)
  VOXELD_CHECKED_CALL(BeginQuery)
  VOXELD_CHECKED_CALL(EndQuery)
  VOXELD_CHECKED_CALL(GetQueryObjectui64v)
  VOXELD_CHECKED_CALL(CreateBuffers)
  VOXELD_CHECKED_CALL(DeleteBuffers)
  VOXELD_CHECKED_CALL(NamedBufferSubData)
  VOXELD_CHECKED_CALL(GetNamedBufferSubData)
  VOXELD_CHECKED_CALL(ClearNamedBufferData)
  VOXELD_CHECKED_CALL(ClearNamedBufferSubData)
  VOXELD_CHECKED_CALL(MapNamedBufferRange)
  VOXELD_CHECKED_CALL(UnmapNamedBuffer)
  VOXELD_CHECKED_CALL(BindBuffer)
  VOXELD_CHECKED_CALL(BindBufferBase)
  VOXELD_CHECKED_CALL(BindBufferRange)
  VOXELD_CHECKED_CALL(CreateTextures)
  VOXELD_CHECKED_CALL(DeleteTextures)
  VOXELD_CHECKED_CALL(BindTextureUnit)
  VOXELD_CHECKED_CALL(CreateFramebuffers)
  VOXELD_CHECKED_CALL(DeleteFramebuffers)
  VOXELD_CHECKED_CALL(BindFramebuffer)
  VOXELD_CHECKED_CALL(CreateVertexArrays)
  VOXELD_CHECKED_CALL(DeleteVertexArrays)
  VOXELD_CHECKED_CALL(BindVertexArray)
  VOXELD_CHECKED_CALL(CreateProgram)
  VOXELD_CHECKED_CALL(DeleteProgram)
  VOXELD_CHECKED_CALL(UseProgram)
  VOXELD_CHECKED_CALL(CreateShader)
  VOXELD_CHECKED_CALL(DeleteShader)
  VOXELD_CHECKED_CALL(DispatchCompute)
  VOXELD_CHECKED_CALL(DispatchComputeIndirect)
  VOXELD_CHECKED_CALL(DrawArrays)
  VOXELD_CHECKED_CALL(ReadPixels)
  VOXELD_CHECKED_CALL(Finish)
  VOXELD_CHECKED_CALL(GetError)
#undef VOXELD_CHECKED_CALL
}

CheckedContext::~CheckedContext() {
  g_checked = nullptr;
}

const char* CheckedContext::name_of(Kind kind) {
  switch (kind) {
    case Kind::kBuffer:
      return "buffer";
    case Kind::kTexture:
      return "texture";
    case Kind::kFramebuffer:
      return "framebuffer";
    case Kind::kVertexArray:
      return "vertex array";
    case Kind::kProgram:
      return "program";
    case Kind::kShader:
      return "shader";
    case Kind::kQuery:
      return "query";
  }
  return "";
}

void CheckedContext::created(Kind kind, int count, const GLuint* ids) {
  objects_[kind].insert(ids, ids + count);
}

void CheckedContext::deleted(Kind kind, const char* call, int count, const GLuint* ids) {
  for (const GLuint id : std::span(ids, static_cast<size_t>(count))) {
    expect(objects_[kind].erase(id) == 1, call,
           std::string(name_of(kind)) + " " + std::to_string(id) + " does not exist");
  }
}

void CheckedContext::expect(bool holds, const char* call, const std::string& rule) {
  if (!holds) violations_.push_back("gl" + std::string(call) + ": " + rule);
}

void CheckedContext::expect_exists(Kind kind, const char* call, GLuint id) {
  expect(id == 0 || objects_[kind].contains(id), call,
         std::string(name_of(kind)) + " " + std::to_string(id) + " does not exist");
}

void CheckedContext::expect_free_buffer(const char* call, GLuint buffer) {
  expect_exists(Kind::kBuffer, call, buffer);
  expect(!mapped_.contains(buffer), call, "buffer " + std::to_string(buffer) + " is mapped");
}

void CheckedContext::before_dispatch(const char* call) {
  expect(program_ != 0 && objects_[Kind::kProgram].contains(program_), call,
         "no program is in use");
  for (const auto& [place, buffer] : bindings_) {
    expect(!mapped_.contains(buffer), call,
           "buffer " + std::to_string(buffer) + " is bound and mapped");
  }
  if (cancel_at_ == counts_.dispatches) {
    cancel_flag_->store(true);
    cancel_at_.reset();
  }
  ++counts_.dispatches;
}

std::vector<std::string> CheckedContext::existing() const {
  std::vector<std::string> names;
  for (const auto& [kind, ids] : objects_) {
    for (const GLuint id : ids) {
      names.push_back(std::string(name_of(kind)) + " " + std::to_string(id));
    }
  }
  return names;
}

std::vector<std::string> CheckedContext::busy() const {
  std::vector<std::string> names;
  for (const auto& [target, id] : active_queries_) {
    names.push_back("active query " + std::to_string(id));
  }
  for (const GLuint id : mapped_) names.push_back("mapped buffer " + std::to_string(id));
  return names;
}

}  // namespace voxeld::gpu
