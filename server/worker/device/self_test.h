// The self-test of a device: small requests by every pass, compared with the CPU's grids.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "server/render/render.h"
#include "server/voxel/pipelines/device_faults.h"
#include "server/voxel/voxelize.h"

namespace voxeld {

// Called before each step. A driver that ends the process has then failed in the last step named.
using SelfTestProgress = std::function<void(DevicePart part, std::string_view step)>;

struct TestedDevice {
  Voxelizer& voxelizer;             // with the device's pipelines, and no faults set
  Renderer* gl_renderer = nullptr;  // null: images are not tested
  Renderer& cpu_renderer;
  // Leaves out variants of programs that other steps have the parts of. A software driver compiles
  // some for seconds.
  bool is_brief = false;
};

// Compiles the device's programs by running them on a small mesh, and compares the hashes of grids
// with those of pipeline cpu, and images with the CPU's. The first step of a part that differs, or
// fails, is its fault; later steps of the part are left out. So are the parts of `known`, whose
// faults are part of the result.
DeviceFaults self_test(const TestedDevice& device, const DeviceFaults& known,
                       const SelfTestProgress& progress);

}  // namespace voxeld
