#include "server/http/sockets/poller.h"

#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <unistd.h>

namespace voxeld::http {

EventFd::EventFd(int flags) : fd_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK | flags)) {}

void EventFd::signal() const {
  const uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = ::write(fd_.get(), &one, sizeof one);
}

bool EventFd::take() const {
  uint64_t value = 0;
  return ::read(fd_.get(), &value, sizeof value) == sizeof value;
}

Poller::Poller() : epoll_(::epoll_create1(EPOLL_CLOEXEC)), ready_(EFD_SEMAPHORE) {
  control(EPOLL_CTL_ADD, ready_.fd(), EPOLLIN | EPOLLONESHOT);
  control(EPOLL_CTL_ADD, end_.fd(), EPOLLIN);  // never taken: all threads see it
}

void Poller::control(int operation, int fd, uint32_t events) const {
  epoll_event event{};
  event.events = events;
  event.data.fd = fd;
  ::epoll_ctl(epoll_.get(), operation, fd, &event);
}

void Poller::add(int socket, uint32_t events) const {
  control(EPOLL_CTL_ADD, socket, events | EPOLLONESHOT);
}

void Poller::arm(int socket, uint32_t events) const {
  control(EPOLL_CTL_MOD, socket, events | EPOLLONESHOT);
}

int Poller::wait() const {
  while (true) {
    epoll_event event{};
    if (::epoll_wait(epoll_.get(), &event, 1, -1) != 1) continue;
    if (event.data.fd == end_.fd()) return kEnded;
    if (event.data.fd != ready_.fd()) return event.data.fd;
    const bool is_taken = ready_.take();
    control(EPOLL_CTL_MOD, ready_.fd(), EPOLLIN | EPOLLONESHOT);  // reports again if more are left
    if (is_taken) return kReady;
  }
}

}  // namespace voxeld::http
