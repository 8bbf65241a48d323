// The outcomes of self-tests, and the file in the data directory that keeps them.
//
//   {"version": 1,
//    "devices": [{"device": "egl:0",
//                 "key": {"renderer": …, "driver": …, "shaders": "sha256-…",
//                         "algorithm_version": 7},
//                 "faults": {"raster": "touch: 1200 voxels, 1201 on the CPU"}}, …]}
//
// The file has one entry for each device; a new test of the device replaces it.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "proto/result.h"
#include "server/voxel/pipelines/device_faults.h"

namespace voxeld {

inline constexpr int kSelfTestVersion = 1;
// The file's name in the data directory.
inline constexpr std::string_view kSelfTestFileName = "self_test.json";
// Larger files are rejected unread: no record gets near this size.
inline constexpr size_t kSelfTestBytesMax = size_t{1} << 20;
// A longer reason is cut: a compiler's log may have any length.
inline constexpr size_t kFaultBytesMax = 1000;

// An outcome is valid only while these match.
struct SelfTestKey {
  std::string renderer, driver;  // as the driver gives them
  std::string shaders;           // hash of the programs' sources
  int algorithm_version = 0;
  bool operator==(const SelfTestKey&) const = default;
};

struct SelfTestOutcome {
  std::string device;  // "egl:0"
  SelfTestKey key;
  DeviceFaults faults;
};

// Readers and writers of the format above. Errors: internal, with the fault and the file.
Result<std::vector<SelfTestOutcome>> parse_self_tests(std::string_view text);
std::string self_tests_text(const std::vector<SelfTestOutcome>& outcomes);
// A missing file is an empty list.
Result<std::vector<SelfTestOutcome>> read_self_tests(const std::filesystem::path& data_dir);
// Replaces the device's entry. A file that cannot be read is replaced as a whole.
Status keep_self_test(const std::filesystem::path& data_dir, SelfTestOutcome outcome);

// The faults of a device, or why none are known.
struct SelfTestLookup {
  bool found = false;
  DeviceFaults faults;
  std::string why_not;  // "not tested", "tested with another driver: …", the file's error
};
SelfTestLookup find_self_test(const std::filesystem::path& data_dir, const std::string& device,
                              const SelfTestKey& key);

}  // namespace voxeld
