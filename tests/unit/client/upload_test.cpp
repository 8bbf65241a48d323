// Meshes on their way to the daemon: from files, memory and streams.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "client/include/voxeld/client.h"
#include "tests/unit/client/client_test_tools.h"
#include "tests/unit/client/scripted_server.h"

namespace voxeld::client {
namespace {

using test::CannedResponse;
using test::json_response;
using test::problem_response;
using test::ScriptedServer;
using ::testing::HasSubstr;
using ::testing::SizeIs;

const std::string kAsset = R"({"id":"sha256-a","filename":"a.ply"})";

// A file in the temporary folder for the time of one test.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& text) {
    path_ = std::filesystem::temp_directory_path() /
            ("unit_client-" + std::to_string(getpid()) + ".ply");
    std::ofstream(path_, std::ios::binary) << text;
  }
  ~TemporaryFile() { std::filesystem::remove(path_); }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

// Gives `text` in pieces of `piece` bytes and counts how often it was asked.
Source stream_of(std::string text, size_t piece, int* calls, const std::string& filename) {
  return Source::stream(
      [text = std::move(text), piece, calls, at = size_t{0}](std::span<std::byte> buffer) mutable {
        ++*calls;
        const size_t count = std::min({piece, buffer.size(), text.size() - at});
        std::ranges::copy(bytes_of(text.substr(at, count)), buffer.begin());
        at += count;
        return count;
      },
      filename);
}

TEST(Upload, a_file_is_sent_with_its_length_and_its_own_name) {
  const std::string text = long_text(300'000);
  const TemporaryFile file(text);
  ScriptedServer server(
      {problem_response(404, "not-found", "no such asset"), json_response(kAsset)});
  EXPECT_EQ(Client(server.url()).upload(Source::file(file.path())), "sha256-a");
  ASSERT_THAT(server.asked(), SizeIs(2));
  const auto asked = server.asked()[1];
  EXPECT_EQ(asked.line(), "POST /v1/assets?filename=" + file.path().filename().string());
  EXPECT_EQ(asked.header("content-length"), "300000");
  EXPECT_EQ(asked.header("content-type"), "application/octet-stream");
  EXPECT_TRUE(asked.body == text);
}

// The hash of 70000 zero bytes.
const std::string kZeros =
    "sha256-f51b279903037b37ea1828a1021499995718d38016cad6c0da30962a41be052f";

TEST(Upload, bytes_that_the_daemon_has_are_not_sent) {
  const Source zeros = Source::memory(std::vector<std::byte>(70'000), "b/zeros.PLY");
  ScriptedServer server({json_response(R"({"id":"sha256-known","filename":"a.ply"})")});
  EXPECT_EQ(Client(server.url()).upload(zeros), "sha256-known");
  EXPECT_THAT(server.lines(), ::testing::ElementsAre("GET /v1/assets/" + kZeros + "?brief=1"));
}

TEST(Upload, bytes_that_the_daemon_has_under_a_name_of_another_format_are_sent) {
  const Source zeros = Source::memory(std::vector<std::byte>(70'000), "zeros.obj");
  ScriptedServer server({json_response(kAsset), json_response(R"({"id":"sha256-a.obj"})")});
  EXPECT_EQ(Client(server.url()).upload(zeros), "sha256-a.obj");
  EXPECT_THAT(server.lines(), ::testing::ElementsAre("GET /v1/assets/" + kZeros + "?brief=1",
                                                     "POST /v1/assets?filename=zeros.obj"));
}

TEST(Upload, an_asset_that_is_deleted_after_the_question_is_sent) {
  ScriptedServer server({json_response(R"({"id":"sha256-known","filename":"a.ply"})"),
                         problem_response(410, "gone", "deleted"), json_response(kAsset),
                         test::job_response("queued"), test::job_response("done"),
                         CannedResponse{.body = "RESULT"}});
  std::string result;
  Client(server.url())
      .voxelize_to(Source::memory(std::vector<std::byte>(70'000), "a.ply"), {},
                   [&](std::span<const std::byte> piece) { result += text_of(piece); });
  EXPECT_EQ(result, "RESULT");
  EXPECT_THAT(server.lines(),
              ::testing::ElementsAre("GET /v1/assets/" + kZeros + "?brief=1", "POST /v1/jobs",
                                     "POST /v1/assets?filename=a.ply", "POST /v1/jobs",
                                     "GET /v1/jobs/j-1", "GET /v1/jobs/j-1/result"));
}

TEST(Upload, a_file_of_a_bundle_that_is_deleted_after_the_question_is_sent) {
  const Source bundle = Source::bundle({Source::memory(bytes_of("mesh"), "a.obj"),
                                        Source::memory(std::vector<std::byte>(70'000), "a.png")});
  ScriptedServer server({json_response(R"({"id":"sha256-0"})"),
                         json_response(R"({"id":"sha256-known","filename":"a.png"})"),
                         problem_response(410, "gone", "deleted"),
                         json_response(R"({"id":"sha256-0"})"), json_response(kAsset),
                         json_response(R"({"id":"sha256-bundle"})")});
  EXPECT_EQ(Client(server.url()).upload(bundle), "sha256-bundle");
  EXPECT_THAT(server.lines(),
              ::testing::ElementsAre("POST /v1/assets?filename=a.obj",
                                     "GET /v1/assets/" + kZeros + "?brief=1", "POST /v1/assets",
                                     "POST /v1/assets?filename=a.obj",
                                     "POST /v1/assets?filename=a.png", "POST /v1/assets"));
  EXPECT_THAT(server.asked()[2].body, HasSubstr("sha256-known"));
  EXPECT_THAT(server.asked()[5].body, ::testing::Not(HasSubstr("sha256-known")));
}

TEST(Upload, a_bundle_with_a_stream_is_sent_once) {
  int calls = 0;
  const Source bundle = Source::bundle({stream_of("mesh", 1000, &calls, "a.obj")});
  ScriptedServer server({json_response(kAsset), problem_response(410, "gone", "deleted")});
  Client client(server.url());
  EXPECT_EQ(error_of([&] { client.upload(bundle); }).code(), "gone");
  EXPECT_THAT(server.asked(), SizeIs(2));
}

TEST(Upload, a_stream_of_which_nothing_was_read_is_sent_again) {
  ScriptedServer server({json_response(kAsset)}, std::chrono::milliseconds(300));
  int calls = 0;
  EXPECT_EQ(Client(settings_for(server.url(), 10)).upload(stream_of("mesh", 1000, &calls, "a.obj")),
            "sha256-a");
  EXPECT_EQ(server.asked()[0].body, "mesh");
}

TEST(Upload, memory_is_sent_with_its_length) {
  ScriptedServer server({json_response(kAsset)});
  Client(server.url()).upload(Source::memory(bytes_of("solid"), "a.stl"));
  EXPECT_EQ(server.asked()[0].header("content-length"), "5");
  EXPECT_EQ(server.asked()[0].body, "solid");
}

TEST(Upload, an_empty_body_is_sent_as_one) {
  ScriptedServer server({json_response(kAsset)});
  Client(server.url()).upload(Source::memory({}, "a.stl"));
  EXPECT_EQ(server.asked()[0].header("content-length"), "0");
}

TEST(Upload, a_stream_is_sent_in_chunks) {
  const std::string text = long_text(200'000);
  ScriptedServer server({json_response(kAsset)});
  int calls = 0;
  Client(server.url()).upload(stream_of(text, 1000, &calls, "a.obj"));
  const auto asked = server.asked()[0];
  EXPECT_EQ(asked.header("transfer-encoding"), "chunked");
  EXPECT_EQ(asked.header("content-length"), "");
  EXPECT_TRUE(asked.body == text);
  EXPECT_EQ(calls, 201);
}

TEST(Upload, names_of_files_are_escaped) {
  const std::string names[][2] = {{"a b.ply", "a%20b.ply"},
                                  {"a&b=c?d#e.ply", "a%26b%3Dc%3Fd%23e.ply"},
                                  {"100%.ply", "100%25.ply"},
                                  {"bäume.ply", "b%C3%A4ume.ply"},
                                  {"a\r\nX: y.ply", "a%0D%0AX%3A%20y.ply"},
                                  {"\xff.ply", "%FF.ply"}};
  for (const auto& [name, escaped] : names) {
    ScriptedServer server({json_response(kAsset)});
    Client(server.url()).upload(Source::memory(bytes_of("x"), name));
    EXPECT_EQ(server.asked()[0].target, "/v1/assets?filename=" + escaped);
  }
}

TEST(Upload, without_a_name_none_is_sent) {
  ScriptedServer server({json_response(kAsset)});
  Client(server.url()).upload(Source::memory(bytes_of("x"), ""));
  EXPECT_EQ(server.asked()[0].target, "/v1/assets");
}

TEST(Upload, a_given_name_stands_for_the_files_own) {
  const TemporaryFile file("x");
  EXPECT_EQ(Source::file(file.path(), "bunny.obj").filename(), "bunny.obj");
  EXPECT_EQ(Source::file(file.path()).filename(), file.path().filename());
}

TEST(Upload, files_and_memory_are_sent_again_from_their_start) {
  const std::string text = long_text(50'000);
  const TemporaryFile file(text);
  for (const Source& source : {Source::file(file.path()), Source::memory(bytes_of(text), "a")}) {
    ScriptedServer server(
        {problem_response(503, "queue-full", "full", {"Retry-After: 0"}), json_response(kAsset)});
    EXPECT_EQ(Client(server.url()).upload(source), "sha256-a");
    ASSERT_THAT(server.asked(), SizeIs(2));
    EXPECT_TRUE(server.asked()[0].body == text);
    EXPECT_TRUE(server.asked()[1].body == text);
  }
}

TEST(Upload, a_stream_is_not_sent_again) {
  ScriptedServer server(
      {problem_response(503, "queue-full", "full", {"Retry-After: 0"}), json_response(kAsset)});
  int calls = 0;
  Client client(server.url());
  const Error error = error_of([&] { client.upload(stream_of("abc", 3, &calls, "a.obj")); });
  EXPECT_EQ(error.code(), "queue-full");
  EXPECT_THAT(server.asked(), SizeIs(1));
  EXPECT_EQ(calls, 2);
}

TEST(Upload, a_refusal_before_the_whole_body_was_sent_is_reported) {
  CannedResponse refusal = problem_response(413, "payload-too-large", "the body is too large");
  refusal.reads_body = false;
  ScriptedServer server({problem_response(404, "not-found", "no such asset"), refusal});
  Client client(server.url());
  const Error error =
      error_of([&] { client.upload(Source::memory(std::vector<std::byte>(64'000'000), "a.ply")); });
  EXPECT_EQ(error.code(), "payload-too-large");
  EXPECT_EQ(error.http_status(), 413);
}

TEST(Upload, a_missing_file_or_a_folder_is_an_error_before_anything_is_sent) {
  ScriptedServer server({});
  Client client(server.url());
  const Error missing = error_of([&] { client.upload(Source::file("/nowhere/a.ply")); });
  EXPECT_EQ(missing.code(), "file");
  EXPECT_STREQ(missing.what(), "/nowhere/a.ply: No such file or directory");
  const Error folder =
      error_of([&] { client.upload(Source::file(std::filesystem::temp_directory_path())); });
  EXPECT_EQ(folder.code(), "file");
  EXPECT_THAT(folder.what(), HasSubstr("directory"));
  EXPECT_THAT(server.asked(), SizeIs(0));
}

TEST(Upload, a_file_that_becomes_shorter_meanwhile_is_an_error) {
  const TemporaryFile file(long_text(4'000'000));
  ScriptedServer server(
      {problem_response(404, "not-found", "no such asset"), json_response(kAsset)});
  Client client(server.url());
  const auto cut = [&](const Progress& progress) {
    if (progress.stage == "upload") std::filesystem::resize_file(file.path(), 0);
    return true;
  };
  const Error error = error_of([&] { client.upload(Source::file(file.path()), cut); });
  EXPECT_EQ(error.code(), "file");
  EXPECT_THAT(error.what(), ::testing::StartsWith(file.path().string() +
                                                  ": cannot be read to its end: expected 4000000 "
                                                  "bytes, got "));
}

TEST(Upload, a_response_without_an_id_is_a_bad_response) {
  ScriptedServer server({json_response("{}")});
  Client client(server.url());
  const Error error = error_of([&] { client.upload(Source::memory(bytes_of("x"), "a")); });
  EXPECT_EQ(error.code(), "bad-response");
  EXPECT_THAT(error.what(), HasSubstr("no asset"));
}

TEST(Upload, a_connection_that_breaks_is_tried_again_unless_a_stream_was_read) {
  CannedResponse cut = json_response(kAsset);
  cut.cut_after = 3;
  ScriptedServer server({cut, json_response(kAsset), cut, cut, cut});
  Client client(settings_for(server.url(), 1));
  const Source mesh = Source::memory(bytes_of("x"), "a");
  EXPECT_EQ(client.upload(mesh), "sha256-a");
  EXPECT_EQ(error_of([&] { client.upload(mesh); }).code(), "unreachable");
  int calls = 0;
  const Source stream = stream_of("mesh", 1000, &calls, "a.obj");
  EXPECT_EQ(error_of([&] { client.upload(stream); }).code(), "unreachable");
  EXPECT_THAT(server.asked(), SizeIs(5));
}

TEST(Upload, an_exception_of_the_stream_passes_through) {
  ScriptedServer server({json_response(kAsset)});
  Client client(server.url());
  const Source broken = Source::stream(
      [](std::span<std::byte>) -> size_t { throw std::domain_error("disk on fire"); }, "a.obj");
  EXPECT_THROW(client.upload(broken), std::domain_error);
}

TEST(Upload, progress_reports_bytes_and_false_stops_it) {
  ScriptedServer server({CannedResponse{.delay = test::kTooLate}});
  Client client(server.url());
  Progress last;
  const auto progress = [&](const Progress& now) {
    last = now;
    return now.done < 50'000;
  };
  const Error error =
      error_of([&] { client.upload(Source::memory(bytes_of(long_text(60'000)), "a"), progress); });
  EXPECT_EQ(error.code(), "interrupted");
  EXPECT_EQ(last.stage, "upload");
  EXPECT_EQ(last.total, 60'000);
}

TEST(Upload, progress_of_a_bundle_is_that_of_all_its_files) {
  const TemporaryFile mesh(long_text(30'000));
  ScriptedServer server({json_response(kAsset), problem_response(404, "not-found", ""),
                         json_response(kAsset), json_response(kAsset)});
  std::vector<Progress> seen;
  Client(server.url())
      .upload(Source::bundle({Source::file(mesh.path()),
                              Source::memory(std::vector<std::byte>(70'000), "a.png")}),
              [&](const Progress& now) {
                seen.push_back(now);
                return true;
              });
  std::int64_t last = 0;
  for (const Progress& now : seen) {
    EXPECT_EQ(now.total, 100'000);
    if (now.stage == "upload") {
      EXPECT_GE(now.done, last);
      last = now.done;
    }
  }
  EXPECT_EQ(last, 100'000);
  // As of a file, but of a stream nobody knows.
  int calls = 0;
  ScriptedServer other({json_response(kAsset), json_response(kAsset), json_response(kAsset)});
  Client(other.url())
      .upload(Source::bundle({Source::file(mesh.path()), stream_of("mesh", 10, &calls, "b.mtl")}),
              [&](const Progress& now) { return now.total == 0; });
}

TEST(Upload, a_stop_token_stops_it) {
  ScriptedServer server({CannedResponse{.delay = test::kTooLate}});
  Client client(server.url());
  std::stop_source stop;
  std::jthread stopper([&] {
    EXPECT_TRUE(server.is_asked(1));
    stop.request_stop();
  });
  const Error error =
      error_of([&] { client.upload(Source::memory(bytes_of("x"), "a"), {}, stop.get_token()); });
  EXPECT_EQ(error.code(), "interrupted");
}

TEST(Upload, an_exception_of_the_progress_callback_passes_through) {
  ScriptedServer server({json_response(kAsset)});
  Client client(server.url());
  EXPECT_THROW(client.upload(Source::memory(bytes_of("x"), "a"),
                             [](const Progress&) -> bool { throw std::domain_error("no"); }),
               std::domain_error);
}

}  // namespace
}  // namespace voxeld::client
