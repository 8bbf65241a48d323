// The sandbox of a worker. A hostile file that takes the worker over finds only the inputs of the
// running task, its outputs, and the files that drivers read.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "proto/messages/task_api.h"
#include "proto/result.h"

namespace voxeld {

enum class SandboxMode {
  kAuto,     // as much as the kernel supports; a warning names what is missing
  kRequire,  // all of it, or the worker does not start
  kOff,
};
// Parses "auto", "require", "off"; other text is kAuto.
SandboxMode sandbox_mode(std::string_view text);
// "full", or the features that this kernel lacks, for people.
std::string sandbox_support();
// A command that lists the files and system calls that a driver was refused.
std::string refusals_command(const std::string& device);

// Closes in two steps, because opening a driver loads libraries and connects to servers. Drivers
// also start threads then, which Landlock can no longer restrict. Used by one thread.
class WorkerSandbox {
 public:
  explicit WorkerSandbox(SandboxMode mode) : mode_(mode) {}
  // Restricts files. Call it before any thread starts. Points the shader caches of drivers into the
  // worker's folder. Empty paths are left out. Errors, only in kRequire: device-unavailable with
  // what is missing.
  Status restrict_to(const WorkerFolders& folders, const std::filesystem::path& data_dir,
                     const std::filesystem::path& shader_dir);
  // Restricts system calls and limits of all threads. Call it after the device was opened. Errors:
  // as above.
  Status close();
  // An error of opening `device`, with the sandbox named as a suspect unless it is off.
  Error suspected(Error error, const std::string& device) const;
  // "full", "off", or what is missing.
  std::string level() const;

 private:
  Status lacks(const Error& error);

  const SandboxMode mode_;
  std::string missing_;
};

}  // namespace voxeld
