#include "server/http/http_server.h"

#include <poll.h>
#include <sys/epoll.h>
#include <sys/socket.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <deque>
#include <thread>
#include <utility>
#include <vector>

#include "server/base/log.h"
#include "server/base/thread_annotations.h"
#include "server/http/active_threads.h"
#include "server/http/client_table.h"
#include "server/http/housekeeping.h"
#include "server/http/message/head_parser.h"
#include "server/http/sockets/listener.h"
#include "server/http/sockets/poller.h"

namespace voxeld::http {
namespace {

constexpr size_t kReadStep = 65536;
// Reads of one body before other clients get the thread.
constexpr int kBodyReadsMax = 16;
constexpr int64_t kLingerBytesMax = int64_t{64} << 20;
// Clients that ask again and again must not keep the server from ending.
constexpr double kUnheardSecondsMax = 1;

using State = Client::State;
using Step = Exchange::Step;

Clock::time_point from_now(double seconds) {
  return Clock::now() +
         std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
}

// Returns when the condition is false, or at `end`. It polls: only the end of a server waits so.
template <typename Condition>
void wait_while(const Condition& condition, Clock::time_point end) {
  constexpr auto kStep = std::chrono::milliseconds(10);
  while (condition() && Clock::now() < end) std::this_thread::sleep_for(kStep);
}

// One housekeeping thread accepts connections, runs timers and closes late clients. The active
// threads of the pool wait for the same events. The thread that gets an event reads from the client
// and runs its request then and there, so that a request is never handed over.
//
// Each socket is armed for one event (EPOLLONESHOT). The thread that gets it takes the client
// (`is_taken`, guarded by `mutex_`) until it arms the socket again. An event of a socket that was
// closed meanwhile finds no client, or a new one without anything to read.
//
// A client that is woken, whose timer has come or that got memory goes to `ready_`, and one thread
// of the pool is told to take it.
class EpollServer final : public HttpServer {
 public:
  EpollServer(UniqueFd listener, const HttpServerConfig& config, Handler handler, Observer observer)
      : port_(port_of(listener.get())),
        config_(config),
        handler_(std::move(handler)),
        observer_(std::move(observer)),
        responses_(config.memory),
        bodies_(config.memory),
        active_(config.threads) {
    Housekeeping::Calls calls;
    calls.has_place = [this] {
      return connections_.load() < config_.connections_max || make_room();
    };
    calls.make_room = [this] { return make_room(); };
    calls.admit = [this](Accepted accepted) { admit(std::move(accepted)); };
    calls.run_timers = [this] { return run_timers(); };
    calls.tick = [this] { tick(); };
    housekeeping_ = std::make_unique<Housekeeping>(std::move(listener), std::move(calls));
    try {
      pool_.reserve(static_cast<size_t>(config.threads));
      for (int i = 0; i < config.threads; ++i) pool_.emplace_back([this, i] { pool_loop(i); });
    } catch (...) {  // no memory, too many threads: those that run use this object
      shut_down();
      throw;
    }
  }
  ~EpollServer() override { shut_down(); }

  int port() const override { return port_; }
  HttpServerState state() const override {
    return {connections_.load(), running_.load(), waiting_.load(),
            responses_.bytes() + bodies_.bytes(), stopping_.load()};
  }

  void wake_waiting() override EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    // A running one may have looked just before the change that this call is for.
    for (Client* client : table_.clients(State::kRunning)) client->is_woken = true;
    for (Client* client : table_.clients(State::kWaiting)) {
      client->is_woken = true;
      make_ready(*client);
    }
  }

  std::vector<RunningRequest> stop(double seconds) override {
    if (stopping_.exchange(true)) return {};
    drain(seconds);
    {
      const MutexLock lock(mutex_);
      ended_ = true;  // from here on no thread takes a client
      // Handlers that still run see a client that has left.
      for (const Client* client : table_.clients(State::kRunning)) {
        ::shutdown(client->connection.fd(), SHUT_RDWR);
      }
    }
    poller_.end();
    active_.end();
    housekeeping_->end();
    wait_while([this] { return !running().empty(); }, from_now(kCutSecondsMax));
    std::vector<RunningRequest> left = running();
    if (left.empty()) join_all();
    return left;
  }

