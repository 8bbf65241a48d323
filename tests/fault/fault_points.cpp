// Makes the N-th call of one class fail: for tests alone, loaded by LD_PRELOAD. SQLite's own calls
// of write, fsync and so on come through here too, so that its handling of them is tested as it is.
#include "tests/fault/fault_points.h"

#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

#include <atomic>
#include <cstddef>

struct sqlite3;
struct sqlite3_stmt;

extern "C" {
void* __libc_malloc(size_t bytes);
void* __libc_calloc(size_t count, size_t bytes);
void* __libc_realloc(void* old, size_t bytes);
void* __libc_memalign(size_t alignment, size_t bytes);
}

namespace {

enum class FaultClass {
  kNone,
  kAlloc,
  kAllocTwice,
  kRead,
  kWrite,
  kShortWrite,
  kSync,
  kRename,
  kLink,
  kCreate,
  kSqlite
};

std::atomic<FaultClass> armed{FaultClass::kNone};
std::atomic<long> target{0};
std::atomic<long> counted{0};
std::atomic<int> fault_code{0};
std::atomic<bool> fired{false};
// Initial-exec, so that it needs no allocation of its own.
__attribute__((tls_model("initial-exec"))) thread_local int paused = 0;
// The result of sqlite3_extended_errcode() after a statement that was made to fail.
__attribute__((tls_model("initial-exec"))) thread_local int sqlite_code = 0;

bool fails(FaultClass which) {
  if (armed.load(std::memory_order_relaxed) != which || paused != 0) return false;
  if (++counted != target) return false;
  fired = true;
  return true;
}

// Calls of malloc and its like: one fails, or the same once more when it is tried again.
bool allocation_fails() {
  __attribute__((tls_model("initial-exec"))) static thread_local bool again = false;
  if (again) {
    again = false;
    errno = ENOMEM;
    return true;
  }
  const bool twice = armed.load(std::memory_order_relaxed) == FaultClass::kAllocTwice;
  if (!fails(twice ? FaultClass::kAllocTwice : FaultClass::kAlloc)) return false;
  again = twice;
  errno = ENOMEM;
  return true;
}

bool fails_with_errno(FaultClass which) {
  if (!fails(which)) return false;
  errno = fault_code;
  return true;
}

// The next definition of a function. A wrong cast of void* is what dlsym asks for.
template <typename Function>
Function next(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

FaultClass class_of(const char* name) {
  const struct {
    const char* name;
    FaultClass value;
  } kNames[] = {{"alloc", FaultClass::kAlloc},
                {"alloc-twice", FaultClass::kAllocTwice},
                {"read", FaultClass::kRead},
                {"write", FaultClass::kWrite},
                {"short-write", FaultClass::kShortWrite},
                {"sync", FaultClass::kSync},
                {"rename", FaultClass::kRename},
                {"link", FaultClass::kLink},
                {"create", FaultClass::kCreate},
                {"sqlite", FaultClass::kSqlite}};
  for (const auto& one : kNames) {
    if (strcmp(one.name, name) == 0) return one.value;
  }
  return FaultClass::kNone;
}

// Only calls from outside fail: SQLite also calls these itself, and knows what they can return.
__attribute__((tls_model("initial-exec"))) thread_local int sqlite_depth = 0;
struct SqliteCall {
  SqliteCall() { ++sqlite_depth; }
  ~SqliteCall() { --sqlite_depth; }
  static bool fails(int& result) {
    if (sqlite_depth > 1) return false;
    sqlite_code = 0;
    if (!::fails(FaultClass::kSqlite)) return false;
    result = sqlite_code = fault_code;
    return true;
  }
};

}  // namespace

extern "C" {

void voxeld_fault_arm(const char* fault_class, long number, int code) {
  counted = 0;
  fired = false;
  target = number;
  fault_code = code;
  armed = class_of(fault_class);
}
void voxeld_fault_disarm() {
  armed = FaultClass::kNone;
}
void voxeld_fault_pause() {
  ++paused;
}
void voxeld_fault_resume() {
  --paused;
}
int voxeld_fault_fired() {
  return fired ? 1 : 0;
}
long voxeld_fault_count() {
  return counted;
}

// --- memory; operator new of libstdc++ calls malloc, then its handler, then malloc again

void* malloc(size_t bytes) {
  if (allocation_fails()) return nullptr;
  return __libc_malloc(bytes);
}
void* calloc(size_t count, size_t bytes) {
  if (allocation_fails()) return nullptr;
  return __libc_calloc(count, bytes);
}
void* realloc(void* old, size_t bytes) {
  if (allocation_fails()) return nullptr;
  return __libc_realloc(old, bytes);
}
void* aligned_alloc(size_t alignment, size_t bytes) {
  if (allocation_fails()) return nullptr;
  return __libc_memalign(alignment, bytes);
}

// --- files

static bool is_file(int fd) {
  struct stat info {};
  return fstat(fd, &info) == 0 && S_ISREG(info.st_mode);
}

// Files alone: of sockets and pipes others than the disk would have to fail.
ssize_t read(int fd, void* data, size_t bytes) {
  static const auto real = next<ssize_t (*)(int, void*, size_t)>("read");
  if (armed == FaultClass::kRead && is_file(fd) && fails_with_errno(FaultClass::kRead)) return -1;
  return real(fd, data, bytes);
}
static ssize_t pread_at(const char* name, int fd, void* data, size_t bytes, off_t at) {
  using Function = ssize_t (*)(int, void*, size_t, off_t);
  static const Function real = next<Function>(name);
  return fails_with_errno(FaultClass::kRead) ? -1 : real(fd, data, bytes, at);
}
ssize_t pread(int fd, void* data, size_t bytes, off_t at) {
  return pread_at("pread", fd, data, bytes, at);
}
ssize_t pread64(int fd, void* data, size_t bytes, off64_t at) {
  return pread_at("pread64", fd, data, bytes, at);
}

ssize_t write(int fd, const void* data, size_t bytes) {
  static const auto real = next<ssize_t (*)(int, const void*, size_t)>("write");
  if (armed == FaultClass::kNone || !is_file(fd)) return real(fd, data, bytes);
  if (fails_with_errno(FaultClass::kWrite)) return -1;
  if (bytes > 1 && fails(FaultClass::kShortWrite)) return real(fd, data, bytes / 2);
  return real(fd, data, bytes);
}
static ssize_t pwrite_at(const char* name, int fd, const void* data, size_t bytes, off_t at) {
  using Function = ssize_t (*)(int, const void*, size_t, off_t);
  static const Function real = next<Function>(name);
  if (armed == FaultClass::kNone) return real(fd, data, bytes, at);
  if (fails_with_errno(FaultClass::kWrite)) return -1;
  if (bytes > 1 && fails(FaultClass::kShortWrite)) return real(fd, data, bytes / 2, at);
  return real(fd, data, bytes, at);
}
ssize_t pwrite(int fd, const void* data, size_t bytes, off_t at) {
  return pwrite_at("pwrite", fd, data, bytes, at);
}
ssize_t pwrite64(int fd, const void* data, size_t bytes, off64_t at) {
  return pwrite_at("pwrite64", fd, data, bytes, at);
}
int ftruncate64(int fd, off64_t bytes) {
  static const auto real = next<int (*)(int, off64_t)>("ftruncate64");
  return fails_with_errno(FaultClass::kWrite) ? -1 : real(fd, bytes);
}

int fsync(int fd) {
  static const auto real = next<int (*)(int)>("fsync");
  return fails_with_errno(FaultClass::kSync) ? -1 : real(fd);
}
int fdatasync(int fd) {
  static const auto real = next<int (*)(int)>("fdatasync");
  return fails_with_errno(FaultClass::kSync) ? -1 : real(fd);
}

int rename(const char* from, const char* to) {
  static const auto real = next<int (*)(const char*, const char*)>("rename");
  return fails_with_errno(FaultClass::kRename) ? -1 : real(from, to);
}
int link(const char* from, const char* to) {
  static const auto real = next<int (*)(const char*, const char*)>("link");
  return fails_with_errno(FaultClass::kLink) ? -1 : real(from, to);
}
int linkat(int from_dir, const char* from, int to_dir, const char* to, int flags) {
  static const auto real = next<int (*)(int, const char*, int, const char*, int)>("linkat");
  return fails_with_errno(FaultClass::kLink) ? -1 : real(from_dir, from, to_dir, to, flags);
}
int unlink(const char* path) {
  static const auto real = next<int (*)(const char*)>("unlink");
  // Removing a name needs no space.
  if (fault_code != ENOSPC && fails_with_errno(FaultClass::kRename)) return -1;
  return real(path);
}
int mkdir(const char* path, mode_t mode) {
  static const auto real = next<int (*)(const char*, mode_t)>("mkdir");
  return fails_with_errno(FaultClass::kCreate) ? -1 : real(path, mode);
}
int mkostemp(char* name, int flags) {
  static const auto real = next<int (*)(char*, int)>("mkostemp");
  return fails_with_errno(FaultClass::kCreate) ? -1 : real(name, flags);
}
static int open_with(const char* name, const char* path, int flags, mode_t mode) {
  using Function = int (*)(const char*, int, ...);
  static const Function real = next<Function>(name);
  if ((flags & O_CREAT) != 0 && fails_with_errno(FaultClass::kCreate)) return -1;
  return real(path, flags, mode);
}
int open(const char* path, int flags, ...) {
  va_list rest;
  va_start(rest, flags);
  const mode_t mode = (flags & O_CREAT) != 0 ? va_arg(rest, mode_t) : 0;
  va_end(rest);
  return open_with("open", path, flags, mode);
}
int open64(const char* path, int flags, ...) {
  va_list rest;
  va_start(rest, flags);
  const mode_t mode = (flags & O_CREAT) != 0 ? va_arg(rest, mode_t) : 0;
  va_end(rest);
  return open_with("open64", path, flags, mode);
}

// --- SQLite: a statement that does not run, and says why

int sqlite3_step(sqlite3_stmt* statement) {
  static const auto real = next<int (*)(sqlite3_stmt*)>("sqlite3_step");
  const SqliteCall call;
  int result = 0;
  return call.fails(result) ? result : real(statement);
}
int sqlite3_prepare_v3(sqlite3* db, const char* sql, int bytes, unsigned int flags,
                       sqlite3_stmt** statement, const char** tail) {
  static const auto real =
      next<int (*)(sqlite3*, const char*, int, unsigned int, sqlite3_stmt**, const char**)>(
          "sqlite3_prepare_v3");
  const SqliteCall call;
  int result = 0;
  return call.fails(result) ? result : real(db, sql, bytes, flags, statement, tail);
}
int sqlite3_exec(sqlite3* db, const char* sql, int (*callback)(void*, int, char**, char**),
                 void* context, char** error) {
  static const auto real =
      next<int (*)(sqlite3*, const char*, int (*)(void*, int, char**, char**), void*, char**)>(
          "sqlite3_exec");
  const SqliteCall call;
  int result = 0;
  return call.fails(result) ? result : real(db, sql, callback, context, error);
}
int sqlite3_extended_errcode(sqlite3* db) {
  static const auto real = next<int (*)(sqlite3*)>("sqlite3_extended_errcode");
  return sqlite_code != 0 ? sqlite_code : real(db);
}

}  // extern "C"
