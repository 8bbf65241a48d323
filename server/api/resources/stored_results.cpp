// Lists of stored results (/v1/results, /v1/grids, /v1/sequences), and their deletion.
#include <algorithm>

#include "proto/messages/json_writer.h"
#include "server/api/resources/list_body.h"
#include "server/api/resources/resources.h"

namespace voxeld::api {
namespace {

std::string result_text(const KeptResult& result, KeptKind kind) {
  std::string text;
  JsonWriter json(text);
  json.begin_object()
      .member("job", result.job)
      .member("bytes", result.bytes)
      .member("created_ms", result.created_ms);
  switch (kind) {
    case KeptKind::kResult:
      json.member("blob", result.blob)
          .member("media_type", result.media_type)
          .member("filename", result.filename)
          .member("grid", result.grid)
          .member("sequence", result.sequence);
      break;
    case KeptKind::kGrid:
      json.member("id", result.grid);
      break;
    case KeptKind::kSequence:
      json.member("id", result.sequence).member("frames", result.frames);
      break;
  }
  json.end_object();
  return text;
}

// The rows below the number of a result, read from the database in batches of about a piece.
Status add_results(Api& api, const Caller& caller, KeptKind kind, const std::string& after,
                   ListRows& rows) {
  constexpr int kBatch = 128;
  VOXELD_ASSIGN(int64_t before_seq, cursor_number(after));
  if (before_seq == 0) return bad_cursor(after);
  before_seq = std::max<int64_t>(before_seq, 0);  // 0: from the newest on
  while (true) {
    VOXELD_ASSIGN(const std::vector<KeptResult> batch,
                  api.jobs.list_kept(caller, kind, kBatch, before_seq));
    for (const KeptResult& result : batch) {
      if (!rows.add(result_text(result, kind), std::to_string(result.seq))) return {};
      before_seq = result.seq;
    }
    if (std::ssize(batch) < kBatch) return {};
  }
}

Response list_stored(Request& request, Api& api, KeptKind kind, const char* name) {
  auto page = requested_page(request);
  if (!page) return problem(request, page.error());
  return list_response(
      "", name, *std::move(page),
      [&api, caller = request.caller, kind](const std::string& after, ListRows& rows) {
        return add_results(api, caller, kind, after, rows);
      });
}

Response deleted(const Request& request, const Status& status) {
  if (!status) return problem(request, status.error());
  Response response;
  response.status = 204;
  return response;
}

}  // namespace

Reply list_results(Request& request, Api& api) {
  return list_stored(request, api, KeptKind::kResult, "results");
}

Reply list_grids(Request& request, Api& api) {
  return list_stored(request, api, KeptKind::kGrid, "grids");
}

Reply list_sequences(Request& request, Api& api) {
  return list_stored(request, api, KeptKind::kSequence, "sequences");
}

Reply delete_result(Request& request, Api& api) {
  return deleted(request, api.jobs.delete_result(request.caller, request.path_parameters[0]));
}

Reply delete_grid(Request& request, Api& api) {
  return deleted(request, api.jobs.delete_grid(request.caller, request.path_parameters[0]));
}

Reply delete_sequence(Request& request, Api& api) {
  return deleted(request, api.jobs.delete_sequence(request.caller, request.path_parameters[0]));
}

}  // namespace voxeld::api
