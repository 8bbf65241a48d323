#include "server/process/frame_socket.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <ctime>

#include "server/base/clock.h"

namespace voxeld {
namespace {

Result<sockaddr_un> unix_address(const std::filesystem::path& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string& text = path.native();
  if (text.size() >= sizeof(address.sun_path)) {
    return Error{ErrorCode::kInternal, "Unix socket path is too long: " + text,
                 "at most " + std::to_string(sizeof(address.sun_path) - 1) + " bytes",
                 std::to_string(text.size())};
  }
  std::memcpy(address.sun_path, text.c_str(), text.size() + 1);
  return address;
}

Error connection_closed() {
  return {ErrorCode::kGone, "connection closed", "", ""};
}

// The time left for a frame. Without a limit, calls block.
class FrameTime {
 public:
  explicit FrameTime(double seconds_max) : seconds_max_(seconds_max) {}
  int flags() const { return seconds_max_ > 0 ? MSG_DONTWAIT : 0; }
  // Waits until the socket is ready. Returns false on timeout.
  bool wait(int fd, short events) const {
    const double left_ms = seconds_max_ * 1000.0 - watch_.ms();
    pollfd one{fd, events, 0};
    return left_ms > 0 && ::poll(&one, 1, static_cast<int>(std::ceil(left_ms))) != 0;
  }
  std::string limit_text() const {
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), "%g s", seconds_max_);
    return text.data();
  }

 private:
  const double seconds_max_;
  const Stopwatch watch_;
};

bool would_block() {
  return errno == EAGAIN || errno == EWOULDBLOCK;
}

// Reads up to `count` available bytes; 0 at the end of the stream.
Result<size_t> read_some(int fd, char* out, size_t count, int flags) {
  while (true) {
    const ssize_t got = ::recv(fd, out, count, flags);
    if (got >= 0) return static_cast<size_t>(got);
    if (errno == EINTR) continue;
    if (would_block()) {
      return Error{ErrorCode::kDeadlineExceeded, "no task message within the time limit", "", ""};
    }
    if (errno == ECONNRESET) return size_t{0};  // the peer died before it read our message
    return errno_error("receive from", "task socket");
  }
}

// Reads until `done` is `count` or the stream ends. Returns false on timeout.
Result<bool> read_rest(int fd, char* out, size_t count, const FrameTime& time, size_t& done) {
  while (done < count) {
    const auto got = read_some(fd, out + done, count - done, time.flags());
    if (!got && got.error().code == ErrorCode::kDeadlineExceeded && time.flags() != 0) {
      if (!time.wait(fd, POLLIN)) return false;
      continue;
    }
    if (!got) return got.error();
    if (*got == 0) break;
    done += *got;
  }
  return true;
}

Status send_exactly(int fd, const char* data, size_t count, const FrameTime& time) {
  const size_t total = count;
  while (count > 0) {
    const ssize_t sent = ::send(fd, data, count, MSG_NOSIGNAL | time.flags());
    if (sent < 0) {
      if (errno == EINTR) continue;
      if (errno == EPIPE || errno == ECONNRESET) return connection_closed();
      if (!would_block()) return errno_error("send to", "task socket");
      if (time.wait(fd, POLLOUT)) continue;
      return Error{ErrorCode::kBadRequest, "task messages are not read",
                   std::to_string(total) + " bytes to be taken within " + time.limit_text(),
                   std::to_string(total - count)};
    }
    data += sent;
    count -= static_cast<size_t>(sent);
  }
  return {};
}

}  // namespace

Result<UniqueFd> listen_unix(const std::filesystem::path& path) {
  VOXELD_ASSIGN(const sockaddr_un address, unix_address(path));
  UniqueFd fd(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  if (!fd.valid()) return errno_error("create", "task socket");
  ::unlink(path.c_str());
  if (::bind(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    return errno_error("bind", path);
  }
  if (::chmod(path.c_str(), 0600) != 0) return errno_error("chmod", path);
  if (::listen(fd.get(), 64) != 0) return errno_error("listen on", path);
  return fd;
}

Result<UniqueFd> connect_unix(const std::filesystem::path& path) {
  VOXELD_ASSIGN(const sockaddr_un address, unix_address(path));
  UniqueFd fd(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  if (!fd.valid()) return errno_error("create", "task socket");
  if (::connect(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    return errno_error("connect to", path);
  }
  return fd;
}

Status FrameSocket::set_receive_timeout(double seconds) {
  timeval limit{};
  limit.tv_sec = static_cast<time_t>(seconds);
  limit.tv_usec = static_cast<suseconds_t>((seconds - static_cast<double>(limit.tv_sec)) * 1e6);
  if (::setsockopt(fd_.get(), SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit) != 0) {
    return errno_error("set the time limit of", "task socket");
  }
  return {};
}

bool FrameSocket::peer_closed() const {
  char byte = 0;
  const ssize_t got = ::recv(fd_.get(), &byte, 1, MSG_PEEK | MSG_DONTWAIT);
  return got == 0 || (got < 0 && errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR);
}

void FrameSocket::shutdown() {
  ::shutdown(fd_.get(), SHUT_RDWR);
}

Status FrameSocket::send(std::string_view payload) {
  if (payload.size() > send_bytes_max_) {
    return Error{ErrorCode::kInternal, "task message is too long",
                 "at most " + std::to_string(send_bytes_max_) + " bytes",
                 std::to_string(payload.size())};
  }
  const FrameTime time(frame_seconds_max_);
  const auto size = static_cast<uint32_t>(payload.size());
  std::array<char, 4> head{};
  for (int i = 0; i < 4; ++i) head[i] = static_cast<char>((size >> (8 * i)) & 0xff);
  VOXELD_TRY(send_exactly(fd_.get(), head.data(), head.size(), time));
  return send_exactly(fd_.get(), payload.data(), payload.size(), time);
}

Result<std::string> FrameSocket::receive() {
  std::array<char, 4> head{};
  VOXELD_ASSIGN(size_t done, read_some(fd_.get(), head.data(), head.size(), 0));
  if (done == 0) return connection_closed();
  const FrameTime time(frame_seconds_max_);
  const auto late = [&](size_t bytes) {
    return Error{ErrorCode::kBadRequest, "task message takes too long",
                 "its " + std::to_string(bytes) + " bytes within " + time.limit_text(),
                 std::to_string(done)};
  };
  VOXELD_ASSIGN(bool in_time, read_rest(fd_.get(), head.data(), head.size(), time, done));
  if (!in_time) return late(head.size());
  uint32_t size = 0;
  for (int i = 0; i < 4; ++i)
    size |= static_cast<uint32_t>(static_cast<uint8_t>(head[i])) << (8 * i);
  if (done < head.size() || size > receive_bytes_max_) {
    return Error{ErrorCode::kBadRequest, "task message has a bad length",
                 "at most " + std::to_string(receive_bytes_max_), std::to_string(size)};
  }
  std::string payload(size, '\0');
  done = 0;
  VOXELD_ASSIGN(in_time, read_rest(fd_.get(), payload.data(), size, time, done));
  if (!in_time) return late(size);
  if (done < size) {
    return Error{ErrorCode::kGone, "connection closed inside a task message", "", ""};
  }
  return payload;
}

}  // namespace voxeld
