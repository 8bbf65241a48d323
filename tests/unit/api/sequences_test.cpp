// Frames and sequences over HTTP, and bundles of assets.
#include <gtest/gtest.h>

#include <string>
#include <thread>
#include <vector>

#include "proto/messages/bundle_manifest.h"
#include "server/base/sha256.h"
#include "tests/unit/api/api_server_fixture.h"

namespace voxeld::api {
namespace {

class SequencesApi : public ServerTest {
 protected:
  // A job of an asset with animation 0, and its task at `worker`.
  Task claim(FakeWorker& worker) {
    const HttpResponse sent = request("POST", "/v1/jobs", "",
                                      R"({"kind":"voxelize","asset":")" + post_asset() +
                                          R"(","options":{"animation":0,"cache":"no"}})");
    EXPECT_EQ(sent.status, 202) << sent.body;
    job_ = sent.header("location");
    const auto task = worker.claim();
    EXPECT_TRUE(task);
    return task.value_or(Task{});
  }
  // The id of a sequence of the frames "a", "b" and "a".
  std::string finished() {
    FakeWorker worker = connect_worker();
    const Task task = claim(worker);
    int64_t index = 0;
    for (const char* text : {"a", "b", "a"}) worker.frame(task, index++, text);
    EXPECT_TRUE(worker.complete_sequence(task, {"a", "b", "a"}, "whole").value("ok", false));
    return json(get(job_))["result"].value("sequence", "");
  }
  // Sends a request that needs a job, acts as its worker, stores the task, returns the response.
  HttpResponse respond_with_worker(const std::string& method, const std::string& target,
                                   const std::string& lines = "") {
    HttpClient client(server_->port());
    const std::string length = method == "POST" ? "Content-Length: 0\r\n" : "";
    EXPECT_TRUE(
        client.send(method + " " + target + " HTTP/1.1\r\nHost: h\r\n" + length + lines + "\r\n"));
    EXPECT_TRUE(comes_true([&] { return client.readable(0) || jobs_->queued_jobs() > 0; }));
    if (client.readable(0)) return client.receive().value_or(HttpResponse{});  // refused at once
    FakeWorker worker = connect_worker();
    const auto task = worker.claim();
    EXPECT_TRUE(task && worker.complete(*task, "made"));
    task_ = task.value_or(Task{});
    return client.receive().value_or(HttpResponse{});
  }
  std::string option(const std::string& name) const {
    const auto options = nlohmann::json::parse(task_.options_json);
    return options.contains(name) ? options[name].dump() : "";
  }
  std::string job_;
  Task task_;
};

TEST_F(SequencesApi, frames_are_listed_and_fetched_while_their_job_runs) {
  FakeWorker worker = connect_worker();
  const Task task = claim(worker);
  EXPECT_EQ(json(get(job_ + "/frames"))["frames"].size(), 0u);
  worker.call(to_json_message(TaskProgress{task.id, task.fence, "voxelize", 0, 8, 0, 3, {}}));
  worker.frame(task, 0, "first grid");
  const auto list = json(get(job_ + "/frames"));
  EXPECT_EQ("/v1/jobs/" + list.value("job", ""), job_);
  EXPECT_TRUE(list["sequence"].is_null());
  EXPECT_EQ(list["frames_total"], 3);
  ASSERT_EQ(list["frames"].size(), 1u);
  EXPECT_EQ(list["frames"][0]["index"], 0);
  EXPECT_EQ(list["frames"][0]["time_s"], 0.0);
  EXPECT_EQ(list["frames"][0]["grid"], sha256_id("first grid"));
  EXPECT_EQ(list["frames"][0]["voxel_count"], 10);
  EXPECT_EQ(list["frames"][0]["content_hash"], sha256_id("content of first grid"));
  const HttpResponse grid = get(job_ + "/frames/0");
  EXPECT_EQ(grid.status, 200);
  EXPECT_EQ(grid.body, "first grid");
  EXPECT_EQ(grid.header("content-type"), "application/vnd.voxeld.grid");
  EXPECT_EQ(grid.header("etag"), "\"" + sha256_id("first grid") + "\"");
  EXPECT_EQ(get(job_ + "/frames/0", "Range: bytes=0-4\r\n").body, "first");
  const auto status = json(get(job_));
  EXPECT_EQ(status["state"], "running");
  EXPECT_EQ(status["frames_done"], 1);
  EXPECT_EQ(status["frames_total"], 3);
}

