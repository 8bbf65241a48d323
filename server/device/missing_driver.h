// The reason why a machine's GPU has no driver for EGL, as far as its files tell.
#pragma once

#include <filesystem>
#include <string>

namespace voxeld::gpu {

// One clause for error texts: which device nodes exist below `root`, and which file of the driver
// is missing or which node this process may not open. `root` is / but for tests.
// It also works inside the sandbox of a worker, which cannot list /dev.
std::string missing_driver(const std::filesystem::path& root = "/");

// Whether a GPU's device node exists below `root`.
bool has_gpu_node(const std::filesystem::path& root = "/");

}  // namespace voxeld::gpu
