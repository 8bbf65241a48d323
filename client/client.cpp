#include <algorithm>
#include <cstring>
#include <nlohmann/json.hpp>
#include <optional>

#include "client/client_impl.h"
#include "client/content_check.h"
#include "client/responses.h"
#include "proto/text/number_text.h"
#include "proto/text/percent_encoding.h"

namespace voxeld::client {
namespace {

std::string full_message(const std::string& message, const std::string& expected,
                         const std::string& got) {
  const std::string tail = (expected.empty() ? "" : "expected " + expected) +
                           (expected.empty() || got.empty() ? "" : ", ") +
                           (got.empty() ? "" : "got " + got);
  // A message that was passed on may have it already.
  if (tail.empty() || message.ends_with(tail)) return message;
  return message.empty() ? tail : message + ": " + tail;
}

// Voxelizes to the native container.
JobInfo voxelize_native(ClientImpl& daemon, const Source& source, const Options& options,
                        std::vector<std::byte>& container, const ProgressCallback& progress,
                        const std::stop_token& stop) {
  Options native = options;
  native.set("format", "native");
  return daemon.run("voxelize", source, native, appends_to(container), progress, stop);
}

}  // namespace

Error::Error(std::string code, int http_status, const std::string& message, std::string expected,
             std::string got, std::string request_id)
    : std::runtime_error(full_message(message, expected, got)),
      code_(std::move(code)),
      expected_(std::move(expected)),
      got_(std::move(got)),
      request_id_(std::move(request_id)),
      http_status_(http_status) {}
Error::~Error() = default;

Source Source::file(std::filesystem::path path, std::string filename) {
  Source source;
  source.filename_ = filename.empty() ? path.filename().string() : std::move(filename);
  source.path_ = std::move(path);
  return source;
}

Source Source::memory(std::vector<std::byte> bytes, std::string filename) {
  Source source;
  source.bytes_ = std::move(bytes);
  source.filename_ = std::move(filename);
  return source;
}

Source Source::stream(std::function<size_t(std::span<std::byte>)> read, std::string filename) {
  Source source;
  source.read_ = std::move(read);
  source.filename_ = std::move(filename);
  return source;
}

Source Source::bundle(std::vector<Source> files) {
  if (files.empty()) throw Error("file", 0, "a bundle without files");
  Source source;
  source.files_ = std::move(files);
  return source;
}

Client::Client(Settings settings) : impl_(std::make_shared<ClientImpl>(std::move(settings))) {}
Client::Client(std::string url)
    : Client([&] {
        Settings settings;
        settings.url = std::move(url);
        return settings;
      }()) {}
Client::Client(Client&&) noexcept = default;
Client& Client::operator=(Client&&) noexcept = default;
Client::~Client() = default;

Grid Client::voxelize(const Source& source, const Options& options,
                      const ProgressCallback& progress, const std::stop_token& stop) {
  std::vector<std::byte> container;
  const JobInfo job = voxelize_native(*impl_, source, options, container, progress, stop);
  return impl_->stored_grid(container, job.grid);
}

Sequence Client::voxelize_sequence(const Source& source, const Options& options,
                                   const ProgressCallback& progress, const std::stop_token& stop) {
  std::vector<std::byte> container;
  voxelize_native(*impl_, source, options, container, progress, stop);
  return Sequence::decode(std::move(container));
}

JobInfo Client::voxelize_to(const Source& source, const Options& options, const Sink& sink,
                            const ProgressCallback& progress, const std::stop_token& stop) {
  return impl_->run("voxelize", source, options, sink, progress, stop);
}

JobInfo Client::render_to(const Source& source, const Options& options, const Sink& sink,
                          const ProgressCallback& progress, const std::stop_token& stop) {
  return impl_->run("render", source, options, sink, progress, stop);
}

std::string Client::upload(const Source& source, const ProgressCallback& progress,
                           const std::stop_token& stop) {
  return impl_->upload(source, progress, stop);
}

std::string Client::bundle(std::span<const BundleFile> files) {
  return impl_->bundle(files, {});
}

std::string Client::asset_json(std::string_view asset) {
  HttpRequest request;
  request.url = impl_->url("/v1/assets/" + percent_encode(asset));
  return impl_->call(std::move(request)).body;
}

Job Client::start(const Source& source, const Options& options, const ProgressCallback& upload,
                  const std::stop_token& stop) {
  return {impl_, impl_->begin("voxelize", source, options, upload, stop)};
}

Job Client::start(std::string_view kind, const Input& input, const Options& options) {
  return {impl_, impl_->submit(kind, input, options)};
}

Job Client::attach(std::string_view id) {
  return {impl_, job(id)};
}

JobInfo Client::submit(std::string_view kind, const Input& input, const Options& options,
                       const std::stop_token& stop) {
  return impl_->submit(kind, input, options, stop);
}

std::string Client::estimate_json(std::string_view kind, const Input& input, const Options& options,
                                  const std::stop_token& stop) {
  return impl_->post_job(kind, input, options, "?dry_run=1", stop).body;
}

JobInfo Client::job(std::string_view id) {
  HttpRequest request;
  request.url = impl_->url("/v1/jobs/" + percent_encode(id));
  return job_info(parse_object(impl_->call(std::move(request)).body));
}

JobInfo Client::wait(std::string_view id, const ProgressCallback& progress,
                     const std::stop_token& stop) {
  return impl_->wait(percent_encode(id), progress, stop);
}

JobInfo Client::cancel(std::string_view id) {
  return impl_->cancel(percent_encode(id));
}

JobFrames Client::frames(std::string_view job) {
  HttpRequest request;
  request.url = impl_->url("/v1/jobs/" + percent_encode(job) + "/frames");
  return job_frames(parse_object(impl_->call(std::move(request)).body));
}

Grid Client::frame(std::string_view job, std::int64_t index) {
  HttpRequest request;
  request.url = impl_->url("/v1/jobs/" + percent_encode(job) + "/frames/" + std::to_string(index));
  const HttpResponse response = impl_->call(std::move(request));
  const auto bytes = std::as_bytes(std::span(response.body));
  const auto etag = response.headers.find("etag");
  ContentCheck check(etag == response.headers.end() ? std::string_view() : etag->second);
  check.add(bytes);
  check.finish("frame " + std::to_string(index) + " of the job " + std::string(job));
  return impl_->stored_grid(bytes, check.id());
}

void Client::tiles(std::string_view job, const TilesCallback& take, const std::stop_token& stop) {
  for (std::int64_t after = 0;;) {
    const HttpResponse response = impl_->tiles(percent_encode(job), after, stop);
    if (response.status == 204) return;
    if (response.status == 202) continue;
    const auto header = response.headers.find("x-voxeld-next");
    const auto next = header == response.headers.end() ? std::nullopt
                                                       : parse_number<std::int64_t>(header->second);
    if (!next || *next <= after) {
      throw Error("bad-response", response.status, "X-Voxeld-Next of tiles of the job",
                  "a number above " + std::to_string(after),
                  header == response.headers.end() ? "none" : "\"" + header->second + "\"");
    }
    if (!take(Grid::decode(std::as_bytes(std::span(response.body))))) return;
    after = *next;
  }
}

Queue Client::queue(int limit, const std::stop_token& stop) {
  HttpRequest request;
  request.url = impl_->url("/v1/queue?limit=" + std::to_string(limit));
  return queue_of(parse_object(impl_->call(std::move(request), "", stop).body));
}

std::vector<JobInfo> Client::jobs(int limit) {
  HttpRequest request;
  request.url = impl_->url("/v1/jobs?limit=" + std::to_string(limit));
  const nlohmann::json body = parse_object(impl_->call(std::move(request)).body);
  const auto list = body.find("jobs");
  if (list == body.end() || !list->is_array()) {
    throw Error("bad-response", 0,
                "the response is no list of jobs: is there a voxeld at this URL?");
  }
  std::vector<JobInfo> jobs;
  for (const auto& status : *list) jobs.push_back(job_info(status));
  return jobs;
}

void Client::download(std::string_view job, const Sink& sink, const ProgressCallback& progress,
                      const std::stop_token& stop) {
  impl_->download(percent_encode(job), sink, progress, stop);
}

Grid Client::grid(std::string_view id, const ProgressCallback& progress,
                  const std::stop_token& stop) {
  return impl_->grid(id, progress, stop);
}

Link Client::share(std::string_view job, std::chrono::seconds lifetime, const Options& options) {
  HttpRequest request;
  request.method = "POST";
  std::string query = "?seconds=" + std::to_string(lifetime.count());
  for (const auto& [name, value] : options.pairs()) {
    query += "&" + percent_encode(name) + "=" + percent_encode(value);
  }
  request.url = impl_->url("/v1/jobs/" + percent_encode(job) + "/share" + query);
  const nlohmann::json response = parse_object(impl_->call(std::move(request)).body);
  return {impl_->url(text_of(response, "url")), number_of(response, "expires_ms")};
}

std::string Client::remove(std::string_view id) {
  const auto call = [&](const std::string& target) {
    HttpRequest request;
    request.method = "DELETE";
    request.url = impl_->url(target);
    impl_->call(std::move(request));
  };
  if (id.starts_with("j-")) {
    call("/v1/jobs/" + percent_encode(id) + "/result");
    return "result";
  }
  // An id is a hash and does not say its kind, so all are tried.
  std::optional<Error> refused;
  for (const std::string_view kind : {"asset", "grid", "sequence"}) {
    try {
      call("/v1/" + std::string(kind) + "s/" + percent_encode(id));
      return std::string(kind);
    } catch (const Error& error) {
      if (error.code() != "not-found" && error.code() != "gone") throw;
      if (!refused || refused->code() == "not-found") refused = error;
    }
  }
  if (refused->code() != "not-found") throw *refused;
  throw Error("not-found", refused->http_status(), "no asset, grid or sequence has this id");
}

std::string Client::list_json(std::string_view what, int limit, std::string_view after) {
  HttpRequest request;
  request.url = impl_->url("/v1/" + percent_encode(what) + "?limit=" + std::to_string(limit) +
                           (after.empty() ? "" : "&after=" + percent_encode(after)));
  return impl_->call(std::move(request)).body;
}

std::string Client::whoami_json() {
  HttpRequest request;
  request.url = impl_->url("/v1/me");
  return impl_->call(std::move(request)).body;
}

}  // namespace voxeld::client
