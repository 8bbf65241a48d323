#include "proto/codec/attribute_small.h"

#include <algorithm>
#include <array>
#include <bit>
#include <optional>
#include <string>
#include <type_traits>

#include "proto/codec/attribute_context.h"
#include "proto/codec/occupancy_model.h"
#include "proto/codec/range_coder.h"
#include "proto/codec/tile_runs.h"
#include "proto/work_point.h"

namespace voxeld {
namespace {

constexpr uint32_t kSameNode = 63;  // a context of its own, apart from those of differences

// Nodes in the binary tree of one difference's bits.
constexpr uint32_t kZeroNode = 0, kSignNode = 1, kLengthNode = 2, kFirstNode = 10, kSecondNode = 20,
                   kLowNode = 48;

// The context that predicts the bits of one difference.
struct DifferenceContext {
  uint32_t channel = 0;  // in coding order
  uint32_t error = 0;    // quantized(): mean error of the neighbours
  uint32_t range = 0;    // quantized(): range of the neighbours in this channel
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

// A coder and its model: codes one bit in its context.
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

// A voxel's cell, and the samples of the tile in which its neighbours are looked up.
template <typename Sample>
struct Place {
  const VoxelNumbers& numbers;
  std::array<uint32_t, 3> cell{};
  std::span<const Sample> samples;  // of the whole tile
};

// Predicts a colour. A predictor gives the order of a voxel's components and a value for each.
class ColorPredictor {
 public:
  using Sample = uint8_t;
  static constexpr size_t kComponents = 4;
  ColorPredictor(const AttributeNeighbors& near, const Place<Sample>&) : near_(near) {}

  size_t channel(size_t i) const { return kOrder[i]; }
  // `done`: the samples coded so far. Red and blue follow the change of green, so they are
  // predicted from it.
  int predicted(size_t i, const uint8_t* done) const {
    const int mean = near_.mean[kOrder[i]];
    if (i == 0 || i == 3) return mean;
    return std::clamp(mean + done[1] - near_.mean[1], 0, 255);
  }

