// Names of devices, and what auto takes.
#include "server/device/device.h"

#include <gtest/gtest.h>

namespace voxeld::gpu {
namespace {

TEST(Device, names_are_parsed_and_written_back) {
  for (const char* name :
       {"egl:0", "egl:12", "pci:0000:3b:00.0", "llvmpipe", "lavapipe", "osmesa", "cpu"}) {
    const auto device = parse_device(name);
    ASSERT_TRUE(device.ok()) << name;
    EXPECT_EQ(device_name(*device), name);
  }
}

TEST(Device, a_pci_address_has_one_form) {
  for (const char* name : {"pci:0000:3b:00.0", "pci:3b:00.0", "pci:00000000:3B:00.0"}) {
    const auto device = parse_device(name);
    ASSERT_TRUE(device.ok()) << name;
    EXPECT_EQ(device_name(*device), "pci:0000:3b:00.0");
    EXPECT_EQ(*device, (DeviceId{DeviceKind::kEgl, 0, PciAddress{0, 0x3b, 0, 0}}));
  }
}

TEST(Device, other_names_are_refused_with_the_forms) {
  for (const char* name : {"", "auto", "egl", "egl:", "egl:-1", "egl:1x", "LLVMPIPE", "cuda:0",
                           "egl:99999999999999999999", "pci:", "pci:0", "0000:3b:00.0"}) {
    const auto device = parse_device(name);
    ASSERT_FALSE(device.ok()) << name;
    EXPECT_EQ(device.error().code, ErrorCode::kInvalidOption);
    EXPECT_EQ(device.error().detail, "unknown device");
    EXPECT_EQ(device.error().expected,
              "egl:N (N = 0, 1, …), pci:DOMAIN:BUS:DEVICE.FUNCTION (as pci:0000:3b:00.0), "
              "llvmpipe, lavapipe, osmesa or cpu");
    EXPECT_EQ(device.error().got, name);
  }
}

TEST(Device, software_renderers_are_known_by_name) {
  for (const char* renderer :
       {"llvmpipe (LLVM 15.0.6, 256 bits)", "softpipe", "Software Rasterizer",
        "zink (llvmpipe (LLVM 15.0.6, 256 bits))",
        "zink Vulkan 1.4(llvmpipe (LLVM 19.1.7, 256 bits) (MESA_LLVMPIPE))",
        "virgl (LLVMPIPE (LLVM 15.0.7, 256 bits))", "D3D12 (Microsoft Basic Render Driver)",
        "ANGLE (Google, Vulkan 1.3.0 (SwiftShader Device (Subzero) (0x0000C0DE)), SwiftShader)",
        "Gallium 0.4 on OpenSWR (LLVM 3.8, 256 bits)", "Apple Software Renderer"}) {
    EXPECT_TRUE(is_software_renderer(renderer)) << renderer;
  }
  for (const char* renderer :
       {"NVIDIA H100 PCIe/PCIe/SSE2",
        "AMD Radeon RX 7900 (radeonsi, navi31, LLVM 17.0.6, DRM 3.57)",
        "Mesa Intel(R) UHD Graphics 620 (KBL GT2)", "D3D12 (NVIDIA GeForce RTX 3070)",
        "zink Vulkan 1.3(NVIDIA GeForce RTX 3070 (NVIDIA_PROPRIETARY))", "virgl (AMD Radeon)",
        "SVGA3D; build: RELEASE;  LLVM;", "FakeGPU", ""}) {
    EXPECT_FALSE(is_software_renderer(renderer)) << renderer;
  }
}

DeviceProbe working(const char* name, bool is_software, const char* renderer) {
  DeviceProbe probe;
  probe.device = *parse_device(name);
  probe.works = true;
  probe.info.is_software = is_software;
  probe.info.renderer = renderer;
  return probe;
}

DeviceProbe broken(const char* name, const char* reason) {
  DeviceProbe probe;
  probe.device = *parse_device(name);
  probe.reason = reason;
  return probe;
}

TEST(ChooseDevice, takes_the_first_hardware_device_before_any_software) {
  const auto choice =
      choose_device({working("llvmpipe", true, "llvmpipe"), broken("egl:0", "no"),
                     working("egl:2", false, "Card B"), working("egl:1", false, "Card A")});
  EXPECT_EQ(device_name(choice.device), "egl:1");
  EXPECT_EQ(choice.why, "egl:1 is the first hardware device that works: Card A");
}

TEST(ChooseDevice, a_software_device_by_number_is_no_hardware) {
  const auto choice =
      choose_device({working("egl:0", true, "llvmpipe"), working("osmesa", true, "llvmpipe"),
                     working("lavapipe", true, "zink")});
  EXPECT_EQ(device_name(choice.device), "lavapipe");
  EXPECT_EQ(choice.why,
            "no hardware device works; lavapipe is the fastest software driver that does: zink");
}

TEST(ChooseDevice, cpu_comes_after_every_driver_that_works) {
  const AutoChoice choice =
      choose_device({working("cpu", true, "a processor"), working("osmesa", true, "llvmpipe"),
                     broken("llvmpipe", "no library")});
  EXPECT_EQ(device_name(choice.device), "osmesa");
}

TEST(ChooseDevice, no_driver_that_works_leaves_cpu_with_every_reason) {
  const AutoChoice choice =
      choose_device({broken("egl:0", "no libEGL"), broken("osmesa", "no library"),
                     working("cpu", true, "a processor")});
  EXPECT_EQ(device_name(choice.device), "cpu");
  EXPECT_EQ(choice.why,
            "no OpenGL device works, so everything runs on the CPU: no libEGL; no library");
}

}  // namespace
}  // namespace voxeld::gpu
