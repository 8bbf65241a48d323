#include "client/cli/commands/job_result.h"

#include <unistd.h>

#include <cstdio>

#include "client/cli/bundle.h"
#include "client/cli/output_file.h"
#include "client/cli/output_name.h"
#include "client/cli/terminal/progress_bar.h"
#include "client/cli/terminal/report.h"
#include "proto/options/table.h"

namespace voxeld::cli {
namespace {

using client::Client;
using client::Error;
using client::JobInfo;
using Clock = std::chrono::steady_clock;

// The path for data; without -o it is stdout.
std::string output_of(const Arguments& arguments) {
  if (!arguments.output.empty()) return arguments.output;
  if (isatty(STDOUT_FILENO) == 1) {
    throw Error("invalid-option", 0, "data is not written to a terminal: name a file with -o");
  }
  return "-";
}

// Runs `make(sink, progress)`, which produces one job's result, and writes it to the output.
template <typename Make>
void write_result(const Arguments& arguments, const std::stop_token& stop, Make&& make) {
  const auto start = Clock::now();
  const std::string path = output_of(arguments);
  OutputFile output(path, stop);
  ProgressBar bar(arguments.quiet);
  const JobInfo job = make([&](std::span<const std::byte> piece) { output.write(piece); },
                           [&](const client::Progress& progress) {
                             bar.show(progress);
                             return true;
                           });
  output.keep();
  bar.clear();
  tell_warnings(arguments, job);
  const std::chrono::duration<double> elapsed = Clock::now() - start;
  if (arguments.json) {
    print_json(
        {{"meta", parsed(job.meta_json)}, {"job", parsed(job.json)}, {"bytes", output.bytes()}});
  } else if (!arguments.quiet && isatty(STDERR_FILENO) == 1) {
    const auto bytes = static_cast<std::int64_t>(output.bytes());
    std::fprintf(stderr, "%s\n", result_line(path, job, bytes, elapsed.count()).c_str());
  }
}

// Submits a job on something stored, waits for it and fetches its result.
JobInfo make_of_stored(Client& daemon, std::string_view kind, const client::Input& input,
                       const client::Options& options, const client::Sink& sink,
                       const client::ProgressCallback& progress, const std::stop_token& stop) {
  JobInfo job = daemon.submit(kind, input, options, stop);
  job = wait_or_cancel(daemon, job.id, progress, stop);
  daemon.download(job.id, sink, progress, stop);
  return job;
}

// The steps that write a job's result to a file of this name.
struct Conversion {
  bool is_needed = false;
  client::Input input;
  client::Options options;
};

// The extension of the file that the job made; "" if it is not known.
std::string extension_of(const JobInfo& job) {
  for (const FormatInfo& format : output_formats()) {
    if (job.media_type == format.media_type) return std::string(format.extension);
    if (job.media_type == format.sequence_media_type) return std::string(format.sequence_extension);
  }
  const std::string_view type = job.media_type;
  for (const std::string_view image : {"png", "gif", "apng"}) {
    if (type == "image/" + std::string(image)) return "." + std::string(image);
  }
  return type == "application/json" ? ".json" : "";
}

// The text of an option's value in a job's status.
std::string option_text(const nlohmann::json& value) {
  if (value.is_string()) return value.get<std::string>();
  if (!value.is_array()) return value.dump();
  std::string text;
  for (const auto& item : value) text += (text.empty() ? "" : ",") + option_text(item);
  return text;
}

// The options by which a job's result differs from the grid that it stored.
void take_selection(const JobInfo& job, client::Options& options) {
  const auto status = parsed(job.json);
  const auto given = status.find("options");
  if (given == status.end()) return;
  // A result that is the stored grid itself: the container of a selection is stored.
  const std::string blob = status.value(nlohmann::json::json_pointer("/result/blob"), "");
  if (!job.grid.empty() && blob == job.grid) return;
  // Frames of an exported sequence; those of a mesh's animation are all that its sequence has.
  const auto frames = given->find("frames");
  if (job.kind == "export" && frames != given->end()) options.set("frames", option_text(*frames));
  for (const Option& option : option_table()) {
    const auto value = given->find(option.name);
    if (option.group == OptionGroup::kSelection && value != given->end()) {
      options.set(std::string(option.name), option_text(*value));
    }
  }
  const auto palette = given->find("palette");  // a number is of a .vox alone
  if (palette != given->end() && !palette->is_number()) {
    options.set("palette", option_text(*palette));
  }
}

Conversion conversion_to(const std::string& path, const JobInfo& job) {
  const OutputName name = OutputName::of(path);
  const std::string made = extension_of(job);
  if (name.kind == OutputName::Kind::kStdout || name.extension == made) return {};
  const bool is_voxels = !job.grid.empty() || !job.sequence.empty();
  if (name.kind == OutputName::Kind::kImage && is_voxels) {
    const std::string of =
        job.sequence.empty() ? "--grid " + job.grid : "--sequence " + job.sequence;
    throw Error("invalid-option", 0,
                "the job made a " + made + "; an image of it is made by voxel render " + of +
                    " -o " + path);
  }
  if (name.kind != OutputName::Kind::kGrid || !is_voxels) {
    throw Error("invalid-option", 0, "the job's result cannot go to this file",
                "a name that ends in " + made, "\"" + path + "\"");
  }
  const bool is_sequence = !job.sequence.empty();
  const std::string wanted(is_sequence ? sequence_extension(name.format)
                                       : format_extension(name.format));
  if (name.extension != wanted) {
    throw Error("invalid-option", 0,
                is_sequence ? "the job made frames of an animation" : "the job made a single grid",
                "a name that ends in " + wanted, "\"" + path + "\"");
  }
  Conversion conversion{true, {}, {}};
  conversion.input =
      is_sequence ? client::Input::of_sequence(job.sequence) : client::Input::of_grid(job.grid);
  conversion.options.set("format", std::string(format_name(name.format)));
  take_selection(job, conversion.options);
  return conversion;
}

}  // namespace

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
  const MeshSource mesh = MeshSource::open(arguments.input, arguments.beside, stop, arguments.pipe);
  mesh.check_output(arguments.output);
  write_result(arguments, stop,
               [&](const client::Sink& sink, const client::ProgressCallback& progress) {
                 return daemon.voxelize_to(mesh.source(), arguments.options, sink, progress, stop);
               });
}

