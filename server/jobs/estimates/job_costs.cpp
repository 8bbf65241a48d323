#include "server/jobs/estimates/job_costs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>
#include <vector>

#include "proto/options/words.h"
#include "server/base/disk/file.h"
#include "server/base/guard.h"
#include "server/base/log.h"

namespace voxeld {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr double kSaveSeconds = 30.0;
// Sorts are made of the options' words; more than these there cannot be.
constexpr size_t kSortsMax = 1000;

// On a small machine, at 256 voxels of a mesh of 1 MiB.
constexpr CostRegression::Guess kWorkerGuess{0.1, 1.6, 0.4};
constexpr CostRegression::Guess kDeviceGuess{0.02, 2.0, 0.3};
constexpr CostRegression::Guess kResultGuess{1e5, 2.0, 0.1};
constexpr CostRegression::Guess kHostGuess{1e8, 0.3, 0.3};

// Rays along each side of a pixel where the renderer chooses.
constexpr int kUsualSamples = 2;

constexpr std::array<std::string_view, 4> kQuantities = {"seconds", "device_seconds",
                                                         "result_bytes", "host_bytes"};

double side_of(const PlacementOptions& placement) {
  if (placement.dims) return *std::ranges::max_element(*placement.dims);
  return placement.size.value_or(kDefaultSize);
}

// Frames that the request names; 24 where it asks for all of an animation that nobody has read.
double frames_of(const AnimationOptions& animation) {
  constexpr double kUsualFrames = 24;
  if (!animation.is_sequence()) return 1;
  if (!animation.times_s.empty()) return static_cast<double>(animation.times_s.size());
  if (animation.frames) return (*animation.frames)[1] - (*animation.frames)[0] + 1;
  return kUsualFrames;
}

std::string voxelize_sort(const VoxelizeOptions& options) {
  constexpr std::array<std::string_view, 4> kFills = {" surface", " solid", " shell", " band"};
  std::string sort(kFills[static_cast<size_t>(options.fill)]);
  if (options.fill != Fill::kSurface && options.sign != Sign::kAuto) {
    sort += ' ';
    sort += option_words::sign_name(options.sign);
  }
  const auto has = [&](bool is_measure) {
    return std::ranges::any_of(kChannels, [&](const ChannelInfo& info) {
      return info.is_measure() == is_measure && options.names(info.channel);
    });
  };
  sort += options.channels && !has(/*is_measure=*/false) ? " occupancy" : " attributes";
  if (has(/*is_measure=*/true)) sort += " measures";
  return sort;
}

}  // namespace

JobWork work_of(JobKind kind, const RequestOptions& options, int64_t input_bytes) {
  JobWork work{std::string(job_kind_name(kind)), {}};
  if (kind == JobKind::kVoxelize || kind == JobKind::kExport) {
    work.sort += ' ';
    work.sort += format_name(options.output.format);
  }
  work.features.input_bytes = static_cast<double>(input_bytes);
  if (kind == JobKind::kVoxelize) {
    work.sort += voxelize_sort(options.voxelize);
    work.features.side = side_of(options.voxelize.placement);
    work.features.frames = frames_of(options.animation);
  } else if (kind == JobKind::kRender) {
    const RenderOptions& render = options.render;
    work.features.side = std::sqrt(static_cast<double>(render.width) * render.height) *
                         (render.samples > 0 ? render.samples : kUsualSamples);
    work.features.frames = render.turntable > 0 ? render.turntable : frames_of(options.animation);
  }
  return work;
}

MeasuredSeconds measured_seconds(const JobStatus& status) {
  MeasuredSeconds seconds;
  double staged = 0;  // on the device, with the waits for it
  for (const auto& [stage, ms] : status.timings) {
    if (stage == "queue" || stage == "upload") continue;
    const bool is_on_device = stage == "voxelize" || stage == "render";
    (is_on_device ? staged : seconds.worker) += ms / 1000;
  }
  seconds.device = status.device_ms > 0 ? std::min(staged, status.device_ms / 1000) : staged;
  seconds.worker += seconds.device;
  return seconds;
}

JobCosts::Sort::Sort()
    : worker_seconds(kWorkerGuess),
      device_seconds(kDeviceGuess),
      result_bytes(kResultGuess),
      host_bytes(kHostGuess) {}

CostRegression* JobCosts::Sort::find(std::string_view quantity) {
  if (quantity == kQuantities[0]) return &worker_seconds;
  if (quantity == kQuantities[1]) return &device_seconds;
  if (quantity == kQuantities[2]) return &result_bytes;
  if (quantity == kQuantities[3]) return &host_bytes;
  return nullptr;
}

JobCosts::JobCosts(fs::path file) : file_(std::move(file)) {
  load();
}

