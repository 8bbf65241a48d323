#include "client/cli/commands.h"

#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>

#include "client/cli/api_key.h"
#include "client/cli/bundle.h"
#include "client/cli/output_file.h"
#include "client/cli/progress_bar.h"
#include "client/cli/top.h"
#include "proto/container/sequence_format.h"
#include "proto/options/options.h"

namespace voxeld::cli {
namespace {

using client::Client;
using client::Error;
using client::JobInfo;
using Json = nlohmann::json;

constexpr int kJsonIndent = 2;

client::Settings settings_of(const Arguments& arguments) {
  client::Settings settings;
  settings.url = arguments.url;
  settings.key = api_key(arguments.key);
  settings.timeout = std::chrono::seconds(arguments.timeout_s);
  return settings;
}

Json parsed(const std::string& text) {
  Json value = Json::parse(text, nullptr, false);
  return value.is_discarded() ? Json() : value;
}

void print_json(const Json& value) {
  const std::string text = value.dump(kJsonIndent, ' ', false, Json::error_handler_t::replace);
  std::printf("%s\n", text.c_str());
}

// The path for data; without -o it is stdout.
std::string output_of(const Arguments& arguments) {
  if (!arguments.output.empty()) return arguments.output;
  if (isatty(STDOUT_FILENO) == 1) {
    throw Error("invalid-option", 0, "data is not written to a terminal: name a file with -o");
  }
  return "-";
}

void tell_warnings(const Arguments& arguments, const JobInfo& job) {
  if (arguments.quiet) return;
  for (const std::string& warning : job.warnings) {
    std::fprintf(stderr, "voxel: warning: %s\n", warning.c_str());
  }
}

// Prints one line for people, to stderr, so it cannot mix with data.
void tell_grid(const JobInfo& job, const Json& meta, const std::string& output,
               std::uint64_t bytes) {
  if (isatty(STDERR_FILENO) != 1) return;
  if (job.frames_total > 0) {
    std::fprintf(stderr, "%s: %lld frames, %llu bytes\n", output.c_str(),
                 static_cast<long long>(job.frames_total), static_cast<unsigned long long>(bytes));
    return;
  }
  if (!meta.contains("dims") || !meta.contains("voxel_count")) return;
  std::fprintf(stderr, "%s: %d x %d x %d cells, %lld voxels, %llu bytes\n", output.c_str(),
               meta["dims"][0].get<int>(), meta["dims"][1].get<int>(), meta["dims"][2].get<int>(),
               meta["voxel_count"].get<long long>(), static_cast<unsigned long long>(bytes));
}

// Runs `make(sink, progress)`, which produces one job's result, and writes it to the output.
template <typename Make>
void write_result(const Arguments& arguments, Make&& make) {
  const std::string path = output_of(arguments);
  OutputFile output(path);
  ProgressBar bar(arguments.quiet);
  const JobInfo job = make([&](std::span<const std::byte> piece) { output.write(piece); },
                           [&](const client::Progress& progress) {
                             bar.show(progress);
                             return true;
                           });
  output.keep();
  bar.clear();
  tell_warnings(arguments, job);
  const Json meta = parsed(job.meta_json);
  if (arguments.json) {
    print_json({{"meta", meta}, {"job", parsed(job.json)}, {"bytes", output.bytes()}});
  } else if (!arguments.quiet) {
    tell_grid(job, meta, path, output.bytes());
  }
}

// Waits for a job that this command submitted. If interrupted, cancels the job.
JobInfo wait_or_cancel(Client& daemon, const std::string& job,
                       const client::ProgressCallback& progress, const std::stop_token& stop) {
  try {
    return daemon.wait(job, progress, stop);
  } catch (const Error& error) {
    if (error.code() != "interrupted") throw;
  }
  try {
    daemon.cancel(job);
  } catch (const Error&) {  // the job ended or the daemon is gone: both are as the user wanted
  }
  throw Error("interrupted", 0, "stopped by the caller");
}

void run_voxelize(const Arguments& arguments, const std::stop_token& stop) {
  Client daemon(settings_of(arguments));
  const MeshSource mesh = MeshSource::open(arguments.input, arguments.beside);
  write_result(arguments, [&](const client::Sink& sink, const client::ProgressCallback& progress) {
    return daemon.voxelize_to(mesh.source(), arguments.options, sink, progress, stop);
  });
}

void run_render(const Arguments& arguments, const std::stop_token& stop) {
  Client daemon(settings_of(arguments));
  if (arguments.input.empty()) {
    const client::Input input = {"", arguments.grid, arguments.sequence};
    write_result(arguments,
                 [&](const client::Sink& sink, const client::ProgressCallback& progress) {
                   JobInfo job = daemon.submit("render", input, arguments.options);
                   job = wait_or_cancel(daemon, job.id, progress, stop);
                   daemon.download(job.id, sink, progress, stop);
                   return job;
                 });
    return;
  }
  const MeshSource mesh = MeshSource::open(arguments.input, arguments.beside);
  write_result(arguments, [&](const client::Sink& sink, const client::ProgressCallback& progress) {
    return daemon.render_to(mesh.source(), arguments.options, sink, progress, stop);
  });
}

void print_job(const JobInfo& job) {
  std::string note = job.stage;
  if (job.state == "queued") note = "position " + std::to_string(job.queue_position);
  if (job.state == "done") note = std::to_string(job.bytes) + " bytes";
  if (job.state == "failed") note = parsed(job.json).value("/error/code"_json_pointer, "");
  if (job.frames_total > 0 && job.state == "running") {
    note += " frame " + std::to_string(job.frames_done) + "/" + std::to_string(job.frames_total);
  } else if (job.tiles_total > 0 && job.state == "running") {
    note += " " + std::to_string(job.tiles_done) + "/" + std::to_string(job.tiles_total);
  }
  std::printf("%-34s %-10s %-10s %s\n", job.id.c_str(), job.kind.c_str(), job.state.c_str(),
              note.c_str());
}

void run_jobs(const Arguments& arguments, const std::stop_token& stop) {
  Client daemon(settings_of(arguments));
  if (arguments.job.empty()) {
    const std::vector<JobInfo> jobs = daemon.jobs(arguments.limit);
    if (arguments.json) {
      Json list = Json::array();
      for (const JobInfo& job : jobs) list.push_back(parsed(job.json));
      print_json({{"jobs", list}});
      return;
    }
    for (const JobInfo& job : jobs) print_job(job);
    return;
  }
  if (!arguments.output.empty()) {
    write_result(arguments,
                 [&](const client::Sink& sink, const client::ProgressCallback& progress) {
                   JobInfo job = daemon.wait(arguments.job, progress, stop);
                   daemon.download(job.id, sink, progress, stop);
                   return job;
                 });
    return;
  }
  const JobInfo job = arguments.cancel ? daemon.cancel(arguments.job) : daemon.job(arguments.job);
  if (arguments.json) {
    print_json(parsed(job.json));
  } else {
    print_job(job);
  }
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

// Prints a line of `voxel ls`: id, bytes, other names.
void print_stored(const Json& stored) {
  const auto text = [&](const char* name) { return stored.value(name, std::string()); };
  const std::string id = stored.contains("id") ? text("id") : text("job");
  const std::string note = stored.contains("filename") ? text("filename") : text("job");
  std::printf("%-71s %12lld  %s\n", id.c_str(), stored.value("bytes", 0LL), note.c_str());
}

void run_list(const Arguments& arguments) {
  Client daemon(settings_of(arguments));
  const Json page = parsed(daemon.list_json(arguments.list, arguments.limit));
  const auto list = page.find(arguments.list);
  if (list == page.end() || !list->is_array()) {
    throw Error("bad-response", 0, "the response is no list: is there a voxeld at this URL?");
  }
  if (arguments.json) {
    print_json(page);
    return;
  }
  for (const Json& stored : *list) print_stored(stored);
}

// Continues after an id that cannot be deleted. The first such error becomes the command's.
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
        std::fprintf(stderr, "voxel: %s: %s\n", id.c_str(), error.what());
      }
      if (!first) first = error;
    }
  }
  if (arguments.json) print_json({{"deleted", removed}});
  if (first) throw *first;
}

