// The context that GPU tests run on, by VOXELD_TEST_DEVICE.
#pragma once

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>

#include "server/gpu/context.h"

namespace voxeld::gpu {

// Opened once per binary; prints the renderer before anything else runs on it. A driver that does
// not open ends the test binary: it is installed by the package list, never skipped.
inline Context& test_context() {
  static const std::unique_ptr<Context> context = [] {
    const char* name = std::getenv("VOXELD_TEST_DEVICE");
    auto device = parse_device(name == nullptr ? "llvmpipe" : name);
    if (!device) {
      std::fprintf(stderr, "VOXELD_TEST_DEVICE: %s\n", device.error().message().c_str());
      std::exit(1);
    }
    auto created = Context::create(*device);
    if (!created) {
      std::fprintf(stderr, "%s\n", created.error().message().c_str());
      std::exit(1);
    }
    const DeviceInfo& info = (*created)->info();
    std::printf("device %s: %s, %s, %s\n", device_name(*device).c_str(), info.renderer.c_str(),
                info.version.c_str(), info.backend.c_str());
    std::fflush(stdout);
    return std::move(created).value();
  }();
  return *context;
}

}  // namespace voxeld::gpu
