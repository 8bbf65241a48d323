#include "server/base/frame_socket.h"

#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

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

// Reads exactly `count` bytes. Returns how many came before the end of the stream.
Result<size_t> read_exactly(int fd, char* out, size_t count) {
  size_t done = 0;
  while (done < count) {
    const ssize_t got = ::recv(fd, out + done, count - done, 0);
    if (got < 0) {
      if (errno == EINTR) continue;
      if (errno == EAGAIN || errno == EWOULDBLOCK) {
        return Error{ErrorCode::kDeadlineExceeded, "no task message within the time limit", "", ""};
      }
      if (errno == ECONNRESET) break;  // the peer died with our message unread
      return errno_error("receive from", "task socket");
    }
    if (got == 0) break;
    done += static_cast<size_t>(got);
  }
  return done;
}

Status send_exactly(int fd, const char* data, size_t count) {
  while (count > 0) {
    const ssize_t sent = ::send(fd, data, count, MSG_NOSIGNAL);
    if (sent < 0) {
      if (errno == EINTR) continue;
      if (errno == EPIPE || errno == ECONNRESET) return connection_closed();
      return errno_error("send to", "task socket");
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
  if (payload.size() > frame_bytes_max_) {
    return Error{ErrorCode::kInternal, "task message is too long",
                 "at most " + std::to_string(frame_bytes_max_) + " bytes",
                 std::to_string(payload.size())};
  }
  const auto size = static_cast<uint32_t>(payload.size());
  std::array<char, 4> head{};
  for (int i = 0; i < 4; ++i) head[i] = static_cast<char>((size >> (8 * i)) & 0xff);
  VOXELD_TRY(send_exactly(fd_.get(), head.data(), head.size()));
  return send_exactly(fd_.get(), payload.data(), payload.size());
}

Result<std::string> FrameSocket::receive() {
  std::array<char, 4> head{};
  VOXELD_ASSIGN(const size_t head_bytes, read_exactly(fd_.get(), head.data(), head.size()));
  if (head_bytes == 0) return connection_closed();
  uint32_t size = 0;
  for (int i = 0; i < 4; ++i)
    size |= static_cast<uint32_t>(static_cast<uint8_t>(head[i])) << (8 * i);
  if (head_bytes < head.size() || size > frame_bytes_max_) {
    return Error{ErrorCode::kBadRequest, "task message has a bad length",
                 "at most " + std::to_string(frame_bytes_max_), std::to_string(size)};
  }
  std::string payload(size, '\0');
  VOXELD_ASSIGN(const size_t got, read_exactly(fd_.get(), payload.data(), size));
  if (got < size) return Error{ErrorCode::kGone, "connection closed inside a task message", "", ""};
  return payload;
}

}  // namespace voxeld