TEST_F(SequencesApi, a_frame_that_is_not_there_yet_says_how_many_are) {
  FakeWorker worker = connect_worker();
  const Task task = claim(worker);
  worker.frame(task, 0, "a");
  EXPECT_EQ(get(job_ + "/frames/1").detail(), "1 frames are done");
  worker.call(to_json_message(TaskProgress{task.id, task.fence, "voxelize", 0, 8, 1, 140, {}}));
  for (const char* index : {"1", "140", "-1", "x", "0x0", "99999999999999999999"}) {
    const HttpResponse response = get(job_ + "/frames/" + index);
    EXPECT_EQ(response.status, 404) << index;
    EXPECT_EQ(response.code(), "not-found");
    EXPECT_EQ(response.detail(), "1 of 140 frames are done");
    EXPECT_EQ(get(job_ + "/frames/" + index + "/render.png").detail(), "1 of 140 frames are done");
  }
  EXPECT_EQ(get("/v1/jobs/j-0/frames").detail(), "no such job");
  EXPECT_EQ(get("/v1/jobs/j-0/frames/0").detail(), "no such job");
}

TEST_F(SequencesApi, a_cancelled_job_keeps_its_frames) {
  FakeWorker worker = connect_worker();
  const Task task = claim(worker);
  worker.frame(task, 0, "a");
  EXPECT_EQ(request("DELETE", job_).status, 202);
  EXPECT_TRUE(worker.frame(task, 1, "b").cancel);
  ASSERT_TRUE(worker.fail(task, {ErrorCode::kCancelled, "the job was cancelled", "", ""}));
  EXPECT_EQ(json(get(job_))["state"], "cancelled");
  EXPECT_EQ(json(get(job_ + "/frames"))["frames"].size(), 2u);
  EXPECT_EQ(get(job_ + "/frames/1").body, "b");
}

TEST_F(SequencesApi, a_frame_is_exported_and_drawn_as_any_grid) {
  FakeWorker worker = connect_worker();
  const Task running = claim(worker);
  worker.frame(running, 0, "a");
  EXPECT_EQ(respond_with_worker("GET", job_ + "/frames/0?format=npy&axes=xyz").body, "made");
  EXPECT_EQ(task_.kind, JobKind::kExport);
  EXPECT_EQ(task_.input_hash, sha256_id("a"));
  EXPECT_EQ(option("axes"), "\"xyz\"");
  EXPECT_EQ(respond_with_worker("GET", job_ + "/frames/0/render.png?width=64").body, "made");
  EXPECT_EQ(task_.kind, JobKind::kRender);
  EXPECT_TRUE(task_.input_is_grid);
  EXPECT_EQ(option("width"), "64");
  const HttpResponse moving = get(job_ + "/frames/0/render.png?image=gif");
  EXPECT_EQ(moving.status, 400);
  EXPECT_EQ(moving.detail(), "image");
}

TEST_F(SequencesApi, a_sequence_lists_its_frames_and_place) {
  const std::string path = "/v1/sequences/" + finished();
  const auto list = json(get(path + "/frames"));
  EXPECT_TRUE(list["job"].is_null());
  EXPECT_EQ("/v1/sequences/" + list.value("sequence", ""), path);
  EXPECT_EQ(list["frames_total"], 3);
  ASSERT_EQ(list["frames"].size(), 3u);
  EXPECT_EQ(list["frames"][2]["index"], 2);
  EXPECT_EQ(list["frames"][2]["time_s"], 2.0 / 24);
  EXPECT_EQ(list["frames"][2]["grid"], sha256_id("a"));
  EXPECT_EQ(list["fps"], 24.0);
  EXPECT_EQ(list["dims"], (std::vector{4, 5, 6}));
  EXPECT_EQ(list["channels"], std::vector{"color"});
  EXPECT_EQ(get(path + "/frames/1").body, "b");
  const HttpResponse beyond = get(path + "/frames/3");
  EXPECT_EQ(beyond.code(), "not-found");
  EXPECT_EQ(json(beyond)["expected"], "0 to 2");
  EXPECT_EQ(json(get(job_ + "/frames"))["sequence"], list["sequence"]);
  EXPECT_EQ(get("/v1/sequences/sha256-0/frames").detail(), "no such sequence");
  EXPECT_EQ(get("/v1/sequences/" + sha256_id("a")).detail(), "no such sequence");
}

