// The tiles of a job's grid over HTTP: while it runs, and after each of its ends.
#include <gtest/gtest.h>

#include <string>
#include <string_view>
#include <vector>

#include "proto/container/grid_format.h"
#include "server/jobs/auth/key_file.h"
#include "tests/unit/api/api_server_fixture.h"
#include "tests/unit/proto/tile_maker.h"

namespace voxeld::api {
namespace {

class JobTilesApi : public ServerTest {
 protected:
  // The container of tiles [begin, end) of a row of tiles.
  static std::string container(size_t begin, size_t end, int tiles = 6) {
    GridHeader header;
    header.dims = {tiles * 256, 20, 10};
    header.voxel_size = {1, 1, 1};
    header.meta_json = R"({"steps":6})";
    const auto all = test::tiles_of(test::box_voxels({0, 1, 2}, {tiles * 256, 2, 3}), {});
    const auto bytes = encode_grid(header, std::span(all).subspan(begin, end - begin)).value();
    return {bytes.begin(), bytes.end()};
  }
  // The x of the tiles of a response; "status" of one that has none.
  static std::string tiles_of(const HttpResponse& response) {
    if (response.status != 200) return std::to_string(response.status);
    const auto* bytes = reinterpret_cast<const uint8_t*>(response.body.data());
    const auto reader = GridReader::open({bytes, response.body.size()});
    if (!reader) return reader.error().message();
    std::string list;
    for (size_t i = 0; i < reader->tile_count(); ++i) {
      EXPECT_TRUE(reader->decode_tile(i));
      list += (list.empty() ? "" : " ") + std::to_string(reader->tile_coord(i)[0]);
    }
    return list;
  }
  // The task of a new job at the worker.
  Task claim(FakeWorker& worker) {
    job_ = "/v1/jobs/" + submit();
    const auto task = worker.claim();
    EXPECT_TRUE(task && job_ == "/v1/jobs/" + task->id);
    return task.value_or(Task{});
  }
  HttpResponse tiles(int after, const std::string& lines = "") {
    return get(job_ + "/tiles?after=" + std::to_string(after), lines);
  }
  std::string job_;
};

TEST_F(JobTilesApi, a_running_job_gives_the_tiles_after_those_that_the_client_has) {
  FakeWorker worker = connect_worker();
  const Task task = claim(worker);
  const HttpResponse none = get(job_ + "/tiles");
  EXPECT_EQ(none.status, 202);
  EXPECT_EQ(json(none).value("state", ""), "running");
  EXPECT_EQ(worker.part(task, 0, container(0, 2)).error, "");
  EXPECT_EQ(worker.part(task, 1, container(2, 5)).error, "");
  const HttpResponse first = get(job_ + "/tiles");
  EXPECT_EQ(tiles_of(first), "0 1");
  EXPECT_EQ(first.header("content-type"), "application/vnd.voxeld.grid");
  EXPECT_EQ(first.header("cache-control"), "no-store");
  EXPECT_EQ(first.header("x-voxeld-next"), "2");
  EXPECT_EQ("/v1/jobs/" + first.header("x-voxeld-job"), job_);
  EXPECT_EQ(tiles_of(tiles(1)), "1");
  EXPECT_EQ(tiles_of(tiles(2)), "2 3 4");
  const HttpResponse last = tiles(4);
  EXPECT_EQ(tiles_of(last), "4");
  EXPECT_EQ(last.header("x-voxeld-next"), "5");
  EXPECT_EQ(tiles(5).status, 202);
  EXPECT_EQ(tiles(1000).status, 202) << "the number of tiles is not known yet";
  worker.part(task, 1, container(2, 3));  // of an attempt that found part 1 damaged
  EXPECT_EQ(tiles_of(tiles(2)), "2");
}

TEST_F(JobTilesApi, a_done_job_gives_the_tiles_of_its_grid_and_then_no_content) {
  FakeWorker worker = connect_worker();
  const Task task = claim(worker);
  worker.part(task, 0, container(0, 2));
  ASSERT_TRUE(worker.complete(task, container(0, 6)));
  EXPECT_EQ(tiles_of(tiles(0)), "0 1 2 3 4 5");
  EXPECT_EQ(tiles_of(tiles(2)), "2 3 4 5");
  const HttpResponse end = tiles(6);
  EXPECT_EQ(end.status, 204);
  EXPECT_EQ(end.body, "");
  const HttpResponse beyond = tiles(7);
  EXPECT_EQ(beyond.status, 400);
  EXPECT_EQ(json(beyond).value("expected", ""), "0 to 6");
  EXPECT_EQ(json(beyond).value("got", ""), "7");
  const std::string grid = json(get(job_))["result"].value("grid", "");
  EXPECT_EQ(request("DELETE", "/v1/grids/" + grid).status, 204);
  EXPECT_EQ(tiles(0).code(), "gone");
}

TEST_F(JobTilesApi, a_response_has_a_bounded_number_of_tiles) {
  FakeWorker worker = connect_worker();
  GridHeader header;
  header.dims = {16384, 16384, 256};
  header.voxel_size = {1, 1, 1};
  std::vector<test::TestVoxel> voxels(2000);
  for (size_t i = 0; i < voxels.size(); ++i) {
    voxels[i].cell = {static_cast<int>(i % 64) * 256, static_cast<int>(i / 64) * 256, 0};
  }
  const auto bytes = encode_grid(header, test::tiles_of(voxels, {})).value();
  const Task task = claim(worker);
  worker.part(task, 0, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  size_t have = 0;
  std::vector<size_t> counts;
  while (have < voxels.size()) {
    const HttpResponse response = tiles(static_cast<int>(have));
    ASSERT_EQ(response.status, 200) << response.body;
    const size_t next = std::stoul(response.header("x-voxeld-next"));
    counts.push_back(next - have);
    have = next;
  }
  EXPECT_EQ(counts, (std::vector<size_t>{960, 960, 80}));
}

TEST_F(JobTilesApi, a_request_waits_for_the_next_tile_or_the_end_of_the_job) {
  FakeWorker worker = connect_worker();
  const Task task = claim(worker);
  HttpClient client(server_->port());
  ASSERT_TRUE(client.send_get(job_ + "/tiles", "Prefer: wait=60\r\n"));
  EXPECT_FALSE(client.readable(0.2));
  worker.part(task, 0, container(0, 2));
  worker.progress(task, "voxelize", 1, 3);
  EXPECT_EQ(tiles_of(client.receive().value_or(HttpResponse{})), "0 1");
  ASSERT_TRUE(client.send_get(job_ + "/tiles?after=6", "Prefer: wait=60\r\n"));
  EXPECT_FALSE(client.readable(0.2));
  ASSERT_TRUE(worker.complete(task, container(0, 6)));
  EXPECT_EQ(client.receive().value_or(HttpResponse{}).status, 204);
}

TEST_F(JobTilesApi, a_wait_ends_at_its_time_with_the_status_of_the_job) {
  job_ = "/v1/jobs/" + submit();
  const HttpResponse late = tiles(0, "Prefer: wait=1\r\n");
  EXPECT_EQ(late.status, 202);
  EXPECT_EQ(json(late).value("state", ""), "queued");
}

TEST_F(JobTilesApi, a_reader_that_stops_holds_neither_the_worker_nor_the_end_of_the_job) {
  FakeWorker worker = connect_worker();
  const Task task = claim(worker);
  const std::string grid = container(0, 64, 64);
  worker.part(task, 0, grid);
  HttpClient client(server_->port());
  ASSERT_TRUE(client.send_get(job_ + "/tiles"));
  const auto head = client.receive_head();  // and no more than its first bytes
  ASSERT_TRUE(head && head->status == 200);
  worker.part(task, 0, container(0, 1));  // removes the file that is being sent
  ASSERT_TRUE(worker.complete(task, grid));
  EXPECT_EQ(json(get(job_)).value("state", ""), "done");
}

TEST_F(JobTilesApi, a_job_that_failed_or_was_cancelled_gives_that_as_the_problem) {
  FakeWorker worker = connect_worker();
  Task task = claim(worker);
  worker.part(task, 0, container(0, 2));
  ASSERT_TRUE(worker.fail(task, {ErrorCode::kMalformedMesh, "line 1: no", "yes", "no"}));
  EXPECT_EQ(tiles(0).code(), "malformed-mesh");
  EXPECT_EQ(tiles(0).status, 422);
  job_ =
      "/v1/jobs/" + json(request("POST", "/v1/jobs", "",
                                 R"({"kind":"voxelize","asset":")" + post_asset("other") + R"("})"))
                        .value("id", "");
  EXPECT_EQ(request("DELETE", job_).status, 200);
  EXPECT_EQ(tiles(0).code(), "cancelled");
}

TEST_F(JobTilesApi, jobs_that_make_no_single_grid_are_in_conflict_with_it) {
  const std::string asset = post_asset();
  const auto refused = [&](const std::string& members) {
    job_ = "/v1/jobs/" + json(request("POST", "/v1/jobs", "", "{" + members + "}")).value("id", "");
    const HttpResponse response = tiles(0);
    EXPECT_EQ(response.status, 409) << response.body;
    return json(response).value("got", "");
  };
  const std::string of_asset = R"("asset":")" + asset + R"(")";
  EXPECT_EQ(refused(R"("kind":"inspect",)" + of_asset), "kind inspect");
  EXPECT_EQ(refused(R"("kind":"voxelize","options":{"animation":0},)" + of_asset),
            "an animation: its frames are at /frames");
  EXPECT_EQ(refused(R"("kind":"voxelize","options":{"level":1},)" + of_asset),
            "a level or region of a grid, or changed voxels");
  job_ =
      "/v1/jobs/" +
      json(request("POST", "/v1/jobs", "",
                   R"({"kind":"voxelize","options":{"animation":0,"time":0.5},)" + of_asset + "}"))
          .value("id", "");
  EXPECT_EQ(tiles(0).status, 202) << "one grid of one moment";
}

TEST_F(JobTilesApi, what_is_not_there_and_invalid_numbers_are_refused) {
  const std::string lab = bearer(add_key("lab")), studio = bearer(add_key("studio"));
  const std::string asset =
      json(request("POST", "/v1/assets?filename=a.ply", lab, "mesh")).value("id", "");
  job_ = "/v1/jobs/" +
         json(request("POST", "/v1/jobs", lab, R"({"kind":"voxelize","asset":")" + asset + R"("})"))
             .value("id", "");
  EXPECT_EQ(tiles(0, lab).status, 202);
  EXPECT_EQ(tiles(0, studio).status, 404);
  EXPECT_EQ(tiles(0).status, 401);
  EXPECT_EQ(get("/v1/jobs/j-1/tiles", lab).status, 404);
  for (const std::string after : {"-1", "", "x", "1.5", "99999999999999999999"}) {
    const HttpResponse response = get(job_ + "/tiles?after=" + after, lab);
    EXPECT_EQ(response.code(), "invalid-option") << after;
    EXPECT_EQ(json(response).value("expected", ""), "a number from 0 on") << after;
  }
}

TEST_F(JobTilesApi, a_part_that_is_no_container_is_not_kept) {
  FakeWorker worker = connect_worker();
  const Task task = claim(worker);
  EXPECT_EQ(worker.part(task, 0, "no container").error,
            "grid container, byte 0: not a grid container: expected the magic VOXGRID, got other "
            "bytes");
  EXPECT_EQ(tiles(0).status, 202);
}

}  // namespace
}  // namespace voxeld::api
