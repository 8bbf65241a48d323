// Bounds on the messages of the task API that a worker sends.
//
// A worker runs the parsers of uploaded files, and a hostile file may take it over. The gateway
// therefore bounds each message in bytes, depth and values before it builds anything from it, and
// each member by its rule in task_fields.h. A message out of bounds is an error (bad-request): the
// gateway ends the connection and the worker. A correct worker stays far within these bounds and
// checks its completion before it sends it.
#pragma once

#include <cstdint>
#include <string_view>

#include <nlohmann/json_fwd.hpp>

#include "proto/messages/job.h"
#include "proto/messages/task_api.h"

namespace voxeld {

namespace limits {

// Bytes of a message: of complete, whose meta is a JSON text within JSON, and of all others.
inline constexpr uint32_t kWorkerMessageBytesMax = 3u << 20;
inline constexpr uint32_t kWorkerReportBytesMax = 128u << 10;
inline constexpr int kWorkerMessageDepthMax = 8;
inline constexpr int64_t kWorkerMessageValuesMax = 4096;

// Meta of a result, and a worker's description of its device: JSON objects as text.
inline constexpr int64_t kMetaBytesMax = int64_t{1} << 20;
inline constexpr int64_t kMetaValuesMax = 200'000;
inline constexpr int64_t kDeviceJsonBytesMax = int64_t{16} << 10;
inline constexpr int64_t kDeviceJsonValuesMax = 256;
inline constexpr int kMetaDepthMax = 16;
inline constexpr int64_t kMetaMembersMax = 256;  // of one object

inline constexpr size_t kTaskNameBytesMax = 255;   // names of devices, drivers, warnings
inline constexpr size_t kTaskTextBytesMax = 2000;  // details of warnings, names of files
// Bytes of each text of an error. A worker cuts them at kTaskTextBytesMax; bytes that are not UTF-8
// become three each on the way.
inline constexpr size_t kTaskErrorBytesMax = 3 * kTaskTextBytesMax;
inline constexpr size_t kTaskPathBytesMax = 4096;
inline constexpr size_t kTaskOutputsMax = 8;
inline constexpr size_t kTaskTimingsMax = 32;
inline constexpr size_t kTaskWarningsMax = 256;
inline constexpr double kStageMsMax = 1e10;                   // 115 days
inline constexpr int64_t kTilesMax = int64_t{1} << 32;        // of one grid, with all its passes
inline constexpr int64_t kMemoryBytesMax = int64_t{1} << 50;  // the most that a message can report

}  // namespace limits

// Parses a message from a worker; parse_task_message() reads those of the gateway. Errors:
// bad-request, which names the kind of message.
Result<nlohmann::json> parse_worker_message(std::string_view text);

// Checks a completion before it is sent, as parse_task_completion() does. Errors: bad-request,
// which names the member.
Status check_bounds(const TaskCompletion& completion);

}  // namespace voxeld
