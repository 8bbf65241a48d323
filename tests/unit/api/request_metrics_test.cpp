// /metrics: a document that a scraper can read, with the right counts in it.
#include "server/api/request_metrics.h"

#include <gtest/gtest.h>
#include <prometheus/registry.h>
#include <prometheus/text_serializer.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "server/api/process_metrics.h"
#include "tests/unit/api/api_server_fixture.h"

namespace voxeld::api {
namespace {

// Samples by "name{labels}", as they stand in the text.
using Samples = std::map<std::string, double>;

// The name of the family that a sample belongs to.
std::string family_of(const std::string& sample, const std::map<std::string, std::string>& types) {
  if (types.count(sample) != 0) return sample;
  for (const std::string suffix : {"_bucket", "_sum", "_count"}) {
    if (!sample.ends_with(suffix)) continue;
    const std::string family = sample.substr(0, sample.size() - suffix.size());
    const auto it = types.find(family);
    if (it != types.end() && (it->second == "histogram" || it->second == "summary")) return family;
  }
  return "";
}

// Reads the text format 0.0.4 of Prometheus, line by line, and fails the test where a line is none:
// every family has one HELP and one TYPE before its samples, and stands in one piece.
Samples parse(const std::string& text) {
  static const std::regex help(R"(# HELP ([a-zA-Z_:][a-zA-Z0-9_:]*) .+)");
  static const std::regex type(
      R"(# TYPE ([a-zA-Z_:][a-zA-Z0-9_:]*) (counter|gauge|histogram|summary|untyped))");
  static const std::string label = R"re([a-zA-Z_][a-zA-Z0-9_]*="(?:[^"\\\n]|\\["\\n])*")re";
  static const std::regex sample("([a-zA-Z_:][a-zA-Z0-9_:]*)(\\{" + label + "(?:," + label +
                                 ")*\\})? ([^ ]+)( [0-9]+)?");
  Samples samples;
  std::map<std::string, std::string> types;
  std::set<std::string> helps;
  std::string current;
  EXPECT_TRUE(text.empty() || text.ends_with('\n'));
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    std::smatch match;
    if (std::regex_match(line, match, help)) {
      EXPECT_TRUE(helps.insert(match[1]).second) << "second HELP: " << line;
    } else if (std::regex_match(line, match, type)) {
      EXPECT_TRUE(types.emplace(match[1], match[2]).second) << "second TYPE: " << line;
      current = match[1];
    } else if (std::regex_match(line, match, sample)) {
      EXPECT_FALSE(current.empty()) << "before any TYPE: " << line;
      EXPECT_EQ(family_of(match[1], types), current) << "outside its family: " << line;
      char* end = nullptr;
      const std::string number = match[3];
      const double value = std::strtod(number.c_str(), &end);
      EXPECT_EQ(*end, '\0') << "no number: " << line;
      EXPECT_TRUE(samples.emplace(match[1].str() + match[2].str(), value).second)
          << "stands twice: " << line;
    } else {
      ADD_FAILURE() << "no line of the format: " << line;
    }
  }
  for (const auto& [name, unused] : types) EXPECT_EQ(helps.count(name), 1u) << name;
  return samples;
}

// Buckets grow with their bound, and the last one is the count.
void expect_histogram(const Samples& samples, const std::string& name, const std::string& label) {
  std::map<double, double> buckets;
  for (const auto& [key, value] : samples) {
    const std::string prefix = name + "_bucket{" + label + ",le=\"";
    if (key.starts_with(prefix)) buckets[std::strtod(key.c_str() + prefix.size(), nullptr)] = value;
  }
  ASSERT_GE(buckets.size(), 2u) << name << label;
  double before = 0;
  for (const auto& [bound, value] : buckets) {
    EXPECT_GE(value, before) << "bucket " << bound;
    before = value;
  }
  EXPECT_TRUE(std::isinf(buckets.rbegin()->first));
  EXPECT_EQ(before, samples.at(name + "_count{" + label + "}"));
}

std::string requests(const std::string& route, int status) {
  return "voxeld_http_requests_total{route=\"" + route + "\",status=\"" + std::to_string(status) +
         "\"}";
}

class RequestMetricsTest : public ::testing::Test {
 protected:
  void record(const std::string& route, int status, double ms, int64_t in = 0, int64_t out = 0,
              const std::string& tenant = "") {
    Head head;
    head.method = "GET";
    head.path = "/x";
    http::ExchangeRecord exchange;
    exchange.head = &head;
    exchange.status = status;
    exchange.ms = ms;
    exchange.bytes_in = in;
    exchange.bytes_out = out;
    exchange.tenant = tenant;
    metrics_.record(exchange, route);
  }
  std::string text() const { return prometheus::TextSerializer().Serialize(registry_->Collect()); }

