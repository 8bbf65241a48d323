#include "server/http/housekeeping.h"

#include <poll.h>

#include <array>
#include <cerrno>
#include <utility>

namespace voxeld::http {
namespace {

// New connections are taken so many at a time; late clients are looked for in between.
constexpr int kAcceptsMax = 256;
constexpr auto kNoDescriptorPause = std::chrono::milliseconds(20);

}  // namespace

Housekeeping::Housekeeping(UniqueFd listener, Calls calls)
    : listener_(std::move(listener)), calls_(std::move(calls)), thread_([this] { loop(); }) {}

void Housekeeping::end() {
  if (!thread_.joinable()) return;
  end_.signal();
  thread_.join();
  listener_.reset();
}

void Housekeeping::loop() {
  std::array<pollfd, 3> entries{
      {{listener_.get(), POLLIN, 0}, {timer_set_.fd(), POLLIN, 0}, {end_.fd(), POLLIN, 0}}};
  auto tick_at = std::chrono::steady_clock::now();
  while (entries[2].revents == 0) {
    const auto wait = calls_.run_timers();
    const int count = ::poll(entries.data(), entries.size(), static_cast<int>(wait.count()));
    if (count > 0 && entries[0].revents != 0) accept_some();
    if (count > 0 && entries[1].revents != 0) timer_set_.take();
    const auto now = std::chrono::steady_clock::now();
    if (now < tick_at) continue;
    tick_at = now + kHousekeepingStep;
    calls_.tick();
  }
}

void Housekeeping::accept_some() {
  for (int i = 0; i < kAcceptsMax; ++i) {
    Accepted accepted = accept_one(listener_.get());
    if (!accepted.fd.valid()) {
      if (errno != EMFILE && errno != ENFILE) return;
      // Out of descriptors: without an idle connection to close, the rest stays in the backlog.
      if (!calls_.make_room()) std::this_thread::sleep_for(kNoDescriptorPause);
      return;
    }
    if (calls_.has_place()) calls_.admit(std::move(accepted));
  }
}

}  // namespace voxeld::http
