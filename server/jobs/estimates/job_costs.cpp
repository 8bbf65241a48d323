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

// Frames that the request names, or those of its sequence; a usual number where it asks for all of
// an animation.
double frames_of(const AnimationOptions& animation, const JobInput& input) {
  constexpr double kUsualFrames = 100;
  if (!animation.is_sequence()) return static_cast<double>(input.frames);
  if (!animation.times_s.empty()) return static_cast<double>(animation.times_s.size());
  if (animation.frames) return (*animation.frames)[1] - (*animation.frames)[0] + 1;
  return kUsualFrames;
}

double images_of(const RequestOptions& options, const JobInput& input) {
  if (options.render.turntable > 0) return options.render.turntable;
  return options.render.image == ImageKind::kPng ? 1 : frames_of(options.animation, input);
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

// Reading does not depend on the grid.
CostFeatures reading_features(const JobWork& work) {
  CostFeatures features;
  features.input_bytes = work.features.input_bytes;
  return features;
}

CostRange times(const CostRange& range, double factor) {
  return {range.expected * factor, range.low * factor, range.high * factor};
}

}  // namespace

JobWork work_of(JobKind kind, const RequestOptions& options, const JobInput& input) {
  JobWork work;
  work.sort = job_kind_name(kind);
  work.read_sort = "read " + std::string(form_name(input.form));
  if (kind == JobKind::kVoxelize || kind == JobKind::kExport) {
    work.sort += ' ';
    work.sort += format_name(options.output.format);
  }
  work.features.input_bytes = static_cast<double>(input.bytes);
  if (kind == JobKind::kVoxelize) {
    work.sort += voxelize_sort(options.voxelize);
    work.features.side = longest_side(options.voxelize.placement);
    work.frames = frames_of(options.animation, input);
  } else if (kind == JobKind::kExport) {
    work.frames = frames_of(options.animation, input);
  } else if (kind == JobKind::kRender) {
    work.features.side = ray_side(options.render);
    work.frames = images_of(options, input);
  }
  work.guess = guess_costs(kind, options, input);
  return work;
}

MeasuredSeconds measured_seconds(const JobStatus& status) {
  MeasuredSeconds seconds;
  double staged = 0;  // on the device, with the waits for it
  for (const auto& [stage, ms] : status.timings) {
    if (stage == "queue" || stage == "upload") continue;
    const bool is_on_device = stage == "voxelize" || stage == "render";
    (is_on_device ? staged : seconds.worker) += ms / 1000;
    if (stage == "parse") seconds.read += ms / 1000;
  }
  seconds.device = status.device_ms > 0 ? std::min(staged, status.device_ms / 1000) : staged;
  seconds.worker += seconds.device;
  return seconds;
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
    const auto* const quantity =
        std::ranges::find(kQuantities, line.substr(first + 1, last - first - 1));
    if (quantity == kQuantities.end()) {
      ++broken;
      continue;
    }
    Sort& sort = sorts_[std::string(line.substr(0, first))];
    CostRegression& model = sort[static_cast<size_t>(quantity - kQuantities.begin())];
    if (!model.parse(line.substr(last + 1))) ++broken;
  }
  if (broken > 0) {
    log::warn("learned costs cannot be read; they are learned anew",
              {{"file", file_.string()}, {"lines", broken}});
  }
}

