#include "proto/attribute_small.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <string>

#include "proto/attribute_context.h"
#include "proto/occupancy_model.h"
#include "proto/range_coder.h"
#include "proto/tile_runs.h"

namespace voxeld {
namespace {

constexpr size_t kColorChannels = 4, kNormalChannels = 3;
constexpr uint32_t kSameNode = 63;  // beside the nodes of differences

// Places in the tree of one difference's bits.
constexpr uint32_t kZeroNode = 0, kSignNode = 1, kLengthNode = 2, kFirstNode = 10, kSecondNode = 20,
                   kLowNode = 48;

// What the bits of one difference are predicted from.
struct DifferenceContext {
  uint32_t channel = 0;  // in coding order
  uint32_t error = 0;    // quantized(): mean error of the neighbours
  uint32_t range = 0;    // quantized(): of the neighbours in this channel
  uint32_t before = 0;   // quantized_difference() of the channel before, 0 for the first
  uint32_t before_that = 0;
  uint32_t count = 0;      // coded neighbours, at most 3
  uint32_t predicted = 0;  // the six high bits

  BitContext at(uint32_t node) const {
    const uint32_t place = channel << 6 | node;
    BitContext context;
    context.values = {place | error << 8 | range << 11, place | before << 8 | before_that << 12,
                      place, place | error << 8 | before << 11 | count << 15,
                      place | predicted << 8 | range << 14};
    context.weight_set = channel << 3 | std::min(node, 7u);
    return context;
  }
};

// Coder and model together: one bit in its context.
template <typename Coder>
struct BitCoder {
  Coder& coder;
  OccupancyModel model;

  bool code(bool bit, const BitContext& context) {
    bit = coder.code(bit, model.predict(context));
    model.update(bit);
    return bit;
  }
  uint32_t code(uint32_t bit, const BitContext& context) {
    return code(bit != 0, context) ? 1u : 0u;
  }
};

// Size of a difference, 1..128: its bit length in unary, then the bits below the highest one.
template <typename Coder>
uint32_t code_size(BitCoder<Coder>& coder, const DifferenceContext& context, uint32_t size) {
  const auto wanted = static_cast<uint32_t>(std::bit_width(size));
  uint32_t length = 1;
  while (length < 8 && coder.code(length < wanted, context.at(kLengthNode + length - 1))) ++length;
  uint32_t value = 1;
  for (uint32_t below = length - 1; below > 0; --below) {
    const uint32_t done = length - 1 - below;
    const uint32_t node = done == 0   ? kFirstNode + length
                          : done == 1 ? kSecondNode + 2 * length + (value & 1)
                                      : kLowNode + below;
    value = value << 1 | coder.code(size >> (below - 1) & 1, context.at(node));
  }
  return value;
}

// A difference modulo 256 as -128..127.
template <typename Coder>
int code_difference(BitCoder<Coder>& coder, const DifferenceContext& context, int difference) {
  if (!coder.code(difference != 0, context.at(kZeroNode))) return 0;
  const bool negative = coder.code(difference < 0, context.at(kSignNode));
  const auto size =
      code_size(coder, context, static_cast<uint32_t>(difference < 0 ? -difference : difference));
  return negative ? -static_cast<int>(size) : static_cast<int>(size);
}

int wrapped(int difference) {
  return static_cast<int8_t>(static_cast<uint8_t>(difference));
}

// Channels of a voxel in the order they are coded, and what each is predicted to be.
class ColorPredictor {
 public:
  static constexpr size_t kChannels = kColorChannels;
  explicit ColorPredictor(const AttributeNeighbors& near) : near_(near) {}

  size_t channel(size_t i) const { return kOrder[i]; }
  // `done`: the voxel's samples so far. Red and blue mostly change with green.
  int predicted(size_t i, const uint8_t* done) const {
    const int mean = near_.mean[kOrder[i]];
    if (i == 0 || i == 3) return mean;
    return std::clamp(mean + done[1] - near_.mean[1], 0, 255);
  }

 private:
  static constexpr std::array<size_t, kColorChannels> kOrder = {1, 0, 2, 3};  // G, R, B, A
  const AttributeNeighbors& near_;
};

uint32_t square_root(uint32_t value) {
  uint32_t root = 0;
  while ((root + 1) * (root + 1) <= value) ++root;
  return root;
}

// Samples of normals are offset by 128. The component with the largest mean comes last: the two
// others leave little choice for it, as the length is 127.
class NormalPredictor {
 public:
  static constexpr size_t kChannels = kNormalChannels;
  explicit NormalPredictor(const AttributeNeighbors& near) : near_(near) {
    const auto size = [&](size_t c) {
      return near.mean[c] < 128 ? 128 - near.mean[c] : near.mean[c] - 128;
    };
    for (size_t c = 1; c < kNormalChannels; ++c) {
      if (size(c) >= size(order_[2])) order_[2] = c;
    }
    order_[0] = order_[2] == 0 ? 1 : 0;
    order_[1] = order_[2] == 2 ? 1 : 2;
  }

  size_t channel(size_t i) const { return order_[i]; }
  int predicted(size_t i, const uint8_t* done) const {
    const int mean = near_.mean[order_[i]];
    if (i < 2) return mean;
    const int a = done[order_[0]] - 128, b = done[order_[1]] - 128;
    const int left = 127 * 127 - a * a - b * b;
    const int size = static_cast<int>(square_root(static_cast<uint32_t>(std::max(left, 0))));
    return mean < 128 ? 128 - size : 128 + size;
  }

