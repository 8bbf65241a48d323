// A model that predicts one bit from several contexts and learns from its value.
//
// Each context picks an adaptive probability from a table of its own. The probabilities are mixed
// in the logistic domain (Mahoney 2005) with weights that learn too. A weight belongs to a context
// and to the use count of its entry, so entries with little experience count for little.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "proto/codec/logistic.h"

namespace voxeld {

inline constexpr size_t kModelContexts = 5;

// The input of one bit's prediction.
struct BitContext {
  std::array<uint32_t, kModelContexts> values{};  // hashed into the tables
  uint32_t weight_set = 0;                        // < OccupancyModel::kWeightSets
};

// The learning rate 1 / (n + 1.6) in 1/65536, after n uses.
constexpr std::array<int32_t, 256> make_adaptive_rates() {
  std::array<int32_t, 256> rates{};
  for (int32_t n = 0; n < 256; ++n) rates[static_cast<size_t>(n)] = 655360 / (10 * n + 16);
  return rates;
}
inline constexpr std::array<int32_t, 256> kAdaptiveRates = make_adaptive_rates();

// An adaptive probability: 24 bits of it above 8 bits of use count (at most 255).
class AdaptiveBit {
 public:
  // The probability of a set bit, in 1/65536: 0..65535.
  uint32_t probability() const { return state_ >> 16; }
  uint32_t use_count() const { return state_ & 0xff; }

  // Moves the probability towards the bit by 1 / (use count + 1.6).
  void update(bool bit) {
    const uint32_t count = use_count();
    const int64_t value = state_ >> 8;
    const int64_t goal = bit ? (1 << 24) - 1 : 0;
    const int64_t moved = value + (((goal - value) * kAdaptiveRates[count]) >> 16);
    state_ = static_cast<uint32_t>(moved) << 8 | (count < 255 ? count + 1 : 255);
  }

 private:
  uint32_t state_ = 0x80000000u;
};

// Predicts and learns. A copy takes over all that was learnt.
class OccupancyModel {
 public:
  static constexpr uint32_t kWeightSets = 32;

  OccupancyModel();

  // The probability of a set bit, in 1/65536: 1..65535. Call update() after each.
  uint32_t predict(const BitContext& context) {
    weights_used_ = &weights_[context.weight_set];
    int64_t sum = 0;
    for (size_t i = 0; i < kModelContexts; ++i) {
      entries_used_[i] = &entries_[first_entry(i) + hash(context.values[i], kTableBits[i])];
      inputs_[i] = kStretchTable[entries_used_[i]->probability() >> (16 - kStretchTableBits)];
      buckets_[i] = static_cast<size_t>(std::bit_width(entries_used_[i]->use_count()));
      sum += static_cast<int64_t>((*weights_used_)[i][buckets_[i]]) * inputs_[i];
    }
    constexpr int64_t kMax = kStretchMax;
    const int64_t mixed = sum >> kWeightBits;
    probability_ = squash(static_cast<int32_t>(mixed < -kMax  ? -kMax
                                               : mixed > kMax ? kMax
                                                              : mixed));
    probability_ = probability_ < 1 ? 1 : probability_ > 65535 ? 65535 : probability_;
    return static_cast<uint32_t>(probability_);
  }

  void update(bool bit) {
    const int32_t error = (bit ? 65536 : 0) - probability_;
    for (size_t i = 0; i < kModelContexts; ++i) {
      int32_t& weight = (*weights_used_)[i][buckets_[i]];
      weight += (inputs_[i] * error + (1 << (kLearningShift - 1))) >> kLearningShift;
      weight = weight < -kWeightMax ? -kWeightMax : weight > kWeightMax ? kWeightMax : weight;
      entries_used_[i]->update(bit);
    }
  }

 private:
  static constexpr int kWeightBits = 16;  // 1.0 is 65536
  static constexpr int32_t kWeightMax = 8 << kWeightBits;
  static constexpr int kLearningShift = 14;
  static constexpr size_t kBuckets = 9;  // bit width of a use count
  static constexpr std::array<uint32_t, kModelContexts> kTableBits = {15, 15, 13, 16, 17};

  static constexpr size_t first_entry(size_t table) {
    size_t first = 0;
    for (size_t i = 0; i < table; ++i) first += size_t{1} << kTableBits[i];
    return first;
  }
  static uint32_t hash(uint32_t value, uint32_t bits) {
    value *= 0x9e3779b1u;
    value ^= value >> 15;
    value *= 0x85ebca6bu;
    return value >> (32 - bits);
  }

  using Weights = std::array<std::array<int32_t, kBuckets>, kModelContexts>;

  std::vector<AdaptiveBit> entries_;
  std::array<Weights, kWeightSets> weights_{};
  // State between predict() and update().
  std::array<AdaptiveBit*, kModelContexts> entries_used_{};
  std::array<int32_t, kModelContexts> inputs_{};
  std::array<size_t, kModelContexts> buckets_{};
  Weights* weights_used_ = nullptr;
  int32_t probability_ = 0;
};

}  // namespace voxeld
