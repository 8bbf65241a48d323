// Loops over triangles, vertices or voxels that are split among a few threads.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "proto/thread_pool.h"
#include "server/base/cancel_point.h"

namespace voxeld {

// The most threads of one loop. More gain nothing, because memory bandwidth bounds the loops.
inline constexpr size_t kVoxelThreadsMax = 8;

// Threads of one loop on this machine, with the one that runs it.
inline int voxel_threads() {
  return static_cast<int>(std::min(ThreadPool::shared().threads(), kVoxelThreadsMax));
}

// Calls work(i) for each i < count on at most `threads_max` threads of the process's pool, within
// the caller's CancelScope: a cancellation point on any of them ends the loop, which then throws
// Cancelled.
template <typename Work>
void parallel_for(size_t count, const Work& work, size_t threads_max = SIZE_MAX) {
  const CancelScope* const scope = internal::cancel_scope;
  ThreadPool::shared().for_each(
      count,
      [&](size_t i) {
        const BorrowedCancelScope borrowed(scope);
        work(i);
      },
      threads_max);
}

// Number of chunks that parallel_chunks() makes of `count` elements: one per thread, but none
// smaller than `grain`; at least 1.
inline size_t chunk_count(size_t count, size_t grain) {
  return std::clamp<size_t>(count / std::max<size_t>(grain, 1), 1,
                            static_cast<size_t>(voxel_threads()));
}

// Calls body(chunk, begin, end) for consecutive parts of [0, count) and waits for all. The threads
// of the process's pool share the chunks with the caller. Chunk numbers ascend with begin.
template <typename Body>
void parallel_chunks(size_t count, size_t grain, const Body& body) {
  const size_t chunks = chunk_count(count, grain);
  const auto bound = [&](size_t chunk) {
    return count / chunks * chunk + std::min(chunk, count % chunks);
  };
  parallel_for(chunks, [&](size_t chunk) { body(chunk, bound(chunk), bound(chunk + 1)); });
}

// A number of threads of the process's pool, for work whose parts have state of their own.
class ThreadTeam {
 public:
  // threads: at least 1. It may be more than the pool has.
  explicit ThreadTeam(int threads) : threads_(std::max(threads, 1)) {}

  int threads() const { return threads_; }

  // Calls body(part) for each part from 0 to count - 1 <= threads() - 1 and waits for all. Two
  // parts may run on the same thread, one after the other, so that no part may wait for another.
  template <typename Body>
  void run(int count, const Body& body) const {
    parallel_for(static_cast<size_t>(std::max(count, 0)),
                 [&](size_t part) { body(static_cast<int>(part)); });
  }

 private:
  int threads_;
};

}  // namespace voxeld