 private:
  static constexpr std::array<size_t, kComponents> kOrder = {1, 0, 2, 3};  // G, R, B, A
  const AttributeNeighbors& near_;
};

uint32_t square_root(uint32_t value) {
  uint32_t root = 0;
  while ((root + 1) * (root + 1) <= value) ++root;
  return root;
}

// Predicts a unit vector; its samples are offset by 128. The component with the largest mean is
// coded last: the length is 127, so the two others leave little choice for it.
class VectorPredictor {
 public:
  using Sample = uint8_t;
  static constexpr size_t kComponents = 3;
  VectorPredictor(const AttributeNeighbors& near, const Place<Sample>&) : near_(near) {
    const auto size = [&](size_t c) {
      return near.mean[c] < 128 ? 128 - near.mean[c] : near.mean[c] - 128;
    };
    for (size_t c = 1; c < kComponents; ++c) {
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
  std::array<size_t, kComponents> order_ = {1, 2, 0};
  const AttributeNeighbors& near_;
};

// Predicts a fraction by the mean of its neighbours.
class FractionPredictor {
 public:
  using Sample = uint8_t;
  static constexpr size_t kComponents = 1;
  FractionPredictor(const AttributeNeighbors& near, const Place<Sample>&) : near_(near) {}

  size_t channel(size_t) const { return 0; }
  int predicted(size_t, const uint8_t*) const { return near_.mean[0]; }

 private:
  const AttributeNeighbors& near_;
};

// Predicts an id. A voxel between two surfaces has the id of the one or of the other. The 16 bits
// are coded as one difference.
class IdPredictor {
 public:
  using Sample = uint16_t;
  static constexpr size_t kComponents = 1;
  IdPredictor(const AttributeNeighbors& near, const Place<Sample>& place)
      : predicted_(near.count == 0 ? near.mean[0] : place.samples[near.other]) {}
  int predicted() const { return predicted_; }

 private:
  int predicted_;
};

// Predicts a distance, offset by 2^15. It assumes that distances are linear in each pair of axes
// for which three neighbours are known.
class DistancePredictor {
 public:
  using Sample = uint16_t;
  static constexpr size_t kComponents = 1;
  DistancePredictor(const AttributeNeighbors& near, const Place<Sample>& place) {
    int sum = 0, count = 0;
    for (size_t a = 0; a < 3; ++a) {
      for (size_t b = a + 1; b < 3; ++b) {
        const auto at_a = sample(place, a, a), at_b = sample(place, b, b);
        const auto at_both = sample(place, a, b);
        if (!at_a || !at_b || !at_both) continue;
        sum += *at_a + *at_b - *at_both;
        ++count;
      }
    }
    predicted_ = count == 0 ? near.mean[0] : std::clamp(sum, 0, count * 65535) / count;
  }
  int predicted() const { return predicted_; }

 private:
  // The sample one step back along the axes `a` and `b`; that cell is coded before this one.
  static std::optional<int> sample(const Place<Sample>& place, size_t a, size_t b) {
    std::array<int, 3> cell{};
    for (size_t c = 0; c < 3; ++c) {
      cell[c] = static_cast<int>(place.cell[c]) - (c == a || c == b ? 1 : 0);
    }
    const uint32_t voxel = place.numbers.find(cell[0], cell[1], cell[2]);
    if (voxel == VoxelNumbers::kNone) return std::nullopt;
    return place.samples[voxel];
  }

  int predicted_ = 0;
};

// Codes one bit: whether all samples equal those of near.first.
template <typename Coder, typename Sample>
bool code_same(BitCoder<Coder>& coder, const AttributeNeighbors& near, size_t components,
               const Sample* samples, const Sample* first) {
  DifferenceContext context;
  context.error = quantized(near.error);
  context.range = quantized(static_cast<uint32_t>(near.range[0]));
  context.before = std::min(near.same_count, 15u);
  context.before_that = std::min(near.count, 15u);
  context.count = std::min(near.count, 3u);
  context.predicted = std::min(near.same_count, 7u) << 3 | std::min(near.count, 7u);
  return coder.code(std::equal(samples, samples + components, first), context.at(kSameNode));
}

// Codes one voxel; its error is the sum of the sizes of its differences, at most 255.
template <typename Predictor, typename Coder>
uint8_t code_voxel(BitCoder<Coder>& coder, const AttributeNeighbors& near,
                   const Place<uint8_t>& place, uint8_t* samples) {
  const Predictor predictor(near, place);
  uint32_t error = 0;
  std::array<int, 2> before{};
  for (size_t i = 0; i < Predictor::kComponents; ++i) {
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

// Codes a voxel of one 16-bit sample: first the multiple of 256 nearest to its difference, then the
// rest.
template <typename Predictor, typename Coder>
uint8_t code_voxel(BitCoder<Coder>& coder, const AttributeNeighbors& near,
                   const Place<uint16_t>& place, uint16_t* sample) {
  const int predicted = Predictor(near, place).predicted();
  const int difference = static_cast<int16_t>(static_cast<uint16_t>(*sample - predicted));
  DifferenceContext context;
  context.error = quantized(near.error);
  context.range = quantized(static_cast<uint32_t>(near.range[0]));
  context.count = std::min(near.count, 3u);
  context.predicted = static_cast<uint32_t>(predicted) >> 10;
  const int high = code_difference(coder, context, wrapped((difference + 128) >> 8));
  context.channel = 1;
  context.before = quantized_difference(high);
  const int low = code_difference(coder, context, wrapped(difference));
  const auto told = static_cast<int16_t>(static_cast<uint16_t>(256 * high + low));
  *sample = static_cast<uint16_t>(predicted + told);
  return static_cast<uint8_t>(std::min(told < 0 ? -told : int{told}, 255));
}

// `samples` is complete when writing and zero when reading. Returns false if the bytes ran out.
template <typename Predictor, typename Coder>
bool code_attributes(Coder& coder, const SparseTile& tile,
                     std::vector<typename Predictor::Sample>& samples) {
  using Sample = typename Predictor::Sample;
  constexpr size_t kComponents = Predictor::kComponents;
  const VoxelNumbers numbers(tile);
  std::vector<uint8_t> errors(samples.size() / kComponents);
  BitCoder<Coder> bits{coder, {}};
  uint32_t number = 0;
  for (size_t b = 0; b < tile.masks.size(); ++b) {
    work_point();
    for (uint32_t word = 0; word < 8; ++word) {
      for (uint64_t rest = tile.masks[b].words[word]; rest != 0; rest &= rest - 1) {
        const auto cell = morton_decode(tile.brick_morton[b] << 9 | word << 6 |
                                        static_cast<uint32_t>(std::countr_zero(rest)));
        const Place<Sample> place{numbers, cell, samples};
        const auto near =
            attribute_neighbors<Sample>(numbers, cell, number, samples, kComponents, errors);
        Sample* voxel = &samples[number * kComponents];
        const Sample* first = &samples[near.first * kComponents];
        if (number > 0 && code_same(bits, near, kComponents, voxel, first)) {
          std::copy_n(first, kComponents, voxel);
        } else {
          errors[number] = code_voxel<Predictor>(bits, near, place, voxel);
        }
        ++number;
      }
    }
    if (coder.exhausted()) return false;
  }
  return true;
}

// Added to signed samples, which are coded as unsigned ones.
template <typename Sample>
constexpr int kOffset = std::is_signed_v<Sample> ? 1 << (8 * sizeof(Sample) - 1) : 0;

template <typename To, typename From>
std::vector<To> offset_samples(std::span<const From> samples, int offset) {
  std::vector<To> out(samples.size());
  std::ranges::transform(samples, out.begin(),
                         [&](From sample) { return static_cast<To>(sample + offset); });
  return out;
}

template <ChannelKind kind>
struct PredictorOf;
template <>
struct PredictorOf<ChannelKind::kColor> : std::type_identity<ColorPredictor> {};
template <>
struct PredictorOf<ChannelKind::kVector> : std::type_identity<VectorPredictor> {};
template <>
struct PredictorOf<ChannelKind::kId> : std::type_identity<IdPredictor> {};
template <>
struct PredictorOf<ChannelKind::kDistance> : std::type_identity<DistancePredictor> {};
template <>
struct PredictorOf<ChannelKind::kFraction> : std::type_identity<FractionPredictor> {};

// The predictor of a channel. Its samples have the size of the channel's.
template <Channel channel>
using ChannelPredictor = typename PredictorOf<channel_info(channel).kind>::type;
static_assert([] {
  bool agree = true;
  for_each_channel_member([&](auto channel, auto member) {
    using Predictor = ChannelPredictor<channel()>;
    agree = agree && Predictor::kComponents == channel_info(channel).components &&
            sizeof(typename Predictor::Sample) == sizeof(SampleOf<decltype(member)>);
  });
  return agree;
}());

Error bad_stream(const char* what) {
  return {ErrorCode::kBadRequest, std::string("grid container, small attributes: ") + what, "", ""};
}

}  // namespace

std::vector<uint8_t> encode_channel_small(const SparseTile& tile, Channel channel) {
  std::vector<uint8_t> bytes;
  with_channel_member(channel, [&](auto which, auto member) {
    using Predictor = ChannelPredictor<which()>;
    using Sample = SampleOf<decltype(member)>;
    auto samples =
        offset_samples<typename Predictor::Sample, Sample>(tile.*member, kOffset<Sample>);
    RangeEncoder coder(bytes);
    code_attributes<Predictor>(coder, tile, samples);
    coder.finish();
  });
  return bytes;
}

Status decode_channel_small(std::span<const uint8_t> bytes, Channel channel, SparseTile& tile) {
  Status status;
  with_channel_member(channel, [&](auto which, auto member) {
    using Predictor = ChannelPredictor<which()>;
    using Sample = SampleOf<decltype(member)>;
    std::vector<typename Predictor::Sample> samples(tile.attribute_count() *
                                                    Predictor::kComponents);
    RangeDecoder coder(bytes);
    const bool complete = code_attributes<Predictor>(coder, tile, samples);
    if (complete && coder.at_end()) {
      tile.*member = offset_samples<Sample, typename Predictor::Sample>(samples, -kOffset<Sample>);
    } else {
      status = bad_stream(complete && !coder.exhausted() ? "bytes after the stream"
                                                         : "the stream is cut off");
    }
  });
  return status;
}

}  // namespace voxeld
