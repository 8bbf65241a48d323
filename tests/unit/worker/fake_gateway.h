// A gateway for one worker connection whose replies the test makes.
#pragma once

#include <sys/socket.h>

#include <functional>
#include <string>
#include <thread>
#include <utility>

#include <nlohmann/json.hpp>

#include "proto/messages/task_api.h"
#include "server/process/frame_socket.h"
#include "tests/unit/base/temporary_dir.h"

namespace voxeld::testing {

// Accepts one connection and replies to each message with the text that `handler` returns, until
// the worker closes. An empty reply closes the connection.
class FakeGateway {
 public:
  using Handler = std::function<std::string(const nlohmann::json&)>;
  explicit FakeGateway(Handler handler) : handler_(std::move(handler)) {
    listener_ = listen_unix(dir_.path() / "s").value();
    thread_ = std::thread([this] { run(); });
  }
  ~FakeGateway() { thread_.join(); }
  std::string address() const { return "unix:" + (dir_.path() / "s").string(); }

 private:
  void run() {
    FrameSocket socket(UniqueFd(::accept(listener_.get(), nullptr, nullptr)), kTaskFrameBytesMax);
    while (auto frame = socket.receive()) {
      const std::string reply = handler_(nlohmann::json::parse(*frame));
      if (reply.empty() || !socket.send(reply)) return;
    }
  }
  TemporaryDir dir_;
  Handler handler_;
  UniqueFd listener_;
  std::thread thread_;
};

}  // namespace voxeld::testing
