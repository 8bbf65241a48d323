// Every variant of shaders/variants.txt is valid GLSL 4.50 by Khronos' reference compiler, which is
// stricter than Mesa; and every entry point stands in that table.
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <optional>
#include <set>
#include <sstream>

#include "server/gpu/shader_source.h"
#include "shaders/embedded.h"
#include "tests/folders.h"
#include "tests/unit/base/temporary_dir.h"

namespace voxeld::gpu {
namespace {

struct Variant {
  std::string file;
  Defines defines;
};

std::vector<Variant> read_variants() {
  const auto path = test::source_dir() / "shaders/variants.txt";
  std::ifstream table(path);
  EXPECT_TRUE(table.good()) << path;
  std::vector<Variant> variants;
  for (std::string line; std::getline(table, line);) {
    std::istringstream words(line);
    Variant variant;
    if (!(words >> variant.file) || variant.file[0] == '#') continue;
    for (std::string define; words >> define;) {
      const size_t equals = define.find('=');
      variant.defines.emplace_back(define.substr(0, equals),
                                   equals == std::string::npos ? "1" : define.substr(equals + 1));
    }
    variants.push_back(std::move(variant));
  }
  return variants;
}

bool is_entry_point(std::string_view name) {
  for (const std::string_view stage : {".comp", ".vert", ".geom", ".frag"}) {
    if (name.ends_with(stage)) return true;
  }
  return false;
}

// Writes the shader to a file whose ending tells its stage, and returns the path.
std::string write_shader(const testing::TemporaryDir& dir, size_t number,
                         const ResolvedShader& shader, std::string_view file) {
  std::string path = dir.path() / (std::to_string(number).append(file.substr(file.rfind('.'))));
  std::ofstream(path) << shader.text;
  return path;
}

// The validator's words on files; nullopt when it finds nothing wrong.
std::optional<std::string> validate(const std::string& paths) {
  const std::string command = std::string(VOXELD_GLSLANG_VALIDATOR) + " " + paths + " 2>&1";
  std::string log;
  FILE* pipe = ::popen(command.c_str(), "r");
  std::array<char, 4096> buffer;
  while (size_t bytes = std::fread(buffer.data(), 1, buffer.size(), pipe)) {
    log.append(buffer.data(), bytes);
  }
  return ::pclose(pipe) == 0 ? std::nullopt : std::optional(log);
}

TEST(ShaderVariants, are_all_valid_offline) {
  const std::vector<Variant> variants = read_variants();
  EXPECT_FALSE(variants.empty());
  const testing::TemporaryDir dir;
  std::vector<std::pair<std::string, ResolvedShader>> files;
  std::string paths;
  for (const Variant& variant : variants) {
    auto shader = resolve_shader(variant.file, variant.defines, read_embedded_shader);
    ASSERT_TRUE(shader.ok()) << shader.error().detail;
    files.emplace_back(write_shader(dir, files.size(), *shader, variant.file), *std::move(shader));
    paths += " " + files.back().first;
  }
  if (!validate(paths)) return;  // by one process, which reads its built-in functions once
  for (size_t i = 0; i < files.size(); ++i) {
    const auto log = validate(files[i].first);
    if (log) ADD_FAILURE() << variants[i].file << ": " << name_files_in_log(*log, files[i].second);
  }
  FAIL() << "the validator refuses the files of all variants";
}

TEST(ShaderVariants, every_entry_point_is_in_the_table) {
  std::set<std::string> listed;
  for (const Variant& variant : read_variants()) listed.insert(variant.file);
  for (const shaders::EmbeddedShader& shader : shaders::embedded_shaders()) {
    if (is_entry_point(shader.name)) {
      EXPECT_TRUE(listed.contains(std::string(shader.name)))
          << shader.name << " is not in shaders/variants.txt";
    }
  }
}

TEST(ShaderVariants, the_validator_finds_mistakes) {
  const auto shader = resolve_shader("x.comp", {}, [](std::string_view) -> Result<std::string> {
    return std::string("\nvoid main() { nonsense(); }\n");
  });
  ASSERT_TRUE(shader.ok());
  const testing::TemporaryDir dir;
  const auto log = validate(write_shader(dir, 0, *shader, "x.comp"));
  ASSERT_TRUE(log);
  EXPECT_NE(name_files_in_log(*log, *shader).find("ERROR: x.comp:2"), std::string::npos);
}

}  // namespace
}  // namespace voxeld::gpu