 private:
  void shut_down() {
    (void)stop(0);
    join_all();
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

  // After stop(). Does nothing if all threads have ended already.
  void join_all() EXCLUDES(mutex_) {
    if (pool_.empty()) return;
    for (std::thread& thread : pool_) thread.join();
    pool_.clear();
    std::vector<std::unique_ptr<Client>> left;
    {
      const MutexLock lock(mutex_);
      ready_.clear();
      left = table_.remove_all();
    }
    for (const std::unique_ptr<Client>& client : left) {
      if (client->exchange) observe(*client);
      client->end_exchange();
    }
    connections_ = 0;
    waiting_ = 0;
  }

  // Until no request is in flight, and then for a moment for clients to close: closing a socket
  // with unread bytes would take its client's last response away.
  void drain(double seconds) EXCLUDES(mutex_) {
    wake_waiting();
    const auto deadline = from_now(seconds);
    const auto is_busy = [this] { return requests_in_flight() > 0; };
    wait_while(is_busy, deadline);
    // Requests that have arrived while all threads were busy are read within a moment.
    wait_while([&] { return is_busy() || has_unread(); },
               std::min(deadline, from_now(kUnheardSecondsMax)));
    wait_while(is_busy, deadline);
    const size_t cut = requests_in_flight();
    if (cut > 0) log::warn("the time to drain is over: responses are cut", {{"responses", cut}});
    wait_while([this] { return is_lingering(); }, std::min(deadline, from_now(kLingerSecondsMax)));
  }

  size_t requests_in_flight() override EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    return table_.in_flight();
  }
  bool is_lingering() EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    return table_.count(State::kLingering) > 0;
  }
  // Whether bytes have arrived from a client that waits for nothing else.
  bool has_unread() EXCLUDES(mutex_) {
    std::vector<pollfd> entries;
    {
      const MutexLock lock(mutex_);
      for (const State state : {State::kIdle, State::kHead}) {
        for (const Client* client : table_.clients(state)) {
          entries.push_back({client->connection.fd(), POLLIN, 0});
        }
      }
    }
    return ::poll(entries.data(), entries.size(), 0) > 0;
  }

  // --- from a state to the next

