#include "server/process/memory_reserve.h"

#include <sys/mman.h>

#include <atomic>
#include <new>

namespace voxeld {
namespace {

struct Reserve {
  std::atomic<void*> start{nullptr};
  std::atomic<size_t> bytes{0};
};

Reserve& reserve() {
  static Reserve one;
  return one;
}

bool let_go() {
  void* const held = reserve().start.exchange(nullptr);
  if (held == nullptr) return false;
  ::munmap(held, reserve().bytes);
  return true;
}

void on_no_memory() {
  if (!let_go()) throw std::bad_alloc();
}

}  // namespace

void hold_memory_reserve(size_t bytes) {
  let_go();
  reserve().bytes = bytes;
  memory_reserve_is_whole();
  std::set_new_handler(bytes > 0 ? on_no_memory : nullptr);
}

bool memory_reserve_is_whole() {
  const size_t bytes = reserve().bytes;
  if (bytes == 0 || reserve().start.load() != nullptr) return true;
  // mmap instead of malloc, because tests and sanitizers can make malloc fail. The pages are never
  // written.
  void* const taken =
      ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (taken == MAP_FAILED) return false;
  // Another thread may have been faster.
  void* none = nullptr;
  if (!reserve().start.compare_exchange_strong(none, taken)) ::munmap(taken, bytes);
  return true;
}

}  // namespace voxeld
