// How the same bytes are read under several names: never as an earlier or a later upload of them.
#include <gtest/gtest.h>

#include <string>

#include "tests/unit/jobs/lists.h"
#include "tests/unit/jobs/service_fixture.h"

namespace voxeld {
namespace {

using testing::FakeWorker;

class ReadingsTest : public testing::ServiceTest {
 protected:
  // The name under which a worker reads the asset where the job gives none.
  std::string name_for_worker(const std::string& asset) {
    JobRequest request;
    request.asset = asset;
    request.options.use_cache = false;
    submit(request);
    FakeWorker worker = connect();
    const auto task = worker.claim();
    EXPECT_TRUE(task);
    if (!task) return "";
    EXPECT_TRUE(worker.complete(*task, "grid of " + task->filename));
    return task->filename;
  }
  // Runs an inspect job to its end.
  void inspect(const std::string& asset, const std::string& filename = "") {
    JobRequest request;
    request.kind = JobKind::kInspect;
    request.asset = asset;
    request.filename = filename;
    const JobStatus status = submit(request);
    if (status.ended()) return;
    FakeWorker worker = connect();
    const auto task = worker.claim();
    ASSERT_TRUE(task);
    ASSERT_TRUE(worker.complete(*task, "description"));
  }
  bool is_described(const std::string& asset) {
    return !service_->get_asset(Caller::open(), asset).value().description_json.empty();
  }
};

TEST_F(ReadingsTest, a_later_name_does_not_change_how_an_earlier_asset_is_read) {
  const std::string off = put_asset("bytes", "truck.off");
  const std::string obj = put_asset("bytes", "lorry.obj");
  EXPECT_EQ(name_for_worker(off), "truck.off");
  EXPECT_EQ(name_for_worker(obj), "truck.obj");
  EXPECT_EQ(service_->get_asset(Caller::open(), off).value().filename, "truck.off");
}

TEST_F(ReadingsTest, an_upload_without_a_name_is_read_by_its_bytes_whatever_came_before) {
  const std::string named = put_asset("bytes", "truck.obj");
  const std::string unnamed = put_asset("bytes", "");
  EXPECT_EQ(name_for_worker(unnamed), "truck.bytes");  // an extension of no format
  EXPECT_EQ(name_for_worker(named), "truck.obj");
  const std::string first = put_asset("others", "");
  const std::string second = put_asset("others", "a.obj");
  EXPECT_EQ(name_for_worker(first), "");
  EXPECT_EQ(name_for_worker(second), "asset.obj");
}

TEST_F(ReadingsTest, names_that_are_read_alike_are_one_asset) {
  const std::string first = put_asset("bytes", "a.obj");
  EXPECT_EQ(put_asset("bytes", "B.OBJ"), first);
  EXPECT_EQ(service_->get_asset(Caller::open(), first).value().filename, "B.OBJ");
}

TEST_F(ReadingsTest, each_way_to_read_has_a_description_of_its_own) {
  const std::string off = put_asset("bytes", "a.off");
  inspect(off, "a.stl");
  EXPECT_FALSE(is_described(off));
  inspect(off);
  EXPECT_TRUE(is_described(off));
  const std::string obj = put_asset("bytes", "a.obj");
  EXPECT_FALSE(is_described(obj));
  inspect(obj);
  EXPECT_TRUE(is_described(off));
}

TEST_F(ReadingsTest, results_are_not_shared_by_ways_to_read) {
  const std::string off = put_asset("bytes", "a.off"), obj = put_asset("bytes", "a.obj");
  JobRequest request;
  request.asset = off;
  submit(request);
  FakeWorker worker = connect();
  ASSERT_TRUE(worker.complete(*worker.claim(), "grid"));
  EXPECT_TRUE(submit(request).cached);
  request.asset = obj;
  EXPECT_FALSE(submit(request).cached);
}

TEST_F(ReadingsTest, the_bytes_are_one_asset_that_is_deleted_as_a_whole) {
  const std::string off = put_asset("bytes", "a.off"), obj = put_asset("bytes", "a.obj");
  EXPECT_EQ(testing::assets_of(*service_, Caller::open()).size(), 1u);
  ASSERT_TRUE(service_->delete_asset(Caller::open(), obj));
  EXPECT_EQ(service_->get_asset(Caller::open(), off).error().code, ErrorCode::kGone);
  EXPECT_EQ(service_->get_asset(Caller::open(), obj).error().code, ErrorCode::kGone);
  // Uploaded again, it is what it is called now.
  const std::string again = put_asset("bytes", "b.stl");
  EXPECT_EQ(again, off);
  EXPECT_EQ(service_->get_asset(Caller::open(), again).value().filename, "b.stl");
  EXPECT_FALSE(is_described(again));
}

}  // namespace
}  // namespace voxeld
