// How large inputs are, and the costs that follow before any job has run.
#include "server/jobs/estimates/job_guess.h"

#include <gtest/gtest.h>

#include <array>
#include <string>

#include "server/jobs/estimates/job_input.h"
#include "server/store/blob_store.h"
#include "tests/unit/base/temporary_dir.h"
#include "tests/unit/scene/zip_maker.h"

namespace voxeld {
namespace {

using Form = JobInput::Form;

class JobInputTest : public ::testing::Test {
 protected:
  JobInput input_of(const std::string& bytes) {
    BlobWriter writer = blobs_.begin(1 << 24, Durability::kSoon).value();
    EXPECT_TRUE(writer.append({reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()}).ok());
    return file_input(blobs_, writer.finish().value().id);
  }

  testing::TemporaryDir dir_;
  BlobStore blobs_ = BlobStore::open(dir_.path()).value();
};

TEST_F(JobInputTest, text_has_no_zeros) {
  const JobInput text = input_of("solid cube");
  EXPECT_EQ(text.form, Form::kText);
  EXPECT_EQ(text.bytes, 10);
  EXPECT_EQ(input_of(std::string("glTF\2\0\0\0", 8)).form, Form::kGlb);
  EXPECT_EQ(file_input(blobs_, "sha256-0").bytes, 0);
}

TEST_F(JobInputTest, archives_count_unpacked) {
  const std::string archive = test::ZipMaker()
                                  .add({.name = "a.obj", .data = "v", .declared_bytes = 1000000})
                                  .add("long/path/of/a.mtl", std::string(234, 'm'))
                                  .bytes();
  for (const std::string& bytes : {archive, archive + std::string(60000, '#')}) {
    const JobInput input = input_of(bytes);
    EXPECT_EQ(input.form, Form::kZip);
    EXPECT_EQ(input.bytes, 1000234);
  }
  // Without a whole directory, as large as the file.
  for (size_t bytes = 4; bytes < archive.size(); ++bytes) {
    EXPECT_EQ(input_of(archive.substr(0, bytes)).bytes, static_cast<int64_t>(bytes));
  }
  // Nor one of other bytes.
  for (size_t at = archive.size() - 150; at < archive.size(); ++at) {
    std::string changed = archive;
    changed[at] = static_cast<char>(changed[at] ^ 0xff);
    EXPECT_GE(input_of(changed).bytes, static_cast<int64_t>(archive.size()));
  }
}

TEST(JobGuess, grows_with_what_costs) {
  RequestOptions options;
  const JobInput mesh{Form::kBinary, 3 << 20};
  const auto seconds = [&] { return guess_costs(JobKind::kVoxelize, options, mesh).work_seconds; };
  options.voxelize.placement.size = 1024;
  const double surface = seconds();
  options.voxelize.fill = Fill::kSolid;
  const double solid = seconds();
  EXPECT_GT(solid, 4 * surface);
  options.voxelize.sign = Sign::kWinding;
  EXPECT_GT(seconds(), 4 * solid);
  options.voxelize = {};
  options.voxelize.placement.size = 1024;
  options.output.format = Format::kObj;
  options.output.mesh = MeshSurface::kSmooth;
  EXPECT_GT(seconds(), 4 * surface);
  // A zip of a text takes as long as its text.
  const JobInput text{Form::kText, 300 << 20}, zip{Form::kZip, 300 << 20};
  EXPECT_DOUBLE_EQ(guess_costs(JobKind::kInspect, {}, text).read_seconds,
                   guess_costs(JobKind::kInspect, {}, zip).read_seconds);
}

TEST(JobGuess, views_of_a_turntable_share_their_grid) {
  RequestOptions options;
  options.voxelize.placement.size = 1024;
  options.render.width = options.render.height = 16;
  const JobInput mesh{Form::kBinary, 3 << 20};
  const JobGuess one = guess_costs(JobKind::kRender, options, mesh);
  options.render.turntable = 20;
  const JobGuess view = guess_costs(JobKind::kRender, options, mesh);
  EXPECT_LT(20 * view.work_seconds, 2 * one.work_seconds);
  EXPECT_LT(20 * view.device_seconds, 2 * one.device_seconds);
}

TEST(JobGuess, files_are_as_large_as_the_cells_in_them) {
  RequestOptions options;
  options.voxelize.placement.size = 1024;
  options.output.format = Format::kNpy;
  const JobInput mesh{Form::kBinary, 3 << 20};
  const auto bytes = [&] { return guess_costs(JobKind::kVoxelize, options, mesh).result_bytes; };
  const double whole = bytes();
  options.output.level = 3;
  EXPECT_NEAR(bytes(), whole / 512, whole / 5120);
  options.output.level = 0;
  options.output.region = std::array{0, 0, 0, 512, 512, 1};
  EXPECT_NEAR(bytes(), whole / 4096, whole / 40960);
}

}  // namespace
}  // namespace voxeld
