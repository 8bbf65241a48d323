#include "client/cli/commands/documents.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <vector>

#include "proto/options/table.h"
#include "proto/version.h"

namespace voxeld::cli {
namespace {

std::vector<const CLI::App*> subcommands_of(const CLI::App& app) {
  return app.get_subcommands(nullptr);
}

// The words that an option takes; empty for any text.
std::vector<std::string> words_of(const CLI::Option& option) {
  for (const std::string& flag : option.get_lnames()) {
    std::string name = flag;
    std::ranges::replace(name, '-', '_');
    const Option* known = find_option(name);
    const auto* values = known == nullptr ? nullptr : std::get_if<WordValues>(&known->codec.values);
    if (values != nullptr) return {values->words.begin(), values->words.end()};
  }
  if (option.get_name() == "what") return {"results", "grids", "sequences", "assets"};
  if (option.get_name() == "document") return {"man", "bash", "zsh"};
  return {};
}

bool takes_value(const CLI::Option& option) {
  return option.get_items_expected_max() > 0;
}

// "-o", "--output", "--local", "--no-local".
std::vector<std::string> names_of(const CLI::Option& option) {
  std::vector<std::string> names;
  for (const std::string& name : option.get_snames()) names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) names.push_back("--" + name);
  return names;
}

std::string joined(const std::vector<std::string>& texts, const std::string& separator) {
  std::string all;
  for (const std::string& text : texts) all += (all.empty() ? "" : separator) + text;
  return all;
}

// --- manual page

// Text for troff: no requests, and hyphens that can be copied.
std::string troff(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '\\') {
      out += "\\e";
    } else if (c == '-') {
      out += "\\-";
    } else if ((c == '.' || c == '\'') && (out.empty() || out.back() == '\n')) {
      out += std::string("\\&") + c;
    } else {
      out += c;
    }
  }
  return out;
}

void add_man_option(const CLI::Option& option, std::string& page) {
  page += ".TP\n";
  std::vector<std::string> names = names_of(option);
  for (std::string& name : names) name = "\\fB" + troff(name) + "\\fR";
  const std::string value = takes_value(option) ? option.get_type_name() : "";
  page += joined(names, ", ") + (value.empty() ? "" : " \\fI" + troff(value) + "\\fR") + "\n";
  page += troff(option.get_description()) + "\n";
}

void add_man_options(const CLI::App& command, std::string& page) {
  for (const CLI::Option* option : command.get_options()) {
    if (!names_of(*option).empty()) add_man_option(*option, page);
  }
}

// " FILE ..."
std::string man_operands(const CLI::App& command) {
  std::string text;
  for (const CLI::Option* option : command.get_options()) {
    if (!option->get_positional()) continue;
    const bool is_list = option->get_items_expected_max() > 1;
    const std::string name =
        " \\fI" + troff(option->get_type_name()) + "\\fR" + (is_list ? " ..." : "");
    text += option->get_required() ? name : " [" + name.substr(1) + "]";
  }
  return text;
}

constexpr const char* kManEnd = R"(.SH SERVER
The server is named by \fB\-\-url\fR, else by \fBVOXELD_URL\fR, else by \fBurl\fR in the
configuration file. Without any of them it is the voxeld at http://127.0.0.1:8080 if there is one,
else a private voxeld, which voxel starts and which ends after a minute without requests.
.SH ENVIRONMENT
.TP
\fBVOXELD_URL\fR
the server
.TP
\fBVOXELD_KEY\fR, \fBVOXELD_KEY_FILE\fR
the API key, or the file that holds it
.TP
\fBVOXELD_DEVICE\fR and other variables of voxeld
settings of a private voxeld
.SH FILES
.TP
\fI$XDG_CONFIG_HOME/voxeld/config.toml\fR (\fI~/.config\fR)
configuration: \fBurl\fR and \fBkey_file\fR
.TP
\fI$XDG_CACHE_HOME/voxeld\fR (\fI~/.cache\fR)
data and log of the private voxeld
.SH EXIT STATUS
.TP
\fB0\fR
done
.TP
\fB1\fR
a local file cannot be read or written, or the service failed inside
.TP
\fB2\fR
usage
.TP
\fB3\fR
the mesh, image or archive cannot be read
.TP
\fB4\fR
over a limit: the grid, the body, the storage
.TP
\fB5\fR
no server responds, or it has no device, is full or is shutting down
.TP
\fB6\fR
the job was cancelled, took too long or crashed its workers
.TP
\fB7\fR
some of several files failed
.TP
\fB130\fR
interrupted
.SH EXAMPLES
.nf
voxel bunny.ply \-o bunny.vox \-\-size 256
voxel *.ply \-\-out\-dir voxels \-\-format vox
voxel render bunny.ply \-o bunny.png \-\-azimuth 45
voxel jobs
.fi
)";

