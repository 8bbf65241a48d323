#include "client/cli/commands/batch.h"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "client/cli/bundle.h"
#include "client/cli/output_file.h"
#include "client/cli/terminal/human.h"
#include "client/cli/terminal/progress_bar.h"
#include "client/cli/terminal/report.h"
#include "client/include/voxeld/client.h"

namespace voxeld::cli {
namespace {

using client::Error;
using client::JobInfo;
using Clock = std::chrono::steady_clock;
using Json = nlohmann::json;

constexpr auto kRedraw = std::chrono::milliseconds(100);

struct Outcome {
  JobInfo job;
  std::int64_t bytes = 0;
  std::optional<Error> error;
};

// Runs the jobs on threads of its own; the calling thread shows how far they are.
class Batch {
 public:
  Batch(const Arguments& arguments, std::stop_token stop)
      : arguments_(arguments), stop_(std::move(stop)), outcomes_(arguments.batch.size()) {}

  void run() {
    const size_t count = std::min<size_t>(kBatchJobsMax, outcomes_.size());
    std::vector<client::Client> daemons;  // what they refuse, such as a key, is no matter of a file
    daemons.reserve(count);
    for (size_t i = 0; i < count; ++i) daemons.emplace_back(settings_of(arguments_));
    std::vector<std::jthread> threads;
    threads.reserve(count);
    running_ = count;
    for (client::Client& daemon : daemons) threads.emplace_back([this, &daemon] { work(daemon); });
    while (running_ > 0) {
      show();
      std::this_thread::sleep_for(kRedraw);
    }
    threads.clear();
    bar_.clear();
  }

  const std::vector<Outcome>& outcomes() const { return outcomes_; }

 private:
  void work(client::Client& daemon) {
    for (size_t i = next_++; i < outcomes_.size() && !stop_.stop_requested(); i = next_++) {
      const auto start = Clock::now();
      Outcome outcome = make(daemon, arguments_.batch[i]);
      const std::chrono::duration<double> elapsed = Clock::now() - start;
      const std::lock_guard lock(mutex_);
      ++ended_;
      if (outcome.error) ++failed_;
      say(arguments_.batch[i], outcome, elapsed.count());
      outcomes_[i] = std::move(outcome);
    }
    --running_;
  }

  Outcome make(client::Client& daemon, const BatchFile& file) {
    Outcome outcome;
    try {
      const MeshSource mesh = MeshSource::open(file.input, {}, stop_);
      mesh.check_output(file.output);
      OutputFile output(file.output, stop_);
      const client::Sink sink = [&](std::span<const std::byte> piece) { output.write(piece); };
      const bool is_render = arguments_.command == Arguments::Command::kRender;
      outcome.job = is_render
                        ? daemon.render_to(mesh.source(), arguments_.options, sink, {}, stop_)
                        : daemon.voxelize_to(mesh.source(), arguments_.options, sink, {}, stop_);
      output.keep();
      outcome.bytes = static_cast<std::int64_t>(output.bytes());
    } catch (const Error& error) {
      outcome.error = error;
    } catch (const std::exception& error) {  // no memory
      outcome.error = Error("file", 0, error.what());
    }
    return outcome;
  }

  // Called with the mutex held.
  void say(const BatchFile& file, const Outcome& outcome, double seconds) {
    if (arguments_.quiet) return;
    bar_.clear();
    for (const std::string& warning : outcome.job.warnings) {
      std::fprintf(stderr, "voxel: %s\n", printable(file.input + ": warning: " + warning).c_str());
    }
    if (outcome.error || arguments_.json || isatty(STDERR_FILENO) != 1) return;
    std::fprintf(stderr, "%s\n",
                 result_line(file.output, outcome.job, outcome.bytes, seconds).c_str());
  }

  void show() {
    const std::lock_guard lock(mutex_);
    const std::string failed = failed_ == 0 ? "" : ", " + std::to_string(failed_) + " failed";
    bar_.show({"file " + std::to_string(std::min(next_.load(), outcomes_.size())) + " of " +
                   std::to_string(outcomes_.size()) + failed,
               ended_, static_cast<std::int64_t>(outcomes_.size()), "files"});
  }

  const Arguments& arguments_;
  const std::stop_token stop_;
  std::atomic<size_t> next_ = 0, running_ = 0;
  std::vector<Outcome> outcomes_;  // each written by one thread, read when all have ended
  std::mutex mutex_;               // guards what follows
  ProgressBar bar_{arguments_.quiet};
  std::int64_t ended_ = 0, failed_ = 0;
};

void print_report(const Arguments& arguments, const std::vector<Outcome>& outcomes) {
  Json files = Json::array();
  for (size_t i = 0; i < outcomes.size(); ++i) {
    const Outcome& outcome = outcomes[i];
    Json file = {{"input", arguments.batch[i].input}};
    if (outcome.error) {
      file["error"] = {{"code", outcome.error->code()}, {"message", outcome.error->what()}};
    } else {
      file["output"] = arguments.batch[i].output;
      file["bytes"] = outcome.bytes;
      file["meta"] = parsed(outcome.job.meta_json);
      file["job"] = parsed(outcome.job.json);
    }
    files.push_back(std::move(file));
  }
  print_json({{"files", files}});
}

}  // namespace

void tell_failures(const Arguments& arguments, const std::vector<std::optional<Error>>& errors) {
  size_t count = 0;
  const Error* first = nullptr;
  for (size_t i = 0; i < errors.size(); ++i) {
    if (!errors[i]) continue;
    const std::string line = arguments.batch[i].input + ": " + errors[i]->what();
    std::fprintf(stderr, "voxel: %s\n", printable(line).c_str());
    if (first == nullptr) first = &*errors[i];
    ++count;
  }
  if (first == nullptr) return;
  const std::string summary =
      std::to_string(count) + " of " + std::to_string(errors.size()) + " files failed";
  throw Error(count == errors.size() ? first->code() : "some-failed", 0, summary);
}

void run_batch(const Arguments& arguments, const std::stop_token& stop) {
  std::error_code failed;
  std::filesystem::create_directories(arguments.out_dir, failed);
  if (failed) throw Error("file", 0, arguments.out_dir + ": " + failed.message());
  Batch batch(arguments, stop);
  batch.run();
  if (stop.stop_requested()) throw Error("interrupted", 0, "stopped by the caller");
  if (arguments.json) print_report(arguments, batch.outcomes());
  std::vector<std::optional<Error>> errors;
  for (const Outcome& outcome : batch.outcomes()) errors.push_back(outcome.error);
  tell_failures(arguments, errors);
}

}  // namespace voxeld::cli
