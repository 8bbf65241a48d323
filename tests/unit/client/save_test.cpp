// Grids as files: the native container by the library, other formats by the daemon.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <thread>

#include "client/include/voxeld/client.h"
#include "proto/container/grid_format.h"
#include "tests/unit/client/client_test_tools.h"
#include "tests/unit/client/scripted_server.h"
#include "tests/unit/proto/tile_maker.h"

namespace voxeld::client {
namespace {

using test::CannedResponse;
using test::job_response;
using test::json_response;
using test::problem_response;
using test::ScriptedServer;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

const CannedResponse kMeshUploaded = json_response(R"({"id":"sha256-a"})");
const CannedResponse kVoxelized = job_response(
    "done", R"("result":{"grid":"sha256-g","media_type":"application/vnd.voxeld.grid"})");

std::string sample_container() {
  GridHeader header;
  header.dims = {20, 20, 20};
  header.voxel_size = {1, 2, 3};
  header.channels.color = true;
  std::mt19937 random(7);
  const auto bytes =
      encode_grid(header,
                  test::tiles_of(test::random_voxels(random, header.dims, 300), header.channels))
          .value();
  return {bytes.begin(), bytes.end()};
}

class Save : public ::testing::Test {
 protected:
  void SetUp() override {
    directory_ =
        std::filesystem::temp_directory_path() / ("voxeld-save-" + std::to_string(getpid()));
    std::filesystem::create_directory(directory_);
  }
  void TearDown() override { std::filesystem::remove_all(directory_); }

