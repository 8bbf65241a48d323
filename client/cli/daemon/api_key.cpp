#include "client/cli/daemon/api_key.h"

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>

#include "client/include/voxeld/client.h"

namespace voxeld::cli {
namespace {

std::string variable(const char* name) {
  const char* value = std::getenv(name);
  return value != nullptr ? value : "";
}

// `name`: what named the file.
std::string read_key(const std::string& name, const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string text;
  std::getline(file, text, '\0');  // an iterator of the buffer would throw for a folder
  if (!file.is_open() || file.bad()) {
    throw client::Error("file", 0, name + ": " + path + ": " + std::strerror(errno));
  }
  constexpr std::string_view kSpace = " \t\r\n";
  const size_t begin = text.find_first_not_of(kSpace);
  if (begin == std::string::npos) {
    throw client::Error("file", 0, name + ": " + path + " is empty");
  }
  return text.substr(begin, text.find_last_not_of(kSpace) + 1 - begin);
}

}  // namespace

std::string api_key(const std::string& flag, const std::filesystem::path& configured) {
  if (!flag.empty()) return flag;
  if (std::string key = variable("VOXELD_KEY"); !key.empty()) return key;
  if (const std::string path = variable("VOXELD_KEY_FILE"); !path.empty()) {
    return read_key("VOXELD_KEY_FILE", path);
  }
  return configured.empty() ? "" : read_key("key_file", configured.string());
}

std::string without_keys(std::string_view text) {
  constexpr std::string_view kPrefix = "vxk_";
  constexpr std::string_view kOfKeys = "abcdefghijklmnopqrstuvwxyz234567_";
  std::string out;
  while (true) {
    const size_t at = text.find(kPrefix);
    if (at == std::string_view::npos) return out += text;
    out += text.substr(0, at + kPrefix.size());
    out += "...";
    text.remove_prefix(at + kPrefix.size());
    text.remove_prefix(std::min(text.size(), text.find_first_not_of(kOfKeys)));
  }
}

}  // namespace voxeld::cli
