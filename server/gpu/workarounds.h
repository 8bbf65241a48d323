// Every driver workaround, in one list. Each has a greppable name, a paragraph that says what was
// seen and how to see it again, and a switch: VOXELD_WORKAROUNDS=-name,-other turns them off.
#pragma once

#include <span>
#include <string_view>

namespace voxeld::gpu {

enum class Workaround {
  // loop_iterations_65535. Mesa 22.3.6, llvmpipe, softpipe, OSMesa and lavapipe: gallivm stops a
  // shader silently after 65,535 loop iterations in total, over all its loops, per SIMD group; what
  // the rest of the loop would have written is missing and no error is raised. Seen by voxelizing a
  // mesh of 5,110 triangles at 1024 cells with one invocation per triangle: 6,364 voxels are lost.
  // On: DeviceInfo::loop_iterations_max = 65535, and passes split their work to stay below.
  kLoopIterations65535,

  // zink_stale_uniforms. Mesa 22.3.6, Zink over lavapipe: a compute dispatch sees default-block
  // uniforms of an earlier dispatch (99% of a grid wrong); uniform buffers are right. No pass of
  // voxeld uses default-block uniforms, which is the actual cure and cannot be switched off. On:
  // ZINK_INLINE_UNIFORMS=0 is set as well while the driver loads, so that a program that a
  // developer tries out behaves.
  kZinkStaleUniforms,

  // timer_query_zero. Mesa 22.3.6, llvmpipe and OSMesa: GL_TIME_ELAPSED queries exist, have counter
  // bits and always give 0. On: PassTimer takes wall time around glFinish on software drivers.
  kTimerQueryZero,

  // lp_vector_width_512. Mesa 22.3.6, llvmpipe with LP_NATIVE_VECTOR_WIDTH=512 in the environment:
  // shaders run 40% slower and the ray march crashes in generated code. On: the variable is taken
  // out of the environment before a Mesa software driver is loaded, where it asks for 512.
  kLpVectorWidth512,
};

struct WorkaroundInfo {
  Workaround workaround;
  std::string_view name;
  std::string_view summary;  // one sentence, for `voxeld doctor`
};

// In the order of the enum.
std::span<const WorkaroundInfo> all_workarounds();

// Whether `list` (the form of VOXELD_WORKAROUNDS: "-name" items separated by commas) leaves it on.
bool workaround_enabled(Workaround workaround, std::string_view list);
// The same by the environment of the process.
bool workaround_enabled(Workaround workaround);

}  // namespace voxeld::gpu
