#include "server/api/api_server.h"

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>

#include "server/api/access/access.h"
#include "server/api/admin.h"
#include "server/api/process_metrics.h"
#include "server/api/request_metrics.h"
#include "server/api/resources/api.h"
#include "server/api/router.h"
#include "server/api/routes.h"
#include "server/http/http_server.h"
#include "server/process/memory_reserve.h"

namespace voxeld::api {
namespace {

// New work is refused while memory is short; reads and cancels go on.
Status check_memory(bool is_new_work) {
  if (!is_new_work || memory_reserve_is_whole()) return {};
  return Error{ErrorCode::kQueueFull, "no new work is taken while memory is short", "", ""};
}

// Admits a request again once its body is whole: its key may have been revoked meanwhile.
class AdmittedBody final : public BodySink {
 public:
  AdmittedBody(const Access& access, std::unique_ptr<BodySink> sink)
      : access_(access), sink_(std::move(sink)) {}
  Status take(std::span<const uint8_t> piece) override { return sink_->take(piece); }
  Reply finish(Request& request) override {
    if (!access_.still_admits(request.key_id)) return problem(request, no_valid_key());
    return sink_->finish(request);
  }

 private:
  const Access& access_;
  const std::unique_ptr<BodySink> sink_;
};

Reply admitted_again(const Access& access, Reply reply) {
  if (auto* stream = std::get_if<StreamedBody>(&reply.next)) {
    stream->sink = std::make_unique<AdmittedBody>(access, std::move(stream->sink));
  } else if (auto* text = std::get_if<TextBody>(&reply.next)) {
    text->then = [&access, then = std::move(text->then)](Request& request, std::string body) {
      if (!access.still_admits(request.key_id)) return Reply(problem(request, no_valid_key()));
      return then(request, std::move(body));
    };
  }
  return reply;
}

class HttpApiServer final : public ApiServer {
 public:
  HttpApiServer(const ApiServerConfig& config, JobService& jobs, const KeyRing& keys,
                const UrlSecrets& secrets, const std::shared_ptr<prometheus::Registry>& registry)
      : config_(config),
        keys_(keys),
        guard_(config.origins, config.listen),
        admin_guard_(config.origins, config.admin_listen),
        access_(keys, secrets),
        api_{.jobs = jobs,
             .access = access_,
             .keys = keys,
             .waits = WaitLimit(config.connections_max),
             .web_dir = config.web_dir},
        metrics_(registry),
        process_metrics_(registry),
        router_(public_routes(api_, config.upload_bytes_max)),
        tell_health_(admin_handler(jobs, keys, registry, [this] { refresh_metrics(); })) {}
  ~HttpApiServer() override { (void)stop(0); }

  Status start() {
    http::HttpServerConfig config;
    config.listen = config_.listen;
    config.threads = config_.request_threads;
    config.connections_max = config_.connections_max;
    config.connections_per_address = config_.connections_per_address;
    config.trusted_proxies = config_.trusted_proxies;
    config.is_new_work = [this](const Head& head) { return is_new_work(head); };
    // Waits of keys that were revoked or have expired end.
    config.is_recheck_due = [this, seen = keys_.epoch()]() mutable {
      const auto before = std::exchange(seen, keys_.epoch());
      return seen != before;
    };
    config.held_files = config_.held_files;
    config.is_disk_short = [this] { return api_.jobs.is_disk_short(); };
    config.add_headers = [this](const Request& request, Response& response) {
      add_headers(request, response);
    };
    VOXELD_ASSIGN(server_, http::start_http_server(
                               config, [this](Request& request) { return handle(request); },
                               [this](const http::ExchangeRecord& exchange) {
                                 metrics_.record(exchange, exchange.route);
                               }));
    if (config_.admin_listen.empty()) return {};
    VOXELD_ASSIGN(
        health_server_,
        start_health_server({config_.admin_listen, config_.admin_connections_max, admin_paths()},
                            [this](const Head& head) { return handle_admin(head); }));
    return {};
  }

  int port() const override { return server_->port(); }
  int admin_port() const override { return health_server_ ? health_server_->port() : 0; }
  uint64_t admitted_requests() const override { return admitted_requests_; }
  bool is_busy() override { return server_->requests_in_flight() > 0; }

  std::vector<http::RunningRequest> stop(double seconds) override {
    api_.stopping = true;
    std::vector<http::RunningRequest> left;
    if (server_) left = server_->stop(seconds);
    if (health_server_) health_server_->stop();
    return left;
  }

 private:
  bool is_new_work(const Head& head) const {
    const Route* route = router_.find(head);
    return route != nullptr && route->work == Work::kNew;
  }

  void refresh_metrics() {
    if (server_) metrics_.set_state(server_->state(), api_.event_streams);
    process_metrics_.refresh();
  }

  Reply handle(Request& request) {
    const Route* route = router_.find(request.head);
    const bool is_public = route != nullptr && route->audience == Audience::kAnyone;
    Status admitted = guard_.check(request.head, !keys_.needs_keys());
    if (admitted) {
      if (auto preflight = guard_.preflight(request.head)) return *std::move(preflight);
      if (!is_public) admitted = access_.admit(request);
    }
    if (admitted) admitted = check_memory(route != nullptr && route->work == Work::kNew);
    if (!admitted) return problem(request, admitted.error());
    ++admitted_requests_;
    Reply reply = router_.dispatch(request);
    return request.key_id.empty() ? std::move(reply) : admitted_again(access_, std::move(reply));
  }

  void add_headers(const Request& request, Response& response) const {
    if (request.rate) add_rate_headers(*request.rate, response);
    if (request.is_negotiated) add_vary(response, "Accept");
    guard_.add_headers(request.head, response);
  }

  // The admin port needs no key.
  Response handle_admin(const Head& head) const {
    const Status checked = admin_guard_.check(head, /*is_open=*/true);
    return checked ? tell_health_(head) : Response::problem(checked.error(), head.path);
  }

  const ApiServerConfig config_;
  const KeyRing& keys_;
  const OriginGuard guard_, admin_guard_;
  Access access_;
  Api api_;
  RequestMetrics metrics_;
  ProcessMetrics process_metrics_;
  const Router router_;
  const HealthHandler tell_health_;
  std::atomic<uint64_t> admitted_requests_ = 0;
  std::unique_ptr<http::HttpServer> server_;
  std::unique_ptr<HealthServer> health_server_;
};

}  // namespace

Result<std::unique_ptr<ApiServer>> start_api_server(
    const ApiServerConfig& config, JobService& jobs, const KeyRing& keys, const UrlSecrets& secrets,
    const std::shared_ptr<prometheus::Registry>& metrics) {
  auto server = std::make_unique<HttpApiServer>(config, jobs, keys, secrets, metrics);
  VOXELD_TRY(server->start());
  return std::unique_ptr<ApiServer>(std::move(server));
}

}  // namespace voxeld::api