  std::filesystem::path path(const std::string& name) const { return directory_ / name; }
  std::string content(const std::string& name) const {
    std::ifstream file(path(name), std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  std::vector<std::string> names() const {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(directory_)) {
      names.push_back(entry.path().filename().string());
    }
    return names;
  }

  std::filesystem::path directory_;
};

// A grid that a daemon voxelized, by the first four responses of its script.
Grid voxelized(const std::string& url) {
  return Client(settings_for(url, 0)).voxelize(Source::memory(bytes_of("x"), "a.ply"), {});
}

std::vector<CannedResponse> voxelized_then(std::vector<CannedResponse> more) {
  std::vector<CannedResponse> all = {kMeshUploaded, job_response("queued"), kVoxelized,
                                     CannedResponse{.body = sample_container()}};
  all.insert(all.end(), more.begin(), more.end());
  return all;
}

TEST_F(Save, the_native_container_needs_no_daemon) {
  const Grid grid = Grid::decode(bytes_of(sample_container()));
  EXPECT_EQ(grid.id(), "");
  grid.save(path("A.VOXG"));
  EXPECT_EQ(content("A.VOXG"), sample_container());
  grid.save(path("b"), Format::kNative);
  EXPECT_EQ(content("b"), sample_container());
  EXPECT_THAT(names(), SizeIs(2));
}

TEST_F(Save, the_daemon_converts_its_grid_to_the_format_of_the_extension) {
  ScriptedServer server(voxelized_then({job_response("queued"), job_response("done"),
                                        CannedResponse{.body = "converted"}, job_response("queued"),
                                        job_response("done"), CannedResponse{.body = "again"}}));
  const Grid grid = voxelized(server.url());
  EXPECT_EQ(grid.id(), "sha256-g");
  grid.save(path("a.nii.gz"), Options().channel(Channel::kColor));
  EXPECT_EQ(content("a.nii.gz"), "converted");
  grid.save(path("a.nii.gz"), Format::kNii);
  EXPECT_EQ(content("a.nii.gz"), "again");
  EXPECT_THAT(names(), ElementsAre("a.nii.gz"));
  const auto asked = server.asked();
  ASSERT_THAT(asked, SizeIs(10));
  EXPECT_EQ(asked[4].body, R"({"grid":"sha256-g","kind":"export",)"
                           R"("options":{"channel":"color","format":"nii"}})");
  EXPECT_EQ(asked[6].line(), "GET /v1/jobs/j-1/result");
}

TEST_F(Save, a_native_container_with_options_is_made_by_the_daemon) {
  ScriptedServer server(voxelized_then(
      {job_response("queued"), job_response("done"), CannedResponse{.body = "small"}}));
  voxelized(server.url()).save(path("a.voxg"), Options().codec(Codec::kSmall));
  EXPECT_EQ(content("a.voxg"), "small");
}

TEST_F(Save, a_failed_conversion_leaves_the_file_as_it_was) {
  std::ofstream(path("a.vox")) << "old";
  CannedResponse cut{.body = "converted", .cut_after = 3};
  ScriptedServer server(voxelized_then({problem_response(400, "invalid-option", "palette"),
                                        job_response("queued"), job_response("done"), cut}));
  const Grid grid = voxelized(server.url());
  EXPECT_EQ(error_of([&] { grid.save(path("a.vox"), Options().palette(999)); }).code(),
            "invalid-option");
  EXPECT_EQ(error_of([&] { grid.save(path("a.vox")); }).code(), "unreachable");
  EXPECT_EQ(content("a.vox"), "old");
  EXPECT_THAT(names(), ElementsAre("a.vox"));
}

TEST_F(Save, a_part_that_a_process_of_the_same_number_left_is_no_obstacle) {
  std::ofstream(path("a.voxg.part-" + std::to_string(getpid()))) << "old";
  Grid::decode(bytes_of(sample_container())).save(path("a.voxg"));
  EXPECT_EQ(content("a.voxg"), sample_container());
  EXPECT_THAT(names(), SizeIs(2));
}

TEST_F(Save, a_stopped_conversion_is_cancelled) {
  ScriptedServer server(
      voxelized_then({job_response("queued"), job_response("running"), job_response("cancelled")}));
  const Grid grid = voxelized(server.url());
  const auto stop = [](const Progress&) { return false; };
  EXPECT_EQ(error_of([&] { grid.save(path("a.vox"), {}, stop); }).code(), "interrupted");
  EXPECT_EQ(server.lines().back(), "DELETE /v1/jobs/j-1");
  EXPECT_THAT(names(), IsEmpty());
}

TEST_F(Save, a_link_stays_one_and_a_pipe_is_written_to) {
  const Grid grid = Grid::decode(bytes_of(sample_container()));
  std::ofstream(path("a.voxg")) << "old";
  std::filesystem::create_symlink(path("a.voxg"), path("link.voxg"));
  grid.save(path("link.voxg"));
  ASSERT_TRUE(std::filesystem::is_symlink(path("link.voxg")));
  EXPECT_EQ(content("a.voxg"), sample_container());
  ASSERT_EQ(mkfifo(path("pipe.voxg").c_str(), 0600), 0);
  std::string piped;
  std::jthread reader([&] { piped = content("pipe.voxg"); });
  grid.save(path("pipe.voxg"));
  reader.join();
  EXPECT_EQ(piped, sample_container());
  EXPECT_THAT(names(), SizeIs(3));
}

TEST_F(Save, errors_tell_what_a_file_needs) {
  const Grid grid = Grid::decode(bytes_of(sample_container()));
  const auto text = [&](const std::string& name, const Options& options) {
    const Error error = error_of([&] { grid.save(name, options); });
    EXPECT_EQ(error.code(), "file");
    return std::string(error.what());
  };
  EXPECT_THAT(text("a.foo", {}), HasSubstr("a.foo: expected option format, or one of the "
                                           "extensions .voxg .npy .npz .vox"));
  EXPECT_THAT(text("a.foo", {}), HasSubstr(", got .foo"));
  EXPECT_THAT(text(".vox", {}), HasSubstr(", got none"));
  EXPECT_EQ(text("a.vox", Options().format(Format::kNpz)),
            "a.vox: expected format vox by its extension, got npz");
  EXPECT_EQ(text("a.vox", {}),
            "a.vox: the daemon converts grids: expected a grid of its own, or format native "
            "without options, got a grid without an id");
  EXPECT_EQ(text("/nowhere/a.voxg", {}), "/nowhere/a.voxg: No such file or directory");
}

TEST_F(Save, a_stored_grid_and_a_frame_have_ids) {
  const std::string bytes = sample_container();
  ScriptedServer server({CannedResponse{.body = bytes}, CannedResponse{.body = bytes},
                         problem_response(404, "not-found", "no such grid")});
  Client client(server.url());
  EXPECT_EQ(client.grid("sha256-g").id(), "sha256-g");
  EXPECT_EQ(client.frame("j-1", 2).id(), "");  // without an ETag
  EXPECT_EQ(error_of([&] { client.grid("../x"); }).code(), "not-found");
  EXPECT_THAT(server.lines(), ElementsAre("GET /v1/grids/sha256-g", "GET /v1/jobs/j-1/frames/2",
                                          "GET /v1/grids/..%2Fx"));
}

}  // namespace
}  // namespace voxeld::client
