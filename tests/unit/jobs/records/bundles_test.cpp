// Assets that are bundles of others: what their tasks name, and what of them may not go away.
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "server/base/sha256.h"
#include "tests/unit/jobs/lists.h"
#include "tests/unit/jobs/service_fixture.h"

namespace voxeld {
namespace {

using testing::FakeWorker;

class BundlesTest : public testing::ServiceTest {
 protected:
  // Stores a bundle of a mesh and its animation; the manifest's bytes do not matter here.
  std::string put_bundle() {
    mesh_ = put_asset("mesh", "bob.md5mesh");
    anim_ = put_asset("anim", "walk.md5anim");
    const auto asset = service_->put_bundle(Caller::open(), put_blob("manifest"), "bob.bundle.json",
                                            {{"bob.md5mesh", mesh_}, {"walk.md5anim", anim_}});
    EXPECT_TRUE(asset) << asset.error().message();
    return asset ? asset->id : "";
  }
  JobRequest request(const std::string& asset) {
    JobRequest request;
    request.asset = asset;
    return request;
  }
  std::string mesh_, anim_;
};

TEST_F(BundlesTest, a_task_names_where_each_file_is) {
  const std::string bundle = put_bundle();
  EXPECT_EQ(service_->get_asset(Caller::open(), bundle).value().content_type, kBundleMediaType);
  submit(request(bundle));
  FakeWorker worker = connect();
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  EXPECT_EQ(task->input_path, worker.input(bundle));
  EXPECT_EQ(task->filename, "bob.bundle.json");
  EXPECT_EQ(task->bundle_paths,
            (std::vector<std::string>{worker.input(mesh_), worker.input(anim_)}));
  EXPECT_TRUE(std::filesystem::equivalent(worker.input(mesh_), blobs().path_of(mesh_)));
  EXPECT_TRUE(std::filesystem::equivalent(worker.input(anim_), blobs().path_of(anim_)));
  ASSERT_TRUE(worker.complete(*task, "x"));
  submit(request(mesh_));
  EXPECT_TRUE(worker.claim()->bundle_paths.empty());
}

TEST_F(BundlesTest, a_file_that_is_not_there_is_named) {
  const std::string mesh = put_asset("mesh");
  const std::string nothing = sha256_id("nothing");
  const BlobInfo manifest = put_blob("manifest");
  const auto refused =
      service_->put_bundle(Caller::open(), manifest, "b", {{"bob", mesh}, {"walk", nothing}});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kNotFound);
  EXPECT_EQ(
      refused.error().message(),
      "bundle file \"walk\": no such asset: expected the id of an uploaded asset, got " + nothing);
  EXPECT_EQ(service_->get_asset(Caller::open(), manifest.id).error().code, ErrorCode::kNotFound);
}

TEST_F(BundlesTest, a_bundle_in_a_bundle_is_refused) {
  const std::string bundle = put_bundle();
  const auto refused =
      service_->put_bundle(Caller::open(), put_blob("outer"), "o", {{"inner", bundle}});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kMalformedBundle);
  EXPECT_EQ(refused.error().detail, "bundle file \"inner\": it is a bundle itself");
}

TEST_F(BundlesTest, work_on_a_bundle_of_which_a_file_was_deleted_is_refused_until_it_is_back) {
  const std::string bundle = put_bundle();
  ASSERT_TRUE(service_->delete_asset(Caller::open(), anim_));
  const auto refused = service_->submit(Caller::open(), request(bundle), {});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kGone);
  EXPECT_EQ(refused.error().detail,
            "bundle file \"walk.md5anim\": asset " + anim_ + " was deleted");
  EXPECT_TRUE(is_removed(anim_));
  put_asset("anim", "walk.md5anim");
  EXPECT_TRUE(service_->submit(Caller::open(), request(bundle), {}));
}

TEST_F(BundlesTest, files_of_a_live_job_stay_until_it_has_ended) {
  const std::string bundle = put_bundle();
  const std::string id = submit(request(bundle)).id;
  FakeWorker worker = connect();
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  for (const std::string& asset : {mesh_, anim_, bundle}) {
    ASSERT_TRUE(service_->delete_asset(Caller::open(), asset));
    EXPECT_TRUE(blobs().stat(asset)) << asset;
  }
  ASSERT_TRUE(worker.complete(*task, "x"));
  EXPECT_EQ(wait_end(id).state, JobState::kDone);
  for (const std::string& asset : {mesh_, anim_, bundle}) {
    EXPECT_TRUE(is_removed(asset)) << asset;
  }
}

TEST_F(BundlesTest, the_same_manifest_is_one_asset) {
  EXPECT_EQ(put_bundle(), put_bundle());
  EXPECT_EQ(testing::assets_of(*service_, Caller::open()).size(), 3u);
}

}  // namespace
}  // namespace voxeld
