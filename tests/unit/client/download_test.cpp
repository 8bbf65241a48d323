// Results on their way to the caller, over connections that break.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/include/voxeld/client.h"
#include "proto/container/grid_format.h"
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
using ::testing::SizeIs;

const std::string kEtag = "\"sha256-r\"";

CannedResponse whole(const std::string& text, std::optional<size_t> cut_after = {}) {
  return CannedResponse{.body = text, .headers = {"ETag: " + kEtag}, .cut_after = cut_after};
}

// The rest of `text` from `begin` on.
CannedResponse part(const std::string& text, size_t begin, std::optional<size_t> cut_after = {}) {
  return CannedResponse{
      .status = 206,
      .body = text.substr(begin),
      .headers = {"ETag: " + kEtag, "Content-Range: bytes " + std::to_string(begin) + "-" +
                                        std::to_string(text.size() - 1) + "/" +
                                        std::to_string(text.size())},
      .cut_after = cut_after};
}

// A sink that appends the received bytes to a text.
struct Received {
  std::string text;
  Sink sink() {
    return [this](std::span<const std::byte> piece) { text += text_of(piece); };
  }
};

TEST(Download, gives_the_whole_result_and_asks_for_no_range) {
  const std::string text = long_text(100'000);
  ScriptedServer server({whole(text)});
  Received received;
  Client(server.url()).download("j-1", received.sink());
  EXPECT_TRUE(received.text == text);
  EXPECT_EQ(server.asked()[0].line(), "GET /v1/jobs/j-1/result");
  EXPECT_EQ(server.asked()[0].header("range"), "");
}

TEST(Download, goes_on_where_the_connection_broke) {
  const std::string text = long_text(100'000);
  ScriptedServer server({whole(text, 30'001), part(text, 30'001, 20'000), part(text, 50'001)});
  Received received;
  Client(server.url()).download("j-1", received.sink());
  EXPECT_TRUE(received.text == text);
  const auto asked = server.asked();
  ASSERT_THAT(asked, SizeIs(3));
  EXPECT_EQ(asked[1].header("range"), "bytes=30001-");
  EXPECT_EQ(asked[1].header("if-range"), kEtag);
  EXPECT_EQ(asked[2].header("range"), "bytes=50001-");
  EXPECT_EQ(asked[2].header("if-range"), kEtag);
}

TEST(Download, goes_on_after_the_daemon_was_busy) {
  const std::string text = long_text(1000);
  ScriptedServer server({whole(text, 10),
                         problem_response(503, "shutting-down", "bye", {"Retry-After: 0"}),
                         part(text, 10)});
  Received received;
  Client(server.url()).download("j-1", received.sink());
  EXPECT_EQ(received.text, text);
}

TEST(Download, starts_anew_when_nothing_had_come) {
  const std::string text = long_text(1000);
  ScriptedServer server({whole("other", 0), whole(text)});
  Received received;
  Client(server.url()).download("j-1", received.sink());
  EXPECT_EQ(received.text, text);
  EXPECT_EQ(server.asked()[1].header("range"), "");
}

TEST(Download, a_result_that_changed_meanwhile_is_an_error_and_gives_no_more_bytes) {
  const std::string text = long_text(1000);
  ScriptedServer server({whole(text, 10), CannedResponse{.body = std::string(1000, 'x'),
                                                         .headers = {"ETag: \"sha256-other\""}}});
  Client client(server.url());
  Received received;
  const Error error = error_of([&] { client.download("j-1", received.sink()); });
  EXPECT_EQ(received.text, text.substr(0, 10));
  EXPECT_EQ(error.code(), "bad-response");
  EXPECT_EQ(error.http_status(), 200);
  EXPECT_STREQ(error.what(),
               "the result changed while it was downloaded, what came so far is of no use: "
               "expected status 206 with bytes 10- of \"sha256-r\", got status 200 of "
               "\"sha256-other\"");
  EXPECT_THAT(server.asked(), SizeIs(2));
}

TEST(Download, a_part_that_starts_elsewhere_or_is_of_another_result_is_an_error) {
  const std::string text = long_text(1000);
  CannedResponse other = part(text, 10);
  other.headers[0] = "ETag: \"sha256-other\"";
  CannedResponse unnamed = part(text, 10);
  unnamed.headers.pop_back();
  for (const CannedResponse& response : {part(text, 9), part(text, 100), other, unnamed}) {
    ScriptedServer server({whole(text, 10), response});
    Client client(server.url());
    Received received;
    EXPECT_EQ(error_of([&] { client.download("j-1", received.sink()); }).code(), "bad-response");
    EXPECT_EQ(received.text, text.substr(0, 10));
  }
}

TEST(Download, without_an_etag_nothing_is_resumed) {
  ScriptedServer server({CannedResponse{.body = long_text(1000), .cut_after = 10}});
  Client client(server.url());
  Received received;
  EXPECT_EQ(error_of([&] { client.download("j-1", received.sink()); }).code(), "unreachable");
  EXPECT_THAT(server.asked(), SizeIs(1));
}

const std::string kIdOfGrid =
    "\"sha256-e7404b86c92a54396e9dd15862a83f6a0b14db06e51197abac985a4f9e83ccc0\"";  // of "GRID"

CannedResponse named(const std::string& text, const std::string& etag) {
  return CannedResponse{.body = text, .headers = {"ETag: " + etag}};
}

TEST(Download, bytes_that_do_not_match_their_id_are_an_error) {
  ScriptedServer server({named("GR1D", kIdOfGrid)});
  Client client(server.url());
  Received received;
  const Error error = error_of([&] { client.download("j-1", received.sink()); });
  EXPECT_EQ(error.code(), "content-mismatch");
  EXPECT_STREQ(error.what(),
               "the result of the job j-1 was damaged on its way, or where it is stored: expected "
               "sha256-e7404b86c92a54396e9dd15862a83f6a0b14db06e51197abac985a4f9e83ccc0, got "
               "sha256-70da90a25269f65d7ca162eb251352e5c08d5e6090570b2f416491dd644828dc");
}

TEST(Download, a_resumed_result_is_checked_as_a_whole) {
  const std::vector<std::string> etag = {"ETag: " + kIdOfGrid};
  const std::vector<std::string> rest = {"ETag: " + kIdOfGrid, "Content-Range: bytes 2-3/4"};
  const CannedResponse begin{.body = "GRID", .headers = etag, .cut_after = 2};
  for (const std::string end : {"ID", "iD"}) {
    ScriptedServer server({begin, CannedResponse{.status = 206, .body = end, .headers = rest}});
    Client client(server.url());
    Received received;
    if (end == "ID") {
      client.download("j-1", received.sink());
    } else {
      EXPECT_EQ(error_of([&] { client.download("j-1", received.sink()); }).code(),
                "content-mismatch");
    }
    EXPECT_EQ(received.text, "GR" + end);
  }
}

TEST(Download, a_frame_is_checked_too) {
  ScriptedServer server({named("GR1D", kIdOfGrid)});
  Client client(server.url());
  EXPECT_EQ(error_of([&] { client.frame("j-1", 7); }).code(), "content-mismatch");
}

TEST(Download, gives_up_where_all_tries_break_at_one_byte) {
  const std::string text = long_text(1000);
  const CannedResponse nothing = part(text, 20, 0);
  ScriptedServer server({whole(text, 10), part(text, 10, 10), nothing, nothing, nothing});
  Client client(settings_for(server.url(), 2));
  Received received;
  EXPECT_EQ(error_of([&] { client.download("j-1", received.sink()); }).code(), "unreachable");
  EXPECT_EQ(received.text, text.substr(0, 20));
  EXPECT_THAT(server.asked(), SizeIs(5));
}

TEST(Download, breaks_may_be_more_than_the_tries_while_bytes_come) {
  const std::string text = long_text(100);
  ScriptedServer server(
      {whole(text, 10), part(text, 10, 10), part(text, 20, 10), part(text, 30, 70)});
  Client client(settings_for(server.url(), 1));
  Received received;
  client.download("j-1", received.sink());
  EXPECT_EQ(received.text, text);
}

TEST(Download, a_problem_is_thrown_and_not_given_to_the_sink) {
  ScriptedServer server({problem_response(409, "conflict", "the job runs")});
  Client client(server.url());
  Received received;
  EXPECT_EQ(error_of([&] { client.download("j-1", received.sink()); }).code(), "conflict");
  EXPECT_EQ(received.text, "");
}

TEST(Download, an_exception_of_the_sink_passes_through_and_ends_the_download) {
  ScriptedServer server({whole(long_text(1'000'000))});
  Client client(server.url());
  int calls = 0;
  const auto sink = [&](std::span<const std::byte>) {
    ++calls;
    throw std::domain_error("disk full");
  };
  EXPECT_THROW(client.download("j-1", sink), std::domain_error);
  EXPECT_EQ(calls, 1);
  EXPECT_THAT(server.asked(), SizeIs(1));
}

TEST(Download, the_client_is_usable_after_a_sink_threw) {
  ScriptedServer server({whole(long_text(1'000'000)), job_response("done")});
  Client client(server.url());
  EXPECT_THROW(
      client.download("j-1", [](std::span<const std::byte>) { throw std::domain_error("no"); }),
      std::domain_error);
  EXPECT_EQ(client.job("j-1").state, "done");
}

TEST(Download, progress_reports_bytes_of_the_total_also_after_a_break) {
  const std::string text = long_text(200'000);
  ScriptedServer server({whole(text, 100'000), part(text, 100'000)});
  Received received;
  std::vector<Progress> told;
  Client(server.url()).download("j-1", received.sink(), [&](const Progress& now) {
    told.push_back(now);
    return true;
  });
  ASSERT_FALSE(told.empty());
  EXPECT_EQ(told.back().stage, "download");
  EXPECT_EQ(told.back().done, 200'000);
  EXPECT_EQ(told.back().total, 200'000);
}

TEST(Download, a_callback_that_returns_false_stops_it) {
  ScriptedServer server({whole(long_text(1'000'000), 10)});
  Client client(server.url());
  Received received;
  const Error error = error_of([&] {
    client.download("j-1", received.sink(), [](const Progress& now) { return now.done == 0; });
  });
  EXPECT_EQ(error.code(), "interrupted");
  EXPECT_THAT(server.asked(), SizeIs(1));
}

TEST(WholeWay, voxelize_uploads_submits_waits_downloads_and_decodes) {
  GridHeader header;
  header.dims = {3, 4, 5};
  header.voxel_size = {1, 1, 1};
  const auto container = encode_grid(header, {});
  ASSERT_TRUE(container.ok());
  ScriptedServer server({json_response(R"({"id":"sha256-a"})"), job_response("queued"),
                         job_response("done"),
                         whole(std::string(container->begin(), container->end()), 50),
                         part(std::string(container->begin(), container->end()), 50)});
  Client client(server.url());
  const Grid grid = client.voxelize(Source::memory(bytes_of("x"), "a b.ply"),
                                    Options().set("size", "5").set("format", "npy"));
  EXPECT_THAT(grid.dims(), ElementsAre(3, 4, 5));
  EXPECT_THAT(server.lines(),
              ElementsAre("POST /v1/assets?filename=a%20b.ply", "POST /v1/jobs", "GET /v1/jobs/j-1",
                          "GET /v1/jobs/j-1/result", "GET /v1/jobs/j-1/result"));
  EXPECT_EQ(server.asked()[1].body, R"({"asset":"sha256-a","filename":"a b.ply","kind":"voxelize",)"
                                    R"("options":{"format":"native","size":"5"}})");
}

TEST(WholeWay, render_gives_the_image_and_the_jobs_end) {
  ScriptedServer server({json_response(R"({"id":"sha256-a"})"), job_response("queued"),
                         job_response("done", R"("result":{"bytes":3,"media_type":"image/png"})"),
                         whole("PNG")});
  Received received;
  const JobInfo job = Client(server.url())
                          .render_to(Source::memory(bytes_of("x"), ""), Options().set("width", "9"),
                                     received.sink());
  EXPECT_EQ(received.text, "PNG");
  EXPECT_EQ(job.media_type, "image/png");
  EXPECT_EQ(server.asked()[1].body,
            R"({"asset":"sha256-a","kind":"render","options":{"width":"9"}})");
}

TEST(WholeWay, a_result_that_is_no_container_is_a_bad_response) {
  ScriptedServer server({json_response(R"({"id":"sha256-a"})"), job_response("queued"),
                         job_response("done"), whole("<html>")});
  Client client(server.url());
  const Error error = error_of([&] { client.voxelize(Source::memory(bytes_of("x"), "a"), {}); });
  EXPECT_EQ(error.code(), "bad-response");
  EXPECT_THAT(error.what(), HasSubstr("the header is cut off"));
}

}  // namespace
}  // namespace voxeld::client
