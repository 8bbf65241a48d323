#include "server/http/sockets/listener.h"

#include <gtest/gtest.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <string>
#include <vector>

#include "tests/unit/http/http_client.h"

namespace voxeld::http {
namespace {

using testing::comes_true;
using testing::HttpClient;

TEST(Listener, small_responses_do_not_wait_for_acknowledgements) {
  const UniqueFd listener = listen_tcp("127.0.0.1:0").value();
  const HttpClient client(port_of(listener.get()));
  Accepted accepted;
  ASSERT_TRUE(comes_true([&] {
    accepted = accept_one(listener.get());
    return accepted.fd.valid();
  }));
  int on = 0;
  socklen_t size = sizeof on;
  ASSERT_EQ(::getsockopt(accepted.fd.get(), IPPROTO_TCP, TCP_NODELAY, &on, &size), 0);
  EXPECT_NE(on, 0);
  EXPECT_EQ(accepted.address, "127.0.0.1");
  EXPECT_TRUE(accepted.is_loopback);
  EXPECT_FALSE(accept_one(listener.get()).fd.valid()) << "nobody else waits";
}

TEST(Listener, hundreds_connect_before_anybody_is_accepted) {
  const UniqueFd listener = listen_tcp("127.0.0.1:0").value();
  std::vector<HttpClient> clients;
  for (int i = 0; i < 200; ++i) {
    clients.emplace_back(port_of(listener.get()));
    ASSERT_TRUE(clients.back().is_open()) << i;
  }
}

TEST(Listener, a_port_has_one_listener) {
  const UniqueFd listener = listen_tcp("127.0.0.1:0").value();
  const auto second = listen_tcp("127.0.0.1:" + std::to_string(port_of(listener.get())));
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().message().find("Address already in use"), std::string::npos);
}

}  // namespace
}  // namespace voxeld::http