void run_render(const Arguments& arguments, const std::stop_token& stop) {
  Client daemon(settings_of(arguments));
  if (arguments.input.empty()) {
    const client::Input input = {"", arguments.grid, arguments.sequence};
    write_result(
        arguments, stop, [&](const client::Sink& sink, const client::ProgressCallback& progress) {
          return make_of_stored(daemon, "render", input, arguments.options, sink, progress, stop);
        });
    return;
  }
  const MeshSource mesh = MeshSource::open(arguments.input, arguments.beside, stop, arguments.pipe);
  mesh.check_output(arguments.output);
  write_result(arguments, stop,
               [&](const client::Sink& sink, const client::ProgressCallback& progress) {
                 return daemon.render_to(mesh.source(), arguments.options, sink, progress, stop);
               });
}

void run_job_result(const Arguments& arguments, const std::stop_token& stop) {
  Client daemon(settings_of(arguments));
  write_result(arguments, stop,
               [&](const client::Sink& sink, const client::ProgressCallback& progress) {
                 JobInfo job = daemon.wait(arguments.job, progress, stop);
                 const Conversion conversion = conversion_to(arguments.output, job);
                 if (conversion.is_needed) {
                   return make_of_stored(daemon, "export", conversion.input, conversion.options,
                                         sink, progress, stop);
                 }
                 daemon.download(job.id, sink, progress, stop);
                 return job;
               });
}

}  // namespace voxeld::cli
