// /v1/assets: uploads by content, and what is in them.
#include <nlohmann/json.hpp>

#include "proto/json_writer.h"
#include "server/http/api.h"
#include "server/http/list_body.h"

namespace voxeld::http {
namespace {

using Json = nlohmann::json;

constexpr ListLimits kListLimits{100, 1000};
// What an answer with a description is taken to need: the row, and the text that is sent.
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

Response post_asset(Request& request, Api& api) {
  for (const auto& [name, value] : request.head.query) {
    if (name != "filename") {
      return problem(request, {ErrorCode::kUnknownOption, "no such option", "filename",
                               "\"" + name.substr(0, 40) + "\""});
    }
  }
  auto upload = receive_upload(request, api);
  if (!upload) return problem(request, upload.error());
  auto asset = register_upload(request, api, *upload);
  if (!asset) return problem(request, asset.error());
  Response response = Response::json(asset->existed ? 200 : 201, text_of(asset_json(*asset)));
  response.headers["Location"] = "/v1/assets/" + asset->id;
  response.headers["ETag"] = "\"" + asset->id + "\"";
  return response;
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

Response list_assets(Request& request, Api& api) {
  auto page = requested_page(request, kListLimits);
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

// The members of the description, and those of the asset, which come last: what a worker says under
// their names does not count.
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

// A description is read while it is sent, within the budget of answers.
Response described_response(const Request& request, Api& api, const std::string& id,
                            const std::string& job = "") {
  Response response = Response::json(200, "");
  response.headers["ETag"] = "\"" + id + "\"";
  response.body = PieceBody{
      [&api, caller = request.caller, id, job] { return description_piece(api, caller, id, job); },
      kDescriptionBytesMax};
  return response;
}

// An inspect job makes the description on first use.
Response get_asset(Request& request, Api& api) {
  const auto asset = api.jobs.get_asset(request.caller, request.path_parameters[0]);
  if (!asset) return problem(request, asset.error());
  if (!asset->description_json.empty()) return described_response(request, api, asset->id);
  JobRequest job;
  job.kind = JobKind::kInspect;
  job.asset = asset->id;
  job.filename = asset->filename;
  const auto submitted = api.jobs.submit(request.caller, job, {});
  if (!submitted) return problem(request, submitted.error());
  const auto status = api.jobs.wait_end(
      request.caller, submitted->id,
      JobService::Clock::now() + std::chrono::seconds(kOneShotSecondsMax), request.client_gone);
  if (!status) return problem(request, status.error());
  if (status->state != JobState::kDone || !status->result) {
    return job_result_response(request, api, *status);
  }
  return described_response(request, api, asset->id, submitted->id);
}

Response delete_asset(Request& request, Api& api) {
  const Status status = api.jobs.delete_asset(request.caller, request.path_parameters[0]);
  if (!status) return problem(request, status.error());
  Response response;
  response.status = 204;
  return response;
}

}  // namespace

void add_asset_routes(Router& router, Api& api) {
  router.add("POST", "/v1/assets", [&api](Request& r) { return post_asset(r, api); });
  router.add("GET", "/v1/assets", [&api](Request& r) { return list_assets(r, api); });
  router.add("GET", "/v1/assets/{id}", [&api](Request& r) { return get_asset(r, api); });
  router.add("DELETE", "/v1/assets/{id}", [&api](Request& r) { return delete_asset(r, api); });
}

}  // namespace voxeld::http
