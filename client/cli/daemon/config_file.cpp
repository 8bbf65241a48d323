#include "client/cli/daemon/config_file.h"

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>

#include "client/include/voxeld/client.h"

namespace voxeld::cli {
namespace {

namespace fs = std::filesystem;
using client::Error;

fs::path absolute_variable(const char* name) {
  const char* value = std::getenv(name);
  return value != nullptr && *value == '/' ? fs::path(value) : fs::path();
}

fs::path with_home(const std::string& path) {
  return path.starts_with("~/") ? absolute_variable("HOME") / path.substr(2) : fs::path(path);
}

}  // namespace

fs::path config_file_path() {
  fs::path folder = absolute_variable("XDG_CONFIG_HOME");
  if (folder.empty()) {
    const fs::path home = absolute_variable("HOME");
    if (home.empty()) return {};
    folder = home / ".config";
  }
  return folder / "voxeld" / "config.toml";
}

ConfigFile read_config_file(const fs::path& path) {
  ConfigFile config;
  std::error_code failed;
  if (path.empty() || !fs::exists(path, failed)) return config;
  std::ifstream file(path);
  if (!file) throw Error("file", 0, path.string() + ": " + std::strerror(errno));
  std::vector<CLI::ConfigItem> items;
  try {
    items = CLI::ConfigTOML().from_config(file);
  } catch (const CLI::Error& error) {
    throw Error("invalid-option", 0, path.string() + ": " + error.what());
  }
  for (const CLI::ConfigItem& item : items) {
    const std::string name = item.fullname();
    const bool is_known = name == "url" || name == "key_file";
    if (!is_known || item.inputs.size() != 1) {
      throw Error("invalid-option", 0, path.string(), "url = \"URL\" or key_file = \"FILE\"",
                  name + " with " + std::to_string(item.inputs.size()) + " values");
    }
    if (name == "url") config.url = item.inputs.front();
    if (name == "key_file") config.key_file = with_home(item.inputs.front());
  }
  return config;
}

}  // namespace voxeld::cli
