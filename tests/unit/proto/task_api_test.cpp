#include "proto/messages/task_api.h"

#include <gtest/gtest.h>

#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "proto/messages/task_bounds.h"

namespace voxeld {
namespace {

using Json = nlohmann::json;

WorkerHello hello() {
  return {3, 4711, "egl:0", "Example GPU", "4.6.0", R"({"limit":5})", "full"};
}
Task task() {
  Task task;
  task.id = "j-1";
  task.fence = 7;
  task.attempt = 2;
  task.kind = JobKind::kRender;
  task.input_path = "/data/blob";
  task.input_hash = "sha256-1";
  task.input_is_grid = true;
  task.input_is_sequence = true;
  task.frame_paths = {"/data/f0", "/data/f1"};
  task.bundle_paths = {"/data/b0"};
  task.filename = "b.ply";
  task.options_json = R"({"width":5})";
  task.tenant = "lab";
  return task;
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
  return {1, 4711, "egl:0"};
}
SliceRequest slice() {
  return {SliceAction::kTake, "j-1", 7, 12'345'678'901, 5};
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
          {"folders", to_json_message(WorkerFolders{"/s/out", "/s/in", "/s/cache"}),
           with(parse_worker_folders)},
          {"task", to_json_message(task()), with(parse_task)},
          {"progress", to_json_message(progress()), with(parse_task_progress)},
          {"frame", to_json_message(frame()), with(parse_task_frame)},
          {"complete", to_json_message(completion()), with(parse_task_completion)},
          {"preempt", to_json_message(preempt()), with(parse_task_preempt)},
          {"fail", to_json_message(failure()), with(parse_task_failure)}};
}

TEST(TaskApi, time_slices_come_back) {
  const auto hello = parse_slices_hello(to_json_message(slices()));
  ASSERT_TRUE(hello) << hello.error().message();
  EXPECT_EQ(hello->pid, 4711);
  EXPECT_EQ(hello->device, "egl:0");
  EXPECT_FALSE(parse_slices_hello(to_json_message(slice())));
  const auto request = parse_slice_request(to_json_message(slice()));
  ASSERT_TRUE(request) << request.error().message();
  EXPECT_EQ(request->action, SliceAction::kTake);
  EXPECT_EQ(request->task, "j-1");
  EXPECT_EQ(request->fence, 7);
  EXPECT_EQ(request->host_bytes, 12'345'678'901);
  EXPECT_EQ(request->device_bytes, 5);
  for (const SliceAction action : {SliceAction::kRenew, SliceAction::kGive}) {
    SliceRequest other = slice();
    other.action = action;
    EXPECT_EQ(parse_slice_request(to_json_message(other))->action, action);
  }
  EXPECT_EQ(parse_slice_request(to_json_message(slices())).error().message(),
            "slice.task: expected it to be there, got nothing");
  Json odd = to_json_message(slice());
  odd["type"] = "slice_steal";
  EXPECT_EQ(parse_slice_request(odd).error().message(),
            "slice.type: expected slice_take, slice_renew or slice_give, got slice_steal");
  const auto refusal = parse_slice_reply(
      to_json_message(SliceReply{false, true, true, Error{ErrorCode::kGridTooLarge, "x", "", ""}}));
  ASSERT_TRUE(refusal) << refusal.error().message();
  EXPECT_FALSE(refusal->granted);
  EXPECT_TRUE(refusal->cancel);
  EXPECT_TRUE(refusal->fenced);
  EXPECT_EQ(refusal->error->code, ErrorCode::kGridTooLarge);
  EXPECT_FALSE(parse_slice_reply(to_json_message(SliceReply{true, false, false, {}}))->error);
}

TEST(TaskApi, a_hello_comes_back) {
  const auto back = parse_worker_hello(to_json_message(hello()));
  ASSERT_TRUE(back) << back.error().message();
  EXPECT_EQ(back->protocol, 3);
  EXPECT_EQ(back->pid, 4711);
  EXPECT_EQ(back->device, "egl:0");
  EXPECT_EQ(back->renderer, "Example GPU");
  EXPECT_EQ(back->driver, "4.6.0");
  EXPECT_EQ(back->device_json, R"({"limit":5})");
}

TEST(TaskApi, a_task_comes_back) {
  const auto back = parse_task(to_json_message(task()));
  ASSERT_TRUE(back) << back.error().message();
  EXPECT_EQ(back->id, "j-1");
  EXPECT_EQ(back->fence, 7);
  EXPECT_EQ(back->attempt, 2);
  EXPECT_EQ(back->kind, JobKind::kRender);
  EXPECT_EQ(back->input_path, "/data/blob");
  EXPECT_EQ(back->input_hash, "sha256-1");
  EXPECT_TRUE(back->input_is_grid);
  EXPECT_TRUE(back->input_is_sequence);
  EXPECT_EQ(back->frame_paths, task().frame_paths);
  EXPECT_EQ(back->bundle_paths, task().bundle_paths);
  EXPECT_EQ(back->filename, "b.ply");
  EXPECT_EQ(back->options_json, R"({"width":5})");
  EXPECT_EQ(back->tenant, "lab");
}

TEST(TaskApi, progress_comes_back) {
  const auto back = parse_task_progress(to_json_message(progress()));
  ASSERT_TRUE(back) << back.error().message();
  EXPECT_EQ(back->task, "j-1");
  EXPECT_EQ(back->fence, 7);
  EXPECT_EQ(back->stage, "voxelize");
  EXPECT_EQ(back->tiles_done, 3);
  EXPECT_EQ(back->tiles_total, 8);
  EXPECT_EQ(back->frames_done, 2);
  EXPECT_EQ(back->frames_total, 9);
  EXPECT_TRUE(back->is_preemptible);
  EXPECT_EQ(back->preparation_ms, 1500);
  Json other = to_json_message(progress());
  other["preparation_ms"] = -1;
  EXPECT_EQ(parse_task_progress(other).error().message(),
            "progress.preparation_ms: expected 0 to 10000000000, got -1");
}

TEST(TaskApi, a_preempted_task_comes_back_and_has_done_no_more_than_all) {
  const auto back = parse_task_preempt(to_json_message(preempt()));
  ASSERT_TRUE(back) << back.error().message();
  EXPECT_EQ(back->task, "j-1");
  EXPECT_EQ(back->fence, 7);
  EXPECT_EQ(back->tiles_done, 3);
  EXPECT_EQ(back->tiles_total, 8);
  EXPECT_EQ(back->timings, preempt().timings);
  for (const int64_t done : {-1, 9}) {
    Json other = to_json_message(preempt());
    other["tiles_done"] = done;
    EXPECT_EQ(parse_task_preempt(other).error().message(),
              "preempt.tiles_done: expected 0 to 8, got " + std::to_string(done));
  }
}

TEST(TaskApi, a_frame_and_its_reply_come_back) {
  const auto back = parse_task_frame(to_json_message(frame()));
  ASSERT_TRUE(back) << back.error().message();
  EXPECT_EQ(back->task, "j-1");
  EXPECT_EQ(back->fence, 7);
  EXPECT_EQ(back->index, 4095);
  EXPECT_EQ(back->time_s, 1.25);
  EXPECT_EQ(back->path, "/scratch/f");
  EXPECT_EQ(back->voxel_count, 12'345'678'901u);
  EXPECT_EQ(back->content_hash, frame().content_hash);
  EXPECT_EQ(back->frames_total, 4096);
  const auto reply =
      parse_task_frame_reply(to_json_message(TaskFrameReply{true, true, "sha256-6", "/data/6"}));
  ASSERT_TRUE(reply) << reply.error().message();
  EXPECT_TRUE(reply->cancel && reply->fenced);
  EXPECT_EQ(reply->grid, "sha256-6");
  EXPECT_EQ(reply->path, "/data/6");
  EXPECT_FALSE(parse_task_frame_reply(to_json_message(TaskFrameReply{}))->cancel);
  EXPECT_EQ(parse_task_frame_reply(Json::object()).error().message(),
            "reply.cancel: expected it to be there, got nothing");
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

TEST(TaskApi, a_completion_comes_back_with_its_stages_in_order) {
  const auto back = parse_task_completion(to_json_message(completion()));
  ASSERT_TRUE(back) << back.error().message();
  EXPECT_EQ(back->task, "j-1");
  EXPECT_EQ(back->fence, 7);
  ASSERT_EQ(back->outputs.size(), 2u);
  EXPECT_EQ(back->outputs[0].role, "result");
  EXPECT_EQ(back->outputs[0].path, "/scratch/a");
  EXPECT_EQ(back->outputs[0].media_type, "application/x-npy");
  EXPECT_EQ(back->outputs[0].filename, "b.npy");
  EXPECT_EQ(back->outputs[1].role, "grid");
  EXPECT_EQ(back->timings, completion().timings);
  EXPECT_EQ(back->meta_json, R"({"dims":[1,2,3]})");
  ASSERT_EQ(back->warnings.size(), 1u);
  EXPECT_EQ(back->warnings[0].code, "missing-texture");
  EXPECT_EQ(back->warnings[0].detail, "a.png");
}

TEST(TaskApi, a_failure_comes_back) {
  const auto back = parse_task_failure(to_json_message(failure()));
  ASSERT_TRUE(back) << back.error().message();
  EXPECT_EQ(back->task, "j-1");
  EXPECT_EQ(back->fence, 7);
  EXPECT_EQ(back->error.code, ErrorCode::kMalformedMesh);
  EXPECT_EQ(back->error.message(), failure().error.message());
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

TEST(TaskApi, what_is_not_an_object_is_refused) {
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

TEST(TaskApi, what_makes_no_sense_without_it_must_be_there) {
  const std::map<std::string, std::vector<std::string>> required = {
      {"hello", {"protocol", "pid", "device"}},
      {"folders", {"scratch_dir", "input_dir", "cache_dir"}},
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
                message.type + "." + name + ": expected it to be there, got nothing");
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
  EXPECT_EQ(parse_task(message).error().message(), "task.kind: expected a kind of job, got sculpt");
}

}  // namespace
}  // namespace voxeld
