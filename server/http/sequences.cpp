// /v1/jobs/{id}/frames, while the job runs too, and /v1/sequences/{id}: what several frames are
// together, in any format and as pictures.
#include <charconv>
#include <nlohmann/json.hpp>

#include "proto/range_text.h"
#include "proto/sequence_format.h"
#include "server/http/api.h"

namespace voxeld::http {
namespace {

using Json = nlohmann::json;

Json frame_json(int64_t index, const SequenceFrame& frame) {
  return {{"index", index},
          {"time_s", frame.time_s},
          {"grid", frame.grid},
          {"voxel_count", frame.voxel_count},
          {"content_hash", frame.content_hash}};
}

Json channel_names(const ChannelSet& channels) {
  Json names = Json::array();
  for (const ChannelInfo& info : kChannels) {
    if (channels.has(info.channel)) names.push_back(info.name);
  }
  return names;
}

// The number of a frame that a path names; nullopt for any other text.
std::optional<int64_t> frame_number(const std::string& text) {
  int64_t index = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), index);
  if (error != std::errc() || end != text.data() + text.size() || index < 0) return std::nullopt;
  return index;
}

// "3 of 140 frames are done"; where the number of all is not known yet, "3 frames are done".
Error no_frame(const JobFrames& frames, const std::string& got) {
  const std::string total = std::to_string(frames.frames_total);
  const std::string done = std::to_string(frames.frames.size());
  return {ErrorCode::kNotFound,
          frames.frames_total > 0 ? done + " of " + total + " frames are done"
                                  : done + " frames are done",
          "the number of one that is done", "\"" + got.substr(0, 40) + "\""};
}

// The grid of the frame that the path names.
Result<std::string> frame_of_job(const Request& request, Api& api) {
  VOXELD_ASSIGN(const JobFrames frames,
                api.jobs.frames(request.caller, request.path_parameters[0]));
  const auto index = frame_number(request.path_parameters[1]);
  for (const ListedFrame& listed : frames.frames) {
    if (index == listed.index) return listed.frame.grid;
  }
  return no_frame(frames, request.path_parameters[1]);
}

Result<std::string> frame_of_sequence(const Request& request, Api& api) {
  VOXELD_ASSIGN(const SequenceManifest manifest,
                api.jobs.get_sequence(request.caller, request.path_parameters[0]));
  const auto index = frame_number(request.path_parameters[1]);
  const size_t count = manifest.frames.size();
  if (index && static_cast<uint64_t>(*index) < count) {
    return manifest.frames[static_cast<size_t>(*index)].grid;
  }
  return Error{ErrorCode::kNotFound, "there is no such frame", index_text(count, "frames"),
               "\"" + request.path_parameters[1].substr(0, 40) + "\""};
}

using FindGrid = Result<std::string> (*)(const Request&, Api&);
using Answer = Response (*)(Request&, Api&, const std::string&);

Response with_frame(Request& request, Api& api, FindGrid find, Answer answer) {
  const auto grid = find(request, api);
  if (!grid) return problem(request, grid.error());
  return answer(request, api, *grid);
}

Response list_frames_of_job(Request& request, Api& api) {
  const auto frames = api.jobs.frames(request.caller, request.path_parameters[0]);
  if (!frames) return problem(request, frames.error());
  Json list = Json::array();
  for (const ListedFrame& listed : frames->frames) {
    list.push_back(frame_json(listed.index, listed.frame));
  }
  return Response::json(
      200, Json{{"job", frames->job},
                {"sequence", frames->sequence.empty() ? Json() : Json(frames->sequence)},
                {"frames_total", frames->frames_total},
                {"frames", std::move(list)}}
               .dump());
}

Response list_frames_of_sequence(Request& request, Api& api) {
  const std::string& id = request.path_parameters[0];
  const auto manifest = api.jobs.get_sequence(request.caller, id);
  if (!manifest) return problem(request, manifest.error());
  Json list = Json::array();
  for (const SequenceFrame& frame : manifest->frames) {
    list.push_back(frame_json(static_cast<int64_t>(list.size()), frame));
  }
  return Response::json(200, Json{{"job", Json()},
                                  {"sequence", id},
                                  {"frames_total", list.size()},
                                  {"frames", list},
                                  {"fps", manifest->fps},
                                  {"dims", manifest->dims},
                                  {"origin", manifest->origin},
                                  {"voxel_size", manifest->voxel_size},
                                  {"channels", channel_names(manifest->channels)}}
                                 .dump());
}

Response run_on_sequence(Request& request, Api& api, JobKind kind) {
  JobRequest job;
  job.kind = kind;
  job.sequence = request.path_parameters[0];
  auto options = parse_options(request.head.query, option_scope(job));
  if (!options) return problem(request, options.error());
  job.options = *std::move(options);
  return run_transient(request, api, job);
}

Response get_sequence(Request& request, Api& api) {
  const auto format = requested_format(request, sequence_media_type);
  if (!format) return problem(request, format.error());
  if (*format && !request.query("format")) {
    request.head.query.emplace_back("format", format_name(**format));
  }
  return run_on_sequence(request, api, JobKind::kExport);
}

Response render_sequence(Request& request, Api& api) {
  if (!request.query("picture")) request.head.query.emplace_back("picture", "gif");
  return run_on_sequence(request, api, JobKind::kRender);
}

// {prefix} and {prefix}/render.png of one frame.
void add_frame_routes(Router& router, Api& api, const std::string& prefix, FindGrid find) {
  router.add("GET", prefix,
             [&api, find](Request& r) { return with_frame(r, api, find, grid_response); });
  router.add("GET", prefix + "/render.png",
             [&api, find](Request& r) { return with_frame(r, api, find, grid_picture); });
}

}  // namespace

void add_sequence_routes(Router& router, Api& api) {
  router.add("GET", "/v1/jobs/{id}/frames",
             [&api](Request& r) { return list_frames_of_job(r, api); });
  add_frame_routes(router, api, "/v1/jobs/{id}/frames/{index}", frame_of_job);
  router.add("GET", "/v1/sequences/{id}", [&api](Request& r) { return get_sequence(r, api); });
  router.add("GET", "/v1/sequences/{id}/frames",
             [&api](Request& r) { return list_frames_of_sequence(r, api); });
  add_frame_routes(router, api, "/v1/sequences/{id}/frames/{index}", frame_of_sequence);
  router.add("GET", "/v1/sequences/{id}/render",
             [&api](Request& r) { return render_sequence(r, api); });
}

}  // namespace voxeld::http
