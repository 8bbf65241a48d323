#include "client/cli/arguments.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <set>

#include "client/cli/commands/documents.h"
#include "client/cli/daemon/api_key.h"
#include "client/cli/output_name.h"
#include "client/cli/palette_flag.h"
#include "proto/messages/job.h"
#include "proto/options/options.h"
#include "proto/options/table.h"
#include "proto/text/near_miss.h"
#include "proto/version.h"

namespace voxeld::cli {
namespace {

constexpr const char* kFooter =
    "\nexit status: 0 done, 1 failure, 2 usage, 3 bad input, 4 over a limit, 5 no daemon,\n"
    "6 job failed or cancelled, 7 some of several files failed, 130 interrupted.";

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
        ->type_name(form_text(option) + (name == "palette" ? " | FILE" : ""));
  }
}

void add_common_flags(CLI::App& app, Arguments& arguments) {
  app.add_option("--url", arguments.url,
                 "the server (default: $VOXELD_URL, url of the configuration file, "
                 "http://127.0.0.1:8080 if a voxeld serves there, else a private one)")
      ->type_name("URL");
  app.add_flag_callback(
      "--local", [&arguments] { arguments.is_local = true; },
      "use a private voxeld, and start one if none runs");
  app.add_flag_callback(
      "--no-local", [&arguments] { arguments.is_local = false; }, "never start a private voxeld");
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

// Flags for the place of results, and for their estimate.
void add_output_flags(CLI::App& app, Arguments& arguments) {
  add_output_flag(app, arguments);
  app.add_option("--out-dir", arguments.out_dir, "make a file of each mesh, in this folder")
      ->type_name("DIR");
  app.add_flag("--dry-run", arguments.dry_run, "print what it would cost; makes nothing");
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

// Checks the options with the daemon's own table before anything is sent.
RequestOptions take_options(const Given& given, OptionScope scope, Arguments& arguments) {
  OptionPairs pairs(given.begin(), given.end());
  auto parsed = parse_options(pairs, scope);
  if (!parsed) throw CLI::ValidationError(parsed.error().message());
  for (const auto& [name, value] : pairs) arguments.options.set(name, value);
  return *std::move(parsed);
}

// The names of files that are meshes or voxels by themselves, and are not sent beside another one.
bool is_mesh_name(const std::string& path) {
  static const std::set<std::string, std::less<>> names = {
      ".obj", ".ply",  ".stl",  ".off", ".gltf",   ".glb", ".md5mesh", ".3mf",
      ".zip", ".voxg", ".voxs", ".vox", ".binvox", ".npy", ".nrrd"};
  return names.contains(lower_case(std::filesystem::path(path).extension().string()));
}

// The file that a path leads to, which need not exist.
std::filesystem::path real_path(const std::string& path) {
  std::error_code failed;
  auto real = std::filesystem::weakly_canonical(path, failed);
  return failed ? std::filesystem::path(path) : real;
}

// Takes one mesh, and the files beside it. `advice`: for somebody with several meshes.
void take_mesh(const std::vector<std::string>& inputs, const std::string& advice,
               Arguments& arguments) {
  arguments.input = inputs.front();
  arguments.beside.assign(inputs.begin() + 1, inputs.end());
  const auto second = std::ranges::find_if(arguments.beside, is_mesh_name);
  if (second == arguments.beside.end()) return;
  throw CLI::ValidationError(*second, "is a second mesh; " + advice);
}

// Distributes the inputs: a batch, or one mesh and the files beside it.
void take_inputs(std::vector<std::string> inputs, std::string_view extension,
                 Arguments& arguments) {
  if (arguments.out_dir.empty()) {
    if (inputs.empty()) return;
    take_mesh(inputs, "--out-dir DIR makes a file of each", arguments);
    const auto is_output = [&](const std::string& input) {
      return input != "-" && real_path(input) == real_path(arguments.output);
    };
    if (arguments.output.empty() || std::ranges::none_of(inputs, is_output)) return;
    throw CLI::ValidationError("--output", arguments.output + " is an input and would be lost");
  }
  if (!arguments.output.empty()) throw CLI::ExcludesError("--out-dir", "--output");
  if (inputs.empty()) throw CLI::RequiredError("a mesh file");
  std::map<std::string, std::string> made_of;
  std::set<std::filesystem::path> meshes;
  for (const std::string& input : inputs) meshes.insert(real_path(input));
  for (const std::string& input : inputs) {
    if (input == "-")
      throw CLI::ValidationError("--out-dir", "stdin has no name to call a file by");
    std::string name = std::filesystem::path(input).stem().string();
    name.append(extension);
    const auto path = (std::filesystem::path(arguments.out_dir) / name).string();
    const auto [other, is_new] = made_of.emplace(path, input);
    if (!is_new) {
      std::string what = other->second;
      what.append(" and ").append(input).append(" would both go to ").append(path);
      throw CLI::ValidationError("--out-dir", what);
    }
    if (meshes.contains(real_path(path))) {
      throw CLI::ValidationError("--out-dir", path + " is a mesh of this call and would be lost");
    }
    arguments.batch.push_back({input, path});
  }
}

void check_voxelize(std::vector<std::string> inputs, Given& given, Arguments& arguments) {
  if (inputs.empty()) throw CLI::RequiredError("a mesh file, or - for stdin,");
  const std::string format =
      format_for(arguments.output, given.contains("format") ? given["format"] : "");
  if (!format.empty()) given["format"] = format;
  if (const auto palette = given.find("palette"); palette != given.end()) {
    palette->second = palette_option(palette->second);
  }
  const RequestOptions options = take_options(given, OptionScope::kVoxelize, arguments);
  const FormatInfo& info = format_info(options.output.format);
  const bool is_sequence = options.animation.is_sequence();
  take_inputs(std::move(inputs), is_sequence ? info.sequence_extension : info.extension, arguments);
  check_extension(arguments.output, options.output.format, is_sequence);
}

void check_render(std::vector<std::string> inputs, Given& given, Arguments& arguments) {
  const int sources = (inputs.empty() ? 0 : 1) + (arguments.grid.empty() ? 0 : 1) +
                      (arguments.sequence.empty() ? 0 : 1);
  if (sources != 1) {
    throw CLI::RequiredError("one of a mesh file (- for stdin), --grid and --sequence");
  }
  const std::string image =
      image_for(arguments.output, given.contains("image") ? given["image"] : "");
  if (!image.empty()) given["image"] = image;
  take_options(given, inputs.empty() ? OptionScope::kRenderGrid : OptionScope::kRenderMesh,
               arguments);
  const bool is_png = image.empty() || image == "png" || image == "sheet";
  take_inputs(std::move(inputs), is_png ? ".png" : "." + image, arguments);
}

void check_combinations(const Arguments& arguments) {
  const bool is_result =  // of a job that was made before
      arguments.command == Arguments::Command::kJobs && !arguments.output.empty();
  const bool writes = arguments.command == Arguments::Command::kVoxelize ||
                      arguments.command == Arguments::Command::kRender || is_result;
  const bool has_stdout = arguments.output.empty() || arguments.output == "-";
  if (writes && arguments.json && has_stdout && arguments.out_dir.empty() && !arguments.dry_run) {
    throw CLI::ValidationError("--json", "needs -o FILE: stdout carries the JSON");
  }
  if (arguments.cancel && arguments.job.empty()) throw CLI::RequiredError("the job's id");
  if (is_result && arguments.job.empty()) throw CLI::RequiredError("the job's id");
  if (is_result && arguments.cancel) throw CLI::ExcludesError("--cancel", "--output");
  if (arguments.is_local.value_or(false) && !arguments.url.empty()) {
    throw CLI::ValidationError("--local",
                               "a private voxeld has a URL of its own; got --url " + arguments.url);
  }
}

// --- the command line as CLI11 knows it

struct CommandLine {
  CommandLine();

  Arguments arguments;
  Given voxelize_given, render_given;
  std::vector<std::string> inputs;
  CLI::App app{"voxel: voxel grids and images of meshes, from a voxeld daemon", "voxel"};
  std::map<const CLI::App*, Arguments::Command> commands;

 private:
  CLI::App* add(const char* name, const char* help, Arguments::Command command);
  void add_mesh_commands();
  void add_stored_commands();
};

CLI::App* CommandLine::add(const char* name, const char* help, Arguments::Command command) {
  CLI::App* added = app.add_subcommand(name, help);
  commands[added] = command;
  add_common_flags(*added, arguments);
  return added;
}

void CommandLine::add_mesh_commands() {
  app.add_option(
         "input", inputs,
         "mesh file (obj ply stl off gltf glb md5mesh 3mf zip) or voxels (voxg vox binvox npy "
         "nrrd), - for stdin; then files that are sent with it (md5anim, textures), or with "
         "--out-dir further meshes")
      ->type_name("FILE");
  add_output_flags(app, arguments);
  add_option_flags(app, OptionScope::kVoxelize, voxelize_given);
  add_urgency_flags(app, arguments);
  add_common_flags(app, arguments);

  CLI::App* render = app.add_subcommand("render", "an image of a mesh's voxels");
  commands[render] = Arguments::Command::kRender;
  render
      ->add_option("input", inputs,
                   "mesh file, - for stdin; then files that are sent with it, or with --out-dir "
                   "further meshes")
      ->type_name("FILE");
  render->add_option("--grid", arguments.grid, "a stored grid instead of a mesh")->type_name("ID");
  render->add_option("--sequence", arguments.sequence, "a stored sequence instead of a mesh")
      ->type_name("ID");
  add_output_flags(*render, arguments);
  add_option_flags(*render, OptionScope::kRenderMesh, render_given);
  add_urgency_flags(*render, arguments);
  add_common_flags(*render, arguments);

  CLI::App* info =
      add("info", "what a mesh, a .voxg or a .voxs file holds", Arguments::Command::kInfo);
  info->add_option("input", inputs, "mesh, .voxg or .voxs file, - for stdin; then files with it")
      ->required()
      ->type_name("FILE");
  add("formats", "what is read and written", Arguments::Command::kFormats);
}

void CommandLine::add_stored_commands() {
  using enum Arguments::Command;
  CLI::App* jobs = add("jobs", "the daemon's latest jobs, or one of them", kJobs);
  jobs->add_option("id", arguments.job,
                   "one job; with -o its result is fetched, as the format that the name says")
      ->type_name("ID");
  jobs->add_flag("--cancel", arguments.cancel, "cancel it; one that has ended stays as it is");
  jobs->add_option("--limit", arguments.limit, "how many (default 20)")
      ->type_name("N")
      ->check(CLI::Range(1, 1000));
  add_output_flag(*jobs, arguments);

  CLI::App* top = add("top", "the daemon's devices and queue, live; q quits", kTop);
  top->add_flag("--once", arguments.once, "print them once and end");

  CLI::App* share = add("share", "a link to a job's result that needs no key", kShare);
  share->add_option("id", arguments.job, "the job")->required()->type_name("ID");
  share->add_option("--seconds", arguments.seconds, "how long it lives (default 3600)")
      ->type_name("N")
      ->check(CLI::Range(1, 30 * 24 * 3600));

  CLI::App* list = add("ls", "what the daemon stores for you, newest first", kList);
  list->add_option("what", arguments.list, "results (default), grids, sequences or assets")
      ->type_name("WHAT")
      ->check(CLI::IsMember({"results", "grids", "sequences", "assets"}));
  list->add_option("--limit", arguments.limit, "how many (default 20)")
      ->type_name("N")
      ->check(CLI::Range(1, 1000));

  CLI::App* remove =
      add("rm", "delete results (by their job), grids, sequences and assets", kRemove);
  remove->add_option("ids", arguments.ids, "of jobs, grids, sequences and assets")
      ->required()
      ->type_name("ID");

  add("whoami", "whose key this is, its limits and what is used of them", kWhoami);

  CLI::App* generate =
      app.add_subcommand("generate", "print the manual page, or completions for a shell");
  commands[generate] = kGenerate;
  generate->add_option("document", arguments.document, "man, bash or zsh")
      ->required()
      ->type_name("WHAT")
      ->check(CLI::IsMember({"man", "bash", "zsh"}));
}

CommandLine::CommandLine() {
  app.footer(kFooter);
  app.set_version_flag("--version", "voxel " + std::string(version()));
  add_mesh_commands();
  add_stored_commands();
  app.require_subcommand(0, 1);
}

// --- suggestions

// The name in `names` that `text` may be a misspelling of; empty if there is none.
std::string near_name(std::string_view text, const std::vector<std::string>& names) {
  const std::vector<std::string_view> known(names.begin(), names.end());
  const std::string_view near = near_miss(text, known);
  return near == text ? std::string() : std::string(near);
}

std::vector<std::string> flags_of(const CLI::App& command) {
  std::vector<std::string> flags;
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) flags.push_back("--" + name);
  }
  return flags;
}

