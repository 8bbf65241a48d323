#include "proto/messages/job.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "proto/messages/job_text.h"
#include "proto/messages/json_fields.h"
#include "proto/messages/json_writer.h"
#include "tests/unit/proto/tied_members.h"

namespace voxeld {

// All members, as in tied_members.h.
inline auto tied(const JobResult& r) {
  const auto& [a, b, c, d, e, f, g, h] = r;
  return std::tie(a, b, c, d, e, f, g, h);
}
inline auto tied(const JobEstimate& estimate) {
  const auto& [a, b, c, d, e, f, g, h] = estimate;
  return std::tie(a, b, c, d, e, f, g, h);
}
inline auto tied(const JobStatus& s) {
  const auto& [a1, a2, a3, a4, a5, a6, a7, a8, b1, b2, b3, b4, b5, b6, b7, b8, c1, c2, c3, c4, c5,
               c6, c7, c8, d1, d2, d3, d4, d5, d6, d7] = s;
  return std::tie(a1, a2, a3, a4, a5, a6, a7, a8, b1, b2, b3, b4, b5, b6, b7, b8, c1, c2, c3, c4,
                  c5, c6, c7, c8, d1, d2, d3, d4, d5, d6, d7);
}

namespace {

using Json = nlohmann::json;

Error job_refusal(std::string_view text) {
  const auto request = parse_job_request(Json::parse(text));
  EXPECT_FALSE(request) << text;
  return request ? Error{} : request.error();
}

JobStatus finished() {
  JobStatus status;
  status.id = "j-0123";
  status.kind = JobKind::kRender;
  status.state = JobState::kDone;
  status.asset = "sha256-1";
  status.grid = "sha256-6";
  status.filename = "b.ply";
  status.options_json = R"({"width":5})";
  status.version = 9;
  status.attempt = 2;
  status.preempted = 8;
  status.tiles_done = 3;
  status.tiles_total = 4;
  status.frames_done = 6;
  status.frames_total = 7;
  status.sequence = "sha256-4";
  status.stage = "encode";
  status.queue_position = 5;
  status.created_ms = 1'700'000'000'000;
  status.started_ms = 1'700'000'000'001;
  status.ended_ms = 1'700'000'000'002;
  status.priority = -3;
  status.deadline_at_ms = 1'700'000'000'009;
  status.device_ms = 12.5;
  status.waiting_for = "a worker";
  status.timings = {{"parse", 1.5}, {"render", 20}};
  status.cached = true;
  status.result =
      JobResult{"sha256-2", 77,         "image/png",           "b.png",
                "sha256-3", "sha256-5", R"({"dims":[1,2,3]})", {{"missing-texture", "a.png"}}};
  return status;
}

TEST(JobNames, lead_back_to_their_values) {
  for (const JobKind kind :
       {JobKind::kVoxelize, JobKind::kRender, JobKind::kExport, JobKind::kInspect}) {
    EXPECT_EQ(job_kind_from_name(job_kind_name(kind)), kind);
  }
  for (const JobState state : {JobState::kQueued, JobState::kRunning, JobState::kDone,
                               JobState::kFailed, JobState::kCancelled}) {
    EXPECT_EQ(job_state_from_name(job_state_name(state)), state);
  }
  EXPECT_EQ(job_kind_name(JobKind::kInspect), "inspect");
  EXPECT_EQ(job_state_name(JobState::kCancelled), "cancelled");
  EXPECT_FALSE(job_kind_from_name("Render"));
  EXPECT_FALSE(job_state_from_name(""));
}

TEST(JobRequest, each_kind_takes_its_input_and_the_options_of_its_scope) {
  struct Case {
    std::string_view text;
    JobKind kind;
    OptionScope scope;
  };
  for (const auto& [text, kind, scope] :
       {Case{R"({"kind":"voxelize","asset":"a","options":{"size":9,"format":"npy"}})",
             JobKind::kVoxelize, OptionScope::kVoxelize},
        Case{R"({"kind":"render","asset":"a","options":{"size":9,"width":5}})", JobKind::kRender,
             OptionScope::kRenderMesh},
        Case{R"({"kind":"render","grid":"g","options":{"width":5}})", JobKind::kRender,
             OptionScope::kRenderGrid},
        Case{R"({"kind":"export","grid":"g","options":{"format":"vox"}})", JobKind::kExport,
             OptionScope::kExport},
        Case{R"({"kind":"export","sequence":"s","options":{"format":"vox","frames":"2..4"}})",
             JobKind::kExport, OptionScope::kExport},
        Case{R"({"kind":"render","sequence":"s","options":{"image":"gif","frames":"2..4"}})",
             JobKind::kRender, OptionScope::kRenderGrid},
        Case{R"({"kind":"render","grid":"g","options":{"image":"gif","turntable":9}})",
             JobKind::kRender, OptionScope::kRenderGrid},
        Case{R"({"kind":"inspect","asset":"a"})", JobKind::kInspect, OptionScope::kVoxelize}}) {
    const auto request = parse_job_request(Json::parse(text));
    ASSERT_TRUE(request) << text << request.error().message();
    EXPECT_EQ(request->kind, kind);
    EXPECT_EQ(option_scope(*request), scope) << text;
  }
}

TEST(JobRequest, exactly_one_input_of_the_right_sort_is_needed) {
  EXPECT_EQ(job_refusal(R"({"kind":"voxelize"})").message(),
            "job: input of kind voxelize: expected asset, got none");
  EXPECT_EQ(job_refusal(R"({"kind":"voxelize","grid":"g"})").message(),
            "job: input of kind voxelize: expected asset, got grid");
  EXPECT_EQ(
      job_refusal(R"({"kind":"render","asset":"a","grid":"g"})").message(),
      "job: input of kind render: expected one of asset, grid and sequence, got asset and grid");
  EXPECT_EQ(job_refusal(R"({"kind":"export","asset":"a"})").message(),
            "job: input of kind export: expected either grid or sequence, got asset");
  EXPECT_EQ(job_refusal(R"({"kind":"inspect","grid":"g"})").message(),
            "job: input of kind inspect: expected asset, got grid");
}

TEST(JobRequest, options_of_a_mesh_that_is_still_to_come_are_those_of_an_asset) {
  JobRequest request;
  request.kind = JobKind::kRender;
  EXPECT_EQ(option_scope(request), OptionScope::kRenderMesh);
}

TEST(JobRequest, a_sequence_is_an_input_as_a_grid_is) {
  EXPECT_EQ(job_refusal(R"({"kind":"voxelize","sequence":"s"})").message(),
            "job: input of kind voxelize: expected asset, got sequence");
  EXPECT_EQ(job_refusal(R"({"kind":"export","grid":"g","sequence":"s"})").message(),
            "job: input of kind export: expected either grid or sequence, got grid and sequence");
  EXPECT_EQ(job_refusal(R"({"kind":"render","asset":"a","grid":"g","sequence":"s"})").got,
            "asset and grid and sequence");
}

TEST(JobRequest, frame_options_need_an_input_with_frames) {
  EXPECT_EQ(job_refusal(R"({"kind":"export","grid":"g","options":{"frames":"0..3"}})").message(),
            "frames: expected a sequence as input, got a grid");
  EXPECT_EQ(job_refusal(R"({"kind":"render","grid":"g","options":{"frame":1}})").message(),
            "frame: expected a sequence as input, got a grid");
  for (const char* image : {"gif", "apng", "sheet"}) {
    EXPECT_EQ(job_refusal(R"({"kind":"render","grid":"g","options":{"image":")" +
                          std::string(image) + R"("}})")
                  .message(),
              "image: expected png, or turntable with a grid as input, got a grid without "
              "turntable");
  }
  EXPECT_EQ(
      job_refusal(R"({"kind":"render","sequence":"s","options":{"image":"gif","turntable":9}})")
          .message(),
      "turntable: expected a grid as input, got a sequence");
}

