// Random numbers: of the kernel, which nobody can guess, and of a generator for ids.
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
// The same for ids that are no secret (requests, traces): from a generator of the thread, which the
// kernel seeds, so without a system call.
std::string id_hex(size_t digits);

}  // namespace voxeld