  std::shared_ptr<prometheus::Registry> registry_ = std::make_shared<prometheus::Registry>();
  RequestMetrics metrics_{registry_};
};

TEST_F(RequestMetricsTest, exchanges_are_counted_by_route_and_status) {
  record("/v1/jobs/{id}", 200, 5, 10, 100);
  record("/v1/jobs/{id}", 200, 500, 1, 1000);
  record("/v1/jobs/{id}", 404, 1, 0, 7);
  record("", 404, 1);
  const Samples samples = parse(text());
  EXPECT_EQ(samples.at(requests("/v1/jobs/{id}", 200)), 2);
  EXPECT_EQ(samples.at(requests("/v1/jobs/{id}", 404)), 1);
  EXPECT_EQ(samples.at(requests("other", 404)), 1);
  EXPECT_EQ(samples.at("voxeld_http_bytes_total{direction=\"in\"}"), 11);
  EXPECT_EQ(samples.at("voxeld_http_bytes_total{direction=\"out\"}"), 1107);
  const std::string histogram = "voxeld_http_request_seconds", label = "route=\"/v1/jobs/{id}\"";
  expect_histogram(samples, histogram, label);
  EXPECT_EQ(samples.at(histogram + "_count{" + label + "}"), 3);
  EXPECT_NEAR(samples.at(histogram + "_sum{" + label + "}"), 0.506, 1e-9);
  EXPECT_EQ(samples.at(histogram + "_bucket{" + label + ",le=\"0.01\"}"), 2);
}

TEST_F(RequestMetricsTest, after_200_tenants_there_are_no_more_labels) {
  for (int i = 0; i < 202; ++i) record("/a", 200, 1, 10, 1, "t" + std::to_string(i));
  const Samples samples = parse(text());
  const std::string in = "voxeld_http_bytes_total{direction=\"in\",tenant=";
  EXPECT_EQ(samples.at(in + "\"t199\"}"), 10);
  EXPECT_EQ(samples.at(in + "\"(other)\"}"), 20);
  EXPECT_EQ(samples.count(in + "\"t200\"}"), 0u);
}

TEST(ProcessMetrics, tell_of_this_process) {
  const auto registry = std::make_shared<prometheus::Registry>();
  ProcessMetrics metrics(registry);
  metrics.refresh();
  const auto read = [&] {
    return parse(prometheus::TextSerializer().Serialize(registry->Collect()));
  };
  const Samples before = read();
  EXPECT_GT(before.at("process_resident_memory_bytes"), 1e6);
  EXPECT_GE(before.at("process_threads"), 1);
  EXPECT_GT(before.at("process_max_fds"), before.at("process_open_fds"));
  EXPECT_GT(before.at("process_start_time_seconds"), 1.7e9);
  EXPECT_GT(before.at("process_cpu_seconds_total"), 0);
  const int opened = ::dup(0);
  ASSERT_GE(opened, 0);
  metrics.refresh();
  EXPECT_EQ(read().at("process_open_fds"), before.at("process_open_fds") + 1);
  ::close(opened);
}

TEST_F(RequestMetricsTest, the_state_is_the_last_one_that_was_set) {
  metrics_.set_state({7, 3}, 2);
  metrics_.set_state({5, 1}, 0);
  const Samples samples = parse(text());
  EXPECT_EQ(samples.at("voxeld_http_state{what=\"connections\"}"), 5);
  EXPECT_EQ(samples.at("voxeld_http_state{what=\"running\"}"), 1);
  EXPECT_EQ(samples.at("voxeld_http_state{what=\"event_streams\"}"), 0);
}

TEST_F(RequestMetricsTest, a_route_with_quotes_and_line_ends_cannot_break_the_document) {
  const std::string evil = "a\"b\\c\nd";
  record(evil, 200, 1);
  const Samples samples = parse(text());
  EXPECT_EQ(samples.count(requests("a\\\"b\\\\c\\nd", 200)), 1u);
}

TEST_F(RequestMetricsTest, threads_count_together) {
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&] {
      for (int i = 0; i < 100; ++i) {
        record("/a", 200, 1, 1, 1);
        metrics_.set_state({i, i}, i);
      }
    });
  }
  for (int i = 0; i < 20; ++i) parse(text());
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(parse(text()).at(requests("/a", 200)), 400);
}

TEST(RequestMetricsWithoutRegistry, only_logs) {
  RequestMetrics metrics(nullptr);
  Head head;
  http::ExchangeRecord exchange;
  exchange.head = &head;
  metrics.record(exchange, "/a");
  metrics.set_state({1, 1}, 1);
}

class MetricsEndpoint : public ServerTest {};

TEST_F(MetricsEndpoint, is_a_document_of_the_text_format_and_on_the_admin_port_alone) {
  submit();
  HttpResponse response;
  ASSERT_TRUE(comes_true([&] {  // an exchange is counted after its response has been sent
    response = admin("/metrics");
    return response.body.find(requests("/v1/assets", 201)) != std::string::npos &&
           response.body.find(requests("/v1/jobs", 202)) != std::string::npos;
  }));
  EXPECT_EQ(response.status, 200);
  EXPECT_EQ(response.header("content-type"), "text/plain; version=0.0.4; charset=utf-8");
  const Samples samples = parse(response.body);
  EXPECT_EQ(samples.at(requests("/v1/jobs", 202)), 1);
  EXPECT_EQ(samples.at(requests("/v1/assets", 201)), 1);
  EXPECT_EQ(samples.at("voxeld_http_state{what=\"event_streams\"}"), 0);
  EXPECT_EQ(get("/metrics").status, 404);
  EXPECT_EQ(admin("/v1/jobs").status, 404);
}

TEST_F(MetricsEndpoint, requests_that_match_no_route_are_counted_as_other) {
  ApiServerConfig config;
  config.request_threads = 1;  // the thread that served "/" meets the broken head
  start(config);
  HttpClient client(server_->port());
  ASSERT_TRUE(client.send_get("/") && client.receive());
  ASSERT_TRUE(client.send("BROKEN\r\n\r\n"));
  EXPECT_EQ(client.receive().value_or(HttpResponse{}).status, 400);
  EXPECT_EQ(get("/v1/nothing").status, 404);
  Samples samples;
  ASSERT_TRUE(comes_true([&] {
    samples = parse(admin("/metrics").body);
    return samples.count(requests("other", 404)) != 0;
  }));
  EXPECT_EQ(samples[requests("/", 200)], 1);
  EXPECT_EQ(samples[requests("other", 400)], 1);
  EXPECT_EQ(samples.count(requests("/", 400)), 0u);
}

}  // namespace
}  // namespace voxeld::api