TEST(JobRequest, members_are_checked_by_name_and_type) {
  EXPECT_EQ(job_refusal("[]").message(), "job: expected an object, got array");
  EXPECT_EQ(
      job_refusal(R"({"kind":"voxelize","asset":"a","size":5})").message(),
      "job: no such member: expected kind, asset, grid, sequence, filename, options, priority, "
      "deadline_ms, got \"size\"");
  EXPECT_EQ(job_refusal(R"({"kind":7})").message(), "job.kind: expected a text, got number");
  EXPECT_EQ(job_refusal(R"({"kind":"voxelize","asset":null})").message(),
            "job.asset: expected a text, got null");
  EXPECT_EQ(job_refusal(R"({"kind":"sculpt"})").message(),
            "job.kind: expected voxelize | render | export | inspect, got \"sculpt\"");
  EXPECT_EQ(job_refusal(R"({})").message(), "job.kind: expected a value, got nothing");
  EXPECT_EQ(job_refusal(R"({"knd":"voxelize","asset":"a"})").message(),
            "job: no such member: expected kind, asset, grid, sequence, filename, options, "
            "priority, deadline_ms, got \"knd\"");
  EXPECT_EQ(job_refusal(R"({"kind":"voxelize","asset":"a","options":[]})").message(),
            "options: expected an object, got array");
  EXPECT_EQ(job_refusal(R"({"kind":"voxelize","asset":"a","options":{"size":0}})").message(),
            "size: expected an integer from 1 to 16384, got \"0\"");
  EXPECT_EQ(job_refusal(R"({"kind":"export","grid":"g","options":{"size":5}})").code,
            ErrorCode::kUnknownOption);
}

