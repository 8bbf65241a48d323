#include "server/api/resources/jobs/job_wait.h"

#include <algorithm>
#include <optional>
#include <utility>

namespace voxeld::api {
namespace {

class JobWait final : public Wait {
 public:
  JobWait(Request& request, Api& api, JobWaitPlan plan)
      : api_(api),
        plan_(std::move(plan)),
        watch_(api.jobs.watch(plan_.job, plan_.change, request.waker)) {}

  std::optional<Response> look(Request& request) override {
    if (!api_.access.still_admits(request.key_id)) {
      abandon(request);
      return problem(request, no_valid_key());
    }
    const auto status = api_.jobs.get(request.caller, plan_.job);
    if (!status) return problem(request, status.error());
    const bool is_late = Clock::now() >= plan_.deadline || (plan_.is_poll && api_.stopping);
    if (!is_over(*status) && !is_late) return std::nullopt;
    if (!status->ended()) abandon(request);
    return plan_.then(request, *status);
  }

  Clock::time_point until() const override { return plan_.deadline; }

  void abandon(Request& request) override {
    if (plan_.is_transient) (void)api_.jobs.cancel(request.caller, plan_.job);
  }

 private:
  bool is_over(const JobStatus& status) const {
    return status.ended() || (plan_.is_over && plan_.is_over(status));
  }

  Api& api_;
  const JobWaitPlan plan_;
  const std::unique_ptr<JobWatch> watch_;
};

Error late_error(const JobStatus& status) {
  return {ErrorCode::kDeadlineExceeded, "the job " + status.id + " did not end in time", "",
          std::string(job_state_name(status.state))};
}

}  // namespace

Reply wait_for_job(Request& request, Api& api, JobWaitPlan plan) {
  return std::unique_ptr<Wait>(std::make_unique<JobWait>(request, api, std::move(plan)));
}

Reply run_transient(Request& request, Api& api, const JobRequest& job,
                    std::function<Response(Request&, const JobStatus&)> then) {
  auto place = api.waits.take(request.caller.tenant());
  if (!place) return problem(request, place.error());
  return run_transient(request, api, job, *std::move(place), 0, std::move(then));
}

Reply run_transient(Request& request, Api& api, const JobRequest& job, WaitPlace place,
                    double upload_ms, std::function<Response(Request&, const JobStatus&)> then) {
  SubmitOptions submit;
  submit.transient = true;
  submit.request_id = request.request_id;
  submit.trace_id = request.trace.trace_id;
  submit.upload_ms = upload_ms;
  const auto submitted = api.jobs.submit(request.caller, job, submit);
  if (!submitted) return problem(request, submitted.error());
  JobWaitPlan plan;
  plan.job = submitted->id;
  plan.place = std::move(place);
  plan.is_transient = true;
  plan.then = [cached = submitted->cached, then = std::move(then)](Request& asking,
                                                                   const JobStatus& status) {
    if (!status.ended()) return problem(asking, late_error(status));
    // The same request makes a new job: a problem that may pass says when to try again.
    if (status.error) return problem(asking, *status.error);
    JobStatus ended = status;
    ended.cached = cached;
    Response response = then(asking, ended);
    // Another version of the daemon may make other bytes of the same request.
    if (response.status < 400) response.headers["Cache-Control"] = "private, max-age=3600";
    return response;
  };
  return wait_for_job(request, api, std::move(plan));
}

}  // namespace voxeld::api
