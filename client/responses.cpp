#include "client/responses.h"

#include <nlohmann/json.hpp>

namespace voxeld::client {

using Json = nlohmann::json;

std::string text_of(const Json& object, const char* name) {
  const auto it = object.find(name);
  return it != object.end() && it->is_string() ? it->get<std::string>() : std::string();
}

int64_t number_of(const Json& object, const char* name) {
  const auto it = object.find(name);
  return it != object.end() && it->is_number_integer() ? it->get<int64_t>() : 0;
}

Json parse_object(const std::string& text) {
  Json body = Json::parse(text, nullptr, false);
  if (!body.is_object()) {
    throw Error("bad-response", 0,
                "the response is no JSON object: is there a voxeld at this URL?");
  }
  return body;
}

JobInfo job_info(const Json& status) {
  JobInfo info;
  info.id = text_of(status, "id");
  info.kind = text_of(status, "kind");
  info.state = text_of(status, "state");
  if (info.id.empty() || info.state.empty()) {
    throw Error("bad-response", 0, "the response is no job: is there a voxeld at this URL?");
  }
  info.stage = text_of(status, "stage");
  info.tiles_done = number_of(status, "tiles_done");
  info.tiles_total = number_of(status, "tiles_total");
  info.frames_done = number_of(status, "frames_done");
  info.frames_total = number_of(status, "frames_total");
  info.queue_position = number_of(status, "queue_position");
  info.grid = text_of(status, "grid");
  info.sequence = text_of(status, "sequence");
  info.json = status.dump();
  if (const auto result = status.find("result"); result != status.end() && result->is_object()) {
    info.bytes = number_of(*result, "bytes");
    info.media_type = text_of(*result, "media_type");
    if (const std::string grid = text_of(*result, "grid"); !grid.empty()) info.grid = grid;
    if (const std::string made = text_of(*result, "sequence"); !made.empty()) info.sequence = made;
    if (result->contains("meta")) info.meta_json = (*result)["meta"].dump();
    if (result->contains("warnings")) {
      for (const Json& warning : (*result)["warnings"]) {
        info.warnings.push_back(text_of(warning, "code") + ": " + text_of(warning, "detail"));
      }
    }
  }
  return info;
}

JobFrames job_frames(const Json& response) {
  JobFrames frames;
  frames.sequence = text_of(response, "sequence");
  frames.total = number_of(response, "frames_total");
  const auto list = response.find("frames");
  if (list == response.end() || !list->is_array()) {
    throw Error("bad-response", 0,
                "the response is no list of frames: is there a voxeld at this URL?");
  }
  for (const Json& frame : *list) {
    const double time_s =
        frame.contains("time_s") && frame["time_s"].is_number() ? frame["time_s"].get<double>() : 0;
    frames.frames.push_back({number_of(frame, "index"), time_s, text_of(frame, "grid"),
                             static_cast<std::uint64_t>(number_of(frame, "voxel_count")),
                             text_of(frame, "content_hash")});
  }
  return frames;
}

Queue queue_of(const Json& response) {
  const auto devices = response.find("devices"), jobs = response.find("jobs");
  if (devices == response.end() || jobs == response.end() || !devices->is_array() ||
      !jobs->is_array()) {
    throw Error("bad-response", 0, "the response is no queue: is there a voxeld at this URL?");
  }
  Queue queue;
  for (const Json& one : *devices) {
    QueueDevice device{text_of(one, "device"),
                       text_of(one, "renderer"),
                       number_of(one, "workers"),
                       number_of(one, "workers_busy"),
                       {}};
    for (const Json& id : one.value("jobs", Json::array())) {
      if (id.is_string()) device.jobs.push_back(id.get<std::string>());
    }
    queue.devices.push_back(std::move(device));
  }
  for (const Json& one : *jobs) {
    queue.jobs.push_back({job_info(one), text_of(one, "tenant"), text_of(one, "device"),
                          number_of(one, "created_ms"), number_of(one, "started_ms")});
  }
  queue.queued = number_of(response, "queued");
  queue.running = number_of(response, "running");
  const Json others = response.value("others", Json::object());
  queue.others_queued = number_of(others, "queued");
  queue.others_running = number_of(others, "running");
  queue.json = response.dump();
  return queue;
}

}  // namespace voxeld::client
