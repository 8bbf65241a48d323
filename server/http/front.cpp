#include "server/http/front.h"

#include <poll.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <deque>
#include <thread>
#include <utility>
#include <vector>

#include "server/base/log.h"
#include "server/base/thread_annotations.h"
#include "server/http/answer_request.h"
#include "server/http/body_reader.h"
#include "server/http/client_table.h"
#include "server/http/exchange.h"
#include "server/http/head_parser.h"
#include "server/http/listener.h"

namespace voxeld::http {
namespace {

constexpr size_t kReadStep = 65536;
// New connections are taken so many at a time, so that who is late is looked for between.
constexpr int kAcceptsMax = 256;
// After a request, a buffer that grew larger than this gives its memory back.
constexpr size_t kBufferKeptBytes = 4096;
constexpr int64_t kLingerBytesMax = int64_t{64} << 20;
constexpr int kPollMs = 500;
// Of a path, in the log of what did not end.
constexpr size_t kWhatBytesMax = 200;
constexpr auto kDrainStep = std::chrono::milliseconds(10);
// Against those who ask again and again, and would keep the front from ending.
constexpr double kUnheardSecondsMax = 1;

using State = Client::State;

// The keeper's thread accepts and sees to those who are late. All threads of the pool wait for the
// same events: who hears of a client reads from it, and runs its request then and there, without a
// thread that hands requests on. Each socket is armed for one event (EPOLLONESHOT), and whoever
// hears of it takes the client (`is_taken`, guarded by `mutex_`) until it arms it again; an event
// of a socket that was closed meanwhile finds nobody, or somebody new who has nothing to say yet.
class EpollFront final : public Front {
 public:
  EpollFront(UniqueFd listener, const FrontConfig& config, Handler handler, Observer observer)
      : listener_(std::move(listener)),
        port_(port_of(listener_.get())),
        config_(config),
        slow_max_(std::max(1, config.threads - std::max(1, config.threads / 4))),
        handler_(std::move(handler)),
        observer_(std::move(observer)),
        budget_(config.answers),
        epoll_(::epoll_create1(EPOLL_CLOEXEC)),
        end_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
    control(EPOLL_CTL_ADD, end_.get(), EPOLLIN);
    keeper_ = std::thread([this] { keep_loop(); });
    for (int i = 0; i < config.threads; ++i) pool_.emplace_back([this] { pool_loop(); });
  }
  ~EpollFront() override {
    (void)stop(0);
    join_all();
  }

  int port() const override { return port_; }
  FrontState state() const override {
    return {connections_.load(), running_.load(), budget_.bytes()};
  }

  std::vector<RunningRequest> stop(double seconds) override {
    if (stopping_.exchange(true)) return {};
    drain(seconds);
    {
      const MutexLock lock(mutex_);
      ended_ = true;  // from here on nothing that waits begins
      // What still runs has its socket cut, so that its thread comes back.
      for (const Client* client : table_.clients(State::kRunning)) {
        ::shutdown(client->connection.fd(), SHUT_RDWR);
      }
    }
    const uint64_t one = 1;  // never read again: all threads see it
    [[maybe_unused]] const ssize_t written = ::write(end_.get(), &one, sizeof one);
    wait_while([this] { return !running().empty(); }, from_now(kCutSecondsMax));
    std::vector<RunningRequest> left = running();
    if (left.empty()) join_all();
    return left;
  }

 private:
  static Clock::time_point from_now(double seconds) {
    return Clock::now() +
           std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
  }

  template <typename Condition>
  static void wait_while(const Condition& condition, Clock::time_point end) {
    while (condition() && Clock::now() < end) std::this_thread::sleep_for(kDrainStep);
  }

  std::vector<RunningRequest> running() EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    std::vector<RunningRequest> running;
    for (const Client* client : table_.clients(State::kRunning)) {
      running.push_back({client->what, client->connection.peer(),
                         std::chrono::duration<double>(Clock::now() - client->started).count()});
    }
    return running;
  }

