// The implementation of Client and Job: requests, retries and responses.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>

#include "client/include/voxeld/client.h"
#include "client/transport.h"

namespace voxeld::client {

// Appends each piece. The bytes must outlive the sink.
Sink appends_to(std::vector<std::byte>& bytes);

// Throws the error of a job that ended and is not done.
void check_done(const JobInfo& job);

class ClientImpl {
 public:
  explicit ClientImpl(Settings settings);

  // Exchanges until the response is not 429, 503 or a refused connection, and not lost where the
  // request may be repeated, or no tries are left.
  // `body` is sent anew each time. Throws Error for any status but 2xx.
  HttpResponse call(HttpRequest request, const std::string& body = "",
                    const std::stop_token& stop = {});
  const Settings& settings() const { return settings_; }
  std::string url(std::string_view path) const { return settings_.url + std::string(path); }

  std::string upload(const Source& source, const ProgressCallback& progress,
                     const std::stop_token& stop);
  std::string bundle(std::span<const BundleFile> files, const std::stop_token& stop);
  JobInfo submit(std::string_view kind, const Input& input, const Options& options,
                 const std::stop_token& stop = {});
  // POST /v1/jobs with this query. A stop ends pauses between tries, but no request: its job could
  // not be cancelled.
  HttpResponse post_job(std::string_view kind, const Input& input, const Options& options,
                        std::string_view query, const std::stop_token& stop = {});
  // The state of a job when it has ended, in whatever way.
  JobInfo wait_end(std::string_view id, const ProgressCallback& progress,
                   const std::stop_token& stop);
  // The same; throws the job's error if it is not done.
  JobInfo wait(std::string_view id, const ProgressCallback& progress, const std::stop_token& stop);
  // The state of a job, after at most these seconds unless it ends before.
  JobInfo look_for(std::string_view id, std::chrono::seconds time, const std::stop_token& stop);
  // DELETE /v1/jobs/{id}.
  JobInfo cancel(std::string_view id);
  // The tiles of a job behind the first `after`: 200; 202: none yet; 204: there are no others.
  HttpResponse tiles(std::string_view job, std::int64_t after, const std::stop_token& stop);
  // The bytes of a resource; `what` names it in errors.
  void fetch(std::string_view path, std::string_view what, const Sink& sink,
             const ProgressCallback& progress, const std::stop_token& stop);
  void download(std::string_view job, const Sink& sink, const ProgressCallback& progress,
                const std::stop_token& stop);
  Grid grid(std::string_view id, const ProgressCallback& progress, const std::stop_token& stop);
  // A grid that the daemon has, from its container.
  Grid stored_grid(std::span<const std::byte> container, std::string id) const;
  // Sends the source, unless the daemon has it, and submits its job.
  JobInfo begin(std::string_view kind, const Source& source, const Options& options,
                const ProgressCallback& progress, const std::stop_token& stop);
  // Waits for a job and downloads its result. Cancels the job if the caller stops the wait.
  JobInfo finish(JobInfo job, const Sink& sink, const ProgressCallback& progress,
                 const std::stop_token& stop);
  JobInfo run(std::string_view kind, const Source& source, const Options& options, const Sink& sink,
              const ProgressCallback& progress, const std::stop_token& stop);

 private:
  HttpRequest cancel_request(std::string_view id) const;
  // The id of the source's bytes, if the daemon has them under a name that is read likewise; else
  // "". Throws if it is stopped or the file cannot be read.
  std::string known_asset(const Source& source, const ProgressCallback& progress,
                          const std::stop_token& stop);
  // Uploads the files of a bundle that the daemon lacks, and the bundle.
  std::string send_bundle(std::span<const Source> sources, const ProgressCallback& progress,
                          const std::stop_token& stop);
  // Uploads without asking; of a bundle what the daemon lacks.
  std::string send(const Source& source, const ProgressCallback& progress,
                   const std::stop_token& stop);
  [[noreturn]] void fail(const HttpResponse& response) const;
  // One poll that the daemon holds for so long. Repeated while the daemon is away: a restarted one
  // still has its jobs.
  HttpResponse poll(HttpRequest request, std::chrono::seconds time, int retries,
                    const std::stop_token& stop);
  // The state of a job. Status 304: nothing changed since `etag`.
  HttpResponse look(std::string_view job, const std::string& etag, std::chrono::seconds time,
                    int retries, const std::stop_token& stop);
  // Further tries of a wait that has no end of its own.
  int wait_retries() const;
  void pause(int attempt, const HttpResponse& response, const std::stop_token& stop) const;

  Settings settings_;
  Transport transport_;
};

}  // namespace voxeld::client
