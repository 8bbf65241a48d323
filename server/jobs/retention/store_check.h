// `voxeld doctor --store`: whether what the database names is in the store, byte for byte.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "proto/result.h"

namespace voxeld {

struct StoreProblem {
  std::string kind;  // database, keys, damaged, missing, counts
  std::string what;  // a blob's id, or a file
  std::string text;
};

struct StoreReport {
  std::filesystem::path data_dir;
  bool daemon_runs = false;
  int64_t schema_version = 0;  // 0: the database could not be read
  int64_t jobs = 0, assets = 0, results = 0;
  int64_t blobs = 0, bytes = 0;
  double hash_seconds = 0;
  // No problems: the daemon removes them itself.
  std::vector<std::string> orphans;    // blobs that no row needs
  std::vector<std::string> leftovers;  // files of uploads and tasks that were cut off
  std::vector<StoreProblem> problems;
};

// Reads all of it and writes nothing, also while a daemon runs on it. Errors: not-found when there
// is no store; internal when it cannot be read.
Result<StoreReport> check_store(const std::filesystem::path& data_dir);

}  // namespace voxeld
