#include "server/http/output.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "tests/unit/base/heap_bytes.h"
#include "tests/unit/base/temporary_dir.h"

namespace voxeld::http {
namespace {

constexpr size_t kSentBytes = size_t{8} << 20;

// Pieces of a file that was deleted meanwhile, as of a FileBody.
TEST(OutputOfPieces, their_file_is_held_until_the_last_one_is_made) {
  const testing::TemporaryDir dir;
  const auto path = dir.path() / "tiles";
  ASSERT_TRUE(write_file(path, std::vector<uint8_t>(100'000)));
  auto file = std::make_shared<const UniqueFd>(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  std::array<int, 2> fds{};
  ASSERT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, fds.data()), 0);
  UniqueFd server(fds[0]);
  const UniqueFd client(fds[1]);
  Connection connection(std::move(server), "10.0.0.1");
  int left = 200;
  Response response;
  response.body = PieceBody{[&] {
                              return Piece{std::string(10'000, 'x'), --left == 0};
                            },
                            kPieceBytesMax, std::move(file)};
  HeldFiles held;
  MemoryBudget budget;
  Output output({}, std::move(response), budget, "lab", nullptr, &held);
  EXPECT_EQ(held.bytes("lab"), 0);
  ::unlink(path.c_str());
  EXPECT_EQ(output.advance(connection), Output::State::kBlocked) << "nobody reads";
  EXPECT_GT(held.bytes("lab"), 0);
  EXPECT_TRUE(output.sends_deleted_file());
  left = 1;
  std::vector<char> bytes(size_t{1} << 20);
  while (output.advance(connection) != Output::State::kDone) {
    ASSERT_GT(::read(client.get(), bytes.data(), bytes.size()), 0);
  }
  EXPECT_EQ(held.bytes("lab"), 0);
  EXPECT_FALSE(output.sends_file());
}

// Bytes that the socket has taken do not count against the budget, so they may not be kept either.
TEST(OutputOfPieces, a_stream_that_waits_keeps_no_memory_of_what_it_has_sent) {
  constexpr size_t kStreams = 100, kBytes = 40'000;
  MemoryBudget budget;
  std::vector<UniqueFd> clients;
  std::vector<std::unique_ptr<Connection>> connections;
  std::vector<std::unique_ptr<Output>> outputs;
  const int64_t before = testing::heap_bytes();
  for (size_t i = 0; i < kStreams; ++i) {
    std::array<int, 2> fds{};
    ASSERT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, fds.data()), 0);
    connections.push_back(std::make_unique<Connection>(UniqueFd(fds[0]), "10.0.0.1"));
    clients.emplace_back(fds[1]);
    Response response;
    response.body = PieceBody{[is_first = true]() mutable -> Result<Piece> {
      if (std::exchange(is_first, false)) return Piece{std::string(kBytes, 'x'), false};
      return Piece{"", false, Clock::now() + std::chrono::hours(1)};
    }};
    outputs.push_back(std::make_unique<Output>(Output::Context(), std::move(response), budget, "",
                                               nullptr, nullptr));
    ASSERT_EQ(outputs.back()->advance(*connections.back()), Output::State::kWaiting);
  }
  EXPECT_EQ(budget.bytes(), 0);
  EXPECT_LT(testing::heap_bytes() - before, static_cast<int64_t>(kStreams * kBytes / 4));
}

// A socket whose other end reads as fast as it can.
class OutputTest : public ::testing::Test {
 protected:
  OutputTest() {
    std::array<int, 2> fds{};
    EXPECT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, fds.data()), 0);
    EXPECT_EQ(::fcntl(fds[0], F_SETFL, O_NONBLOCK), 0);
    ends_ = {UniqueFd(fds[0]), UniqueFd(fds[1])};
    reader_ = std::thread([fd = ends_.second.get(), this] {
      std::vector<char> bytes(size_t{1} << 20);
      for (ssize_t got = 1; got > 0; read_ += static_cast<size_t>(got)) {
        got = ::read(fd, bytes.data(), bytes.size());
        if (got < 0) return;
      }
    });
  }

  // Sends the response to its end, and returns the most bytes of a turn.
  int64_t longest_turn(Response response) {
    Connection connection(std::move(ends_.first), "10.0.0.1");
    Output output({}, std::move(response), budget_, "", nullptr, nullptr);
    int64_t longest = 0, sent = 0;
    for (auto state = Output::State::kBlocked; state == Output::State::kBlocked;) {
      state = output.advance(connection);
      longest = std::max(longest, output.sent() - sent);
      sent = output.sent();
    }
    ::shutdown(connection.fd(), SHUT_RDWR);
    reader_.join();
    EXPECT_EQ(static_cast<int64_t>(read_), sent);
    EXPECT_GT(sent, static_cast<int64_t>(kSentBytes));
    return longest;
  }

  std::pair<UniqueFd, UniqueFd> ends_;
  MemoryBudget budget_;
  size_t read_ = 0;
  std::thread reader_;
};

TEST_F(OutputTest, a_text_is_sent_in_turns_however_fast_the_client_reads) {
  EXPECT_LE(longest_turn(Response::text(200, std::string(kSentBytes, 'x'))), Output::kTurnBytes);
}

TEST_F(OutputTest, a_file_is_sent_in_turns_however_fast_the_client_reads) {
  const testing::TemporaryDir dir;
  const std::vector<uint8_t> bytes(kSentBytes);
  ASSERT_TRUE(write_file(dir.path() / "f", bytes).ok());
  Response response;
  response.status = 200;
  response.body = FileBody{dir.path() / "f", 0, static_cast<int64_t>(kSentBytes)};
  EXPECT_LE(longest_turn(std::move(response)), Output::kTurnBytes);
}

}  // namespace
}  // namespace voxeld::http
