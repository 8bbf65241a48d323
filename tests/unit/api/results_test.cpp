// The bytes of finished jobs: whole, in parts, and when the client has them already.
#include <gtest/gtest.h>

#include <string>

#include "server/base/disk/file.h"
#include "tests/unit/api/api_server_fixture.h"

namespace voxeld::api {
namespace {

const std::string kResult = "0123456789abcdefghij";

class ResultsTest : public ServerTest {
 protected:
  void SetUp() override {
    ServerTest::SetUp();
    job_ = finished_job(kResult);
    result_ = job_ + "/result";
  }
  std::string job_, result_;
};

TEST_F(ResultsTest, a_result_comes_with_its_job_grid_and_meta) {
  const HttpResponse response = get(result_);
  EXPECT_EQ(response.status, 200);
  EXPECT_EQ(response.body, kResult);
  EXPECT_EQ(response.header("content-type"), "application/x-npy");
  EXPECT_EQ(response.header("content-disposition"), "inline; filename=\"result.npy\"");
  EXPECT_EQ("/v1/jobs/" + response.header("x-voxeld-job"), job_);
  EXPECT_EQ("\"" + response.header("x-voxeld-grid") + "\"", response.header("etag"));
  EXPECT_EQ(response.header("x-voxeld-meta"), R"({"voxel_count":7})");
  EXPECT_EQ(response.header("x-voxeld-warnings"), "missing-texture");
  EXPECT_NE(response.header("server-timing").find("parse;dur=1.500, voxelize;dur=2.500"),
            std::string::npos)
      << response.header("server-timing");
  EXPECT_EQ(response.header("cache-status"), "voxeld; fwd=miss");
}

TEST_F(ResultsTest, head_returns_the_length_of_a_result) {
  const HttpResponse response = request("HEAD", result_);
  EXPECT_EQ(response.status, 200);
  EXPECT_EQ(response.header("content-length"), std::to_string(kResult.size()));
}

TEST_F(ResultsTest, ranges_are_parts_of_the_result) {
  const HttpResponse part = get(result_, "Range: bytes=10-12\r\n");
  EXPECT_EQ(part.status, 206);
  EXPECT_EQ(part.body, "abc");
  EXPECT_EQ(part.header("content-range"), "bytes 10-12/20");
  EXPECT_EQ(part.header("content-length"), "3");
  EXPECT_EQ(part.header("content-type"), "application/x-npy");
  EXPECT_EQ(get(result_, "Range: bytes=-3\r\n").body, "hij");
  EXPECT_EQ(get(result_, "Range: bytes=18-99\r\n").body, "ij");
}

TEST_F(ResultsTest, a_range_outside_is_not_satisfiable) {
  const HttpResponse response = get(result_, "Range: bytes=20-\r\n");
  EXPECT_EQ(response.status, 416);
  EXPECT_EQ(response.code(), "range-not-satisfiable");
  EXPECT_EQ(response.header("content-range"), "bytes */20");
}

TEST_F(ResultsTest, a_download_goes_on_only_with_the_same_content) {
  const std::string etag = get(result_).header("etag");
  const std::string range = "Range: bytes=10-\r\nIf-Range: ";
  EXPECT_EQ(get(result_, range + etag + "\r\n").body, "abcdefghij");
  EXPECT_EQ(get(result_, range + "\"other\"\r\n").body, kResult);
}

TEST_F(ResultsTest, a_client_that_has_the_result_gets_304_and_no_bytes) {
  const std::string etag = get(result_).header("etag");
  HttpClient client(server_->port());
  ASSERT_TRUE(client.send_get(result_, "If-None-Match: " + etag + "\r\n"));
  const auto response = client.receive(/*has_body=*/false);
  ASSERT_TRUE(response);
  EXPECT_EQ(response->status, 304);
  EXPECT_EQ(response->header("etag"), etag);
  EXPECT_EQ(response->header("content-length"), "");
  ASSERT_TRUE(client.send_get(result_, "If-None-Match: \"other\"\r\n"));
  EXPECT_EQ(client.receive()->body, kResult);
}

TEST_F(ResultsTest, a_format_that_is_not_known_is_an_invalid_option) {
  const HttpResponse response = get(result_ + "?format=stl");
  EXPECT_EQ(response.status, 400);
  EXPECT_EQ(response.code(), "invalid-option");
}

TEST_F(ResultsTest, a_type_that_no_format_has_is_not_acceptable) {
  const HttpResponse response = get(result_, "Accept: text/html\r\n");
  EXPECT_EQ(response.status, 406);
  EXPECT_EQ(response.code(), "not-acceptable");
  EXPECT_EQ(response.detail(), "Accept names no type that there is");
  EXPECT_EQ(json(response).value("expected", ""),
            "one of application/x-npy, application/vnd.voxeld.grid, application/x-npz, "
            "model/x-magicavoxel-vox, text/x-xyz, model/gltf-binary, model/ply, model/obj, "
            "application/x-vti, application/x-nrrd, application/x-metaimage, "
            "application/x-nifti, application/x-binvox, text/csv, application/x-pcd, "
            "model/x-qubicle-qb, application/x-schem, application/x-litematic, "
            "application/x-nbt, application/x-zarr+zip, application/x-vdb, application/x-nvdb, "
            "application/x-octomap-bt, application/x-ldraw, application/x-vtu, "
            "application/x-abaqus-inp, image/ktx2, application/x-raw+zip, "
            "application/x-png-slices+zip");
  EXPECT_EQ(response.header("vary"), "Accept");
}

TEST_F(ResultsTest, options_without_a_format_export_in_the_format_of_the_result) {
  const std::string id = json(get(job_)).value("id", "");
  HttpClient client(server_->port());
  ASSERT_TRUE(client.send_get(result_ + "?axes=xyz", ""));
  FakeWorker worker = connect_worker();
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  EXPECT_EQ(task->kind, JobKind::kExport);
  const auto options = nlohmann::json::parse(task->options_json);
  EXPECT_EQ(options["format"], "npy");
  EXPECT_EQ(options["axes"], "xyz");
  ASSERT_TRUE(worker.complete(*task, "exported"));
  EXPECT_EQ(client.receive()->body, "exported");
}

TEST_F(ResultsTest, a_misspelt_parameter_gets_the_near_miss) {
  const HttpResponse response = get(result_ + "?fromat=npz");
  EXPECT_EQ(response.status, 400);
  EXPECT_EQ(response.code(), "unknown-option");
  EXPECT_EQ(response.detail(), "unknown parameter 'fromat'; did you mean 'format'?");
}

TEST_F(ResultsTest, equal_work_is_served_from_the_cache) {
  const HttpResponse again = post_job();
  EXPECT_EQ(again.status, 200);
  EXPECT_EQ(json(again).value("cached", false), true);
}

TEST_F(ResultsTest, a_result_that_vanished_from_the_store_is_gone) {
  const std::string blob = get(result_).header("x-voxeld-grid");
  ASSERT_TRUE(blobs().remove(blob));
  EXPECT_EQ(get(result_).code(), "gone");
}

TEST_F(ResultsTest, a_grid_that_is_no_container_is_told_so_and_its_bytes_still_come) {
  const std::string grid = "/v1/grids/" + get(result_).header("x-voxeld-grid");
  const HttpResponse response = get(grid, "Range: bytes=0-3\r\n");
  EXPECT_EQ(response.status, 206);
  EXPECT_EQ(response.body, "0123");
  EXPECT_EQ(get(grid + "/tiles").status / 100, 4);
  EXPECT_EQ(get(grid + "/tiles/0").status / 100, 4);
  EXPECT_EQ(get("/v1/grids/sha256-0/tiles").code(), "not-found");
}

class UnfinishedTest : public ServerTest {};

TEST_F(UnfinishedTest, the_result_of_a_job_that_waits_is_a_conflict) {
  const HttpResponse response = get("/v1/jobs/" + submit() + "/result");
  EXPECT_EQ(response.status, 409);
  EXPECT_EQ(response.code(), "conflict");
}

TEST_F(UnfinishedTest, the_result_of_a_cancelled_job_is_its_problem) {
  const std::string path = "/v1/jobs/" + submit();
  EXPECT_EQ(request("DELETE", path).status, 200);
  const HttpResponse response = get(path + "/result");
  EXPECT_EQ(response.status, 409);
  EXPECT_EQ(response.code(), "cancelled");
}

TEST_F(UnfinishedTest, the_result_of_a_failed_job_is_its_problem) {
  const std::string path = "/v1/jobs/" + submit();
  FakeWorker worker = connect_worker();
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  ASSERT_TRUE(worker.fail(*task, {ErrorCode::kMalformedMesh, "bunny.ply line 3", "a", "b"}));
  const HttpResponse response = get(path + "/result");
  EXPECT_EQ(response.status, 422);
  EXPECT_EQ(response.code(), "malformed-mesh");
  EXPECT_EQ(response.detail(), "bunny.ply line 3");
}

TEST_F(UnfinishedTest, a_request_that_would_make_a_new_job_is_told_when_to_try_again) {
  const std::string grid = json(get(finished_job("x")))["result"]["grid"];
  HttpClient client(server_->port());
  ASSERT_TRUE(client.send("GET /v1/grids/" + grid + "/render.png HTTP/1.1\r\nHost: h\r\n\r\n"));
  FakeWorker worker = connect_worker();
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  ASSERT_TRUE(worker.fail(*task, {ErrorCode::kDeviceUnavailable, "no device", "", ""}));
  const auto image = client.receive();
  ASSERT_TRUE(image);
  EXPECT_EQ(image->status, 503);
  EXPECT_EQ(image->detail(), "no device");
  EXPECT_NE(image->header("retry-after"), "");
  const std::string path = "/v1/jobs/" + task->id;
  for (const HttpResponse& stored : {get(path + "/result"), request("POST", path + "/share")}) {
    EXPECT_EQ(stored.status, 503);
    EXPECT_EQ(stored.header("retry-after"), "") << "the job stays failed";
  }
}

}  // namespace
}  // namespace voxeld::api
