// The reason why there is no GPU, by the files of made-up machines.
#include "server/device/missing_driver.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

namespace voxeld::gpu {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class MissingDriver : public ::testing::Test {
 protected:
  MissingDriver()
      : root_(fs::temp_directory_path() / ("voxeld-gpu-" + std::to_string(::getpid()))) {
    fs::create_directories(root_);
  }
  ~MissingDriver() override { fs::remove_all(root_); }
  // A file that opens, as a device node would.
  void add_file(const std::string& path) {
    fs::create_directories((root_ / path).parent_path());
    std::ofstream(root_ / path) << "x";
  }
  const fs::path root_;
};

TEST_F(MissingDriver, no_node_at_all) {
  EXPECT_EQ(missing_driver(root_),
            "no GPU's device node is there (/dev/nvidia0 or /dev/dri/renderD128)");
  add_file("dev/nvidiactl");  // belongs to no card
  EXPECT_THAT(missing_driver(root_), HasSubstr("no GPU's device node"));
}

TEST_F(MissingDriver, nodes_of_every_kind_of_gpu_count) {
  EXPECT_FALSE(has_gpu_node(root_));
  add_file("dev/dxg");
  EXPECT_TRUE(has_gpu_node(root_));
  EXPECT_THAT(missing_driver(root_), HasSubstr("/dev/dxg is there, but no Mesa driver"));
  fs::remove(root_ / "dev/dxg");
  add_file("dev/dri/renderD128");
  EXPECT_TRUE(has_gpu_node(root_));
  fs::remove(root_ / "dev/dri/renderD128");
  add_file("dev/nvidia3");
  EXPECT_TRUE(has_gpu_node(root_));
}

TEST_F(MissingDriver, an_nvidia_card_without_its_vendor_file) {
  add_file("dev/nvidia1");
  add_file("dev/nvidia0");
  add_file("usr/share/glvnd/egl_vendor.d/50_mesa.json");
  EXPECT_THAT(missing_driver(root_), HasSubstr("/dev/nvidia0 is there, but not NVIDIA's EGL"));
  EXPECT_THAT(missing_driver(root_), HasSubstr("10_nvidia.json"));
}

TEST_F(MissingDriver, an_nvidia_card_whose_driver_does_not_open) {
  add_file("dev/nvidia0");
  add_file("etc/glvnd/egl_vendor.d/10_nvidia.json");
  EXPECT_THAT(missing_driver(root_), HasSubstr("its EGL driver did not open"));
}

TEST_F(MissingDriver, a_node_that_does_not_open) {
  // A folder opens for nobody's writing, not even root's.
  fs::create_directories(root_ / "dev/nvidia0");
  EXPECT_EQ(missing_driver(root_), "/dev/nvidia0 cannot be opened: Is a directory");
  fs::remove(root_ / "dev/nvidia0");
  fs::create_directories(root_ / "dev/dri/renderD129");
  EXPECT_EQ(missing_driver(root_),
            "/dev/dri/renderD129 cannot be opened: Is a directory (is this user in the group "
            "render?)");
}

TEST_F(MissingDriver, a_node_that_opens_without_a_driver_of_mesa) {
  add_file("dev/dri/card0");
  add_file("dev/dri/renderD128");
  EXPECT_EQ(missing_driver(root_),
            "/dev/dri/renderD128 is there, but no Mesa driver for it (package libgl1-mesa-dri)");
}

}  // namespace
}  // namespace voxeld::gpu
