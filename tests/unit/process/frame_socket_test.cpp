#include "server/process/frame_socket.h"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <string>
#include <thread>
#include <utility>

#include "tests/unit/base/temporary_dir.h"

namespace voxeld {
namespace {

std::pair<UniqueFd, UniqueFd> socket_pair() {
  std::array<int, 2> fds{};
  EXPECT_EQ(::socketpair(AF_UNIX, SOCK_STREAM, 0, fds.data()), 0);
  return {UniqueFd(fds[0]), UniqueFd(fds[1])};
}

TEST(FrameSocket, frames_arrive_whole_and_in_order) {
  auto [a, b] = socket_pair();
  FrameSocket left(std::move(a), 1 << 20), right(std::move(b), 1 << 20);
  const std::string large(600'000, 'x');  // more than a socket buffer holds
  std::thread sender([&] {
    EXPECT_TRUE(left.send("one"));
    EXPECT_TRUE(left.send(""));
    EXPECT_TRUE(left.send(large));
  });
  EXPECT_EQ(right.receive().value(), "one");
  EXPECT_EQ(right.receive().value(), "");
  EXPECT_EQ(right.receive().value(), large);
  sender.join();
}

TEST(FrameSocket, a_closed_connection_is_gone) {
  auto [a, b] = socket_pair();
  FrameSocket right(std::move(b), 100);
  EXPECT_FALSE(right.peer_closed());
  a.reset();
  EXPECT_TRUE(right.peer_closed());
  const auto frame = right.receive();
  ASSERT_FALSE(frame);
  EXPECT_EQ(frame.error().code, ErrorCode::kGone);
  EXPECT_EQ(frame.error().detail, "connection closed");
  EXPECT_EQ(right.send("anybody there?").error().code, ErrorCode::kGone);
}

TEST(FrameSocket, an_end_inside_a_frame_is_distinguished) {
  auto [a, b] = socket_pair();
  FrameSocket right(std::move(b), 100);
  const std::array<char, 6> partial = {10, 0, 0, 0, 'a', 'b'};
  ASSERT_EQ(::send(a.get(), partial.data(), partial.size(), 0), 6);
  a.reset();
  EXPECT_EQ(right.receive().error().detail, "connection closed inside a task message");
}

TEST(FrameSocket, a_length_over_the_limit_is_refused_before_it_is_read) {
  auto [a, b] = socket_pair();
  FrameSocket right(std::move(b), 100);
  const std::array<unsigned char, 4> head = {0xff, 0xff, 0xff, 0xff};
  ASSERT_EQ(::send(a.get(), head.data(), head.size(), 0), 4);
  const auto frame = right.receive();
  ASSERT_FALSE(frame);
  EXPECT_EQ(frame.error().message(),
            "task message has a bad length: expected at most 100, got "
            "4294967295");
}

TEST(FrameSocket, a_message_over_the_limit_is_not_sent) {
  auto [a, b] = socket_pair();
  FrameSocket left(std::move(a), 4);
  EXPECT_EQ(left.send("12345").error().message(),
            "task message is too long: expected at most 4 bytes, got 5");
}

TEST(FrameSocket, silence_beyond_the_time_limit_is_deadline_exceeded) {
  auto [a, b] = socket_pair();
  FrameSocket right(std::move(b), 100);
  ASSERT_TRUE(right.set_receive_timeout(0.05));
  EXPECT_EQ(right.receive().error().code, ErrorCode::kDeadlineExceeded);
}

TEST(FrameSocket, a_peer_that_is_not_trusted_has_a_time_for_each_frame_and_no_more_bytes) {
  auto [a, b] = socket_pair();
  FrameSocket right(std::move(b), 1 << 20);
  right.distrust(100, 0.1);
  const std::array<char, 6> partial = {10, 0, 0, 0, 'a', 'b'};
  ASSERT_EQ(::send(a.get(), partial.data(), 2, 0), 2);
  EXPECT_EQ(right.receive().error().message(),
            "task message takes too long: expected its 4 bytes within 0.1 s, got 2");
  ASSERT_EQ(::send(a.get(), partial.data(), partial.size(), 0), 6);
  const Error late = right.receive().error();
  EXPECT_EQ(late.code, ErrorCode::kBadRequest);
  EXPECT_EQ(late.message(),
            "task message takes too long: expected its 10 bytes within 0.1 s, got 2");
  const std::array<char, 4> head = {101, 0, 0, 0};
  ASSERT_EQ(::send(a.get(), head.data(), head.size(), 0), 4);
  EXPECT_EQ(right.receive().error().message(),
            "task message has a bad length: expected at most 100, got 101");
  // The other end is not read.
  const Error stuck = right.send(std::string(1 << 20, 'x')).error();
  EXPECT_EQ(stuck.code, ErrorCode::kBadRequest);
  EXPECT_TRUE(stuck.message().starts_with(
      "task messages are not read: expected 1048576 bytes to be taken within 0.1 s, got "))
      << stuck.message();
}

TEST(FrameSocket, shutdown_ends_a_receive_that_blocks_in_another_thread) {
  auto [a, b] = socket_pair();
  FrameSocket right(std::move(b), 100);
  std::thread closer([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(30));
    right.shutdown();
  });
  EXPECT_EQ(right.receive().error().code, ErrorCode::kGone);
  closer.join();
}

TEST(FrameSocket, a_listening_socket_is_for_its_user_alone_and_replaces_an_old_one) {
  testing::TemporaryDir dir;
  const auto path = dir.path() / "s.sock";
  { ASSERT_TRUE(listen_unix(path)); }
  auto listener = listen_unix(path);
  ASSERT_TRUE(listener) << listener.error().detail;
  struct stat info {};
  ASSERT_EQ(::stat(path.c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0600u);
  EXPECT_TRUE(connect_unix(path));
}

TEST(FrameSocket, a_path_too_long_for_a_socket_is_named) {
  const auto refused = listen_unix("/tmp/" + std::string(200, 'x'));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().expected, "at most 107 bytes");
  EXPECT_EQ(refused.error().got, "205");
}

}  // namespace
}  // namespace voxeld
