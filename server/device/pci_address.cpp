#include "server/device/pci_address.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdio>
#include <system_error>

namespace voxeld::gpu {
namespace {

// Takes a hexadecimal number of `digits_min` to `digits_max` digits off the front of `text`.
std::optional<int> take_hex(std::string_view& text, size_t digits_min, size_t digits_max) {
  int value = 0;
  const char* begin = text.data();
  const char* end = begin + std::min(text.size(), digits_max);
  const auto parsed = std::from_chars(begin, end, value, 16);
  const auto digits = static_cast<size_t>(parsed.ptr - begin);
  if (parsed.ec != std::errc() || value < 0 || digits < digits_min || *begin == '-') return {};
  text.remove_prefix(digits);
  return value;
}

bool take(std::string_view& text, char expected) {
  if (!text.starts_with(expected)) return false;
  text.remove_prefix(1);
  return true;
}

}  // namespace

std::optional<PciAddress> parse_pci_address(std::string_view text) {
  PciAddress address;
  if (text.find(':') != text.rfind(':')) {
    const auto domain = take_hex(text, 4, 8);
    if (!domain || !take(text, ':')) return {};
    address.domain = *domain;
  }
  const auto bus = take_hex(text, 2, 2);
  if (!bus || !take(text, ':')) return {};
  const auto device = take_hex(text, 2, 2);
  if (!device || *device > 0x1f || !take(text, '.')) return {};
  const auto function = take_hex(text, 1, 1);
  if (!function || *function > 7 || !text.empty()) return {};
  address.bus = *bus;
  address.device = *device;
  address.function = *function;
  return address;
}

std::string pci_address_text(const PciAddress& address) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%04x:%02x:%02x.%x",
                static_cast<unsigned>(address.domain), static_cast<unsigned>(address.bus),
                static_cast<unsigned>(address.device), static_cast<unsigned>(address.function));
  return text.data();
}

std::optional<PciAddress> pci_address_of(const std::filesystem::path& drm_file,
                                         const std::filesystem::path& root) {
  // A link, as "../../../0000:3b:00.0".
  const std::filesystem::path device = root / "sys/class/drm" / drm_file.filename() / "device";
  std::array<char, 4096> target{};
  const ssize_t bytes = ::readlink(device.c_str(), target.data(), target.size());
  if (bytes <= 0) return {};
  const std::string_view text(target.data(), static_cast<size_t>(bytes));
  return parse_pci_address(text.substr(text.rfind('/') + 1));
}

}  // namespace voxeld::gpu
