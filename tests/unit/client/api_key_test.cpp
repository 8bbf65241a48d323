// Keys: where the CLI finds one, that the library sends it, and that nothing shows it.
#include "client/cli/daemon/api_key.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <string>

#include "client/include/voxeld/client.h"
#include "tests/unit/base/temporary_dir.h"
#include "tests/unit/client/client_test_tools.h"
#include "tests/unit/client/scripted_server.h"

namespace voxeld::client {
namespace {

using test::CannedResponse;
using test::job_response;
using test::problem_response;
using test::ScriptedServer;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;

const std::string kKey = "vxk_abcdefgh_" + std::string(52, 'q');

// Sets a variable for one test.
class Variable {
 public:
  Variable(const char* name, const std::string& value) : name_(name) {
    ::setenv(name, value.c_str(), 1);
  }
  ~Variable() { ::unsetenv(name_); }

 private:
  const char* name_;
};

Settings with_key(const std::string& url, const std::string& key) {
  Settings settings = settings_for(url, 0);
  settings.key = key;
  return settings;
}

TEST(ApiKey, goes_with_every_request) {
  ScriptedServer server({test::json_response(R"({"id":"sha256-a"})"), job_response("queued"),
                         job_response("done"), CannedResponse{200, "bytes"}});
  Client client(with_key(server.url(), kKey));
  client.upload(Source::memory(bytes_of("mesh"), "a.ply"));
  client.submit("voxelize", Input::of_asset("sha256-a"), {});
  client.wait("j-1");
  client.download("j-1", [](std::span<const std::byte>) {});
  ASSERT_THAT(server.asked(), SizeIs(4));
  for (const auto& asked : server.asked()) {
    EXPECT_EQ(asked.header("authorization"), "Bearer " + kKey) << asked.line();
  }
}

TEST(ApiKey, without_one_no_request_has_an_authorization) {
  ScriptedServer server({job_response("done")});
  Client client(server.url());
  client.job("j-1");
  EXPECT_EQ(server.asked().at(0).header("authorization"), "");
}

TEST(ApiKey, a_redirect_is_not_followed_to_another_server) {
  ScriptedServer other({job_response("done")});
  ScriptedServer server({CannedResponse{302, "", {"Location: " + other.url() + "/v1/jobs/j-1"}}});
  Client client(with_key(server.url(), kKey));
  error_of([&] { client.job("j-1"); });
  EXPECT_THAT(other.asked(), SizeIs(0));
}

TEST(ApiKey, a_refused_one_is_an_error_that_does_not_show_it) {
  ScriptedServer server(
      {problem_response(401, "unauthorized", "this daemon needs a valid API key")});
  Client client(with_key(server.url(), kKey));
  const Error error = error_of([&] { client.job("j-1"); });
  EXPECT_EQ(error.code(), "unauthorized");
  EXPECT_EQ(error.http_status(), 401);
  EXPECT_THAT(error.what(), Not(HasSubstr("qqq")));
}

TEST(ApiKey, one_that_would_be_a_header_of_its_own_is_refused_unshown) {
  for (const std::string& key : {kKey + "\r\nX: y", kKey + "\n", kKey + " ", std::string("\x7f")}) {
    const Error error = error_of([&] { Client client(with_key("http://127.0.0.1:1", key)); });
    EXPECT_EQ(error.code(), "invalid-option");
    EXPECT_THAT(error.what(), Not(HasSubstr("qqq")));
  }
}

TEST(ApiKey, the_flag_comes_before_the_variable_and_that_before_the_file) {
  const testing::TemporaryDir dir;
  const std::string path = (dir.path() / "key").string();
  std::ofstream(path) << "  " << kKey << "\r\n";
  EXPECT_EQ(cli::api_key(""), "");
  EXPECT_EQ(cli::api_key("flag"), "flag");
  const Variable file("VOXELD_KEY_FILE", path);
  EXPECT_EQ(cli::api_key(""), kKey);
  const Variable variable("VOXELD_KEY", "variable");
  EXPECT_EQ(cli::api_key(""), "variable");
  EXPECT_EQ(cli::api_key("flag"), "flag");
}

TEST(ApiKey, a_file_without_a_key_is_named_in_the_error) {
  const testing::TemporaryDir dir;
  const std::string path = (dir.path() / "key").string();
  const Variable file("VOXELD_KEY_FILE", path);
  const Error missing = error_of([] { cli::api_key(""); });
  EXPECT_EQ(missing.code(), "file");
  EXPECT_EQ(std::string(missing.what()),
            "VOXELD_KEY_FILE: " + path + ": No such file or directory");
  std::ofstream(path) << "\n";
  EXPECT_EQ(std::string(error_of([] { cli::api_key(""); }).what()),
            "VOXELD_KEY_FILE: " + path + " is empty");
  const Variable folder("VOXELD_KEY_FILE", dir.path().string());
  EXPECT_EQ(std::string(error_of([] { cli::api_key(""); }).what()),
            "VOXELD_KEY_FILE: " + dir.path().string() + ": Is a directory");
}

TEST(ApiKey, texts_that_are_printed_lose_their_keys) {
  EXPECT_EQ(cli::without_keys("no key"), "no key");
  EXPECT_EQ(cli::without_keys(kKey), "vxk_...");
  EXPECT_EQ(cli::without_keys("not expected: --kye=" + kKey + ", " + kKey + " --x"),
            "not expected: --kye=vxk_..., vxk_... --x");
  EXPECT_EQ(cli::without_keys("vxk_"), "vxk_...");
}

}  // namespace
}  // namespace voxeld::client
