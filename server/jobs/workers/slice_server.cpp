#include "server/jobs/workers/slice_server.h"

#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "proto/messages/task_bounds.h"
#include "server/jobs/workers/message_rate.h"

namespace voxeld {
namespace {

using nlohmann::json;

// One connection: its worker has at most one task, and that at most one time slice.
class SliceConnection {
 public:
  SliceConnection(FrameSocket& socket, const SliceServerContext& context)
      : socket_(socket), context_(context), rate_(context.limits) {}
  ~SliceConnection() { give(); }
  SliceConnection(const SliceConnection&) = delete;
  SliceConnection& operator=(const SliceConnection&) = delete;

  Status handle(const std::string& frame) {
    VOXELD_TRY(rate_.take());
    VOXELD_ASSIGN(const json message, parse_worker_message(frame));
    VOXELD_ASSIGN(SliceRequest request, parse_slice_request(message));
    const bool is_same = request.task == last_.task && request.fence == last_.fence;
    if (!is_same || request.action == SliceAction::kGive) give();
    last_ = std::move(request);
    if (last_.action == SliceAction::kGive) return {};
    return send(to_json_message(reply()));
  }

  Status send(const json& message) {
    return socket_.send(message.dump(-1, ' ', false, json::error_handler_t::replace));
  }

 private:
  void give() { context_.slices.give(last_.task, last_.fence); }

  SliceReply reply() {
    const auto stop = [this] {
      return context_.stopping || context_.board.cancel_age_seconds(last_.task) >= 0 ||
             socket_.peer_closed();
    };
    SliceReply reply;
    Result<TimeSlices::Outcome> outcome = TimeSlices::Outcome::kFenced;
    if (last_.action == SliceAction::kRenew) {
      outcome = context_.slices.renew(last_.task, last_.fence, stop);
    } else {
      outcome = context_.slices.take(last_.task, last_.fence,
                                     {last_.host_bytes, last_.device_bytes}, stop);
    }
    if (!outcome) {
      reply.error = outcome.error();
      return reply;
    }
    reply.granted = *outcome == TimeSlices::Outcome::kGranted;
    reply.cancel = *outcome == TimeSlices::Outcome::kStopped;
    reply.fenced = *outcome == TimeSlices::Outcome::kFenced;
    return reply;
  }

  FrameSocket& socket_;
  const SliceServerContext& context_;
  MessageRate rate_;
  SliceRequest last_;
};

}  // namespace

Status serve_slices(FrameSocket& socket, const SlicesHello& worker,
                    const SliceServerContext& context) {
  if (worker.protocol != kTaskProtocolVersion) {
    return Error{ErrorCode::kBadRequest, "worker speaks another version of the task protocol",
                 std::to_string(kTaskProtocolVersion), std::to_string(worker.protocol)};
  }
  VOXELD_TRY(socket.set_receive_timeout(0));
  SliceConnection connection(socket, context);
  VOXELD_TRY(connection.send({{"ok", true}}));
  while (!context.stopping) {
    VOXELD_ASSIGN(const std::string frame, socket.receive());
    VOXELD_TRY(connection.handle(frame));
  }
  return {};
}

}  // namespace voxeld
