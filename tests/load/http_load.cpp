// Clients of an HTTP server, by the thousand.
//
//   voxeld_http_load hold PORT IDLE SLOW
//     Opens IDLE connections that ask once and then keep still, and SLOW that send a head byte by
//     byte and come back when they are cut off. Prints "ready" when all are open; holds them until
//     stdin ends, then prints {"idle_open": …, "slow_cut": …}.
//   voxeld_http_load probe PORT PATH SECONDS [HEADER…]
//     Asks again and again, 100 times a second at most, on one connection as long as the server
//     leaves it open, and prints response times: {"count": …, "p50_ms": …, "p99_ms": …,
//     "max_ms": …}.
//   voxeld_http_load rate PORT PATH SECONDS CONNECTIONS [HEADER…]
//     Sends requests on so many connections, each after the last response; prints {"per_second": …,
//     "mb_per_second": …}.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/epoll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>
#include <vector>

#include "server/base/disk/file.h"

namespace {

using Clock = std::chrono::steady_clock;
using voxeld::UniqueFd;

constexpr int kResponseMs = 120'000;
constexpr std::string_view kSlowHead =
    "GET /livez HTTP/1.1\r\nHost: localhost\r\nX-Slow: "
    "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa";

[[noreturn]] void fail(const std::string& what) {
  std::fprintf(stderr, "http_load: %s: %s\n", what.c_str(),
               std::generic_category().message(errno).c_str());
  std::exit(1);
}

UniqueFd connect_to(int port) {
  UniqueFd fd(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (!fd.valid() ||
      ::connect(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    fail("connect");
  }
  const int on = 1;
  ::setsockopt(fd.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  return fd;
}

std::string request_for(const std::string& path, std::span<char* const> headers) {
  std::string text = "GET " + path + " HTTP/1.1\r\nHost: localhost\r\n";
  for (const char* header : headers) text += std::string(header) + "\r\n";
  return text + "\r\n";
}

void send_all(int fd, std::string_view text) {
  while (!text.empty()) {
    const ssize_t sent = ::send(fd, text.data(), text.size(), MSG_NOSIGNAL);
    if (sent <= 0) fail("send");
    text.remove_prefix(static_cast<size_t>(sent));
  }
}

// Parses a response as far as needed to find its end.
class ResponseReader {
 public:
  // More of it came; true when it is whole.
  bool take(std::string_view bytes) {
    if (left_ < 0) {
      head_ += bytes;
      const size_t end = head_.find("\r\n\r\n");
      if (end == std::string::npos) return false;
      if (!head_.starts_with("HTTP/1.1 2")) {
        std::fprintf(stderr, "http_load: response %s\n", head_.substr(0, 400).c_str());
        std::exit(1);
      }
      const size_t length = head_.find("Content-Length: ");
      left_ = length > end ? 0 : std::atoll(head_.c_str() + length + 16);
      bytes_ += left_;
      closes_ = head_.rfind("Connection: close", end) != std::string::npos;
      left_ -= static_cast<int64_t>(head_.size() - end - 4);
    } else {
      left_ -= static_cast<int64_t>(bytes.size());
    }
    if (left_ > 0) return false;
    left_ = -1;
    head_.clear();
    return true;
  }
  int64_t bytes() const { return bytes_; }  // of all bodies
  bool closes() const { return closes_; }   // the server closes the connection after the last one

 private:
  std::string head_;
  int64_t left_ = -1, bytes_ = 0;
  bool closes_ = false;
};

void read_response(int fd, ResponseReader& reader) {
  static std::array<char, 1 << 18> buffer;
  while (true) {
    pollfd entry{fd, POLLIN, 0};
    if (::poll(&entry, 1, kResponseMs) != 1) fail("no response");
    const ssize_t got = ::recv(fd, buffer.data(), buffer.size(), 0);
    if (got <= 0) fail("recv");
    if (reader.take({buffer.data(), static_cast<size_t>(got)})) return;
  }
}

struct SlowClient {
  UniqueFd fd;
  size_t sent = 0;
};

// One more byte of each; those that the server cut off come back.
int64_t advance_slow(int port, std::vector<SlowClient>& clients) {
  int64_t cut = 0;
  for (SlowClient& client : clients) {
    char byte = 0;
    const ssize_t got = ::recv(client.fd.get(), &byte, 1, MSG_DONTWAIT);
    const bool closed = got == 0 || (got < 0 && errno != EAGAIN && errno != EWOULDBLOCK);
    if (closed ||
        ::send(client.fd.get(), &kSlowHead[client.sent % kSlowHead.size()], 1, MSG_NOSIGNAL) != 1) {
      client = {connect_to(port), 0};
      ++cut;
      continue;
    }
    client.sent = std::min(client.sent + 1, kSlowHead.size() - 1);
  }
  return cut;
}

int hold(int port, int idle_count, int slow_count) {
  std::vector<UniqueFd> idle;
  const std::string request = request_for("/", {});
  for (int i = 0; i < idle_count; ++i) {
    idle.push_back(connect_to(port));
    send_all(idle.back().get(), request);
    ResponseReader reader;
    read_response(idle.back().get(), reader);
  }
  std::vector<SlowClient> slow(static_cast<size_t>(slow_count));
  for (SlowClient& client : slow) client.fd = connect_to(port);
  std::printf("ready\n");
  std::fflush(stdout);
  int64_t cut = 0;
  while (true) {
    cut += advance_slow(port, slow);
    pollfd input{STDIN_FILENO, POLLIN, 0};
    if (::poll(&input, 1, 1000) == 1) break;
  }
  int64_t open = 0;
  for (const UniqueFd& fd : idle) {
    char byte = 0;
    const ssize_t got = ::recv(fd.get(), &byte, 1, MSG_DONTWAIT);
    open += got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK) ? 1 : 0;
  }
  std::printf("{\"idle_open\": %lld, \"slow_cut\": %lld}\n", static_cast<long long>(open),
              static_cast<long long>(cut));
  return 0;
}

int probe(int port, const std::string& request, double seconds) {
  UniqueFd fd;
  std::vector<double> took_ms;
  ResponseReader reader;
  const auto end = Clock::now() + std::chrono::duration<double>(seconds);
  while (Clock::now() < end) {
    const auto start = Clock::now();
    if (!fd.valid()) fd = connect_to(port);
    send_all(fd.get(), request);
    read_response(fd.get(), reader);
    if (reader.closes()) fd.reset();
    took_ms.push_back(std::chrono::duration<double, std::milli>(Clock::now() - start).count());
    std::this_thread::sleep_until(start + std::chrono::milliseconds(10));
  }
  std::ranges::sort(took_ms);
  const auto at = [&](size_t percent) { return took_ms[(took_ms.size() - 1) * percent / 100]; };
  std::printf("{\"count\": %zu, \"p50_ms\": %.3f, \"p99_ms\": %.3f, \"max_ms\": %.3f}\n",
              took_ms.size(), at(50), at(99), took_ms.back());
  return 0;
}

int rate(int port, const std::string& request, double seconds, int connections) {
  const UniqueFd epoll(::epoll_create1(EPOLL_CLOEXEC));
  std::vector<UniqueFd> clients;
  std::vector<ResponseReader> readers(static_cast<size_t>(connections));
  for (int i = 0; i < connections; ++i) {
    clients.push_back(connect_to(port));
    epoll_event event{};
    event.events = EPOLLIN;
    event.data.u32 = static_cast<uint32_t>(i);
    ::epoll_ctl(epoll.get(), EPOLL_CTL_ADD, clients.back().get(), &event);
    send_all(clients.back().get(), request);
  }
  static std::array<char, 1 << 18> buffer;
  std::array<epoll_event, 256> events{};
  int64_t responses = 0;
  const auto start = Clock::now(), end = start + std::chrono::duration_cast<Clock::duration>(
                                                     std::chrono::duration<double>(seconds));
  while (Clock::now() < end) {
    const int count = ::epoll_wait(epoll.get(), events.data(), events.size(), 1000);
    for (int i = 0; i < count; ++i) {
      const uint32_t client = events[static_cast<size_t>(i)].data.u32;
      const ssize_t got = ::recv(clients[client].get(), buffer.data(), buffer.size(), 0);
      if (got <= 0) fail("recv");
      if (!readers[client].take({buffer.data(), static_cast<size_t>(got)})) continue;
      ++responses;
      send_all(clients[client].get(), request);
    }
  }
  const double took = std::chrono::duration<double>(Clock::now() - start).count();
  int64_t bytes = 0;
  for (const ResponseReader& reader : readers) bytes += reader.bytes();
  std::printf("{\"per_second\": %.1f, \"mb_per_second\": %.1f}\n",
              static_cast<double>(responses) / took, static_cast<double>(bytes) / took / 1e6);
  return 0;
}

void raise_descriptor_limit() {
  rlimit limit{};
  ::getrlimit(RLIMIT_NOFILE, &limit);
  limit.rlim_cur = limit.rlim_max;
  ::setrlimit(RLIMIT_NOFILE, &limit);
}

}  // namespace

int main(int argc, char** argv) {
  const std::span<char* const> words(argv, static_cast<size_t>(argc));
  const std::string_view mode = words.size() > 1 ? words[1] : "";
  raise_descriptor_limit();
  if (mode == "hold" && words.size() == 5) {
    return hold(std::atoi(words[2]), std::atoi(words[3]), std::atoi(words[4]));
  }
  if (mode == "probe" && words.size() >= 5) {
    return probe(std::atoi(words[2]), request_for(words[3], words.subspan(5)), std::atof(words[4]));
  }
  if (mode == "rate" && words.size() >= 6) {
    return rate(std::atoi(words[2]), request_for(words[3], words.subspan(6)), std::atof(words[4]),
                std::atoi(words[5]));
  }
  std::fprintf(stderr, "http_load hold | probe | rate PORT …, as its source says\n");
  return 64;
}
