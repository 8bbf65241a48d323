#include "client/client_impl.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <random>
#include <thread>

#include "client/content_check.h"
#include "client/grid_impl.h"
#include "client/responses.h"
#include "client/source_reader.h"
#include "proto/asset_id.h"
#include "proto/messages/job.h"
#include "proto/text/hex.h"
#include "proto/text/percent_encoding.h"

namespace voxeld::client {
namespace {

using Json = nlohmann::json;
using namespace std::chrono_literals;

constexpr auto kPauseFirst = 200ms;
constexpr int kPauseDoublings = 6;
constexpr std::chrono::milliseconds kPauseMax = 10s;  // the limit of a pause that begins at 200 ms
                                                      // and doubles
// A smaller source is sent without asking whether the daemon has it: that takes as long.
constexpr long long kAskedBytesMin = 64LL * 1024;
constexpr size_t kHashedBytes = size_t{1} << 20;  // at a time
// The time of one long poll: progress is reported at least this often.
constexpr std::chrono::seconds kPollTime = 2s;
// Least tries, some 30 s, of a wait for a job: it survives a restart of the daemon, and so does who
// waits for it.
constexpr int kWaitRetries = 8;
// A daemon that hangs must not keep its caller from giving up.
constexpr std::chrono::seconds kCancelTime = 10s;
const std::string kIdempotencyKey = "Idempotency-Key: ";

bool is_good(const HttpResponse& response) {
  return response.failure == HttpResponse::Failure::kNone && response.status / 100 == 2;
}

std::string header_of(const HttpResponse& response, const std::string& name) {
  const auto it = response.headers.find(name);
  return it == response.headers.end() ? std::string() : it->second;
}

// Whether nothing was done and a later try may succeed.
bool is_busy(const HttpResponse& response) {
  return response.failure == HttpResponse::Failure::kUnreachable ||
         (response.failure == HttpResponse::Failure::kNone &&
          (response.status == 429 || response.status == 503));
}

// Whether the daemon may have taken the request, but its response was lost: here, or by a proxy. A
// 504 of the daemon's own has a code.
bool is_lost(const HttpResponse& response) {
  if (response.failure != HttpResponse::Failure::kNone) {
    return response.failure == HttpResponse::Failure::kBroken;
  }
  return (response.status == 502 || response.status == 504) &&
         !header_of(response, "content-type").starts_with("application/problem+json");
}

// Whether it may be sent again where its response was lost: it reads, or the daemon knows it again.
bool is_repeatable(const HttpRequest& request) {
  return request.method == "GET" || std::ranges::any_of(request.headers, [](const auto& header) {
           return header.starts_with(kIdempotencyKey);
         });
}

std::string random_key() {
  std::random_device random;
  std::string key;
  for (int i = 0; i < 16; ++i) append_hex(key, static_cast<uint8_t>(random()));
  return key;
}

// Refuses a key with a line feed or the like, which would add a header of its own.
const std::string& checked_key(const std::string& key) {
  if (std::ranges::all_of(key, [](char c) { return c > ' ' && c < 0x7f; })) return key;
  throw Error("invalid-option", 0, "the API key holds characters that no key has");
}

// Whether an asset that the daemon had when it was asked may have been deleted meanwhile.
bool is_gone(const Error& error) {
  return error.code() == "gone" || error.code() == "not-found";
}

Error interrupted() {
  return Error("interrupted", 0, "stopped by the caller");
}

// Counts frames of a sequence, tiles of a grid.
Progress progress_of(const JobInfo& info) {
  const std::string stage = info.state == "queued" ? "queued" : info.stage;
  if (info.frames_total > 0) return {stage, info.frames_done, info.frames_total, "frames"};
  return {stage, info.tiles_done, info.tiles_total, "tiles"};
}

Error job_error(const JobInfo& info) {
  const Json error = parse_object(info.json).value("error", Json::object());
  const std::string code = text_of(error, "code"), detail = text_of(error, "detail");
  return Error(code.empty() ? info.state : code, info_of(error_code_from_name(code)).http_status,
               detail.empty() ? "the job " + info.id + " was " + info.state : detail,
               text_of(error, "expected"), text_of(error, "got"));
}

// Checks a resumed download: the next bytes must continue after `done`, in the same result.
void check_resumed(const HttpResponse& head, long long done, const std::string& etag) {
  const std::string start = "bytes " + std::to_string(done) + "-";
  const std::string range = header_of(head, "content-range"), now = header_of(head, "etag");
  if (head.status == 206 && range.starts_with(start) && (now.empty() || now == etag)) return;
  throw Error("bad-response", head.status,
              "the result changed while it was downloaded, what came so far is of no use",
              "status 206 with " + start + " of " + etag,
              "status " + std::to_string(head.status) + (range.empty() ? "" : " with " + range) +
                  (now.empty() ? "" : " of " + now));
}

}  // namespace

Sink appends_to(std::vector<std::byte>& bytes) {
  return [&bytes](std::span<const std::byte> piece) {
    bytes.insert(bytes.end(), piece.begin(), piece.end());
  };
}

void check_done(const JobInfo& job) {
  if (job.state != "done") throw job_error(job);
}

ClientImpl::ClientImpl(Settings settings)
    : settings_(std::move(settings)),
      transport_(settings_.connect_timeout, settings_.timeout, checked_key(settings_.key)) {
  while (settings_.url.ends_with('/')) settings_.url.pop_back();
}

void ClientImpl::fail(const HttpResponse& response) const {
  switch (response.failure) {
    case HttpResponse::Failure::kUnreachable:
      throw Error("unreachable", 0, settings_.url + ": " + response.failure_text);
    case HttpResponse::Failure::kTimeout:
      throw Error("timeout", response.status, settings_.url + ": " + response.failure_text);
    case HttpResponse::Failure::kInterrupted:
      throw interrupted();
    case HttpResponse::Failure::kBroken:
      throw Error("unreachable", response.status, settings_.url + ": " + response.failure_text);
    case HttpResponse::Failure::kNone:
      break;
  }
  const Json problem = Json::parse(response.body, nullptr, false);
  if (!problem.is_object() || text_of(problem, "code").empty()) {
    throw Error(response.status == 413 ? "payload-too-large" : "bad-response", response.status,
                settings_.url + ": status " + std::to_string(response.status));
  }
  throw Error(text_of(problem, "code"), response.status, text_of(problem, "detail"),
              text_of(problem, "expected"), text_of(problem, "got"),
              header_of(response, "x-request-id"));
}

void ClientImpl::pause(int attempt, const HttpResponse& response,
                       const std::stop_token& stop) const {
  auto wait = attempt < kPauseDoublings ? kPauseFirst * (1 << attempt) : kPauseMax;
  const std::string after = header_of(response, "retry-after");
  if (!after.empty() && after.find_first_not_of("0123456789") == std::string::npos) {
    const long seconds = std::strtol(after.c_str(), nullptr, 10);
    wait = std::chrono::seconds(std::min<long>(seconds, kPauseMax / 1s));
  }
  const auto until = std::chrono::steady_clock::now() + wait;
  while (std::chrono::steady_clock::now() < until) {
    if (stop.stop_requested()) throw interrupted();
    std::this_thread::sleep_for(20ms);
  }
}

HttpResponse ClientImpl::call(HttpRequest request, const std::string& body,
                              const std::stop_token& stop) {
  if (!request.keep_going) request.keep_going = [&] { return !stop.stop_requested(); };
  for (int attempt = 0;; ++attempt) {
    auto reader = text_reader(body);
    if (!body.empty()) {
      request.body = reader.read;
      request.body_bytes = reader.bytes;
    }
    HttpResponse response = transport_.exchange(request);
    const bool is_away = is_busy(response) || (is_lost(response) && is_repeatable(request));
    if (is_away && attempt < settings_.retries) {
      pause(attempt, response, stop);
      continue;
    }
    if (!is_good(response)) fail(response);
    return response;
  }
}

std::string ClientImpl::known_asset(const Source& source, const ProgressCallback& progress,
                                    const std::stop_token& stop) {
  if (source.read_ || !source.files_.empty()) return "";
  const SourceReader reader =
      source.path_.empty() ? memory_reader(source.bytes_) : file_reader(source.path_);
  if (reader.bytes.value_or(0) < kAskedBytesMin) return "";
  ContentHash hash;
  long long hashed = 0;
  std::vector<std::byte> buffer(kHashedBytes);
  while (const size_t count = reader.read(buffer)) {
    hash.add(std::span(buffer).first(count));
    hashed += static_cast<long long>(count);
    const bool goes_on = !progress || progress({"hash", hashed, *reader.bytes, "bytes"});
    if (!goes_on || stop.stop_requested()) throw interrupted();
  }
  const std::string id = "sha256-" + hash.finish();
  HttpRequest request;
  request.url = url("/v1/assets/" + id + "?brief=1");
  request.keep_going = [&] { return !stop.stop_requested(); };
  const HttpResponse response = transport_.exchange(request);
  if (stop.stop_requested()) throw interrupted();
  const Json asset = Json::parse(response.body, nullptr, false);
  if (!is_good(response) || !asset.is_object()) return "";
  const bool is_same = reading_of(text_of(asset, "filename")) == reading_of(source.filename_);
  return is_same ? text_of(asset, "id") : "";
}

std::string ClientImpl::upload(const Source& source, const ProgressCallback& progress,
                               const std::stop_token& stop) {
  std::string known = known_asset(source, progress, stop);
  return known.empty() ? send(source, progress, stop) : known;
}

std::string ClientImpl::bundle(std::span<const BundleFile> files, const std::stop_token& stop) {
  Json list = Json::array();
  for (const BundleFile& file : files) list.push_back({{"name", file.name}, {"asset", file.asset}});
  HttpRequest request;
  request.method = "POST";
  request.url = url("/v1/assets");
  request.headers = {"Content-Type: application/vnd.voxeld.bundle+json"};
  const std::string body =
      Json{{"files", list}}.dump(-1, ' ', false, Json::error_handler_t::replace);
  std::string id = text_of(parse_object(call(std::move(request), body, stop).body), "id");
  if (!id.empty()) return id;
  throw Error("bad-response", 0,
              "the response to the bundle names no asset: is there a voxeld at this URL?");
}

std::string ClientImpl::send_bundle(std::span<const Source> sources,
                                    const ProgressCallback& progress, const std::stop_token& stop) {
  // Of all files. Nobody knows how much a stream has.
  long long done = 0, total = 0;
  bool is_stream = false;
  const auto bytes_of = [](const Source& source) {
    std::error_code missing;  // reported when it is read
    const auto bytes = source.path_.empty() ? source.bytes_.size()
                                            : std::filesystem::file_size(source.path_, missing);
    return missing ? 0 : static_cast<long long>(bytes);
  };
  for (const Source& source : sources) {
    is_stream = is_stream || source.read_;
    total += bytes_of(source);
  }
  if (is_stream) total = 0;
  ProgressCallback of_all;
  if (progress) {
    of_all = [&](const Progress& file) {
      return progress({file.stage, done + file.done, total, file.unit});
    };
  }
  std::vector<BundleFile> files;
  for (const Source& source : sources) {
    files.push_back({source.filename_, upload(source, of_all, stop)});
    done += bytes_of(source);
  }
  try {
    return bundle(files, stop);
  } catch (const Error& error) {
    if (!is_gone(error) || is_stream) throw;
  }
  done = 0;
  for (size_t i = 0; i < files.size(); ++i) {
    files[i].asset = send(sources[i], of_all, stop);
    done += bytes_of(sources[i]);
  }
  return bundle(files, stop);
}

std::string ClientImpl::send(const Source& source, const ProgressCallback& progress,
                             const std::stop_token& stop) {
  if (!source.files_.empty()) return send_bundle(source.files_, progress, stop);
  const bool repeatable = !source.read_;
  bool stopped = false;
  for (int attempt = 0;; ++attempt) {
    SourceReader reader = source.read_            ? SourceReader{source.read_, std::nullopt}
                          : !source.path_.empty() ? file_reader(source.path_)
                                                  : memory_reader(source.bytes_);
    long long sent = 0;
    HttpRequest request;
    request.method = "POST";
    request.url = url("/v1/assets");
    if (!source.filename_.empty()) {
      request.url += "?filename=" + percent_encode(source.filename_);
    }
    request.headers = {"Content-Type: application/octet-stream"};
    request.body_bytes = reader.bytes;
    request.body = [&](std::span<std::byte> buffer) {
      const size_t count = reader.read(buffer);
      sent += static_cast<long long>(count);
      // The daemon would wait for the rest.
      if (count == 0 && sent < reader.bytes.value_or(0)) {
        throw Error("file", 0, source.path_.string() + ": cannot be read to its end",
                    std::to_string(*reader.bytes) + " bytes", std::to_string(sent));
      }
      return count;
    };
    request.keep_going = [&] {
      stopped = stopped || stop.stop_requested() ||
                (progress && !progress({"upload", sent, reader.bytes.value_or(0), "bytes"}));
      return !stopped;
    };
    const HttpResponse response = transport_.exchange(request);
    if (stopped) throw interrupted();
    const bool is_away = is_busy(response) || is_lost(response);
    if (is_away && (repeatable || sent == 0) && attempt < settings_.retries) {
      pause(attempt, response, stop);
      continue;
    }
    if (!is_good(response)) fail(response);
    std::string id = text_of(parse_object(response.body), "id");
    if (id.empty()) {
      throw Error("bad-response", response.status,
                  "the response to the upload names no asset: is there a voxeld at this URL?");
    }
    return id;
  }
}

HttpResponse ClientImpl::post_job(std::string_view kind, const Input& input, const Options& options,
                                  std::string_view query, const std::stop_token& stop) {
  Json body = {{"kind", kind}, {"options", Json::object()}};
  if (!input.asset.empty()) body["asset"] = input.asset;
  if (!input.grid.empty()) body["grid"] = input.grid;
  if (!input.sequence.empty()) body["sequence"] = input.sequence;
  for (const auto& [name, value] : options.pairs()) {
    if (name == "filename") {
      body["filename"] = value;
    } else if (name == "priority" || name == "deadline_ms") {
      // Members of the job, as integers. The daemon reports the error of other values.
      const Json number = Json::parse(value, nullptr, false);
      body[name] = number.is_number() ? number : Json(value);
    } else {
      body["options"][name] = value;
    }
  }
  HttpRequest request;
  request.method = "POST";
  request.url = url("/v1/jobs") + std::string(query);
  request.headers = {"Content-Type: application/json"};
  if (query.empty()) request.headers.push_back(kIdempotencyKey + random_key());
  request.keep_going = [] { return true; };
  // File names need not be UTF-8, but JSON must be.
  const std::string text = body.dump(-1, ' ', false, Json::error_handler_t::replace);
  return call(std::move(request), text, stop);
}

JobInfo ClientImpl::submit(std::string_view kind, const Input& input, const Options& options,
                           const std::stop_token& stop) {
  return job_info(parse_object(post_job(kind, input, options, "", stop).body));
}

int ClientImpl::wait_retries() const {
  return settings_.retries == 0 ? 0 : std::max(settings_.retries, kWaitRetries);
}

HttpResponse ClientImpl::poll(HttpRequest request, std::chrono::seconds time, int retries,
                              const std::stop_token& stop) {
  if (time > 0s) request.headers.push_back("Prefer: wait=" + std::to_string(time.count()));
  request.held = time;
  request.keep_going = [&] { return !stop.stop_requested(); };
  for (int attempt = 0;; ++attempt) {
    HttpResponse response = transport_.exchange(request);
    if (stop.stop_requested()) throw interrupted();
    const bool is_away = is_busy(response) || is_lost(response);
    if (is_away && attempt < retries) {
      pause(attempt, response, stop);
      continue;
    }
    return response;
  }
}

HttpResponse ClientImpl::look(std::string_view job, const std::string& etag,
                              std::chrono::seconds time, int retries, const std::stop_token& stop) {
  HttpRequest request;
  request.url = url("/v1/jobs/" + std::string(job));
  // With an ETag the daemon responds at the next change; the short wait allows progress in between.
  if (!etag.empty()) request.headers.push_back("If-None-Match: " + etag);
  HttpResponse response = poll(std::move(request), time, retries, stop);
  const bool is_unchanged =
      response.failure == HttpResponse::Failure::kNone && response.status == 304 && !etag.empty();
  if (!is_good(response) && !is_unchanged) fail(response);
  return response;
}

HttpResponse ClientImpl::tiles(std::string_view job, std::int64_t after,
                               const std::stop_token& stop) {
  HttpRequest request;
  request.url = url("/v1/jobs/" + std::string(job) + "/tiles?after=" + std::to_string(after));
  HttpResponse response = poll(std::move(request), kPollTime, wait_retries(), stop);
  if (!is_good(response)) fail(response);
  return response;
}

JobInfo ClientImpl::look_for(std::string_view id, std::chrono::seconds time,
                             const std::stop_token& stop) {
  return job_info(
      parse_object(look(id, "", std::min(time, kPollTime), settings_.retries, stop).body));
}

HttpRequest ClientImpl::cancel_request(std::string_view id) const {
  HttpRequest request;
  request.method = "DELETE";
  request.url = url("/v1/jobs/" + std::string(id));
  const auto until = std::chrono::steady_clock::now() + kCancelTime;
  request.keep_going = [until] { return std::chrono::steady_clock::now() < until; };
  return request;
}

JobInfo ClientImpl::cancel(std::string_view id) {
  try {
    return job_info(parse_object(call(cancel_request(id)).body));
  } catch (const Error& error) {
    if (error.code() != "interrupted") throw;
    throw Error("timeout", 0,
                settings_.url + ": no response to the cancellation in " +
                    std::to_string(kCancelTime.count()) + " s");
  }
}

JobInfo ClientImpl::wait_end(std::string_view id, const ProgressCallback& progress,
                             const std::stop_token& stop) {
  std::string etag;
  JobInfo info;
  do {
    const HttpResponse response = look(id, etag, kPollTime, wait_retries(), stop);
    if (response.status != 304) {
      etag = header_of(response, "etag");
      info = job_info(parse_object(response.body));
    }
    // Called also without a change, so that the callback can stop a stalled job.
    if (progress && !progress(progress_of(info))) throw interrupted();
  } while (!info.ended());
  return info;
}

JobInfo ClientImpl::wait(std::string_view id, const ProgressCallback& progress,
                         const std::stop_token& stop) {
  JobInfo info = wait_end(id, progress, stop);
  check_done(info);
  return info;
}

void ClientImpl::download(std::string_view job, const Sink& sink, const ProgressCallback& progress,
                          const std::stop_token& stop) {
  fetch("/v1/jobs/" + std::string(job) + "/result", "the result of the job " + std::string(job),
        sink, progress, stop);
}

Grid ClientImpl::grid(std::string_view id, const ProgressCallback& progress,
                      const std::stop_token& stop) {
  std::vector<std::byte> container;
  fetch("/v1/grids/" + percent_encode(id), "the grid " + std::string(id), appends_to(container),
        progress, stop);
  return stored_grid(container, std::string(id));
}

Grid ClientImpl::stored_grid(std::span<const std::byte> container, std::string id) const {
  Grid grid = Grid::decode(container);
  grid.impl_->id = std::move(id);
  grid.impl_->daemon = settings_;
  return grid;
}

void ClientImpl::fetch(std::string_view path, std::string_view what, const Sink& sink,
                       const ProgressCallback& progress, const std::stop_token& stop) {
  long long done = 0, total = 0;
  std::string etag;
  std::optional<ContentCheck> check;
  long long resumed_at = 0;
  for (int attempt = 0;; ++attempt) {
    if (done > resumed_at) {  // the tries are for each byte at which it breaks
      resumed_at = done;
      attempt = 0;
    }
    HttpRequest request;
    request.url = url(path);
    if (done > 0) {
      request.headers = {"Range: bytes=" + std::to_string(done) + "-", "If-Range: " + etag};
    }
    bool stopped = false;
    request.sink = [&](std::span<const std::byte> piece) {
      if (check) check->add(piece);
      sink(piece);
      done += static_cast<long long>(piece.size());
    };
    request.on_head = [&](const HttpResponse& head) {
      if (head.status / 100 != 2) return;
      if (done > 0) return check_resumed(head, done, etag);
      etag = header_of(head, "etag");
      check.emplace(etag);
      total = std::strtoll(header_of(head, "content-length").c_str(), nullptr, 10);
    };
    request.keep_going = [&] {
      stopped = stopped || stop.stop_requested() ||
                (progress && !progress({"download", done, total, "bytes"}));
      return !stopped;
    };
    const HttpResponse response = transport_.exchange(request);
    if (stopped) throw interrupted();
    if (is_good(response)) {
      if (check) check->finish(what);
      return;
    }
    const bool resumable = is_busy(response) || is_lost(response);
    if (!resumable || attempt >= settings_.retries || (done > 0 && etag.empty())) fail(response);
    pause(attempt, response, stop);
  }
}

JobInfo ClientImpl::begin(std::string_view kind, const Source& source, const Options& options,
                          const ProgressCallback& progress, const std::stop_token& stop) {
  const std::string known = known_asset(source, progress, stop);
  const std::string asset = known.empty() ? send(source, progress, stop) : known;
  Options named = options;
  if (!source.filename().empty() && !named.has("filename")) {
    named.set("filename", source.filename());
  }
  try {
    return submit(kind, Input::of_asset(asset), named, stop);
  } catch (const Error& error) {
    if (known.empty() || !is_gone(error)) throw;
  }
  return submit(kind, Input::of_asset(send(source, progress, stop)), named, stop);
}

JobInfo ClientImpl::finish(JobInfo job, const Sink& sink, const ProgressCallback& progress,
                           const std::stop_token& stop) {
  const auto give_up = [&] { (void)transport_.exchange(cancel_request(job.id)); };
  try {
    job = wait(job.id, progress, stop);
  } catch (const Error& error) {
    if (error.code() == "interrupted") give_up();
    throw;
  } catch (...) {  // from the progress callback: nobody waits for the result any more
    give_up();
    throw;
  }
  download(job.id, sink, progress, stop);
  return job;
}

JobInfo ClientImpl::run(std::string_view kind, const Source& source, const Options& options,
                        const Sink& sink, const ProgressCallback& progress,
                        const std::stop_token& stop) {
  return finish(begin(kind, source, options, progress, stop), sink, progress, stop);
}

}  // namespace voxeld::client
