// What a worker gives up, so that a hostile file that takes it over finds nothing but the inputs of
// the task that it runs, its own outputs, and the files that drivers read.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "proto/result.h"
#include "proto/task_api.h"

namespace voxeld {

enum class SandboxMode {
  kAuto,     // as much as the kernel can take; a warning names what is missing
  kRequire,  // all of it, or the worker does not start
  kOff,
};
// "auto", "require", "off"; other text is kAuto.
SandboxMode sandbox_mode(std::string_view text);
// "full", or what this kernel does not have, for people.
std::string sandbox_support();

// Two steps, as drivers load libraries and connect to servers when they are opened, and have
// threads from then on, which Landlock does not bind any more. One thread.
class WorkerSandbox {
 public:
  explicit WorkerSandbox(SandboxMode mode) : mode_(mode) {}
  // Files. Before any thread starts. Points the shader caches of drivers into the worker's folder.
  // Errors, in kRequire alone: device-unavailable with what is missing.
  Status restrict_to(const WorkerFolders& folders, const std::filesystem::path& data_dir,
                     const std::filesystem::path& shader_dir);
  // System calls and limits, of all threads. After the device was opened. Errors: as above.
  Status close();
  // "full", "off", or what is missing.
  std::string level() const;

 private:
  Status lacks(const Error& error);

  const SandboxMode mode_;
  std::string missing_;
};

}  // namespace voxeld
