// Addresses of GPUs on the PCI bus, and where Linux tells them.
#include "server/device/pci_address.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "tests/unit/base/temporary_dir.h"

namespace voxeld::gpu {
namespace {

TEST(PciAddress, is_parsed_and_written_as_linux_does) {
  const struct {
    const char *text, *written;
  } kCases[] = {{"0000:3b:00.0", "0000:3b:00.0"},     {"3b:00.0", "0000:3b:00.0"},
                {"00000000:3B:00.0", "0000:3b:00.0"}, {"0001:AF:1F.7", "0001:af:1f.7"},
                {"10000:01:02.3", "10000:01:02.3"},   {"7fffffff:ff:1f.7", "7fffffff:ff:1f.7"}};
  for (const auto& one : kCases) {
    const auto address = parse_pci_address(one.text);
    ASSERT_TRUE(address) << one.text;
    EXPECT_EQ(pci_address_text(*address), one.written);
    EXPECT_EQ(parse_pci_address(one.written), address);
  }
}

TEST(PciAddress, anything_else_is_none) {
  for (const char* text : {"",
                           ":",
                           "3b",
                           "3b:00",
                           "3b:00.",
                           "3b:00.8",
                           "3b:20.0",
                           "3b:0.0",
                           "b:00.0",
                           "3b:00.0 ",
                           " 3b:00.0",
                           "000:3b:00.0",
                           "123456789:3b:00.0",
                           "ffffffff:3b:00.0",
                           "-001:3b:00.0",
                           "0000:3b:00:0",
                           "0000:0000:3b:00.0",
                           "0x3b:00.0",
                           "3g:00.0",
                           "3b:-1.0",
                           "3b:00.00"}) {
    EXPECT_FALSE(parse_pci_address(text)) << text;
  }
}

TEST(PciAddress, sorts_by_number) {
  std::vector<PciAddress> sorted;
  for (const char* text : {"10000:00:00.0", "0000:af:00.0", "0000:3b:00.1", "0000:3b:00.0"}) {
    sorted.push_back(*parse_pci_address(text));
  }
  std::sort(sorted.begin(), sorted.end());
  EXPECT_EQ(pci_address_text(sorted[0]), "0000:3b:00.0");
  EXPECT_EQ(pci_address_text(sorted[1]), "0000:3b:00.1");
  EXPECT_EQ(pci_address_text(sorted[3]), "10000:00:00.0");
}

TEST(PciAddress, of_a_drm_device_is_where_sysfs_links_to) {
  const testing::TemporaryDir root;
  const auto link = [&](const char* node, const char* target) {
    const auto folder = root.path() / "sys/class/drm" / node;
    std::filesystem::create_directories(folder);
    std::filesystem::create_symlink(target, folder / "device");
  };
  link("renderD128", "../../../0000:3b:00.0");
  link("card1", "0000:af:00.0");
  link("card2", "../../platform-gpu");  // on no PCI bus
  EXPECT_EQ(pci_address_of("/dev/dri/renderD128", root.path()), parse_pci_address("3b:00.0"));
  EXPECT_EQ(pci_address_of("/dev/dri/card1", root.path()), parse_pci_address("af:00.0"));
  for (const char* node : {"/dev/dri/card2", "/dev/dri/card3", ""}) {
    EXPECT_FALSE(pci_address_of(node, root.path())) << node;
  }
}

}  // namespace
}  // namespace voxeld::gpu