TEST(JobRequest, priority_and_deadline_outside_their_ranges_are_refused) {
  const auto request = parse_job_request(
      Json::parse(R"({"kind":"voxelize","asset":"a","priority":-100,"deadline_ms":1})"));
  ASSERT_TRUE(request) << request.error().message();
  EXPECT_EQ(request->priority, -100);
  EXPECT_EQ(request->deadline_ms, 1);
  const auto plain = parse_job_request(Json::parse(R"({"kind":"voxelize","asset":"a"})"));
  EXPECT_FALSE(plain->priority);
  EXPECT_FALSE(plain->deadline_ms);
  EXPECT_EQ(job_refusal(R"({"kind":"voxelize","asset":"a","priority":101})").message(),
            "priority: expected -100 to 100, got 101");
  EXPECT_EQ(job_refusal(R"({"kind":"voxelize","asset":"a","deadline_ms":0})").message(),
            "deadline_ms: expected 1 to 31622400000 milliseconds from now, got 0");
  EXPECT_EQ(job_refusal(R"({"kind":"voxelize","asset":"a","priority":1.5})").message(),
            "job.priority: expected an integer, got number");
}

TEST(JobRequest, the_filename_may_stand_in_the_options) {
  const auto request = parse_job_request(
      Json::parse(R"({"kind":"voxelize","asset":"a","options":{"filename":"b.stl"}})"));
  ASSERT_TRUE(request);
  EXPECT_EQ(request->filename, "b.stl");
}

template <typename Struct>
void expect_no_defaults(const Struct& full) {
  const Struct fresh{};
  const auto all = tied(full), none = tied(fresh);
  const bool each_differs = [&]<size_t... I>(std::index_sequence<I...>) {
    return (!(std::get<I>(all) == std::get<I>(none)) && ...);
  }
  (std::make_index_sequence<std::tuple_size_v<decltype(all)>>());
  EXPECT_TRUE(each_differs) << "a member has its default value";
}

