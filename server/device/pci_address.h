// Addresses on the PCI bus. That of a GPU stays the same when the machine starts again, unlike its
// place in a driver's enumeration.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>

namespace voxeld::gpu {

struct PciAddress {
  int domain = 0;
  int bus = 0;
  int device = 0;
  int function = 0;
  bool operator==(const PciAddress&) const = default;
  bool operator<(const PciAddress& other) const {
    return std::tie(domain, bus, device, function) <
           std::tie(other.domain, other.bus, other.device, other.function);
  }
};

// Parses "0000:3b:00.0", also without the domain, in upper case, and with the eight digits of a
// domain that NVIDIA's tools print. nullopt: not an address.
std::optional<PciAddress> parse_pci_address(std::string_view text);
// "0000:3b:00.0", as Linux writes it.
std::string pci_address_text(const PciAddress& address);

// The address of the GPU of a DRM device file ("/dev/dri/renderD128"), from sysfs below `root`,
// which is / but for tests. nullopt: not on a PCI bus, or sysfs does not tell.
std::optional<PciAddress> pci_address_of(const std::filesystem::path& drm_file,
                                         const std::filesystem::path& root = "/");

}  // namespace voxeld::gpu
