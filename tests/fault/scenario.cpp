// One life of the gateway with one call that fails: everything a client does, a restart, and then
// whether what was acknowledged is there. tests/fault/run_faults.py runs it for every call in turn.
//
//   fault_scenario run CLASS NUMBER CODE DIR    prints "fired=0|1 calls=N"; exit status 0: all well
//   fault_scenario worker --gateway G --device D    what its supervisor starts
#include <errno.h>
#include <execinfo.h>
#include <signal.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <functional>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "server/base/log.h"
#include "server/base/sha256.h"
#include "server/jobs/retention/store_check.h"
#include "server/jobs/service/job_service.h"
#include "server/process/memory_reserve.h"
#include "tests/fault/fault_points.h"
#include "tests/unit/jobs/fake_worker.h"
#include "tests/unit/jobs/wait_job.h"

namespace voxeld::testing {
namespace {

namespace fs = std::filesystem;
using Clock = JobService::Clock;

constexpr std::chrono::seconds kJobSecondsMax{60};
constexpr int kSqliteFull = 13;
constexpr int kTriesMax = 4;  // the fault comes once; what it broke must work again at once

std::string fault_class, self;
int fault_errno = 0;

// Prints the place of a crash, for addr2line.
void print_backtrace(int signal) {
  voxeld_fault_disarm();
  void* frames[64];
  ::backtrace_symbols_fd(frames, ::backtrace(frames, 64), 2);
  ::signal(signal, SIG_DFL);
  ::raise(signal);
}

[[noreturn]] void broken(const std::string& what) {
  voxeld_fault_pause();
  std::fprintf(stderr, "BROKEN: %s\n", what.c_str());
  std::_Exit(1);
}

void require(bool holds, const std::string& what) {
  if (!holds) broken(what);
}

bool fault_fired() {
  return voxeld_fault_fired() != 0;
}

// Whether the fault says that there is no space.
bool is_full_fault() {
  return fault_class == "sqlite" ? fault_errno == kSqliteFull
                                 : fault_errno == ENOSPC && !fault_class.starts_with("alloc");
}

void check_error(const std::string& step, const Error& error) {
  require(fault_fired(), step + " failed without a fault: " + error.message());
  if (!is_full_fault()) return;
  // SQLite tries once more without creating the file or changing it, and then knows another reason.
  for (const char* other : {"unable to open database file", "cannot write to"}) {
    if (error.detail.find(other) != std::string::npos) return;
  }
  require(error.code == ErrorCode::kStorageFull,
          step + ": a full disk is storage-full, not: " + error.message());
}

// Runs the call as the HTTP server does: what it throws is one failed request.
template <typename Call>
auto attempt(const std::string& step, Call&& call) {
  for (int tries = 1;; ++tries) {
    voxeld_fault_resume();
    auto result = [&]() -> decltype(call()) {
      try {
        return call();
      } catch (const std::exception& failure) {
        return Error{};
      }
    }();
    voxeld_fault_pause();
    if (result) return std::move(result).value();
    const bool thrown = result.error().detail.empty();
    if (thrown) {
      require(fault_fired(), step + " threw without a fault");
    } else {
      check_error(step, result.error());
    }
    if (tries == kTriesMax) broken(step + " fails again: " + result.error().message());
  }
}

std::string text_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

class Life {
 public:
  explicit Life(fs::path dir) : dir_(std::move(dir)) {}

  void live() {
    start();
    const std::string a = put_asset("mesh a", "a.ply"), b = put_asset("mesh b", "b.ply");
    put_bundle({{"a.ply", a}, {"b.ply", b}});
    const std::string first = submit(a, "key 1");
    end_of(first, JobState::kDone);
    require(submit(a, "key 1") == first, "the same key gave another job");
    check_result(first);
    end_of(submit(a, ""), JobState::kDone);
    end_of(submit(put_asset("moving", "frames.md5mesh"), ""), JobState::kDone);
    start();
    end_of(submit(put_asset("bad", "fail.ply"), ""), JobState::kFailed);
    // With a key: a submit that is tried again would leave a second job, which nobody cancels.
    const std::string slow = submit(put_asset("slow", "slow.ply"), "key slow");
    attempt("cancel", [&] { return service_->cancel(Caller::open(), slow); });
    end_of(slow, JobState::kCancelled);
    attempt("delete", [&]() -> Result<bool> {
      const Status deleted = service_->delete_asset(Caller::open(), b);
      if (deleted || deleted.error().code == ErrorCode::kGone) return true;
      return deleted.error();
    });
    deleted_.insert(b);
    assets_.erase(b);
    attempt("list", [&] { return all_jobs(); });
    attempt("list assets", [&]() -> Result<bool> {
      VOXELD_TRY(service_->list_assets(Caller::open(), {}, [](const Asset&) { return true; }));
      return true;
    });
    stop();
  }

