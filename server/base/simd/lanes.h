// Vectors for the kernels, VOXELD_LANE_BYTES wide, by the vector extension of GCC and Clang.
// Everything in the kernels' headers is in an unnamed namespace: each instruction set compiles its
// own copy, and the linker must not exchange them.
#pragma once

#include <cstddef>
#include <cstdint>

#if defined(__SSE2__)
#include <immintrin.h>
#endif

#ifndef VOXELD_LANE_BYTES
#error "define VOXELD_LANE_BYTES (16, 32 or 64) before including this"
#endif

namespace voxeld {
namespace {

constexpr int kLanes = VOXELD_LANE_BYTES / 4;
constexpr int kDoubleLanes = VOXELD_LANE_BYTES / 8;

using IntLanes = int32_t __attribute__((vector_size(VOXELD_LANE_BYTES)));
using FloatLanes = float __attribute__((vector_size(VOXELD_LANE_BYTES)));
using DoubleLanes = double __attribute__((vector_size(VOXELD_LANE_BYTES)));
using Int4 = int32_t __attribute__((vector_size(16)));

template <typename T>
T lesser(T a, T b) {
  return a < b ? a : b;
}
template <typename T>
T greater(T a, T b) {
  return a > b ? a : b;
}
// Compilers do not turn these float comparisons into one instruction, because of NaN and -0. The
// kernels never meet NaN and do not care about -0. maskz is used because GCC 12 takes the plain
// forms for uninitialized (bug 105593).
#if VOXELD_LANE_BYTES == 64 && defined(__AVX512F__)
inline FloatLanes lesser(FloatLanes a, FloatLanes b) {
  return _mm512_maskz_min_ps(0xffff, a, b);
}
inline FloatLanes greater(FloatLanes a, FloatLanes b) {
  return _mm512_maskz_max_ps(0xffff, a, b);
}
inline DoubleLanes lesser(DoubleLanes a, DoubleLanes b) {
  return _mm512_maskz_min_pd(0xff, a, b);
}
inline DoubleLanes greater(DoubleLanes a, DoubleLanes b) {
  return _mm512_maskz_max_pd(0xff, a, b);
}
#elif VOXELD_LANE_BYTES == 32 && defined(__AVX__)
inline FloatLanes lesser(FloatLanes a, FloatLanes b) {
  return _mm256_min_ps(a, b);
}
inline FloatLanes greater(FloatLanes a, FloatLanes b) {
  return _mm256_max_ps(a, b);
}
inline DoubleLanes lesser(DoubleLanes a, DoubleLanes b) {
  return _mm256_min_pd(a, b);
}
inline DoubleLanes greater(DoubleLanes a, DoubleLanes b) {
  return _mm256_max_pd(a, b);
}
#elif VOXELD_LANE_BYTES == 16 && defined(__SSE2__)
inline FloatLanes lesser(FloatLanes a, FloatLanes b) {
  return _mm_min_ps(a, b);
}
inline FloatLanes greater(FloatLanes a, FloatLanes b) {
  return _mm_max_ps(a, b);
}
inline DoubleLanes lesser(DoubleLanes a, DoubleLanes b) {
  return _mm_min_pd(a, b);
}
inline DoubleLanes greater(DoubleLanes a, DoubleLanes b) {
  return _mm_max_pd(a, b);
}
#endif

// Bit l of the result is set if lane l is negative.
inline uint32_t negative_lanes(IntLanes v) {
#if VOXELD_LANE_BYTES == 64 && defined(__AVX512DQ__)
  return _mm512_movepi32_mask(reinterpret_cast<__m512i>(v));
#elif VOXELD_LANE_BYTES == 32 && defined(__AVX__)
  return static_cast<uint32_t>(_mm256_movemask_ps(reinterpret_cast<__m256>(v)));
#elif VOXELD_LANE_BYTES == 16 && defined(__SSE2__)
  return static_cast<uint32_t>(_mm_movemask_ps(reinterpret_cast<__m128>(v)));
#else
  uint32_t bits = 0;
  for (int l = 0; l < kLanes; ++l) bits |= (static_cast<uint32_t>(v[l]) >> 31) << l;
  return bits;
#endif
}

inline bool any_negative(Int4 v) {
#if defined(__SSE2__)
  return _mm_movemask_ps(reinterpret_cast<__m128>(v)) != 0;
#else
  return (v[0] | v[1] | v[2] | v[3]) < 0;
#endif
}

inline IntLanes all_lanes(int32_t value) {
  return IntLanes{} + value;
}
inline int32_t largest(IntLanes v) {
  int32_t lanes[kLanes];
  __builtin_memcpy(lanes, &v, sizeof v);
  int32_t most = lanes[0];
  for (int l = 1; l < kLanes; ++l) most = lanes[l] > most ? lanes[l] : most;
  return most;
}
// 0, 1, 2, ...
inline IntLanes lane_numbers() {
  IntLanes v{};
  for (int l = 0; l < kLanes; ++l) v[l] = l;
  return v;
}
// Transposes kLanes points into vectors of their x, y and z.
inline void transposed(const Int4* points, IntLanes (&axes)[3]) {
  Int4 quarters[3][kLanes / 4];
  for (int g = 0; g < kLanes / 4; ++g) {
    const Int4 *a = points + ptrdiff_t{4} * g, *b = a + 1, *c = a + 2, *d = a + 3;
    const Int4 xy_ab = __builtin_shufflevector(*a, *b, 0, 4, 1, 5);
    const Int4 xy_cd = __builtin_shufflevector(*c, *d, 0, 4, 1, 5);
    const Int4 z_ab = __builtin_shufflevector(*a, *b, 2, 6, 3, 7);
    const Int4 z_cd = __builtin_shufflevector(*c, *d, 2, 6, 3, 7);
    quarters[0][g] = __builtin_shufflevector(xy_ab, xy_cd, 0, 1, 4, 5);
    quarters[1][g] = __builtin_shufflevector(xy_ab, xy_cd, 2, 3, 6, 7);
    quarters[2][g] = __builtin_shufflevector(z_ab, z_cd, 0, 1, 4, 5);
  }
  for (int c = 0; c < 3; ++c) __builtin_memcpy(&axes[c], quarters[c], sizeof axes[c]);
}
inline FloatLanes all_lanes_f(float value) {
  return FloatLanes{} + value;
}
inline DoubleLanes all_lanes_d(double value) {
  return DoubleLanes{} + value;
}
inline FloatLanes to_float(IntLanes v) {
  return __builtin_convertvector(v, FloatLanes);
}
// Rounds towards zero; |v| < 2^31.
inline IntLanes truncated(FloatLanes v) {
  return __builtin_convertvector(v, IntLanes);
}
// -v in lanes where `mask` is set (all bits of a lane or none), else v.
inline IntLanes negate_where(IntLanes mask, IntLanes v) {
  return (v ^ mask) - mask;
}

}  // namespace
}  // namespace voxeld
