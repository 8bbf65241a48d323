// shaders/lib/divide.glsl, as C++, against the processor's division.
#include <gtest/gtest.h>

#include <cmath>
#include <ios>
#include <random>

#include "shaders/glsl.h"

namespace voxeld::glsl {

#define precise
#include "shaders/lib/divide.glsl"
#undef precise

namespace {

class Numbers {
 public:
  // 53 random bits, now and then few of them, at a random power of two.
  double next(int exponent_max) {
    uint64_t bits = random_() >> 11 | uint64_t{1} << 52;
    if (random_() % 4 == 0) bits &= ~uint64_t{0} << random_() % 53;
    if (random_() % 4 == 0) bits |= (uint64_t{1} << random_() % 52) - 1;
    const auto range = static_cast<uint64_t>(2 * exponent_max + 1);
    const int exponent = static_cast<int>(random_() % range) - exponent_max;
    const double magnitude = std::ldexp(static_cast<double>(bits), exponent - 52);
    return random_() % 2 == 0 ? magnitude : -magnitude;
  }

 private:
  std::mt19937_64 random_{29};
};

void expect_quotient(double a, double b) {
  ASSERT_EQ(divided(a, b, 1.0 / b), a / b) << std::hexfloat << a << " / " << b;
}

TEST(DivideShader, quotients_are_those_of_the_processor) {
  Numbers numbers;
  for (int i = 0; i < 1'000'000; ++i)
    expect_quotient(numbers.next(200), std::abs(numbers.next(90)));
}

// a is the rounded product of b and the middle of two doubles, or one of its neighbours: nothing is
// nearer to a tie.
TEST(DivideShader, quotients_next_to_the_middle_of_two_doubles_are_rounded_to_the_nearer) {
  Numbers numbers;
  for (int i = 0; i < 300'000; ++i) {
    const double b = std::abs(numbers.next(60)), q = numbers.next(60);
    const double step = std::nextafter(q, 2 * q) - q;
    const double a = std::fma(q, b, step * b / 2);
    for (const double near : {std::nextafter(a, 0.0), a, std::nextafter(a, 2 * a)}) {
      expect_quotient(near, b);
    }
  }
}

// Below a power of two doubles are twice as dense.
TEST(DivideShader, quotients_around_powers_of_two_are_those_of_the_processor) {
  Numbers numbers;
  for (int i = 0; i < 300'000; ++i) {
    const double b = std::abs(numbers.next(60));
    double a = std::ldexp(b, i % 41 - 20);
    for (int steps = i % 4; steps > 0; --steps) a = std::nextafter(a, i % 8 < 4 ? 0.0 : 2 * a);
    expect_quotient(a, b);
  }
  expect_quotient(0.0, 3.0);
  expect_quotient(1.0, 3.0);
  expect_quotient(-5.0, 5.0);
}

}  // namespace
}  // namespace voxeld::glsl
