#include <unistd.h>

#include <cstdio>
#include <string>

#include "server/jobs/service/job_service.h"
#include "tests/unit/jobs/fake_worker.h"

namespace {

// Submits jobs for `asset` until it is killed, and prints the id of each that was acknowledged.
int submit_main(const std::string& data_dir, const std::string& asset) {
  voxeld::JobServiceConfig config;
  config.data_dir = data_dir;
  config.start_workers = false;
  auto service = voxeld::start_job_service(config, nullptr);
  if (!service) {
    std::fprintf(stderr, "%s\n", service.error().message().c_str());
    return 1;
  }
  voxeld::JobRequest request;
  request.asset = asset;
  while (true) {
    const auto job = (*service)->submit(voxeld::Caller::open(), request, {});
    if (!job) return 2;
    const std::string line = job->id + "\n";
    if (::write(STDOUT_FILENO, line.data(), line.size()) < 0) return 0;
  }
}

}  // namespace

int main(int argc, char** argv) {
  const std::string command = argc > 1 ? argv[1] : "";
  if (command == "submit" && argc == 4) return submit_main(argv[2], argv[3]);
  if (command == "worker" && argc >= 6) return voxeld::testing::fake_worker_main(argv[3], argv[5]);
  std::fprintf(stderr, "usage: %s submit DIR ASSET | worker --gateway G --device D\n", argv[0]);
  return 64;
}