  // Leaves the client to its socket's next event.
  void wait_for(Client& client, State state) EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    // A head that arrives byte by byte stays in its state, and its time goes on.
    if (client.state != state || state == State::kIdle) table_.set_state(client, state);
    client.is_taken = false;
    uint32_t events = EPOLLIN;
    if (state == State::kSending) events = EPOLLOUT;
    // Always reported: this puts the client behind all others that have something to read.
    if (state == State::kQueued) events = EPOLLIN | EPOLLOUT;
    poller_.arm(client.connection.fd(), events);
  }

  // Leaves the client to its waker, its timer, or the end of its connection.
  void wait_for_wake(Client& client) EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    table_.set_state(client, State::kWaiting);
    waiting_ = static_cast<int64_t>(table_.count(State::kWaiting));
    client.is_taken = false;
    if (client.is_woken) return make_ready(client);
    const auto until = client.exchange->wait_until();
    if (until != Clock::time_point::max()) table_.set_timer(client, until);
    if (table_.next_timer() == &client) housekeeping_->timer_set();
    poller_.arm(client.connection.fd(), EPOLLRDHUP);
  }

  // Leaves the client to grant_memory().
  void wait_for_memory(Client& client) EXCLUDES(mutex_) {
    {
      const MutexLock lock(mutex_);
      table_.set_state(client, State::kHeld);
      client.is_taken = false;
      if (client.is_granted) make_ready(client);  // while this thread still had it
    }
    grant_memory();
  }

  // Called by the waker of its exchange.
  void wake(Client& client) EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    client.is_woken = true;
    if (client.state == State::kWaiting) make_ready(client);
  }

  // Queues a client that waits or is held for a thread of the pool.
  void make_ready(Client& client) REQUIRES(mutex_) {
    if (client.is_taken) return;
    client.is_taken = true;
    client.is_woken = client.is_granted = false;
    ready_.push_back(&client);
    poller_.signal_ready();
  }

  // Bytes of the budget have been returned: exchanges that waited for them go on.
  void grant_memory() EXCLUDES(mutex_) {
    for (MemoryBudget* const budget : {&responses_, &bodies_}) {
      if (!budget->has_waiting()) continue;
      for (void* const owner : budget->grant()) {
        Client& client = *static_cast<Client*>(owner);
        const MutexLock lock(mutex_);
        client.is_granted = true;
        if (client.state == State::kHeld) make_ready(client);
      }
    }
  }

  void close(Client& client) EXCLUDES(mutex_) {
    std::unique_ptr<Client> removed;
    {
      const MutexLock lock(mutex_);
      removed = table_.remove(client);
    }
    removed->end_exchange();
    removed.reset();
    --connections_;
    grant_memory();
  }

  // --- the housekeeping thread

  std::chrono::milliseconds run_timers() EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    const auto now = Clock::now();
    while (Client* client = table_.next_timer()) {
      const auto at = (*client->timer)->first;
      if (at > now) {
        return std::chrono::ceil<std::chrono::milliseconds>(
            std::min<Clock::duration>(at - now, kHousekeepingStep));
      }
      table_.drop_timer(*client);
      make_ready(*client);
    }
    return kHousekeepingStep;
  }

  void tick() {
    is_disk_short_ = config_.is_disk_short && config_.is_disk_short();
    drop_late();
    grant_memory();
    if (config_.is_recheck_due && config_.is_recheck_due()) wake_waiting();
  }

  // Closed at once if its address has too many.
  void admit(Accepted accepted) EXCLUDES(mutex_) {
    const bool is_counted = config_.connections_per_address > 0 && !accepted.is_loopback &&
                            std::ranges::count(config_.trusted_proxies, accepted.address) == 0;
    const int fd = accepted.fd.get();
    const MutexLock lock(mutex_);
    if (is_counted && table_.count_of(accepted.address) >= config_.connections_per_address) return;
    ++connections_;
    table_.add(std::move(accepted.fd), std::move(accepted.address), is_counted);
    poller_.add(fd, EPOLLIN);
  }

  // Closes the client that has waited for its own bytes for longest; false if none has waited for
  // long enough.
  bool make_room() EXCLUDES(mutex_) {
    Client* late = take_late(State::kIdle, kIdleSecondsMin);
    if (late == nullptr) late = take_late(State::kHead, kHeadSecondsMin);
    if (late == nullptr) late = take_late(State::kBody, kBodySecondsMin);
    if (late == nullptr) return false;
    if (late->exchange) observe(*late);
    close(*late);
    return true;
  }

  // Takes the client that has been late for longest; with `keeps_room`, among such downloads.
  Client* take_late(State state, double seconds, bool keeps_room = false) EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    const auto now = Clock::now();
    Client* client = keeps_room ? table_.late_download(seconds, is_disk_short_, now)
                                : table_.late(state, seconds, now);
    if (client != nullptr) client->is_taken = true;
    return client;
  }

  void drop_late() {
    const double pressed_seconds = config_.send.pressed_stall_seconds;
    while (Client* client = take_late(State::kSending, pressed_seconds, true)) cut(*client);
    while (Client* client = take_late(State::kIdle, kIdleSecondsMax)) close(*client);
    while (Client* client = take_late(State::kHead, kHeadSecondsMax)) close(*client);
    while (Client* client = take_late(State::kLingering, kLingerSecondsMax)) close(*client);
    // It pipelines, and its socket has no room for the next response.
    while (Client* client = take_late(State::kQueued, config_.send.stall_seconds)) close(*client);
    while (Client* client = take_late(State::kSending, config_.send.stall_seconds)) cut(*client);
    while (Client* client = take_late(State::kBody, kBodyGraceSeconds)) {
      if (!begin_again(*client)) return;
      client->exchange->fail_body(slow_body_error());
      run(*client);
    }
  }

  // --- the pool's threads

  void pool_loop(int thread) {
    Connection::block_sigpipe();
    while (Client* client = next(thread)) serve(*client);
  }

  // The client that this thread serves next. Null: the server has ended.
  Client* next(int thread) EXCLUDES(mutex_) {
    while (true) {
      const int event = active_.wait(thread, [this] { return poller_.wait(); });
      if (event == Poller::kEnded) return nullptr;
      Client* client = event == Poller::kReady ? take_ready() : take(event);
      if (client != nullptr) return client;
    }
  }

  // Null after the end.
  Client* take_ready() EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    if (ended_ || ready_.empty()) return nullptr;
    Client* client = ready_.front();
    ready_.pop_front();
    return client;
  }

  // Null if another thread has it already.
  Client* take(int fd) EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    Client* client = table_.find(fd);
    if (ended_ || client == nullptr || client->is_taken) return nullptr;
    client->is_taken = true;
    return client;
  }

  void serve(Client& client) {
    switch (client.state) {
      case State::kIdle:
      case State::kHead:
        return read_head(client);
      case State::kQueued:
        return use_head(client);  // it is in the buffer already
      case State::kBody:
        if (begin_again(client)) read_body(client);
        return;
      case State::kWaiting:
        if (begin_again(client)) look_again(client);
        return;
      case State::kHeld:
      case State::kSending:
        if (begin_again(client)) run(client);
        return;
      case State::kLingering:
        return drop_input(client);
      case State::kRunning:
        return;
    }
  }

  void read_head(Client& client) {
    switch (client.connection.receive_available(kReadStep)) {
      case Connection::ReadState::kData:
        return use_head(client);
      case Connection::ReadState::kNothing:
        return wait_for(client, client.state);
      case Connection::ReadState::kClosed:
        return close(client);
    }
  }

  // Begins the request whose head is in the buffer, or waits for the rest of the head.
  void use_head(Client& client) {
    std::string& buffer = client.connection.buffer();
    auto head = take_head(buffer, client.head_scanned);
    if (head) return begin(client, *std::move(head));
    wait_for(client, buffer.empty() ? State::kIdle : State::kHead);
  }

  void begin(Client& client, Result<Head> head) EXCLUDES(mutex_) {
    const bool is_refused =
        stopping_ && head.ok() && config_.is_new_work && config_.is_new_work(*head);
    client.head_scanned = 0;
    client.paused = {};
    client.started = Clock::now();
    client.waker = std::make_shared<CallbackWaker>([this, &client] { wake(client); });
    client.exchange = std::make_unique<Exchange>(
        Exchange::Context{handler_, config_.add_headers, config_.trusted_proxies, responses_,
                          bodies_, stopping_, config_.held_files},
        client.connection, std::move(head), is_refused, client.waker, &client);
    {
      const MutexLock lock(mutex_);
      if (ended_) return;
      client.is_woken = client.is_granted = false;
      client.what = client.exchange->description();
      table_.set_state(client, State::kRunning);
    }
    run(client);
  }

  // False: the server has ended.
  bool begin_again(Client& client) EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    if (ended_) return false;
    const bool has_paused = client.state == State::kHeld || client.state == State::kWaiting;
    if (has_paused && client.exchange->responded()) client.paused += Clock::now() - client.since;
    table_.set_state(client, State::kRunning);
    waiting_ = static_cast<int64_t>(table_.count(State::kWaiting));
    return true;
  }

  void look_again(Client& client) {
    if (!client.connection.peer_closed()) return run(client);
    client.exchange->abandon();
    cut(client);
  }

  // Gives the exchange what its client has sent, for a while.
  void read_body(Client& client) {
    for (int i = 0; i < kBodyReadsMax; ++i) {
      switch (client.connection.receive_available(kReadStep)) {
        case Connection::ReadState::kData:
          break;
        case Connection::ReadState::kNothing:
          if (client.exchange->is_body_too_slow()) {
            client.exchange->fail_body(slow_body_error());
            return run(client);
          }
          return wait_for_body(client);
        case Connection::ReadState::kClosed:
          client.exchange->fail_body(short_body_error());
          return run(client);
      }
      const Step step = advance(client);
      if (step != Step::kReadBody) return settle(client, step);
    }
    wait_for_body(client);
  }

  void wait_for_body(Client& client) {
    client.connection.shrink_buffer();
    wait_for(client, State::kBody);
  }

  void run(Client& client) {
    const Step step = advance(client);
    // More of the body may be there already.
    if (step == Step::kReadBody) return read_body(client);
    settle(client, step);  // from then on other threads may have the client
  }

  Step advance(Client& client) {
    ++running_;
    const Step step = client.exchange->advance();
    --running_;
    return step;
  }

  void settle(Client& client, Step step) {
    // A body was in it, and the response may take long.
    if (step != Step::kReadBody) client.connection.shrink_buffer();
    switch (step) {
      case Step::kReadBody:
        return wait_for_body(client);
      case Step::kWait:
        wait_for_wake(client);
        return grant_memory();
      case Step::kNeedMemory:
        return wait_for_memory(client);
      case Step::kSend:
        if (client.is_too_slow(config_.send, is_disk_short_)) break;
        wait_for(client, State::kSending);
        return grant_memory();
      case Step::kDone:
        return finish(client);
      case Step::kBroken:
        break;
    }
    cut(client);
  }

  void cut(Client& client) {
    observe(client);
    close(client);
  }

  void finish(Client& client) {
    observe(client);
    const bool keep = client.exchange->keeps_connection();
    client.end_exchange();
    grant_memory();
    if (!keep) {
      // Closing with unread bytes would reset the connection and take the response with it: say
      // that no more will be sent, and drop what still comes for a moment.
      ::shutdown(client.connection.fd(), SHUT_WR);
      client.lingered_bytes = 0;
      return drop_input(client);
    }
    wait_for(client, client.connection.buffer().empty() ? State::kIdle : State::kQueued);
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

  void observe(const Client& client) {
    ExchangeRecord record = client.exchange->record();
    record.ms = std::chrono::duration<double, std::milli>(Clock::now() - client.started).count();
    observer_(record);
  }

  const int port_;
  const HttpServerConfig config_;
  const Handler handler_;
  const Observer observer_;
  MemoryBudget responses_, bodies_;  // before the clients, whose exchanges hold bytes of them
  const Poller poller_;              // of the pool
  ActiveThreads active_;
  std::atomic<bool> stopping_{false};
  std::atomic<bool> is_disk_short_{false};  // as of the last tick
  std::atomic<int64_t> connections_{0}, running_{0}, waiting_{0};

  Mutex mutex_;
  ClientTable table_ GUARDED_BY(mutex_);
  std::deque<Client*> ready_ GUARDED_BY(mutex_);
  bool ended_ GUARDED_BY(mutex_) = false;

  std::unique_ptr<Housekeeping> housekeeping_;
  std::vector<std::thread> pool_;
};

}  // namespace

Result<std::unique_ptr<HttpServer>> start_http_server(const HttpServerConfig& config,
                                                      Handler handler, Observer observer) {
  VOXELD_ASSIGN(UniqueFd listener, listen_tcp(config.listen));
  return std::unique_ptr<HttpServer>(std::make_unique<EpollServer>(
      std::move(listener), config, std::move(handler), std::move(observer)));
}

}  // namespace voxeld::http
