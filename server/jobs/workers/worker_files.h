// The folder of one worker: all of the data directory that it reaches
// (server/worker/worker_sandbox).
//
//   DIR/run/scratch/wN/in      what its task reads: links to blobs, read-only for it
//                      out     what it writes
//                      cache   its driver's compiled shaders
//                      taken   outputs on their way into the store, out of its reach
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "proto/messages/task_api.h"
#include "proto/result.h"

namespace voxeld {

// One thread at a time.
class WorkerFiles {
 public:
  explicit WorkerFiles(std::filesystem::path root) : root_(std::move(root)) {}

  // Makes the folders. Again: nothing.
  Status create() const;
  WorkerFolders folders() const;
  // The folders of what the worker wrote, with what was taken of it.
  std::vector<std::filesystem::path> written() const;
  // Lets the worker read a blob, and tells under which path. Errors: not-found.
  Result<std::string> hand_over(const std::filesystem::path& blob) const;
  // Takes an output from the worker, which cannot change it any more, and tells where it is now.
  // Errors: internal for what is not a closed plain file of its own in the folder of outputs.
  Result<std::filesystem::path> take(const std::string& output) const;
  // At the end of a task: its inputs and what it left go.
  void clear() const;
  // At the end of the worker. The daemon's next start removes what stays.
  void remove() const noexcept;

 private:
  const std::filesystem::path root_;
};

}  // namespace voxeld