TEST_F(SequencesApi, a_sequence_is_exported_by_parameter_and_by_accept) {
  const std::string sequence = finished();
  const std::string path = "/v1/sequences/" + sequence;
  EXPECT_EQ(respond_with_worker("GET", path).body, "made");
  EXPECT_TRUE(task_.input_is_sequence);
  EXPECT_EQ(task_.input_hash, sequence);
  EXPECT_EQ(task_.frame_paths.size(), 3u);
  EXPECT_EQ(option("format"), "\"native\"");
  EXPECT_EQ(respond_with_worker("GET", path + "?format=vox&frames=0..1").body, "made");
  EXPECT_EQ(option("format"), "\"vox\"");
  EXPECT_EQ(option("frames"), "\"0..1\"");
  respond_with_worker("GET", path, "Accept: application/x-npz\r\n");
  EXPECT_EQ(option("format"), "\"npz\"");
  EXPECT_EQ(get(path, "Accept: application/vnd.voxeld.sequence\r\n").header("cache-status"),
            "voxeld; hit");
  EXPECT_EQ(get(path, "Accept: text/html\r\n").code(), "not-acceptable");
  EXPECT_EQ(get(path + "?frames=2..1").code(), "invalid-option");
  EXPECT_EQ(get(path + "?fps=5").code(), "unknown-option");
}

TEST_F(SequencesApi, a_sequence_is_drawn_as_a_gif_where_nothing_else_is_said) {
  const std::string path = "/v1/sequences/" + finished();
  EXPECT_EQ(respond_with_worker("GET", path + "/render?width=100").body, "made");
  EXPECT_EQ(task_.kind, JobKind::kRender);
  EXPECT_EQ(option("image"), "\"gif\"");
  EXPECT_EQ(option("width"), "100");
  respond_with_worker("GET", path + "/render?image=sheet&columns=2");
  EXPECT_EQ(option("image"), "\"sheet\"");
  EXPECT_EQ(option("width"), "160");
  respond_with_worker("GET", path + "/render?image=png&frame=2");
  EXPECT_EQ(option("frame"), "2");
  const HttpResponse turned = get(path + "/render?turntable=9");
  EXPECT_EQ(turned.code(), "unknown-option");
  EXPECT_EQ(turned.detail(), "option 'turntable' does not apply to this request");
  respond_with_worker("GET", path + "/frames/1/render.png");
  EXPECT_EQ(task_.input_hash, sha256_id("b"));
}

TEST_F(SequencesApi, a_grid_turns_and_has_no_frames) {
  finished();
  const std::string path = "/v1/grids/" + sha256_id("a");
  EXPECT_EQ(respond_with_worker("GET", path + "/render?image=apng&turntable=36&rate=12").body,
            "made");
  EXPECT_EQ(option("turntable"), "36");
  EXPECT_EQ(option("rate"), "12");
  EXPECT_EQ(get(path + "/render?image=gif").code(), "invalid-option");
  EXPECT_EQ(get(path + "?frames=0..1").detail(), "option 'frames' does not apply to this request");
  EXPECT_EQ(get(path + "/render.png?frame=1").detail(),
            "option 'frame' does not apply to this request");
}

TEST_F(SequencesApi, the_result_of_a_sequence_comes_in_other_formats) {
  const std::string sequence = finished();
  const HttpResponse whole = get(job_ + "/result");
  EXPECT_EQ(whole.body, "whole");
  EXPECT_EQ(whole.header("content-type"), "application/vnd.voxeld.sequence");
  EXPECT_EQ(whole.header("x-voxeld-sequence"), sequence);
  EXPECT_EQ(get(job_ + "/result?format=native").body, "whole");
  EXPECT_EQ(respond_with_worker("GET", job_ + "/result?format=npz").body, "made");
  EXPECT_EQ(task_.input_hash, sequence);
  EXPECT_TRUE(task_.input_is_sequence);
}

TEST_F(SequencesApi, one_shot_images_take_a_sequence_and_only_one_input) {
  const std::string sequence = finished();
  EXPECT_EQ(respond_with_worker("POST", "/v1/render?image=gif&sequence=" + sequence).body, "made");
  EXPECT_EQ(task_.input_hash, sequence);
  const HttpResponse two = request("POST", "/v1/render?grid=x&sequence=" + sequence);
  EXPECT_EQ(two.code(), "invalid-option");
  EXPECT_EQ(json(two)["expected"], "one of asset, grid and sequence");
  EXPECT_EQ(request("POST", "/v1/voxelize?sequence=" + sequence).detail(),
            "unknown parameter 'sequence'");
  const HttpResponse still = request("POST", "/v1/render?image=gif&time=1", "", "mesh");
  EXPECT_EQ(still.detail(), "image");
}

TEST_F(SequencesApi, a_dry_run_looks_for_the_sequence) {
  const auto dry = [&](const std::string& sequence) {
    return request("POST", "/v1/jobs?dry_run=1", "",
                   R"({"kind":"export","sequence":")" + sequence + R"("})");
  };
  const std::string sequence = finished();
  EXPECT_EQ(json(dry(sequence))["sequence"], sequence);
  EXPECT_EQ(dry("sha256-0").code(), "not-found");
}

