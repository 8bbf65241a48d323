#include "client/cli/arguments.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>

#include "client/cli/api_key.h"
#include "proto/container/sequence_format.h"
#include "proto/messages/job.h"
#include "proto/options/options.h"
#include "proto/options/table.h"
#include "proto/version.h"

namespace voxeld::cli {
namespace {

constexpr const char* kFooter =
    "\nexit status: 0 done, 1 failure, 2 usage, 3 bad input, 4 over a limit, 5 no daemon,\n"
    "6 job failed or cancelled, 130 interrupted. VOXELD_URL names the daemon.";

std::string flag_of(std::string_view name) {
  std::string flag = "--" + std::string(name);
  std::ranges::replace(flag, '_', '-');
  return flag;
}

// The flags of the command line; only these go to the daemon.
using Given = std::map<std::string, std::string>;

void add_option_flags(CLI::App& app, OptionScope scope, Given& given) {
  for (const Option& option : option_table()) {
    if (!option.applies_to(scope)) continue;
    const std::string name(option.name);
    app.add_option_function<std::string>(
           flag_of(name), [&given, name](const std::string& value) { given[name] = value; },
           flag_help(option))
        ->type_name(form_text(option));
  }
}

void add_common_flags(CLI::App& app, Arguments& arguments) {
  app.add_option("--url", arguments.url,
                 "the daemon (default: $VOXELD_URL or http://127.0.0.1:8080)")
      ->type_name("URL");
  app.add_option("--key", arguments.key,
                 "API key (default: $VOXELD_KEY, or what the file $VOXELD_KEY_FILE holds)")
      ->type_name("KEY");
  app.add_option("--timeout", arguments.timeout_s, "seconds for one exchange with the daemon")
      ->type_name("S")
      ->check(CLI::Range(0, 1000000));
  app.add_flag("--json", arguments.json, "say what was done as JSON on stdout");
  app.add_flag("-q,--quiet", arguments.quiet, "no progress, no warnings");
}

void add_output_flag(CLI::App& app, Arguments& arguments) {
  app.add_option("-o,--output", arguments.output,
                 "file to write, - for stdout (default: stdout unless that is a terminal)")
      ->type_name("FILE");
}

void add_urgency_flags(CLI::App& app, Arguments& arguments) {
  app.add_option("--priority", arguments.priority,
                 "among your own jobs, the highest first (default 0)")
      ->check(CLI::Range(-limits::kPriorityMax, limits::kPriorityMax));
  app.add_option("--deadline", arguments.deadline_s, "give up when it is not done by then")
      ->check(CLI::Range(0.001, static_cast<double>(limits::kDeadlineMsMax) / 1000.0))
      ->type_name("SECONDS");
}

void set_urgency(Arguments& arguments) {
  if (arguments.priority) {
    arguments.options.set("priority", std::to_string(*arguments.priority));
  }
  if (arguments.deadline_s) {
    const auto deadline_ms = static_cast<int64_t>(std::ceil(*arguments.deadline_s * 1000.0));
    arguments.options.set("deadline_ms", std::to_string(deadline_ms));
  }
}

std::string extension_of(const std::string& output) {
  return output.empty() || output == "-" ? "" : std::filesystem::path(output).extension().string();
}

// The format of the output's extension. An unknown one is an error, not a guess.
std::string format_by_extension(const std::string& output) {
  const std::string extension = extension_of(output);
  if (output.empty() || output == "-") return "";
  std::string known;
  for (const FormatInfo& format : output_formats()) {
    if (extension == format.extension || extension == format.sequence_extension) {
      return std::string(format.name);
    }
    known += std::string(format.extension) + ", ";
  }
  throw CLI::ValidationError("--output", "expected a name that ends in " + known + "or " +
                                             std::string(sequence_extension(Format::kNative)) +
                                             " (or --format), got \"" + output + "\"");
}

// Checks the extension: files of grids and of sequences have different ones in some formats.
void check_extension(const std::string& output, Format format, bool is_sequence) {
  const FormatInfo& info = format_info(format);
  const std::string grid(info.extension), sequence(info.sequence_extension);
  if (grid == sequence || extension_of(output) != (is_sequence ? grid : sequence)) return;
  throw CLI::ValidationError(
      "--output",
      is_sequence ? "an animation's frames go to a " + sequence + ", not a " + grid
                  : "a " + sequence + " holds an animation's frames: name one with --animation");
}

// The kind of image of the output's extension; "" for one that a .png can hold.
std::string image_by_extension(const std::string& output) {
  const std::string extension = extension_of(output);
  return extension == ".gif" || extension == ".apng" ? extension.substr(1) : "";
}

// Checks the options with the daemon's own table before anything is sent.
RequestOptions take_options(const Given& given, OptionScope scope, Arguments& arguments) {
  OptionPairs pairs(given.begin(), given.end());
  auto parsed = parse_options(pairs, scope);
  if (!parsed) throw CLI::ValidationError(parsed.error().message());
  for (const auto& [name, value] : pairs) arguments.options.set(name, value);
  return *std::move(parsed);
}

void check_voxelize(Arguments& arguments, Given& given) {
  if (arguments.input.empty()) throw CLI::RequiredError("a mesh file, or - for stdin,");
  if (!given.contains("format")) {
    const std::string format = format_by_extension(arguments.output);
    if (!format.empty()) given["format"] = format;
  }
  const RequestOptions options = take_options(given, OptionScope::kVoxelize, arguments);
  check_extension(arguments.output, options.output.format, options.animation.is_sequence());
}

void check_render(Arguments& arguments, Given& given) {
  const int inputs = (arguments.input.empty() ? 0 : 1) + (arguments.grid.empty() ? 0 : 1) +
                     (arguments.sequence.empty() ? 0 : 1);
  if (inputs != 1) {
    throw CLI::RequiredError("one of a mesh file (- for stdin), --grid and --sequence");
  }
  const std::string image = image_by_extension(arguments.output);
  if (!given.contains("image") && !image.empty()) given["image"] = image;
  take_options(given, arguments.input.empty() ? OptionScope::kRenderGrid : OptionScope::kRenderMesh,
               arguments);
}

void check_outputs(const Arguments& arguments) {
  const bool writes = arguments.command == Arguments::Command::kVoxelize ||
                      arguments.command == Arguments::Command::kRender;
  if (writes && arguments.json && (arguments.output.empty() || arguments.output == "-")) {
    throw CLI::ValidationError("--json", "needs -o FILE: stdout carries the JSON");
  }
  if (arguments.cancel && arguments.job.empty()) throw CLI::RequiredError("the job's id");
}

std::string default_url() {
  const char* url = std::getenv("VOXELD_URL");
  return url != nullptr && *url != '\0' ? url : "http://127.0.0.1:8080";
}

}  // namespace

std::variant<Arguments, ExitStatus> parse_arguments(int argc, char** argv) {
  Arguments arguments;
  Given voxelize_given, render_given;
  CLI::App app("voxel: voxel grids and images of meshes, from a voxeld daemon");
  app.footer(kFooter);
  app.set_version_flag("--version", "voxel " + std::string(version()));
  std::vector<std::string> inputs;
  app.add_option("input", inputs,
                 "mesh file (obj ply stl off gltf glb md5mesh zip), - for stdin; then files that "
                 "are sent with it (md5anim, textures)")
      ->type_name("FILE");
  add_output_flag(app, arguments);
  add_common_flags(app, arguments);
  add_option_flags(app, OptionScope::kVoxelize, voxelize_given);
  add_urgency_flags(app, arguments);

  CLI::App* render = app.add_subcommand("render", "an image of a mesh's voxels");
  render->add_option("input", inputs, "mesh file, - for stdin; then files that are sent with it")
      ->type_name("FILE");
  render->add_option("--grid", arguments.grid, "a stored grid instead of a mesh")->type_name("ID");
  render->add_option("--sequence", arguments.sequence, "a stored sequence instead of a mesh")
      ->type_name("ID");
  add_output_flag(*render, arguments);
  add_common_flags(*render, arguments);
  add_option_flags(*render, OptionScope::kRenderMesh, render_given);
  add_urgency_flags(*render, arguments);

  CLI::App* jobs = app.add_subcommand("jobs", "the daemon's latest jobs, or one of them");
  jobs->add_option("id", arguments.job, "one job; with -o its result is fetched");
  jobs->add_flag("--cancel", arguments.cancel, "cancel it");
  jobs->add_option("--limit", arguments.limit, "how many (default 20)")->check(CLI::Range(1, 1000));
  add_output_flag(*jobs, arguments);
  add_common_flags(*jobs, arguments);

  CLI::App* top = app.add_subcommand("top", "the daemon's devices and queue, live; q quits");
  top->add_flag("--once", arguments.once, "print them once and end");
  add_common_flags(*top, arguments);

  CLI::App* share = app.add_subcommand("share", "a link to a job's result that needs no key");
  share->add_option("id", arguments.job, "the job")->required();
  share->add_option("--seconds", arguments.seconds, "how long it lives (default 3600)")
      ->check(CLI::Range(1, 30 * 24 * 3600));
  add_common_flags(*share, arguments);

  CLI::App* list = app.add_subcommand("ls", "what the daemon keeps for you, newest first");
  list->add_option("what", arguments.list, "results (default), grids, sequences or assets")
      ->check(CLI::IsMember({"results", "grids", "sequences", "assets"}));
  list->add_option("--limit", arguments.limit, "how many (default 20)")->check(CLI::Range(1, 1000));
  add_common_flags(*list, arguments);

  CLI::App* remove = app.add_subcommand("rm",
                                        "delete results (by their job), grids, sequences and "
                                        "assets");
  remove->add_option("ids", arguments.ids, "of jobs, grids, sequences and assets")
      ->required()
      ->type_name("ID");
  add_common_flags(*remove, arguments);

  CLI::App* whoami =
      app.add_subcommand("whoami", "whose key this is, its limits and what is used of them");
  add_common_flags(*whoami, arguments);

  CLI::App* info = app.add_subcommand("info", "what a mesh, a .voxg or a .voxs file holds");
  info->add_option("input", inputs, "mesh, .voxg or .voxs file, - for stdin; then files with it")
      ->required()
      ->type_name("FILE");
  add_common_flags(*info, arguments);

  CLI::App* formats = app.add_subcommand("formats", "what is read and written");
  add_common_flags(*formats, arguments);
  app.require_subcommand(0, 1);

  try {
    app.parse(argc, argv);
    using enum Arguments::Command;
    arguments.command = render->parsed()    ? kRender
                        : jobs->parsed()    ? kJobs
                        : top->parsed()     ? kTop
                        : share->parsed()   ? kShare
                        : list->parsed()    ? kList
                        : remove->parsed()  ? kRemove
                        : whoami->parsed()  ? kWhoami
                        : info->parsed()    ? kInfo
                        : formats->parsed() ? kFormats
                                            : kVoxelize;
    if (!inputs.empty()) {
      arguments.input = inputs.front();
      arguments.beside.assign(inputs.begin() + 1, inputs.end());
    }
    if (arguments.command == kVoxelize) check_voxelize(arguments, voxelize_given);
    if (arguments.command == kRender) check_render(arguments, render_given);
    set_urgency(arguments);
    check_outputs(arguments);
  } catch (const CLI::Success& request) {
    app.exit(request);  // --help, --version: to stdout
    return kSuccess;
  } catch (const CLI::ParseError& error) {
    std::fprintf(stderr, "voxel: %s\nvoxel --help tells more\n",
                 without_keys(error.what()).c_str());
    return kUsage;
  }
  if (arguments.url.empty()) arguments.url = default_url();
  return arguments;
}

}  // namespace voxeld::cli