TEST(JobStatus, every_member_is_written) {
  JobStatus status = finished();
  status.error = Error{ErrorCode::kMalformedMesh, "a.obj line 3: index", "1 to 8", "9"};
  status.estimate = JobEstimate{1.5, 1, 2.5, 0.5, 1000, 1 << 30, 17, 5.5};
  status.expected_start_ms = 1'700'000'000'003;
  status.expected_end_ms = 1'700'000'000'004;
  expect_no_defaults(status);
  expect_no_defaults(*status.result);
  expect_no_defaults(*status.error);
  expect_no_defaults(*status.estimate);
  const Json json = Json::parse(job_status_text(status));
  EXPECT_EQ(json, Json::parse(R"({
    "id": "j-0123", "kind": "render", "state": "done", "asset": "sha256-1", "grid": "sha256-6",
    "sequence": "sha256-4", "version": 9, "attempt": 2, "preempted": 8, "tiles_done": 3,
    "tiles_total": 4, "frames_done": 6, "frames_total": 7, "queue_position": 5,
    "created_ms": 1700000000000, "started_ms": 1700000000001, "ended_ms": 1700000000002,
    "priority": -3, "deadline_at_ms": 1700000000009, "device_ms": 12.5, "cached": true,
    "filename": "b.ply", "stage": "encode", "waiting_for": "a worker",
    "timings": {"parse": 1.5, "render": 20},
    "error": {"code": "malformed-mesh", "detail": "a.obj line 3: index", "expected": "1 to 8",
              "got": "9"},
    "estimate": {"seconds": 1.5, "seconds_low": 1, "seconds_high": 2.5, "device_seconds": 0.5,
                 "result_bytes": 1000, "host_bytes": 1073741824, "learned_from": 17,
                 "overrun": 5.5},
    "expected_start_ms": 1700000000003, "expected_end_ms": 1700000000004,
    "options": {"width": 5},
    "result": {"blob": "sha256-2", "bytes": 77, "media_type": "image/png", "filename": "b.png",
               "grid": "sha256-3", "sequence": "sha256-5", "meta": {"dims": [1, 2, 3]},
               "warnings": [{"code": "missing-texture", "detail": "a.png"}]}})"));
  EXPECT_EQ(json.size(), std::tuple_size_v<decltype(tied(status))>);
}

TEST(JobStatus, a_failed_job_carries_its_error_and_no_result) {
  JobStatus status;
  status.state = JobState::kFailed;
  status.error = Error{ErrorCode::kMalformedMesh, "a.obj line 3: index", "1 to 8", "9"};
  const Json json = Json::parse(job_status_text(status));
  EXPECT_FALSE(json.contains("result"));
  EXPECT_EQ(json["error"]["code"], "malformed-mesh");
  EXPECT_EQ(json["error"]["expected"], "1 to 8");
}

TEST(JobStatus, only_the_three_last_states_are_ended) {
  JobStatus status;
  for (const auto& [state, ended] : {std::pair{JobState::kQueued, false},
                                     {JobState::kRunning, false},
                                     {JobState::kDone, true},
                                     {JobState::kFailed, true},
                                     {JobState::kCancelled, true}}) {
    status.state = state;
    EXPECT_EQ(status.ended(), ended) << job_state_name(state);
  }
}

TEST(JobStatus, meta_that_is_no_object_is_written_as_an_empty_one) {
  JobStatus status = finished();
  for (const char* meta : {"", "[1]", "{", "5"}) {
    status.result->meta_json = meta;
    EXPECT_EQ(Json::parse(job_status_text(status))["result"]["meta"].dump(), "{}") << meta;
  }
}

TEST(JobStatus, a_row_of_a_job_with_long_texts_is_bounded_and_names_what_it_leaves_out) {
  JobStatus status = finished();
  const std::string megabyte(1 << 20, 'x');
  status.options_json = R"({"times":[)" + std::string(200'000, '1') + "]}";
  status.result->meta_json = R"({"labels":")" + megabyte + "\"}";
  for (int i = 0; i < 1000; ++i) status.result->warnings.push_back({"missing-texture", "x.png"});
  status.filename = megabyte;
  status.error = Error{ErrorCode::kInternal, megabyte, megabyte, megabyte};
  const std::string text = job_row_text(status);
  EXPECT_LT(text.size(), 8 * limits::kRowTextBytesMax);
  const Json row = Json::parse(text);
  EXPECT_EQ(row["left_out"], (std::vector<std::string>{"options", "meta"}));
  EXPECT_FALSE(row.contains("options"));
  EXPECT_FALSE(row["result"].contains("meta"));
  EXPECT_EQ(row["result"]["warnings"][0]["code"], "left-out");
  EXPECT_EQ(row["id"], status.id);
  EXPECT_EQ(Json::parse(job_status_text(status))["result"]["meta"]["labels"], megabyte);
  EXPECT_FALSE(Json::parse(job_row_text(finished())).contains("left_out"));
}

