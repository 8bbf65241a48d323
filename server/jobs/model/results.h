// The result of a job, and the frames of a sequence.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "proto/limits.h"
#include "proto/messages/job.h"
#include "proto/messages/sequence.h"
#include "proto/result.h"

namespace voxeld {

// A stored file that the caller may read.
struct StoredBlob {
  std::string id;
  int64_t bytes = 0;
  std::filesystem::path path;
};

// A job, and the file of its result or why there is none: JobService::get_result().
struct JobAndResult {
  JobStatus status;
  Result<StoredBlob> file;
};

// A list of stored results.
enum class KeptKind { kResult, kGrid, kSequence };
struct KeptResult {
  int64_t seq = 0;   // order of arrival: what a list goes on behind
  std::string job;   // that made it
  std::string blob;  // of the result
  std::string grid, sequence;
  int64_t bytes = 0;  // of the result, the grid or the sequence's container, as the kind says
  std::string media_type, filename;
  int64_t created_ms = 0;
  int64_t frames = 0;  // of the sequence
};

struct ListedFrame {
  int64_t index = 0;  // among the request's frames
  SequenceFrame frame;
};

// A native container with tiles of a job's grid. The file of a running job may be removed at any
// time.
struct TileFile {
  std::filesystem::path path;
  int64_t first_tile = 0;  // tiles of the grid before those of the container
};

// The frames of a job with an index from `first` on, at most `count` of them.
struct FrameRange {
  int64_t first = 0;
  int64_t count = limits::kFramesMax;
};

// The frames that a job has made so far.
struct JobFrames {
  std::string job;
  std::string sequence;             // once it is done, when it made one
  int64_t frames_done = 0;          // of all, not of the range
  int64_t frames_total = 0;         // 0: not known, or no sequence
  std::vector<ListedFrame> frames;  // of the range, by ascending index
};

}  // namespace voxeld
