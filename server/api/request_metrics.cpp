#include "server/api/request_metrics.h"

#include <prometheus/counter.h>
#include <prometheus/gauge.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>

#include <string>
#include <string_view>

#include "server/base/log.h"
#include "server/jobs/model/tenant_labels.h"

namespace voxeld::api {
namespace {

const prometheus::Histogram::BucketBoundaries kSeconds = {0.001, 0.01, 0.1, 0.5, 1, 5, 10, 60, 600};

// The path for the log, without a key that a client put into it.
std::string logged_path(std::string_view path) {
  constexpr size_t kBytesMax = 200;
  constexpr std::string_view kKeyBegin = "vxk_";
  const size_t key = path.find(kKeyBegin);
  if (key != std::string_view::npos) path = path.substr(0, key + kKeyBegin.size());
  return std::string(path.substr(0, kBytesMax));
}

}  // namespace

struct RequestMetrics::Impl {
  explicit Impl(prometheus::Registry& registry)
      : requests(prometheus::BuildCounter()
                     .Name("voxeld_http_requests_total")
                     .Help("Responses by route and status")
                     .Register(registry)),
        seconds(prometheus::BuildHistogram()
                    .Name("voxeld_http_request_seconds")
                    .Help("Time from the head of a request to the end of its response")
                    .Register(registry)),
        bytes(prometheus::BuildCounter()
                  .Name("voxeld_http_bytes_total")
                  .Help("Bytes of bodies by direction and tenant")
                  .Register(registry)),
        state(prometheus::BuildGauge()
                  .Name("voxeld_http_state")
                  .Help("Open connections, requests on a thread, requests that wait, event streams")
                  .Register(registry)) {}

  void add_bytes(const char* direction, const std::string& tenant, int64_t count) {
    prometheus::Labels labels = {{"direction", direction}};
    if (!tenant.empty()) labels["tenant"] = tenants.of(tenant);
    bytes.Add(labels).Increment(static_cast<double>(count));
  }

  prometheus::Family<prometheus::Counter>& requests;
  prometheus::Family<prometheus::Histogram>& seconds;
  prometheus::Family<prometheus::Counter>& bytes;
  prometheus::Family<prometheus::Gauge>& state;
  TenantLabels tenants;
};

RequestMetrics::RequestMetrics(const std::shared_ptr<prometheus::Registry>& registry) {
  if (registry) impl_ = std::make_unique<Impl>(*registry);
}
RequestMetrics::~RequestMetrics() = default;

void RequestMetrics::record(const http::ExchangeRecord& exchange, const std::string& route) {
  const std::string method = exchange.head->method.empty() ? "-" : exchange.head->method;
  log::info("request", {{"id", exchange.request_id},
                        {"trace", exchange.trace_id},
                        {"peer", exchange.peer},
                        {"tenant", exchange.tenant},
                        {"key", exchange.key_id},
                        {"method", method.substr(0, 20)},
                        {"path", logged_path(exchange.head->path)},
                        {"status", exchange.status},
                        {"in", static_cast<long>(exchange.bytes_in)},
                        {"out", static_cast<long>(exchange.bytes_out)},
                        {"ms", exchange.ms}});
  if (!impl_) return;
  const std::string name = route.empty() ? "other" : route;
  impl_->requests.Add({{"route", name}, {"status", std::to_string(exchange.status)}}).Increment();
  impl_->seconds.Add({{"route", name}}, kSeconds).Observe(exchange.ms / 1000);
  impl_->add_bytes("in", exchange.tenant, exchange.bytes_in);
  impl_->add_bytes("out", exchange.tenant, exchange.bytes_out);
}

void RequestMetrics::set_state(const http::HttpServerState& state, int event_streams) {
  if (!impl_) return;
  impl_->state.Add({{"what", "connections"}}).Set(static_cast<double>(state.connections));
  impl_->state.Add({{"what", "running"}}).Set(static_cast<double>(state.requests_running));
  impl_->state.Add({{"what", "event_streams"}}).Set(event_streams);
  impl_->state.Add({{"what", "waiting"}}).Set(static_cast<double>(state.requests_waiting));
}

}  // namespace voxeld::api
