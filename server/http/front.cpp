#include "server/http/front.h"

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
constexpr size_t kEventsMax = 256;
// New connections are taken so many at a time, so that those that are there are looked at between.
constexpr int kAcceptsMax = 256;
// After a request, a buffer that grew larger than this gives its memory back.
constexpr size_t kBufferKeptBytes = 4096;
constexpr int64_t kLingerBytesMax = int64_t{64} << 20;
constexpr int kPollMs = 500;
constexpr auto kDrainStep = std::chrono::milliseconds(10);

using State = Client::State;

// Which threads may take a request.
enum class Lane { kQuick, kSlow };

// The poller's thread reads heads and small bodies, and sees to those who are late; the pool's
// threads run handlers and send. A client in a state of waiting is the poller's, a running one its
// thread's; `mutex_` guards who is what. Each socket is armed for one event (EPOLLONESHOT), so that
// nobody but its owner hears of it.
class EpollFront final : public Front {
 public:
  EpollFront(UniqueFd listener, const FrontConfig& config, Handler handler, Observer observer)
      : listener_(std::move(listener)),
        port_(port_of(listener_.get())),
        config_(config),
        slow_max_(std::max(1, config.threads - std::max(1, config.threads / 4))),
        handler_(std::move(handler)),
        observer_(std::move(observer)),
        epoll_(::epoll_create1(EPOLL_CLOEXEC)),
        wake_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
    control(EPOLL_CTL_ADD, listener_.get(), EPOLLIN);
    control(EPOLL_CTL_ADD, wake_.get(), EPOLLIN);
    poller_ = std::thread([this] { poll_loop(); });
    for (int i = 0; i < config.threads; ++i) pool_.emplace_back([this] { pool_loop(); });
  }
  ~EpollFront() override { stop(0); }

  int port() const override { return port_; }
  FrontState state() const override { return {connections_.load(), running_.load()}; }

  void stop(double seconds) override {
    if (stopping_.exchange(true)) return;
    drain(seconds);
    {
      const MutexLock lock(mutex_);
      ended_ = true;  // from here on nothing that waits begins
      // What still runs has its socket cut, so that its thread comes back.
      for (const int fd : running_fds_) ::shutdown(fd, SHUT_RDWR);
    }
    ready_.notify_all();
    notify();
    poller_.join();
    for (std::thread& thread : pool_) thread.join();
    listener_.reset();
    const MutexLock lock(mutex_);
    queues_ = {};
    while (Client* client = any_client()) table_.remove(*client);
    connections_ = 0;
  }

 private:
  void control(int operation, int fd, uint32_t events) {
    epoll_event event{};
    event.events = events;
    event.data.fd = fd;
    ::epoll_ctl(epoll_.get(), operation, fd, &event);
  }

  // Until nothing is in flight, and then for a moment for clients to close: with bytes of theirs
  // unread, closing would take their last answer away.
  void drain(double seconds) EXCLUDES(mutex_) {
    const auto until = [](double from_now) {
      return Clock::now() +
             std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(from_now));
    };
    const auto deadline = until(seconds);
    const auto wait_while = [](const auto& condition, Clock::time_point end) {
      while (condition() && Clock::now() < end) std::this_thread::sleep_for(kDrainStep);
    };
    wait_while([this] { return in_flight() > 0; }, deadline);
    if (const size_t cut = in_flight(); cut > 0) {
      log::warn("the time to drain is over: answers are cut", {{"answers", cut}});
    }
    wait_while([this] { return is_lingering(); }, std::min(deadline, until(kLingerSecondsMax)));
  }

  size_t in_flight() EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    return table_.in_flight();
  }
  bool is_lingering() EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    return table_.count(State::kLingering) > 0;
  }

  void notify() {
    const uint64_t one = 1;
    [[maybe_unused]] const ssize_t written = ::write(wake_.get(), &one, sizeof one);
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
    const uint32_t events = state == State::kSending ? EPOLLOUT : EPOLLIN;
    control(EPOLL_CTL_MOD, client.connection.fd(), events | EPOLLONESHOT);
  }

  void close(Client& client) EXCLUDES(mutex_) {
    std::unique_ptr<Client> removed;
    {
      const MutexLock lock(mutex_);
      removed = table_.remove(client);
    }
    --connections_;
  }

  void enqueue(Client& client, Lane lane) EXCLUDES(mutex_) {
    {
      const MutexLock lock(mutex_);
      table_.set_state(client, State::kQueued);
      queues_[static_cast<size_t>(lane)].push_back(&client);
    }
    ready_.notify_one();
  }

  // --- the poller's thread

  void poll_loop() {
    std::array<epoll_event, kEventsMax> events{};
    while (true) {
      const int count = ::epoll_wait(epoll_.get(), events.data(), kEventsMax, kPollMs);
      for (int i = 0; i < count; ++i) handle(events[static_cast<size_t>(i)].data.fd);
      if (has_ended()) return;
      drop_late();
    }
  }

  void handle(int fd) {
    if (fd == wake_.get()) {
      uint64_t value = 0;
      [[maybe_unused]] const ssize_t got = ::read(wake_.get(), &value, sizeof value);
    } else if (fd == listener_.get()) {
      accept_some();
    } else if (Client* client = waiting(fd)) {
      if (client->state == State::kSending) return enqueue(*client, Lane::kQuick);
      if (client->state == State::kLingering) return drop_input(*client);
      receive(*client);
    }
  }

  bool has_ended() EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    return ended_;
  }

  // Null where a thread has it: then the event is one of a socket that was closed meanwhile.
  Client* waiting(int fd) EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    Client* client = table_.find(fd);
    const bool is_taken =
        client != nullptr && (client->state == State::kQueued || client->state == State::kRunning);
    return is_taken ? nullptr : client;
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

  // Closes who has been idle for longest; false where nobody has been for long enough.
  bool make_room() EXCLUDES(mutex_) {
    Client* idle = nullptr;
    {
      const MutexLock lock(mutex_);
      idle = table_.late(State::kIdle, kIdleSecondsMin, Clock::now());
    }
    if (idle != nullptr) close(*idle);
    return idle != nullptr;
  }

  void receive(Client& client) {
    switch (client.connection.receive_available(kReadStep)) {
      case Connection::ReadState::kClosed:
        return close(client);
      case Connection::ReadState::kNothing:
        return wait_for(client, client.state);
      case Connection::ReadState::kData:
        return go_on(client);
    }
  }

  // Hands the client to the pool when its request can be answered, else waits for the rest of it.
  void go_on(Client& client) {
    std::string& buffer = client.connection.buffer();
    if (!client.head) {
      const size_t end = buffer.find("\r\n\r\n", client.head_scanned);
      if (end == std::string::npos || end + 4 > kHeadBytesMax) {
        const bool is_bad = buffer.size() > kHeadBytesMax ||
                            buffer.find("\n\n", client.head_scanned) != std::string::npos;
        if (is_bad) return begin(client, Lane::kQuick);
        client.head_scanned = buffer.size() < 3 ? 0 : buffer.size() - 3;
        return wait_for(client, buffer.empty() ? State::kIdle : State::kHead);
      }
      client.head.emplace(parse_head(std::string_view(buffer).substr(0, end + 4)));
      buffer.erase(0, end + 4);
    }
    if (!*client.head) return begin(client, Lane::kQuick);
    const Head& head = client.head->value();
    const int64_t length = head.content_length.value_or(0);
    const bool is_small =
        !head.chunked && length <= kSmallBodyBytesMax && head.header("Expect").empty();
    if (is_small && static_cast<int64_t>(buffer.size()) < length) {
      return wait_for(client, State::kBody);
    }
    const bool may_wait = config_.may_wait && config_.may_wait(head);
    begin(client, (head.has_body() && !is_small) || may_wait ? Lane::kSlow : Lane::kQuick);
  }

  void begin(Client& client, Lane lane) {
    client.started = Clock::now();
    client.is_refused = stopping_ && client.head && *client.head && config_.is_new_work &&
                        config_.is_new_work(client.head->value());
    enqueue(client, client.is_refused ? Lane::kQuick : lane);
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

  Client* take_late(State state, double seconds) EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    return table_.late(state, seconds, Clock::now());
  }

  void drop_late() {
    while (Client* client = take_late(State::kIdle, kIdleSecondsMax)) close(*client);
    while (Client* client = take_late(State::kHead, kHeadSecondsMax)) close(*client);
    while (Client* client = take_late(State::kLingering, kLingerSecondsMax)) close(*client);
    while (Client* client = take_late(State::kSending, config_.send.stall_seconds))
      end_cut(*client);
    while (Client* client = take_late(State::kBody, kBodyGraceSeconds)) {
      client->head.emplace(slow_body_error());
      begin(*client, Lane::kQuick);
    }
  }

  void end_cut(Client& client) {
    observe(client);
    close(client);
  }

  // --- the pool's threads

  // The next request for this thread; null: the front has ended.
  Client* take_next(Lane& lane) EXCLUDES(mutex_) {
    MutexLock lock(mutex_);
    while (!ended_) {
      for (const Lane candidate : {Lane::kQuick, Lane::kSlow}) {
        auto& queue = queues_[static_cast<size_t>(candidate)];
        if (queue.empty() || (candidate == Lane::kSlow && slow_running_ >= slow_max_)) continue;
        Client* client = queue.front();
        queue.pop_front();
        lane = candidate;
        if (lane == Lane::kSlow) ++slow_running_;
        table_.set_state(*client, State::kRunning);
        running_fds_.push_back(client->connection.fd());
        return client;
      }
      ready_.wait(lock);
    }
    return nullptr;
  }

  void let_go(int fd, Lane lane) EXCLUDES(mutex_) {
    bool wakes = false;
    {
      const MutexLock lock(mutex_);
      std::erase(running_fds_, fd);
      if (lane == Lane::kSlow) --slow_running_;
      wakes = lane == Lane::kSlow && !queues_[static_cast<size_t>(Lane::kSlow)].empty();
    }
    if (wakes) ready_.notify_one();
  }

  void pool_loop() {
    Lane lane = Lane::kQuick;
    while (Client* client = take_next(lane)) {
      const int fd = client->connection.fd();
      ++running_;
      if (client->output == nullptr) answer(*client);
      const Output::State sent = client->output->advance(client->connection);
      --running_;
      // From here on others may have the client, or another one this descriptor.
      let_go(fd, lane);
      finish(*client, sent);
    }
  }

  void answer(Client& client) {
    Response response = answer_request(client, handler_, config_);
    client.keep = client.keep && !stopping_;
    static const Head kNoHead;
    const bool has_head = client.head && *client.head;
    client.output =
        std::make_unique<Output>(has_head ? client.head->value() : kNoHead, response, client.keep);
    if (const auto* stream = std::get_if<StreamBody>(&response.body)) {
      const bool wants_body = !has_head || client.head->value().method != "HEAD";
      if (client.output->advance(client.connection) == Output::State::kDone && wants_body) {
        EventSink sink(client.connection);
        (*stream)(sink);
      }
    }
  }

  void finish(Client& client, Output::State sent) {
    if (sent == Output::State::kBlocked && !is_too_slow(client)) {
      return wait_for(client, State::kSending);
    }
    observe(client);
    if (sent != Output::State::kDone || client.connection.broken()) return close(client);
    client.output.reset();
    client.head.reset();
    client.head_scanned = 0;
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
    go_on(client);  // a pipelined request is there already
  }

  // An average below the least rate, so that nobody holds a place for ever by reading now and then.
  bool is_too_slow(const Client& client) const {
    const SendLimits& limits = config_.send;
    const double seconds = std::chrono::duration<double>(Clock::now() - client.started).count();
    return seconds > limits.grace_seconds &&
           static_cast<double>(client.output->sent()) <
               (seconds - limits.grace_seconds) * static_cast<double>(limits.rate_min);
  }

  void observe(Client& client) {
    static const Head kNoHead;
    ExchangeRecord& record = client.record;
    if (record.head == nullptr) record.head = &kNoHead;
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
  const UniqueFd epoll_, wake_;
  std::atomic<bool> stopping_{false};
  std::atomic<int64_t> connections_{0}, running_{0};

  Mutex mutex_;
  CondVar ready_;
  ClientTable table_ GUARDED_BY(mutex_);
  std::array<std::deque<Client*>, 2> queues_ GUARDED_BY(mutex_);  // by Lane
  int slow_running_ GUARDED_BY(mutex_) = 0;
  std::vector<int> running_fds_ GUARDED_BY(mutex_);
  bool ended_ GUARDED_BY(mutex_) = false;

  std::thread poller_;
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
