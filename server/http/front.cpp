#include "server/http/front.h"

#include <arpa/inet.h>
#include <netdb.h>
#include <netinet/tcp.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <deque>
#include <random>
#include <thread>
#include <unordered_map>
#include <vector>

#include "server/base/thread_annotations.h"
#include "server/http/body_reader.h"
#include "server/http/exchange.h"
#include "server/http/head_parser.h"

namespace voxeld::http {
namespace {

constexpr size_t kReadStep = 65536;

Error listen_error(const std::string& address) {
  return {ErrorCode::kInternal, address + ": " + std::strerror(errno), "", ""};
}

// SO_REUSEADDR alone: with SO_REUSEPORT a second daemon would take half of the connections.
Result<UniqueFd> listen_tcp(const std::string& address) {
  const size_t colon = address.rfind(':');
  if (colon == std::string::npos) {
    return Error{ErrorCode::kInvalidOption, "listen address", "HOST:PORT", "\"" + address + "\""};
  }
  std::string host = address.substr(0, colon);
  if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
  addrinfo hints{};
  hints.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  const int status = ::getaddrinfo(host.c_str(), address.substr(colon + 1).c_str(), &hints, &found);
  if (status != 0) {
    return Error{ErrorCode::kInvalidOption, "listen address " + address, "HOST:PORT",
                 ::gai_strerror(status)};
  }
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> owner(found, ::freeaddrinfo);
  UniqueFd fd(::socket(found->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  const int on = 1;
  if (!fd.valid() || ::setsockopt(fd.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) != 0 ||
      ::bind(fd.get(), found->ai_addr, found->ai_addrlen) != 0 ||
      ::listen(fd.get(), kBacklog) != 0) {
    return listen_error(address);
  }
  return fd;
}

int port_of(int fd) {
  sockaddr_storage address{};
  socklen_t size = sizeof address;
  ::getsockname(fd, reinterpret_cast<sockaddr*>(&address), &size);
  return ntohs(address.ss_family == AF_INET6 ? reinterpret_cast<sockaddr_in6*>(&address)->sin6_port
                                             : reinterpret_cast<sockaddr_in*>(&address)->sin_port);
}

std::string new_request_id() {
  thread_local std::mt19937_64 random{std::random_device{}()};
  char text[20];
  std::snprintf(text, sizeof text, "r-%016llx", static_cast<unsigned long long>(random()));
  return text;
}

bool is_plain_id(std::string_view id) {
  return !id.empty() && id.size() <= 64 &&
         id.find_first_not_of(
             "abcdefghijklmnopqrstuvwxyz"
             "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
             "0123456789-_.") == id.npos;
}

using ConnectionPtr = std::unique_ptr<Connection>;

class EpollFront final : public Front {
 public:
  EpollFront(UniqueFd listener, const FrontConfig& config, Handler handler, Observer observer)
      : listener_(std::move(listener)),
        port_(port_of(listener_.get())),
        config_(config),
        handler_(std::move(handler)),
        observer_(std::move(observer)),
        epoll_(::epoll_create1(EPOLL_CLOEXEC)),
        wake_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
    watch(listener_.get());
    watch(wake_.get());
    poller_ = std::thread([this] { poll_loop(); });
    for (int i = 0; i < config.threads; ++i) pool_.emplace_back([this] { pool_loop(); });
  }
  ~EpollFront() override { stop(0); }

  int port() const override { return port_; }
  FrontState state() const override { return {connections_.load(), running_.load()}; }

  void stop(double seconds) override {
    if (stopping_.exchange(true)) return;
    notify();
    const auto deadline = Clock::now() + std::chrono::duration<double>(seconds);
    while (is_busy() && Clock::now() < deadline) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
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
    const MutexLock lock(mutex_);
    queue_.clear();
    returned_.clear();
    idle_.clear();
    connections_ = 0;
  }

 private:
  void watch(int fd) {
    epoll_event event{};
    event.events = EPOLLIN;
    event.data.fd = fd;
    ::epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, fd, &event);
  }

  // Whether a request runs or waits for a thread.
  bool is_busy() {
    const MutexLock lock(mutex_);
    return !queue_.empty() || !running_fds_.empty();
  }

  void notify() {
    const uint64_t one = 1;
    [[maybe_unused]] const ssize_t written = ::write(wake_.get(), &one, sizeof one);
  }

  // --- the poller's thread

  void poll_loop() {
    bool accepting = true;
    for (;;) {
      epoll_event events[64];
      const int count = ::epoll_wait(epoll_.get(), events, 64, 1000);
      if (stopping_ && accepting) {
        listener_.reset();
        accepting = false;
        idle_.clear();
      }
      for (int i = 0; i < count; ++i) {
        const int fd = events[i].data.fd;
        if (fd == wake_.get()) {
          uint64_t value = 0;
          [[maybe_unused]] const ssize_t got = ::read(wake_.get(), &value, sizeof value);
        } else if (accepting && fd == listener_.get()) {
          accept_all();
        } else {
          receive(fd);
        }
      }
      take_returned();
      if (has_ended()) return;
      drop_late();
    }
  }

  bool has_ended() {
    const MutexLock lock(mutex_);
    return ended_;
  }

  void accept_all() {
    for (;;) {
      sockaddr_storage address{};
      socklen_t size = sizeof address;
      UniqueFd fd(::accept4(listener_.get(), reinterpret_cast<sockaddr*>(&address), &size,
                            SOCK_NONBLOCK | SOCK_CLOEXEC));
      if (!fd.valid()) {
        // Out of descriptors: leave the rest in the backlog for a moment instead of spinning.
        if (errno == EMFILE || errno == ENFILE) {
          std::this_thread::sleep_for(std::chrono::milliseconds(20));
        }
        return;
      }
      if (connections_.load() >= config_.connections_max) continue;  // closed at once
      const int on = 1;
      ::setsockopt(fd.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
      char host[INET6_ADDRSTRLEN] = "?";
      ::getnameinfo(reinterpret_cast<sockaddr*>(&address), size, host, sizeof host, nullptr, 0,
                    NI_NUMERICHOST);
      auto connection = std::make_unique<Connection>(std::move(fd), host);
      const int raw = connection->fd();
      ++connections_;
      idle_[raw] = std::move(connection);
      watch(raw);
    }
  }

  void drop(int fd) {
    idle_.erase(fd);  // closing takes it out of epoll
    --connections_;
  }

  void receive(int fd) {
    const auto it = idle_.find(fd);
    if (it == idle_.end()) return;
    Connection& connection = *it->second;
    if (connection.buffer().empty()) connection.idle_since = Clock::now();
    if (connection.receive_available(kReadStep) == Connection::ReadState::kClosed) {
      drop(fd);
      return;
    }
    dispatch_if_complete(fd);
  }

  // Hands the connection to the pool when its buffer holds a whole head (or too much for one).
  void dispatch_if_complete(int fd) {
    const auto it = idle_.find(fd);
    if (it == idle_.end()) return;
    const std::string& buffer = it->second->buffer();
    if (buffer.find("\r\n\r\n") == std::string::npos && buffer.size() <= kHeadBytesMax &&
        buffer.find("\n\n") == std::string::npos) {
      return;
    }
    ::epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, fd, nullptr);
    {
      const MutexLock lock(mutex_);
      queue_.push_back(std::move(it->second));
    }
    idle_.erase(it);
    ready_.notify_one();
  }

  void take_returned() {
    std::vector<ConnectionPtr> returned;
    {
      const MutexLock lock(mutex_);
      returned.swap(returned_);
    }
    for (ConnectionPtr& connection : returned) {
      if (connection == nullptr || stopping_) {
        --connections_;
        continue;
      }
      const int fd = connection->fd();
      connection->idle_since = Clock::now();
      idle_[fd] = std::move(connection);
      watch(fd);
      dispatch_if_complete(fd);  // a pipelined request is there already
    }
  }

  void drop_late() {
    std::vector<int> late;
    for (const auto& [fd, connection] : idle_) {
      const int seconds = connection->buffer().empty() ? kIdleSecondsMax : kHeadSecondsMax;
      if (Clock::now() - connection->idle_since > std::chrono::seconds(seconds)) late.push_back(fd);
    }
    for (const int fd : late) drop(fd);
  }

  // --- the pool's threads

  void pool_loop() {
    for (;;) {
      ConnectionPtr connection;
      {
        MutexLock lock(mutex_);
        while (queue_.empty() && !ended_) ready_.wait(lock);
        if (ended_) return;
        connection = std::move(queue_.front());
        queue_.pop_front();
        running_fds_.push_back(connection->fd());
      }
      const int fd = connection->fd();
      ++running_;
      const bool keep = serve(*connection) && !stopping_;
      --running_;
      {
        const MutexLock lock(mutex_);
        std::erase(running_fds_, fd);
        returned_.push_back(keep ? std::move(connection) : nullptr);
      }
      notify();
    }
  }

  // One exchange; true when the connection can serve another.
  bool serve(Connection& connection) {
    const auto start = Clock::now();
    const size_t end = connection.buffer().find("\r\n\r\n");
    Head head;
    ExchangeRecord record;
    record.head = &head;
    record.peer = connection.peer();
    Response response;
    bool keep = false;
    if (end == std::string::npos || end + 4 > kHeadBytesMax) {
      const bool is_long = connection.buffer().size() > kHeadBytesMax;
      response = Response::problem({ErrorCode::kBadRequest,
                                    is_long ? "the head of the request is too long"
                                            : "bare line feed in the head of the request",
                                    is_long ? "at most " + std::to_string(kHeadBytesMax) + " bytes"
                                            : "lines that end in CRLF",
                                    ""},
                                   "");
    } else {
      auto parsed = parse_head(std::string_view(connection.buffer()).substr(0, end + 4));
      connection.buffer().erase(0, end + 4);
      if (!parsed) {
        response = Response::problem(parsed.error(), "");
      } else {
        head = std::move(parsed).value();
        keep = answer(connection, head, response, record);
      }
    }
    if (record.request_id.empty()) record.request_id = new_request_id();
    response.headers["X-Request-Id"] = record.request_id;
    response.headers["X-Content-Type-Options"] = "nosniff";
    keep =
        keep && !response.close && !stopping_ && !std::holds_alternative<StreamBody>(response.body);
    record.status = response.status;
    record.bytes_out = send_response(connection, head, response, keep);
    record.ms = std::chrono::duration<double, std::milli>(Clock::now() - start).count();
    observer_(record);
    if (!keep) linger(connection);
    return keep && !connection.broken();
  }

  // Runs the handler. False when the request's body was not read to its end.
  bool answer(Connection& connection, const Head& head, Response& response,
              ExchangeRecord& record) {
    BodyReader body(connection, head);
    Request request;
    request.head = head;
    request.body = &body;
    request.client_gone = [&] { return connection.peer_closed(); };
    const std::string_view given = head.header("X-Request-Id");
    request.request_id = is_plain_id(given) ? std::string(given) : new_request_id();
    record.request_id = request.request_id;
    const auto parent = parse_traceparent(head.header("traceparent"));
    request.trace = parent ? child_span(*parent) : new_trace();
    record.trace_id = request.trace.trace_id;
    try {
      response = handler_(request);
    } catch (const std::exception& e) {
      // Out of memory and the like: one answer fails, the daemon goes on.
      response = Response::problem({ErrorCode::kInternal, e.what(), "", ""}, head.path,
                                   request.trace.trace_id);
    }
    response.headers["traceresponse"] = traceparent_text(request.trace);
    record.bytes_in = body.bytes_read();
    record.key_id = request.key_id;
    if (!request.key_id.empty()) record.tenant = request.caller.tenant();
    return body.finished() && head.keep_alive();
  }

  // Closing with unread bytes would reset the connection and take the answer with it: say that no
  // more will be sent, and drop what still comes for a moment.
  static void linger(Connection& connection) {
    ::shutdown(connection.fd(), SHUT_WR);
    const auto deadline = Clock::now() + std::chrono::seconds(2);
    for (int64_t dropped = 0; dropped < (int64_t{64} << 20); dropped += kReadStep) {
      connection.buffer().clear();
      if (connection.broken() || !connection.receive_more(deadline, kReadStep)) return;
    }
  }

  UniqueFd listener_;
  const int port_;
  const FrontConfig config_;
  const Handler handler_;
  const Observer observer_;
  const UniqueFd epoll_, wake_;
  std::atomic<bool> stopping_{false};
  std::atomic<int64_t> connections_{0}, running_{0};

  std::unordered_map<int, ConnectionPtr> idle_;  // the poller's alone, until it has ended

  Mutex mutex_;
  CondVar ready_;
  std::deque<ConnectionPtr> queue_ GUARDED_BY(mutex_);
  std::vector<ConnectionPtr> returned_ GUARDED_BY(mutex_);  // null: closed
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
