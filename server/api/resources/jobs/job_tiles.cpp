// /v1/jobs/{id}/tiles: the tiles of a job's grid, also while the job runs.
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "proto/container/distance_unit.h"
#include "proto/container/grid_directory.h"
#include "proto/container/grid_excerpt.h"
#include "proto/container/grid_format.h"
#include "proto/output_format.h"
#include "proto/text/client_texts.h"
#include "proto/text/number_text.h"
#include "server/api/resources/jobs/job_responses.h"
#include "server/api/resources/jobs/job_wait.h"
#include "server/api/resources/resources.h"
#include "server/base/disk/file.h"

namespace voxeld::api {
namespace {

// Tiles of one response, so that its header, meta and directory fit into one piece.
constexpr size_t kTilesMax = 960;

// A container that is sent from a file which may be removed meanwhile.
class ExcerptBody {
 public:
  ExcerptBody(std::shared_ptr<const UniqueFd> file, GridExcerpt excerpt)
      : file_(std::move(file)), excerpt_(std::move(excerpt)), at_(excerpt_.first_byte) {}

  Result<Piece> next() {
    Piece piece;
    const std::vector<uint8_t> front = std::exchange(excerpt_.front, {});
    piece.text.assign(front.begin(), front.end());
    const size_t had = piece.text.size();
    const auto room = std::max<uint64_t>(kPieceBytesMax, had) - had;
    piece.text.resize(had + std::min(room, excerpt_.end_byte - at_));
    VOXELD_TRY(read(std::span(piece.text).subspan(had)));
    piece.is_last = at_ == excerpt_.end_byte;
    return piece;
  }

 private:
  Status read(std::span<char> out) {
    while (!out.empty()) {
      const ssize_t count = ::pread(file_->get(), out.data(), out.size(), static_cast<off_t>(at_));
      if (count < 0 && errno == EINTR) continue;
      if (count < 0) return errno_error("read", "tiles");
      if (count == 0) return Error{ErrorCode::kInternal, "a file of tiles ends early", "", ""};
      at_ += static_cast<uint64_t>(count);
      out = out.subspan(static_cast<size_t>(count));
    }
    return {};
  }

  const std::shared_ptr<const UniqueFd> file_;
  GridExcerpt excerpt_;
  uint64_t at_;  // of the file
};

Error no_such_tile(int64_t after, size_t count) {
  return {ErrorCode::kInvalidOption, "after: tiles that the client has",
          range_text(0, static_cast<int64_t>(count)), std::to_string(after)};
}

// No more tiles come.
Response all_tiles_sent() {
  Response response;
  response.status = 204;
  return response;
}

// The meta of the tiles from number `after` on, with the unit of their distances.
Result<std::string> meta_of_tiles(const JobStatus& status, std::span<const uint8_t> container,
                                  const GridHeader& header, int64_t after) {
  nlohmann::json meta = {{"job", status.id}, {"first_tile", after}};
  if (header.channels.distance) {
    VOXELD_ASSIGN(const GridReader reader, GridReader::open(container));
    const auto whole = nlohmann::json::parse(reader.header().meta_json, nullptr, false);
    if (has_world_distances(whole)) meta["options"]["distance"] = whole["options"]["distance"];
  }
  return meta.dump();
}

// The tiles of the file from number `after` of the grid on; nullopt if the file is gone because its
// job has ended meanwhile.
Result<std::optional<Response>> send_tiles(const JobStatus& status, const TileFile& tiles,
                                           int64_t after) {
  UniqueFd fd(::open(tiles.path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!fd.valid() && errno == ENOENT) return std::optional<Response>();
  if (!fd.valid()) return errno_error("open", tiles.path);
  VOXELD_ASSIGN(const MappedFile file, MappedFile::open(tiles.path));
  VOXELD_ASSIGN(const GridDirectory directory, GridDirectory::open(file.bytes()));
  const auto first = static_cast<uint64_t>(after - tiles.first_tile);
  if (first == directory.tile_count() && status.ended()) return std::optional(all_tiles_sent());
  if (first >= directory.tile_count()) return no_such_tile(after, directory.tile_count());
  VOXELD_ASSIGN(const std::string meta,
                meta_of_tiles(status, file.bytes(), directory.header(), after));
  VOXELD_ASSIGN(GridExcerpt excerpt, excerpt_tiles(file.bytes(), first, kTilesMax, meta));
  Response response;
  response.headers["Content-Type"] = format_media_type(Format::kNative);
  response.headers["Cache-Control"] = "no-store";
  response.headers["X-Voxeld-Job"] = status.id;
  response.headers["X-Voxeld-Next"] =
      std::to_string(after + static_cast<int64_t>(excerpt.tile_count));
  const auto kept = std::make_shared<const UniqueFd>(std::move(fd));
  const auto body = std::make_shared<ExcerptBody>(kept, std::move(excerpt));
  response.body = PieceBody{[body] { return body->next(); }, kPieceBytesMax, kept};
  return std::optional(std::move(response));
}

// The tiles after those that the client has; without new ones, the status of the job.
Response respond_with_tiles(const Request& request, Api& api, const JobStatus& status,
                            int64_t after) {
  if (status.ended() && status.state != JobState::kDone) {
    return job_result_response(request, api, status);  // why there is none
  }
  const auto tiles = api.jobs.tiles_of(status, after);
  if (!tiles) return problem(request, tiles.error());
  if (*tiles) {
    auto sent = send_tiles(status, **tiles, after);
    if (!sent) return problem(request, sent.error());
    if (*sent) return **std::move(sent);
  }
  return status_response(request, api, 202, status);
}

}  // namespace

// With `Prefer: wait`, the response waits for the next tile or the end of the job.
Reply get_tiles_of_job(Request& request, Api& api) {
  const std::string text = request.query("after").value_or("0");
  const auto parsed = parse_number<int64_t>(text, 0, std::numeric_limits<int32_t>::max());
  if (!parsed) {
    return problem(request, {ErrorCode::kInvalidOption, "after: tiles that the client has",
                             "a number from 0 on", echoed(text)});
  }
  const int64_t after = *parsed;
  const std::string& id = request.path_parameters[0];
  const auto status = api.jobs.get(request.caller, id);
  if (!status) return problem(request, status.error());
  const int wait = preferred_wait_seconds(request);
  const auto has_news = [&api, after](const JobStatus& now) {
    const auto tiles = api.jobs.tiles_of(now, after);
    return !tiles || *tiles;
  };
  if (wait == 0 || status->ended() || has_news(*status)) {
    return respond_with_tiles(request, api, *status, after);
  }
  auto place = api.waits.take(request.caller.tenant());
  if (!place) return problem(request, place.error());
  JobWaitPlan plan;
  plan.job = id;
  plan.place = *std::move(place);
  plan.deadline = Clock::now() + std::chrono::seconds(wait);
  plan.change = JobChange::kAny;
  plan.is_poll = true;
  plan.is_over = has_news;
  plan.then = [&api, after](Request& asking, const JobStatus& now) {
    return respond_with_tiles(asking, api, now, after);
  };
  return wait_for_job(request, api, std::move(plan));
}

}  // namespace voxeld::api
