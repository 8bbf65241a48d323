// POST …/share: links that expire, for readers without a key.
#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "proto/text/client_texts.h"
#include "proto/text/number_text.h"
#include "server/api/resources/jobs/job_responses.h"
#include "server/api/resources/resources.h"
#include "server/base/clock.h"
#include "server/http/message/head_parser.h"

namespace voxeld::api {
namespace {

// Views of /v1/grids/{id}.
constexpr std::array<std::string_view, 3> kGridViews = {"grid", "render.png", "render"};

static_assert(client_texts::kLink.bytes_max == http::kTargetBytesMax);

// The query, split into properties of the link and the query of its target.
struct Wanted {
  int64_t seconds = kLinkSecondsDefault;
  std::string view;
  OptionPairs query;
};

Result<Wanted> parse_wanted(const Request& request) {
  Wanted wanted;
  for (const auto& [name, value] : request.head.query) {
    if (name == "view") {
      wanted.view = value;
    } else if (name != "seconds") {
      wanted.query.emplace_back(name, value);
    } else {
      const auto seconds = parse_number<int64_t>(value, 1, kLinkSecondsMax);
      if (!seconds) {
        return Error{ErrorCode::kInvalidOption, "seconds",
                     "an integer from 1 to " + std::to_string(kLinkSecondsMax), echoed(value)};
      }
      wanted.seconds = *seconds;
    }
  }
  return wanted;
}

Response link_response(const Request& request, const Api& api, const std::string& path,
                       const Wanted& wanted) {
  const int64_t expires_s = unix_time_ms() / 1000 + wanted.seconds;
  const auto url = api.access.links().make(path, wanted.query, request.key_id, expires_s);
  if (!url) return problem(request, url.error());
  if (const Status fits = check_length(client_texts::kLink, *url); !fits) {
    return problem(request, fits.error());
  }
  return Response::json(201,
                        nlohmann::json{{"url", *url}, {"expires_ms", expires_s * 1000}}.dump());
}

}  // namespace

Reply share_job(Request& request, Api& api) {
  const std::string& id = request.path_parameters[0];
  const auto found = api.jobs.get_with_result(request.caller, id);
  if (!found) return problem(request, found.error());
  const JobStatus& status = found->status;
  if (status.ended() && (status.state != JobState::kDone || !found->file)) {
    return job_result_response(request, api, *found);  // why there is none
  }
  const auto wanted = parse_wanted(request);
  if (!wanted) return problem(request, wanted.error());
  if (!wanted->view.empty() && wanted->view != "result") {
    return problem(request, {ErrorCode::kInvalidOption, "view", "result", echoed(wanted->view)});
  }
  if (const Status taken = check_result_query(status, wanted->query); !taken) {
    return problem(request, taken.error());
  }
  return link_response(request, api, "/v1/jobs/" + id + "/result", *wanted);
}

Reply share_grid(Request& request, Api& api) {
  const std::string& id = request.path_parameters[0];
  const auto grid = api.jobs.get_grid(request.caller, id);
  if (!grid) return problem(request, grid.error());
  const auto wanted = parse_wanted(request);
  if (!wanted) return problem(request, wanted.error());
  const bool is_grid = wanted->view.empty() || wanted->view == kGridViews.front();
  if (!is_grid && std::ranges::count(kGridViews, wanted->view) == 0) {
    return problem(request, {ErrorCode::kInvalidOption, "view", "grid, render.png or render",
                             echoed(wanted->view)});
  }
  const auto scope = is_grid ? OptionScope::kExport : OptionScope::kRenderGrid;
  if (const auto options = parse_options(wanted->query, scope); !options) {
    return problem(request, options.error());
  }
  if (is_grid) return link_response(request, api, "/v1/grids/" + id, *wanted);
  return link_response(request, api, "/v1/grids/" + id + "/" + wanted->view, *wanted);
}

}  // namespace voxeld::api
