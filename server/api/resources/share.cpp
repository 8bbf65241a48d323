// POST …/share: links that expire, for readers without a key.
#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "proto/text/client_texts.h"
#include "proto/text/number_text.h"
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
  const auto status = api.jobs.get(request.caller, id);
  if (!status) return problem(request, status.error());
  const auto wanted = parse_wanted(request);
  if (!wanted) return problem(request, wanted.error());
  if (!wanted->view.empty() && wanted->view != "result") {
    return problem(request, {ErrorCode::kInvalidOption, "view", "result", echoed(wanted->view)});
  }
  return link_response(request, api, "/v1/jobs/" + id + "/result", *wanted);
}

Reply share_grid(Request& request, Api& api) {
  const std::string& id = request.path_parameters[0];
  const auto grid = api.jobs.get_grid(request.caller, id);
  if (!grid) return problem(request, grid.error());
  const auto wanted = parse_wanted(request);
  if (!wanted) return problem(request, wanted.error());
  if (wanted->view.empty() || wanted->view == kGridViews.front()) {
    return link_response(request, api, "/v1/grids/" + id, *wanted);
  }
  if (std::ranges::count(kGridViews, wanted->view) == 0) {
    return problem(request, {ErrorCode::kInvalidOption, "view", "grid, render.png or render",
                             echoed(wanted->view)});
  }
  return link_response(request, api, "/v1/grids/" + id + "/" + wanted->view, *wanted);
}

}  // namespace voxeld::api
