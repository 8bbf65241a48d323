#include "proto/codec/range_coder.h"

#include <gtest/gtest.h>

#include <random>
#include <span>

#include "proto/codec/logistic.h"

namespace voxeld {
namespace {

struct CodedBit {
  bool bit = false;
  uint32_t one = 0;
};

std::vector<CodedBit> random_bits(uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<CodedBit> bits(random() % 3000);
  for (CodedBit& coded : bits) {
    coded.one = static_cast<uint32_t>((seed & 1) != 0       ? 1 + random() % 65535
                                      : (random() & 1) != 0 ? 1
                                                            : 65535);
    coded.bit = (seed & 2) != 0 ? (random() & 1) != 0 : (random() & 0xffff) < coded.one;
  }
  return bits;
}

std::vector<uint8_t> encoded(const std::vector<CodedBit>& bits) {
  std::vector<uint8_t> bytes;
  RangeEncoder coder(bytes);
  for (const CodedBit& coded : bits) coder.code(coded.bit, coded.one);
  coder.finish();
  return bytes;
}

TEST(RangeCoder, bits_of_any_probability_come_back_and_use_all_bytes) {
  for (uint32_t seed = 0; seed < 1000; ++seed) {
    SCOPED_TRACE(seed);
    const auto bits = random_bits(seed);
    const auto bytes = encoded(bits);
    RangeDecoder coder(bytes);
    for (const CodedBit& coded : bits) ASSERT_EQ(coder.code(false, coded.one), coded.bit);
    EXPECT_TRUE(coder.at_end());
  }
}

TEST(RangeCoder, a_decoder_notices_missing_and_extra_bytes) {
  const auto bits = random_bits(1);
  auto bytes = encoded(bits);
  bytes.push_back(0);
  RangeDecoder longer(bytes);
  for (const CodedBit& coded : bits) longer.code(false, coded.one);
  EXPECT_FALSE(longer.exhausted());
  EXPECT_FALSE(longer.at_end());
  RangeDecoder shorter(std::span<const uint8_t>(bytes).first(bytes.size() - 2));
  for (const CodedBit& coded : bits) shorter.code(false, coded.one);
  EXPECT_TRUE(shorter.exhausted());
}

TEST(RangeCoder, likely_bits_cost_as_their_probability_predicts) {
  // 100000 bits of probability 65000/65536 cost 0.01184 bits each, 148 bytes, and 4 at the end.
  EXPECT_NEAR(static_cast<double>(encoded(std::vector<CodedBit>(100'000, {true, 65000})).size()),
              148 + 4, 2);
  EXPECT_EQ(encoded({}).size(), 4u);
}

TEST(Logistic, squash_rises_and_is_symmetric) {
  EXPECT_EQ(squash(0), 32768);
  for (int32_t x = -kStretchMax - 5; x < kStretchMax + 5; ++x) {
    ASSERT_LE(squash(x), squash(x + 1)) << x;
    ASSERT_NEAR(squash(x) + squash(-x), 65536, 1) << x;
  }
}

TEST(Logistic, stretch_is_the_inverse_of_squash) {
  for (int32_t i = 0; i < 4096; ++i) {
    const int32_t x = kStretchTable[static_cast<size_t>(i)];
    ASSERT_GE(squash(x), 16 * i + 8) << i;
    ASSERT_LT(squash(x - 1), 16 * i + 8) << i;
  }
}

}  // namespace
}  // namespace voxeld
