#include "client/cli/daemon/config_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>

#include "tests/unit/client/client_test_tools.h"

namespace voxeld::cli {
namespace {

namespace fs = std::filesystem;
using client::error_of;

class ConfigFileTest : public ::testing::Test {
 protected:
  ~ConfigFileTest() override { fs::remove(path_); }
  ConfigFile read(const std::string& text) const {
    std::ofstream(path_) << text;
    return read_config_file(path_);
  }
  const fs::path path_ =
      fs::temp_directory_path() / ("unit_client-" + std::to_string(getpid()) + ".toml");
};

TEST_F(ConfigFileTest, url_and_key_file_are_read) {
  ::setenv("HOME", "/home/me", 1);
  const ConfigFile config = read(
      "# of the lab\nurl = \"https://voxels.example.org\"\nkey_file = \"~/.config/voxeld/key\"\n");
  EXPECT_EQ(config.url, "https://voxels.example.org");
  EXPECT_EQ(config.key_file, "/home/me/.config/voxeld/key");
}

TEST_F(ConfigFileTest, a_missing_file_names_nothing) {
  EXPECT_EQ(read_config_file("/nowhere/config.toml").url, "");
  EXPECT_EQ(read_config_file("").url, "");
}

TEST_F(ConfigFileTest, an_unknown_name_is_refused) {
  const client::Error error = error_of([&] { read("adress = \"x\"\n"); });
  EXPECT_EQ(error.code(), "invalid-option");
  EXPECT_EQ(error.what(), path_.string() +
                              ": expected url = \"URL\" or key_file = \"FILE\", got adress with 1 "
                              "values");
}

TEST_F(ConfigFileTest, it_lies_in_the_folder_of_configurations) {
  ::setenv("XDG_CONFIG_HOME", "/etc/me", 1);
  EXPECT_EQ(config_file_path(), "/etc/me/voxeld/config.toml");
  ::setenv("XDG_CONFIG_HOME", "relative", 1);
  ::setenv("HOME", "/home/me", 1);
  EXPECT_EQ(config_file_path(), "/home/me/.config/voxeld/config.toml");
  ::unsetenv("XDG_CONFIG_HOME");
}

}  // namespace
}  // namespace voxeld::cli
