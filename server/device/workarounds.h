// The list of all driver workarounds. Each has a greppable name, a paragraph on the symptom and how
// to reproduce it, and a switch: VOXELD_WORKAROUNDS=-name,-other turns them off.
#pragma once

#include <span>
#include <string_view>

namespace voxeld::gpu {

enum class Workaround {
  // loop_iterations_65535. Mesa 22.3.6, llvmpipe, softpipe, OSMesa and lavapipe: gallivm silently
  // stops a shader after 65,535 loop iterations in total, over all its loops, per SIMD group. The
  // rest of the loop writes nothing and no error is raised. To reproduce: voxelize a mesh of 5,110
  // triangles at 1024 cells with one invocation per triangle; 6,364 voxels are lost. If on:
  // DeviceInfo::loop_iterations_max = 65535, and passes split their work to stay below.
  kLoopIterations65535,

  // zink_stale_uniforms. Mesa 22.3.6, Zink over lavapipe: a compute dispatch sees default-block
  // uniforms of an earlier dispatch (99% of a grid wrong); uniform buffers are right. The actual
  // cure is that no pass of voxeld uses default-block uniforms; it cannot be switched off. If on:
  // ZINK_INLINE_UNIFORMS=0 is also set while the driver loads, so that a developer's experiments
  // behave.
  kZinkStaleUniforms,

  // timer_query_zero. Mesa 22.3.6, llvmpipe and OSMesa: GL_TIME_ELAPSED queries exist, have counter
  // bits and always return 0. If on: PassTimer measures wall time around glFinish on software
  // drivers.
  kTimerQueryZero,

  // lp_vector_width_512. Mesa 22.3.6, llvmpipe with LP_NATIVE_VECTOR_WIDTH=512 in the environment:
  // shaders run 40% slower and the ray march crashes in generated code. If on: a value of 512 is
  // removed from the environment before a Mesa software driver is loaded.
  kLpVectorWidth512,
};

struct WorkaroundInfo {
  Workaround workaround;
  std::string_view name;
  std::string_view summary;  // one sentence, for `voxeld doctor`
};

// All workarounds, in the order of the enum.
std::span<const WorkaroundInfo> all_workarounds();

// True if `list` leaves the workaround on. list: "-name" items separated by commas, as in
// VOXELD_WORKAROUNDS.
bool workaround_enabled(Workaround workaround, std::string_view list);
// The same for the list in the environment of the process.
bool workaround_enabled(Workaround workaround);

}  // namespace voxeld::gpu
