// Annotations for clang's -Wthread-safety, which checks GUARDED_BY and REQUIRES at compile time
// (the tsan and asan presets compile with clang). Other compilers see nothing.
#pragma once

#include <condition_variable>
#include <mutex>

#if defined(__clang__)
#define VOXELD_TSA(x) __attribute__((x))
#else
#define VOXELD_TSA(x)
#endif

#define CAPABILITY(x) VOXELD_TSA(capability(x))
#define SCOPED_CAPABILITY VOXELD_TSA(scoped_lockable)
#define GUARDED_BY(x) VOXELD_TSA(guarded_by(x))
#define REQUIRES(...) VOXELD_TSA(requires_capability(__VA_ARGS__))
#define EXCLUDES(...) VOXELD_TSA(locks_excluded(__VA_ARGS__))
#define ACQUIRE(...) VOXELD_TSA(acquire_capability(__VA_ARGS__))
#define RELEASE(...) VOXELD_TSA(release_capability(__VA_ARGS__))
#define TRY_ACQUIRE(...) VOXELD_TSA(try_acquire_capability(__VA_ARGS__))
#define NO_THREAD_SAFETY_ANALYSIS VOXELD_TSA(no_thread_safety_analysis)

namespace voxeld {

// A std::mutex with annotations for clang's analysis.
class CAPABILITY("mutex") Mutex {
 public:
  void lock() ACQUIRE() { mutex_.lock(); }
  void unlock() RELEASE() { mutex_.unlock(); }
  bool try_lock() TRY_ACQUIRE(true) { return mutex_.try_lock(); }

 private:
  std::mutex mutex_;
};

// Holds a Mutex for a scope. It is also a BasicLockable, so CondVar can release it while waiting.
class SCOPED_CAPABILITY MutexLock {
 public:
  explicit MutexLock(Mutex& mutex) ACQUIRE(mutex) : mutex_(mutex) { mutex_.lock(); }
  ~MutexLock() RELEASE() { mutex_.unlock(); }
  MutexLock(const MutexLock&) = delete;
  MutexLock& operator=(const MutexLock&) = delete;

  // Only for CondVar.
  void lock() NO_THREAD_SAFETY_ANALYSIS { mutex_.lock(); }
  void unlock() NO_THREAD_SAFETY_ANALYSIS { mutex_.unlock(); }

 private:
  Mutex& mutex_;
};

// A condition variable; use cv.wait(lock) in a while loop over the condition. The analysis does not
// follow predicates given as lambdas.
using CondVar = std::condition_variable_any;

}  // namespace voxeld