// A text such as "3 of 10", or "3" without a limit.
std::string use_of(const Json& me, const char* name) {
  const auto path = [&](const char* of) {
    return Json::json_pointer(std::string(of) + "/" + name);
  };
  const Json used = me.value(path("/usage"), Json(0)), limit = me.value(path("/limits"), Json());
  return used.dump() + (limit.is_null() ? "" : " of " + limit.dump());
}

void run_whoami(const Arguments& arguments) {
  Client daemon(settings_of(arguments));
  const Json me = parsed(daemon.whoami_json());
  if (!me.is_object() || !me.contains("tenant")) {
    throw Error("bad-response", 0, "the response names no tenant: is there a voxeld at this URL?");
  }
  if (arguments.json) {
    print_json(me);
    return;
  }
  const std::string tenant = me.value("tenant", ""), key = me.value("key", "");
  const Json rate = me.value("/limits/requests_per_minute"_json_pointer, Json());
  const Json cells = me.value("/limits/cells"_json_pointer, Json());
  std::printf("tenant       %s%s\n",
              tenant.empty() ? "- (the daemon asks for no key)" : tenant.c_str(),
              me.value("admin", false) ? " (admin)" : "");
  if (!key.empty()) std::printf("key          %s\n", key.c_str());
  std::printf("queued jobs  %s\nrunning jobs %s\nbytes        %s\n",
              use_of(me, "queued_jobs").c_str(), use_of(me, "running_jobs").c_str(),
              use_of(me, "bytes").c_str());
  if (!rate.is_null()) std::printf("requests     at most %s per minute\n", rate.dump().c_str());
  if (!cells.is_null()) std::printf("cells        at most %s in a job\n", cells.dump().c_str());
}

