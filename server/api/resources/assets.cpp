// /v1/assets: uploads by content, and descriptions of what they contain.
#include <memory>
#include <nlohmann/json.hpp>
#include <utility>

#include "proto/messages/json_writer.h"
#include "server/api/resources/jobs/job_responses.h"
#include "server/api/resources/jobs/job_wait.h"
#include "server/api/resources/list_body.h"
#include "server/api/resources/resources.h"
#include "server/api/resources/upload.h"

namespace voxeld::api {
namespace {

using Json = nlohmann::json;

// Memory of a response with a description: the row, and the text that is sent.
constexpr int64_t kDescriptionBytesMax = int64_t{1} << 20;

Json asset_json(const Asset& asset) {
  return {{"id", asset.id},
          {"filename", asset.filename},
          {"content_type", asset.content_type},
          {"bytes", asset.bytes},
          {"created_ms", asset.created_ms}};
}

std::string text_of(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

// "created_ms.id.tenant"
std::string cursor_of(const Asset& asset) {
  return std::to_string(asset.created_ms) + "." + asset.id + "." + asset.tenant;
}

Result<AssetCursor> asset_cursor(const std::string& after) {
  AssetCursor cursor;
  if (after.empty()) return cursor;
  const size_t first = after.find('.'), second = after.find('.', first + 1);
  if (second == std::string::npos) return bad_cursor(after);
  VOXELD_ASSIGN(cursor.created_ms, cursor_number(after.substr(0, first)));
  cursor.id = after.substr(first + 1, second - first - 1);
  cursor.tenant = after.substr(second + 1);
  return cursor;
}

// The members of the description, then those of the asset: later members win, so a worker cannot
// change these.
std::string described_text(const Asset& asset) {
  const std::string& description = asset.description_json;
  std::string text = "{";
  if (description.starts_with('{') && Json::accept(description)) {
    text = description.substr(0, description.rfind('}'));
  }
  JsonWriter(text)
      .member("id", asset.id)
      .member("filename", asset.filename)
      .member("content_type", asset.content_type)
      .member("bytes", asset.bytes)
      .member("created_ms", asset.created_ms)
      .end_object();
  return text;
}

// The asset with its description, or that of the inspect job `job`.
Result<Piece> description_piece(Api& api, const Caller& caller, const std::string& id,
                                const std::string& job) {
  VOXELD_ASSIGN(Asset asset, api.jobs.get_asset(caller, id));
  if (asset.description_json.empty() && !job.empty()) {
    VOXELD_ASSIGN(JobStatus inspected, api.jobs.get_whole(caller, job));
    if (inspected.result) asset.description_json = std::move(inspected.result->meta_json);
  }
  return Piece{described_text(asset), true};
}

// A description is read while it is sent, within the memory budget.
Response described_response(const Request& request, Api& api, const std::string& id,
                            const std::string& job = "") {
  Response response = Response::json(200, "");
  response.headers["ETag"] = "\"" + id + "\"";
  response.body = PieceBody{
      [&api, caller = request.caller, id, job] { return description_piece(api, caller, id, job); },
      kDescriptionBytesMax};
  return response;
}

}  // namespace

Reply post_asset(Request& request, Api& api) {
  return receive_upload(request, api, Durability::kNow, [](Request&, const Upload& upload) {
    const Asset& asset = upload.asset;
    Response response = Response::json(asset.existed ? 200 : 201, text_of(asset_json(asset)));
    response.headers["Location"] = "/v1/assets/" + asset.id;
    response.headers["ETag"] = "\"" + asset.id + "\"";
    return response;
  });
}

Reply list_assets(Request& request, Api& api) {
  auto page = requested_page(request);
  if (!page) return problem(request, page.error());
  return list_response(
      "", "assets", *std::move(page),
      [&api, caller = request.caller](const std::string& after, ListRows& rows) -> Status {
        VOXELD_ASSIGN(const AssetCursor cursor, asset_cursor(after));
        return api.jobs.list_assets(caller, cursor, [&](const Asset& asset) {
          return rows.add(text_of(asset_json(asset)), cursor_of(asset));
        });
      });
}

// An inspect job makes the description on first use. ?brief=1: what an upload returns, without it.
Reply get_asset(Request& request, Api& api) {
  const auto is_brief = query_word(request, "brief", {"0", "1"});
  if (!is_brief) return problem(request, is_brief.error());
  const auto asset = api.jobs.get_asset(request.caller, request.path_parameters[0]);
  if (!asset) return problem(request, asset.error());
  if (*is_brief == "1") {
    Response response = Response::json(200, text_of(asset_json(*asset)));
    response.headers["ETag"] = "\"" + asset->id + "\"";
    return response;
  }
  if (!asset->description_json.empty()) return described_response(request, api, asset->id);
  auto place = api.waits.take(request.caller.tenant());
  if (!place) return problem(request, place.error());
  JobRequest job;
  job.kind = JobKind::kInspect;
  job.asset = asset->id;
  job.filename = asset->filename;
  const auto submitted = api.jobs.submit(request.caller, job, {});
  if (!submitted) return problem(request, submitted.error());
  JobWaitPlan plan;
  plan.job = submitted->id;
  plan.place = *std::move(place);
  plan.then = [&api, id = asset->id](Request& asking, const JobStatus& status) {
    if (status.error) return problem(asking, *status.error);  // the next request makes a new job
    if (status.state != JobState::kDone || !status.result) {
      return job_result_response(asking, api, status);
    }
    return described_response(asking, api, id, status.id);
  };
  return wait_for_job(request, api, std::move(plan));
}

Reply delete_asset(Request& request, Api& api) {
  const Status status = api.jobs.delete_asset(request.caller, request.path_parameters[0]);
  if (!status) return problem(request, status.error());
  Response response;
  response.status = 204;
  return response;
}

}  // namespace voxeld::api
