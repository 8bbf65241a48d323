// Runs independent work, such as tiles, on all cores.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace voxeld {

// Calls work(i) once for each i < count, in any order, and returns when all calls are done. It uses
// as many threads as the machine has, including the calling one. An exception of `work` is rethrown
// here; calls that have not begun by then are skipped.
template <typename Work>
void for_each_parallel(size_t count, Work&& work) {
  std::atomic<size_t> next = 0;
  std::mutex mutex;
  std::exception_ptr failure;
  const auto run = [&] {
    for (size_t i = next++; i < count; i = next++) {
      try {
        work(i);
      } catch (...) {
        const std::lock_guard lock(mutex);
        failure = std::current_exception();
        next = count;
      }
    }
  };
  {
    const size_t cores = std::max<size_t>(std::thread::hardware_concurrency(), 1);
    std::vector<std::jthread> helpers;
    try {
      for (size_t i = 1; i < std::min(cores, count); ++i) helpers.emplace_back(run);
    } catch (const std::system_error&) {
      // No more threads are available; the existing ones do the work.
    }
    run();
  }
  if (failure) std::rethrow_exception(failure);
}

}  // namespace voxeld
