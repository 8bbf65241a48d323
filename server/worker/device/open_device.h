// Opens a device for a worker: its pipelines to voxelize and its renderers.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "proto/messages/task_api.h"
#include "proto/result.h"
#include "server/device/device.h"
#include "server/render/render.h"
#include "server/voxel/pipelines/tile_pipeline.h"

namespace voxeld {

struct OpenedDevice {
  gpu::DeviceInfo info;
  std::string shaders;                     // ShaderLibrary::sources_hash(); empty without GL
  std::shared_ptr<void> context;           // outlives the next two; null without GL
  std::unique_ptr<TilePipeline> pipeline;  // raster and compute; null without GL
  std::unique_ptr<Renderer> gl_renderer;   // null without GL
  std::unique_ptr<Renderer> cpu_renderer;
  std::function<Status(std::string_view where)> check;  // whether the device still works
  // Memory of the device, if its driver reports it. Call it only on the thread that opened the
  // device.
  std::function<DeviceMemory()> memory = [] { return DeviceMemory(); };
};

// Opens a device; cpu always succeeds. `shader_dir`: empty for the built-in shaders. Errors:
// device-unavailable.
Result<OpenedDevice> open_device(const gpu::DeviceId& device, const std::string& shader_dir);

// Opens a device with a GL context.
Result<OpenedDevice> open_gl_device(const gpu::DeviceId& device, const std::string& shader_dir);

}  // namespace voxeld
