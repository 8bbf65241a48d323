// Loops over triangles, vertices or voxels that are split among a few threads.
#pragma once

#include <algorithm>
#include <cstddef>
#include <thread>
#include <vector>

namespace voxeld {

// The most threads of one loop. More gain nothing, because memory bandwidth bounds the loops.
inline constexpr size_t kVoxelThreadsMax = 8;

// Number of chunks that parallel_chunks() makes of `count` elements: one per thread, but none
// smaller than `grain`; at least 1.
inline size_t chunk_count(size_t count, size_t grain) {
  // Read once, because hardware_concurrency() can cost more than a small loop.
  static const size_t threads =
      std::clamp<size_t>(std::thread::hardware_concurrency(), 1, kVoxelThreadsMax);
  return std::clamp<size_t>(count / std::max<size_t>(grain, 1), 1, threads);
}

// Calls body(chunk, begin, end) for consecutive parts of [0, count) and waits for all. Each part
// has its own thread; the last runs on the caller's. Chunk numbers ascend with begin.
template <typename Body>
void parallel_chunks(size_t count, size_t grain, const Body& body) {
  const size_t chunks = chunk_count(count, grain);
  const auto bound = [&](size_t chunk) {
    return count / chunks * chunk + std::min(chunk, count % chunks);
  };
  std::vector<std::jthread> threads;
  threads.reserve(chunks);
  for (size_t chunk = 0; chunk + 1 < chunks; ++chunk) {
    threads.emplace_back([&body, &bound, chunk] { body(chunk, bound(chunk), bound(chunk + 1)); });
  }
  body(chunks - 1, bound(chunks - 1), count);
}

}  // namespace voxeld
