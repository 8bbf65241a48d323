#include "server/http/server.h"

#include <algorithm>
#include <iterator>

#include "server/base/memory_reserve.h"
#include "server/http/access.h"
#include "server/http/admin.h"
#include "server/http/api.h"
#include "server/http/front.h"
#include "server/http/process_metrics.h"
#include "server/http/request_metrics.h"

namespace voxeld::http {
namespace {

constexpr int kAdminThreads = 2;

// Whether the answer may wait for a job or an event: by what the request looks like, before
// anybody knows whether its result is there already.
bool may_wait(const Head& head) {
  const std::string_view path = head.path;
  const auto has = [&](std::string_view part) { return path.find(part) != std::string_view::npos; };
  if (head.header("Prefer").find("wait=") != std::string_view::npos) return true;
  if (head.method == "POST") return path == "/v1/voxelize" || path == "/v1/render";
  if (head.method != "GET" && head.method != "HEAD") return false;
  const std::string_view accept = head.header("Accept");
  const bool converts = !head.query.empty() || (!accept.empty() && accept != "*/*");
  return path.ends_with("/events") || has("/render") || path.starts_with("/v1/assets/") ||
         (converts && (path.ends_with("/result") || has("/frames/") ||
                       path.starts_with("/v1/grids/") || path.starts_with("/v1/sequences/")));
}

// What a client asks for that has nothing here yet. Who has a job may look at it, fetch what is
// there and cancel it to the end; a GET that would start work is refused by the job service.
bool is_new_work(const Head& head) {
  return head.method != "GET" && head.method != "HEAD" && head.method != "OPTIONS" &&
         head.method != "DELETE";
}

// Reads and cancels go on.
Status check_memory(const Head& head) {
  if (!is_new_work(head) || memory_reserve_is_whole()) return {};
  return Error{ErrorCode::kQueueFull, "no new work is taken while memory is short", "", ""};
}

class HttpServer final : public Server {
 public:
  HttpServer(const ServerConfig& config, JobService& jobs, const KeyRing& keys,
             const UrlSecrets& secrets, const std::shared_ptr<prometheus::Registry>& registry)
      : config_(config),
        keys_(keys),
        guard_(config.origins, config.listen),
        admin_guard_(config.origins, config.admin_listen),
        access_(keys, secrets),
        api_{jobs, access_, config_},
        metrics_(registry),
        process_metrics_(registry) {
    add_one_shot_routes(router_, api_);
    add_asset_routes(router_, api_);
    add_job_routes(router_, api_);
    add_queue_routes(router_, api_);
    add_event_routes(router_, api_);
    add_result_routes(router_, api_);
    add_kept_routes(router_, api_);
    add_grid_routes(router_, api_);
    add_me_routes(router_, api_);
    add_share_routes(router_, api_);
    add_sequence_routes(router_, api_);
    add_index_routes(router_, api_);
    add_admin_routes(admin_router_, jobs, keys, registry, [this] {
      if (front_) metrics_.set_state(front_->state(), api_.subscribers);
      process_metrics_.refresh();
    });
  }
  ~HttpServer() override { (void)stop(0); }

  Status start() {
    FrontConfig front{config_.listen,
                      config_.request_threads,
                      config_.connections_max,
                      config_.connections_per_address,
                      config_.trusted_proxies,
                      may_wait,
                      is_new_work};
    VOXELD_ASSIGN(front_, start_front(
                              front, [this](Request& request) { return answer(request); },
                              [this](const ExchangeRecord& exchange) {
                                metrics_.record(exchange, exchange.route);
                              }));
    VOXELD_ASSIGN(admin_front_,
                  start_front(
                      {config_.admin_listen, kAdminThreads, config_.admin_connections_max},
                      [this](Request& request) { return answer_admin(request); },
                      [](const ExchangeRecord&) {}));
    return {};
  }

  int port() const override { return front_->port(); }
  int admin_port() const override { return admin_front_->port(); }

  std::vector<RunningRequest> stop(double seconds) override {
    api_.stopping = true;
    std::vector<RunningRequest> left;
    if (front_) left = front_->stop(seconds);
    if (admin_front_) std::ranges::move(admin_front_->stop(0.1), std::back_inserter(left));
    return left;
  }

 private:
  Response answer(Request& request) {
    Response response = answer_guarded(request);
    if (request.rate) add_rate_headers(*request.rate, response);
    if (request.is_negotiated) add_vary(response, "Accept");
    guard_.add_headers(request.head, response);
    return response;
  }

  Response answer_guarded(Request& request) {
    Status admitted = guard_.check(request.head, !keys_.needs_keys());
    if (admitted) {
      if (auto preflight = guard_.preflight(request.head)) return *std::move(preflight);
      admitted = access_.admit(request);
    }
    if (admitted) admitted = check_memory(request.head);
    if (!admitted) return problem(request, admitted.error());
    return router_.dispatch(request, &request.route);
  }

  // Its routes never need a key.
  Response answer_admin(Request& request) {
    if (Status checked = admin_guard_.check(request.head, /*is_open=*/true); !checked) {
      return problem(request, checked.error());
    }
    return admin_router_.dispatch(request, &request.route);
  }

  const ServerConfig config_;
  const KeyRing& keys_;
  const OriginGuard guard_, admin_guard_;
  Access access_;
  Api api_;
  RequestMetrics metrics_;
  ProcessMetrics process_metrics_;
  Router router_, admin_router_;
  std::unique_ptr<Front> front_, admin_front_;
};

}  // namespace

Result<std::unique_ptr<Server>> start_server(const ServerConfig& config, JobService& jobs,
                                             const KeyRing& keys, const UrlSecrets& secrets,
                                             const std::shared_ptr<prometheus::Registry>& metrics) {
  auto server = std::make_unique<HttpServer>(config, jobs, keys, secrets, metrics);
  VOXELD_TRY(server->start());
  return std::unique_ptr<Server>(std::move(server));
}

}  // namespace voxeld::http
