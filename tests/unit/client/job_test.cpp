// Jobs: what is submitted, how their end is waited for, how they are stopped.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/include/voxeld/client.h"
#include "proto/container/grid_format.h"
#include "proto/error_code.h"
#include "tests/unit/base/comes_true.h"
#include "tests/unit/client/client_test_tools.h"
#include "tests/unit/client/scripted_server.h"
#include "tests/unit/proto/tile_maker.h"

namespace voxeld::client {
namespace {

using namespace std::chrono_literals;
using test::CannedResponse;
using test::job_response;
using test::json_response;
using test::problem_response;
using test::ScriptedServer;
using ::testing::AnyOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

const CannedResponse kUploaded = json_response(R"({"id":"sha256-a"})");

CannedResponse unchanged(std::chrono::milliseconds delay = 0ms) {
  return CannedResponse{.status = 304, .delay = delay};
}

CannedResponse running(int done, const std::string& etag) {
  return job_response("running",
                      R"("stage":"voxelize","tiles_total":4,"tiles_done":)" + std::to_string(done),
                      {"ETag: " + etag});
}

TEST(Submit, kind_input_options_and_filename_are_sent) {
  ScriptedServer server({job_response("queued"), job_response("queued")});
  Client client(server.url());
  client.submit("voxelize", Input::of_asset("sha256-a"),
                Options().set("size", "7").set("filename", "a.ply").set("size", "8"));
  client.submit("export", Input::of_grid("sha256-g"), Options().set("format", "vox"));
  EXPECT_EQ(server.asked()[0].body,
            R"({"asset":"sha256-a","filename":"a.ply","kind":"voxelize","options":{"size":"8"}})");
  EXPECT_EQ(server.asked()[1].body,
            R"({"grid":"sha256-g","kind":"export","options":{"format":"vox"}})");
}

TEST(Submit, a_sequence_may_be_the_input) {
  ScriptedServer server({job_response("queued")});
  Client(server.url())
      .submit("export", Input::of_sequence("sha256-s"), Options().set("frames", "3..5"));
  EXPECT_EQ(server.asked()[0].body,
            R"({"kind":"export","options":{"frames":"3..5"},"sequence":"sha256-s"})");
}

TEST(Submit, a_bundle_names_its_files_and_their_uploads) {
  ScriptedServer server({json_response(R"({"id":"sha256-b"})"), json_response("{}")});
  Client client(server.url());
  const std::vector<BundleFile> files = {{"bob.md5mesh", "sha256-a"}, {"walk.md5anim", "sha256-c"}};
  EXPECT_EQ(client.bundle(files), "sha256-b");
  EXPECT_EQ(server.asked()[0].line(), "POST /v1/assets");
  EXPECT_EQ(server.asked()[0].header("content-type"), "application/vnd.voxeld.bundle+json");
  EXPECT_EQ(server.asked()[0].body, R"({"files":[{"asset":"sha256-a","name":"bob.md5mesh"},)"
                                    R"({"asset":"sha256-c","name":"walk.md5anim"}]})");
  EXPECT_EQ(error_of([&] { client.bundle(files); }).code(), "bad-response");
}

TEST(Frames, finished_frames_are_listed) {
  ScriptedServer server(
      {json_response(
           R"({"job":"j-1","sequence":null,"frames_total":3,"frames":[{"index":0,"time_s":0,)"
           R"("grid":"sha256-g","voxel_count":17,"content_hash":"sha256-h"},{"index":2,)"
           R"("time_s":0.25,"grid":"sha256-i","voxel_count":5,"content_hash":"sha256-j"}]})"),
       json_response(R"({"sequence":"sha256-s","frames_total":0,"frames":[]})"),
       json_response(R"({"frames_total":0})")});
  Client client(server.url());
  const JobFrames frames = client.frames("j-1");
  EXPECT_EQ(frames.sequence, "");
  EXPECT_EQ(frames.total, 3);
  ASSERT_THAT(frames.frames, SizeIs(2));
  EXPECT_EQ(frames.frames[0].grid, "sha256-g");
  EXPECT_EQ(frames.frames[0].content_hash, "sha256-h");
  EXPECT_EQ(frames.frames[0].voxel_count, 17u);
  EXPECT_EQ(frames.frames[1].index, 2);
  EXPECT_EQ(frames.frames[1].time_s, 0.25);
  EXPECT_EQ(client.frames("j-1").sequence, "sha256-s");
  EXPECT_EQ(error_of([&] { client.frames("j-1"); }).code(), "bad-response");
  EXPECT_EQ(server.lines()[0], "GET /v1/jobs/j-1/frames");
}

TEST(Frames, one_that_is_not_done_yet_is_not_found) {
  ScriptedServer server({problem_response(404, "not-found", "frame 7: 3 of 140 frames are done")});
  Client client(server.url());
  EXPECT_EQ(error_of([&] { client.frame("j-1", 7); }).code(), "not-found");
  EXPECT_EQ(server.lines()[0], "GET /v1/jobs/j-1/frames/7");
}

TEST(Frames, progress_of_a_sequence_counts_frames) {
  ScriptedServer server({job_response("running",
                                      R"("stage":"voxelize","tiles_total":4,"tiles_done":1,)"
                                      R"("frames_total":140,"frames_done":12)",
                                      {"ETag: \"1\""}),
                         job_response("done", R"("frames_total":140,"frames_done":140,)"
                                              R"("result":{"sequence":"sha256-s"})")});
  std::vector<std::string> told;
  const JobInfo job = Client(server.url()).wait("j-1", [&](const Progress& now) {
    told.push_back(std::to_string(now.done) + "/" + std::to_string(now.total) + " " + now.unit);
    return true;
  });
  EXPECT_THAT(told, ElementsAre("12/140 frames", "140/140 frames"));
  EXPECT_EQ(job.sequence, "sha256-s");
  EXPECT_EQ(job.frames_total, 140);
}

// Tiles of a grid of so many voxels.
CannedResponse tiles_response(int voxels, const std::string& next) {
  GridHeader header;
  header.dims = {300, 2, 2};
  header.voxel_size = {1, 1, 1};
  const auto bytes =
      encode_grid(header,
                  voxeld::test::tiles_of(voxeld::test::box_voxels({0, 0, 0}, {voxels, 1, 1}), {}))
          .value();
  return {.body = std::string(bytes.begin(), bytes.end()),
          .headers = {"Content-Type: application/vnd.voxeld.grid", "X-Voxeld-Next: " + next}};
}

TEST(Tiles, are_passed_on_until_there_are_no_others) {
  CannedResponse cut = tiles_response(9, "2");
  cut.cut_after = 100;
  CannedResponse none_yet = job_response("running");
  none_yet.status = 202;
  ScriptedServer server({none_yet, tiles_response(5, "1"),
                         problem_response(503, "queue-full", "busy"), cut, tiles_response(9, "2"),
                         CannedResponse{.status = 204}});
  std::vector<std::uint64_t> voxels;
  Client(settings_for(server.url(), 2)).tiles("j-1", [&](const Grid& tiles) {
    voxels.push_back(tiles.voxel_count());
    return true;
  });
  EXPECT_THAT(voxels, ElementsAre(5u, 9u));
  EXPECT_THAT(server.lines(),
              ElementsAre("GET /v1/jobs/j-1/tiles?after=0", "GET /v1/jobs/j-1/tiles?after=0",
                          "GET /v1/jobs/j-1/tiles?after=1", "GET /v1/jobs/j-1/tiles?after=1",
                          "GET /v1/jobs/j-1/tiles?after=1", "GET /v1/jobs/j-1/tiles?after=2"));
  EXPECT_THAT(server.asked()[0].header("prefer"), HasSubstr("wait="));
}

TEST(Tiles, the_callback_and_a_stop_end_it_and_the_job_goes_on) {
  CannedResponse none_yet = job_response("running");
  none_yet.status = 202;
  ScriptedServer server({tiles_response(5, "1"), none_yet});
  Client client(server.url());
  client.tiles("j-1", [](const Grid&) { return false; });
  EXPECT_THAT(server.asked(), SizeIs(1));
  std::stop_source stop;
  stop.request_stop();
  const TilesCallback take = [](const Grid&) { return true; };
  EXPECT_EQ(error_of([&] { client.tiles("j-1", take, stop.get_token()); }).code(), "interrupted");
  for (const std::string& line : server.lines()) EXPECT_THAT(line, HasSubstr("GET "));
}

TEST(Tiles, errors_of_the_job_and_invalid_responses_are_thrown) {
  const auto error = [](const CannedResponse& response) {
    ScriptedServer server({response});
    Client client(server.url());
    return error_of([&] { client.tiles("j-1", [](const Grid&) { return true; }); });
  };
  EXPECT_EQ(error(problem_response(409, "cancelled", "the job was cancelled")).code(), "cancelled");
  EXPECT_EQ(error(CannedResponse{.body = "no container", .headers = {"X-Voxeld-Next: 1"}}).code(),
            "bad-response");
  const Error stuck = error(tiles_response(5, "0"));
  EXPECT_EQ(stuck.code(), "bad-response");
  EXPECT_EQ(stuck.expected(), "a number above 0");
  EXPECT_EQ(stuck.got(), "\"0\"");
}

TEST(Submit, a_name_that_is_no_utf8_is_sent_as_text_that_is) {
  ScriptedServer server({job_response("queued")});
  Client(server.url())
      .submit("inspect", Input::of_asset("a"), Options().set("filename", "b\xe4ume.ply"));
  EXPECT_THAT(server.asked()[0].body, HasSubstr("\"filename\":\"b\xef\xbf\xbdume.ply\""));
}

TEST(JobInfo, holds_the_values_of_the_response) {
  ScriptedServer server({json_response(
      R"({"id":"j-7","kind":"render","state":"done","stage":"","tiles_done":3,"tiles_total":4,)"
      R"("queue_position":0,"result":{"bytes":99,"media_type":"image/png","grid":"sha256-g",)"
      R"("meta":{"dims":[1,2,3]},"warnings":[{"code":"missing-texture","detail":"skin.png"}]}})")});
  const JobInfo job = Client(server.url()).job("j-7");
  EXPECT_EQ(job.id, "j-7");
  EXPECT_EQ(job.kind, "render");
  EXPECT_TRUE(job.ended());
  EXPECT_EQ(job.tiles_done, 3);
  EXPECT_EQ(job.tiles_total, 4);
  EXPECT_EQ(job.bytes, 99);
  EXPECT_EQ(job.media_type, "image/png");
  EXPECT_EQ(job.grid, "sha256-g");
  EXPECT_EQ(job.meta_json, R"({"dims":[1,2,3]})");
  EXPECT_THAT(job.warnings, ElementsAre("missing-texture: skin.png"));
  EXPECT_THAT(job.json, HasSubstr("\"queue_position\":0"));
}

TEST(JobInfo, members_of_the_wrong_type_are_left_out) {
  ScriptedServer server({json_response(R"({"id":"j","state":"done","kind":[],"tiles_done":"x",)"
                                       R"("result":{"bytes":{},"warnings":[7,null]}})"),
                         json_response(R"({"id":"j","state":"done","result":[1]})")});
  Client client(server.url());
  EXPECT_EQ(client.job("j").kind, "");
  EXPECT_EQ(client.job("j").bytes, 0);
}

TEST(Jobs, a_list_is_asked_for_with_its_limit) {
  ScriptedServer server(
      {json_response(R"({"jobs":[{"id":"j-2","state":"done"},{"id":"j-1","state":"failed"}]})"),
       json_response(R"({"jobs":[]})")});
  Client client(server.url());
  const auto jobs = client.jobs(2);
  ASSERT_THAT(jobs, SizeIs(2));
  EXPECT_EQ(jobs[1].state, "failed");
  EXPECT_THAT(client.jobs(), SizeIs(0));
  EXPECT_THAT(server.lines(), ElementsAre("GET /v1/jobs?limit=2", "GET /v1/jobs?limit=100"));
}

TEST(Jobs, a_list_of_the_wrong_type_is_a_bad_response) {
  for (const char* body : {"{}", R"({"jobs":7})", R"({"jobs":"x"})", R"({"jobs":[1]})"}) {
    ScriptedServer server({json_response(body)});
    Client client(server.url());
    EXPECT_EQ(error_of([&] { client.jobs(); }).code(), "bad-response") << body;
  }
}

TEST(Wait, asks_for_the_next_change_by_etag_until_the_end) {
  ScriptedServer server({job_response("queued", R"("queue_position":2)", {"ETag: \"1\""}),
                         running(1, "\"2\""), unchanged(), running(3, "\"3\""),
                         job_response("done", "", {"ETag: \"4\""})});
  Client client(server.url());
  std::vector<std::string> stages;
  const JobInfo job = client.wait("j-1", [&](const Progress& progress) {
    stages.push_back(progress.stage + " " + std::to_string(progress.done) + "/" +
                     std::to_string(progress.total));
    return true;
  });
  EXPECT_EQ(job.state, "done");
  EXPECT_THAT(stages,
              ElementsAre("queued 0/0", "voxelize 1/4", "voxelize 1/4", "voxelize 3/4", " 0/0"));
  const auto asked = server.asked();
  ASSERT_THAT(asked, SizeIs(5));
  EXPECT_EQ(asked[0].line(), "GET /v1/jobs/j-1");
  EXPECT_THAT(asked[0].header("prefer"), HasSubstr("wait="));
  EXPECT_EQ(asked[0].header("if-none-match"), "");
  EXPECT_EQ(asked[1].header("if-none-match"), "\"1\"");
  EXPECT_EQ(asked[2].header("if-none-match"), "\"2\"");
  EXPECT_EQ(asked[3].header("if-none-match"), "\"2\"");
  EXPECT_EQ(asked[4].header("if-none-match"), "\"3\"");
}

TEST(Wait, a_failed_job_throws_its_own_error) {
  ScriptedServer server({job_response(
      "failed",
      R"("error":{"code":"malformed-mesh","detail":"a.ply line 3","expected":"1","got":"2"})")});
  Client client(server.url());
  const Error error = error_of([&] { client.wait("j-1"); });
  EXPECT_EQ(error.code(), "malformed-mesh");
  EXPECT_EQ(error.http_status(), 422);
  EXPECT_STREQ(error.what(), "a.ply line 3: expected 1, got 2");
}

TEST(Wait, every_error_code_of_a_job_keeps_its_name_and_status) {
  for (const ErrorCodeInfo& info : all_error_codes()) {
    ScriptedServer server({job_response(
        "failed", R"("error":{"detail":"d","code":")" + std::string(info.name) + "\"}")});
    Client client(server.url());
    const Error error = error_of([&] { client.wait("j-1"); });
    EXPECT_EQ(error.code(), info.name);
    EXPECT_EQ(error.http_status(), info.http_status);
  }
}

TEST(Wait, an_end_without_an_error_document_is_reported_by_the_state) {
  ScriptedServer server({job_response("cancelled"), job_response("failed", R"("error":7)")});
  Client client(server.url());
  const Error cancelled = error_of([&] { client.wait("j-1"); });
  EXPECT_EQ(cancelled.code(), "cancelled");
  EXPECT_STREQ(cancelled.what(), "the job j-1 was cancelled");
  EXPECT_EQ(error_of([&] { client.wait("j-1"); }).code(), "failed");
}

TEST(Wait, goes_on_over_a_daemon_that_restarts_while_the_job_stands_still) {
  CannedResponse cut = running(1, "\"1\"");
  cut.cut_after = 5;
  ScriptedServer server({running(1, "\"1\""), problem_response(503, "shutting-down", "bye"), cut,
                         unchanged(), job_response("done")});
  EXPECT_EQ(Client(server.url()).wait("j-1").state, "done");
  EXPECT_THAT(server.asked(), SizeIs(5));
}

TEST(Wait, tries_at_least_eight_times_more_unless_none_is_wanted) {
  std::vector<CannedResponse> script(
      10, problem_response(503, "shutting-down", "bye", {"Retry-After: 0"}));
  script.front() = running(1, "\"1\"");
  for (const auto& [retries, asked] : {std::pair<int, size_t>{1, 10}, {0, 2}}) {
    ScriptedServer server(script);
    Client client(settings_for(server.url(), retries));
    EXPECT_EQ(error_of([&] { client.wait("j-1"); }).code(), "shutting-down");
    EXPECT_THAT(server.asked(), SizeIs(asked));
  }
}

TEST(Wait, a_304_without_a_condition_is_a_bad_response) {
  ScriptedServer server({unchanged()});
  Client client(server.url());
  EXPECT_EQ(error_of([&] { client.wait("j-1"); }).code(), "bad-response");
}

TEST(Wait, a_short_timeout_does_not_count_the_time_that_the_daemon_was_asked_to_hold) {
  // Tried again where a busy machine adds seconds; all tries would fail if the held time counted.
  EXPECT_TRUE(testing::comes_true([] {
    ScriptedServer server({running(1, "\"1\""), unchanged(1100ms), job_response("done")});
    Settings settings = settings_for(server.url(), 0);
    settings.timeout = 1s;
    try {
      return Client(settings).wait("j-1").state == "done";
    } catch (const Error&) {
      return false;
    }
  }));
}

TEST(Cancel, is_a_delete) {
  ScriptedServer server({job_response("cancelled")});
  EXPECT_EQ(Client(server.url()).cancel("j-1").state, "cancelled");
  EXPECT_THAT(server.lines(), ElementsAre("DELETE /v1/jobs/j-1"));
}

TEST(Cancel, a_stop_token_deletes_the_job_that_voxelize_waits_for) {
  ScriptedServer server(
      {kUploaded, job_response("queued"), unchanged(test::kTooLate), job_response("cancelled")});
  Client client(server.url());
  std::stop_source stop;
  std::jthread stopper([&] {
    EXPECT_TRUE(server.is_asked(3));
    stop.request_stop();
  });
  const Error error = error_of(
      [&] { client.voxelize(Source::memory(bytes_of("x"), "a.ply"), {}, {}, stop.get_token()); });
  EXPECT_EQ(error.code(), "interrupted");
  EXPECT_THAT(server.lines(), ElementsAre("POST /v1/assets?filename=a.ply", "POST /v1/jobs",
                                          "GET /v1/jobs/j-1", "DELETE /v1/jobs/j-1"));
}

TEST(Cancel, a_callback_that_returns_false_deletes_the_job_even_while_it_stands_still) {
  ScriptedServer server({kUploaded, job_response("queued"), running(2, "\"1\""), unchanged(),
                         unchanged(), job_response("cancelled")});
  Client client(server.url());
  int calls = 0;
  const Error error = error_of([&] {
    client.voxelize(Source::memory(bytes_of("x"), "a.ply"), {},
                    [&](const Progress& now) { return now.stage != "voxelize" || ++calls < 3; });
  });
  EXPECT_EQ(error.code(), "interrupted");
  EXPECT_EQ(server.lines().back(), "DELETE /v1/jobs/j-1");
  EXPECT_THAT(server.asked(), SizeIs(6));
}

TEST(Cancel, a_callback_that_throws_deletes_the_job_and_its_exception_passes_through) {
  ScriptedServer server(
      {kUploaded, job_response("queued"), running(2, "\"1\""), job_response("cancelled")});
  Client client(server.url());
  const auto progress = [](const Progress& now) {
    if (now.stage == "voxelize") throw std::domain_error("no");
    return true;
  };
  EXPECT_THROW(client.voxelize(Source::memory(bytes_of("x"), "a.ply"), {}, progress),
               std::domain_error);
  EXPECT_EQ(server.lines().back(), "DELETE /v1/jobs/j-1");
}

TEST(Cancel, a_job_that_failed_by_itself_is_not_deleted) {
  ScriptedServer server({kUploaded, job_response("queued"), job_response("failed")});
  Client client(server.url());
  EXPECT_EQ(error_of([&] { client.voxelize(Source::memory(bytes_of("x"), "a.ply"), {}); }).code(),
            "failed");
  EXPECT_THAT(server.asked(), SizeIs(3));
}

TEST(Cancel, a_stop_ends_the_pause_before_another_try) {
  const auto full = [](const std::string& seconds) {
    return problem_response(503, "queue-full", "full", {"Retry-After: " + seconds});
  };
  ScriptedServer server({full("9"), job_response("done"), full("5"), job_response("done")});
  Client client(server.url());
  std::stop_source stop, control_stop;
  std::jthread stopper([&] {
    EXPECT_TRUE(server.is_asked(1));
    // The server takes this request once the first client has its response, and pauses.
    EXPECT_EQ(Client(server.url()).job("j-2").state, "done");
    stop.request_stop();
    const auto control = [&] { Client(server.url()).wait("j-3", {}, control_stop.get_token()); };
    EXPECT_EQ(error_of(control).code(), "interrupted");
  });
  EXPECT_EQ(error_of([&] { client.wait("j-1", {}, stop.get_token()); }).code(), "interrupted");
  EXPECT_LT(server.asked().size(), 4u) << "the control, which pauses for less, asks again first";
  control_stop.request_stop();
}

TEST(Cancel, a_stop_ends_the_pause_before_a_job_is_submitted_again) {
  ScriptedServer server(
      {kUploaded, problem_response(503, "queue-full", "full", {"Retry-After: 9"})});
  Client client(server.url());
  std::stop_source stop;
  std::jthread stopper([&] {
    EXPECT_TRUE(server.is_asked(2));
    stop.request_stop();
  });
  const Error error = error_of(
      [&] { client.voxelize(Source::memory(bytes_of("x"), "a.ply"), {}, {}, stop.get_token()); });
  EXPECT_EQ(error.code(), "interrupted");
  EXPECT_THAT(server.asked(), SizeIs(2));
}

std::string container_of(int voxels) {
  return tiles_response(voxels, "").body;
}

const std::string kGridResult =
    R"("result":{"grid":"sha256-g","media_type":"application/vnd.voxeld.grid"})";

TEST(Job, is_started_and_asked_for_without_a_wait) {
  ScriptedServer server({kUploaded, job_response("queued"), running(1, "\"1\""),
                         job_response("done", kGridResult),
                         CannedResponse{.body = container_of(5)}});
  Client client(server.url());
  Job job = client.start(Source::memory(bytes_of("x"), "a.ply"), Options().size(8));
  EXPECT_EQ(job.id(), "j-1");
  EXPECT_EQ(job.info().state, "queued");
  EXPECT_FALSE(job.poll());
  EXPECT_EQ(job.info().tiles_done, 1);
  EXPECT_TRUE(job.poll());
  EXPECT_TRUE(job.poll());  // does not ask again
  const Grid grid = job.grid();
  EXPECT_EQ(grid.voxel_count(), 5u);
  EXPECT_EQ(grid.id(), "sha256-g");
  const auto asked = server.asked();
  ASSERT_THAT(asked, SizeIs(5));
  EXPECT_EQ(asked[1].body, R"({"asset":"sha256-a","filename":"a.ply","kind":"voxelize",)"
                           R"("options":{"size":"8"}})");
  EXPECT_EQ(asked[2].header("prefer"), "");
  EXPECT_EQ(asked[4].line(), "GET /v1/jobs/j-1/result");
}

TEST(Job, outlives_its_client_and_can_be_attached_by_its_id) {
  ScriptedServer server({job_response("running"), job_response("done", kGridResult),
                         CannedResponse{.body = "bytes"}});
  std::optional<Job> job = Client(server.url()).attach("j-1");
  std::string got;
  job->download([&](std::span<const std::byte> piece) { got += text_of(piece); });
  EXPECT_EQ(got, "bytes");
}

TEST(Job, waits_for_a_time_and_may_go_on_afterwards) {
  ScriptedServer server({job_response("queued"), job_response("queued"), job_response("running"),
                         job_response("running"), job_response("done")});
  Client client(server.url());
  Job job = client.start("export", Input::of_grid("sha256-g"), {});
  EXPECT_FALSE(job.wait_for(0ms));
  EXPECT_EQ(server.asked().size(), 2u);
  EXPECT_TRUE(job.wait_for(1h));
  EXPECT_EQ(server.asked()[2].header("prefer"), "");
  EXPECT_EQ(server.asked()[3].header("prefer"), "wait=2");
}

TEST(Job, a_stopped_wait_leaves_it_to_the_daemon_until_it_is_cancelled) {
  // The stopped wait may send a request, and may not.
  ScriptedServer server({job_response("queued"), job_response("running"), job_response("running"),
                         job_response("cancelled"), job_response("cancelled")});
  Client client(server.url());
  Job job = client.start("voxelize", Input::of_asset("sha256-a"), {});
  EXPECT_EQ(error_of([&] { job.wait([](const Progress&) { return false; }); }).code(),
            "interrupted");
  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ(error_of([&] { job.wait_for(1h, stop.get_token()); }).code(), "interrupted");
  job.cancel();
  job.cancel();  // has ended
  EXPECT_EQ(job.info().state, "cancelled");
  EXPECT_THAT(server.lines(), Contains("DELETE /v1/jobs/j-1").Times(1));
  EXPECT_EQ(error_of([&] { job.wait(); }).code(), "cancelled");
}

TEST(Job, a_cancel_leaves_the_record_of_one_that_has_ended_meanwhile) {
  ScriptedServer server({job_response("queued"), job_response("done")});
  Client client(server.url());
  Job job = client.start("voxelize", Input::of_asset("sha256-a"), {});
  job.cancel();
  EXPECT_EQ(job.info().state, "done");
  EXPECT_THAT(server.lines(), ElementsAre("POST /v1/jobs", "DELETE /v1/jobs/j-1"));
}

TEST(Job, a_failure_is_thrown_by_the_result_and_not_by_the_poll) {
  ScriptedServer server(
      {job_response("queued"),
       job_response("failed", R"("error":{"code":"malformed-mesh","detail":"a.ply line 3"})")});
  Client client(server.url());
  Job job = client.start("voxelize", Input::of_asset("sha256-a"), {});
  EXPECT_TRUE(job.poll());
  for (int i = 0; i < 2; ++i) EXPECT_EQ(error_of([&] { job.grid(); }).code(), "malformed-mesh");
  EXPECT_THAT(server.asked(), SizeIs(2));
}

TEST(Job, a_grid_of_another_format_is_that_from_which_it_was_written) {
  const std::string npz = R"("result":{"grid":"sha256-g","media_type":"application/x-npz"})";
  const std::string png = R"("result":{"media_type":"image/png"})";
  ScriptedServer server({job_response("done", npz), CannedResponse{.body = container_of(9)},
                         job_response("done", png)});
  Client client(server.url());
  EXPECT_EQ(client.attach("j-1").grid().voxel_count(), 9u);
  EXPECT_EQ(server.lines()[1], "GET /v1/grids/sha256-g");
  Job image = client.attach("j-1");
  const Error error = error_of([&] { image.grid(); });
  EXPECT_EQ(error.code(), "conflict");
  EXPECT_STREQ(error.what(), "the result of the job j-1: expected a grid, got image/png");
  EXPECT_EQ(error_of([&] { image.sequence(); }).code(), "conflict");
}

TEST(Job, the_first_of_several_that_ends_is_found) {
  ScriptedServer server({job_response("queued"), job_response("queued"), job_response("running"),
                         job_response("running"), job_response("running"), job_response("done"),
                         job_response("running"), job_response("running")});
  Client client(server.url());
  std::vector<Job> jobs;
  EXPECT_EQ(wait_any(jobs), std::nullopt);
  for (int i = 0; i < 2; ++i) jobs.push_back(client.start("voxelize", Input::of_asset("a"), {}));
  EXPECT_EQ(wait_any(jobs), 1u);
  EXPECT_EQ(wait_any(std::span(jobs).subspan(1)), 0u);  // without a request
  EXPECT_EQ(wait_any(std::span(jobs).first(1), 10ms), std::nullopt);
  EXPECT_THAT(server.asked(), SizeIs(AnyOf(7u, 8u)));  // one look may take longer than 10 ms
}

}  // namespace
}  // namespace voxeld::client
