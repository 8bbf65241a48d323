// Small matrices of the skinning oracles, by rows. Rotations are matrices and turn by axis and
// angle, so that no sign of a quaternion matters.
#pragma once

#include <array>
#include <cmath>

namespace voxeld::reference {

using Vec3 = std::array<double, 3>;
using Mat3 = std::array<Vec3, 3>;

// y = turn * x + place
struct Affine {
  Mat3 turn = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  Vec3 place = {0, 0, 0};
};

inline Vec3 plus(const Vec3& a, const Vec3& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}
inline Vec3 times(double s, const Vec3& a) {
  return {s * a[0], s * a[1], s * a[2]};
}
inline double dot(const Vec3& a, const Vec3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
inline Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
inline Vec3 unit(const Vec3& a) {
  return times(1 / std::sqrt(dot(a, a)), a);
}
inline Vec3 mapped(const Mat3& m, const Vec3& p) {
  return {dot(m[0], p), dot(m[1], p), dot(m[2], p)};
}
inline Vec3 mapped(const Affine& a, const Vec3& p) {
  return plus(mapped(a.turn, p), a.place);
}
inline Mat3 transposed(const Mat3& m) {
  Mat3 out;
  for (size_t r = 0; r < 3; ++r) {
    for (size_t c = 0; c < 3; ++c) out[c][r] = m[r][c];
  }
  return out;
}
inline Mat3 product(const Mat3& a, const Mat3& b) {
  Mat3 out;
  const Mat3 columns = transposed(b);
  for (size_t r = 0; r < 3; ++r) {
    for (size_t c = 0; c < 3; ++c) out[r][c] = dot(a[r], columns[c]);
  }
  return out;
}
inline Affine product(const Affine& a, const Affine& b) {
  return {product(a.turn, b.turn), mapped(a, b.place)};
}
inline Mat3 mixed(double s, const Mat3& a, double t, const Mat3& b) {
  Mat3 out;
  for (size_t r = 0; r < 3; ++r) out[r] = plus(times(s, a[r]), times(t, b[r]));
  return out;
}
// The matrix by which normals go: the inverse, transposed, by Cramer's rule.
inline Mat3 inverse_transposed(const Mat3& m) {
  const double det = dot(m[0], cross(m[1], m[2]));
  return {times(1 / det, cross(m[1], m[2])), times(1 / det, cross(m[2], m[0])),
          times(1 / det, cross(m[0], m[1]))};
}

// The rotation of a quaternion of any length above 0: p + 2w (v x p) + 2 v x (v x p).
inline Mat3 rotation_of(double x, double y, double z, double w) {
  const double length = std::sqrt(x * x + y * y + z * z + w * w);
  const Vec3 v = {x / length, y / length, z / length};
  Mat3 columns;
  for (size_t axis = 0; axis < 3; ++axis) {
    Vec3 p = {0, 0, 0};
    p[axis] = 1;
    const Vec3 once = cross(v, p);
    columns[axis] = plus(p, plus(times(2 * w / length, once), times(2, cross(v, once))));
  }
  return transposed(columns);
}

// `share` of the way from rotation a to b, the short way round: a * exp(share * log(a^T b)). The
// angle between them must not be a half turn.
inline Mat3 between(const Mat3& a, const Mat3& b, double share) {
  const Mat3 way = product(transposed(a), b);
  const Vec3 skew = {(way[2][1] - way[1][2]) / 2, (way[0][2] - way[2][0]) / 2,
                     (way[1][0] - way[0][1]) / 2};  // axis * sin(angle)
  const double sine = std::sqrt(dot(skew, skew));
  const double angle = std::atan2(sine, (way[0][0] + way[1][1] + way[2][2] - 1) / 2);
  if (sine < 1e-12) return a;
  const Vec3 axis = times(1 / sine, skew);
  const double half = share * angle / 2;
  return product(a, rotation_of(axis[0] * std::sin(half), axis[1] * std::sin(half),
                                axis[2] * std::sin(half), std::cos(half)));
}

}  // namespace voxeld::reference
