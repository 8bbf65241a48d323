// voxel: the command line client of voxeld. docs/voxel.md describes its use.
#include <cstdio>
#include <exception>

#include "client/cli/api_key.h"
#include "client/cli/arguments.h"
#include "client/cli/commands.h"
#include "client/cli/interrupt.h"

namespace {

using namespace voxeld;
using cli::ExitStatus;

int run(int argc, char** argv) {
  const auto arguments = cli::parse_arguments(argc, argv);
  if (const auto* status = std::get_if<ExitStatus>(&arguments)) return *status;
  const cli::Interrupt interrupt;
  try {
    cli::run_command(std::get<cli::Arguments>(arguments), interrupt.token());
  } catch (const client::Error& error) {
    std::fprintf(stderr, "voxel: %s\n", cli::without_keys(error.what()).c_str());
    if (!error.request_id().empty()) {
      std::fprintf(stderr, "voxel: request %s\n", error.request_id().c_str());
    }
    return cli::exit_status_of(error);
  }
  if (std::fflush(stdout) != 0) {
    std::perror("voxel: stdout");
    return cli::kFailure;
  }
  return cli::kSuccess;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "voxel: %s\n", error.what());
    return voxeld::cli::kFailure;
  }
}
