// The files that drivers open, as rules of the sandbox.
#pragma once

#include <filesystem>
#include <vector>

#include "server/process/sandbox.h"

namespace voxeld {

// Rules for the files of drivers on this machine: folders that the loader and the usual drivers
// read, device nodes, and the libraries that manifests name, wherever these are. Call it outside of
// a sandbox, which cannot list /dev.
std::vector<FileRule> driver_rules();

// The library that a manifest of a Vulkan driver or of libglvnd names (ICD.library_path), relative
// to the manifest's folder. Empty if the manifest cannot be read, or names a library without a
// folder, which the loader searches for as for every library.
std::filesystem::path manifest_library(const std::filesystem::path& manifest);

// Whether `path` is `folder` or in it, by their names alone.
bool is_beneath(const std::filesystem::path& path, const std::filesystem::path& folder);

}  // namespace voxeld