std::vector<std::byte> read_whole(const std::string& path) {
  std::ifstream file;
  if (path != "-") {
    file.open(path, std::ios::binary);
    if (!file) throw Error("file", 0, path + ": cannot be opened");
  }
  std::vector<std::byte> bytes;
  const auto read = [&](std::span<char> buffer) {
    if (path == "-") return std::fread(buffer.data(), 1, buffer.size(), stdin);
    file.read(buffer.data(), static_cast<std::streamsize>(buffer.size()));
    return static_cast<size_t>(file.gcount());
  };
  std::vector<char> buffer(1 << 20);
  while (const size_t count = read(buffer)) {
    const auto piece = std::as_bytes(std::span(buffer).first(count));
    bytes.insert(bytes.end(), piece.begin(), piece.end());
  }
  return bytes;
}

// Prints the placement of a grid or a sequence.
template <typename Voxels>
void print_place(const Voxels& voxels) {
  std::string holds = "occupancy";
  for (const std::string_view channel : voxels.channels()) holds += ", " + std::string(channel);
  const auto dims = voxels.dims();
  const auto origin = voxels.origin();
  const auto edge = voxels.voxel_size();
  std::printf(
      "cells       %d x %d x %d\norigin      %.9g %.9g %.9g\n"
      "voxel size  %.9g %.9g %.9g\nholds       %s\n",
      dims[0], dims[1], dims[2], origin[0], origin[1], origin[2], edge[0], edge[1], edge[2],
      holds.c_str());
}

void info_of_grid(const Arguments& arguments) {
  const std::vector<std::byte> bytes = read_whole(arguments.input);
  const client::Grid grid = client::Grid::decode(bytes);
  Json object = {{"dims", grid.dims()},
                 {"origin", grid.origin()},
                 {"voxel_size", grid.voxel_size()},
                 {"voxel_count", grid.voxel_count()},
                 {"color", grid.has_color()},
                 {"normal", grid.has_normal()},
                 {"channels", grid.channels()},
                 {"bytes", bytes.size()},
                 {"meta", parsed(grid.meta_json())}};
  if (arguments.json) {
    print_json(object);
    return;
  }
  print_place(grid);
  std::printf("voxels      %llu\nbytes       %zu\n",
              static_cast<unsigned long long>(grid.voxel_count()), bytes.size());
}

void info_of_sequence(const Arguments& arguments) {
  std::vector<std::byte> container = read_whole(arguments.input);
  const size_t bytes = container.size();
  const auto sequence = client::Sequence::decode(std::move(container));
  Json frames = Json::array();
  for (size_t i = 0; i < sequence.frame_count(); ++i) {
    frames.push_back({{"time_s", sequence.time_s(i)}, {"voxel_count", sequence.voxel_count(i)}});
  }
  if (arguments.json) {
    print_json({{"dims", sequence.dims()},
                {"origin", sequence.origin()},
                {"voxel_size", sequence.voxel_size()},
                {"channels", sequence.channels()},
                {"fps", sequence.fps()},
                {"frames", frames},
                {"bytes", bytes},
                {"meta", parsed(sequence.meta_json())}});
    return;
  }
  print_place(sequence);
  std::printf("frames      %zu, %.9g s to %.9g s\nbytes       %zu\n", sequence.frame_count(),
              sequence.time_s(0), sequence.time_s(sequence.frame_count() - 1), bytes);
}

