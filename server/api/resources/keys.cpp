// /v1/keys: API keys for holders of an admin's key. `voxeld keys` does the same on the machine.
#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "proto/messages/job.h"
#include "proto/messages/json_fields.h"
#include "server/api/resources/list_body.h"
#include "server/api/resources/resources.h"
#include "server/base/clock.h"
#include "server/base/log.h"
#include "server/jobs/auth/key_changes.h"
#include "server/jobs/auth/key_file.h"

namespace voxeld::api {
namespace {

// Body of PATCH /v1/keys/{id}.
struct SettingsBody {
  KeySettings settings;
};

// Body of POST /v1/keys.
struct NewKeyBody {
  NewKey key;
};

void visit_settings(auto& settings, auto& visit) {
  visit(kOptional, "weight", settings.weight);
  visit(kOptional, "rate", settings.rate);
  visit(kOptional, "queued_jobs", settings.queued_jobs);
  visit(kOptional, "bytes", settings.bytes);
  visit(kOptional, "cells", settings.cells);
}

void visit_fields(IsA<SettingsBody> auto& body, auto& visit) {
  visit.name("key");
  visit_settings(body.settings, visit);
}

void visit_fields(IsA<NewKeyBody> auto& body, auto& visit) {
  visit.name("key");
  visit(kRequired, "name", body.key.tenant);
  visit(kOptional, "admin", body.key.is_admin);
  visit(kOptional, "expires", body.key.expires);
  visit_settings(body.key.settings, visit);
}

template <typename Body>
Result<Body> parse_key_body(const std::string& text) {
  VOXELD_ASSIGN(const nlohmann::json object, parse_json_bounded(text));
  Body body;
  VOXELD_TRY(read_fields(object, body, Unlisted::kRefuse));
  return body;
}

// Errors: conflict on a daemon without keys, forbidden without an admin's key.
Status check_admin(const Request& request) {
  if (request.key_id.empty()) {
    return Error{ErrorCode::kConflict, "this daemon has no API keys",
                 "the first one from voxeld keys add NAME --admin, on the daemon's machine", ""};
  }
  if (!request.caller.sees_all()) {
    return Error{ErrorCode::kForbidden, "only an admin may list and change keys",
                 "the key of an admin (voxeld keys add NAME --admin)", "the key of a tenant"};
  }
  return {};
}

// Makes a change count from the next request on, and logs it with the key that asked for it.
void note_change(const Request& request, const Api& api, std::string_view event,
                 const ApiKey& key) {
  api.keys.refresh();
  log::info(event, {{"key", key.id},
                    {"tenant", key.tenant},
                    {"role", key.is_admin ? "admin" : "tenant"},
                    {"by", request.caller.tenant()},
                    {"by_key", request.key_id},
                    {"request", request.request_id},
                    {"trace", request.trace.trace_id}});
}

Response key_response(int status, const ApiKey& key) {
  return Response::json(status, key_json(key, unix_time_ms()).dump());
}

Reply add_key_of_body(Request& request, Api& api, const std::string& text) {
  if (const Status may = check_admin(request); !may) return problem(request, may.error());
  const auto body = parse_key_body<NewKeyBody>(text);
  if (!body) return problem(request, body.error());
  const auto added = add_key(api.keys.data_dir(), body->key);
  if (!added) return problem(request, added.error());
  note_change(request, api, "API key added", added->key);
  nlohmann::json shown = key_json(added->key, unix_time_ms());
  shown["key"] = added->secret_text;
  return Response::json(201, shown.dump());
}

Reply set_limits_of_body(Request& request, Api& api, const std::string& text) {
  if (const Status may = check_admin(request); !may) return problem(request, may.error());
  const auto body = parse_key_body<SettingsBody>(text);
  if (!body) return problem(request, body.error());
  const auto key = set_key_limits(api.keys.data_dir(), request.path_parameters[0], body->settings);
  if (!key) return problem(request, key.error());
  note_change(request, api, "API key changed", *key);
  return key_response(200, *key);
}

// Asks for the body of an admin's request, which `handler` gets.
Reply with_body(Request& request, Api& api, Reply (*handler)(Request&, Api&, const std::string&)) {
  Status may = check_admin(request);
  if (may) may = check_json_type(request);
  if (!may) return problem(request, may.error());
  return TextBody{request.body_bytes_max,
                  [&api, handler](Request& asking, const std::string& text) {
                    return handler(asking, api, text);
                  }};
}

// The rows after the key with the id `after`, in the order of the file: the oldest first.
Status add_key_rows(const Api& api, const std::string& after, ListRows& rows) {
  VOXELD_ASSIGN(const auto keys, read_keys(key_file_path(api.keys.data_dir())));
  const KeyList list = keys.value_or(KeyList());
  auto key = list.begin();
  if (!after.empty()) {
    key = std::ranges::find(list, after, &ApiKey::id);
    if (key == list.end()) return bad_cursor(after);
    ++key;
  }
  const int64_t now_ms = unix_time_ms();
  while (key != list.end() && rows.add(key_json(*key, now_ms).dump(), key->id)) ++key;
  return {};
}

}  // namespace

Reply list_keys(Request& request, Api& api) {
  if (const Status may = check_admin(request); !may) return problem(request, may.error());
  auto page = requested_page(request);
  if (!page) return problem(request, page.error());
  return list_response(
      "", "keys", *std::move(page),
      [&api](const std::string& after, ListRows& rows) { return add_key_rows(api, after, rows); });
}

Reply post_key(Request& request, Api& api) {
  return with_body(request, api, add_key_of_body);
}

Reply patch_key(Request& request, Api& api) {
  return with_body(request, api, set_limits_of_body);
}

Reply delete_key(Request& request, Api& api) {
  if (const Status may = check_admin(request); !may) return problem(request, may.error());
  const auto key = revoke_key(api.keys.data_dir(), request.path_parameters[0], LastAdmin::kStays);
  if (!key) return problem(request, key.error());
  note_change(request, api, "API key revoked", *key);
  return key_response(200, *key);
}

}  // namespace voxeld::api
