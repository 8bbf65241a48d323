#include "client/cli/commands/stored.h"

#include <chrono>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>

#include "client/cli/commands/job_result.h"
#include "client/cli/terminal/human.h"
#include "client/cli/terminal/report.h"
#include "client/include/voxeld/client.h"

namespace voxeld::cli {
namespace {

using client::Client;
using client::Error;
using client::JobInfo;
using Json = nlohmann::json;

// The size that was asked for: "256", "64,64,32", "0.01 a voxel".
std::string size_of(const Json& status) {
  const Json options = status.value("options", Json::object());
  const auto text = [&](const char* name) {
    const Json value = options.is_object() ? options.value(name, Json()) : Json();
    return value.is_null() ? "" : value.is_string() ? value.get<std::string>() : value.dump();
  };
  if (std::string dims = text("dims"); !dims.empty()) return dims;
  if (std::string edge = text("voxel_size"); !edge.empty()) return edge + " a voxel";
  return text("size");
}

// A note on a job beside its state: place in the queue, bytes, progress or error.
std::string note_of(const JobInfo& job, const Json& status) {
  if (job.state == "queued") return "place " + std::to_string(job.queue_position);
  if (job.state == "done") return bytes_text(job.bytes);
  if (job.state == "failed") return status.value("/error/code"_json_pointer, "");
  if (job.state != "running") return "";
  const auto progress = [&](std::int64_t done, std::int64_t total, const char* unit) {
    return job.stage + " " + std::to_string(done) + "/" + std::to_string(total) + unit;
  };
  if (job.frames_total > 0) return progress(job.frames_done, job.frames_total, " frames");
  if (job.tiles_total > 0) return progress(job.tiles_done, job.tiles_total, " tiles");
  return job.stage;
}

void print_jobs(const std::vector<JobInfo>& jobs) {
  Table table("lrllrll");
  table.add({"ID", "AGE", "STATE", "KIND", "SIZE", "RESULT", "FILE"});
  for (const JobInfo& job : jobs) {
    const Json status = parsed(job.json);
    table.add({job.id, age_text(status.value("created_ms", std::int64_t{0}), unix_now_ms()),
               job.state, job.kind, size_of(status), note_of(job, status),
               status.value("filename", "")});
  }
  std::fputs(table.text().c_str(), stdout);
}

void run_one_job(const Arguments& arguments) {
  Client daemon(settings_of(arguments));
  const JobInfo job = arguments.cancel ? daemon.cancel(arguments.job) : daemon.job(arguments.job);
  if (arguments.json) {
    print_json(parsed(job.json));
  } else {
    print_jobs({job});
  }
}

// A text such as "3 of 10", or "3" without a limit.
std::string use_of(const Json& me, const char* name, std::string (*text)(std::int64_t)) {
  const auto number = [&](const char* of) {
    const Json value = me.value(Json::json_pointer(std::string(of) + "/" + name), Json());
    return value.is_number_integer() ? std::optional(value.get<std::int64_t>()) : std::nullopt;
  };
  const auto limit = number("/limits");
  return text(number("/usage").value_or(0)) + (limit ? " of " + text(*limit) : "");
}

}  // namespace

void run_jobs(const Arguments& arguments, const std::stop_token& stop) {
  if (!arguments.job.empty() && !arguments.output.empty()) return run_job_result(arguments, stop);
  if (!arguments.job.empty()) return run_one_job(arguments);
  Client daemon(settings_of(arguments));
  const std::vector<JobInfo> jobs = daemon.jobs(arguments.limit);
  if (!arguments.json) return print_jobs(jobs);
  Json list = Json::array();
  for (const JobInfo& job : jobs) list.push_back(parsed(job.json));
  print_json({{"jobs", list}});
}

void run_share(const Arguments& arguments) {
  Client daemon(settings_of(arguments));
  const client::Link link = daemon.share(arguments.job, std::chrono::seconds(arguments.seconds));
  if (arguments.json) {
    print_json({{"url", link.url}, {"expires_ms", link.expires_ms}});
  } else {
    std::printf("%s\n", link.url.c_str());
  }
}

void run_list(const Arguments& arguments) {
  Client daemon(settings_of(arguments));
  const Json page = parsed(daemon.list_json(arguments.list, arguments.limit));
  const auto list = page.find(arguments.list);
  if (list == page.end() || !list->is_array()) {
    throw Error("bad-response", 0, "the response is no list: is there a voxeld at this URL?");
  }
  if (arguments.json) return print_json(page);
  Table table("lrrl");
  table.add({"ID", "AGE", "SIZE", arguments.list == "assets" ? "FILE" : "JOB"});
  for (const Json& stored : *list) {
    const auto text = [&](const char* name) { return stored.value(name, std::string()); };
    table.add({stored.contains("id") ? text("id") : text("job"),
               age_text(stored.value("created_ms", std::int64_t{0}), unix_now_ms()),
               bytes_text(stored.value("bytes", std::int64_t{0})),
               stored.contains("filename") ? text("filename") : text("job")});
  }
  std::fputs(table.text().c_str(), stdout);
}

void run_remove(const Arguments& arguments) {
  Client daemon(settings_of(arguments));
  Json removed = Json::array();
  std::optional<Error> first;
  for (const std::string& id : arguments.ids) {
    try {
      const std::string kind = daemon.remove(id);
      removed.push_back({{"id", id}, {"kind", kind}});
      if (!arguments.json && !arguments.quiet) std::printf("%s %s\n", kind.c_str(), id.c_str());
    } catch (const Error& error) {
      if (arguments.ids.size() > 1) {
        std::fprintf(stderr, "voxel: %s: %s\n", id.c_str(), printable(error.what()).c_str());
      }
      if (!first) first = error;
    }
  }
  if (arguments.json) print_json({{"deleted", removed}});
  if (first) throw *first;
}

void run_whoami(const Arguments& arguments) {
  Client daemon(settings_of(arguments));
  const Json me = parsed(daemon.whoami_json());
  if (!me.is_object() || !me.contains("tenant")) {
    throw Error("bad-response", 0, "the response names no tenant: is there a voxeld at this URL?");
  }
  if (arguments.json) return print_json(me);
  const std::string tenant = me.value("tenant", ""), key = me.value("key", "");
  const auto limit = [&](const char* name) {
    return me.value(Json::json_pointer(std::string("/limits/") + name), Json());
  };
  Table table("ll");
  table.add({"server", arguments.url});
  table.add({"tenant", (tenant.empty() ? "- (the daemon asks for no key)" : tenant) +
                           (me.value("admin", false) ? " (admin)" : "")});
  if (!key.empty()) table.add({"key", key});
  table.add({"queued jobs", use_of(me, "queued_jobs", count_text)});
  table.add({"running jobs", use_of(me, "running_jobs", count_text)});
  table.add({"storage", use_of(me, "bytes", bytes_text)});
  if (const Json rate = limit("requests_per_minute"); rate.is_number_integer()) {
    table.add({"requests", "at most " + count_text(rate.get<std::int64_t>()) + " per minute"});
  }
  if (const Json cells = limit("cells"); cells.is_number_integer()) {
    table.add({"cells", "at most " + count_text(cells.get<std::int64_t>()) + " in a job"});
  }
  std::fputs(table.text().c_str(), stdout);
}

}  // namespace voxeld::cli