std::vector<std::string> command_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands(nullptr)) names.push_back(command->get_name());
  return names;
}

const CLI::App& parsed_command(const CLI::App& app) {
  const auto parsed = app.get_subcommands();
  return parsed.empty() ? app : *parsed.front();
}

std::string with_program(const CLI::App& app, const CLI::App& command) {
  return &app == &command ? "voxel" : "voxel " + command.get_name();
}

// Explains arguments that the command does not know.
std::string explain_extras(const CLI::App& app) {
  const CLI::App& command = parsed_command(app);
  std::string text = with_program(app, command) + " does not take";
  const std::vector<std::string> extras = app.remaining(true);
  for (const std::string& extra : extras) text += " " + extra;
  const auto flag =
      std::ranges::find_if(extras, [](const auto& one) { return one.starts_with("--"); });
  if (flag == extras.end()) return text;
  const std::string name = flag->substr(0, flag->find('='));
  if (const std::string near = near_name(name, flags_of(command)); !near.empty()) {
    return text + "; did you mean " + near + "?";
  }
  for (const CLI::App* other : app.get_subcommands(nullptr)) {
    if (std::ranges::count(flags_of(*other), name) == 0) continue;
    return text + "; it is an option of " + with_program(app, *other);
  }
  if (std::ranges::count(flags_of(app), name) != 0) {
    return text + "; it is an option of voxel without " + command.get_name();
  }
  return text;
}

