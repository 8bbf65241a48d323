#include <cstdio>
#include <nlohmann/json.hpp>

#include "server/doctor.h"
#include "server/jobs/retention/store_check.h"
#include "server/jobs/retention/store_rebuild.h"

namespace voxeld {
namespace {

using nlohmann::json;

void print_text(const StoreReport& report) {
  std::printf("store      %s%s\n", report.data_dir.c_str(),
              report.daemon_runs ? " (a daemon runs on it)" : "");
  std::printf("database   schema %lld: %lld jobs, %lld assets, %lld results\n",
              static_cast<long long>(report.schema_version), static_cast<long long>(report.jobs),
              static_cast<long long>(report.assets), static_cast<long long>(report.results));
  std::printf("files      %lld, %.1f MB, read in %.1f s\n", static_cast<long long>(report.blobs),
              static_cast<double>(report.bytes) / 1e6, report.hash_seconds);
  std::printf("orphans    %zu files that nothing names; the daemon moves them to quarantine\n",
              report.orphans.size());
  std::printf(
      "leftovers  %zu files of uploads and tasks that were cut off; the daemon removes "
      "them when it starts\n",
      report.leftovers.size());
  for (const StoreProblem& problem : report.problems) {
    std::printf("%-10s %s: %s\n", problem.kind.c_str(), problem.what.c_str(), problem.text.c_str());
  }
  if (report.problems.empty()) {
    std::printf("all is well\n");
    return;
  }
  std::printf(
      "\n%zu problems. A damaged or missing asset: upload the same bytes again. A result "
      "or grid: submit the job again.\nThe database: stop the daemon "
      "and put back a copy, or move it away and run voxeld doctor --rebuild. The keys: put back a "
      "copy.\n",
      report.problems.size());
}

void print_json(const StoreReport& report) {
  json object = {{"data_dir", report.data_dir.string()},
                 {"daemon_runs", report.daemon_runs},
                 {"schema_version", report.schema_version},
                 {"jobs", report.jobs},
                 {"assets", report.assets},
                 {"results", report.results},
                 {"blobs", report.blobs},
                 {"bytes", report.bytes},
                 {"hash_seconds", report.hash_seconds},
                 {"orphans", report.orphans},
                 {"leftovers", report.leftovers},
                 {"problems", json::array()}};
  for (const StoreProblem& problem : report.problems) {
    object["problems"].push_back(
        {{"kind", problem.kind}, {"what", problem.what}, {"text", problem.text}});
  }
  std::printf("%s\n", object.dump(2, ' ', false, json::error_handler_t::replace).c_str());
}

void print_text(const RebuildReport& report) {
  const auto number = [](int64_t count) { return static_cast<long long>(count); };
  std::printf("store      %s\n", report.data_dir.c_str());
  std::printf("known      %lld files that the database knew\n", number(report.known));
  std::printf("recovered  %lld assets, %lld grids, %lld sequences%s%s\n", number(report.assets),
              number(report.grids), number(report.sequences),
              report.tenant.empty() ? "" : " for tenant ", report.tenant.c_str());
  std::printf("left       %lld results in other formats, %lld damaged files\n",
              number(report.outputs), number(report.damaged));
  std::printf(
      "The daemon moves what is left to quarantine when it starts. Jobs, names and tenants "
      "of files are not recovered.\n");
}

void print_json(const RebuildReport& report) {
  const json object = {{"data_dir", report.data_dir.string()},
                       {"tenant", report.tenant},
                       {"known", report.known},
                       {"assets", report.assets},
                       {"grids", report.grids},
                       {"sequences", report.sequences},
                       {"outputs", report.outputs},
                       {"damaged", report.damaged}};
  std::printf("%s\n", object.dump(2, ' ', false, json::error_handler_t::replace).c_str());
}

// Prints it as the command wants, or the error to stderr. False: an error.
template <typename Report>
bool print(const Result<Report>& report, const DoctorCommand& command) {
  if (!report) {
    std::fprintf(stderr, "voxeld: %s\n", report.error().message().c_str());
    return false;
  }
  if (command.json) {
    print_json(*report);
  } else {
    print_text(*report);
  }
  return true;
}

}  // namespace

int doctor_rebuild_main(const DoctorCommand& command) {
  return print(rebuild_store(command.data_dir, command.tenant), command) ? 0 : 1;
}

int doctor_store_main(const DoctorCommand& command) {
  const auto report = check_store(command.data_dir);
  return print(report, command) && report->problems.empty() ? 0 : 1;
}

}  // namespace voxeld
