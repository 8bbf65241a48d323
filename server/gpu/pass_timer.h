// Measurement of the time that each pass takes.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "server/base/clock.h"
#include "server/gpu/context.h"

namespace voxeld::gpu {

// GPU time of named passes by timer queries. If queries always return 0 (workaround
// timer_query_zero), it measures wall time around glFinish. Passes must not nest.
class PassTimer {
 public:
  explicit PassTimer(const Context& context);
  ~PassTimer();
  PassTimer(const PassTimer&) = delete;
  PassTimer& operator=(const PassTimer&) = delete;

  // The pass ends with this object, also on an early return: a query that stays active would fail
  // every later one of the context.
  class Pass {
   public:
    Pass(const Pass&) = delete;
    Pass& operator=(const Pass&) = delete;
    ~Pass() { timer_->end(); }

   private:
    friend class PassTimer;
    explicit Pass(PassTimer& timer) : timer_(&timer) {}
    PassTimer* timer_;
  };
  [[nodiscard]] Pass measure(std::string_view pass);
  // Milliseconds per pass so far, in order of first use. Waits for the device.
  std::vector<std::pair<std::string, double>> results();

 private:
  void end();

  struct Pending {
    std::string pass;
    uint32_t query;
  };
  const Context* context_;
  Stopwatch wall_;
  std::string running_;           // name of the pass that runs
  std::vector<Pending> pending_;  // ended, but result not read yet; timer queries only
  StageTimes times_;
};

}  // namespace voxeld::gpu