// Written beside and renamed, without sync.
void JobCosts::save() {
  std::string text;
  for (const auto& [name, sort] : sorts_) {
    for (size_t i = 0; i < sort.size(); ++i) {
      if (sort[i].observations() == 0) continue;
      text += name + "\t" + std::string(kQuantities[i]) + "\t" + sort[i].text() + "\n";
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

JobCosts::Sort* JobCosts::sort_of(std::string_view name) {
  const auto found = sorts_.find(name);
  if (found != sorts_.end()) return &found->second;
  return sorts_.size() < kSortsMax ? &sorts_[std::string(name)] : nullptr;
}

const CostRegression& JobCosts::factor(std::string_view sort, Quantity quantity) const {
  static const CostRegression unknown;
  const auto found = sorts_.find(sort);
  return found == sorts_.end() ? unknown : found->second[static_cast<size_t>(quantity)];
}

CostRange JobCosts::device_seconds(const JobWork& work) const {
  return times(factor(work.sort, Quantity::kDeviceSeconds).predict(work.features),
               work.guess.device_seconds * work.frames);
}

JobEstimate JobCosts::estimate(const JobWork& work) const {
  const MutexLock lock(mutex_);
  const auto expected = [&](Quantity quantity, double guess) REQUIRES(mutex_) {
    return std::llround(factor(work.sort, quantity).predict(work.features).expected * guess);
  };
  const CostRegression& learned = factor(work.sort, Quantity::kSeconds);
  const CostRange read =
      times(factor(work.read_sort, Quantity::kSeconds).predict(reading_features(work)),
            work.guess.read_seconds);
  const CostRange rest =
      times(learned.predict(work.features), work.guess.work_seconds * work.frames);
  JobEstimate estimate;
  estimate.seconds = read.expected + rest.expected;
  estimate.seconds_low = read.low + rest.low;
  estimate.seconds_high = read.high + rest.high;
  estimate.device_seconds = std::min(rest.expected, device_seconds(work).expected);
  estimate.result_bytes = expected(Quantity::kResultBytes, work.guess.result_bytes * work.frames);
  // Memory is for one frame at a time.
  estimate.host_bytes = expected(Quantity::kHostBytes, work.guess.host_bytes);
  estimate.learned_from = learned.observations();
  return estimate;
}

void JobCosts::learn(const JobWork& work, const JobStatus& done) {
  if (!done.result) return;
  MeasuredSeconds seconds = measured_seconds(done);
  const json meta = json::parse(done.result->meta_json, nullptr, false);
  // Frames are read, too, as the work of each.
  const bool is_sequence = done.frames_total > 0;
  if (is_sequence) seconds.read = 0;
  const double frames = is_sequence ? static_cast<double>(done.frames_total) : work.frames;
  const MutexLock lock(mutex_);
  Sort* const sort = sort_of(work.sort);
  if (sort == nullptr) return;
  const auto observe = [&](Quantity quantity, double cost, double guess) REQUIRES(mutex_) {
    (*sort)[static_cast<size_t>(quantity)].observe(work.features, cost / guess);
  };
  const JobGuess& guess = work.guess;
  observe(Quantity::kSeconds, seconds.worker - seconds.read, guess.work_seconds * frames);
  observe(Quantity::kDeviceSeconds, seconds.device, guess.device_seconds * frames);
  observe(Quantity::kResultBytes, static_cast<double>(done.result->bytes),
          guess.result_bytes * frames);
  if (meta.is_object() && meta.contains("host_bytes_peak")) {
    const json& peak = meta["host_bytes_peak"];
    if (peak.is_number()) observe(Quantity::kHostBytes, peak.get<double>(), guess.host_bytes);
  }
  if (Sort* const reading = sort_of(work.read_sort); reading != nullptr && !is_sequence) {
    (*reading)[0].observe(reading_features(work), seconds.read / guess.read_seconds);
  }
  note_new();
}

void JobCosts::learn_at_least(const JobWork& work, double device_seconds) {
  const MutexLock lock(mutex_);
  Sort* const sort = sort_of(work.sort);
  if (sort == nullptr || device_seconds <= this->device_seconds(work).expected) return;
  const auto observe = [&](Quantity quantity, double cost, double guess) REQUIRES(mutex_) {
    CostRegression& factor = (*sort)[static_cast<size_t>(quantity)];
    cost = std::max(cost, factor.predict(work.features).expected * guess);
    factor.observe(work.features, cost / guess);
  };
  observe(Quantity::kDeviceSeconds, device_seconds, work.guess.device_seconds * work.frames);
  observe(Quantity::kSeconds, device_seconds, work.guess.work_seconds * work.frames);
  note_new();
}

void JobCosts::note_new() {
  is_new_ = true;
  if (since_saved_.ms() > kSaveSeconds * 1000) save();
}

}  // namespace voxeld
