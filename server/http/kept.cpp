// What jobs left and its tenant keeps: lists of /v1/results, /v1/grids and /v1/sequences, and
// deletion.
#include <algorithm>

#include "proto/json_writer.h"
#include "server/http/api.h"
#include "server/http/list_body.h"

namespace voxeld::http {
namespace {

constexpr ListLimits kListLimits{100, 1000};

std::string kept_text(const KeptResult& kept, KeptKind kind) {
  std::string text;
  JsonWriter json(text);
  json.begin_object()
      .member("job", kept.job)
      .member("bytes", kept.bytes)
      .member("created_ms", kept.created_ms);
  switch (kind) {
    case KeptKind::kResult:
      json.member("blob", kept.blob)
          .member("media_type", kept.media_type)
          .member("filename", kept.filename)
          .member("grid", kept.grid)
          .member("sequence", kept.sequence);
      break;
    case KeptKind::kGrid:
      json.member("id", kept.grid);
      break;
    case KeptKind::kSequence:
      json.member("id", kept.sequence).member("frames", kept.frames);
      break;
  }
  json.end_object();
  return text;
}

// The rows below the number of a result, read from the database in batches of about a piece.
Status add_kept(Api& api, const Caller& caller, KeptKind kind, const std::string& after,
                ListRows& rows) {
  constexpr int kBatch = 128;
  VOXELD_ASSIGN(int64_t before_seq, cursor_number(after));
  if (before_seq == 0) return bad_cursor(after);
  before_seq = std::max<int64_t>(before_seq, 0);  // 0: from the newest on
  while (true) {
    VOXELD_ASSIGN(const std::vector<KeptResult> batch,
                  api.jobs.list_kept(caller, kind, kBatch, before_seq));
    for (const KeptResult& kept : batch) {
      if (!rows.add(kept_text(kept, kind), std::to_string(kept.seq))) return {};
      before_seq = kept.seq;
    }
    if (std::ssize(batch) < kBatch) return {};
  }
}

Response list_kept(Request& request, Api& api, KeptKind kind, const char* name) {
  auto page = requested_page(request, kListLimits);
  if (!page) return problem(request, page.error());
  return list_response(
      "", name, *std::move(page),
      [&api, caller = request.caller, kind](const std::string& after, ListRows& rows) {
        return add_kept(api, caller, kind, after, rows);
      });
}

Response deleted(const Request& request, const Status& status) {
  if (!status) return problem(request, status.error());
  Response response;
  response.status = 204;
  return response;
}

}  // namespace

void add_kept_routes(Router& router, Api& api) {
  router.add("GET", "/v1/results",
             [&api](Request& r) { return list_kept(r, api, KeptKind::kResult, "results"); });
  router.add("GET", "/v1/grids",
             [&api](Request& r) { return list_kept(r, api, KeptKind::kGrid, "grids"); });
  router.add("GET", "/v1/sequences",
             [&api](Request& r) { return list_kept(r, api, KeptKind::kSequence, "sequences"); });
  router.add("DELETE", "/v1/jobs/{id}/result", [&api](Request& r) {
    return deleted(r, api.jobs.delete_result(r.caller, r.path_parameters[0]));
  });
  router.add("DELETE", "/v1/grids/{id}", [&api](Request& r) {
    return deleted(r, api.jobs.delete_grid(r.caller, r.path_parameters[0]));
  });
  router.add("DELETE", "/v1/sequences/{id}", [&api](Request& r) {
    return deleted(r, api.jobs.delete_sequence(r.caller, r.path_parameters[0]));
  });
}

}  // namespace voxeld::http
