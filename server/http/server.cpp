#include "server/http/server.h"

#include <utility>

#include "server/http/access.h"
#include "server/http/admin.h"
#include "server/http/api.h"
#include "server/http/front.h"
#include "server/http/request_metrics.h"

namespace voxeld::http {
namespace {

constexpr int kAdminThreads = 2;
constexpr int kAdminConnectionsMax = 64;

// The pattern that the running request matched, for the observer that runs after it on the same
// thread.
thread_local std::string current_route;

class HttpServer final : public Server {
 public:
  HttpServer(const ServerConfig& config, JobService& jobs, const KeyRing& keys,
             const std::shared_ptr<prometheus::Registry>& registry)
      : config_(config), access_(keys), api_{jobs, access_, config_}, metrics_(registry) {
    add_one_shot_routes(router_, api_);
    add_asset_routes(router_, api_);
    add_job_routes(router_, api_);
    add_queue_routes(router_, api_);
    add_event_routes(router_, api_);
    add_result_routes(router_, api_);
    add_grid_routes(router_, api_);
    add_sequence_routes(router_, api_);
    add_index_routes(router_, api_);
    add_admin_routes(admin_router_, jobs, keys, registry, [this] {
      if (front_) metrics_.set_state(front_->state(), api_.subscribers);
    });
  }
  ~HttpServer() override { stop(0); }

  Status start() {
    VOXELD_ASSIGN(front_, start_front(
                              {config_.listen, config_.request_threads, config_.connections_max},
                              [this](Request& request) { return answer(request); },
                              [this](const ExchangeRecord& exchange) {
                                // Requests that no handler saw leave nothing behind.
                                metrics_.record(exchange, std::exchange(current_route, {}));
                              }));
    VOXELD_ASSIGN(admin_front_, start_front(
                                    {config_.admin_listen, kAdminThreads, kAdminConnectionsMax},
                                    [this](Request& request) {
                                      std::string route;
                                      return admin_router_.dispatch(request, &route);
                                    },
                                    [](const ExchangeRecord&) {}));
    return {};
  }

  int port() const override { return front_->port(); }
  int admin_port() const override { return admin_front_->port(); }

  void stop(double seconds) override {
    api_.stopping = true;
    if (front_) front_->stop(seconds);
    if (admin_front_) admin_front_->stop(0.1);
  }

 private:
  Response answer(Request& request) {
    current_route.clear();
    if (const Status admitted = access_.admit(request); !admitted) {
      return problem(request, admitted.error());
    }
    return router_.dispatch(request, &current_route);
  }

  const ServerConfig config_;
  const Access access_;
  Api api_;
  RequestMetrics metrics_;
  Router router_, admin_router_;
  std::unique_ptr<Front> front_, admin_front_;
};

}  // namespace

Result<std::unique_ptr<Server>> start_server(const ServerConfig& config, JobService& jobs,
                                             const KeyRing& keys,
                                             const std::shared_ptr<prometheus::Registry>& metrics) {
  auto server = std::make_unique<HttpServer>(config, jobs, keys, metrics);
  VOXELD_TRY(server->start());
  return std::unique_ptr<Server>(std::move(server));
}

}  // namespace voxeld::http
