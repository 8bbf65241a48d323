// Every variant of shaders/variants.txt is valid GLSL 4.50 by Khronos' reference compiler, which is
// stricter than Mesa; and every entry point stands in that table.
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "server/gpu/shader_source.h"
#include "shaders/embedded.h"

namespace voxeld::gpu {
namespace {

struct Variant {
  std::string file;
  Defines defines;
};

std::vector<Variant> read_variants() {
  std::ifstream table(VOXELD_SHADER_DIR "/variants.txt");
  EXPECT_TRUE(table.good()) << VOXELD_SHADER_DIR "/variants.txt";
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

// The validator's words, empty when it finds nothing wrong.
std::string validate(const ResolvedShader& shader, std::string_view file) {
  std::string pattern = (std::filesystem::temp_directory_path() / "voxeld-shader-XXXXXX").string();
  const int fd = ::mkstemp(pattern.data());
  EXPECT_GE(fd, 0);
  ::close(fd);
  std::ofstream(pattern) << shader.text;
  const std::string stage(file.substr(file.rfind('.') + 1));
  const std::string command =
      std::string(VOXELD_GLSLANG_VALIDATOR) + " -S " + stage + " " + pattern + " 2>&1";
  std::string log;
  FILE* pipe = ::popen(command.c_str(), "r");
  std::array<char, 4096> buffer;
  while (size_t bytes = std::fread(buffer.data(), 1, buffer.size(), pipe)) {
    log.append(buffer.data(), bytes);
  }
  const int status = ::pclose(pipe);
  std::filesystem::remove(pattern);
  return status == 0 ? "" : name_files_in_log(log, shader);
}

TEST(ShaderVariants, are_all_valid_offline) {
  const std::vector<Variant> variants = read_variants();
  EXPECT_FALSE(variants.empty());
  for (const Variant& variant : variants) {
    const auto shader = resolve_shader(variant.file, variant.defines, read_embedded_shader);
    ASSERT_TRUE(shader.ok()) << shader.error().detail;
    EXPECT_EQ(validate(*shader, variant.file), "") << variant.file;
  }
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
  EXPECT_NE(validate(*shader, "x.comp").find("ERROR: x.comp:2"), std::string::npos);
}

}  // namespace
}  // namespace voxeld::gpu
