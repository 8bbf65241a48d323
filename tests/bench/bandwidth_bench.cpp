// The bandwidth of this machine's memory and cores, for floors: bandwidth_bench [--threads N]
// prints one JSON object. All threads stream over arrays far larger than caches (as McCalpin's
// STREAM, 1995); the best of the runs counts. Bytes are those that the loop names: a store that
// reads the line first moves more.
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <string>
#include <thread>
#include <vector>

namespace {

constexpr size_t kArrayBytes = size_t{128} << 20;  // each of three; caches are tens of MiB
constexpr int kRuns = 7;
constexpr int64_t kOperations = int64_t{1} << 30;  // per thread

// Seconds of the fastest run of work(thread) on all threads.
double best_seconds(int threads, const std::function<void(int)>& work) {
  double best = 1e30;
  for (int run = 0; run < kRuns; ++run) {
    const auto begin = std::chrono::steady_clock::now();
    std::vector<std::jthread> pool;
    for (int t = 0; t < threads; ++t) pool.emplace_back(work, t);
    pool.clear();  // joins
    const auto end = std::chrono::steady_clock::now();
    best = std::min(best, std::chrono::duration<double>(end - begin).count());
  }
  return best;
}

// 32-bit multiply-adds in chains that do not wait for each other, as many as fill vectors.
uint32_t integer_work() {
  constexpr int kChains = 128;
  uint32_t chain[kChains];
  for (int k = 0; k < kChains; ++k) chain[k] = static_cast<uint32_t>(k);
  for (int64_t i = 0; i < kOperations / (2 * kChains); ++i) {
    for (uint32_t& value : chain) value = value * 0x9e3779b9u + static_cast<uint32_t>(i);
  }
  uint32_t sum = 0;
  for (const uint32_t value : chain) sum += value;
  return sum;
}

}  // namespace

int main(int argc, char** argv) {
  const bool given = argc == 3 && std::strcmp(argv[1], "--threads") == 0;
  const int threads = given ? std::max(1, std::atoi(argv[2]))
                            : static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  const size_t count = kArrayBytes / sizeof(double);
  std::vector<double> a(count, 1.0), b(count, 2.0), c(count, 3.0);
  const auto share = [&](int t) { return count * static_cast<size_t>(t) / threads; };
  const double clear = best_seconds(threads, [&](int t) {
    std::memset(&a[share(t)], 0, (share(t + 1) - share(t)) * sizeof(double));
  });
  const double read = best_seconds(threads, [&](int t) {
    double sums[8] = {};
    for (size_t i = share(t); i + 8 <= share(t + 1); i += 8) {
      for (size_t k = 0; k < 8; ++k) sums[k] += b[i + k];
    }
    volatile double sink =
        sums[0] + sums[1] + sums[2] + sums[3] + sums[4] + sums[5] + sums[6] + sums[7];
    static_cast<void>(sink);
  });
  const double triad = best_seconds(threads, [&](int t) {
    for (size_t i = share(t); i < share(t + 1); ++i) a[i] = b[i] + 3.0 * c[i];
  });
  const double integers = best_seconds(threads, [](int) {
    volatile uint32_t sink = integer_work();
    static_cast<void>(sink);
  });
  const double bytes = static_cast<double>(kArrayBytes);
  std::printf(
      "{\"threads\": %d, \"clear_gb_s\": %.2f, \"read_gb_s\": %.2f, \"triad_gb_s\": %.2f, "
      "\"integer_gops\": %.2f}\n",
      threads, bytes / clear / 1e9, bytes / read / 1e9, 3 * bytes / triad / 1e9,
      static_cast<double>(kOperations) * threads / integers / 1e9);
  return 0;
}
