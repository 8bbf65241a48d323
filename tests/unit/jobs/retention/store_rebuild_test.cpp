#include "server/jobs/retention/store_rebuild.h"

#include <gtest/gtest.h>

#include <fstream>
#include <string>

#include "proto/messages/sequence.h"
#include "server/base/sha256.h"
#include "server/jobs/auth/key_file.h"
#include "tests/unit/jobs/service_fixture.h"

namespace voxeld::testing {
namespace {

namespace fs = std::filesystem;
using namespace std::string_literals;

class StoreRebuildTest : public ServiceTest {
 protected:
  fs::path data() const { return dir_.path() / "data"; }
  // The database is lost with whatever named `texts`.
  void lose_database(const std::vector<std::string>& texts) {
    service_.reset();
    for (const std::string& text : texts) {
      std::ofstream(blobs().path_of(sha256_id(text)), std::ios::binary) << text;
    }
    for (const char* name : {"jobs.sqlite", "jobs.sqlite-wal", "jobs.sqlite-shm"}) {
      fs::remove(data() / name);
    }
  }
  bool is_grid(const Caller& caller, const std::string& text) {
    return service_->get_grid(caller, sha256_id(text)).ok();
  }
};

TEST_F(StoreRebuildTest, assets_bundles_grids_and_sequences_are_known_again) {
  const std::string mesh = "ply\nmesh", skin = "\x89PNG skin", grid = "VOXGRID\0 grid"s,
                    array = "\x93NUMPY array";
  const std::string bundle = "{\"files\": [{\"name\": \"a.ply\", \"asset\": \"" + sha256_id(mesh) +
                             "\"}, {\"name\": \"skin.png\", \"asset\": \"" + sha256_id(skin) +
                             "\"}]}";
  SequenceManifest manifest;
  manifest.dims = {4, 4, 4};
  manifest.voxel_size = {1, 1, 1};
  manifest.frames = {{0, sha256_id(grid), 1, sha256_id("h")}};
  const std::string sequence = sequence_json(manifest);
  lose_database(
      {mesh, skin, grid, bundle, sequence, array, "VOXSEQ\0\0 frames"s, "{\"asset\": {}}"});
  const auto report = rebuild_store(data(), std::nullopt);
  ASSERT_TRUE(report) << report.error().message();
  EXPECT_EQ(report->assets, 5);  // mesh, image, manifest, voxels, glTF
  EXPECT_EQ(report->grids, 1);
  EXPECT_EQ(report->sequences, 1);
  EXPECT_EQ(report->outputs, 1);
  EXPECT_EQ(report->damaged, 0);
  EXPECT_EQ(report->known, 0);
  start();
  EXPECT_EQ(service_->get_asset(Caller::open(), sha256_id(skin))->filename, "skin.png");
  EXPECT_EQ(service_->get_asset(Caller::open(), sha256_id(bundle))->filename,
            "recovered.bundle.json");
  EXPECT_TRUE(is_grid(Caller::open(), grid));
  EXPECT_EQ(service_->get_sequence(Caller::open(), sha256_id(sequence))->frames.size(), 1u);
  EXPECT_EQ(blob_bytes(Caller::open()),
            static_cast<int64_t>(mesh.size() + skin.size() + grid.size() + bundle.size() +
                                 sequence.size() + array.size() + "{\"asset\": {}}"s.size()));
  service_.reset();
  EXPECT_EQ(rebuild_store(data(), std::nullopt)->known, 7);
}

TEST_F(StoreRebuildTest, what_went_to_quarantine_is_found_too) {
  lose_database({"ply\nmesh"});
  ASSERT_TRUE(blobs().quarantine(sha256_id("ply\nmesh"), "2026-11-22"));
  EXPECT_EQ(rebuild_store(data(), std::nullopt)->assets, 1);
  start();
  EXPECT_TRUE(service_->get_asset(Caller::open(), sha256_id("ply\nmesh")));
}

TEST_F(StoreRebuildTest, a_damaged_blob_is_not_made_known) {
  lose_database({"mesh"});
  std::ofstream(blobs().path_of(sha256_id("mesh"))) << "other";
  const auto report = rebuild_store(data(), std::nullopt);
  EXPECT_EQ(report->damaged, 1);
  EXPECT_EQ(report->assets, 0);
}

TEST_F(StoreRebuildTest, with_keys_somebody_has_to_be_named) {
  lose_database({"mesh"});
  ASSERT_TRUE(change_keys(data(), [](KeyList&) { return Status(); }));
  EXPECT_EQ(rebuild_store(data(), std::nullopt).error().message(),
            "there are API keys, and files do not tell which tenant's they are:"
            " expected --tenant NAME, got no --tenant");
  EXPECT_EQ(rebuild_store(data(), "Not A Name").error().code, ErrorCode::kInvalidOption);
  EXPECT_EQ(rebuild_store(data(), "lab")->assets, 1);
  start();
  EXPECT_TRUE(service_->get_asset(Caller::tenant("lab", false), sha256_id("mesh")));
  EXPECT_FALSE(service_->get_asset(Caller::tenant("studio", false), sha256_id("mesh")));
}

TEST_F(StoreRebuildTest, no_store_and_a_store_in_use_are_refused) {
  EXPECT_EQ(rebuild_store(dir_.path() / "nowhere", std::nullopt).error().code,
            ErrorCode::kNotFound);
  EXPECT_EQ(rebuild_store(data(), std::nullopt).error().code, ErrorCode::kConflict);
}

}  // namespace
}  // namespace voxeld::testing
