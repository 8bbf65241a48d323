#include "server/http/client_table.h"

#include <gtest/gtest.h>
#include <sys/eventfd.h>
#include <sys/socket.h>

#include <array>
#include <atomic>
#include <chrono>
#include <functional>
#include <list>
#include <memory>
#include <string>
#include <vector>

#include "server/http/client_address.h"
#include "server/http/message/head_parser.h"

namespace voxeld::http {
namespace {

UniqueFd some_fd() {
  return UniqueFd(::eventfd(0, EFD_CLOEXEC));
}

TEST(ClientTable, the_client_that_waits_longest_comes_first) {
  ClientTable table;
  Client& first = table.add(some_fd(), "10.0.0.1", true);
  Client& second = table.add(some_fd(), "10.0.0.1", true);
  EXPECT_EQ(table.clients(Client::State::kIdle).front(), &first);
  table.set_state(first, Client::State::kHead);
  EXPECT_EQ(table.clients(Client::State::kIdle).front(), &second);
  table.set_state(first, Client::State::kIdle);
  EXPECT_EQ(table.clients(Client::State::kIdle).front(), &second) << "the first one began anew";
  EXPECT_EQ(table.count(Client::State::kIdle), 2u);
  EXPECT_TRUE(table.clients(Client::State::kHead).empty());
}

TEST(ClientTable, a_client_in_a_state_for_longer_than_the_limit_is_late) {
  ClientTable table;
  Client& client = table.add(some_fd(), "10.0.0.1", true);
  const auto now = client.since;
  EXPECT_EQ(table.late(Client::State::kIdle, 5, now + std::chrono::seconds(5)), nullptr);
  EXPECT_EQ(table.late(Client::State::kIdle, 5, now + std::chrono::seconds(6)), &client);
}

TEST(ClientTable, a_taken_client_is_not_late_but_the_next_one_is) {
  ClientTable table;
  Client& first = table.add(some_fd(), "10.0.0.1", true);
  Client& second = table.add(some_fd(), "10.0.0.1", true);
  const auto later = second.since + std::chrono::seconds(6);
  first.is_taken = true;
  EXPECT_EQ(table.late(Client::State::kIdle, 5, later), &second);
  second.is_taken = true;
  EXPECT_EQ(table.late(Client::State::kIdle, 5, later), nullptr);
}

TEST(ClientTable, requests_that_have_begun_and_were_not_refused_are_in_flight) {
  ClientTable table;
  Client& client = table.add(some_fd(), "10.0.0.1", true);
  Client& refused = table.add(some_fd(), "10.0.0.1", true);
  const Handler handler;
  const std::function<void(const Request&, Response&)> add_headers;
  const std::vector<std::string> proxies;
  MemoryBudget budget;
  const std::atomic<bool> is_draining{true};
  refused.exchange = std::make_unique<Exchange>(
      Exchange::Context{handler, add_headers, proxies, budget, budget, is_draining},
      refused.connection, parse_head("POST / HTTP/1.1\r\nHost: h\r\n\r\n"), /*is_refused=*/true,
      nullptr, nullptr);
  for (const auto state : {Client::State::kHead, Client::State::kLingering}) {
    table.set_state(client, state);
    EXPECT_EQ(table.in_flight(), 0u);
  }
  for (const auto state :
       {Client::State::kQueued, Client::State::kRunning, Client::State::kBody,
        Client::State::kWaiting, Client::State::kHeld, Client::State::kSending}) {
    table.set_state(client, state);
    table.set_state(refused, state);
    EXPECT_EQ(table.in_flight(), 1u);
  }
  EXPECT_EQ(table.clients(Client::State::kSending), (std::list<Client*>{&client, &refused}));
  table.remove(client);
  EXPECT_EQ(table.in_flight(), 0u);
}

TEST(ClientTable, the_next_timer_is_the_earliest_and_ends_with_the_state) {
  ClientTable table;
  Client& first = table.add(some_fd(), "10.0.0.1", true);
  Client& second = table.add(some_fd(), "10.0.0.1", true);
  EXPECT_EQ(table.next_timer(), nullptr);
  const auto now = Clock::now();
  table.set_timer(first, now + std::chrono::seconds(2));
  table.set_timer(second, now + std::chrono::seconds(3));
  EXPECT_EQ(table.next_timer(), &first);
  table.set_timer(second, now + std::chrono::seconds(1));
  EXPECT_EQ(table.next_timer(), &second);
  table.set_state(second, Client::State::kRunning);
  EXPECT_EQ(table.next_timer(), &first);
  table.remove(first);
  EXPECT_EQ(table.next_timer(), nullptr);
}

// Is over when the test says so.
class ToldWait final : public Wait {
 public:
  explicit ToldWait(const bool& is_over) : is_over_(is_over) {}
  std::optional<Response> look(Request&) override {
    if (!is_over_) return std::nullopt;
    return Response::text(200, std::string(8'000'000, 'x'));  // more than a socket's buffer holds
  }
  Clock::time_point until() const override { return Clock::time_point::max(); }

