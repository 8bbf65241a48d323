#include "server/http/client_table.h"

#include <arpa/inet.h>

#include <algorithm>

namespace voxeld::http {

std::string counted_as(std::string_view address) {
  in6_addr bytes{};
  // The name of its interface follows a link-local address.
  const std::string number(address.substr(0, address.find('%')));
  if (::inet_pton(AF_INET6, number.c_str(), &bytes) != 1) return std::string(address);
  std::fill(std::begin(bytes.s6_addr) + 8, std::end(bytes.s6_addr), uint8_t{0});
  char text[INET6_ADDRSTRLEN] = "";
  ::inet_ntop(AF_INET6, &bytes, text, sizeof text);
  return std::string(text) + "/64";
}

bool Client::takes_less_than(int64_t bytes_per_second, double grace_seconds,
                             Clock::time_point now) const {
  const auto taking = now - *exchange->responded() - paused;
  const double late = std::chrono::duration<double>(taking).count() - grace_seconds;
  return late > 0 &&
         static_cast<double>(exchange->sent()) < late * static_cast<double>(bytes_per_second);
}

bool Client::is_too_slow(const SendLimits& limits, bool is_disk_short) const {
  if (takes_less_than(limits.rate_min, limits.grace_seconds)) return true;
  return takes_less_than(limits.rate_min, limits.pressed_grace_seconds) &&
         exchange->keeps_room(is_disk_short);
}

void Client::end_exchange() {
  if (waker) waker->detach();
  waker.reset();
  exchange.reset();
}

Client& ClientTable::add(UniqueFd fd, std::string address, bool is_counted) {
  const int raw = fd.get();
  auto client = std::make_unique<Client>(std::move(fd), std::move(address));
  Client& added = *client;
  added.is_counted = is_counted;
  if (is_counted) ++by_address_[counted_as(added.connection.peer())];
  auto& list = lists_[index(added.state)];
  added.place = list.insert(list.end(), &added);
  by_fd_[raw] = std::move(client);
  return added;
}

Client* ClientTable::find(int fd) {
  const auto it = by_fd_.find(fd);
  return it == by_fd_.end() ? nullptr : it->second.get();
}

std::unique_ptr<Client> ClientTable::remove(Client& client) {
  lists_[index(client.state)].erase(client.place);
  drop_timer(client);
  count_in_flight(client, false);
  if (client.is_counted) {
    const auto counted = by_address_.find(counted_as(client.connection.peer()));
    if (--counted->second == 0) by_address_.erase(counted);
  }
  const auto it = by_fd_.find(client.connection.fd());
  std::unique_ptr<Client> removed = std::move(it->second);
  by_fd_.erase(it);
  return removed;
}

std::vector<std::unique_ptr<Client>> ClientTable::remove_all() {
  std::vector<std::unique_ptr<Client>> removed;
  while (!by_fd_.empty()) removed.push_back(remove(*by_fd_.begin()->second));
  return removed;
}

void ClientTable::set_state(Client& client, Client::State state) {
  auto& to = lists_[index(state)];
  to.splice(to.end(), lists_[index(client.state)], client.place);
  client.state = state;
  client.since = Clock::now();
  drop_timer(client);
  const bool has_begun = state != Client::State::kIdle && state != Client::State::kHead &&
                         state != Client::State::kLingering;
  const bool is_refused = client.exchange && client.exchange->is_refused();
  count_in_flight(client, has_begun && !is_refused);
}

void ClientTable::set_timer(Client& client, Clock::time_point at) {
  drop_timer(client);
  client.timer = timers_.emplace(at, &client);
}

void ClientTable::drop_timer(Client& client) {
  if (client.timer) timers_.erase(*client.timer);
  client.timer.reset();
}

void ClientTable::count_in_flight(Client& client, bool is_in_flight) {
  if (client.is_in_flight_ == is_in_flight) return;
  client.is_in_flight_ = is_in_flight;
  in_flight_ = is_in_flight ? in_flight_ + 1 : in_flight_ - 1;
}

int ClientTable::count_of(std::string_view address) const {
  const auto it = by_address_.find(counted_as(address));
  return it == by_address_.end() ? 0 : it->second;
}

Client* ClientTable::late(Client::State state, double seconds, Clock::time_point now) const {
  for (Client* client : lists_[index(state)]) {
    if (std::chrono::duration<double>(now - client->since).count() <= seconds) return nullptr;
    if (!client->is_taken) return client;
  }
  return nullptr;
}

Client* ClientTable::late_download(double seconds, bool is_disk_short,
                                   Clock::time_point now) const {
  for (Client* client : lists_[index(Client::State::kSending)]) {
    if (std::chrono::duration<double>(now - client->since).count() <= seconds) return nullptr;
    if (!client->is_taken && client->exchange->keeps_room(is_disk_short)) return client;
  }
  return nullptr;
}

}  // namespace voxeld::http
