// TOUCH_INT, the integer of the plane test, chosen by the triangle's size and the device's
// abilities. All give the same results:
//   int        triangles up to TOUCH_SMALL_EXTENT wide; sums wrap around where a step is too large
//   int64_t    every triangle; GL_ARB_gpu_shader_int64
//   TouchWide  every triangle; two 32-bit words, for devices without that extension: NO_INT64
// TOUCH_INT3 has three of them. There are functions instead of operators, because TouchWide can
// have none.
#if defined(NO_INT64) && !defined(TOUCH_INT)
#define TOUCH_INT TouchWide
#define TOUCH_INT3 TouchWide3
#define TOUCH_SPLIT
struct TouchWide {
  uint low;
  uint high;  // two's complement
};
struct TouchWide3 {
  TouchWide x, y, z;
};
#elif !defined(TOUCH_INT)
#define TOUCH_INT int64_t
#define TOUCH_INT3 i64vec3
#endif

#ifdef TOUCH_SPLIT
#ifndef __cplusplus
uint umul_high(uint a, uint b) {
  uint high, low;
  umulExtended(a, b, high, low);
  return high;
}
#endif
TouchWide touch_int(int v) {
  TouchWide r;
  r.low = uint(v);
  r.high = v < 0 ? 0xffffffffu : 0u;
  return r;
}
TouchWide touch_plus(TouchWide a, TouchWide b) {
  TouchWide r;
  r.low = a.low + b.low;
  r.high = a.high + b.high + (r.low < a.low ? 1u : 0u);
  return r;
}
TouchWide touch_minus(TouchWide a, TouchWide b) {
  TouchWide r;
  r.low = a.low - b.low;
  r.high = a.high - b.high - (a.low < b.low ? 1u : 0u);
  return r;
}
// A product modulo 2^64. As a word, a negative factor is 2^32 too large, which is subtracted.
TouchWide touch_times(TouchWide a, int b) {
  TouchWide r;
  r.low = a.low * uint(b);
  r.high = umul_high(a.low, uint(b)) + a.high * uint(b) - (b < 0 ? a.low : 0u);
  return r;
}
bool touch_is_negative(TouchWide a) { return (a.high >> 31u) != 0u; }
bool touch_is_zero(TouchWide a) { return (a.low | a.high) == 0u; }
TouchWide touch_amount(TouchWide a) {
  if (touch_is_negative(a)) a = touch_minus(touch_int(0), a);
  return a;
}
// Converts the absolute value, so that the two rounded words never cancel out.
float touch_float(TouchWide a) {
  TouchWide b = touch_amount(a);
  float amount = float(b.high) * 4294967296.0f + float(b.low);
  return touch_is_negative(a) ? -amount : amount;
}
int touch_low9(TouchWide a) { return int(a.low & 511u); }
// a >> 9, for a that is not negative.
TouchWide touch_shifted9(TouchWide a) {
  TouchWide r;
  r.low = (a.low >> 9u) | (a.high << 23u);
  r.high = a.high >> 9u;
  return r;
}
#else
TOUCH_INT touch_int(int v) { return TOUCH_INT(v); }
int touch_plus(int a, int b) { return int(uint(a) + uint(b)); }
int touch_minus(int a, int b) { return int(uint(a) - uint(b)); }
int touch_times(int a, int b) { return int(uint(a) * uint(b)); }
bool touch_is_negative(int a) { return a < 0; }
bool touch_is_zero(int a) { return a == 0; }
float touch_float(int a) { return float(a); }
int touch_amount(int a) { return abs(a); }
int touch_low9(int a) { return a & 511; }
int touch_shifted9(int a) { return a >> 9; }
#ifndef NO_INT64
int64_t touch_plus(int64_t a, int64_t b) { return a + b; }
int64_t touch_minus(int64_t a, int64_t b) { return a - b; }
int64_t touch_times(int64_t a, int b) { return a * int64_t(b); }
bool touch_is_negative(int64_t a) { return a < int64_t(0); }
bool touch_is_zero(int64_t a) { return a == int64_t(0); }
float touch_float(int64_t a) { return float(a); }
int64_t touch_amount(int64_t a) { return abs(a); }
int touch_low9(int64_t a) { return int(a & int64_t(511)); }
int64_t touch_shifted9(int64_t a) { return a >> 9; }
#endif
#endif

TOUCH_INT touch_negated(TOUCH_INT a) { return touch_minus(touch_int(0), a); }
// The determinant a b - c d.
TOUCH_INT touch_det(int a, int b, int c, int d) {
  return touch_minus(touch_times(touch_int(a), b), touch_times(touch_int(c), d));
}