// A word that is neither a file nor a command may be a misspelt command.
void check_first_word(const CLI::App& app, const std::vector<std::string>& inputs) {
  if (inputs.empty() || inputs.front() == "-") return;
  std::error_code failed;
  if (std::filesystem::exists(inputs.front(), failed)) return;
  const std::string near = near_name(inputs.front(), command_names(app));
  if (near.empty()) return;
  throw CLI::ValidationError(inputs.front(),
                             "neither a command nor a file; did you mean " + near + "?");
}

// Options of voxel itself before the name of a command: render takes them, others have no use for
// them.
void take_options_before(CommandLine& line) {
  if (line.arguments.command == Arguments::Command::kRender) {
    line.render_given.merge(line.voxelize_given);
  } else if (!line.voxelize_given.empty()) {
    throw CLI::ValidationError(flag_of(line.voxelize_given.begin()->first),
                               "is no option of voxel " + parsed_command(line.app).get_name());
  }
}

void finish(CommandLine& line) {
  Arguments& arguments = line.arguments;
  const auto parsed = line.commands.find(&parsed_command(line.app));
  if (parsed != line.commands.end()) arguments.command = parsed->second;
  using enum Arguments::Command;
  if (arguments.command != kVoxelize) take_options_before(line);
  switch (arguments.command) {
    case kVoxelize:
      check_first_word(line.app, line.inputs);
      check_voxelize(line.inputs, line.voxelize_given, arguments);
      break;
    case kRender:
      check_render(line.inputs, line.render_given, arguments);
      break;
    case kInfo:
      take_mesh(line.inputs, "voxel info describes one", arguments);
      break;
    default:
      break;
  }
  set_urgency(arguments);
  check_combinations(arguments);
}

ExitStatus usage_error(const std::string& message) {
  std::fprintf(stderr, "voxel: %s\nvoxel --help tells more\n", without_keys(message).c_str());
  return kUsage;
}

}  // namespace

std::variant<Arguments, ExitStatus> parse_arguments(int argc, char** argv) {
  CommandLine line;
  try {
    line.app.parse(argc, argv);
    finish(line);
  } catch (const CLI::Success& request) {
    line.app.exit(request);  // --help, --version: to stdout
    return kSuccess;
  } catch (const CLI::ExtrasError&) {
    return usage_error(explain_extras(line.app));
  } catch (const CLI::ParseError& error) {
    return usage_error(error.what());
  }
  if (line.arguments.command == Arguments::Command::kGenerate) {
    std::fputs(document_text(line.arguments.document, line.app).c_str(), stdout);
    return kSuccess;
  }
  return line.arguments;
}

}  // namespace voxeld::cli
