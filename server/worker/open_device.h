// What a device gives a worker: ways to voxelize and to draw.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "proto/result.h"
#include "proto/task_api.h"
#include "server/gpu/device.h"
#include "server/render/render.h"
#include "server/voxel/tile_pipeline.h"

namespace voxeld {

struct OpenedDevice {
  gpu::DeviceInfo info;
  std::shared_ptr<void> context;           // what the next two live on; null without GL
  std::unique_ptr<TilePipeline> pipeline;  // raster and compute; null without GL
  std::unique_ptr<Renderer> gl_renderer;   // null without GL
  std::unique_ptr<Renderer> cpu_renderer;
  std::function<Status(std::string_view where)> check;  // whether it still works
  // Of the device, where its driver tells; nothing on other threads than the one that opened it.
  std::function<DeviceMemory()> memory = [] { return DeviceMemory(); };
};

// Device cpu always opens. `shader_dir`: empty for the shaders built in. Errors:
// device-unavailable.
Result<OpenedDevice> open_device(const gpu::DeviceId& device, const std::string& shader_dir);

// The same for a device with a GL context.
Result<OpenedDevice> open_gl_device(const gpu::DeviceId& device, const std::string& shader_dir);

}  // namespace voxeld
