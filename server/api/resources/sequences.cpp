// /v1/jobs/{id}/frames, also while the job runs, and /v1/sequences/{id}: all frames of an animation
// in any format, and as images.
#include <limits>

#include "proto/container/sequence_format.h"
#include "proto/messages/json_writer.h"
#include "proto/text/client_texts.h"
#include "proto/text/number_text.h"
#include "server/api/resources/jobs/job_responses.h"
#include "server/api/resources/jobs/job_wait.h"
#include "server/api/resources/list_body.h"
#include "server/api/resources/resources.h"

namespace voxeld::api {
namespace {

// The most frames that there can be: a sequence is one page, unless less is asked for.
constexpr ListLimits kFrameLimits{limits::kFramesMax, limits::kFramesMax};

std::string frame_json(int64_t index, const SequenceFrame& frame) {
  std::string text;
  JsonWriter(text)
      .begin_object()
      .member("index", index)
      .member("time_s", frame.time_s)
      .member("grid", frame.grid)
      .member("voxel_count", frame.voxel_count)
      .member("content_hash", frame.content_hash)
      .end_object();
  return text;
}

void write_channels(JsonWriter& json, const ChannelSet& channels) {
  json.key("channels").begin_array();
  for (const ChannelInfo& info : kChannels) {
    if (channels.has(info.channel)) json.value(info.name);
  }
  json.end_array();
}

// The number of a frame that a path names; nullopt for any other text.
std::optional<int64_t> frame_number(const std::string& text) {
  return parse_number<int64_t>(text, 0, std::numeric_limits<int64_t>::max());
}

// "3 of 140 frames are done"; where the number of all is not known yet, "3 frames are done".
Error no_frame(const JobFrames& frames, const std::string& got) {
  const std::string total = std::to_string(frames.frames_total);
  const std::string done = std::to_string(frames.frames_done);
  return {ErrorCode::kNotFound,
          frames.frames_total > 0 ? done + " of " + total + " frames are done"
                                  : done + " frames are done",
          "the number of one that is done", echoed(got)};
}

// The grid of the frame that the path names.
Result<std::string> frame_of_job(const Request& request, Api& api) {
  const auto index = frame_number(request.path_parameters[1]);
  const FrameRange range{index.value_or(0), index ? 1 : 0};
  VOXELD_ASSIGN(const JobFrames frames,
                api.jobs.frames(request.caller, request.path_parameters[0], range));
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
using Respond = Reply (*)(Request&, Api&, const std::string&);

Reply with_frame(Request& request, Api& api, FindGrid find, Respond respond) {
  const auto grid = find(request, api);
  if (!grid) return problem(request, grid.error());
  return respond(request, api, *grid);
}

// The rows after `after`, read from the database in batches of about a piece.
Status add_frames_of_job(Api& api, const Caller& caller, const std::string& job,
                         const std::string& after, ListRows& rows) {
  constexpr int64_t kBatch = 256;
  VOXELD_ASSIGN(const int64_t last, cursor_number(after));
  FrameRange range{last + 1, kBatch};
  while (true) {
    VOXELD_ASSIGN(const JobFrames frames, api.jobs.frames(caller, job, range));
    for (const ListedFrame& listed : frames.frames) {
      if (!rows.add(frame_json(listed.index, listed.frame), std::to_string(listed.index))) {
        return {};
      }
      range.first = listed.index + 1;
    }
    if (static_cast<int64_t>(frames.frames.size()) < kBatch) return {};
  }
}

// The manifest is read again for each piece, because it is larger in memory than the response.
Status add_frames_of_sequence(Api& api, const Caller& caller, const std::string& id,
                              const std::string& after, ListRows& rows) {
  VOXELD_ASSIGN(const int64_t last, cursor_number(after));
  VOXELD_ASSIGN(const SequenceManifest manifest, api.jobs.get_sequence(caller, id));
  for (auto i = static_cast<size_t>(last + 1); i < manifest.frames.size(); ++i) {
    const std::string row = frame_json(static_cast<int64_t>(i), manifest.frames[i]);
    if (!rows.add(row, std::to_string(i))) break;
  }
  return {};
}

Reply run_on_sequence(Request& request, Api& api, JobKind kind) {
  JobRequest job;
  job.kind = kind;
  job.sequence = request.path_parameters[0];
  auto options = parse_options(request.head.query, option_scope(job));
  if (!options) return problem(request, options.error());
  job.options = *std::move(options);
  return run_transient(request, api, job, [&api](Request& asking, const JobStatus& ended) {
    return job_result_response(asking, api, ended);
  });
}

}  // namespace

Reply list_frames_of_job(Request& request, Api& api) {
  auto page = requested_page(request, kFrameLimits);
  if (!page) return problem(request, page.error());
  const std::string& id = request.path_parameters[0];
  const auto frames = api.jobs.frames(request.caller, id, {0, 0});
  if (!frames) return problem(request, frames.error());
  std::string head;
  JsonWriter json(head);
  json.member("job", frames->job).key("sequence");
  if (frames->sequence.empty()) {
    json.raw("null");
  } else {
    json.value(frames->sequence);
  }
  json.member("frames_total", frames->frames_total);
  return list_response(
      std::move(head), "frames", *std::move(page),
      [&api, caller = request.caller, id](const std::string& after, ListRows& rows) {
        return add_frames_of_job(api, caller, id, after, rows);
      });
}

Reply get_frame_of_job(Request& request, Api& api) {
  return with_frame(request, api, frame_of_job, grid_response);
}

Reply render_frame_of_job(Request& request, Api& api) {
  return with_frame(request, api, frame_of_job, grid_image);
}

Reply list_frames_of_sequence(Request& request, Api& api) {
  auto page = requested_page(request, kFrameLimits);
  if (!page) return problem(request, page.error());
  const std::string& id = request.path_parameters[0];
  const auto manifest = api.jobs.get_sequence(request.caller, id);
  if (!manifest) return problem(request, manifest.error());
  std::string head;
  JsonWriter json(head);
  json.key("job")
      .raw("null")
      .member("sequence", id)
      .member("frames_total", manifest->frames.size())
      .member("fps", manifest->fps)
      .member("dims", manifest->dims)
      .member("origin", manifest->origin)
      .member("voxel_size", manifest->voxel_size);
  write_channels(json, manifest->channels);
  return list_response(
      std::move(head), "frames", *std::move(page),
      [&api, caller = request.caller, id](const std::string& after, ListRows& rows) {
        return add_frames_of_sequence(api, caller, id, after, rows);
      });
}

Reply get_frame_of_sequence(Request& request, Api& api) {
  return with_frame(request, api, frame_of_sequence, grid_response);
}

Reply render_frame_of_sequence(Request& request, Api& api) {
  return with_frame(request, api, frame_of_sequence, grid_image);
}

Reply get_sequence(Request& request, Api& api) {
  const auto format =
      requested_format(request, sequence_media_type, sequence_media_type(Format::kNative));
  if (!format) return problem(request, format.error());
  if (*format && !request.query("format")) {
    request.head.query.emplace_back("format", format_name(**format));
  }
  return run_on_sequence(request, api, JobKind::kExport);
}

Reply render_sequence(Request& request, Api& api) {
  if (!request.query("image")) request.head.query.emplace_back("image", "gif");
  return run_on_sequence(request, api, JobKind::kRender);
}

}  // namespace voxeld::api
