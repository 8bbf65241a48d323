#include "server/worker/gateway/device_slice.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "server/worker/gateway/task_client.h"

namespace voxeld {
namespace {

using nlohmann::json;

std::string dump(const json& message) {
  return message.dump(-1, ' ', false, json::error_handler_t::replace);
}

}  // namespace

Result<std::unique_ptr<SliceClient>> SliceClient::connect(const std::string& gateway) {
  VOXELD_ASSIGN(UniqueFd fd, connect_gateway(gateway));
  return std::unique_ptr<SliceClient>(new SliceClient(std::move(fd)));
}

Status SliceClient::hello(const SlicesHello& hello) {
  VOXELD_TRY(socket_.send(dump(to_json_message(hello))));
  VOXELD_TRY(socket_.receive());
  return {};
}

Result<SliceReply> SliceClient::ask(const SliceRequest& request) {
  VOXELD_TRY(socket_.send(dump(to_json_message(request))));
  VOXELD_ASSIGN(const std::string frame, socket_.receive());
  VOXELD_ASSIGN(const json message, parse_task_message(frame));
  return parse_slice_reply(message);
}

Status SliceClient::give(const SliceRequest& request) {
  return socket_.send(dump(to_json_message(request)));
}

DeviceSlice::DeviceSlice(SliceClient* client, const Task& task) : client_(client) {
  request_.task = task.id;
  request_.fence = task.fence;
  pause_.take = [this] { return renew(); };
}

void DeviceSlice::expect(int64_t host_bytes, int64_t device_bytes) {
  const MutexLock lock(mutex_);
  request_.host_bytes = std::max(request_.host_bytes, host_bytes);
  request_.device_bytes = std::max(request_.device_bytes, device_bytes);
}

Status DeviceSlice::begin() {
  const MutexLock lock(mutex_);
  return ask(since_.load() == kNotHeld ? SliceAction::kTake : SliceAction::kRenew);
}

void DeviceSlice::end() {
  const MutexLock lock(mutex_);
  if (since_.exchange(kNotHeld) == kNotHeld || client_ == nullptr) return;
  request_.action = SliceAction::kGive;
  // A failure is ignored: a gateway that is gone has no time slices to give back to.
  (void)client_->give(request_).ok();
}

void DeviceSlice::tick() {
  if (client_ != nullptr && is_old()) pause_.is_due = true;
}

// The first thread that comes asks; the others wait for it.
bool DeviceSlice::renew() {
  const MutexLock lock(mutex_);
  if (is_old()) is_refused_ = !ask(SliceAction::kRenew).ok();
  pause_.is_due = is_refused_;
  return !is_refused_;
}

bool DeviceSlice::is_old() const {
  const Clock::time_point since = since_;
  return since != kNotHeld && Clock::now() - since >= kQuantum;
}

Status DeviceSlice::ask(SliceAction action) {
  if (client_ != nullptr) {
    request_.action = action;
    since_ = kNotHeld;
    VOXELD_ASSIGN(const SliceReply reply, client_->ask(request_));
    if (reply.error) return *reply.error;
    if (!reply.granted) return Error{ErrorCode::kCancelled, "the job was cancelled", "", ""};
  }
  since_ = Clock::now();
  return {};
}

}  // namespace voxeld
