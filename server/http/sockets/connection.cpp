#include "server/http/sockets/connection.h"

#include <poll.h>
#include <signal.h>
#include <sys/sendfile.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>

namespace voxeld::http {
namespace {

// An empty buffer that grew larger than this gives its memory back.
constexpr size_t kBufferKeptBytes = 4096;

}  // namespace

void Connection::shrink_buffer() {
  if (buffer_.empty() && buffer_.capacity() > kBufferKeptBytes) std::string().swap(buffer_);
}

Connection::ReadState Connection::receive_available(size_t bytes_max) {
  std::array<char, 65536> chunk;
  const size_t want = std::min(chunk.size(), bytes_max);
  for (;;) {
    const ssize_t got = ::recv(fd_.get(), chunk.data(), want, 0);
    if (got > 0) {
      buffer_.append(chunk.data(), static_cast<size_t>(got));
      return ReadState::kData;
    }
    if (got == 0) return ReadState::kClosed;
    if (errno == EINTR) continue;
    if (errno == EAGAIN || errno == EWOULDBLOCK) return ReadState::kNothing;
    broken_ = true;
    return ReadState::kClosed;
  }
}

int64_t Connection::send_some(std::string_view bytes) {
  while (true) {
    const ssize_t sent = ::send(fd_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent >= 0) return sent;
    if (errno == EAGAIN || errno == EWOULDBLOCK) return 0;
    if (errno == EINTR) continue;
    broken_ = true;
    return 0;
  }
}

int64_t Connection::send_file_some(int file, int64_t offset, int64_t bytes) {
  constexpr int64_t kStep = int64_t{1} << 20;
  off_t at = offset;
  while (true) {
    const ssize_t sent =
        ::sendfile(fd_.get(), file, &at, static_cast<size_t>(std::min(bytes, kStep)));
    if (sent > 0) return sent;
    if (sent < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return 0;
    if (sent < 0 && errno == EINTR) continue;
    broken_ = true;  // also where the file ends before it should
    return 0;
  }
}

void Connection::block_sigpipe() {
  sigset_t set;
  ::sigemptyset(&set);
  ::sigaddset(&set, SIGPIPE);
  ::pthread_sigmask(SIG_BLOCK, &set, nullptr);
}

bool Connection::peer_closed() const {
  if (broken_) return true;
  pollfd entry{fd_.get(), POLLRDHUP, 0};
  return ::poll(&entry, 1, 0) > 0;  // or POLLHUP, POLLERR
}

}  // namespace voxeld::http
