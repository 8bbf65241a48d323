// A budget for the memory of exchanges: response bytes that are generated and that their clients
// have not taken yet, and request bodies that are held as text.
//
// A client that does not read costs the part of its response that is in memory. Large responses are
// generated in pieces (PieceBody), and the next piece only when the budget has room for it. Until
// then the exchange waits, without a thread, for bytes of others to leave.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <list>
#include <map>
#include <string>
#include <vector>

#include "server/base/thread_annotations.h"

namespace voxeld::http {

// Bytes of one tenant, and of all tenants. Over either, the next piece or body waits.
inline constexpr int64_t kTenantMemoryBytesMax = int64_t{16} << 20;
inline constexpr int64_t kMemoryBytesMax = int64_t{64} << 20;

struct MemoryLimits {
  int64_t tenant_bytes_max = kTenantMemoryBytesMax;
  int64_t bytes_max = kMemoryBytesMax;
};

class MemoryBudget;

// The bytes of one response or request body; its destruction returns them to the budget. One thread
// at a time uses it, except that MemoryBudget::grant() may take bytes for one that waits.
class MemoryShare {
 public:
  // `owner` is handed back by grant().
  MemoryShare(MemoryBudget& budget, std::string tenant, void* owner);
  ~MemoryShare();
  MemoryShare(const MemoryShare&) = delete;
  MemoryShare& operator=(const MemoryShare&) = delete;

  // Holds `bytes` instead of what it holds. False: there is no room, or others of the tenant wait
  // already; it holds nothing and waits for grant(), after which the same call gives true.
  bool reserve(int64_t bytes);
  // Holds `bytes` instead of what it holds, whether there is room or not.
  void set(int64_t bytes);

 private:
  friend class MemoryBudget;
  MemoryBudget& budget_;
  const std::string tenant_;
  void* const owner_;
  // Guarded by the budget's mutex.
  int64_t bytes_ = 0, wanted_ = 0;
  bool is_waiting_ = false;
};

// Thread-safe.
class MemoryBudget {
 public:
  explicit MemoryBudget(const MemoryLimits& limits = {}) : limits_(limits) {}

  int64_t bytes() const EXCLUDES(mutex_);
  // Whether any share waits; without a lock.
  bool has_waiting() const { return waiting_count_ > 0; }
  // Gives bytes to those that wait and for which there is room now, each tenant's in the order in
  // which they came; the owners of these.
  std::vector<void*> grant() EXCLUDES(mutex_);

 private:
  friend class MemoryShare;
  struct Account {
    int64_t bytes = 0;
    std::deque<MemoryShare*> waiting;
  };
  // One that has nothing gets its piece, however large it is: else nothing would ever free bytes.
  bool has_room(const Account& account, int64_t bytes) const REQUIRES(mutex_);
  void take(Account& account, MemoryShare& share, int64_t bytes) REQUIRES(mutex_);

  const MemoryLimits limits_;
  mutable Mutex mutex_;
  std::map<std::string, Account> accounts_ GUARDED_BY(mutex_);  // of tenants with bytes or waiting
  int64_t bytes_ GUARDED_BY(mutex_) = 0;
  std::atomic<int64_t> waiting_count_{0};
};

}  // namespace voxeld::http
