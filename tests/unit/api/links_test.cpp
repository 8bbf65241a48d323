// Signed links: what they open, and that nothing else does.
#include <string>

#include "server/api/access/signed_link.h"
#include "server/base/clock.h"
#include "server/jobs/auth/key_file.h"
#include "tests/unit/api/api_server_fixture.h"

namespace voxeld::api {
namespace {

class LinksTest : public ServerTest {
 protected:
  std::string share(const std::string& target, int status = 201) {
    const HttpResponse response = request("POST", target);
    EXPECT_EQ(response.status, status) << response.body;
    return json(response).value("url", "");
  }
  std::string made(const std::string& path, int64_t expires_s, const std::string& key = "") {
    return SignedLinks(*secrets_).make(path, {}, key, expires_s).value();
  }
  static int64_t now_s() { return unix_time_ms() / 1000; }
};

TEST_F(LinksTest, a_link_gives_the_result_with_ranges_and_conditions) {
  const std::string job = finished_job("0123456789");
  const std::string url = share(job + "/share?seconds=60");
  ASSERT_TRUE(url.starts_with(job + "/result?expires=")) << url;
  const HttpResponse whole = get(url);
  EXPECT_EQ(whole.status, 200);
  EXPECT_EQ(whole.body, "0123456789");
  EXPECT_EQ(get(url, "Range: bytes=2-4\r\n").body, "234");
  EXPECT_EQ(get(url, "If-None-Match: " + whole.header("etag") + "\r\n").status, 304);
  const HttpResponse head = request("HEAD", url);
  EXPECT_EQ(head.status, 200);
  EXPECT_EQ(head.header("content-length"), "10");
}

TEST_F(LinksTest, a_link_with_any_change_is_no_such_link) {
  const std::string job = finished_job("0123456789");
  const std::string grid = json(get(job))["result"]["grid"];
  const std::string url = share("/v1/grids/" + grid + "/share?view=grid");
  EXPECT_EQ(get(url).status, 200);
  const auto replaced = [&](const std::string& from, const std::string& to) {
    std::string changed = url;
    changed.replace(changed.find(from), from.size(), to);
    return changed;
  };
  const char last = url.back();
  const std::string expires = url.substr(url.find("expires=") + 8, 10);
  for (const std::string& changed :
       {url.substr(0, url.size() - 1) + (last == '0' ? '1' : '0'), replaced("key=", "key=abcdefgh"),
        replaced(expires, std::to_string(std::stoll(expires) + 1)), url + "&format=vox",
        replaced("?", "?format=vox&"), replaced(grid, grid + "/tiles"), url + "&expires=1",
        replaced("/v1/grids/" + grid, job + "/result"),
        std::string("/v1/grids/x?expires=9999999999&key=&signature=")}) {
    const HttpResponse response = get(changed);
    EXPECT_EQ(response.status, 404) << changed;
    EXPECT_EQ(response.detail(), "no such link") << changed;
  }
  EXPECT_EQ(request("POST", url).status, 405);
}

TEST_F(LinksTest, a_link_that_expired_says_so) {
  const std::string job = finished_job("0123456789");
  EXPECT_EQ(get(made(job + "/result", now_s() + 60)).status, 200);
  const HttpResponse response = get(made(job + "/result", now_s()));
  EXPECT_EQ(response.status, 410);
  EXPECT_EQ(response.code(), "gone");
}

TEST_F(LinksTest, options_are_part_of_a_link) {
  const std::string job = finished_job("0123456789");
  const std::string url = share(job + "/share?format=npy&filename=x%26y%20z");
  EXPECT_NE(url.find("format=npy&filename=x%26y%20z&expires="), std::string::npos) << url;
  share(job + "/share?format=npy&axes=x%26y%20z", 400);  // as the route itself says of such axes
  share(job + "/share?filename=" + std::string(256, 'x'), 400);
  share(job + "/share?seconds=0", 400);
  share(job + "/share?seconds=2592001", 400);
  share(job + "/share?view=events", 400);
  share(job + "/share?expires=1", 400);
  share("/v1/jobs/j-00000000000000000000000000000000/share", 404);
}

TEST_F(LinksTest, a_result_that_is_no_grid_has_no_link_to_another_format) {
  const std::string body = R"({"kind":"inspect","asset":")" + post_asset() + R"("})";
  const std::string job = "/v1/jobs/" + json(request("POST", "/v1/jobs", "", body)).value("id", "");
  FakeWorker worker = connect_worker();
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  TaskCompletion completion;
  completion.task = task->id;
  completion.fence = task->fence;
  completion.outputs = {
      {"result", worker.write("out", "{}").string(), "application/json", "bunny.json"}};
  worker.complete_with(completion);
  EXPECT_EQ(get(job + "/result?format=npy").status, 406);
  const HttpResponse refused = request("POST", job + "/share?format=npy");
  EXPECT_EQ(refused.status, 400);
  EXPECT_EQ(refused.detail(), "format");
  EXPECT_EQ(get(share(job + "/share")).body, "{}");
}

TEST_F(LinksTest, links_end_with_the_key_that_made_them) {
  const KeySecret secret = make_key_secret();
  const auto change = [&](int64_t revoked_ms) {
    ASSERT_TRUE(change_keys(dir_.path() / "data", [&](KeyList& keys) -> Status {
      ApiKey key;
      key.id = secret.id;
      key.tenant = "lab";
      key.secret_hash = secret.hash();
      key.revoked_ms = revoked_ms;
      keys = {key};
      return {};
    }));
  };
  const std::string open_job = finished_job("0123456789");
  const std::string open_url = share(open_job + "/share");
  EXPECT_EQ(get(open_url).status, 200);
  change(0);
  EXPECT_EQ(get(open_url).status, 404);  // made when nobody needed a key
  const std::string bearer = "Authorization: Bearer " + secret.text() + "\r\n";
  const std::string asset = json(request("POST", "/v1/assets", bearer, "mesh")).value("id", "");
  const std::string id =
      json(request("POST", "/v1/jobs", bearer, R"({"kind":"voxelize","asset":")" + asset + R"("})"))
          .value("id", "");
  FakeWorker worker = connect_worker();
  const auto task = worker.claim();
  ASSERT_TRUE(task && worker.complete(*task, "of the lab"));
  const std::string url =
      json(request("POST", "/v1/jobs/" + id + "/share", bearer)).value("url", "");
  EXPECT_EQ(get(url).body, "of the lab");
  EXPECT_EQ(get("/v1/jobs/" + id + "/result").status, 401);
  // A link is for reading: with other methods its parameters mean nothing.
  EXPECT_EQ(request("DELETE", url).status, 401);
  EXPECT_EQ(get(url).body, "of the lab");
  change(1);
  EXPECT_EQ(get(url).status, 404);
}

}  // namespace
}  // namespace voxeld::api
