// A tenant's limits over HTTP.
#include <cstdint>
#include <filesystem>
#include <string>
#include <system_error>

#include "server/jobs/auth/key_file.h"
#include "tests/unit/api/api_server_fixture.h"

namespace voxeld::api {
namespace {

class LimitsTest : public ServerTest {
 protected:
  std::string add(const std::string& tenant, const TenantLimits& limits) {
    ApiKey key;
    key.limits = limits;
    return bearer(add_key(tenant, key));
  }
  static TenantLimits bytes(int64_t most) {
    TenantLimits limits;
    limits.bytes = most;
    return limits;
  }
  // Bytes of files that are being uploaded.
  int64_t unfinished_bytes() const {
    int64_t sum = 0;
    for (const auto& file : std::filesystem::directory_iterator(dir_.path() / "data/tmp")) {
      std::error_code gone;
      const auto bytes = file.file_size(gone);
      if (!gone) sum += static_cast<int64_t>(bytes);
    }
    return sum;
  }
};

TEST_F(LimitsTest, a_tenant_over_its_rate_gets_retry_after) {
  TenantLimits limits;
  limits.requests_per_minute = 60;
  const std::string lab = add("lab", limits), studio = add("studio", {});
  const HttpResponse first = get("/v1/jobs", lab);
  EXPECT_EQ(first.status, 200);
  EXPECT_EQ(first.header("ratelimit-policy"), "\"requests\";q=2;w=2");
  EXPECT_EQ(first.header("ratelimit"), "\"requests\";r=1;t=1");
  EXPECT_EQ(first.header("retry-after"), "");
  HttpResponse refused;
  ASSERT_TRUE(comes_true([&] {  // a slow machine may take several seconds for a few requests
    refused = get("/v1/jobs", lab);
    return refused.status == 429;
  }));
  EXPECT_EQ(refused.code(), "too-many-requests");
  EXPECT_EQ(refused.header("retry-after"), "1");
  EXPECT_NE(refused.body.find("at most 1/s"), std::string::npos);
  const HttpResponse other = get("/v1/jobs", studio);
  EXPECT_EQ(other.status, 200);
  EXPECT_EQ(other.header("ratelimit"), "");
  for (int i = 0; i < 5; ++i) EXPECT_EQ(admin("/livez").status, 200);
}

TEST_F(LimitsTest, an_upload_over_the_quota_is_refused_before_its_body) {
  const std::string lab = add("lab", bytes(101'000));  // with rows of some 400 bytes
  EXPECT_EQ(request("POST", "/v1/assets", lab, std::string(70'000, 'x')).status, 201);
  for (const auto& [length, status] : {std::pair{"31001", 507}, std::pair{"101001", 413}}) {
    HttpClient client(server_->port());
    ASSERT_TRUE(client.send("POST /v1/assets HTTP/1.1\r\nHost: h\r\nContent-Length: " +
                            std::string(length) + "\r\n" + lab + "\r\n"));  // and no body
    const auto response = client.receive();
    ASSERT_TRUE(response);
    EXPECT_EQ(response->status, status);
    EXPECT_EQ(response->code(), status == 507 ? "quota-exceeded" : "payload-too-large");
    EXPECT_NE(response->body.find("beside 70"), std::string::npos) << response->body;
  }
  EXPECT_EQ(request("POST", "/v1/assets", lab, std::string(30'000, 'y')).status, 201);
}

TEST_F(LimitsTest, a_chunked_upload_is_refused_when_it_gets_too_long) {
  const std::string lab = add("lab", bytes(1000));
  EXPECT_EQ(request("POST", "/v1/assets", lab, "1234567").status, 201);
  HttpClient client(server_->port());
  ASSERT_TRUE(client.send("POST /v1/assets HTTP/1.1\r\nHost: h\r\nTransfer-Encoding: chunked\r\n" +
                          lab + "\r\n3\r\nabc\r\n2bc\r\n" + std::string(700, 'd') + "\r\n"));
  const auto response = client.receive();
  ASSERT_TRUE(response);
  EXPECT_EQ(response->status, 507);
  EXPECT_EQ(response->code(), "quota-exceeded");
}

TEST_F(LimitsTest, uploads_that_do_not_end_hold_no_more_than_the_quota) {
  const std::string lab = add("lab", bytes(1'000'000)), studio = add("studio", bytes(1'000'000));
  const std::string head = "POST /v1/assets HTTP/1.1\r\nHost: h\r\nContent-Length: 900000\r\n";
  const std::string most(800'000, 'x');
  HttpClient first(server_->port()), second(server_->port()), other(server_->port());
  ASSERT_TRUE(first.send(head + lab + "\r\n" + most));
  ASSERT_TRUE(comes_true([&] { return unfinished_bytes() == std::ssize(most); }));
  ASSERT_TRUE(second.send(head + lab + "\r\n" + most));
  const HttpResponse refused = second.receive().value_or(HttpResponse{});
  EXPECT_EQ(refused.status, 429);
  EXPECT_EQ(refused.code(), "too-many-requests");
  EXPECT_EQ(refused.detail(), "uploads of this tenant that have not ended hold its whole quota");
  EXPECT_NE(refused.header("retry-after"), "");
  ASSERT_TRUE(other.send(head + studio + "\r\n" + std::string(900'000, 'y')));
  EXPECT_EQ(other.receive().value_or(HttpResponse{}).status, 201);
  EXPECT_FALSE(first.readable(0)) << "it may go on";
  first.close();
  EXPECT_TRUE(comes_true([&] { return request("POST", "/v1/assets", lab, most).status == 201; }));
}

TEST_F(LimitsTest, a_tenant_can_read_its_limits_and_usage) {
  TenantLimits limits = bytes(10'000);
  limits.queued_jobs = 1;
  limits.cells = 5;
  const std::string lab = add("lab", limits);
  const std::string asset = json(request("POST", "/v1/assets", lab, "1234567")).value("id", "");
  const std::string job = R"({"kind":"voxelize","asset":")" + asset + R"("})";
  EXPECT_EQ(request("POST", "/v1/jobs", lab, job).status, 202);
  const HttpResponse full =
      request("POST", "/v1/jobs", lab,
              R"({"kind":"voxelize","asset":")" + asset + R"(","options":{"size":9}})");
  EXPECT_EQ(full.status, 429);
  EXPECT_EQ(full.code(), "too-many-requests");
  EXPECT_NE(full.header("retry-after"), "");
  const nlohmann::json me = json(get("/v1/me", lab));
  EXPECT_EQ(me["tenant"], "lab");
  EXPECT_EQ(me["admin"], false);
  EXPECT_TRUE(me["limits"]["requests_per_minute"].is_null());
  EXPECT_EQ(me["limits"]["bytes"], 10'000);
  EXPECT_EQ(me["limits"]["cells"], 5);
  EXPECT_GT(me["usage"]["bytes"], 7 + 1024) << "with the rows of the asset and of the job";
  EXPECT_EQ(me["usage"]["queued_jobs"], 1);
}

}  // namespace
}  // namespace voxeld::api
