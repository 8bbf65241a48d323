// Splits loops over triangles, vertices or voxels among a few threads.
#pragma once

#include <algorithm>
#include <cstddef>
#include <thread>
#include <vector>

namespace voxeld {

// More threads than this give nothing: the loops are bound by memory.
inline constexpr size_t kVoxelThreadsMax = 8;

// How many chunks parallel_chunks() makes of `count` elements: as many as there are threads, but
// none smaller than `grain`; at least 1.
inline size_t chunk_count(size_t count, size_t grain) {
  // Asked once: the question can cost more than a small loop.
  static const size_t threads =
      std::clamp<size_t>(std::thread::hardware_concurrency(), 1, kVoxelThreadsMax);
  return std::clamp<size_t>(count / std::max<size_t>(grain, 1), 1, threads);
}

// Calls body(chunk, begin, end) for consecutive parts of [0, count), each on a thread of its own
// (the last on the caller's), and waits. Chunk numbers ascend with begin.
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
