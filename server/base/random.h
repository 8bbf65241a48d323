// Random numbers of the kernel, which nobody can guess.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace voxeld {

// Fills `bytes` by getrandom(2).
void fill_random(std::span<uint8_t> bytes);
// An even number of hexadecimal digits.
std::string random_hex(size_t digits);

}  // namespace voxeld