class BundlesApi : public ServerTest {
 protected:
  static std::string manifest(const std::vector<BundleFile>& files) {
    auto list = nlohmann::json::array();
    for (const BundleFile& file : files) {
      list.push_back({{"name", file.name}, {"asset", file.asset}});
    }
    return nlohmann::json{{"files", list}}.dump();
  }
  HttpResponse post_bundle(const std::string& text, const std::string& query = "",
                           const std::string& type = std::string(kBundleMediaType)) {
    return request("POST", "/v1/assets" + query, "Content-Type: " + type + "\r\n", text);
  }
};

TEST_F(BundlesApi, a_bundle_is_an_asset_that_a_job_works_on) {
  const std::string mesh = post_asset("mesh"), anim = post_asset("anim");
  const std::string text = manifest({{"a/bob.md5mesh", mesh}, {"walk.md5anim", anim}});
  const HttpResponse sent = post_bundle(text, "", "Application/vnd.voxeld.bundle+JSON; v=1");
  ASSERT_EQ(sent.status, 201) << sent.body;
  EXPECT_EQ(json(sent)["filename"], "bob.bundle.json");
  EXPECT_EQ(json(sent)["content_type"], kBundleMediaType);
  EXPECT_EQ(json(sent)["id"], sha256_id(text));
  EXPECT_EQ(post_bundle(text, "?filename=knight").status, 200);
  request("POST", "/v1/jobs", "", R"({"kind":"voxelize","asset":")" + sha256_id(text) + R"("})");
  FakeWorker worker = connect_worker();
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  EXPECT_EQ(task->filename, "knight.bundle.json");
  EXPECT_EQ(task->bundle_paths, (std::vector<std::string>{worker.input(mesh), worker.input(anim)}));
}

TEST_F(BundlesApi, a_one_shot_request_takes_a_bundle_as_its_body) {
  const std::string mesh = post_asset("mesh");
  HttpClient client(server_->port());
  const std::string text = manifest({{"bob.md5mesh", mesh}});
  ASSERT_TRUE(client.send("POST /v1/voxelize?size=9 HTTP/1.1\r\nHost: h\r\nContent-Type: " +
                          std::string(kBundleMediaType) + "\r\nContent-Length: " +
                          std::to_string(text.size()) + "\r\n\r\n" + text));
  FakeWorker worker = connect_worker();
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  EXPECT_EQ(task->bundle_paths.size(), 1u);
  EXPECT_EQ(task->filename, "bob.bundle.json");
  ASSERT_TRUE(worker.complete(*task, "made"));
  EXPECT_EQ(client.receive()->body, "made");
}

TEST_F(BundlesApi, a_manifest_is_checked_before_anything_is_stored) {
  const std::string mesh = post_asset("mesh"), nothing = sha256_id("nothing");
  const HttpResponse missing = post_bundle(manifest({{"bob", mesh}, {"walk", nothing}}));
  EXPECT_EQ(missing.status, 404);
  EXPECT_EQ(missing.detail(), "bundle file \"walk\": no such asset");
  EXPECT_EQ(json(missing)["got"], nothing);
  const HttpResponse bad = post_bundle(R"({"files":[]})");
  EXPECT_EQ(bad.status, 422);
  EXPECT_EQ(bad.code(), "malformed-bundle");
  EXPECT_EQ(post_bundle("").code(), "malformed-bundle");
  EXPECT_EQ(post_bundle(std::string((1 << 20) + 1, ' ')).code(), "payload-too-large");
  EXPECT_EQ(request("DELETE", "/v1/assets/" + mesh).status, 204);
  EXPECT_EQ(post_bundle(manifest({{"bob", mesh}})).code(), "gone");
  EXPECT_EQ(json(get("/v1/assets"))["assets"].size(), 0u);
  // The mesh itself goes with the next sweep.
  EXPECT_TRUE(comes_true([&] { return blobs().list().value().empty(); }));
}

TEST_F(BundlesApi, work_on_a_bundle_without_one_of_its_files_names_it) {
  const std::string mesh = post_asset("mesh");
  const std::string bundle = json(post_bundle(manifest({{"bob.md5mesh", mesh}})))["id"];
  EXPECT_EQ(request("DELETE", "/v1/assets/" + mesh).status, 204);
  const HttpResponse response = request("POST", "/v1/voxelize?asset=" + bundle);
  EXPECT_EQ(response.status, 410);
  EXPECT_EQ(response.detail(), "bundle file \"bob.md5mesh\": asset " + mesh + " was deleted");
}

}  // namespace
}  // namespace voxeld::api
