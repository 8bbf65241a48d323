// Contexts open on every software driver, know their limits, and refuse clearly.
#include "server/gpu/context.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/gpu/context/test_device.h"

namespace voxeld::gpu {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

TEST(Context, opens_and_names_the_driver_that_was_asked_for) {
  const DeviceInfo& info = test_context().info();
  EXPECT_TRUE(info.is_software) << info.renderer;
  EXPECT_THAT(info.renderer, HasSubstr("llvmpipe"));
  const bool is_zink = info.renderer.find("zink") != std::string::npos;
  EXPECT_EQ(is_zink, info.device.kind == DeviceKind::kLavapipe) << info.renderer;
  EXPECT_THAT(info.version, HasSubstr("Mesa"));
  EXPECT_THAT(info.backend,
              StartsWith(info.device.kind == DeviceKind::kOsmesa ? "OSMesa" : "EGL 1.5"));
}

TEST(Context, limits_are_read_or_known) {
  const DeviceInfo& info = test_context().info();
  EXPECT_TRUE(info.has_int64);
  EXPECT_TRUE(info.has_float64);
  EXPECT_FALSE(info.has_timer_queries) << "timer_query_zero";
  EXPECT_EQ(info.loop_iterations_max, 65535) << "loop_iterations_65535";
  EXPECT_GE(info.ssbo_bytes_max, int64_t{128} << 20);
  EXPECT_GE(info.ssbo_bindings_max, 8);
  EXPECT_GE(info.ubo_bytes_max, 16384);
  EXPECT_GE(info.texture_side_max, 8192);
  EXPECT_GE(info.texture3d_side_max, 2048);
  EXPECT_GE(info.framebuffer_side_max, 4096);
  EXPECT_GE(info.dispatch_groups_max, 65535);
}

TEST(Context, a_second_context_of_the_same_kind_opens_and_the_first_still_works) {
  Context& first = test_context();
  auto second = Context::create(first.info().device);
  ASSERT_TRUE(second.ok()) << second.error().message();
  EXPECT_TRUE((*second)->check("second context").ok());
  second = Error{};  // gone
  ASSERT_TRUE(first.make_current().ok());
  EXPECT_TRUE(first.check("first context").ok());
}

TEST(Context, another_kind_of_mesa_egl_driver_is_refused_in_the_same_process) {
  const DeviceKind kind = test_context().info().device.kind;
  if (kind == DeviceKind::kOsmesa) GTEST_SKIP() << "osmesa is no EGL driver";
  const bool is_zink = kind == DeviceKind::kLavapipe;
  const auto other = Context::create({is_zink ? DeviceKind::kLlvmpipe : DeviceKind::kLavapipe, 0});
  ASSERT_FALSE(other.ok());
  EXPECT_EQ(other.error().code, ErrorCode::kDeviceUnavailable);
  EXPECT_EQ(other.error().message(),
            is_zink ? "llvmpipe cannot be opened: this process has opened lavapipe, and Mesa loads "
                      "one EGL driver per process"
                    : "lavapipe cannot be opened: this process has opened llvmpipe, and Mesa loads "
                      "one EGL driver per process");
  ASSERT_TRUE(test_context().make_current().ok());
}

TEST(Context, osmesa_and_egl_live_in_one_process) {
  Context& own = test_context();
  const bool own_is_osmesa = own.info().device.kind == DeviceKind::kOsmesa;
  {
    auto other = Context::create({own_is_osmesa ? DeviceKind::kLlvmpipe : DeviceKind::kOsmesa, 0});
    ASSERT_TRUE(other.ok()) << other.error().message();
    EXPECT_NE((*other)->info().backend, own.info().backend);
    EXPECT_TRUE((*other)->check("the other").ok());
  }
  ASSERT_TRUE(own.make_current().ok());
  EXPECT_TRUE(own.check("own").ok());
}

TEST(Context, a_device_number_that_does_not_exist_is_refused_with_the_range) {
  const auto context = Context::create({DeviceKind::kEgl, 99});
  ASSERT_FALSE(context.ok());
  EXPECT_THAT(context.error().message(), StartsWith("egl:99 does not exist: expected "));
  ASSERT_TRUE(test_context().make_current().ok());
}

TEST(Context, opening_a_device_leaves_the_environment_as_it_was) {
  test_context();
  EXPECT_EQ(std::getenv("LIBGL_ALWAYS_SOFTWARE"), nullptr);
  EXPECT_EQ(std::getenv("MESA_LOADER_DRIVER_OVERRIDE"), nullptr);
  EXPECT_EQ(std::getenv("ZINK_INLINE_UNIFORMS"), nullptr);
}

TEST(Context, an_error_is_reported_once_with_its_name_and_place) {
  Context& context = test_context();
  context.gl().Enable(0xdead);
  context.gl().NamedBufferSubData(123456, 0, 4, nullptr);
  const Status status = context.check("a pass");
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kInternal);
  EXPECT_THAT(status.error().detail, StartsWith("a pass: GL_INVALID_ENUM on "));
  EXPECT_TRUE(context.check("the next pass").ok());
}

// A driver that has reset the device, which tells each error once.
class LostContext final : public Context {
 public:
  LostContext() {
    errors_ = 1;
    gl_.GetError = []() -> GLenum { return errors_-- > 0 ? GL_CONTEXT_LOST : GL_NO_ERROR; };
    gl_.GetGraphicsResetStatus = []() -> GLenum { return GL_NO_ERROR; };
  }
  Status make_current() const override { return {}; }

 private:
  static inline int errors_ = 0;
};

TEST(Context, a_lost_context_stays_lost) {
  const LostContext context;
  for (int i = 0; i < 3; ++i) {
    const Status status = context.check("raster pass");
    ASSERT_FALSE(status.ok());
    EXPECT_EQ(status.error().code, ErrorCode::kDeviceUnavailable);
    EXPECT_THAT(status.error().message(), HasSubstr("the device was reset"));
  }
  EXPECT_EQ(context.memory().bytes_total, 0);
}

// A driver that has reset the device, of which no call tells.
class ResetContext final : public Context {
 public:
  ResetContext() {
    gl_.GetError = []() -> GLenum { return GL_NO_ERROR; };
    gl_.GetGraphicsResetStatus = []() -> GLenum { return GL_INNOCENT_CONTEXT_RESET; };
  }
  Status make_current() const override { return {}; }
};

TEST(Context, a_reset_of_which_no_call_tells_is_an_error) {
  const ResetContext context;
  const Status status = context.check("raster pass");
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kDeviceUnavailable);
  EXPECT_THAT(status.error().message(), StartsWith("raster pass: "));
  EXPECT_THAT(status.error().message(), HasSubstr("the device was reset"));
}

TEST(Context, software_drivers_tell_no_memory_of_a_device) {
  if (!test_context().info().is_software) GTEST_SKIP() << "hardware";
  const MemoryInfo memory = test_context().memory();
  EXPECT_EQ(memory.bytes_total, 0);
  EXPECT_EQ(memory.bytes_free, 0);
}

}  // namespace
}  // namespace voxeld::gpu
