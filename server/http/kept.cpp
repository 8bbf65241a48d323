// What jobs left and its tenant keeps: lists of /v1/results, /v1/grids and /v1/sequences, and
// deletion.
#include <charconv>
#include <limits>
#include <nlohmann/json.hpp>

#include "proto/client_texts.h"
#include "server/http/api.h"

namespace voxeld::http {
namespace {

using Json = nlohmann::json;

constexpr int64_t kListDefault = 100, kListMax = 1000;

struct Page {
  int64_t limit = kListDefault;
  int64_t before_seq = 0;  // 0: from the newest on
};

Status read_number(const std::pair<std::string, std::string>& parameter, int64_t max,
                   std::string_view expected, int64_t& out) {
  const std::string& text = parameter.second;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), out);
  if (error == std::errc() && end == text.data() + text.size() && out >= 1 && out <= max) return {};
  return Error{ErrorCode::kInvalidOption, parameter.first, std::string(expected), echoed(text)};
}

Result<Page> requested_page(const Request& request) {
  Page page;
  for (const auto& parameter : request.head.query) {
    if (parameter.first == "limit") {
      VOXELD_TRY(read_number(parameter, kListMax,
                             "an integer from 1 to " + std::to_string(kListMax), page.limit));
    } else if (parameter.first == "after") {
      VOXELD_TRY(read_number(parameter, std::numeric_limits<int64_t>::max(),
                             "\"next\" of the page before", page.before_seq));
    } else {
      return Error{ErrorCode::kUnknownOption, "no such option", "limit, after",
                   echoed(parameter.first)};
    }
  }
  return page;
}

Json kept_json(const KeptResult& kept, KeptKind kind) {
  Json out = {{"job", kept.job}, {"bytes", kept.bytes}, {"created_ms", kept.created_ms}};
  switch (kind) {
    case KeptKind::kResult:
      out.update({{"blob", kept.blob},
                  {"media_type", kept.media_type},
                  {"filename", kept.filename},
                  {"grid", kept.grid},
                  {"sequence", kept.sequence}});
      break;
    case KeptKind::kGrid:
      out["id"] = kept.grid;
      break;
    case KeptKind::kSequence:
      out["id"] = kept.sequence;
      out["frames"] = kept.frames;
      break;
  }
  return out;
}

Response list_kept(Request& request, Api& api, KeptKind kind, const char* name) {
  const auto page = requested_page(request);
  if (!page) return problem(request, page.error());
  // One more than are shown tells whether there is a next page.
  auto kept =
      api.jobs.list_kept(request.caller, kind, static_cast<int>(page->limit) + 1, page->before_seq);
  if (!kept) return problem(request, kept.error());
  const bool has_more = static_cast<int64_t>(kept->size()) > page->limit;
  if (has_more) kept->pop_back();
  Json list = Json::array();
  for (const KeptResult& one : *kept) list.push_back(kept_json(one, kind));
  Json out = {{name, std::move(list)}, {"next", nullptr}};
  if (has_more) out["next"] = std::to_string(kept->back().seq);
  return Response::json(200, out.dump(-1, ' ', false, Json::error_handler_t::replace));
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
