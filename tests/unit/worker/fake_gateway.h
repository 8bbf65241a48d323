// A gateway for one worker connection that answers as the test says.
#pragma once

#include <sys/socket.h>

#include <functional>
#include <string>
#include <thread>
#include <utility>

#include <nlohmann/json.hpp>

#include "proto/messages/task_api.h"
#include "server/base/frame_socket.h"
#include "tests/unit/base/temporary_dir.h"

namespace voxeld::testing {

// Accepts one connection and answers each message with what `answer` returns, until the worker
// closes; an empty answer closes from this side.
class FakeGateway {
 public:
  using Answer = std::function<std::string(const nlohmann::json&)>;
  explicit FakeGateway(Answer answer) : answer_(std::move(answer)) {
    listener_ = listen_unix(dir_.path() / "s").value();
    thread_ = std::thread([this] { run(); });
  }
  ~FakeGateway() { thread_.join(); }
  std::string address() const { return "unix:" + (dir_.path() / "s").string(); }

 private:
  void run() {
    FrameSocket socket(UniqueFd(::accept(listener_.get(), nullptr, nullptr)), kTaskFrameBytesMax);
    while (auto frame = socket.receive()) {
      const std::string reply = answer_(nlohmann::json::parse(*frame));
      if (reply.empty() || !socket.send(reply)) return;
    }
  }
  TemporaryDir dir_;
  Answer answer_;
  UniqueFd listener_;
  std::thread thread_;
};

}  // namespace voxeld::testing
