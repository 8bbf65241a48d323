// Which failures are tried again, for how long, and what Error the rest become.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>

#include "client/include/voxeld/client.h"
#include "tests/unit/client/client_test_tools.h"
#include "tests/unit/client/scripted_server.h"

namespace voxeld::client {
namespace {

using namespace std::chrono_literals;
using test::CannedResponse;
using test::job_response;
using test::json_response;
using test::problem_response;
using test::ScriptedServer;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Le;
using ::testing::SizeIs;

CannedResponse busy(int status, const std::string& retry_after) {
  return problem_response(status, "queue-full", "the queue is full",
                          {"Retry-After: " + retry_after});
}

TEST(Retry, a_busy_daemon_is_asked_again_with_the_same_body) {
  ScriptedServer server({busy(503, "0"), busy(429, "0"), job_response("queued")});
  Client client(server.url());
  const JobInfo job =
      client.submit("voxelize", Input::of_asset("sha256-a"), Options().set("size", "9"));
  EXPECT_EQ(job.id, "j-1");
  const auto asked = server.asked();
  ASSERT_THAT(asked, SizeIs(3));
  EXPECT_EQ(asked[0].line(), "POST /v1/jobs");
  EXPECT_EQ(asked[0].body, R"({"asset":"sha256-a","kind":"voxelize","options":{"size":"9"}})");
  EXPECT_EQ(asked[0].header("content-type"), "application/json");
  EXPECT_EQ(asked[1].body, asked[0].body);
  EXPECT_EQ(asked[2].body, asked[0].body);
}

TEST(Retry, a_submission_whose_response_is_lost_is_sent_again_with_the_same_key) {
  CannedResponse lost = job_response("queued");
  lost.cut_after = 5;
  ScriptedServer server({lost, job_response("queued"), job_response("queued")});
  Client client(server.url());
  EXPECT_EQ(client.submit("voxelize", Input::of_asset("sha256-a"), {}).id, "j-1");
  client.submit("voxelize", Input::of_asset("sha256-a"), {});
  const auto asked = server.asked();
  ASSERT_THAT(asked, SizeIs(3));
  EXPECT_THAT(asked[0].header("idempotency-key"), SizeIs(32));
  EXPECT_EQ(asked[1].header("idempotency-key"), asked[0].header("idempotency-key"));
  EXPECT_EQ(asked[1].body, asked[0].body);
  EXPECT_NE(asked[2].header("idempotency-key"), asked[0].header("idempotency-key"));
}

TEST(Retry, an_estimate_has_no_key) {
  ScriptedServer server({json_response("{}")});
  Client(server.url()).estimate_json("voxelize", Input::of_asset("sha256-a"), {});
  EXPECT_EQ(server.asked().at(0).header("idempotency-key"), "");
}

TEST(Retry, the_pause_is_that_of_retry_after) {
  ScriptedServer server({busy(503, "1"), job_response("done")});
  Client client(server.url());
  const auto start = std::chrono::steady_clock::now();
  EXPECT_EQ(client.job("j-1").state, "done");
  EXPECT_GE(since(start), 1000ms);
}

TEST(Retry, without_retry_after_the_pause_doubles_from_200_ms) {
  ScriptedServer server({problem_response(503, "shutting-down", "x"),
                         problem_response(503, "shutting-down", "x"), job_response("done")});
  Client client(server.url());
  const auto start = std::chrono::steady_clock::now();
  EXPECT_EQ(client.job("j-1").state, "done");
  EXPECT_GE(since(start), 600ms);
}

TEST(Retry, a_retry_after_that_is_a_date_is_not_waited_for) {
  ScriptedServer server({busy(503, "Wed, 21 Oct 2015 07:28:00 GMT"), job_response("done")});
  EXPECT_EQ(Client(server.url()).job("j-1").state, "done");
}

TEST(Retry, it_gives_up_after_the_tries_and_reports_the_last_response) {
  ScriptedServer server({busy(503, "0"), busy(503, "0"), busy(429, "0"), job_response("done")});
  Client client(settings_for(server.url(), 2));
  const Error error = error_of([&] { client.job("j-1"); });
  EXPECT_EQ(error.code(), "queue-full");
  EXPECT_EQ(error.http_status(), 429);
  EXPECT_THAT(server.asked(), SizeIs(3));
}

TEST(Retry, zero_retries_ask_once) {
  ScriptedServer server({busy(503, "0"), job_response("done")});
  Client client(settings_for(server.url(), 0));
  EXPECT_EQ(error_of([&] { client.job("j-1"); }).http_status(), 503);
  EXPECT_THAT(server.asked(), SizeIs(1));
}

TEST(Retry, a_refused_connection_is_tried_until_the_daemon_listens) {
  ScriptedServer server({job_response("done")}, 300ms);
  EXPECT_EQ(Client(settings_for(server.url(), 10)).job("j-1").state, "done");
}

TEST(Retry, other_failures_are_reported_at_once) {
  for (const int status : {400, 404, 409, 500, 504, 507}) {
    ScriptedServer server({problem_response(status, "some-code", "no"), job_response("done")});
    Client client(server.url());
    EXPECT_EQ(error_of([&] { client.job("j-1"); }).http_status(), status);
    EXPECT_THAT(server.asked(), SizeIs(1));
  }
}

TEST(Retry, a_proxy_that_has_lost_the_daemon_is_asked_again_where_that_does_nothing_twice) {
  const CannedResponse lost{.status = 502, .body = "<html>Bad Gateway</html>"};
  ScriptedServer server({lost, job_response("queued"), CannedResponse{.status = 504, .body = ""},
                         job_response("done"), lost, CannedResponse{.body = "RESULT"}});
  Client client(server.url());
  client.submit("voxelize", Input::of_asset("sha256-a"), {});
  EXPECT_EQ(client.wait("j-1").state, "done");
  std::vector<std::byte> result;
  client.download("j-1", [&](std::span<const std::byte> piece) {
    result.insert(result.end(), piece.begin(), piece.end());
  });
  EXPECT_EQ(result, bytes_of("RESULT"));
  const auto asked = server.asked();
  ASSERT_THAT(asked, SizeIs(6));
  EXPECT_EQ(asked[1].header("idempotency-key"), asked[0].header("idempotency-key"));
  ScriptedServer other({lost, job_response("cancelled")});
  EXPECT_EQ(error_of([&] { Client(other.url()).cancel("j-1"); }).http_status(), 502);
}

TEST(Errors, a_body_that_is_too_large_for_a_proxy_is_too_large) {
  ScriptedServer server({CannedResponse{.status = 413, .body = "<html>Too Large</html>"}});
  Client client(server.url());
  EXPECT_EQ(error_of([&] { client.upload(Source::memory(bytes_of("mesh"), "a.obj")); }).code(),
            "payload-too-large");
}

TEST(Errors, a_problem_document_becomes_an_error_with_all_its_parts) {
  ScriptedServer server({CannedResponse{
      .status = 400,
      .body = R"({"type":"urn:voxeld:error:invalid-option","title":"T","status":400,)"
              R"("code":"invalid-option","detail":"size","expected":"1 to 2048","got":"0"})",
      .headers = {"Content-Type: application/problem+json", "X-Request-Id: r-17"}}});
  Client client(server.url());
  const Error error = error_of([&] { client.submit("voxelize", Input::of_asset("a"), {}); });
  EXPECT_EQ(error.code(), "invalid-option");
  EXPECT_EQ(error.http_status(), 400);
  EXPECT_EQ(error.expected(), "1 to 2048");
  EXPECT_EQ(error.got(), "0");
  EXPECT_EQ(error.request_id(), "r-17");
  EXPECT_STREQ(error.what(), "size: expected 1 to 2048, got 0");
}

TEST(Errors, the_text_leaves_out_members_that_the_problem_lacks) {
  EXPECT_STREQ(Error("c", 1, "a", "", "b").what(), "a: got b");
  EXPECT_STREQ(Error("c", 1, "a", "b", "").what(), "a: expected b");
  EXPECT_STREQ(Error("c", 1, "a").what(), "a");
  EXPECT_STREQ(Error("c", 1, "", "b", "c").what(), "expected b, got c");
}

TEST(Errors, the_text_of_a_detail_that_names_both_values_has_them_once) {
  EXPECT_STREQ(Error("c", 1, "size: expected 1 to 2048, got 0", "1 to 2048", "0").what(),
               "size: expected 1 to 2048, got 0");
  EXPECT_STREQ(Error("c", 1, "size: got 0", "", "0").what(), "size: got 0");
}

TEST(Errors, the_text_of_a_failed_connection_names_the_address_and_the_reason_once) {
  const auto text_for = [](const std::string& url) {
    Client client(settings_for(url, 0));
    return std::string(error_of([&] { client.job("j-1"); }).what());
  };
  const std::string nobody = test::url_of_nobody();
  EXPECT_EQ(text_for(nobody), nobody + ": Connection refused");
  EXPECT_EQ(text_for("ftp://127.0.0.1"),
            "ftp://127.0.0.1: the URL begins with neither http:// nor https://");
  EXPECT_EQ(text_for("http://no-host.invalid"),
            "http://no-host.invalid: the name of the host is not known");
}

TEST(Errors, a_response_of_another_service_is_a_bad_response) {
  for (const CannedResponse& response :
       {CannedResponse{.body = "<html>Welcome to nginx</html>"}, CannedResponse{.body = ""},
        CannedResponse{.body = "[1]"}, CannedResponse{.body = "\"text\""},
        CannedResponse{.body = R"({"hello":"world"})"},
        CannedResponse{.body = R"({"id":7,"state":null})"},
        CannedResponse{.body = "{\"id\":\"\xff\"}"},
        CannedResponse{.status = 404, .body = "<html>no</html>"},
        CannedResponse{.status = 404, .body = "{}"},
        CannedResponse{.status = 404, .body = R"({"code":7})"},
        CannedResponse{.status = 302, .headers = {"Location: http://127.0.0.1:1/"}}}) {
    SCOPED_TRACE(response.body);
    ScriptedServer server({response});
    Client client(server.url());
    const Error error = error_of([&] { client.job("j-1"); });
    EXPECT_EQ(error.code(), "bad-response");
    EXPECT_THAT(server.asked(), SizeIs(1));
  }
}

TEST(Errors, a_bad_response_names_the_address_and_the_status) {
  ScriptedServer server({CannedResponse{.status = 404, .body = "<html>no</html>"}});
  Client client(server.url());
  const Error error = error_of([&] { client.job("j-1"); });
  EXPECT_EQ(error.http_status(), 404);
  EXPECT_EQ(error.what(), server.url() + ": status 404");
}

TEST(Errors, an_address_without_a_daemon_is_unreachable_and_named) {
  Client client(settings_for(test::url_of_nobody(), 1));
  const auto start = std::chrono::steady_clock::now();
  const Error error = error_of([&] { client.job("j-1"); });
  EXPECT_GE(since(start), 200ms);
  EXPECT_EQ(error.code(), "unreachable");
  EXPECT_EQ(error.http_status(), 0);
  EXPECT_THAT(error.what(), HasSubstr(test::url_of_nobody()));
}

TEST(Errors, an_address_that_is_none_is_unreachable) {
  for (const char* url : {"", "http://", "ftp://127.0.0.1", "nonsense://x", "file:///etc/passwd"}) {
    SCOPED_TRACE(url);
    Client client(settings_for(url, 0));
    EXPECT_EQ(error_of([&] { client.job("j-1"); }).code(), "unreachable");
  }
}

TEST(Errors, a_daemon_that_does_not_respond_in_time_is_a_timeout) {
  ScriptedServer server({CannedResponse{.delay = test::kTooLate}});
  Settings settings = settings_for(server.url(), 3);
  settings.timeout = 1s;
  Client client(settings);
  const Error error = error_of([&] { client.job("j-1"); });
  EXPECT_EQ(error.code(), "timeout");
  EXPECT_THAT(server.asked(), SizeIs(Le(1u)));  // none where the server is slower than the client
}

TEST(Client, slashes_at_the_end_of_the_address_do_not_count) {
  ScriptedServer server({job_response("done")});
  EXPECT_EQ(Client(server.url() + "//").job("j-1").state, "done");
  EXPECT_THAT(server.lines(), ElementsAre("GET /v1/jobs/j-1"));
}

TEST(Client, ids_are_escaped_in_paths) {
  ScriptedServer server(
      {job_response("done"), job_response("cancelled"), json_response("{\"a\":1}")});
  Client client(server.url());
  client.job("../x?y=1");
  client.cancel("a/b");
  EXPECT_EQ(client.asset_json("a b"), "{\"a\":1}");
  EXPECT_THAT(server.lines(), ElementsAre("GET /v1/jobs/..%2Fx%3Fy%3D1", "DELETE /v1/jobs/a%2Fb",
                                          "GET /v1/assets/a%20b"));
}

TEST(Client, a_moved_client_goes_on) {
  ScriptedServer server({job_response("done")});
  Client first(server.url());
  Client second(std::move(first));
  EXPECT_EQ(second.job("j-1").state, "done");
}

}  // namespace
}  // namespace voxeld::client
