#include "server/gpu/pass_timer.h"

#include "server/base/check.h"

namespace voxeld::gpu {

PassTimer::PassTimer(const Context& context) : context_(&context) {}

PassTimer::~PassTimer() {
  for (const Pending& one : pending_) context_->gl().DeleteQueries(1, &one.query);
}

PassTimer::Pass PassTimer::measure(std::string_view pass) {
  VOXELD_CHECK(running_.empty(), "passes do not nest");
  running_ = pass;
  if (!context_->info().has_timer_queries) {
    context_->gl().Finish();
    wall_.lap();
    return Pass(*this);
  }
  uint32_t query = 0;
  context_->gl().CreateQueries(GL_TIME_ELAPSED, 1, &query);
  context_->gl().BeginQuery(GL_TIME_ELAPSED, query);
  pending_.push_back({running_, query});
  return Pass(*this);
}

void PassTimer::end() {
  if (context_->info().has_timer_queries) {
    context_->gl().EndQuery(GL_TIME_ELAPSED);
  } else {
    context_->gl().Finish();
    add_stage(times_, running_, wall_.ms());
  }
  running_.clear();
}

std::vector<std::pair<std::string, double>> PassTimer::results() {
  for (const Pending& one : pending_) {
    GLuint64 nanoseconds = 0;
    context_->gl().GetQueryObjectui64v(one.query, GL_QUERY_RESULT, &nanoseconds);
    add_stage(times_, one.pass, static_cast<double>(nanoseconds) * 1e-6);
    context_->gl().DeleteQueries(1, &one.query);
  }
  pending_.clear();
  return times_;
}

}  // namespace voxeld::gpu