  // After stop(). Nothing happens where all have ended already.
  void join_all() EXCLUDES(mutex_) {
    if (!keeper_.joinable()) return;
    keeper_.join();
    for (std::thread& thread : pool_) thread.join();
    listener_.reset();
    const MutexLock lock(mutex_);
    slow_queue_.clear();
    while (Client* client = any_client()) table_.remove(*client);
    connections_ = 0;
  }

  void control(int operation, int fd, uint32_t events) {
    epoll_event event{};
    event.events = events;
    event.data.fd = fd;
    ::epoll_ctl(epoll_.get(), operation, fd, &event);
  }

  // Until nothing is in flight, and then for a moment for clients to close: with bytes of theirs
  // unread, closing would take their last answer away.
  void drain(double seconds) EXCLUDES(mutex_) {
    const auto deadline = from_now(seconds);
    const auto is_busy = [this] { return in_flight() > 0; };
    wait_while(is_busy, deadline);
    // Requests that nobody has read yet, as all threads were busy, come in within a moment.
    wait_while([&] { return is_busy() || has_unheard(); },
               std::min(deadline, from_now(kUnheardSecondsMax)));
    wait_while(is_busy, deadline);
    if (const size_t cut = in_flight(); cut > 0) {
      log::warn("the time to drain is over: answers are cut", {{"answers", cut}});
    }
    wait_while([this] { return is_lingering(); }, std::min(deadline, from_now(kLingerSecondsMax)));
  }

