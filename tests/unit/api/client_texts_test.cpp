// Texts of clients that are too long: refused with limit and length, not stored, not echoed.
#include <algorithm>
#include <cstdint>
#include <iterator>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "proto/options/table.h"
#include "server/jobs/database/sqlite_connection.h"
#include "tests/unit/api/api_server_fixture.h"

namespace voxeld::api {
namespace {

constexpr size_t kLongBytes = 200'000;
// No refusal is longer than this, whatever was sent.
constexpr size_t kResponseBytesMax = 2048;

const std::string& long_text() {
  static const std::string text(kLongBytes, 'A');
  return text;
}

size_t bytes_of(const HttpResponse& response) {
  size_t bytes = response.body.size();
  for (const auto& [name, value] : response.headers) bytes += name.size() + value.size();
  return bytes;
}

class ClientTexts : public ServerTest {
 protected:
  HttpResponse post_json(const nlohmann::json& job, const std::string& lines = "") {
    return request("POST", "/v1/jobs", lines, job.dump());
  }
  nlohmann::json job() { return {{"kind", "voxelize"}, {"asset", post_asset()}}; }
  SqliteConnection reader() {
    return SqliteConnection::open(dir_.path() / "data/jobs.sqlite", SqliteConnection::Role::kReader)
        .value();
  }
  int64_t number(const std::string& sql) {
    SqliteConnection connection = reader();
    auto row = connection.query(sql);
    EXPECT_TRUE(row && row->step());
    return row->int64(0);
  }
  // The longest text of any row of any table.
  int64_t longest_stored() {
    SqliteConnection connection = reader();
    int64_t longest = 0;
    std::vector<std::string> columns;
    {
      auto rows = connection.query(
          "SELECT 'SELECT COALESCE(MAX(LENGTH(CAST(\"' || c.name || '\" AS BLOB))), 0) FROM \"'"
          " || t.name || '\"' FROM sqlite_master t, pragma_table_info(t.name) c"
          " WHERE t.type = 'table'");
      EXPECT_TRUE(rows);
      while (rows->step().value()) columns.push_back(rows->text(0));
    }
    EXPECT_GT(columns.size(), 50U);
    for (const std::string& sql : columns) longest = std::max(longest, number(sql));
    return longest;
  }
  // How many times the options of a status name.
  static int64_t times_in(const nlohmann::json& status) {
    if (!status.is_object()) return 0;
    return std::ssize(status.value("/options/times"_json_pointer, nlohmann::json::array()));
  }
  void expect_refused(const HttpResponse& response, int status, std::string_view code,
                      std::string_view limit, const std::string& what) {
    EXPECT_EQ(response.status, status) << what << ": " << response.body.substr(0, 300);
    EXPECT_EQ(response.code(), code) << what;
    EXPECT_NE(response.body.find(limit), std::string::npos)
        << what << ": " << response.body.substr(0, 300);
    EXPECT_LE(bytes_of(response), kResponseBytesMax) << what;
    EXPECT_EQ(response.body.find(std::string(300, 'A')), std::string::npos) << what;
  }
};

TEST_F(ClientTexts, members_of_a_job_are_bounded) {
  for (const char* name : {"asset", "grid", "sequence", "filename"}) {
    nlohmann::json body = job();
    body[name] = long_text();
    const std::string_view limit = name == std::string_view("filename") ? "at most 255 bytes"
                                   : name == std::string_view("asset")  ? "at most 1024 bytes"
                                                                        : "at most 80 bytes";
    expect_refused(post_json(body), 400, "invalid-option", limit, name);
    EXPECT_NE(post_json(body).body.find("\"got\":\"200000\""), std::string::npos);
  }
  nlohmann::json body = job();
  body["kind"] = long_text();
  expect_refused(post_json(body), 400, "bad-request", "voxelize | render", "kind");
  body = job();
  body[long_text()] = 1;
  expect_refused(post_json(body), 400, "bad-request", "no such member", "a member's name");
  const std::string twice =
      R"({"kind":"voxelize",")" + long_text() + R"(":1,")" + long_text() + R"(":2})";
  expect_refused(request("POST", "/v1/jobs", "", twice), 400, "bad-request", "distinct keys",
                 "a key that stands twice");
  EXPECT_LE(longest_stored(), 2000);
}

TEST_F(ClientTexts, every_option_of_a_job_is_bounded) {
  for (const Option& info : option_table()) {
    const std::string name(info.name);
    const auto tried = [&](const nlohmann::json& value) {
      nlohmann::json body = job();
      if (!info.applies_to(OptionScope::kVoxelize)) {
        body["kind"] = "render";
      }
      body["options"][name] = value;
      return post_json(body);
    };
    const std::string_view limit = name == "times"     ? "at most 102400 bytes"
                                   : name == "palette" ? "at most 2048 bytes"
                                   : name == "filename" || name == "animation" || name == "variant"
                                       ? "at most 255 bytes"
                                       : "at most 1024 bytes";
    expect_refused(tried(long_text()), 400, "invalid-option", limit, name);
    const bool takes_words = std::holds_alternative<WordListValues>(info.codec.values);
    expect_refused(tried(nlohmann::json(std::vector<std::string>(1000, std::string(200, 'A')))),
                   400, "invalid-option", takes_words ? limit : R"("expected":"a )",
                   name + " as a list");
  }
  nlohmann::json body = job();
  body["options"][long_text()] = "1";
  expect_refused(post_json(body), 400, "unknown-option", "unknown option", "an option's name");
  body["options"] = {{long_text(), nlohmann::json::object()}};
  expect_refused(post_json(body), 400, "unknown-option", "unknown option", "a name with an object");
  EXPECT_EQ(number("SELECT COUNT(*) FROM jobs"), 0);
}

TEST_F(ClientTexts, headers_are_bounded) {
  const std::string name(30'000, 'A');
  expect_refused(post_json(job(), "Idempotency-Key: " + name + "\r\n"), 400, "bad-request",
                 "at most 255 bytes", "Idempotency-Key");
  for (const char* target : {"/v1/assets", "/v1/voxelize?size=8"}) {
    expect_refused(request("POST", target, "Content-Type: model/" + name + "\r\n", "mesh"), 400,
                   "bad-request", "at most 255 bytes", std::string("Content-Type of ") + target);
    expect_refused(
        request("POST", target, "Content-Disposition: attachment; filename=\"" + name + "\"\r\n",
                "mesh"),
        400, "invalid-option", "at most 255 bytes",
        std::string("Content-Disposition of ") + target);
  }
  expect_refused(request("POST", "/v1/assets?filename=" + name.substr(0, 5000), "", "mesh"), 400,
                 "invalid-option", "at most 255 bytes", "filename of an asset");
  for (const char* header :
       {"X-Request-Id", "traceparent", "Prefer", "Last-Event-ID", "If-None-Match", "Accept",
        "X-Forwarded-For", "User-Agent", "Authorization"}) {
    const HttpResponse response = post_json(job(), std::string(header) + ": " + name + "\r\n");
    EXPECT_EQ(response.status, 202) << header;
    EXPECT_EQ((response.body + response.header("x-request-id")).find(std::string(300, 'A')),
              std::string::npos)
        << header;
  }
  EXPECT_LE(longest_stored(), 2000);
}

TEST_F(ClientTexts, a_name_that_gets_the_extension_of_its_type_stays_within_the_limit) {
  const HttpResponse response = request("POST", "/v1/assets?filename=" + std::string(255, 'n'),
                                        "Content-Type: model/obj\r\n", "mesh");
  EXPECT_EQ(json(response).value("filename", ""), std::string(251, 'n') + ".obj");
}

TEST_F(ClientTexts, long_names_in_a_request_are_not_echoed_whole) {
  const std::string path = finished_job("0123456789");
  const std::string name(6000, 'A');
  for (const std::string& target : std::vector<std::string>{
           "/v1/" + name, "/v1/jobs/" + name, "/v1/grids/" + name, "/v1/sequences/" + name,
           "/v1/assets/" + name, "/v1/jobs?state=" + name, "/v1/jobs?" + name + "=1",
           path + "/frames/" + name, path + "/result?format=" + name}) {
    const HttpResponse response = get(target);
    EXPECT_GE(response.status, 400) << target.substr(0, 30);
    EXPECT_LE(bytes_of(response), kResponseBytesMax) << target.substr(0, 30);
  }
  const HttpResponse range =
      get(path + "/result", "Range: bytes=" + std::string(30'000, '9') + "-\r\n");
  EXPECT_LE(bytes_of(range), kResponseBytesMax);
  const HttpResponse beyond =
      get(path + "/result", "Range: bytes=" + std::string(30'000, '0') + "99-\r\n");
  EXPECT_EQ(beyond.status, 416);
  EXPECT_LE(bytes_of(beyond), kResponseBytesMax);
}

TEST_F(ClientTexts, a_link_that_no_request_can_hold_is_not_made) {
  const std::string path = "/v1/jobs/" + json(post_json(job())).value("id", "");
  // A blank is one byte of the request and three of the link. The job has not ended: only its
  // format would tell whether the options fit.
  const HttpResponse response = request("POST", path + "/share?palette=" + std::string(4000, '+'));
  expect_refused(response, 400, "invalid-option", "at most 8192 bytes", "a link");
  EXPECT_EQ(request("POST", path + "/share?format=npy").status, 201);
}

TEST_F(ClientTexts, the_longest_that_are_taken_are_stored_once) {
  nlohmann::json times = nlohmann::json::array();
  for (int i = 0; i < 4096; ++i) times.push_back(i / 24.0);
  nlohmann::json body = job();
  body["filename"] = std::string(251, 'b') + ".ply";
  body["options"] = {{"animation", std::string(255, 'w')}, {"times", times}};
  const HttpResponse response =
      post_json(body, "Idempotency-Key: " + std::string(255, 'k') + "\r\n");
  ASSERT_EQ(response.status, 202) << response.body.substr(0, 500);
  const std::string id = json(response).value("id", "");
  EXPECT_EQ(times_in(json(response)), 4096);
  ASSERT_EQ(request("DELETE", "/v1/jobs/" + id).status, 200);
  // In the job's own row, and in none of its events.
  EXPECT_GT(number("SELECT LENGTH(options_json) FROM jobs WHERE id = '" + id + "'"), 50'000);
  EXPECT_LE(number("SELECT MAX(LENGTH(data_json)) FROM job_events WHERE job_id = '" + id + "'"),
            2000);
  // Events name it as left out, as lists do; the job itself has all of it.
  HttpClient client(server_->port());
  ASSERT_TRUE(client.send_get("/v1/jobs/" + id + "/events"));
  const std::string events = client.receive_to_end().value_or("");
  size_t seen = 0;
  for (size_t at = events.find("data: "); at != std::string::npos;
       at = events.find("data: ", at + 1)) {
    const auto status = nlohmann::json::parse(events.substr(at + 6, events.find('\n', at) - at - 6),
                                              nullptr, false);
    ASSERT_TRUE(status.is_object());
    EXPECT_EQ(status.value("left_out", nlohmann::json()), nlohmann::json({"options"}));
    ++seen;
  }
  EXPECT_EQ(seen, 2U) << "queued and cancelled";
  EXPECT_EQ(times_in(json(request("GET", "/v1/jobs/" + id))), 4096);
}

}  // namespace
}  // namespace voxeld::api
