// The #include resolver and the way back from driver logs.
#include "server/gpu/shader_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "server/base/sha256.h"
#include "shaders/embedded.h"

namespace voxeld::gpu {
namespace {

using ::testing::ElementsAre;
using ::testing::EndsWith;

using Files = std::map<std::string, std::string, std::less<>>;

Result<ResolvedShader> resolve(const Files& files, std::string_view file,
                               const Defines& defines = {}) {
  return resolve_shader(file, defines, [&](std::string_view name) -> Result<std::string> {
    const auto found = files.find(name);
    if (found != files.end()) return found->second;
    return Error{ErrorCode::kInternal, "no shader is named " + std::string(name), "", ""};
  });
}

TEST(ResolveShader, begins_with_version_then_defines) {
  const auto shader =
      resolve({{"a.comp", "void main() {}\n"}}, "a.comp", {{"A", "1"}, {"B", "2u"}});
  ASSERT_TRUE(shader.ok());
  EXPECT_EQ(shader->text,
            "#version 450 core\n"
            "#extension GL_ARB_gpu_shader_int64 : require\n"
            "#define A 1\n"
            "#define B 2u\n"
            "void main() {}\n");
  EXPECT_THAT(shader->files, ElementsAre("a.comp"));
  ASSERT_EQ(shader->lines.size(), 5u);
  EXPECT_EQ(shader->lines[3].number, 0);
  EXPECT_EQ(shader->lines[4].number, 1);
}

TEST(ResolveShader, variants_without_64_bit_integers_do_not_ask_for_them) {
  const auto shader =
      resolve({{"a.comp", "void main() {}\n"}}, "a.comp", {{std::string(kNoInt64Define), "1"}});
  ASSERT_TRUE(shader.ok());
  EXPECT_EQ(shader->text,
            "#version 450 core\n"
            "#define NO_INT64 1\n"
            "void main() {}\n");
  EXPECT_EQ(shader->lines.size(), 3u);
}

TEST(ResolveShader, includes_each_file_once_and_in_cycles) {
  const auto shader =
      resolve({{"a.comp", "#include \"lib/b.glsl\"\n#include \"lib/c.glsl\"\nmain\n"},
               {"lib/b.glsl", "#include \"lib/c.glsl\"\nb\n"},
               {"lib/c.glsl", "#include \"lib/b.glsl\"\nc\n"}},
              "a.comp");
  ASSERT_TRUE(shader.ok());
  EXPECT_THAT(shader->text, EndsWith("require\n\nc\nb\n\nmain\n"));
  EXPECT_THAT(shader->files, ElementsAre("a.comp", "lib/b.glsl", "lib/c.glsl"));
}

TEST(ResolveShader, shared_headers_drop_the_parts_for_cpp) {
  const auto shader = resolve(
      {{"a.comp", "#include \"shaders/shared/p.h\"\n"},
       {"shared/p.h", "#pragma once\n#include <cstdint>\n  #  include \"shaders/shared/q.h\"\np\n"},
       {"shared/q.h", "q"}},
      "a.comp");
  ASSERT_TRUE(shader.ok());
  EXPECT_THAT(shader->text, EndsWith("require\n\n\nq\np\n"));
}

TEST(ResolveShader, mistakes_are_reported_with_file_and_line) {
  const struct {
    Files files;
    const char* message;
  } kCases[] = {
      {{{"a.comp", "x\n#include \"b.glsl\"\n"}},
       "a.comp line 2: cannot include b.glsl: no shader is named b.glsl"},
      {{{"a.comp", "#include \"b.glsl\"\n"}, {"b.glsl", "\n\n#include \"c.glsl\"\n"}},
       "b.glsl line 3: cannot include c.glsl: no shader is named c.glsl"},
      {{{"a.comp", "#include b.glsl\n"}}, "a.comp line 1: #include takes a name in quotes"},
      {{{"a.comp", "#include \"b.glsl\n"}}, "a.comp line 1: #include takes a name in quotes"},
      {{{"a.comp", "#version 430\n"}}, "a.comp line 1: #version is given by the resolver"},
      {{}, "no shader is named a.comp"},
  };
  for (const auto& one : kCases) {
    const auto shader = resolve(one.files, "a.comp");
    ASSERT_FALSE(shader.ok()) << one.message;
    EXPECT_EQ(shader.error().code, ErrorCode::kInternal);
    EXPECT_EQ(shader.error().detail, one.message);
  }
}

TEST(NameFilesInLog, every_compiler_form_is_mapped_and_other_lines_stay) {
  const auto shader = resolve(
      {{"a.comp", "#include \"lib/b.glsl\"\nmain\n"}, {"lib/b.glsl", "one\ntwo\n"}}, "a.comp");
  ASSERT_TRUE(shader.ok());
  // Lines of the text: 1-2 head, 3 one, 4 two, 5 main.
  EXPECT_EQ(name_files_in_log("0:4(7): error: bad\n", *shader), "lib/b.glsl:2(7): error: bad");
  EXPECT_EQ(name_files_in_log("0(3) : error C1008: bad", *shader),
            "lib/b.glsl:1 : error C1008: bad");
  EXPECT_EQ(name_files_in_log("ERROR: 0:5: 'x' : bad", *shader), "ERROR: a.comp:2: 'x' : bad");
  for (const char* same : {"0:1(1): error: in the head", "0:99: no such line", "error: no place",
                           "3 errors", "0:x", "18446744073709551616:1: big"}) {
    EXPECT_EQ(name_files_in_log(same, *shader), same);
  }
  EXPECT_EQ(name_files_in_log("\n\nx\n\n0:5: y\n", *shader), "x\na.comp:2: y");
}

TEST(EmbeddedShaders, are_sorted_and_found_by_name) {
  std::string_view before;
  ASSERT_FALSE(shaders::embedded_shaders().empty());
  for (const shaders::EmbeddedShader& shader : shaders::embedded_shaders()) {
    EXPECT_LT(before, shader.name);
    before = shader.name;
    EXPECT_EQ("sha256-" + std::string(shader.sha256), sha256_id(shader.text));
    const auto text = read_embedded_shader(shader.name);
    ASSERT_TRUE(text.ok());
    EXPECT_EQ(*text, shader.text);
  }
  const auto missing = read_embedded_shader("missing.comp");
  ASSERT_FALSE(missing.ok());
  EXPECT_EQ(missing.error().detail, "no shader is named missing.comp");
}

}  // namespace
}  // namespace voxeld::gpu