TEST(JobStatus, an_event_and_the_members_of_its_row_make_the_row) {
  JobStatus status = finished();
  status.filename = R"(a","state":"done".ply)";
  const std::string event = job_event_text(status);
  const Json changing = Json::parse(event);
  for (const char* name : {"options", "result", "left_out"}) EXPECT_FALSE(changing.contains(name));
  EXPECT_EQ(Json::parse(with_fixed_members(event, status)), Json::parse(job_row_text(status)));
  JobStatus before = status;  // the row has a result by now, the event is older
  before.state = JobState::kRunning;
  const Json old = Json::parse(with_fixed_members(job_event_text(before), status));
  EXPECT_TRUE(old.contains("options"));
  EXPECT_FALSE(old.contains("result"));
  EXPECT_EQ(with_fixed_members("", status), "");
}

TEST(JsonWriter, numbers_and_texts_read_back_unchanged) {
  std::string text;
  JsonWriter(text)
      .begin_object()
      .member("text", "a\"b\\c\n\xff")
      .member("large", std::numeric_limits<uint64_t>::max())
      .member("small", std::numeric_limits<int64_t>::min())
      .member("fraction", 0.1)
      .member("whole", 2.0)
      .member("none", std::nan(""))
      .member("yes", true)
      .member("list", std::array{1, 2, 3})
      .end_object();
  EXPECT_EQ(text, R"({"text":"a\"b\\c\n�","large":18446744073709551615,)"
                  R"("small":-9223372036854775808,"fraction":0.1,"whole":2.0,"none":null,)"
                  R"("yes":true,"list":[1,2,3]})");
}

TEST(Problem, has_the_members_of_rfc_9457_for_every_code) {
  for (const ErrorCodeInfo& info : all_error_codes()) {
    const Error error{info.code, "what", "this", "that"};
    const Json json = problem_json(error, "/v1/jobs/1");
    EXPECT_EQ(json["type"], "urn:voxeld:error:" + std::string(info.name));
    EXPECT_EQ(json["title"], info.title);
    EXPECT_EQ(json["status"], info.http_status);
    EXPECT_EQ(json["code"], info.name);
    EXPECT_EQ(json["detail"], "what");
    EXPECT_EQ(json["instance"], "/v1/jobs/1");
    Error back;
    EXPECT_TRUE(read_value(json, back));
    EXPECT_EQ(back.code, info.code);
    EXPECT_EQ(back.message(), error.message());
  }
  const Json brief = problem_json({ErrorCode::kGone, "what", "", ""}, "");
  EXPECT_FALSE(brief.contains("expected") || brief.contains("got") || brief.contains("instance"));
}

TEST(Problem, an_invalid_problem_document_is_internal_with_a_reason) {
  const auto read = [](const Json& json) {
    Error error;
    EXPECT_TRUE(read_value(json, error));
    return error;
  };
  EXPECT_EQ(read("oops").code, ErrorCode::kInternal);
  EXPECT_EQ(read("oops").message(),
            "not a problem document: error: expected an object, got string");
  EXPECT_EQ(read({{"code", 5}}).code, ErrorCode::kInternal);
  EXPECT_EQ(read({{"code", "of-tomorrow"}, {"detail", "x"}}).message(), "x");
  EXPECT_EQ(read({{"code", "of-tomorrow"}}).code, ErrorCode::kInternal);
}

}  // namespace
}  // namespace voxeld
