// The pipelines that voxelize. All of them give the same bytes.
#pragma once

#include <string_view>

namespace voxeld {

enum class Pipeline { kRaster, kCompute, kCpu };

constexpr std::string_view pipeline_name(Pipeline pipeline) {
  switch (pipeline) {
    case Pipeline::kRaster:
      return "raster";
    case Pipeline::kCompute:
      return "compute";
    case Pipeline::kCpu:
      break;
  }
  return "cpu";
}

}  // namespace voxeld
