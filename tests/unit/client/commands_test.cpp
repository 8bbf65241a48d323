// Commands of voxel against a scripted daemon: what is asked, and what is left on the disk.
#include "client/cli/commands/commands.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "client/cli/exit_status.h"
#include "tests/unit/client/client_test_tools.h"
#include "tests/unit/client/scripted_server.h"

namespace voxeld::cli {
namespace {

namespace fs = std::filesystem;
using client::error_of;
using test::CannedResponse;
using test::job_response;
using test::json_response;
using test::ScriptedServer;
using ::testing::ElementsAre;

class Commands : public ::testing::Test {
 protected:
  Commands()
      : folder_(fs::temp_directory_path() / ("unit_client-commands-" + std::to_string(getpid()))) {
    fs::create_directory(folder_);
    std::ofstream(mesh()) << "ply\n";
  }
  ~Commands() override { fs::remove_all(folder_); }
  fs::path mesh() const { return folder_ / "a.ply"; }
  fs::path output() const { return folder_ / "out"; }
  std::string written() const {
    std::ifstream file(output(), std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  // Nothing but the mesh: no output, no part of one.
  void expect_nothing_written() const {
    EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 1);
  }
  Arguments arguments(Arguments::Command command, const ScriptedServer& server) const {
    Arguments arguments;
    arguments.command = command;
    arguments.url = server.url();
    arguments.quiet = true;
    arguments.output = output();
    return arguments;
  }
  // Runs the command and stops it when the daemon was asked `requests` times.
  static client::Error stopped_after(const ScriptedServer& server, size_t requests,
                                     const Arguments& arguments) {
    std::stop_source stop;
    std::jthread stopper([&] {
      EXPECT_TRUE(server.is_asked(requests));
      stop.request_stop();
    });
    return error_of([&] { run_command(arguments, stop.get_token()); });
  }

  fs::path folder_;
};

TEST_F(Commands, voxelize_writes_the_result) {
  ScriptedServer server({json_response(R"({"id":"sha256-a"})"), job_response("queued"),
                         job_response("done"), CannedResponse{.body = "RESULT"}});
  Arguments voxelize = arguments(Arguments::Command::kVoxelize, server);
  voxelize.input = mesh();
  run_command(voxelize, {});
  EXPECT_EQ(written(), "RESULT");
}

TEST_F(Commands, a_failure_leaves_no_new_file_and_the_old_one_unchanged) {
  ScriptedServer server({json_response(R"({"id":"sha256-a"})"), job_response("queued"),
                         job_response("done"), CannedResponse{.body = "RESULT", .cut_after = 3}});
  Arguments voxelize = arguments(Arguments::Command::kVoxelize, server);
  voxelize.input = mesh();
  EXPECT_EQ(error_of([&] { run_command(voxelize, {}); }).code(), "unreachable");
  expect_nothing_written();
  ScriptedServer second({});
  voxelize.url = second.url();
  std::ofstream(output()) << "old";
  EXPECT_EQ(error_of([&] { run_command(voxelize, {}); }).code(), "bad-response");
  EXPECT_EQ(written(), "old");
}

TEST_F(Commands, a_damaged_result_leaves_no_new_file_and_the_old_one_unchanged) {
  const std::string id =
      "\"sha256-a67d2a6c9087c1bcb7e7cc96385d820b9264c5043aadb04c3e0efe0e6621a5ef\"";  // of "RESULT"
  for (const bool has_old : {false, true}) {
    ScriptedServer server({json_response(R"({"id":"sha256-a"})"), job_response("queued"),
                           job_response("done"),
                           CannedResponse{.body = "RESVLT", .headers = {"ETag: " + id}}});
    Arguments voxelize = arguments(Arguments::Command::kVoxelize, server);
    voxelize.input = mesh();
    if (has_old) std::ofstream(output()) << "old";
    const client::Error error = error_of([&] { run_command(voxelize, {}); });
    EXPECT_EQ(error.code(), "content-mismatch");
    EXPECT_EQ(exit_status_of(error), kUnreachable);
    if (has_old) {
      EXPECT_EQ(written(), "old");
    } else {
      expect_nothing_written();
    }
  }
}

TEST_F(Commands, a_texture_of_the_mesh_is_not_overwritten) {
  std::ofstream(folder_ / "b.obj") << "mtllib b.mtl\n";
  std::ofstream(folder_ / "b.mtl") << "map_Kd b.png\n";
  std::ofstream(folder_ / "b.png") << "texture";
  ScriptedServer server({});
  Arguments render = arguments(Arguments::Command::kRender, server);
  render.input = folder_ / "b.obj";
  render.output = folder_ / "b.png";
  const client::Error error = error_of([&] { run_command(render, {}); });
  EXPECT_EQ(exit_status_of(error), kUsage);
  EXPECT_EQ(error.what(), render.output + " belongs to " + render.input + " and would be lost");
  render.out_dir = folder_;
  render.batch = {{render.input, render.output}};
  EXPECT_EQ(exit_status_of(error_of([&] { run_command(render, {}); })), kUsage);
  EXPECT_THAT(server.lines(), ::testing::IsEmpty());
  EXPECT_EQ(fs::file_size(folder_ / "b.png"), 7u);
}

TEST_F(Commands, a_key_that_no_daemon_takes_is_an_error_of_the_whole_batch) {
  ScriptedServer server({});
  Arguments voxelize = arguments(Arguments::Command::kVoxelize, server);
  voxelize.output.clear();
  voxelize.out_dir = folder_;
  voxelize.batch = {{mesh().string(), output().string()}};
  voxelize.key = "vxk_a\r";
  EXPECT_EQ(error_of([&] { run_command(voxelize, {}); }).code(), "invalid-option");
  EXPECT_THAT(server.lines(), ::testing::IsEmpty());
  expect_nothing_written();
}

TEST_F(Commands, a_stop_is_heeded_where_there_is_a_job_or_a_file) {
  Arguments given;
  given.command = Arguments::Command::kJobs;
  EXPECT_FALSE(heeds_stop(given));
  given.output = "a.vox";
  EXPECT_TRUE(heeds_stop(given));
  given.command = Arguments::Command::kVoxelize;
  EXPECT_TRUE(heeds_stop(given));
  given.command = Arguments::Command::kList;
  EXPECT_FALSE(heeds_stop(given));
}

TEST_F(Commands, an_interrupt_cancels_the_job_of_a_mesh) {
  ScriptedServer server({json_response(R"({"id":"sha256-a"})"), job_response("queued"),
                         CannedResponse{.status = 304, .delay = test::kTooLate},
                         job_response("cancelled")});
  Arguments voxelize = arguments(Arguments::Command::kVoxelize, server);
  voxelize.input = mesh();
  EXPECT_EQ(stopped_after(server, 3, voxelize).code(), "interrupted");
  EXPECT_EQ(server.lines().back(), "DELETE /v1/jobs/j-1");
  expect_nothing_written();
}

TEST_F(Commands, an_interrupt_cancels_the_image_of_a_grid) {
  ScriptedServer server({job_response("queued"),
                         CannedResponse{.status = 304, .delay = test::kTooLate},
                         job_response("cancelled")});
  Arguments render = arguments(Arguments::Command::kRender, server);
  render.grid = "sha256-g";
  EXPECT_EQ(stopped_after(server, 2, render).code(), "interrupted");
  EXPECT_THAT(server.lines(),
              ElementsAre("POST /v1/jobs", "GET /v1/jobs/j-1", "DELETE /v1/jobs/j-1"));
  expect_nothing_written();
}

TEST_F(Commands, an_interrupt_ends_the_pause_of_a_busy_daemon) {
  const CannedResponse busy = test::problem_response(503, "queue-full", "", {"Retry-After: 9"});
  Arguments render, dry_run, info, top;
  render.command = dry_run.command = Arguments::Command::kRender;
  render.grid = dry_run.grid = "sha256-g";
  render.output = output();
  dry_run.dry_run = true;
  info.command = Arguments::Command::kInfo;
  info.input = mesh();
  top.command = Arguments::Command::kTop;
  for (Arguments* given : {&render, &dry_run, &info, &top}) {
    std::vector<CannedResponse> script = {busy};
    if (given == &info) script.insert(script.begin(), json_response(R"({"id":"sha256-a"})"));
    ScriptedServer server(script);
    given->url = server.url();
    given->quiet = true;
    EXPECT_EQ(stopped_after(server, script.size(), *given).code(), "interrupted");
    EXPECT_THAT(server.lines(), ::testing::SizeIs(script.size())) << "no further try";
  }
  expect_nothing_written();
}

TEST_F(Commands, a_stored_sequence_is_drawn) {
  ScriptedServer server(
      {job_response("queued"), job_response("done"), CannedResponse{.body = "GIF89a"}});
  Arguments render = arguments(Arguments::Command::kRender, server);
  render.sequence = "sha256-s";
  render.options.set("image", "gif");
  run_command(render, {});
  EXPECT_EQ(written(), "GIF89a");
  EXPECT_EQ(server.asked()[0].body,
            R"({"kind":"render","options":{"image":"gif"},"sequence":"sha256-s"})");
}

TEST_F(Commands, the_frames_of_a_job_are_converted_as_the_job_selected_them) {
  const std::string made = R"("options":{"region":[0,0,0,8,8,8]},"result":{"sequence":"sha256-s",)"
                           R"("media_type":"application/vnd.voxeld.sequence"})";
  ScriptedServer server({job_response("done", made), job_response("queued"), job_response("done"),
                         CannedResponse{.body = "VOX "}});
  Arguments jobs = arguments(Arguments::Command::kJobs, server);
  jobs.job = "j-1";
  jobs.output = folder_ / "a.vox";
  run_command(jobs, {});
  EXPECT_EQ(server.asked()[1].body, R"({"kind":"export","options":{"format":"vox",)"
                                    R"("region":"0,0,0,8,8,8"},"sequence":"sha256-s"})");
}

TEST_F(Commands, files_beside_the_mesh_go_with_it) {
  std::ofstream(folder_ / "b.md5anim") << "MD5Version 10\n";
  ScriptedServer server({json_response(R"({"id":"sha256-a"})"),
                         json_response(R"({"id":"sha256-b"})"),
                         json_response(R"({"id":"sha256-c"})"), job_response("queued"),
                         job_response("done"), CannedResponse{.body = "RESULT"}});
  Arguments voxelize = arguments(Arguments::Command::kVoxelize, server);
  voxelize.input = mesh();
  voxelize.beside = {folder_ / "b.md5anim"};
  run_command(voxelize, {});
  EXPECT_THAT(server.lines(),
              ElementsAre("POST /v1/assets?filename=a.ply", "POST /v1/assets?filename=b.md5anim",
                          "POST /v1/assets", "POST /v1/jobs", "GET /v1/jobs/j-1",
                          "GET /v1/jobs/j-1/result"));
  EXPECT_THAT(server.asked()[3].body, ::testing::HasSubstr(R"("asset":"sha256-c")"));
}

TEST_F(Commands, an_interrupt_cancels_the_inspection_of_a_mesh) {
  ScriptedServer server({json_response(R"({"id":"sha256-a"})"), job_response("queued"),
                         CannedResponse{.status = 304, .delay = test::kTooLate},
                         job_response("cancelled")});
  Arguments info = arguments(Arguments::Command::kInfo, server);
  info.input = mesh();
  EXPECT_EQ(stopped_after(server, 3, info).code(), "interrupted");
  EXPECT_EQ(server.lines().back(), "DELETE /v1/jobs/j-1");
}

TEST_F(Commands, info_of_a_damaged_container_names_the_file_and_asks_no_daemon) {
  Arguments info;
  info.command = Arguments::Command::kInfo;
  for (const char* name : {"b.voxg", "B.VOXG", "b.voxs"}) {
    info.input = folder_ / name;
    std::ofstream(info.input) << "no container";
    EXPECT_FALSE(needs_server(info)) << name;
    const client::Error error = error_of([&] { run_command(info, {}); });
    EXPECT_EQ(exit_status_of(error), kBadInput) << name;
    EXPECT_THAT(error.what(), ::testing::StartsWith(info.input + ": ")) << name;
  }
}

TEST_F(Commands, info_of_a_container_that_cannot_be_read_says_why) {
  Arguments info;
  info.command = Arguments::Command::kInfo;
  info.input = folder_ / "c.voxg";
  const client::Error missing = error_of([&] { run_command(info, {}); });
  EXPECT_EQ(missing.code(), "file");
  EXPECT_EQ(missing.what(), info.input + ": No such file or directory");
  fs::create_directory(info.input);
  const client::Error folder = error_of([&] { run_command(info, {}); });
  EXPECT_EQ(folder.code(), "file");
  EXPECT_EQ(folder.what(), info.input + ": Is a directory");
}

TEST_F(Commands, an_interrupt_while_another_ones_job_is_waited_for_leaves_it_alone) {
  ScriptedServer server(
      {CannedResponse{.status = 304, .delay = test::kTooLate}, job_response("cancelled")});
  Arguments jobs = arguments(Arguments::Command::kJobs, server);
  jobs.job = "j-1";
  EXPECT_EQ(stopped_after(server, 1, jobs).code(), "interrupted");
  EXPECT_THAT(server.lines(), ElementsAre("GET /v1/jobs/j-1"));
  expect_nothing_written();
}

}  // namespace
}  // namespace voxeld::cli
