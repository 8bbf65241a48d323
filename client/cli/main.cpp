// voxel: the command line client of voxeld. docs/voxel.md describes its use.
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <exception>
#include <string>

#include "client/cli/arguments.h"
#include "client/cli/bundle.h"
#include "client/cli/commands/commands.h"
#include "client/cli/daemon/api_key.h"
#include "client/cli/daemon/server.h"
#include "client/cli/terminal/human.h"
#include "client/cli/terminal/interrupt.h"
#include "proto/standard_descriptors.h"

namespace {

using namespace voxeld;
using cli::ExitStatus;

// The status of a command that has printed all it had to.
ExitStatus printed_status() {
  const bool is_flushed = std::fflush(stdout) == 0;
  const std::string why = is_flushed ? "" : std::string(": ") + std::strerror(errno);
  // The C library drops the bytes and the reason of a write that failed: the last flush may succeed
  // nevertheless.
  if (is_flushed && std::ferror(stdout) == 0) return cli::kSuccess;
  std::fprintf(stderr, "voxel: stdout cannot be written%s\n", why.c_str());
  return cli::kFailure;
}

int run(int argc, char** argv) {
  auto parsed = cli::parse_arguments(argc, argv);
  if (const auto* status = std::get_if<ExitStatus>(&parsed)) {
    return *status == cli::kSuccess ? printed_status() : *status;
  }
  auto& arguments = std::get<cli::Arguments>(parsed);
  cli::Interrupt interrupt;
  try {
    if (cli::needs_server(arguments)) {
      // Not after a server is found: the private daemon ends when idle. A stream with other files
      // beside it is refused at once.
      if (arguments.beside.empty()) {
        arguments.pipe = cli::await_stream(arguments.input, interrupt.token());
      }
      const cli::Server server = cli::find_server(arguments, interrupt.token());
      arguments.url = server.url;
      arguments.key = server.key;
    }
    if (!cli::heeds_stop(arguments)) interrupt.end_at_once();
    cli::run_command(arguments, interrupt.token());
  } catch (const client::Error& error) {
    std::fprintf(stderr, "voxel: %s\n", cli::printable(cli::without_keys(error.what())).c_str());
    if (!error.request_id().empty()) {
      std::fprintf(stderr, "voxel: request %s\n", error.request_id().c_str());
    }
    return cli::exit_status_of(error);
  }
  return printed_status();
}

}  // namespace

int main(int argc, char** argv) {
  voxeld::keep_standard_descriptors();
  try {
    return run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "voxel: %s\n", error.what());
    return voxeld::cli::kFailure;
  }
}
