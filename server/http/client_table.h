// The connections of a front, what each of them waits for, and who has waited too long.
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

#include "server/http/connection.h"
#include "server/http/exchange.h"
#include "server/http/front.h"

namespace voxeld::http {

struct Client {
  // idle ─> head ─> body ─> queued ─> running ─> idle | queued | sending | lingering | gone
  //                                     │ └──────────────────────── sending
  //                                    held
  enum class State {
    kIdle,       // for the first byte of a request
    kHead,       // for the rest of its head
    kBody,       // for the rest of a small body
    kQueued,     // for a thread: of those that may be slow, or for its turn, where it pipelines
    kRunning,    // a thread has it
    kSending,    // for its client to take more of an answer
    kHeld,       // for the budget of answers to have room for its next piece
    kLingering,  // for its client to close, after an answer that ends the connection
  };
  static constexpr size_t kStates = 8;

  explicit Client(UniqueFd fd, std::string address)
      : connection(std::move(fd), std::move(address)) {}

  Connection connection;
  bool is_counted = false;  // by address
  bool is_taken = false;    // by a thread, or by the queue: nobody else may touch it
  State state = State::kIdle;
  Clock::time_point since = Clock::now();  // of the state
  std::list<Client*>::iterator place;      // among those of its state

  // --- of the request; whoever has the client by its state uses them
  std::optional<Result<Head>> head;  // once it is whole
  size_t head_scanned = 0;           // bytes of the buffer without an empty line
  Clock::time_point started;         // its head was whole
  std::string what;                  // method and path; the table's owner guards it
  std::unique_ptr<Output> output;    // its answer
  Clock::duration held{};            // for which that waited for the budget
  ExchangeRecord record;
  bool keep = false;
  bool is_slow = false;     // it takes one of the threads that may be slow
  bool is_refused = false;  // new work while the front drains
  bool is_granted = false;  // the budget has given it a piece since it had to wait for that
  int64_t lingered_bytes = 0;

 private:
  friend class ClientTable;
  bool is_in_flight_ = false;
};

// The name under which connections of an address are counted: an IPv4 address itself, or the first
// 64 bits of an IPv6 one, since a customer is given 2^64 of them at least.
std::string counted_as(std::string_view address);

// Not thread-safe. Everything is O(1), but for taking those who are late, which is O(of them) and
// of those that are taken.
class ClientTable {
 public:
  // Takes it in as idle. `is_counted`: against count_of() its address.
  Client& add(UniqueFd fd, std::string address, bool is_counted);
  Client* find(int fd);
  // The socket closes when the caller lets go of it.
  std::unique_ptr<Client> remove(Client& client);
  // `since` now, and to the end of those of that state.
  void set_state(Client& client, Client::State state);

  size_t size() const { return by_fd_.size(); }
  size_t count(Client::State state) const { return lists_[index(state)].size(); }
  // Those with a request that has begun, was not refused, and is not answered to its end.
  size_t in_flight() const { return in_flight_; }
  int count_of(std::string_view address) const;
  // Who has been in that state for longest; null where nobody is.
  Client* longest(Client::State state) const;
  // The same of those that are not taken, if it has been for more than `seconds`.
  Client* late(Client::State state, double seconds, Clock::time_point now) const;
  // Those in that state, the longest first.
  const std::list<Client*>& clients(Client::State state) const { return lists_[index(state)]; }

 private:
  static size_t index(Client::State state) { return static_cast<size_t>(state); }
  void count_in_flight(Client& client, bool is_in_flight);

  std::unordered_map<int, std::unique_ptr<Client>> by_fd_;
  std::map<std::string, int, std::less<>> by_address_;
  std::array<std::list<Client*>, Client::kStates> lists_;
  size_t in_flight_ = 0;
};

}  // namespace voxeld::http
