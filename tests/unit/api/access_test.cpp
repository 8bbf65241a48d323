// Keys at the door: who gets in, and that those who do not learn nothing else.
#include "server/api/access/access.h"

#include <regex>
#include <string>
#include <tuple>

#include "server/jobs/auth/key_file.h"
#include "tests/unit/api/api_server_fixture.h"

namespace voxeld::api {
namespace {

class AccessTest : public ServerTest {
 protected:
  std::string add(const std::string& tenant, bool is_admin = false, int64_t expires_ms = 0) {
    ApiKey key;
    key.is_admin = is_admin;
    key.expires_ms = expires_ms;
    return add_key(tenant, key);
  }
  void revoke(const std::string& key) {
    EXPECT_TRUE(change_keys(dir_.path() / "data", [&](KeyList& keys) -> Status {
      for (ApiKey& one : keys) {
        if (one.id == split_key(key).id) one.revoked_ms = 1;
      }
      return {};
    }));
  }
  // Everything that a client sees but what differs from request to request.
  static std::string seen(const HttpResponse& response) {
    std::string text = std::to_string(response.status) + "\n";
    for (const auto& [name, value] : response.headers) {
      const bool is_new = name == "x-request-id" || name == "X-Request-Id" ||
                          name == "traceresponse" || name == "date";  // with each request
      if (!is_new) text += name + ": " + value + "\n";
    }
    static const std::regex trace("\"trace_id\":\"[0-9a-f]{32}\"");
    return text + std::regex_replace(response.body, trace, "\"trace_id\":\"\"");
  }
};

TEST_F(AccessTest, an_open_daemon_asks_for_no_key_and_minds_none) {
  EXPECT_EQ(get("/v1/jobs").status, 200);
  EXPECT_EQ(get("/v1/jobs", bearer("anything")).status, 200);
  EXPECT_EQ(json(admin("/readyz")).value("access", ""), "open");
}

TEST_F(AccessTest, with_keys_every_route_needs_one_but_the_start_page_and_the_specification) {
  const std::string key = add("lab");
  EXPECT_EQ(get("/").status, 200);
  EXPECT_EQ(get("/openapi.json").status, 200);
  EXPECT_EQ(admin("/livez").status, 200);
  EXPECT_EQ(json(admin("/readyz")).value("access", ""), "keys");
  for (const char* path : {"/v1/jobs", "/v1/assets", "/v1/grids/x", "/v1/nothing", "//", "/v1"}) {
    EXPECT_EQ(get(path).status, 401) << path;
    EXPECT_NE(get(path, bearer(key)).status, 401) << path;
  }
  EXPECT_EQ(request("POST", "/v1/voxelize", "", "mesh").status, 401);
  EXPECT_EQ(request("OPTIONS", "/v1/jobs").status, 401);
  EXPECT_EQ(request("HEAD", "/v1/jobs").status, 401);
}

TEST_F(AccessTest, every_invalid_key_gets_the_same_response) {
  const std::string good = add("lab"), revoked = add("lab"), expired = add("lab", false, 1);
  revoke(revoked);
  std::string wrong = good;
  wrong.back() = wrong.back() == 'a' ? 'q' : 'a';
  const HttpResponse without = get("/v1/jobs");
  EXPECT_EQ(without.status, 401);
  EXPECT_EQ(json(without).value("code", ""), "unauthorized");
  EXPECT_NE(seen(without).find("Bearer realm=\"voxeld\""), std::string::npos);
  for (const std::string& lines :
       {bearer(wrong), bearer(revoked), bearer(expired), bearer(""), bearer("x"),
        bearer(make_key_secret().text()), bearer(good + "a"), bearer(good + " " + good),
        bearer(good) + bearer(good), "Authorization: " + good + "\r\n",
        "Authorization: Basic " + good + "\r\n", std::string("Authorization:\r\n")}) {
    EXPECT_EQ(seen(get("/v1/jobs", lines)), seen(without)) << lines;
  }
  EXPECT_EQ(get("/v1/jobs", bearer(good)).status, 200);
  EXPECT_EQ(get("/v1/jobs", "authorization: bearer  " + good + "\r\n").status, 200);
}

TEST_F(AccessTest, a_revoked_key_ends_its_event_streams) {
  const std::string key = add("lab");
  const auto asset = json(request("POST", "/v1/assets", bearer(key), "mesh")).value("id", "");
  const auto job = json(request("POST", "/v1/jobs", bearer(key),
                                R"({"kind":"voxelize","asset":")" + asset + R"("})"));
  HttpClient client(server_->port());
  ASSERT_TRUE(client.send_get("/v1/jobs/" + job.value("id", "") + "/events", bearer(key)));
  const auto head = client.receive_head();
  ASSERT_TRUE(head && head->status == 200);
  revoke(key);
  EXPECT_TRUE(client.receive_to_end()) << "the job has not ended";
}

TEST_F(AccessTest, a_revoked_key_ends_whatever_waits_in_its_name) {
  const std::string key = add("lab"), other = add("lab");
  const auto asset = json(request("POST", "/v1/assets", bearer(key), "mesh")).value("id", "");
  const std::string work = R"({"kind":"voxelize","asset":")" + asset + R"("})";
  const auto job = json(request("POST", "/v1/jobs", bearer(key), work)).value("id", "");
  const std::string tag = get("/v1/jobs/" + job, bearer(key)).header("etag");
  const std::string wait = bearer(key) + "Prefer: wait=60\r\n";
  const std::string post = "Content-Type: application/json\r\nContent-Length: ";
  std::vector<HttpClient> waiting;
  for (int i = 0; i < 4; ++i) waiting.emplace_back(server_->port());
  ASSERT_TRUE(waiting[0].send_get("/v1/jobs/" + job, wait));
  ASSERT_TRUE(waiting[1].send_get("/v1/jobs/" + job, wait + "If-None-Match: " + tag + "\r\n"));
  ASSERT_TRUE(waiting[2].send("POST /v1/jobs HTTP/1.1\r\nHost: h\r\n" + wait + post +
                              std::to_string(work.size()) + "\r\n\r\n" + work));
  ASSERT_TRUE(waiting[3].send("POST /v1/voxelize?size=9&asset=" + asset +
                              " HTTP/1.1\r\nHost: h\r\n" + bearer(key) +
                              "Content-Length: 0\r\n\r\n"));
  ASSERT_TRUE(comes_true([&] {
    return admin("/metrics").body.find("what=\"waiting\"} 4\n") != std::string::npos;
  })) << admin("/metrics").body;
  revoke(key);
  for (HttpClient& client : waiting) {
    ASSERT_TRUE(client.readable(kPatienceSeconds / 2)) << "less than it would wait";
    EXPECT_EQ(client.receive().value_or(HttpResponse{}).code(), "unauthorized");
  }
  EXPECT_EQ(get("/v1/jobs/" + job, bearer(other)).status, 200) << "the tenant's job stays";
}

TEST_F(AccessTest, a_key_that_is_revoked_before_a_body_is_whole_makes_nothing_of_it) {
  const std::string key = add("lab"), other = add("lab");
  const auto asset = json(request("POST", "/v1/assets", bearer(key), "mesh")).value("id", "");
  const std::string job = R"({"kind":"voxelize","asset":")" + asset + R"("})";
  for (const auto& [path, type, body] :
       {std::tuple<std::string, std::string, std::string>{"/v1/jobs", "application/json", job},
        {"/v1/assets", "application/octet-stream", "another mesh"}}) {
    const std::string revoked = add("lab");
    HttpClient client(server_->port());
    ASSERT_TRUE(client.send("POST " + path + " HTTP/1.1\r\nHost: h\r\n" + bearer(revoked) +
                            "Content-Type: " + type + "\r\nExpect: 100-continue\r\n" +
                            "Content-Length: " + std::to_string(body.size()) + "\r\n\r\n"));
    ASSERT_TRUE(client.receive_some().starts_with("HTTP/1.1 100 ")) << path;
    revoke(revoked);
    ASSERT_TRUE(client.send(body));
    EXPECT_EQ(client.receive().value_or(HttpResponse{}).code(), "unauthorized") << path;
  }
  EXPECT_EQ(json(get("/v1/assets", bearer(other)))["assets"].size(), 1u);
  EXPECT_EQ(json(get("/v1/jobs", bearer(other)))["jobs"].size(), 0u);
}

TEST_F(AccessTest, keys_that_cannot_be_read_any_more_make_the_daemon_not_ready) {
  const std::string key = add("lab");
  FakeWorker worker = connect_worker();
  EXPECT_EQ(get("/v1/jobs", bearer(key)).status, 200);
  std::filesystem::remove(dir_.path() / "data/keys");
  EXPECT_EQ(get("/v1/jobs", bearer(key)).status, 401);
  EXPECT_EQ(get("/v1/jobs").status, 401);
  const auto ready = admin("/readyz");
  EXPECT_EQ(ready.status, 503);
  EXPECT_NE(json(ready).value("reason", "").find("keys is gone"), std::string::npos);
}

TEST_F(AccessTest, an_upload_of_another_tenants_bytes_gets_the_response_of_a_first_upload) {
  const std::string lab = bearer(add("lab")), studio = bearer(add("studio"));
  const std::string target = "/v1/assets?filename=bunny.ply";
  const HttpResponse first = request("POST", target, lab, "mesh");
  const HttpResponse again = request("POST", target, lab, "mesh");
  const HttpResponse other = request("POST", target, studio, "mesh");
  EXPECT_EQ(first.status, 201);
  EXPECT_EQ(again.status, 200);
  EXPECT_EQ(other.status, 201);
  EXPECT_EQ(json(other).value("id", ""), json(first).value("id", "-"));
}

}  // namespace
}  // namespace voxeld::api