JobCosts::~JobCosts() {
  guarded("saving costs", [this] {
    const MutexLock lock(mutex_);
    if (is_new_) save();
  });
}

void JobCosts::load() {
  const MutexLock lock(mutex_);
  std::error_code failed;
  if (!fs::exists(file_, failed)) return;
  const auto bytes = read_file(file_);
  std::string_view text;
  if (bytes) text = {reinterpret_cast<const char*>(bytes->data()), bytes->size()};
  int broken = bytes ? 0 : 1;
  while (!text.empty() && sorts_.size() < kSortsMax) {
    const std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(text.size(), line.size() + 1));
    const size_t first = line.find('\t'), last = line.rfind('\t');
    if (first == line.npos || last == first) {
      ++broken;
      continue;
    }
    Sort& sort = sorts_[std::string(line.substr(0, first))];
    CostRegression* model = sort.find(line.substr(first + 1, last - first - 1));
    if (model == nullptr || !model->parse(line.substr(last + 1))) ++broken;
  }
  if (broken > 0) {
    log::warn("learned costs cannot be read; they are learned anew",
              {{"file", file_.string()}, {"lines", broken}});
  }
}

// Written beside and renamed, without sync.
void JobCosts::save() {
  std::string text;
  for (auto& [name, sort] : sorts_) {
    for (const std::string_view quantity : kQuantities) {
      text += name + "\t" + std::string(quantity) + "\t" + sort.find(quantity)->text() + "\n";
    }
  }
  const fs::path fresh = file_.string() + ".new";
  Status written = write_file(fresh, {reinterpret_cast<const uint8_t*>(text.data()), text.size()});
  std::error_code failed;
  if (written) fs::rename(fresh, file_, failed);
  if (!written || failed) {
    log::warn("learned costs cannot be written",
              {{"error", written ? failed.message() : written.error().message()}});
    fs::remove(fresh, failed);
  }
  since_saved_.lap();
  is_new_ = false;
}

JobEstimate JobCosts::estimate(const JobWork& work) const {
  const MutexLock lock(mutex_);
  static const Sort unknown;
  const auto found = sorts_.find(work.sort);
  const Sort& sort = found == sorts_.end() ? unknown : found->second;
  const CostRange worker = sort.worker_seconds.predict(work.features);
  CostFeatures one = work.features;
  one.frames = 1;  // memory is for one frame at a time
  JobEstimate estimate;
  estimate.seconds = worker.expected;
  estimate.seconds_low = worker.low;
  estimate.seconds_high = worker.high;
  estimate.device_seconds =
      std::min(worker.expected, sort.device_seconds.predict(work.features).expected);
  estimate.result_bytes = std::llround(sort.result_bytes.predict(work.features).expected);
  estimate.host_bytes = std::llround(sort.host_bytes.predict(one).expected);
  estimate.learned_from = sort.worker_seconds.observations();
  return estimate;
}

void JobCosts::learn(const JobWork& work, const JobStatus& done) {
  if (!done.result) return;
  const MeasuredSeconds seconds = measured_seconds(done);
  const json meta = json::parse(done.result->meta_json, nullptr, false);
  CostFeatures features = work.features;
  if (done.frames_total > 0) features.frames = static_cast<double>(done.frames_total);
  CostFeatures one = features;
  one.frames = 1;
  const MutexLock lock(mutex_);
  if (sorts_.size() >= kSortsMax && !sorts_.contains(work.sort)) return;
  Sort& sort = sorts_[work.sort];
  sort.worker_seconds.observe(features, seconds.worker);
  sort.device_seconds.observe(features, seconds.device);
  sort.result_bytes.observe(features, static_cast<double>(done.result->bytes));
  if (meta.is_object() && meta.contains("host_bytes_peak")) {
    const json& peak = meta["host_bytes_peak"];
    if (peak.is_number()) sort.host_bytes.observe(one, peak.get<double>());
  }
  note_new();
}

void JobCosts::learn_at_least(const JobWork& work, double device_seconds) {
  const MutexLock lock(mutex_);
  if (sorts_.size() >= kSortsMax && !sorts_.contains(work.sort)) return;
  Sort& sort = sorts_[work.sort];
  if (device_seconds <= sort.device_seconds.predict(work.features).expected) return;
  sort.device_seconds.observe(work.features, device_seconds);
  const double worker_seconds = sort.worker_seconds.predict(work.features).expected;
  sort.worker_seconds.observe(work.features, std::max(worker_seconds, device_seconds));
  note_new();
}

void JobCosts::note_new() {
  is_new_ = true;
  if (since_saved_.ms() > kSaveSeconds * 1000) save();
}

}  // namespace voxeld
