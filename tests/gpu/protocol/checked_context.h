// A context that passes every call on to another one and checks that the calls keep OpenGL's rules
// of order, which Mesa's drivers forgive and others need not.
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "server/gpu/context.h"

namespace voxeld::gpu {

// Calls since the last reset_counts().
struct CallCounts {
  int64_t dispatches = 0;      // and draws
  int64_t blocking_reads = 0;  // the CPU waits for the device
  int64_t query_results = 0;   // read after the job's last blocking read: they wait no more
  int64_t uploads = 0;
  int64_t buffers_created = 0;
  int64_t bytes_down = 0;  // read by the CPU
  int64_t bytes_up = 0;
  int64_t error_checks = 0;  // glGetError
};

// Rules (OpenGL 4.5 core, sections in brackets): at most one query of a target is active, an active
// query is not deleted and its result not read [4.2]; objects are used and deleted while they exist
// [5.1]; a mapped buffer is neither mapped again, nor uploaded, read or cleared, nor bound during a
// dispatch [6.2, 6.3]; a dispatch needs a program [19]. One such context at a time.
class CheckedContext final : public Context {
 public:
  explicit CheckedContext(Context& inner);
  ~CheckedContext() override;
  Status make_current() const override { return inner_->make_current(); }

  // Broken rules so far, each with the name of the call.
  const std::vector<std::string>& violations() const { return violations_; }
  // Objects and queries that exist, "buffer 7"; active queries and mapped buffers say so.
  std::vector<std::string> existing() const;
  std::vector<std::string> busy() const;

  // Objects made from now on find a device without 64-bit integers in shaders.
  void take_int64_away() { info_.has_int64 = false; }

  const CallCounts& counts() const { return counts_; }
  void reset_counts() { counts_ = {}; }
  // The glGetError of that number from now on returns GL_OUT_OF_MEMORY; 0: the next one.
  void fail_check(int64_t number) { failing_check_ = counts_.error_checks + number; }
  void fail_no_check() { failing_check_.reset(); }
  // Sets the flag at the dispatch or draw of that number from now on.
  void cancel_at_dispatch(int64_t number, std::atomic<bool>& flag) {
    cancel_at_ = counts_.dispatches + number;
    cancel_flag_ = &flag;
  }

 private:
  friend struct CheckedCalls;
  enum class Kind { kBuffer, kTexture, kFramebuffer, kVertexArray, kProgram, kShader, kQuery };
  static const char* name_of(Kind kind);
  void created(Kind kind, int count, const GLuint* ids);
  void deleted(Kind kind, const char* call, int count, const GLuint* ids);
  void expect(bool holds, const char* call, const std::string& rule);
  void expect_exists(Kind kind, const char* call, GLuint id);
  // Checks a call that accesses the buffer's contents.
  void expect_free_buffer(const char* call, GLuint buffer);
  void before_dispatch(const char* call);

  Context* inner_;
  std::map<Kind, std::set<GLuint>> objects_;
  std::map<GLenum, GLuint> active_queries_;               // by target
  std::set<GLuint> mapped_;                               // buffers
  std::map<std::pair<GLenum, GLuint>, GLuint> bindings_;  // target and index to buffer
  GLuint program_ = 0;
  std::vector<std::string> violations_;
  CallCounts counts_;
  std::optional<int64_t> failing_check_, cancel_at_;
  std::atomic<bool>* cancel_flag_ = nullptr;
};

}  // namespace voxeld::gpu