std::string man_page(const CLI::App& app) {
  std::string page =
      ".TH VOXEL 1 \"\" \"voxel " + std::string(version()) + "\" \"User Commands\"\n";
  page += ".SH NAME\nvoxel \\- voxel grids and images of meshes\n.SH SYNOPSIS\n";
  page += ".B voxel\n[\\fIOPTION\\fR ...]" + man_operands(app) + "\n";
  for (const CLI::App* command : subcommands_of(app)) {
    page += ".br\n.B voxel " + command->get_name() + "\n[\\fIOPTION\\fR ...]" +
            man_operands(*command) + "\n";
  }
  page +=
      ".SH DESCRIPTION\nMakes a voxel grid of a mesh, by a voxeld server. The extension of the "
      "output's name\nchooses the format; voxel formats lists them. Data goes to files or stdout, "
      "everything else to stderr.\n"
      ".SH OPTIONS\n";
  add_man_options(app, page);
  page += ".SH COMMANDS\n";
  for (const CLI::App* command : subcommands_of(app)) {
    page += ".SS voxel " + command->get_name() + man_operands(*command) + "\n" +
            troff(command->get_description()) + "\n";
    add_man_options(*command, page);
  }
  return page + kManEnd;
}

// --- bash

// A case of a shell's case statement, which sets `flags` and `values`.
std::string bash_case(const std::string& pattern, const CLI::App& command) {
  std::vector<std::string> flags;
  std::string values;
  for (const CLI::Option* option : command.get_options()) {
    const std::vector<std::string> names = names_of(*option);
    flags.insert(flags.end(), names.begin(), names.end());
    const std::vector<std::string> words = words_of(*option);
    if (names.empty() || !takes_value(*option)) continue;
    values += "        " + joined(names, "|") + ") words=\"" + joined(words, " ") +
              "\"; takes_value=1 ;;\n";
  }
  return "    " + pattern + ")\n      flags=\"" + joined(flags, " ") +
         "\"\n      case \"$previous\" in\n" + values + "      esac ;;\n";
}

std::string bash_completion(const CLI::App& app) {
  std::vector<std::string> commands;
  std::string cases;
  for (const CLI::App* command : subcommands_of(app)) {
    commands.push_back(command->get_name());
    cases += bash_case(command->get_name(), *command);
  }
  cases += bash_case("*", app);
  return R"(# Completion of voxel for bash. Made by: voxel generate bash
_voxel() {
  local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD-1]}
  local flags="" words="" takes_value="" commands=")" +
         joined(commands, " ") + R"("
  case "${COMP_WORDS[1]}" in
)" + cases +
         R"(  esac
  COMPREPLY=()
  if [[ -n $words ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")
  elif [[ -z $takes_value && $current == -* ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$flags" -- "$current")
  elif [[ $COMP_CWORD -eq 1 ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$commands" -- "$current"; compgen -f -- "$current")
  else
    case "${COMP_WORDS[1]}" in
      ls) mapfile -t COMPREPLY < <(compgen -W "results grids sequences assets" -- "$current") ;;
      generate) mapfile -t COMPREPLY < <(compgen -W "man bash zsh" -- "$current") ;;
      *) mapfile -t COMPREPLY < <(compgen -f -- "$current") ;;
    esac
  fi
}
complete -o filenames -F _voxel voxel
)";
}

// --- zsh

// Text within single quotes and the brackets or colons of a specification.
std::string zsh_text(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '\'') {
      out += "'\\''";
    } else if (c == '[' || c == ']' || c == ':' || c == '\\') {
      out += std::string("\\") + c;
    } else {
      out += c;
    }
  }
  return out;
}

// The specifications of a command's options for _arguments.
std::string zsh_options(const CLI::App& command, const std::string& indent) {
  std::string text;
  for (const CLI::Option* option : command.get_options()) {
    const std::vector<std::string> words = words_of(*option);
    const std::string action = words.empty() ? "_files" : "(" + joined(words, " ") + ")";
    for (const std::string& name : names_of(*option)) {
      text.append(" \\\n").append(indent).append("'").append(name);
      text.append("[").append(zsh_text(option->get_description())).append("]");
      if (takes_value(*option)) {
        text.append(":").append(zsh_text(option->get_type_name())).append(":").append(action);
      }
      text += "'";
    }
    if (option->get_positional()) {
      text.append(" \\\n").append(indent).append("'*:");
      text.append(zsh_text(option->get_type_name())).append(":").append(action).append("'");
    }
  }
  return text;
}

std::string zsh_completion(const CLI::App& app) {
  std::string described, cases;
  for (const CLI::App* command : subcommands_of(app)) {
    described += "    '" + command->get_name() + ":" + zsh_text(command->get_description()) + "'\n";
    cases +=
        "    " + command->get_name() + ") _arguments" + zsh_options(*command, "      ") + " ;;\n";
  }
  return "#compdef voxel\n# Completion of voxel for zsh. Made by: voxel generate zsh\n"
         "_voxel() {\n  local -a commands=(\n" +
         described +
         "  )\n  if (( CURRENT == 2 )) && [[ $words[2] != -* ]]; then\n"
         "    _describe command commands\n    _files\n    return\n  fi\n"
         "  local command=$words[2]\n  case $command in\n" +
         cases + "    *) _arguments" + zsh_options(app, "      ") +
         " ;;\n  esac\n}\n_voxel \"$@\"\n";
}

}  // namespace

std::string document_text(std::string_view document, const CLI::App& app) {
  if (document == "bash") return bash_completion(app);
  if (document == "zsh") return zsh_completion(app);
  return man_page(app);
}

}  // namespace voxeld::cli
