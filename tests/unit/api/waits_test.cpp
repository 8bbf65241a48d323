// Requests that wait for jobs: by the hundred on a few threads, fair between tenants, bounded.
#include <chrono>
#include <string>
#include <vector>

#include "server/base/clock.h"
#include "server/jobs/auth/key_file.h"
#include "tests/unit/api/api_server_fixture.h"
#include "tests/unit/jobs/lists.h"

namespace voxeld::api {
namespace {

class WaitsTest : public ServerTest {
 protected:
  // Four threads, of which the former server left three to requests that wait.
  void SetUp() override {
    ApiServerConfig config;
    config.request_threads = 4;
    config.connections_max = 400;
    start(config);
  }
  std::string add(const std::string& tenant) { return bearer(add_key(tenant)); }
  // Sends a one-shot request for a mesh of its own and does not wait for the response.
  HttpClient one_shot(const std::string& lines, const std::string& mesh) {
    HttpClient client(server_->port());
    EXPECT_TRUE(client.send("POST /v1/voxelize?size=16 HTTP/1.1\r\nHost: h\r\n" + lines +
                            "Content-Length: " + std::to_string(mesh.size()) + "\r\n\r\n" + mesh));
    return client;
  }
  bool are_waiting(int count) {
    const std::string line = "{what=\"waiting\"} " + std::to_string(count) + "\n";
    return admin("/metrics").body.find(line) != std::string::npos;
  }
  bool waiting(int count) {
    return comes_true([&] { return are_waiting(count); });
  }
};

TEST_F(WaitsTest, every_one_shot_is_a_queued_job_at_once_and_others_are_served_between) {
  const std::string lab = add("lab"), studio = add("studio");
  std::vector<HttpClient> clients;
  for (int i = 0; i < 150; ++i) {
    clients.push_back(one_shot(lab, "mesh " + std::to_string(i)));
  }
  ASSERT_TRUE(comes_true([&] { return jobs_->queued_jobs() == 150; }));
  ASSERT_TRUE(waiting(150));
  EXPECT_EQ(get("/v1/jobs?limit=1", studio).status, 200);
  HttpClient other = one_shot(studio, "another mesh");
  ASSERT_TRUE(comes_true([&] { return jobs_->queued_jobs() == 151; }));
  const std::string job = json(get("/v1/jobs", studio))["jobs"][0].value("id", "");
  // The scheduler knows both tenants, so the second one's only job is among the first two.
  FakeWorker worker = connect_worker();
  std::vector<std::string> claimed;
  while (claimed.size() < 2) {
    const auto task = worker.claim();
    ASSERT_TRUE(task && worker.complete(*task, "voxels"));
    claimed.push_back(task->id);
    if (task->id == job) break;
  }
  EXPECT_EQ(claimed.back(), job);
  EXPECT_EQ(other.receive().value_or(HttpResponse{}).body, "voxels");
}

TEST_F(WaitsTest, slow_uploads_polls_and_streams_of_one_tenant_delay_no_other) {
  const std::string lab = add("lab"), studio = add("studio");
  const std::string asset =
      json(request("POST", "/v1/assets?filename=a.ply", lab, "mesh")).value("id", "");
  const std::string job =
      json(request("POST", "/v1/jobs", lab, R"({"kind":"voxelize","asset":")" + asset + R"("})"))
          .value("id", "");
  std::vector<HttpClient> clients;
  for (int i = 0; i < 40; ++i) {
    ASSERT_TRUE(clients.emplace_back(server_->port())
                    .send("POST /v1/assets HTTP/1.1\r\nHost: h\r\n" + lab +
                          "Content-Length: 1000000\r\n\r\nbegin"));
    ASSERT_TRUE(clients.emplace_back(server_->port())
                    .send_get("/v1/jobs/" + job, lab + "Prefer: wait=60\r\n"));
    ASSERT_TRUE(clients.emplace_back(server_->port()).send_get("/v1/jobs/" + job + "/events", lab));
  }
  ASSERT_TRUE(waiting(80)) << admin("/metrics").body;
  const HttpResponse upload = request("POST", "/v1/assets", studio, "mesh");
  EXPECT_EQ(upload.status, 201);
  EXPECT_EQ(get("/v1/assets", studio).status, 200);
  HttpClient other = one_shot(studio, "another mesh");
  FakeWorker worker = connect_worker();
  for (int i = 0; i < 2; ++i) {
    const auto task = worker.claim();
    ASSERT_TRUE(task && worker.complete(*task, "voxels"));
  }
  EXPECT_EQ(other.receive().value_or(HttpResponse{}).body, "voxels");
}

TEST_F(WaitsTest, a_tenant_over_its_share_of_waits_is_refused_and_others_are_not) {
  const std::string lab = add("lab"), studio = add("studio");
  std::vector<HttpClient> clients;
  for (int i = 0; i < 200; ++i) clients.push_back(one_shot(lab, "mesh " + std::to_string(i)));
  ASSERT_TRUE(waiting(200));
  HttpClient over = one_shot(lab, "one more");
  const HttpResponse refused = over.receive().value_or(HttpResponse{});
  EXPECT_EQ(refused.status, 429);
  EXPECT_EQ(refused.code(), "too-many-requests");
  EXPECT_EQ(refused.detail(), "too many requests of this tenant wait at a time");
  EXPECT_EQ(refused.header("retry-after"), "2");
  EXPECT_EQ(get("/v1/jobs?limit=1", lab).status, 200) << "requests that do not wait";
  HttpClient other = one_shot(studio, "mesh");
  ASSERT_TRUE(waiting(201)) << "it waits for its job";
  clients.pop_back();
  ASSERT_TRUE(waiting(200));
  // The place comes back after the metric has changed: a request between them is refused.
  EXPECT_TRUE(comes_true([&] {
    clients.push_back(one_shot(lab, "again"));
    EXPECT_TRUE(comes_true([&] { return clients.back().readable(0) || are_waiting(201); }));
    return are_waiting(201);
  }));
}

TEST_F(WaitsTest, a_job_outlives_a_poll_whose_client_leaves) {
  const std::string id = submit();
  HttpClient client(server_->port());
  ASSERT_TRUE(client.send_get("/v1/jobs/" + id, "Prefer: wait=60\r\n"));
  ASSERT_TRUE(waiting(1));
  client.close();
  ASSERT_TRUE(waiting(0));
  EXPECT_EQ(json(get("/v1/jobs/" + id)).value("state", ""), "queued");
}

TEST_F(WaitsTest, a_poll_ends_at_its_time_with_the_job_as_it_is) {
  const std::string id = submit();
  const auto begin = std::chrono::steady_clock::now();
  const HttpResponse response = get("/v1/jobs/" + id, "Prefer: wait=1\r\n");
  EXPECT_EQ(json(response).value("state", ""), "queued");
  const auto took = std::chrono::steady_clock::now() - begin;
  EXPECT_GE(took, std::chrono::seconds(1));
}

TEST_F(WaitsTest, a_key_that_expires_ends_its_waiting_requests) {
  const std::string id = submit();
  ApiKey key;
  key.is_admin = true;
  key.expires_ms = unix_time_ms() + 1500;
  const std::string text = add_key("lab", key);
  HttpClient client(server_->port());
  ASSERT_TRUE(client.send_get("/v1/jobs/" + id,
                              "Authorization: Bearer " + text + "\r\nPrefer: wait=60\r\n"));
  ASSERT_TRUE(client.readable(kPatienceSeconds / 2)) << "less than it would wait";
  EXPECT_EQ(client.receive().value_or(HttpResponse{}).code(), "unauthorized");
}

TEST_F(WaitsTest, a_one_shot_that_was_cached_does_not_wait) {
  HttpClient first = one_shot("", "mesh");
  FakeWorker worker = connect_worker();
  const auto task = worker.claim();
  ASSERT_TRUE(task && worker.complete(*task, "voxels"));
  EXPECT_EQ(first.receive().value_or(HttpResponse{}).body, "voxels");
  HttpClient second = one_shot("", "mesh");
  const HttpResponse response = second.receive().value_or(HttpResponse{});
  EXPECT_EQ(response.body, "voxels");
  EXPECT_EQ(response.header("cache-status"), "voxeld; hit");
}

}  // namespace
}  // namespace voxeld::api
