// A budget for the bytes of answers that are made and that their clients have not yet taken.
//
// A client that does not read costs what of its answer is in memory. Answers that may be large are
// made in pieces (PieceBody), and the next piece is made when the budget has room for it: until
// then the answer waits, without a thread, for others' bytes to leave.
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

// Bytes of one tenant, and of all; over it, the next piece waits.
inline constexpr int64_t kTenantAnswerBytesMax = int64_t{16} << 20;
inline constexpr int64_t kAnswerBytesMax = int64_t{64} << 20;

struct AnswerLimits {
  int64_t tenant_bytes_max = kTenantAnswerBytesMax;
  int64_t bytes_max = kAnswerBytesMax;
};

class AnswerBudget;

// The bytes of one answer; they go back to the budget when it goes away. Used by one thread at a
// time, but that AnswerBudget::grant() may take bytes for one that waits.
class AnswerShare {
 public:
  // `owner` is handed back by grant().
  AnswerShare(AnswerBudget& budget, std::string tenant, void* owner);
  ~AnswerShare();
  AnswerShare(const AnswerShare&) = delete;
  AnswerShare& operator=(const AnswerShare&) = delete;

  // Holds `bytes` instead of what it holds. False: there is no room, or others of the tenant wait
  // already; it holds nothing and waits for grant(), after which the same call gives true.
  bool reserve(int64_t bytes);
  // Holds `bytes` instead of what it holds, whether there is room or not.
  void set(int64_t bytes);

 private:
  friend class AnswerBudget;
  AnswerBudget& budget_;
  const std::string tenant_;
  void* const owner_;
  // Guarded by the budget's mutex.
  int64_t bytes_ = 0, wanted_ = 0;
  bool is_waiting_ = false;
};

// Thread-safe.
class AnswerBudget {
 public:
  explicit AnswerBudget(const AnswerLimits& limits = {}) : limits_(limits) {}

  int64_t bytes() const EXCLUDES(mutex_);
  // Whether any share waits; without a lock.
  bool has_waiting() const { return waiting_count_ > 0; }
  // Gives bytes to those that wait and for which there is room now, each tenant's in the order in
  // which they came; the owners of these.
  std::vector<void*> grant() EXCLUDES(mutex_);

 private:
  friend class AnswerShare;
  struct Account {
    int64_t bytes = 0;
    std::deque<AnswerShare*> waiting;
  };
  // One that has nothing gets its piece, however large it is: else nothing would ever free bytes.
  bool has_room(const Account& account, int64_t bytes) const REQUIRES(mutex_);
  void take(Account& account, AnswerShare& share, int64_t bytes) REQUIRES(mutex_);

  const AnswerLimits limits_;
  mutable Mutex mutex_;
  std::map<std::string, Account> accounts_ GUARDED_BY(mutex_);  // of tenants with bytes or waiting
  int64_t bytes_ GUARDED_BY(mutex_) = 0;
  std::atomic<int64_t> waiting_count_{0};
};

}  // namespace voxeld::http
