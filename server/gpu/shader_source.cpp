#include "server/gpu/shader_source.h"

#include <algorithm>
#include <charconv>
#include <optional>

#include "shaders/embedded.h"

namespace voxeld::gpu {
namespace {

// OpenGL 4.5, the baseline.
constexpr std::string_view kVersion = "#version 450 core";
constexpr std::string_view kInt64 = "#extension GL_ARB_gpu_shader_int64 : require";

std::string_view trim_left(std::string_view text) {
  const size_t start = text.find_first_not_of(" \t");
  return start == std::string_view::npos ? std::string_view{} : text.substr(start);
}

bool is_directive(std::string_view line, std::string_view name, std::string_view& rest) {
  line = trim_left(line);
  if (!line.starts_with('#')) return false;
  line = trim_left(line.substr(1));
  if (!line.starts_with(name)) return false;
  rest = trim_left(line.substr(name.size()));
  return true;
}

Error error_at(std::string_view file, int line, std::string what) {
  return Error{ErrorCode::kInternal,
               std::string(file) + " line " + std::to_string(line) + ": " + std::move(what), "",
               ""};
}

class Resolver {
 public:
  explicit Resolver(const ShaderReader& read) : read_(read) {}

  Status add_file(const std::string& name) {
    const size_t index = out.files.size();
    out.files.push_back(name);
    VOXELD_ASSIGN(const std::string text, read_(name));
    int line_number = 0;
    for (size_t start = 0; start < text.size();) {
      const size_t end = std::min(text.find('\n', start), text.size());
      const std::string_view line = std::string_view(text).substr(start, end - start);
      VOXELD_TRY(add_line(line, index, ++line_number));
      start = end + 1;
    }
    return {};
  }

  void append(std::string_view line, size_t index, int number) {
    out.text.append(line);
    out.text += '\n';
    out.lines.push_back({index, number});
  }

  ResolvedShader out;

 private:
  Status add_line(std::string_view line, size_t index, int number) {
    std::string_view rest;
    if (is_directive(line, "include", rest)) return add_include(rest, index, number);
    if (is_directive(line, "version", rest)) {
      return error_at(out.files[index], number, "#version is given by the resolver");
    }
    if (is_directive(line, "pragma", rest) && rest.starts_with("once")) line = {};
    append(line, index, number);
    return {};
  }

  Status add_include(std::string_view target, size_t index, int number) {
    if (target.starts_with('<')) {  // in the C++ part of a shared header
      append({}, index, number);
      return {};
    }
    const size_t close = target.find('"', 1);
    if (!target.starts_with('"') || close == std::string_view::npos) {
      return error_at(out.files[index], number, "#include takes a name in quotes");
    }
    std::string name(target.substr(1, close - 1));
    constexpr std::string_view kRoot = "shaders/";
    if (name.starts_with(kRoot)) name.erase(0, kRoot.size());
    if (std::find(out.files.begin(), out.files.end(), name) != out.files.end()) {
      append({}, index, number);
      return {};
    }
    const std::string from = out.files[index];
    if (Status status = add_file(name); !status.ok()) {
      // Only a file that cannot be read is reported with the place that includes it.
      if (out.files.back() != name) return status;
      return error_at(from, number, "cannot include " + name + ": " + status.error().detail);
    }
    return {};
  }

  const ShaderReader& read_;
};

// Parses "<number>" at the head of `text` and removes it.
std::optional<size_t> take_number(std::string_view& text) {
  size_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end == text.data()) return std::nullopt;
  text.remove_prefix(static_cast<size_t>(end - text.data()));
  return value;
}

std::string name_file_in_line(std::string_view line, const ResolvedShader& shader) {
  std::string_view rest = line;
  std::string prefix;
  for (const std::string_view head : {"ERROR: ", "WARNING: "}) {
    if (rest.starts_with(head)) {
      prefix = head;
      rest.remove_prefix(head.size());
    }
  }
  const auto file = take_number(rest);
  if (!file || rest.empty()) return std::string(line);
  const char open = rest.front();
  if (open != ':' && open != '(') return std::string(line);
  rest.remove_prefix(1);
  const auto number = take_number(rest);
  if (!number || *number == 0 || *number > shader.lines.size()) return std::string(line);
  if (open == '(' && rest.starts_with(')')) rest.remove_prefix(1);
  const ResolvedShader::Line& from = shader.lines[*number - 1];
  if (from.number == 0) return std::string(line);
  return prefix + shader.files[from.file] + ":" + std::to_string(from.number) + std::string(rest);
}

}  // namespace

Result<ResolvedShader> resolve_shader(std::string_view file, const Defines& defines,
                                      const ShaderReader& read) {
  Resolver resolver(read);
  resolver.append(kVersion, 0, 0);
  const bool is_without = std::ranges::any_of(
      defines, [](const auto& define) { return define.first == kNoInt64Define; });
  if (!is_without) resolver.append(kInt64, 0, 0);
  for (const auto& [name, value] : defines) {
    std::string line = "#define ";
    line.append(name).append(" ").append(value);
    resolver.append(line, 0, 0);
  }
  VOXELD_TRY(resolver.add_file(std::string(file)));
  return std::move(resolver.out);
}

std::string name_files_in_log(std::string_view log, const ResolvedShader& shader) {
  std::string named;
  while (!log.empty()) {
    const size_t end = std::min(log.find('\n'), log.size());
    const std::string_view line = log.substr(0, end);
    if (!line.empty()) {
      if (!named.empty()) named += '\n';
      named += name_file_in_line(line, shader);
    }
    log.remove_prefix(std::min(end + 1, log.size()));
  }
  return named;
}

Result<std::string> read_embedded_shader(std::string_view name) {
  for (const shaders::EmbeddedShader& shader : shaders::embedded_shaders()) {
    if (shader.name == name) return std::string(shader.text);
  }
  return Error{ErrorCode::kInternal, "no shader is named " + std::string(name), "", ""};
}

}  // namespace voxeld::gpu
