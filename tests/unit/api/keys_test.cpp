// /v1/keys: admins list, add, change and revoke keys; nobody else does.
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "server/jobs/auth/api_key.h"
#include "tests/unit/api/api_server_fixture.h"

namespace voxeld::api {
namespace {

class KeysApiTest : public ServerTest {
 protected:
  std::string add_admin(const std::string& tenant = "boss") {
    ApiKey key;
    key.is_admin = true;
    return add_key(tenant, key);
  }
  HttpResponse post(const std::string& key, const std::string& body) {
    return request("POST", "/v1/keys", bearer(key), body);
  }
  HttpResponse patch(const std::string& key, const std::string& id, const std::string& body) {
    return request("PATCH", "/v1/keys/" + id, bearer(key), body);
  }
  HttpResponse revoke(const std::string& key, const std::string& id) {
    return request("DELETE", "/v1/keys/" + id, bearer(key));
  }
  static std::string id_of(const std::string& key) { return std::string(split_key(key).id); }
};

TEST_F(KeysApiTest, an_open_daemon_tells_where_its_first_key_comes_from) {
  for (const auto& [method, path] : std::vector<std::pair<std::string, std::string>>{
           {"GET", "/v1/keys"}, {"POST", "/v1/keys"}, {"DELETE", "/v1/keys/aaaaaaaa"}}) {
    const HttpResponse response = request(method, path, "", method == "POST" ? "{}" : "");
    EXPECT_EQ(response.status, 409) << method;
    EXPECT_EQ(response.code(), "conflict");
    EXPECT_NE(response.body.find("voxeld keys add NAME --admin"), std::string::npos);
  }
}

TEST_F(KeysApiTest, a_tenant_is_forbidden_and_changes_nothing) {
  const std::string boss = add_admin(), lab = add_key("lab");
  for (const HttpResponse& response : {get("/v1/keys", bearer(lab)), post(lab, R"({"name":"lab"})"),
                                       patch(lab, id_of(lab), R"({"weight":9})"),
                                       revoke(lab, id_of(boss)), revoke(lab, "aaaaaaaa")}) {
    EXPECT_EQ(response.status, 403) << response.body;
    EXPECT_EQ(response.code(), "forbidden");
  }
  EXPECT_EQ(json(get("/v1/keys", bearer(boss)))["keys"].size(), 2u);
}

TEST_F(KeysApiTest, a_new_key_counts_at_once_and_its_secret_is_shown_once) {
  const std::string boss = add_admin();
  const HttpResponse response =
      post(boss, R"({"name":"lab","expires":"1h","weight":3,"rate":"10/s","queued_jobs":5,)"
                 R"("bytes":1000000,"cells":7})");
  ASSERT_EQ(response.status, 201) << response.body;
  EXPECT_EQ(response.header("cache-control"), "no-store");
  nlohmann::json added = json(response);
  const std::string key = added.value("key", "");
  EXPECT_EQ(added["id"], id_of(key));
  EXPECT_EQ(json(get("/v1/me", bearer(key))).value("tenant", ""), "lab");
  added.erase("key");
  const nlohmann::json limits = {
      {"requests_per_minute", 600}, {"queued_jobs", 5}, {"bytes", 1000000}, {"cells", 7}};
  EXPECT_EQ(added["limits"], limits);
  EXPECT_EQ(added["weight"], 3);
  EXPECT_EQ(added["admin"], false);
  EXPECT_EQ(added["expires_ms"].get<int64_t>() - added["created_ms"].get<int64_t>(), 3600 * 1000);
  const HttpResponse list = get("/v1/keys", bearer(boss));
  EXPECT_EQ(json(list)["keys"][1], added);
  EXPECT_EQ(list.body.find(std::string(split_key(key).secret)), std::string::npos);
  const std::string second = json(post(boss, R"({"name":"chief","admin":true})")).value("key", "");
  EXPECT_EQ(get("/v1/keys", bearer(second)).status, 200);
}

TEST_F(KeysApiTest, a_list_has_pages) {
  const std::string boss = add_admin();
  for (const char* tenant : {"a", "b", "c"}) add_key(tenant);
  std::vector<std::string> names;
  std::string after;
  do {
    const auto page = json(get("/v1/keys?limit=3" + after, bearer(boss)));
    for (const auto& key : page["keys"]) names.push_back(key.value("name", ""));
    after = page.contains("next") ? "&after=" + page.value("next", "") : "";
  } while (!after.empty());
  EXPECT_EQ(names, (std::vector<std::string>{"boss", "a", "b", "c"}));
  EXPECT_EQ(get("/v1/keys?after=aaaaaaaa", bearer(boss)).code(), "invalid-option");
}

TEST_F(KeysApiTest, limits_change_for_all_keys_of_the_tenant) {
  const std::string boss = add_admin(), one = add_key("lab"), two = add_key("lab");
  const HttpResponse changed = patch(boss, id_of(one), R"({"rate":"30/m","weight":2})");
  ASSERT_EQ(changed.status, 200) << changed.body;
  EXPECT_EQ(json(changed)["weight"], 2);
  const auto listed = json(get("/v1/keys", bearer(boss)));
  std::map<std::string, int64_t> rates;
  for (const auto& key : listed["keys"]) {
    rates[key["id"]] = key["limits"]["requests_per_minute"];
  }
  const std::map<std::string, int64_t> expected = {
      {id_of(boss), 0}, {id_of(one), 30}, {id_of(two), 30}};
  EXPECT_EQ(rates, expected);
  EXPECT_EQ(patch(boss, "aaaaaaaa", "{}").status, 404);
}

TEST_F(KeysApiTest, a_revoked_key_ends_at_once_and_revoking_it_again_gives_the_same_response) {
  const std::string boss = add_admin(), lab = add_key("lab");
  const HttpResponse first = revoke(boss, id_of(lab));
  EXPECT_EQ(first.status, 200);
  EXPECT_EQ(json(first).value("state", ""), "revoked");
  EXPECT_EQ(get("/v1/me", bearer(lab)).status, 401);
  EXPECT_EQ(revoke(boss, id_of(lab)).body, first.body);
  EXPECT_EQ(revoke(boss, "aaaaaaaa").code(), "not-found");
  EXPECT_EQ(revoke(boss, lab).code(), "not-found") << "a whole key is no id";
}

TEST_F(KeysApiTest, the_last_live_key_of_an_admin_is_not_revoked) {
  const std::string boss = add_admin(), second = add_admin("chief");
  EXPECT_EQ(revoke(boss, id_of(second)).status, 200);
  const HttpResponse refused = revoke(boss, id_of(boss));
  EXPECT_EQ(refused.status, 409);
  EXPECT_NE(refused.body.find("voxeld keys revoke"), std::string::npos);
  EXPECT_EQ(get("/v1/keys", bearer(boss)).status, 200);
}

TEST_F(KeysApiTest, wrong_bodies_are_refused_with_what_was_expected) {
  const std::string boss = add_admin();
  struct Case {
    const char *body, *code, *detail, *expected, *got;
  };
  const std::vector<Case> cases = {
      {R"({})", "bad-request", "key.name", "a value", "nothing"},
      {R"({"name":1})", "bad-request", "key.name", "a text", "number"},
      {R"({"name":"lab","admin":"yes"})", "bad-request", "key.admin", "true or false", "string"},
      {R"({"name":"lab","bytes":"20G"})", "bad-request", "key.bytes", "an integer", "string"},
      {R"({"name":"lab","role":"admin"})", "bad-request", "key: no such member",
       "name, admin, expires, weight, rate, queued_jobs, bytes, cells", "\"role\""},
      {R"({"name":"lab","weight":0})", "invalid-option", "weight", "1 to 1000", "0"}};
  for (const Case& one : cases) {
    const HttpResponse response = post(boss, one.body);
    const nlohmann::json problem = json(response);
    EXPECT_EQ(response.status, 400) << response.body;
    EXPECT_EQ(problem.value("code", ""), one.code);
    EXPECT_EQ(problem.value("detail", ""), one.detail);
    EXPECT_EQ(problem.value("expected", ""), one.expected);
    EXPECT_EQ(problem.value("got", ""), one.got);
  }
  for (const char* body : {R"({"name":"Two Words"})", R"({"name":"lab","expires":"soon"})",
                           R"({"name":"lab","rate":"fast"})", R"({"name":)"}) {
    EXPECT_EQ(post(boss, body).status, 400) << body;
  }
  EXPECT_EQ(patch(boss, id_of(boss), R"({"name":"lab"})").code(), "bad-request");
  EXPECT_EQ(request("POST", "/v1/keys", bearer(boss) + "Content-Type: text/plain\r\n",
                    R"({"name":"lab"})")
                .status,
            415);
  EXPECT_EQ(json(get("/v1/keys", bearer(boss)))["keys"].size(), 1u);
}

TEST_F(KeysApiTest, a_key_that_is_revoked_before_its_body_has_arrived_adds_nothing) {
  const std::string boss = add_admin(), second = add_admin("chief");
  const std::string body = R"({"name":"lab","admin":true})";
  HttpClient client(server_->port());
  ASSERT_TRUE(client.send("POST /v1/keys HTTP/1.1\r\nHost: h\r\n" + bearer(second) +
                          "Content-Type: application/json\r\nExpect: 100-continue\r\n"
                          "Content-Length: " +
                          std::to_string(body.size()) + "\r\n\r\n"));
  ASSERT_TRUE(client.receive_some().starts_with("HTTP/1.1 100 ")) << "the key was admitted";
  ASSERT_EQ(revoke(boss, id_of(second)).status, 200);
  ASSERT_TRUE(client.send(body));
  EXPECT_EQ(client.receive().value_or(HttpResponse{}).status, 401);
  EXPECT_EQ(json(get("/v1/keys", bearer(boss)))["keys"].size(), 2u);
}

}  // namespace
}  // namespace voxeld::api
