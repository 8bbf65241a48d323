#include "server/jobs/workers/slice_server.h"

#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "proto/task_bounds.h"
#include "server/jobs/workers/message_rate.h"

namespace voxeld {
namespace {

using nlohmann::json;

// One connection: its worker has at most one task, and that at most one turn.
class TurnConnection {
 public:
  TurnConnection(FrameSocket& socket, const TurnServerContext& context)
      : socket_(socket), context_(context) {}
  ~TurnConnection() { give(); }
  TurnConnection(const TurnConnection&) = delete;
  TurnConnection& operator=(const TurnConnection&) = delete;

  Status answer(const std::string& frame) {
    VOXELD_TRY(rate_.take());
    VOXELD_ASSIGN(const json message, parse_worker_message(frame));
    VOXELD_ASSIGN(TurnRequest request, parse_turn_request(message));
    const bool is_same = request.task == last_.task && request.fence == last_.fence;
    if (!is_same || request.action == TurnAction::kGive) give();
    last_ = std::move(request);
    if (last_.action == TurnAction::kGive) return {};
    return send(to_json_message(reply()));
  }

  Status send(const json& message) {
    return socket_.send(message.dump(-1, ' ', false, json::error_handler_t::replace));
  }

 private:
  void give() { context_.turns.give(last_.task, last_.fence); }

  TurnReply reply() {
    const auto stop = [this] {
      return context_.stopping || context_.board.cancel_age_seconds(last_.task) >= 0 ||
             socket_.peer_closed();
    };
    TurnReply reply;
    Result<DeviceTurns::Answer> answer = DeviceTurns::Answer::kFenced;
    if (last_.action == TurnAction::kRenew) {
      answer = context_.turns.renew(last_.task, last_.fence, stop);
    } else {
      answer = context_.turns.take(last_.task, last_.fence, {last_.host_bytes, last_.device_bytes},
                                   stop);
    }
    if (!answer) {
      reply.error = answer.error();
      return reply;
    }
    reply.granted = *answer == DeviceTurns::Answer::kGranted;
    reply.cancel = *answer == DeviceTurns::Answer::kStopped;
    reply.fenced = *answer == DeviceTurns::Answer::kFenced;
    return reply;
  }

  FrameSocket& socket_;
  const TurnServerContext& context_;
  MessageRate rate_;
  TurnRequest last_;
};

}  // namespace

Status serve_turns(FrameSocket& socket, const TurnsHello& worker,
                   const TurnServerContext& context) {
  if (worker.protocol != kTaskProtocolVersion) {
    return Error{ErrorCode::kBadRequest, "worker speaks another version of the task protocol",
                 std::to_string(kTaskProtocolVersion), std::to_string(worker.protocol)};
  }
  VOXELD_TRY(socket.set_receive_timeout(0));
  TurnConnection connection(socket, context);
  VOXELD_TRY(connection.send({{"ok", true}}));
  while (!context.stopping) {
    VOXELD_ASSIGN(const std::string frame, socket.receive());
    VOXELD_TRY(connection.answer(frame));
  }
  return {};
}

}  // namespace voxeld
