#include "proto/messages/task_api.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "proto/messages/task_bounds.h"
#include "tests/unit/proto/tied_members.h"

namespace voxeld {

// All members, as in tied_members.h.
inline auto tied(const WorkerHello& h) {
  const auto& [a, b, c, d, e, f, g, i] = h;
  return std::tie(a, b, c, d, e, f, g, i);
}
inline auto tied(const WorkerFolders& f) {
  const auto& [a, b, c, d] = f;
  return std::tie(a, b, c, d);
}
inline auto tied(const TaskDoneFrame& f) {
  const auto& [a, b, c, d, e] = f;
  return std::tie(a, b, c, d, e);
}
inline auto tied(const Task& t) {
  const auto& [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r] = t;
  return std::tie(a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r);
}
inline auto tied(const DeviceMemory& m) {
  const auto& [a, b] = m;
  return std::tie(a, b);
}
inline auto tied(const TaskProgress& p) {
  const auto& [a, b, c, d, e, f, g, h, i, j] = p;
  return std::tie(a, b, c, d, e, f, g, h, i, j);
}
inline auto tied(const TaskProgressReply& r) {
  const auto& [a, b, c] = r;
  return std::tie(a, b, c);
}
inline auto tied(const TaskPartReply& r) {
  const auto& [a, b, c] = r;
  return std::tie(a, b, c);
}
inline auto tied(const TaskFrame& f) {
  const auto& [a, b, c, d, e, g, h, i] = f;
  return std::tie(a, b, c, d, e, g, h, i);
}
inline auto tied(const TaskFrameReply& r) {
  const auto& [a, b, c, d] = r;
  return std::tie(a, b, c, d);
}
inline auto tied(const TaskPart& p) {
  const auto& [a, b, c, d] = p;
  return std::tie(a, b, c, d);
}
inline auto tied(const TaskOutput& o) {
  const auto& [a, b, c, d] = o;
  return std::tie(a, b, c, d);
}
inline auto tied(const TaskCompletion& t) {
  const auto& [a, b, c, d, e, f] = t;
  return std::tie(a, b, c, d, e, f);
}
inline auto tied(const TaskPreemption& p) {
  const auto& [a, b, c, d, e] = p;
  return std::tie(a, b, c, d, e);
}
inline auto tied(const TaskFailure& f) {
  const auto& [a, b, c] = f;
  return std::tie(a, b, c);
}
inline auto tied(const SlicesHello& h) {
  const auto& [a, b, c] = h;
  return std::tie(a, b, c);
}
inline auto tied(const SliceRequest& r) {
  const auto& [a, b, c, d, e] = r;
  return std::tie(a, b, c, d, e);
}
inline auto tied(const SliceReply& r) {
  const auto& [a, b, c, d] = r;
  return std::tie(a, b, c, d);
}

namespace {

using Json = nlohmann::json;

// Each has another value than the default in every member.
WorkerHello hello() {
  return {3, 4711, "egl:0", "Example GPU", "4.6.0", R"({"limit":5})", "full", "raster: touch"};
}
WorkerFolders folders() {
  return {"/s/out", "/s/in", "/s/cache", 12'345'678'901};
}
Task task() {
  return {.id = "j-1",
          .fence = 7,
          .attempt = 2,
          .kind = JobKind::kRender,
          .input_path = "/data/blob",
          .input_hash = "sha256-1",
          .input_is_grid = true,
          .input_is_sequence = true,
          .frame_paths = {"/data/f0", "/data/f1"},
          .bundle_paths = {"/data/b0"},
          .filename = "b.ply",
          .options_json = R"({"width":5})",
          .part_paths = {"/data/p0", "/data/p1"},
          .done_frames = {{"sha256-2", "/data/d0", 0.5, 12'345'678'901, "sha256-3"}},
          .tenant = "lab",
          .request_id = "r-1",
          .trace_id = "t-1",
          .cells_max = 1'000'000'000'000};
}
TaskProgress progress() {
  return {"j-1", 7, "voxelize", 3, 8, 2, 9, {1 << 30, 1 << 20}, true, 1500};
}
TaskPreemption preempt() {
  return {"j-1", 7, 3, 8, {{"voxelize", 12.5}, {"parse", 1}}};
}
TaskFrame frame() {
  return {"j-1", 7, 4095, 1.25, "/scratch/f", 12'345'678'901, "sha256-" + std::string(64, '5'),
          4096};
}
TaskFrameReply frame_reply() {
  return {true, true, "sha256-6", "/data/6"};
}
TaskPart part() {
  return {"j-1", 7, 4095, "/scratch/p"};
}
TaskCompletion completion() {
  return {"j-1",
          7,
          {{"result", "/scratch/a", "application/x-npy", "b.npy"},
           {"grid", "/scratch/b", "application/vnd.voxeld.grid", "b.voxg"}},
          {{"voxelize", 12.5}, {"parse", 1}},
          R"({"dims":[1,2,3]})",
          {{"missing-texture", "a.png"}}};
}
TaskFailure failure() {
  return {"j-1", 7, {ErrorCode::kMalformedMesh, "b.ply line 3: x", "a number", "\"y\""}};
}

SlicesHello slices() {
  return {3, 4711, "egl:0"};
}
SliceRequest slice() {
  return {SliceAction::kRenew, "j-1", 7, 12'345'678'901, 5};
}
SliceReply slice_reply() {
  return {true, true, true, Error{ErrorCode::kGridTooLarge, "x", "y", "z"}};
}

// The messages and, for each, how it is read.
struct Message {
  std::string type;
  Json json;
  std::function<Status(const Json&)> parse;
};
template <typename T>
std::function<Status(const Json&)> with(Result<T> (*parse)(const Json&)) {
  return [parse](const Json& json) -> Status {
    VOXELD_TRY(parse(json));
    return {};
  };
}
std::vector<Message> messages() {
  return {{"hello", to_json_message(hello()), with(parse_worker_hello)},
          {"folders", to_json_message(folders()), with(parse_worker_folders)},
          {"task", to_json_message(task()), with(parse_task)},
          {"progress", to_json_message(progress()), with(parse_task_progress)},
          {"frame", to_json_message(frame()), with(parse_task_frame)},
          {"complete", to_json_message(completion()), with(parse_task_completion)},
          {"preempt", to_json_message(preempt()), with(parse_task_preempt)},
          {"fail", to_json_message(failure()), with(parse_task_failure)}};
}

template <typename Message>
void expect_message_round_trip(const Message& full, Result<Message> (*parse)(const Json&)) {
  const Json json = to_json_message(full);
  SCOPED_TRACE(json.dump());
  const Message fresh{};
  const auto all = tied(full), none = tied(fresh);
  const bool each_differs = [&]<size_t... I>(std::index_sequence<I...>) {
    return (!(std::get<I>(all) == std::get<I>(none)) && ...);
  }
  (std::make_index_sequence<std::tuple_size_v<decltype(all)>>());
  EXPECT_TRUE(each_differs) << "a member has its default value";
  const auto back = parse(json);
  ASSERT_TRUE(back) << back.error().message();
  EXPECT_TRUE(*back == full) << to_json_message(*back).dump();
}

TEST(TaskApi, every_member_of_every_message_comes_back) {
  expect_message_round_trip(hello(), parse_worker_hello);
  expect_message_round_trip(folders(), parse_worker_folders);
  expect_message_round_trip(task(), parse_task);
  expect_message_round_trip(progress(), parse_task_progress);
  expect_message_round_trip(TaskProgressReply{true, true, true}, parse_task_progress_reply);
  expect_message_round_trip(frame(), parse_task_frame);
  expect_message_round_trip(frame_reply(), parse_task_frame_reply);
  expect_message_round_trip(part(), parse_task_part);
  expect_message_round_trip(TaskPartReply{true, true, "storage-full"}, parse_task_part_reply);
  expect_message_round_trip(completion(), parse_task_completion);
  expect_message_round_trip(preempt(), parse_task_preempt);
  expect_message_round_trip(failure(), parse_task_failure);
  expect_message_round_trip(slices(), parse_slices_hello);
  expect_message_round_trip(slice(), parse_slice_request);
  expect_message_round_trip(slice_reply(), parse_slice_reply);
}

TEST(TaskApi, the_action_of_a_time_slice_is_its_type) {
  for (const SliceAction action : {SliceAction::kTake, SliceAction::kRenew, SliceAction::kGive}) {
    SliceRequest other = slice();
    other.action = action;
    EXPECT_EQ(parse_slice_request(to_json_message(other))->action, action);
  }
  EXPECT_FALSE(parse_slices_hello(to_json_message(slice())));
  EXPECT_EQ(parse_slice_request(to_json_message(slices())).error().message(),
            "slice.task: expected a value, got nothing");
  Json odd = to_json_message(slice());
  odd["type"] = "slice_steal";
  EXPECT_EQ(parse_slice_request(odd).error().message(),
            "slice.type: expected slice_take | slice_renew | slice_give, got \"slice_steal\"");
  const Json plain = to_json_message(SliceReply{true, false, false, {}});
  EXPECT_FALSE(plain.contains("error"));
  EXPECT_FALSE(parse_slice_reply(plain)->error);
}

TEST(TaskApi, a_preempted_task_has_done_no_more_than_all) {
  for (const int64_t done : {-1, 9}) {
    Json other = to_json_message(preempt());
    other["tiles_done"] = done;
    EXPECT_EQ(parse_task_preempt(other).error().message(),
              "preempt.tiles_done: expected 0 to 8, got " + std::to_string(done));
  }
}

TEST(TaskApi, an_empty_reply_is_refused) {
  EXPECT_EQ(parse_task_frame_reply(Json::object()).error().message(),
            "reply.cancel: expected a value, got nothing");
}

// {message, member, value, error}
TEST(TaskApi, members_out_of_bounds_are_refused_by_their_name) {
  struct Case {
    Json message;
    std::string member;
    Json value;
    std::string error;
  };
  const std::string name(256, 'n'), path(4097, 'p'), text(2001, 't');
  const std::vector<Case> cases = {
      {to_json_message(hello()), "/device", name,
       "hello.device: expected at most 255 bytes, got 256"},
      {to_json_message(hello()), "/renderer", "a\nb",
       "hello.renderer: expected text without control characters, got a?b"},
      {to_json_message(hello()), "/driver", name,
       "hello.driver: expected at most 255 bytes, got 256"},
      {to_json_message(hello()), "/sandbox", name,
       "hello.sandbox: expected at most 255 bytes, got 256"},
      {to_json_message(hello()), "/device_failure", std::string(6001, 'f'),
       "hello.device_failure: expected at most 6000 bytes, got 6001"},
      {to_json_message(hello()), "/device_json", "[1]",
       "hello.device_json: expected an object, got array"},
      {to_json_message(progress()), "/stage", "nap",
       "progress.stage: expected parse, place, voxelize, render, encode or inspect, got nap"},
      {to_json_message(progress()), "/tiles_done", -1,
       "progress.tiles_done: expected 0 to 4294967296, got -1"},
      {to_json_message(progress()), "/tiles_total", (int64_t{1} << 32) + 1,
       "progress.tiles_total: expected 0 to 4294967296, got 4294967297"},
      {to_json_message(progress()), "/frames_done", 4097,
       "progress.frames_done: expected 0 to 4096, got 4097"},
      {to_json_message(progress()), "/frames_total", -1,
       "progress.frames_total: expected 0 to 4096, got -1"},
      {to_json_message(progress()), "/device_bytes_total", -1,
       "progress.device_bytes_total: expected 0 to 1125899906842624, got -1"},
      {to_json_message(progress()), "/device_bytes_free", -1,
       "progress.device_bytes_free: expected 0 to 1125899906842624, got -1"},
      {to_json_message(progress()), "/preparation_ms", -1,
       "progress.preparation_ms: expected 0 to 10000000000, got -1"},
      {to_json_message(frame()), "/time_s", -1.5,
       "frame.time_s: expected seconds from 0 on, got -1.5"},
      {to_json_message(frame()), "/path", path,
       "frame.path: expected at most 4096 bytes, got 4097"},
      {to_json_message(frame()), "/content_hash", "5",
       "frame.content_hash: expected sha256- and 64 hex digits, got 5"},
      {to_json_message(part()), "/position", 4096, "part.position: expected 0 to 4095, got 4096"},
      {to_json_message(part()), "/path", path, "part.path: expected at most 4096 bytes, got 4097"},
      {to_json_message(completion()), "/outputs",
       std::vector<Json>(9, to_json_message(completion())["outputs"][0]),
       "complete.outputs: expected at most 8, got 9"},
      {to_json_message(completion()), "/outputs/1/role", "mesh",
       "complete.outputs[1].role: expected result, grid or sequence, got mesh"},
      {to_json_message(completion()), "/outputs/1/path", path,
       "complete.outputs[1].path: expected at most 4096 bytes, got 4097"},
      {to_json_message(completion()), "/outputs/0/media_type", "text/html",
       "complete.outputs[0].media_type: expected that of a format of results, got text/html"},
      {to_json_message(completion()), "/outputs/0/filename", text,
       "complete.outputs[0].filename: expected at most 2000 bytes, got 2001"},
      {to_json_message(completion()), "/outputs/0", 5,
       "complete.outputs[0]: expected an object, got number"},
      {to_json_message(completion()), "/timings/0/0", "nap",
       "complete.timings: expected parse, place, voxelize, render, encode or inspect, got nap"},
      {to_json_message(completion()), "/timings/1/1", -1,
       "complete.timings of parse: expected milliseconds from 0 to 1e10, got -1.000000"},
      {to_json_message(completion()), "/timings", std::vector<Json>(33, Json{"parse", 1}),
       "complete.timings: expected at most 32, got 33"},
      {to_json_message(completion()), "/timings/0", Json::array({"parse", 1, 2}),
       "complete.timings: expected pairs of stage and milliseconds"},
      {to_json_message(completion()), "/timings", 5,
       "complete.timings: expected a list, got number"},
      {to_json_message(completion()), "/meta_json", "{",
       "complete.meta_json: JSON: syntax error at byte 2: expected a JSON value"},
      {to_json_message(completion()), "/warnings", std::vector<Json>(257, Json{{"code", "a"}}),
       "complete.warnings: expected at most 256, got 257"},
      {to_json_message(completion()), "/warnings/0/code", name,
       "complete.warnings[0].code: expected at most 255 bytes, got 256"},
      {to_json_message(completion()), "/warnings/0/detail", text,
       "complete.warnings[0].detail: expected at most 2000 bytes, got 2001"},
      {to_json_message(preempt()), "/tiles_total", -1,
       "preempt.tiles_total: expected 0 to 4294967296, got -1"},
      {to_json_message(preempt()), "/timings/0/0", "nap",
       "preempt.timings: expected parse, place, voxelize, render, encode or inspect, got nap"},
      {to_json_message(failure()), "/error/got", std::string(6001, 'g'),
       "fail.error.got: expected at most 6000 bytes, got 6001"},
      {to_json_message(slices()), "/device", name,
       "slices.device: expected at most 255 bytes, got 256"},
      {to_json_message(slice()), "/host_bytes", -1,
       "slice.host_bytes: expected 0 to 1125899906842624, got -1"},
      {to_json_message(slice()), "/device_bytes", -1,
       "slice.device_bytes: expected 0 to 1125899906842624, got -1"},
  };
  std::vector<Message> known = messages();
  known.push_back({"part", to_json_message(part()), with(parse_task_part)});
  known.push_back({"slices", to_json_message(slices()), with(parse_slices_hello)});
  known.push_back({"slice_renew", to_json_message(slice()), with(parse_slice_request)});
  for (const Case& one : cases) {
    const auto reader =
        std::ranges::find(known, one.message["type"].get<std::string>(), &Message::type);
    ASSERT_NE(reader, known.end()) << one.message["type"];
    Json message = one.message;
    message[Json::json_pointer(one.member)] = one.value;
    const Status status = reader->parse(message);
    ASSERT_FALSE(status) << one.error;
    EXPECT_EQ(status.error().message(), one.error);
    EXPECT_EQ(status.error().code, ErrorCode::kBadRequest);
  }
}

TEST(TaskApi, a_completion_is_checked_before_it_is_sent) {
  TaskCompletion done = completion();
  EXPECT_TRUE(check_bounds(done));
  done.warnings.push_back({"long", std::string(2001, 'w')});
  EXPECT_EQ(check_bounds(done).error().message(),
            "complete.warnings[1].detail: expected at most 2000 bytes, got 2001");
}

TEST(TaskApi, frames_that_cannot_be_are_refused) {
  for (const int64_t index : {int64_t{-1}, int64_t{4096}, INT64_MAX}) {
    Json message = to_json_message(frame());
    message["index"] = index;
    EXPECT_EQ(parse_task_frame(message).error().message(),
              "frame.index: expected 0 to 4095, got " + std::to_string(index));
  }
  Json message = to_json_message(frame());
  message["voxel_count"] = -5;
  EXPECT_EQ(parse_task_frame(message).error().message(),
            "frame.voxel_count: expected 0 or more, got -5");
  message = to_json_message(frame());
  message["frames_total"] = 4097;
  EXPECT_EQ(parse_task_frame(message).error().message(),
            "frame.frames_total: expected 0 to 4096, got 4097");
}

TEST(TaskApi, the_paths_of_the_longest_sequence_fit_into_a_message) {
  Task longest = task();
  longest.frame_paths.assign(4096, "/data/" + std::string(900, 'p'));
  const std::string text = to_json_message(longest).dump();
  EXPECT_FALSE(parse_json_bounded(text));
  const auto message = parse_task_message(text);
  ASSERT_TRUE(message) << message.error().message();
  EXPECT_EQ(parse_task(*message)->frame_paths.size(), 4096u);
  EXPECT_FALSE(parse_task_message(std::string(kTaskFrameBytesMax + 1, ' ')));
}

TEST(TaskApi, paths_are_lists_of_texts) {
  for (const char* name : {"frame_paths", "bundle_paths"}) {
    Json message = to_json_message(task());
    message[name] = {"/a", 5};
    EXPECT_EQ(parse_task(message).error().message(),
              "task." + std::string(name) + ": expected a list of texts, got array");
  }
}

// The messages of an honest worker about the worst file are within the bounds.
TEST(TaskApi, the_longest_names_and_errors_are_within_the_bounds) {
  TaskCompletion longest = completion();
  longest.outputs[0].filename = std::string(3 * 255, 'f') + ".npy";
  longest.warnings.assign(101, Warning{"missing-texture", std::string(500, '\xff')});
  const auto dumped = [](const Json& message) {
    return Json::parse(message.dump(-1, ' ', false, Json::error_handler_t::replace));
  };
  const auto back = parse_task_completion(dumped(to_json_message(longest)));
  EXPECT_TRUE(back) << back.error().message();
  TaskFailure failed = failure();
  failed.error.detail = std::string(limits::kTaskTextBytesMax, '\xff');
  const auto told = parse_task_failure(dumped(to_json_message(failed)));
  EXPECT_TRUE(told) << told.error().message();
  failed.error.detail = std::string(limits::kTaskErrorBytesMax + 1, 'x');
  EXPECT_EQ(parse_task_failure(to_json_message(failed)).error().message(),
            "fail.error.detail: expected at most 6000 bytes, got 6001");
}

TEST(TaskApi, another_type_of_message_is_refused_by_its_name) {
  for (const Message& message : messages()) {
    EXPECT_EQ(message.json["type"], message.type);
    Json other = message.json;
    other["type"] = "dance";
    const Status status = message.parse(other);
    ASSERT_FALSE(status);
    EXPECT_EQ(status.error().code, ErrorCode::kBadRequest);
    EXPECT_EQ(status.error().message(), "message.type: expected " + message.type + ", got dance");
  }
}

TEST(TaskApi, a_value_that_is_not_an_object_is_refused) {
  for (const Message& message : messages()) {
    for (const Json& value :
         {Json(), Json(5), Json("x"), Json::array(), Json::array({message.json})}) {
      const Status status = message.parse(value);
      ASSERT_FALSE(status);
      EXPECT_EQ(status.error().message(),
                "message: expected an object, got " + std::string(value.type_name()));
    }
  }
}

TEST(TaskApi, every_member_of_another_type_is_refused_by_its_name) {
  for (const Message& message : messages()) {
    for (const auto& [name, value] : message.json.items()) {
      if (name == "type" || name == "error") continue;
      Json other = message.json;
      other[name] = value.is_object() ? Json::array() : Json::object();
      const Status status = message.parse(other);
      ASSERT_FALSE(status) << message.type << "." << name;
      EXPECT_EQ(status.error().code, ErrorCode::kBadRequest);
      EXPECT_NE(status.error().detail.find(name), std::string::npos) << status.error().message();
    }
  }
}

TEST(TaskApi, required_members_must_be_present) {
  const std::map<std::string, std::vector<std::string>> required = {
      {"hello", {"protocol", "pid", "device"}},
      {"folders", {"scratch_dir", "input_dir", "cache_dir", "disk_reserve_bytes"}},
      {"task", {"id", "fence", "kind", "input_path", "options_json"}},
      {"progress", {"task", "fence"}},
      {"frame", {"task", "fence", "index", "time_s", "path", "voxel_count", "content_hash"}},
      {"complete", {"task", "fence", "outputs", "timings", "warnings"}},
      {"preempt", {"task", "fence", "tiles_done", "tiles_total", "timings"}},
      {"fail", {"task", "fence", "error"}}};
  for (const Message& message : messages()) {
    for (const std::string& name : required.at(message.type)) {
      SCOPED_TRACE(message.type + "." + name);
      Json other = message.json;
      other.erase(name);
      const Status status = message.parse(other);
      ASSERT_FALSE(status);
      EXPECT_EQ(status.error().code, ErrorCode::kBadRequest);
      EXPECT_EQ(status.error().message(),
                message.type + "." + name + ": expected a value, got nothing");
    }
  }
}

TEST(TaskApi, integers_that_do_not_fit_their_field_are_refused) {
  Json message = to_json_message(task());
  message["attempt"] = int64_t{1} << 32;
  EXPECT_EQ(parse_task(message).error().message(),
            "task.attempt: expected an integer of 32 bits, got 4294967296");
  message = to_json_message(task());
  message["fence"] = UINT64_MAX;
  EXPECT_EQ(parse_task(message).error().message(),
            "task.fence: expected an integer of 64 bits, got 18446744073709551615");
  message["fence"] = 1.5;
  EXPECT_EQ(parse_task(message).error().message(), "task.fence: expected an integer, got number");
}

TEST(TaskApi, an_error_that_is_not_one_is_an_internal_error_of_the_worker) {
  Json message = to_json_message(failure());
  message["error"] = 5;
  const auto back = parse_task_failure(message);
  ASSERT_TRUE(back);
  EXPECT_EQ(back->error.code, ErrorCode::kInternal);
  EXPECT_EQ(back->error.message(), "not a problem document: error: expected an object, got number");
}

TEST(TaskApi, a_kind_of_a_newer_server_is_refused) {
  Json message = to_json_message(task());
  message["kind"] = "sculpt";
  EXPECT_EQ(parse_task(message).error().message(),
            "task.kind: expected voxelize | render | export | inspect, got \"sculpt\"");
}

}  // namespace
}  // namespace voxeld
