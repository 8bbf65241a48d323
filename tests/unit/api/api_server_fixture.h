// The whole HTTP side over a real job service in a temporary directory; the worker is the test's
// own.
#pragma once

#include <gtest/gtest.h>
#include <prometheus/registry.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "server/api/api_server.h"
#include "server/jobs/auth/key_file.h"
#include "server/jobs/service/job_service.h"
#include "server/store/blob_store.h"
#include "tests/unit/base/temporary_dir.h"
#include "tests/unit/http/http_client.h"
#include "tests/unit/jobs/fake_worker.h"

namespace voxeld::api {

using testing::comes_true;
using testing::FakeWorker;
using testing::HttpClient;
using testing::HttpResponse;
using testing::kPatienceSeconds;

class ServerTest : public ::testing::Test {
 protected:
  void SetUp() override { start({}); }
  void TearDown() override {
    server_.reset();
    jobs_.reset();
  }
  // `config` without its addresses.
  void start(ApiServerConfig config) {
    server_.reset();
    jobs_.reset();
    registry_ = std::make_shared<prometheus::Registry>();
    JobServiceConfig jobs;
    jobs.data_dir = dir_.path() / "data";
    jobs.start_workers = false;
    jobs.limits_of = [this](std::string_view tenant) {
      return keys_ == nullptr ? TenantLimits{} : keys_->limits_of(tenant);
    };
    auto service = start_job_service(jobs, registry_);
    ASSERT_TRUE(service) << service.error().message();
    jobs_ = *std::move(service);
    config.listen = config.admin_listen = "127.0.0.1:0";
    config.origins.public_hosts.emplace_back("h");  // whom HttpClient asks for
    auto keys = KeyRing::open(dir_.path() / "data", std::chrono::milliseconds(0));
    ASSERT_TRUE(keys) << keys.error().message();
    keys_ = *std::move(keys);
    auto secrets = UrlSecrets::open(dir_.path() / "data");
    ASSERT_TRUE(secrets) << secrets.error().message();
    secrets_ = *std::move(secrets);
    auto server = start_api_server(config, *jobs_, *keys_, *secrets_, registry_);
    ASSERT_TRUE(server) << server.error().message();
    server_ = *std::move(server);
  }
  // Adds an API key of this tenant and with these rights (the id and the hash are made here), and
  // returns its text.
  std::string add_key(const std::string& tenant, ApiKey key = {}) {
    const KeySecret secret = make_key_secret();
    key.id = secret.id;
    key.tenant = tenant;
    key.secret_hash = secret.hash();
    EXPECT_TRUE(change_keys(dir_.path() / "data", [&](KeyList& keys) -> Status {
      keys.push_back(key);
      return {};
    }));
    return secret.text();
  }
  // The line of a request's head that carries a key.
  static std::string bearer(const std::string& key) {
    return "Authorization: Bearer " + key + "\r\n";
  }

  // As it is on the disk.
  BlobStore blobs() { return BlobStore::open(dir_.path() / "data").value(); }
  FakeWorker connect_worker() {
    return {dir_.path() / "data/run/tasks.sock", "llvmpipe", testing::kPatience};
  }

  // One request on a connection of its own.
  HttpResponse request(const std::string& method, const std::string& target,
                       const std::string& lines = "", const std::string& body = "") {
    return request_at(server_->port(), method, target, lines, body);
  }
  HttpResponse get(const std::string& target, const std::string& lines = "") {
    return request("GET", target, lines);
  }
  HttpResponse admin(const std::string& target) {
    return request_at(server_->admin_port(), "GET", target, "", "");
  }
  // A body that looks like JSON says so, unless `lines` has a Content-Type.
  static HttpResponse request_at(int port, const std::string& method, const std::string& target,
                                 const std::string& lines, const std::string& body) {
    HttpClient client(port);
    std::string head = method + " " + target + " HTTP/1.1\r\nHost: h\r\n" + lines;
    if (method == "POST" || method == "PATCH") {
      head += "Content-Length: " + std::to_string(body.size()) + "\r\n";
    }
    const bool is_json = body.starts_with('{') && lines.find("Content-Type") == lines.npos;
    if (is_json) head += "Content-Type: application/json\r\n";
    EXPECT_TRUE(client.send(head + "\r\n" + body));
    return client.receive(method != "HEAD").value_or(HttpResponse{});
  }
  static nlohmann::json json(const HttpResponse& response) {
    return nlohmann::json::parse(response.body, nullptr, false);
  }
  std::string post_asset(const std::string& text = "mesh") {
    return json(request("POST", "/v1/assets?filename=bunny.ply", "", text)).value("id", "");
  }
  // The response to a voxelize job for a new asset.
  HttpResponse post_job(const std::string& lines = "") {
    return request("POST", "/v1/jobs", lines,
                   R"({"kind":"voxelize","asset":")" + post_asset() + R"("})");
  }
  std::string submit() { return json(post_job()).value("id", ""); }
  // The path of a job that a worker ended with `text` as its result.
  std::string finished_job(const std::string& text) {
    const std::string id = submit();
    FakeWorker worker = connect_worker();
    const auto task = worker.claim();
    EXPECT_TRUE(task && task->id == id);
    EXPECT_TRUE(task && worker.complete(*task, text));
    return "/v1/jobs/" + id;
  }

  testing::TemporaryDir dir_;
  std::shared_ptr<prometheus::Registry> registry_;
  std::unique_ptr<JobService> jobs_;
  std::unique_ptr<KeyRing> keys_;
  std::unique_ptr<UrlSecrets> secrets_;
  std::unique_ptr<ApiServer> server_;
};

}  // namespace voxeld::api
