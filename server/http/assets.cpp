// /v1/assets: uploads by content, and what is in them.
#include <nlohmann/json.hpp>

#include "server/http/api.h"

namespace voxeld::http {
namespace {

using Json = nlohmann::json;

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

Response list_assets(Request& request, Api& api) {
  auto assets = api.jobs.list_assets(request.caller, 1000);
  if (!assets) return problem(request, assets.error());
  Json list = Json::array();
  for (const Asset& asset : *assets) list.push_back(asset_json(asset));
  return Response::json(200, text_of({{"assets", list}}));
}

// Members of the description beside those of the asset; an inspect job makes it on first use.
Response get_asset(Request& request, Api& api) {
  auto asset = api.jobs.get_asset(request.caller, request.path_parameters[0]);
  if (!asset) return problem(request, asset.error());
  if (asset->description_json.empty()) {
    JobRequest job;
    job.kind = JobKind::kInspect;
    job.asset = asset->id;
    job.filename = asset->filename;
    auto submitted = api.jobs.submit(request.caller, job, {});
    if (!submitted) return problem(request, submitted.error());
    auto status = api.jobs.wait_end(
        request.caller, submitted->id,
        JobService::Clock::now() + std::chrono::seconds(kOneShotSecondsMax), request.client_gone);
    if (!status) return problem(request, status.error());
    if (status->state != JobState::kDone || !status->result) {
      return job_result_response(request, api, *status);
    }
    asset->description_json = status->result->meta_json;
  }
  Json out = asset_json(*asset);
  const Json description = Json::parse(asset->description_json, nullptr, false);
  if (description.is_object()) {
    for (const auto& [name, value] : description.items()) out.emplace(name, value);
  }
  Response response = Response::json(200, text_of(out));
  response.headers["ETag"] = "\"" + asset->id + "\"";
  return response;
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
