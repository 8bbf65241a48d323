// The command line of voxel: subcommands and flags. Flags for the daemon come from its table of
// options (proto/options/table.h).
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "client/cli/exit_status.h"
#include "client/include/voxeld/client.h"

namespace voxeld::cli {

// A mesh of --out-dir, and the file that is made of it.
struct BatchFile {
  std::string input, output;
};

struct Arguments {
  enum class Command {
    kVoxelize,
    kRender,
    kJobs,
    kTop,
    kShare,
    kList,
    kRemove,
    kWhoami,
    kInfo,
    kFormats,
    kGenerate
  } command = Command::kVoxelize;
  std::string url;               // --url; empty: see server.h
  std::string key;               // --key; empty: see api_key.h
  std::optional<bool> is_local;  // --local, --no-local: see server.h
  bool json = false;             // report on stdout as JSON
  bool quiet = false;            // no progress and no warnings on stderr
  int timeout_s = 0;             // of one exchange with the daemon; 0: no limit

  std::string input;                // path, or "-" for stdin
  std::shared_ptr<const int> pipe;  // the opened `input`, if it is a pipe: see await_stream()
  std::vector<std::string> beside;  // paths of files that are sent with it
  std::string output;               // path, or "-" for stdout; empty: stdout unless it is a
                                    // terminal
  std::string out_dir;              // a file for each input goes here, instead of output
  std::vector<BatchFile> batch;     // with out_dir; `input` and `beside` are empty
  bool dry_run = false;             // print estimates, make nothing
  std::string grid;                 // render: the id of a stored grid instead of a mesh
  std::string sequence;             // render: the id of a stored sequence instead
  client::Options options;
  std::optional<int> priority;       // of the job
  std::optional<double> deadline_s;  // of the job, from its acceptance on

  std::string job;               // jobs: a single one; share
  std::vector<std::string> ids;  // rm: ids to delete
  std::string list = "results";  // ls: the list to show
  int seconds = 3600;            // share: lifetime of the link
  bool cancel = false;           // jobs: cancel it
  int limit = 20;                // jobs, ls: how many
  bool once = false;             // top: one snapshot, without a terminal
  std::string document;          // generate: man, bash or zsh
};

// Parses the arguments, or returns the status to exit with. Help, version and errors are printed
// here.
std::variant<Arguments, ExitStatus> parse_arguments(int argc, char** argv);

}  // namespace voxeld::cli
