// The implementation of Client: requests, retries and responses.
#pragma once

#include <functional>
#include <string>
#include <string_view>

#include "client/include/voxeld/client.h"
#include "client/transport.h"

namespace voxeld::client {

class ClientImpl {
 public:
  explicit ClientImpl(Settings settings);

  // Exchanges until the response is not 429, 503 or a refused connection, or no tries are left.
  // `body` is sent anew each time. Throws Error for any status but 2xx.
  HttpResponse call(HttpRequest request, const std::string& body = "",
                    const std::stop_token& stop = {});
  std::string url(std::string_view path) const { return settings_.url + std::string(path); }

  std::string upload(const Source& source, const ProgressCallback& progress,
                     const std::stop_token& stop);
  JobInfo submit(std::string_view kind, const Input& input, const Options& options);
  // POST /v1/jobs with this query.
  HttpResponse post_job(std::string_view kind, const Input& input, const Options& options,
                        std::string_view query);
  JobInfo wait(std::string_view id, const ProgressCallback& progress, const std::stop_token& stop);
  void download(std::string_view job, const Sink& sink, const ProgressCallback& progress,
                const std::stop_token& stop);
  JobInfo run(std::string_view kind, const Source& source, const Options& options, const Sink& sink,
              const ProgressCallback& progress, const std::stop_token& stop);

 private:
  // The id of the source's bytes, if the daemon has them under a name that is read likewise; else
  // "". Throws if it is stopped or the file cannot be read.
  std::string known_asset(const Source& source, const ProgressCallback& progress,
                          const std::stop_token& stop);
  // Uploads without asking.
  std::string send(const Source& source, const ProgressCallback& progress,
                   const std::stop_token& stop);
  [[noreturn]] void fail(const HttpResponse& response) const;
  // One long poll of a job. Repeated while the daemon is away, because a restarted daemon still has
  // its jobs. Status 304: nothing changed since `etag`.
  HttpResponse look(std::string_view job, const std::string& etag, const std::stop_token& stop);
  void pause(int attempt, const HttpResponse& response, const std::stop_token& stop) const;

  Settings settings_;
  Transport transport_;
};

}  // namespace voxeld::client