void info_of_mesh(const Arguments& arguments, const std::stop_token& stop) {
  Client daemon(settings_of(arguments));
  const MeshSource mesh = MeshSource::open(arguments.input, arguments.beside);
  ProgressBar bar(arguments.quiet);
  const std::string asset = daemon.upload(
      mesh.source(),
      [&](const client::Progress& progress) {
        bar.show(progress);
        return true;
      },
      stop);
  client::Options options;
  if (!mesh.source().filename().empty()) options.set("filename", mesh.source().filename());
  JobInfo job = daemon.submit("inspect", client::Input::of_asset(asset), options);
  job = wait_or_cancel(daemon, job.id, {}, stop);
  bar.clear();
  Json meta = parsed(job.meta_json);
  if (arguments.json) {
    meta["id"] = asset;
    print_json(meta);
    return;
  }
  tell_warnings(arguments, job);
  std::printf("asset      %s\n", asset.c_str());
  for (const auto& [name, value] : meta.items()) {
    if (name == "warnings") continue;  // printed above
    const std::string text = value.is_string() ? value.get<std::string>() : value.dump();
    std::printf("%-10s %s\n", name.c_str(), text.c_str());
  }
}

void run_info(const Arguments& arguments, const std::stop_token& stop) {
  const auto extension = std::filesystem::path(arguments.input).extension();
  if (extension == format_extension(Format::kNative)) {
    info_of_grid(arguments);
  } else if (extension == sequence_extension(Format::kNative)) {
    info_of_sequence(arguments);
  } else {
    info_of_mesh(arguments, stop);
  }
}

void run_top(const Arguments& arguments, const std::stop_token& stop) {
  Client daemon(settings_of(arguments));
  watch_queue(arguments, daemon, stop);
}

void run_formats(const Arguments& arguments) {
  Json written = Json::array();
  for (const FormatInfo& format : output_formats()) {
    written.push_back(std::string(format.extension));
    if (format.extension != format.sequence_extension) {
      written.push_back(std::string(format.sequence_extension));
    }
  }
  const Json object = {{"read", {"obj", "ply", "stl", "off", "gltf", "glb", "md5mesh", "zip"}},
                       {"write", written},
                       {"image", {".png", ".gif", ".apng"}}};
  if (arguments.json) {
    print_json(object);
    return;
  }
  std::printf(
      "reads   .obj with .mtl and textures, .ply, .stl, .off, .gltf, .glb, .md5mesh, .zip of one;\n"
      "        animations of .gltf, .glb and, with .md5anim, .md5mesh\n"
      "writes  .npy  dense array; of an animation with a frame axis\n"
      "        .npz  dense arrays with origin and voxel size; likewise\n"
      "        .vox  MagicaVoxel; of an animation animated\n"
      "        .xyz  points as text; of an animation a .zip of one file each\n"
      "        .voxg voxeld's sparse container\n"
      "        .voxs the same of an animation's frames\n"
      "        .png  image (voxel render); .gif, .apng of an animation or a turntable\n");
}

}  // namespace

void run_command(const Arguments& arguments, const std::stop_token& stop) {
  switch (arguments.command) {
    case Arguments::Command::kVoxelize:
      return run_voxelize(arguments, stop);
    case Arguments::Command::kRender:
      return run_render(arguments, stop);
    case Arguments::Command::kJobs:
      return run_jobs(arguments, stop);
    case Arguments::Command::kTop:
      return run_top(arguments, stop);
    case Arguments::Command::kList:
      return run_list(arguments);
    case Arguments::Command::kRemove:
      return run_remove(arguments);
    case Arguments::Command::kShare:
      return run_share(arguments);
    case Arguments::Command::kWhoami:
      return run_whoami(arguments);
    case Arguments::Command::kInfo:
      return run_info(arguments, stop);
    case Arguments::Command::kFormats:
      return run_formats(arguments);
  }
}

}  // namespace voxeld::cli
