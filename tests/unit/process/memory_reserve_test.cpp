#include "server/process/memory_reserve.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <functional>
#include <new>
#include <vector>

namespace voxeld {
namespace {

// The malloc of sanitizers heeds no RLIMIT_AS, and ends the process where there is nothing.
#ifndef VOXELD_SANITIZED

constexpr size_t kBlockBytes = size_t{1} << 20;

// The handler and the limit are a process's own: each story has one, and returns its exit status.
int status_of(const std::function<int()>& story) {
  const pid_t child = ::fork();
  if (child == 0) ::_exit(story());
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + WTERMSIG(status);
}

// Takes all that malloc gives. From there on operator new has nothing but the reserve.
std::vector<void*> take_all() {
  rlimit limit{};
  limit.rlim_cur = limit.rlim_max = size_t{512} << 20;
  ::setrlimit(RLIMIT_AS, &limit);
  std::vector<void*> taken;
  taken.reserve(4096);
  for (size_t bytes = kBlockBytes; bytes >= 64; bytes /= 2) {
    while (taken.size() < taken.capacity()) {
      void* const block = std::malloc(bytes);
      if (block == nullptr) break;
      taken.push_back(block);
    }
  }
  return taken;
}

bool can_allocate(size_t bytes) {
  try {
    void* const block = ::operator new(bytes);
    ::operator delete(block);
    return true;
  } catch (const std::bad_alloc&) {
    return false;
  }
}

TEST(MemoryReserve, WithoutItAllocationsFail) {
  EXPECT_EQ(status_of([] {
              const auto taken = take_all();
              return can_allocate(kBlockBytes) ? 1 : 0;
            }),
            0);
}

TEST(MemoryReserve, IsUsedOnceAndTakenBack) {
  EXPECT_EQ(status_of([] {
              hold_memory_reserve();
              std::vector<void*> taken = take_all();
              if (!memory_reserve_is_whole()) return 1;
              void* const block =
                  ::operator new(3 * kBlockBytes);  // what the reserve makes room for
              if (memory_reserve_is_whole()) return 2;
              if (can_allocate(3 * kBlockBytes)) return 3;  // it is gone, and that is told
              ::operator delete(block);
              for (void* one : taken) std::free(one);
              if (!memory_reserve_is_whole()) return 4;
              return can_allocate(3 * kBlockBytes) ? 0 : 5;
            }),
            0);
}

TEST(MemoryReserve, WhatCanNeverBeIsToldAtOnce) {
  EXPECT_EQ(status_of([] {
              hold_memory_reserve();
              bool threw = false;
              try {
                const std::vector<char> all(size_t{1} << 62);
              } catch (const std::bad_alloc&) {
                threw = true;
              }
              return threw && memory_reserve_is_whole() ? 0 : 1;
            }),
            0);
}

#endif

TEST(MemoryReserve, IsWholeWhereNoneIsHeld) {
  EXPECT_TRUE(memory_reserve_is_whole());
}

}  // namespace
}  // namespace voxeld
