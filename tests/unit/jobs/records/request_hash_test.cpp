#include "server/jobs/model/request_hash.h"

#include <gtest/gtest.h>

#include "server/base/algorithm_version.h"
#include "server/base/sha256.h"

namespace voxeld {
namespace {

JobRequest request() {
  JobRequest request;
  request.asset = sha256_id("asset");
  request.filename = "bunny.ply";
  return request;
}

TEST(RequestHash, the_stem_of_the_file_name_does_not_matter_but_its_extension_does) {
  JobRequest other = request();
  other.filename = "Kaninchen.PLY";
  EXPECT_EQ(request_hash(other), request_hash(request()));
  other.filename = "bunny.obj";
  EXPECT_NE(request_hash(other), request_hash(request()));
}

TEST(RequestHash, the_file_inside_a_bundle_matters) {
  JobRequest a = request(), b = request();
  a.filename = "x.zip!a.obj";
  b.filename = "x.zip!b.obj";
  EXPECT_NE(request_hash(a), request_hash(b));
}

TEST(RequestHash, of_an_asset_or_grid_is_what_it_was_before_there_were_sequences) {
  JobRequest old = request();
  const std::string options = canonical_json(old.options, OptionScope::kVoxelize);
  std::string parts;
  for (const std::string& part : {std::to_string(kAlgorithmVersion), std::string("voxelize"),
                                  old.asset, std::string(), std::string(".ply"), options}) {
    parts += std::to_string(part.size()) + ":" + part;
  }
  EXPECT_EQ(request_hash(old), sha256_id(parts));
}

TEST(RequestHash, a_sequence_and_a_grid_of_one_id_are_two_inputs) {
  JobRequest grid, sequence;
  grid.kind = sequence.kind = JobKind::kExport;
  grid.grid = sequence.sequence = sha256_id("x");
  EXPECT_NE(request_hash(grid), request_hash(sequence));
  JobRequest other = sequence;
  other.sequence = sha256_id("y");
  EXPECT_NE(request_hash(other), request_hash(sequence));
}

TEST(RequestHash, input_kind_and_options_matter) {
  JobRequest other = request();
  other.asset = sha256_id("another");
  EXPECT_NE(request_hash(other), request_hash(request()));
  other = request();
  other.kind = JobKind::kRender;
  EXPECT_NE(request_hash(other), request_hash(request()));
  other = request();
  other.options.voxelize.placement.size = 64;
  EXPECT_NE(request_hash(other), request_hash(request()));
}

TEST(RequestHash, whether_the_cache_is_used_does_not_name_another_result_but_another_request) {
  JobRequest other = request();
  other.options.use_cache = false;
  EXPECT_EQ(request_hash(other), request_hash(request()));
  EXPECT_NE(idempotency_hash(other), idempotency_hash(request()));
}

TEST(RequestHash, priority_and_deadline_do_not_name_another_result_but_another_request) {
  JobRequest urgent = request(), due = request();
  urgent.priority = 0;
  due.deadline_ms = 1000;
  for (const JobRequest& other : {urgent, due}) {
    EXPECT_EQ(request_hash(other), request_hash(request()));
    EXPECT_NE(idempotency_hash(other), idempotency_hash(request()));
  }
}

}  // namespace
}  // namespace voxeld