  Result<std::vector<JobStatus>> all_jobs() {
    std::vector<JobStatus> all;
    VOXELD_TRY(service_->list(Caller::open(), {}, [&](const ListedJob& job) {
      all.push_back(job.status);
      return true;
    }));
    return all;
  }

  // Without faults from here on.
  void check() {
    check_files(/*is_clean=*/false);
    start();
    for (const auto& [id, text] : assets_) {
      require(service_->get_asset(Caller::open(), id).ok(), "an asset was lost: " + text);
    }
    for (const std::string& id : deleted_) {
      const auto asset = service_->get_asset(Caller::open(), id);
      require(!asset && asset.error().code == ErrorCode::kGone, "a deleted asset is back");
    }
    for (const auto& [id, state] : jobs_) {
      const auto status = service_->get(Caller::open(), id);
      require(status.ok(), "a job was lost: " + id);
      require(status->state == state, "a job ended twice: " + id);
      if (state == JobState::kDone) check_result(id);
    }
    for (const auto& [key, id] : keys_) {
      require(submit(key.second, key.first) == id, "a key was forgotten");
    }
    // All the rows there are: nobody else submitted anything.
    const auto all = all_jobs();
    require(all && all->size() <= jobs_.size() + 1, "there are jobs that nobody submitted");
    for (const JobStatus& status : *all) end_of(status.id, std::nullopt);
    wait_for_sweep();
    stop();
    check_files(/*is_clean=*/true);
  }

 private:
  void start() {
    stop();
    attempt("start", [&]() -> Result<bool> {
      JobServiceConfig config;
      config.data_dir = dir_;
      config.devices = {"fake"};
      config.worker_executable = self;
      config.storage.disk_reserve_bytes = 0;
      VOXELD_ASSIGN(service_, start_job_service(config, nullptr));
      return true;
    });
  }
  void stop() {
    voxeld_fault_resume();
    service_.reset();
    voxeld_fault_pause();
  }

  BlobInfo upload(const std::string& text) {
    return attempt("upload", [&]() -> Result<BlobInfo> {
      VOXELD_ASSIGN(BlobWriter writer, service_->begin_upload(1 << 20));
      VOXELD_TRY(writer.append({reinterpret_cast<const uint8_t*>(text.data()), text.size()}));
      return writer.finish();
    });
  }
  std::string put_asset(const std::string& text, const std::string& name) {
    const BlobInfo blob = upload(text);
    const auto asset =
        attempt("put asset", [&] { return service_->put_asset(Caller::open(), blob, name, ""); });
    require(asset.id == sha256_id(text), "an asset has another's name");
    assets_[asset.id] = text;
    return asset.id;
  }
  void put_bundle(const std::vector<BundleFile>& files) {
    const BlobInfo blob = upload("manifest");
    attempt("put bundle",
            [&] { return service_->put_bundle(Caller::open(), blob, "x.json", files); });
    assets_[blob.id] = "manifest";
  }
  std::string submit(const std::string& asset, const std::string& key) {
    JobRequest request;
    request.asset = asset;
    SubmitOptions options;
    options.idempotency_key = key;
    const auto status =
        attempt("submit", [&] { return service_->submit(Caller::open(), request, options); });
    if (!key.empty()) keys_[{key, asset}] = status.id;
    return status.id;
  }
  // Waits; a fault on the gateway's side of the task may fail the job instead, with its reason.
  void end_of(const std::string& id, std::optional<JobState> expected) {
    const auto status = attempt(
        "wait", [&] { return testing::wait_end(*service_, Caller::open(), id, kJobSecondsMax); });
    require(status.ended(), "a job hangs: " + id + ", " +
                                std::string(job_state_name(status.state)) + " in attempt " +
                                std::to_string(status.attempt));
    if (!expected) return;
    if (status.state != *expected) {
      require(status.state == JobState::kFailed && status.error.has_value(),
              "a job ended as " + std::string(job_state_name(status.state)));
      check_error("the job", *status.error);
    }
    jobs_[id] = status.state;
  }
  void check_result(const std::string& id) {
    if (jobs_[id] != JobState::kDone) return;
    const auto blob = attempt("result", [&] { return service_->get_result(Caller::open(), id); });
    const std::string text = text_of(blob.path);
    require(text.starts_with("result of j-") && sha256_id(text) == blob.id,
            "a result has other bytes: " + text);
    const auto status = attempt("get", [&] { return service_->get(Caller::open(), id); });
    if (status.result->sequence.empty()) return;
    const auto manifest = attempt("sequence", [&] {
      return service_->get_sequence(Caller::open(), status.result->sequence);
    });
    require(manifest.frames.size() == 2, "a sequence lacks frames");
    for (const SequenceFrame& frame : manifest.frames) {
      attempt("frame", [&] { return service_->get_grid(Caller::open(), frame.grid); });
    }
  }

