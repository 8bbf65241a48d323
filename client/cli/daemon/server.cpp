#include "client/cli/daemon/server.h"

#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include "client/cli/daemon/api_key.h"
#include "client/cli/daemon/config_file.h"
#include "client/cli/daemon/private_daemon.h"
#include "client/include/voxeld/client.h"

namespace voxeld::cli {
namespace {

using client::Error;

// Limit of the request that asks whether a voxeld serves at kDefaultUrl.
constexpr std::chrono::seconds kAskTimeMax{2};

std::string url_variable() {
  const char* url = std::getenv("VOXELD_URL");
  return url != nullptr ? url : "";
}

// Another program may listen there. It does not get the key.
bool is_voxeld(const std::string& url) {
  client::Settings settings;
  settings.url = url;
  settings.retries = 0;
  settings.connect_timeout = settings.timeout = kAskTimeMax;
  try {
    return client::Client(settings).whoami_json().starts_with('{');
  } catch (const Error& error) {
    return error.code() != "unreachable" && error.code() != "timeout" &&
           error.code() != "bad-response";
  }
}

Server private_server(const Arguments& arguments, const std::stop_token& stop) {
  const PrivateDaemon daemon = use_private_daemon(stop);
  if (daemon.is_new && !arguments.quiet && ::isatty(STDERR_FILENO) == 1) {
    std::fprintf(stderr, "voxel: started a private voxeld, which ends when idle; data: %s\n",
                 private_daemon_folder().c_str());
  }
  return {daemon.url, daemon.key};
}

}  // namespace

Server find_server(const Arguments& arguments, const std::stop_token& stop) {
  if (arguments.is_local.value_or(false)) return private_server(arguments, stop);
  std::string url = arguments.url.empty() ? url_variable() : arguments.url;
  if (!url.empty()) return {url, api_key(arguments.key, {})};
  const ConfigFile config = read_config_file(config_file_path());
  if (!config.url.empty()) return {config.url, api_key(arguments.key, config.key_file)};
  if (!arguments.is_local.value_or(true) || is_voxeld(kDefaultUrl)) {
    return {kDefaultUrl, api_key(arguments.key, config.key_file)};
  }
  return private_server(arguments, stop);
}

}  // namespace voxeld::cli