  size_t in_flight() EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    return table_.in_flight();
  }
  // Whether anything came from a client that waits for nothing else.
  bool has_unheard() EXCLUDES(mutex_) {
    std::vector<pollfd> entries;
    {
      const MutexLock lock(mutex_);
      for (const State state : {State::kIdle, State::kHead, State::kBody}) {
        for (const Client* client : table_.clients(state)) {
          entries.push_back({client->connection.fd(), POLLIN, 0});
        }
      }
    }
    return ::poll(entries.data(), entries.size(), 0) > 0;
  }
  bool is_lingering() EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    return table_.count(State::kLingering) > 0;
  }

  Client* any_client() REQUIRES(mutex_) {
    for (size_t state = 0; state < Client::kStates; ++state) {
      if (Client* client = table_.longest(static_cast<State>(state))) return client;
    }
    return nullptr;
  }

  // Puts it where it waits, and arms its socket for what it waits for.
  void wait_for(Client& client, State state) EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    // Of those that stand still the time goes on; each other step begins anew.
    if (client.state != state || state == State::kIdle || state == State::kSending) {
      table_.set_state(client, state);
    }
    if (state == State::kHeld && !client.is_granted) return;  // grant_pieces() goes on with it
    arm(client);
  }

  void arm(Client& client) REQUIRES(mutex_) {
    client.is_taken = false;
    client.is_granted = false;
    const State state = client.state;
    uint32_t events = EPOLLIN;
    // What a held one waited for is there.
    if (state == State::kSending || state == State::kHeld) events = EPOLLOUT;
    // What it waits for is there: this puts it behind all others that have something to say.
    if (state == State::kQueued) events = EPOLLIN | EPOLLOUT;
    control(EPOLL_CTL_MOD, client.connection.fd(), events | EPOLLONESHOT);
  }

  void close(Client& client) EXCLUDES(mutex_) {
    std::unique_ptr<Client> removed;
    {
      const MutexLock lock(mutex_);
      removed = table_.remove(client);
    }
    removed.reset();  // with the bytes of its answer
    --connections_;
    grant_pieces();
  }

  // Bytes have left: answers that waited for room go on.
  void grant_pieces() EXCLUDES(mutex_) {
    if (!budget_.has_waiting()) return;
    for (void* const owner : budget_.grant()) {
      Client& client = *static_cast<Client*>(owner);
      const MutexLock lock(mutex_);
      client.is_granted = true;
      // Else its thread is still about to put it there.
      if (client.state == State::kHeld) arm(client);
    }
  }

  // --- the keeper's thread

  void keep_loop() {
    std::array<pollfd, 2> entries{{{listener_.get(), POLLIN, 0}, {end_.get(), POLLIN, 0}}};
    while (entries[1].revents == 0) {
      const int count = ::poll(entries.data(), entries.size(), kPollMs);
      if (count > 0 && entries[0].revents != 0) accept_some();
      drop_late();
      grant_pieces();
    }
  }

  void accept_some() {
    for (int i = 0; i < kAcceptsMax; ++i) {
      Accepted accepted = accept_one(listener_.get());
      if (!accepted.fd.valid()) {
        if (errno != EMFILE && errno != ENFILE) return;
        // Out of descriptors: without an idle one to close, the rest stays in the backlog.
        if (!make_room()) std::this_thread::sleep_for(std::chrono::milliseconds(20));
        return;
      }
      if (connections_.load() >= config_.connections_max && !make_room()) continue;
      admit(std::move(accepted));
    }
  }

  // Closed at once where its address has too many.
  void admit(Accepted accepted) EXCLUDES(mutex_) {
    const bool is_counted = config_.connections_per_address > 0 && !accepted.is_loopback &&
                            std::ranges::count(config_.trusted_proxies, accepted.address) == 0;
    const int fd = accepted.fd.get();
    const MutexLock lock(mutex_);
    if (is_counted && table_.count_of(accepted.address) >= config_.connections_per_address) return;
    ++connections_;
    table_.add(std::move(accepted.fd), std::move(accepted.address), is_counted);
    control(EPOLL_CTL_ADD, fd, EPOLLIN | EPOLLONESHOT);
  }

  // Closes the client that has waited for its own bytes for longest; false where none has for long
  // enough.
  bool make_room() EXCLUDES(mutex_) {
    Client* late = take_late(State::kIdle, kIdleSecondsMin);
    if (late == nullptr) late = take_late(State::kHead, kHeadSecondsMin);
    if (late == nullptr) late = take_late(State::kBody, kBodySecondsMin);
    if (late != nullptr) close(*late);
    return late != nullptr;
  }

  // Who has waited for too long is this thread's from then on.
  Client* take_late(State state, double seconds) EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    Client* client = table_.late(state, seconds, Clock::now());
    if (client != nullptr) client->is_taken = true;
    return client;
  }

  void drop_late() {
    while (Client* client = take_late(State::kIdle, kIdleSecondsMax)) close(*client);
    while (Client* client = take_late(State::kHead, kHeadSecondsMax)) close(*client);
    while (Client* client = take_late(State::kLingering, kLingerSecondsMax)) close(*client);
    // It pipelines, and its socket has no room for the next answer.
    while (Client* client = take_late(State::kQueued, config_.send.stall_seconds)) close(*client);
    while (Client* client = take_late(State::kSending, config_.send.stall_seconds)) {
      end_cut(*client);
    }
    while (Client* client = take_late(State::kBody, kBodyGraceSeconds)) {
      client->head.emplace(slow_body_error());
      if (begin(*client, /*is_slow=*/false)) run(*client);
    }
  }

  void end_cut(Client& client) {
    observe(client);
    close(client);
  }

  // --- the pool's threads

  void pool_loop() {
    while (Client* client = next()) {
      const bool has_begun = client->state == State::kRunning;
      if (has_begun || hear(*client)) run(*client);
    }
  }

  // Whom this thread sees to next: a client of the queue, which begins to run, or one that has
  // something to say. Null: the front has ended.
  Client* next() EXCLUDES(mutex_) {
    while (true) {
      {
        const MutexLock lock(mutex_);
        if (ended_) return nullptr;
        if (!slow_queue_.empty() && slow_running_ < slow_max_) {
          Client* client = slow_queue_.front();
          slow_queue_.pop_front();
          ++slow_running_;
          table_.set_state(*client, State::kRunning);
          return client;
        }
      }
      epoll_event event{};
      if (::epoll_wait(epoll_.get(), &event, 1, -1) != 1) continue;
      if (Client* client = take(event.data.fd)) return client;
    }
  }

  // Null where another thread has it already.
  Client* take(int fd) EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    Client* client = table_.find(fd);
    if (client == nullptr || client->is_taken) return nullptr;
    client->is_taken = true;
    return client;
  }

  // True: it is to be run by this thread.
  bool hear(Client& client) {
    if (client.state == State::kSending || client.state == State::kHeld) return begin_again(client);
    if (client.state == State::kQueued) return go_on(client);  // its buffer has it already
    if (client.state == State::kLingering) {
      drop_input(client);
      return false;
    }
    const auto read = client.connection.receive_available(kReadStep);
    if (read == Connection::ReadState::kData) return go_on(client);
    if (read == Connection::ReadState::kClosed) {
      close(client);
    } else {
      wait_for(client, client.state);
    }
    return false;
  }

  // True when its request can be answered, by this thread; else it waits for the rest of it.
  bool go_on(Client& client) {
    std::string& buffer = client.connection.buffer();
    if (!client.head) {
      const size_t end = buffer.find("\r\n\r\n", client.head_scanned);
      if (end == std::string::npos || end + 4 > kHeadBytesMax) {
        const bool is_bad = buffer.size() > kHeadBytesMax ||
                            buffer.find("\n\n", client.head_scanned) != std::string::npos;
        if (is_bad) return begin(client, /*is_slow=*/false);
        client.head_scanned = buffer.size() < 3 ? 0 : buffer.size() - 3;
        wait_for(client, buffer.empty() ? State::kIdle : State::kHead);
        return false;
      }
      client.head.emplace(parse_head(std::string_view(buffer).substr(0, end + 4)));
      buffer.erase(0, end + 4);
    }
    if (!*client.head) return begin(client, /*is_slow=*/false);
    const Head& head = client.head->value();
    const int64_t length = head.content_length.value_or(0);
    const bool is_small =
        !head.chunked && length <= kSmallBodyBytesMax && head.header("Expect").empty();
    if (is_small && static_cast<int64_t>(buffer.size()) < length) {
      wait_for(client, State::kBody);
      return false;
    }
    const bool may_wait = config_.may_wait && config_.may_wait(head);
    return begin(client, (head.has_body() && !is_small) || may_wait);
  }

  static std::string what_of(const Client& client) {
    if (!client.head || !*client.head) return "a broken head";
    const Head& head = client.head->value();
    return head.method + " " + head.path.substr(0, kWhatBytesMax);
  }

  // A request begins. False: it waits for one of the threads that may be slow; the one that gets
  // free takes it, so that nobody has to be woken.
  bool begin(Client& client, bool is_slow) EXCLUDES(mutex_) {
    client.started = Clock::now();
    client.is_refused = stopping_ && client.head && *client.head && config_.is_new_work &&
                        config_.is_new_work(client.head->value());
    client.is_slow = is_slow && !client.is_refused;
    const MutexLock lock(mutex_);
    client.what = what_of(client);
    const bool waits = client.is_slow && slow_running_ >= slow_max_;
    table_.set_state(client, waits || ended_ ? State::kQueued : State::kRunning);
    if (ended_) return false;
    if (waits) {
      slow_queue_.push_back(&client);
    } else if (client.is_slow) {
      ++slow_running_;
    }
    return !waits;
  }

  // The rest of an answer.
  bool begin_again(Client& client) EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    if (ended_) return false;
    client.is_slow = false;
    if (client.state == State::kHeld) client.held += Clock::now() - client.since;
    table_.set_state(client, State::kRunning);
    return true;
  }

  void run(Client& client) {
    ++running_;
    if (client.output == nullptr) answer(client);
    const Output::State sent = client.output->advance(client.connection);
    --running_;
    if (client.is_slow) {
      const MutexLock lock(mutex_);
      --slow_running_;
    }
    finish(client, sent);  // from then on others may have the client
  }

  void drop_input(Client& client) {
    client.connection.buffer().clear();
    const auto read = client.connection.receive_available(kReadStep);
    client.lingered_bytes += static_cast<int64_t>(client.connection.buffer().size());
    if (read == Connection::ReadState::kClosed || client.lingered_bytes > kLingerBytesMax) {
      return close(client);
    }
    wait_for(client, State::kLingering);
  }

  void answer(Client& client) {
    Response response = answer_request(client, handler_, config_);
    client.keep = client.keep && !stopping_;
    StreamBody stream;
    if (auto* body = std::get_if<StreamBody>(&response.body)) stream = std::move(*body);
    Output::Context context;
    if (client.head && *client.head) {
      const Head& head = client.head->value();
      context.method = head.method;
      context.path = head.path;
      context.minor = head.minor;
    }
    context.request_id = client.record.request_id;
    context.trace_id = client.record.trace_id;
    context.keep = client.keep;
    const bool wants_body = context.method != "HEAD";
    client.output = std::make_unique<Output>(std::move(context), std::move(response), budget_,
                                             client.record.tenant, &client);
    if (stream == nullptr) return;
    if (client.output->advance(client.connection) == Output::State::kDone && wants_body) {
      EventSink sink(client.connection);
      stream(sink);
    }
  }

  void finish(Client& client, Output::State sent) {
    if (sent == Output::State::kBlocked && !is_too_slow(client)) {
      wait_for(client, State::kSending);
      return grant_pieces();
    }
    if (sent == Output::State::kHeld) {
      wait_for(client, State::kHeld);
      return grant_pieces();
    }
    observe(client);
    if (sent != Output::State::kDone || client.connection.broken()) return close(client);
    client.output.reset();
    grant_pieces();
    client.head.reset();
    client.head_scanned = 0;
    client.held = {};
    client.record = {};
    if (!client.keep) {
      // Closing with unread bytes would reset the connection and take the answer with it: say that
      // no more will be sent, and drop what still comes for a moment.
      ::shutdown(client.connection.fd(), SHUT_WR);
      client.lingered_bytes = 0;
      return drop_input(client);
    }
    std::string& buffer = client.connection.buffer();
    if (buffer.empty() && buffer.capacity() > kBufferKeptBytes) std::string().swap(buffer);
    // Where it pipelines, its next request is there already.
    wait_for(client, buffer.empty() ? State::kIdle : State::kQueued);
  }

  // An average below the least rate, so that nobody holds a place for ever by reading now and then.
  bool is_too_slow(const Client& client) const {
    const SendLimits& limits = config_.send;
    const auto taking = Clock::now() - client.started - client.held;
    const double seconds = std::chrono::duration<double>(taking).count();
    return seconds > limits.grace_seconds &&
           static_cast<double>(client.output->sent()) <
               (seconds - limits.grace_seconds) * static_cast<double>(limits.rate_min);
  }

  void observe(Client& client) {
    static const Head kNoHead;
    ExchangeRecord& record = client.record;
    if (record.head == nullptr) record.head = &kNoHead;
    record.status = client.output->status();
    record.bytes_out = client.output->body_sent();
    record.ms = std::chrono::duration<double, std::milli>(Clock::now() - client.started).count();
    observer_(record);
  }

  UniqueFd listener_;
  const int port_;
  const FrontConfig config_;
  const int slow_max_;
  const Handler handler_;
  const Observer observer_;
  AnswerBudget budget_;   // before the clients, whose answers hold bytes of it
  const UniqueFd epoll_;  // of clients
  const UniqueFd end_;    // readable when the front has ended
  std::atomic<bool> stopping_{false};
  std::atomic<int64_t> connections_{0}, running_{0};

  Mutex mutex_;
  ClientTable table_ GUARDED_BY(mutex_);
  std::deque<Client*> slow_queue_ GUARDED_BY(mutex_);
  int slow_running_ GUARDED_BY(mutex_) = 0;
  bool ended_ GUARDED_BY(mutex_) = false;

  std::thread keeper_;
  std::vector<std::thread> pool_;
};

}  // namespace

Result<std::unique_ptr<Front>> start_front(const FrontConfig& config, Handler handler,
                                           Observer observer) {
  VOXELD_ASSIGN(UniqueFd listener, listen_tcp(config.listen));
  return std::unique_ptr<Front>(std::make_unique<EpollFront>(
      std::move(listener), config, std::move(handler), std::move(observer)));
}

}  // namespace voxeld::http