 private:
  std::array<size_t, kNormalChannels> order_ = {1, 2, 0};
  const AttributeNeighbors& near_;
};

// Whether all samples are those of near.first.
template <typename Coder>
bool code_same(BitCoder<Coder>& coder, const AttributeNeighbors& near, size_t channels,
               const uint8_t* samples, const uint8_t* first) {
  DifferenceContext context;
  context.error = quantized(near.error);
  context.range = quantized(static_cast<uint32_t>(near.range[0]));
  context.before = std::min(near.same_count, 15u);
  context.before_that = std::min(near.count, 15u);
  context.count = std::min(near.count, 3u);
  context.predicted = std::min(near.same_count, 7u) << 3 | std::min(near.count, 7u);
  return coder.code(std::equal(samples, samples + channels, first), context.at(kSameNode));
}

// Codes one voxel; its error is the sum of the sizes of its differences, at most 255.
template <typename Predictor, typename Coder>
uint8_t code_voxel(BitCoder<Coder>& coder, const AttributeNeighbors& near, uint8_t* samples) {
  const Predictor predictor(near);
  uint32_t error = 0;
  std::array<int, 2> before{};
  for (size_t i = 0; i < Predictor::kChannels; ++i) {
    uint8_t& sample = samples[predictor.channel(i)];
    const int predicted = predictor.predicted(i, samples);
    DifferenceContext context;
    context.channel = static_cast<uint32_t>(i);
    context.error = quantized(near.error);
    context.range = quantized(static_cast<uint32_t>(near.range[predictor.channel(i)]));
    context.before = quantized_difference(before[0]);
    context.before_that = quantized_difference(before[1]);
    context.count = std::min(near.count, 3u);
    context.predicted = static_cast<uint32_t>(predicted) >> 2;
    const int difference = code_difference(coder, context, wrapped(sample - predicted));
    sample = static_cast<uint8_t>(predicted + difference);
    before = {difference, before[0]};
    error += static_cast<uint32_t>(difference < 0 ? -difference : difference);
  }
  return static_cast<uint8_t>(std::min(error, 255u));
}

// `samples` is complete when writing, zero when reading. False when the bytes ran out.
template <typename Predictor, typename Coder>
bool code_attributes(Coder& coder, const SparseTile& tile, std::vector<uint8_t>& samples) {
  constexpr size_t kChannels = Predictor::kChannels;
  const VoxelNumbers numbers(tile);
  std::vector<uint8_t> errors(samples.size() / kChannels);
  BitCoder<Coder> bits{coder, {}};
  uint32_t number = 0;
  for (size_t b = 0; b < tile.masks.size(); ++b) {
    for (uint32_t word = 0; word < 8; ++word) {
      for (uint64_t rest = tile.masks[b].words[word]; rest != 0; rest &= rest - 1) {
        const auto cell = morton_decode(tile.brick_morton[b] << 9 | word << 6 |
                                        static_cast<uint32_t>(std::countr_zero(rest)));
        const auto near = attribute_neighbors(numbers, cell, number, samples, kChannels, errors);
        uint8_t* voxel = &samples[number * kChannels];
        const uint8_t* first = &samples[near.first * kChannels];
        if (number > 0 && code_same(bits, near, kChannels, voxel, first)) {
          std::copy_n(first, kChannels, voxel);
        } else {
          errors[number] = code_voxel<Predictor>(bits, near, voxel);
        }
        ++number;
      }
    }
    if (coder.exhausted()) return false;
  }
  return true;
}

template <typename Predictor>
std::vector<uint8_t> encoded(const SparseTile& tile, std::vector<uint8_t> samples) {
  std::vector<uint8_t> bytes;
  RangeEncoder coder(bytes);
  code_attributes<Predictor>(coder, tile, samples);
  coder.finish();
  return bytes;
}

template <typename Predictor>
Result<std::vector<uint8_t>> decoded(std::span<const uint8_t> bytes, const SparseTile& tile) {
  std::vector<uint8_t> samples(tile.attribute_count() * Predictor::kChannels);
  RangeDecoder coder(bytes);
  const bool complete = code_attributes<Predictor>(coder, tile, samples);
  if (complete && coder.at_end()) return samples;
  return Error{
      ErrorCode::kBadRequest,
      std::string("grid container, small attributes: ") +
          (complete && !coder.exhausted() ? "bytes after the stream" : "the stream is cut off"),
      "", ""};
}

}  // namespace

std::vector<uint8_t> encode_color_small(const SparseTile& tile) {
  return encoded<ColorPredictor>(tile, tile.color);
}

std::vector<uint8_t> encode_normal_small(const SparseTile& tile) {
  std::vector<uint8_t> samples(tile.normal.size());
  std::ranges::transform(tile.normal, samples.begin(),
                         [](int8_t sample) { return static_cast<uint8_t>(sample + 128); });
  return encoded<NormalPredictor>(tile, std::move(samples));
}

Status decode_color_small(std::span<const uint8_t> bytes, SparseTile& tile) {
  VOXELD_ASSIGN(tile.color, decoded<ColorPredictor>(bytes, tile));
  return {};
}

Status decode_normal_small(std::span<const uint8_t> bytes, SparseTile& tile) {
  VOXELD_ASSIGN(const std::vector<uint8_t> samples, decoded<NormalPredictor>(bytes, tile));
  tile.normal.resize(samples.size());
  std::ranges::transform(samples, tile.normal.begin(),
                         [](uint8_t sample) { return static_cast<int8_t>(sample - 128); });
  return {};
}

}  // namespace voxeld