  // The sweep looks for orphans right after the start.
  void wait_for_sweep() {
    const auto deadline = Clock::now() + kJobSecondsMax;
    while (Clock::now() < deadline) {
      const auto report = check_store(dir_);
      if (report && report->orphans.empty()) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  }
  void check_files(bool is_clean) {
    const auto report = check_store(dir_);
    require(report.ok(), "the store cannot be checked");
    for (const StoreProblem& problem : report->problems) {
      broken(problem.kind + " " + problem.what + ": " + problem.text);
    }
    if (!is_clean) return;
    require(report->orphans.empty(), "files stay that nothing names");
    require(report->leftovers.empty(),
            "temporary files stay: " + (report->leftovers.empty() ? "" : report->leftovers[0]));
  }

  const fs::path dir_;
  std::unique_ptr<JobService> service_;
  std::map<std::string, std::string> assets_;
  std::set<std::string> deleted_;
  std::map<std::string, JobState> jobs_;
  std::map<std::pair<std::string, std::string>, std::string> keys_;  // key and asset -> job
};

int run_main(int argc, char** argv) {
  if (argc != 6) return 64;
  fault_class = argv[2];
  const long number = std::atol(argv[3]);
  fault_errno = std::atoi(argv[4]);
  const fs::path dir = argv[5];
  ::signal(SIGPIPE, SIG_IGN);
  for (const int crash : {SIGABRT, SIGSEGV, SIGBUS}) ::signal(crash, print_backtrace);
  voxeld_fault_pause();
  voxeld_fault_arm(fault_class.c_str(), number, fault_errno);
  Life life(dir);
  life.live();
  voxeld_fault_disarm();
  const bool fired = fault_fired();
  const long calls = voxeld_fault_count();
  life.check();
  std::printf("fired=%d calls=%ld\n", fired ? 1 : 0, calls);
  return 0;
}

// As fake_worker_main(), and an asset called frames… becomes a sequence.
int worker_main(const std::string& gateway, const std::string& device) {
  FakeWorker worker(gateway.substr(std::string("unix:").size()), device);
  while (const auto task = worker.claim()) {
    if (task->filename.starts_with("fail")) {
      worker.fail(*task, {ErrorCode::kMalformedMesh, "fail.ply line 1", "", ""});
    } else if (task->filename.starts_with("slow")) {
      while (true) {
        const TaskProgressReply reply = worker.progress(*task, "voxelize", 1, 2);
        if (reply.fenced) return 0;
        if (reply.cancel) break;
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
      }
      worker.fail(*task, {ErrorCode::kCancelled, "the job was cancelled", "", ""});
    } else if (task->filename.starts_with("frames")) {
      bool goes_on = true;
      for (int64_t i = 0; i < 2 && goes_on; ++i) {
        const TaskFrameReply reply = worker.frame(*task, i, "frame " + std::to_string(i), 2);
        goes_on = !reply.fenced && !reply.cancel;
      }
      if (goes_on) worker.complete_sequence(*task, {"frame 0", "frame 1"}, "result of " + task->id);
    } else {
      worker.complete(*task, "result of " + task->id);
    }
  }
  return 0;
}

}  // namespace
}  // namespace voxeld::testing

int main(int argc, char** argv) {
  const std::string command = argc > 1 ? argv[1] : "";
  voxeld::log::configure(voxeld::log::Level::kError, "gateway");
  voxeld::hold_memory_reserve();
  voxeld::testing::self = std::filesystem::read_symlink("/proc/self/exe").string();
  if (command == "run") return voxeld::testing::run_main(argc, argv);
  if (command == "worker" && argc >= 6) return voxeld::testing::worker_main(argv[3], argv[5]);
  std::fprintf(stderr, "usage: %s run CLASS NUMBER CODE DIR\n", argv[0]);
  return 64;
}
