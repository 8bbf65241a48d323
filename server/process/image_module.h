// The shared object that links OpenImageIO, libvoxeld_images.so. Debian's OpenImageIO brings more
// than 250 libraries, which take 0.3 s and 50 MB of each process that links them. Only a worker
// that reads a texture or writes an image needs them, so it loads them by then. The sandbox of
// workers permits that (worker_sandbox.cpp).
//
// The module's other names are those of the program that loads it (-rdynamic), so that both have
// one cancellation flag.
#pragma once

#include <filesystem>

#include "proto/result.h"

namespace voxeld {

// The folder of the module, relative to the program's.
std::filesystem::path image_module_folder();

// The address of a pointer that the module defines by VOXELD_PUBLISH. Loads the module. Errors:
// internal, with the loader's words. Thread-safe.
Result<const void*> image_module_symbol(const char* name);

// The place where the module has the address of the function that it publishes under `name`. A
// Result of the address itself makes GCC 12 warn of a shadowed name.
template <typename Function>
Result<Function* const*> image_module_function(const char* name) {
  VOXELD_ASSIGN(const void* const symbol, image_module_symbol(name));
  return static_cast<Function* const*>(symbol);
}

}  // namespace voxeld

// In the module, outside of namespaces: makes `function` known as `name`.
#define VOXELD_PUBLISH(name, function)                                            \
  extern "C" {                                                                    \
  extern __attribute__((visibility("default"))) decltype(&(function)) const name; \
  decltype(&(function)) const name = &(function);                                 \
  }
