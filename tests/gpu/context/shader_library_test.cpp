// Programs from files: caching, dispatch, and errors that a reader can follow.
#include "server/gpu/shader_library.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "server/gpu/objects.h"
#include "tests/gpu/context/test_device.h"

namespace voxeld::gpu {
namespace {

using ::testing::ContainsRegex;
using ::testing::HasSubstr;

// A folder of shader files that goes away with the test.
class ShaderFolder {
 public:
  ShaderFolder() {
    std::string pattern = (std::filesystem::temp_directory_path() / "voxeld-XXXXXX").string();
    path_ = ::mkdtemp(pattern.data());
    std::filesystem::create_directories(path_ / "lib");
  }
  ~ShaderFolder() { std::filesystem::remove_all(path_); }
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(path_ / name) << text;
  }
  std::string path() const { return path_.string(); }

 private:
  std::filesystem::path path_;
};

constexpr char kCount[] = R"(layout(local_size_x = 1) in;
layout(std430, binding = 0) buffer Count { uint count; };
#include "lib/step.glsl"
void main() { atomicAdd(count, step_size()); }
)";

TEST(ShaderLibrary, a_dispatch_over_the_axis_limit_runs_every_group) {
  const ShaderFolder folder;
  folder.write("count.comp", kCount);
  folder.write("lib/step.glsl", "uint step_size() { return STEP; }\n");
  ShaderLibrary shaders(test_context(), folder.path());
  const auto program = shaders.get({{"count.comp"}}, {{"STEP", "2u"}});
  ASSERT_TRUE(program.ok()) << program.error().message();
  auto buffer = Buffer::create(test_context(), 4, "count");
  ASSERT_TRUE(buffer.ok());
  buffer->bind_storage(0);
  const int64_t groups = test_context().info().dispatch_groups_max + 1;
  (*program)->dispatch(groups);
  test_context().gl().MemoryBarrier(GL_ALL_BARRIER_BITS);
  std::vector<uint32_t> count(1);
  buffer->read<uint32_t>(0, count);
  // Folded to two rows; the shader is asked to check its count, and this one does not.
  EXPECT_EQ(count[0], 2 * 2 * test_context().info().dispatch_groups_max);
  EXPECT_TRUE(test_context().check("count").ok());
}

TEST(ShaderLibrary, the_same_files_and_defines_give_the_same_program) {
  const ShaderFolder folder;
  folder.write("count.comp", kCount);
  folder.write("lib/step.glsl", "uint step_size() { return STEP; }\n");
  ShaderLibrary shaders(test_context(), folder.path());
  const auto first = shaders.get({{"count.comp"}}, {{"STEP", "1u"}});
  const auto again = shaders.get({{"count.comp"}}, {{"STEP", "1u"}});
  const auto other = shaders.get({{"count.comp"}}, {{"STEP", "3u"}});
  ASSERT_TRUE(first.ok() && again.ok() && other.ok());
  EXPECT_EQ(*first, *again);
  EXPECT_NE(*first, *other);
}

TEST(ShaderLibrary, an_error_in_an_included_file_names_that_file_and_line) {
  const ShaderFolder folder;
  folder.write("count.comp", kCount);
  folder.write("lib/step.glsl", "// first line\nuint step_size() { return nonsense; }\n");
  ShaderLibrary shaders(test_context(), folder.path());
  const auto program = shaders.get({{"count.comp"}}, {});
  ASSERT_FALSE(program.ok());
  EXPECT_EQ(program.error().code, ErrorCode::kInternal);
  EXPECT_THAT(program.error().detail, HasSubstr("count.comp does not compile on "));
  EXPECT_THAT(program.error().detail, ContainsRegex("lib/step\\.glsl:2[^0-9].*nonsense"));
}

TEST(ShaderLibrary, an_error_after_an_include_keeps_the_line_of_the_including_file) {
  const ShaderFolder folder;
  folder.write("count.comp", "#include \"lib/step.glsl\"\n\nvoid main() { nonsense(); }\n");
  folder.write("lib/step.glsl", "uint step_size() { return 1u; }\n");
  ShaderLibrary shaders(test_context(), folder.path());
  const auto program = shaders.get({{"count.comp"}}, {});
  ASSERT_FALSE(program.ok());
  EXPECT_THAT(program.error().detail, ContainsRegex("count\\.comp:3[^0-9].*nonsense"));
}

TEST(ShaderLibrary, stages_that_do_not_fit_are_a_link_error_with_the_names) {
  const ShaderFolder folder;
  folder.write("a.vert", "void main() { gl_Position = vec4(0.0); }\n");
  folder.write("a.frag", "in vec3 missing; out vec4 c; void main() { c = missing.xyzz; }\n");
  ShaderLibrary shaders(test_context(), folder.path());
  const auto program = shaders.get({{"a.vert"}, {"a.frag"}}, {{"X", "1"}});
  ASSERT_FALSE(program.ok());
  EXPECT_THAT(program.error().detail, HasSubstr("a.vert a.frag X=1 does not link on "));
  EXPECT_THAT(program.error().detail, HasSubstr("missing"));
  EXPECT_TRUE(test_context().check("after a failed link").ok());
}

}  // namespace
}  // namespace voxeld::gpu
