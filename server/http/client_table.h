// The client connections of a server: what each of them waits for, and which has waited too long.
#pragma once

#include <array>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "server/base/waker.h"
#include "server/http/exchange.h"
#include "server/http/send_limits.h"
#include "server/http/sockets/connection.h"

namespace voxeld::http {

struct Client {
  // idle ─> head ─> running ─> idle | queued | lingering | gone
  //                   │ ^
  //                   v │
  //     body | waiting | held | sending
  enum class State {
    kIdle,       // for the first byte of a request
    kHead,       // for the rest of its head
    kQueued,     // for a thread: it pipelines, and its next request is in the buffer
    kRunning,    // a thread has it
    kBody,       // for more of a request's body
    kWaiting,    // for its waker or its timer
    kHeld,       // for room in the memory budget
    kSending,    // for its client to take more of a response
    kLingering,  // for its client to close, after a response that ends the connection
  };
  static constexpr size_t kStates = 9;

  explicit Client(UniqueFd fd, std::string address)
      : connection(std::move(fd), std::move(address)) {}

  // Whether its response, once it has taken more than the grace, goes out at less than the rate on
  // the average, so that no client keeps its place for ever by reading now and then.
  bool takes_less_than(int64_t bytes_per_second, double grace_seconds,
                       Clock::time_point now = Clock::now()) const;

  // The same by the limits, of which a download that keeps room on the disk has shorter ones.
  bool is_too_slow(const SendLimits& limits, bool is_disk_short) const;

  // Ends the exchange: its waker comes to nothing, its memory goes back to the budget.
  void end_exchange();

  Connection connection;
  bool is_counted = false;  // against its address
  bool is_taken = false;    // by a thread or the ready queue: nobody else may touch it
  bool is_woken = false;    // while a thread had it: instead of waiting, it looks again
  bool is_granted = false;  // memory, while a thread had it
  State state = State::kIdle;
  Clock::time_point since = Clock::now();  // of the state
  std::list<Client*>::iterator place;      // among those of its state
  // Set while it waits with a time limit.
  std::optional<std::multimap<Clock::time_point, Client*>::iterator> timer;

  // --- of the request; used by the thread that has taken the client
  size_t head_scanned = 0;    // bytes of the buffer without an empty line
  Clock::time_point started;  // its head was complete
  std::string what;           // method and path; guarded as the state is
  std::shared_ptr<CallbackWaker> waker;
  std::unique_ptr<Exchange> exchange;  // from the complete head to the end of the response
  Clock::duration paused{};            // of the response, without anything to send
  int64_t lingered_bytes = 0;

 private:
  friend class ClientTable;
  bool is_in_flight_ = false;
};

// The name under which connections of an address are counted: an IPv4 address itself, or the first
// 64 bits of an IPv6 one, since a customer is given 2^64 of them at least.
std::string counted_as(std::string_view address);

// Not thread-safe. Everything is O(1), except late(), which is O(taken clients), and timers, which
// are O(log n).
class ClientTable {
 public:
  // Adds an idle client. `is_counted`: against count_of() its address.
  Client& add(UniqueFd fd, std::string address, bool is_counted);
  Client* find(int fd);
  // The socket closes when the caller destroys the result.
  std::unique_ptr<Client> remove(Client& client);
  std::vector<std::unique_ptr<Client>> remove_all();
  // Sets `since` to now, puts it at the end of its state's list and drops its timer.
  void set_state(Client& client, Client::State state);

  size_t size() const { return by_fd_.size(); }
  size_t count(Client::State state) const { return lists_[index(state)].size(); }
  // Clients with a request that has begun, was not refused, and whose response is not complete.
  size_t in_flight() const { return in_flight_; }
  int count_of(std::string_view address) const;
  // The client not taken that has been in the state for longest, if for more than `seconds`; else
  // null.
  Client* late(Client::State state, double seconds, Clock::time_point now) const;
  // The same among those that keep room on the disk from others (Exchange::keeps_room()).
  Client* late_download(double seconds, bool is_disk_short, Clock::time_point now) const;
  // Clients in that state, the longest first.
  const std::list<Client*>& clients(Client::State state) const { return lists_[index(state)]; }

  // Replaces the client's timer.
  void set_timer(Client& client, Clock::time_point at);
  void drop_timer(Client& client);
  // The client whose timer is the next; null without timers.
  Client* next_timer() const { return timers_.empty() ? nullptr : timers_.begin()->second; }

 private:
  static size_t index(Client::State state) { return static_cast<size_t>(state); }
  void count_in_flight(Client& client, bool is_in_flight);

  std::unordered_map<int, std::unique_ptr<Client>> by_fd_;
  std::map<std::string, int, std::less<>> by_address_;
  std::array<std::list<Client*>, Client::kStates> lists_;
  std::multimap<Clock::time_point, Client*> timers_;
  size_t in_flight_ = 0;
};

}  // namespace voxeld::http