 private:
  const bool& is_over_;
};

TEST(Client, its_rate_counts_from_the_begin_of_its_response_without_pauses) {
  using std::chrono::seconds;
  std::array<int, 2> fds{};
  ASSERT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, fds.data()), 0);
  const UniqueFd peer(fds[1]);
  bool is_over = false;
  const Handler handler = [&is_over](Request&) -> Reply {
    return std::unique_ptr<Wait>(std::make_unique<ToldWait>(is_over));
  };
  const std::function<void(const Request&, Response&)> add_headers;
  const std::vector<std::string> proxies;
  MemoryBudget budget;
  const std::atomic<bool> is_draining{false};
  Client client(UniqueFd{fds[0]}, "10.0.0.1");
  client.exchange = std::make_unique<Exchange>(
      Exchange::Context{handler, add_headers, proxies, budget, budget, is_draining},
      client.connection, parse_head("GET / HTTP/1.1\r\nHost: h\r\n\r\n"), /*is_refused=*/false,
      nullptr, nullptr);
  ASSERT_EQ(client.exchange->advance(), Exchange::Step::kWait);
  EXPECT_FALSE(client.exchange->responded());
  is_over = true;
  const auto woken = Clock::now();
  ASSERT_EQ(client.exchange->advance(), Exchange::Step::kSend) << "the other end reads nothing";
  ASSERT_TRUE(client.exchange->responded());
  const auto begun = *client.exchange->responded();
  EXPECT_GE(begun, woken) << "the time of the wait does not count";
  const int64_t sent = client.exchange->sent();
  EXPECT_GT(sent, 0);
  EXPECT_FALSE(client.takes_less_than(sent + 1, 60, begun + seconds(60)));
  EXPECT_TRUE(client.takes_less_than(sent + 1, 60, begun + seconds(61)));
  EXPECT_FALSE(client.takes_less_than(sent, 60, begun + seconds(61)));
  EXPECT_TRUE(client.takes_less_than(sent, 60, begun + seconds(62)));
  client.paused = seconds(9);
  EXPECT_FALSE(client.takes_less_than(sent, 60, begun + seconds(70)));
  EXPECT_TRUE(client.takes_less_than(sent, 60, begun + seconds(71)));
}

TEST(ClientTable, addresses_are_counted_while_their_connections_are_there) {
  ClientTable table;
  Client& first = table.add(some_fd(), "10.0.0.1", true);
  const int fd = first.connection.fd();
  table.add(some_fd(), "10.0.0.1", true);
  table.add(some_fd(), "10.0.0.1", false);
  EXPECT_EQ(table.count_of("10.0.0.1"), 2);
  EXPECT_EQ(table.count_of("10.0.0.2"), 0);
  EXPECT_EQ(table.find(fd), &first);
  table.remove(first);
  EXPECT_EQ(table.find(fd), nullptr);
  EXPECT_EQ(table.count_of("10.0.0.1"), 1);
  EXPECT_EQ(table.size(), 2u);
}

// The address that is told of a request with these lines, from 10.0.0.9.
std::string address_of(const std::string& lines, const std::vector<std::string>& trusted) {
  Head head = parse_head("GET / HTTP/1.1\r\nHost: h\r\n" + lines + "\r\n").value();
  const std::string address = take_client_address(head, "10.0.0.9", trusted);
  EXPECT_EQ(head.headers.size(), 1u) << "nothing of what was forwarded is left";
  return address;
}

TEST(CountedAs, takes_the_first_64_bits_of_an_ipv6_address_and_all_of_an_ipv4_one) {
  EXPECT_EQ(counted_as("192.0.2.1"), "192.0.2.1");
  EXPECT_EQ(counted_as("2001:db8:0:1::1"), "2001:db8:0:1::/64");
  EXPECT_EQ(counted_as("2001:db8:0:1:ffff:2:3:4"), "2001:db8:0:1::/64");
  EXPECT_EQ(counted_as("2001:db8:0:2::1"), "2001:db8:0:2::/64");
  EXPECT_EQ(counted_as("fe80::1%lo"), "fe80::/64");
  EXPECT_EQ(counted_as("?"), "?");
}

TEST(ClientAddress, is_the_peers_whatever_strangers_say) {
  EXPECT_EQ(address_of(
                "X-Forwarded-For: 6.6.6.6\r\nX-Real-IP: 6.6.6.6\r\nForwarded: for=6.6.6.6\r\n", {}),
            "10.0.0.9");
  EXPECT_EQ(address_of("X-Forwarded-For: 6.6.6.6\r\n", {"10.0.0.8"}), "10.0.0.9");
}

TEST(ClientAddress, is_the_last_one_that_no_trusted_proxy_has) {
  const std::vector<std::string> trusted = {"10.0.0.9", "10.0.0.8"};
  EXPECT_EQ(address_of("", trusted), "10.0.0.9");
  EXPECT_EQ(address_of("X-Forwarded-For: 6.6.6.6, 7.7.7.7\r\n", trusted), "7.7.7.7");
  EXPECT_EQ(address_of("X-Forwarded-For: 6.6.6.6, 7.7.7.7, 10.0.0.8\r\n", trusted), "7.7.7.7");
  EXPECT_EQ(address_of("X-Forwarded-For: 6.6.6.6\r\nX-Forwarded-For: ::1\r\n", trusted), "::1");
  EXPECT_EQ(address_of("X-Forwarded-For: 6.6.6.6, somewhere else\r\n", trusted), "10.0.0.9");
}

}  // namespace
}  // namespace voxeld::http
