#include "server/formats/zip/deflate.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "server/base/check.h"
#include "server/formats/zip/huffman.h"

namespace voxeld {
namespace {

constexpr size_t kLengthMin = 3, kLengthMax = Deflater::kRepeatBytesMax, kDistanceMax = 32768;
constexpr size_t kLiterals = 256, kNone = kLiterals;  // kNone: a step without a literal
constexpr size_t kRunMin = 4;                         // shorter ones are literals
constexpr size_t kHashedBytes = 4;
constexpr size_t kEndOfBlock = 256, kFirstLength = 257;
constexpr int kCodeBitsMax = 15;

// Values that share a code: `base` and the extra bits' numbers above it.
struct Bucket {
  uint16_t base;
  uint8_t extra_bits;
};

// RFC 1951, 3.2.5: four buckets (two for distances) of each number of extra bits.
constexpr size_t kLengthCodes = 29;
constexpr auto kLengths = [] {
  std::array<Bucket, kLengthCodes> buckets{};
  unsigned base = kLengthMin;
  for (size_t i = 0; i + 1 < kLengthCodes; ++i) {
    const auto bits = static_cast<uint8_t>(i < 8 ? 0 : i / 4 - 1);
    buckets[i] = {static_cast<uint16_t>(base), bits};
    base += 1u << bits;
  }
  buckets[kLengthCodes - 1] = {kLengthMax, 0};
  return buckets;
}();
constexpr auto kDistances = [] {
  std::array<Bucket, 30> buckets{};
  unsigned base = 1;
  for (size_t i = 0; i < buckets.size(); ++i) {
    const auto bits = static_cast<uint8_t>(i < 4 ? 0 : i / 2 - 1);
    buckets[i] = {static_cast<uint16_t>(base), bits};
    base += 1u << bits;
  }
  return buckets;
}();

constexpr auto kLengthBuckets = [] {
  std::array<uint8_t, kLengthMax + 1> of{};
  for (size_t i = 0; i < kLengthCodes; ++i) {
    for (size_t length = kLengths[i].base; length <= kLengthMax; ++length) {
      of[length] = static_cast<uint8_t>(i);
    }
  }
  return of;
}();

// Two buckets begin in each doubling of distance - 1.
size_t distance_bucket(size_t distance) {
  const size_t d = distance - 1;
  if (d < 2) return d;
  const auto doubling = static_cast<size_t>(std::bit_width(d)) - 1;
  return 2 * doubling + (d >> (doubling - 1) & 1);
}

// Packs codes into bytes, the first bit lowest.
class BitWriter {
 public:
  static constexpr size_t kSlack = 8;  // bytes that `out` has behind the last one

  explicit BitWriter(uint8_t* out) : out_(out), at_(out) {}

  // At most 56 bits.
  void put(uint64_t bits, int count) {
    bits_ |= bits << filled_;
    filled_ += count;
    std::memcpy(at_, &bits_, sizeof bits_);  // little-endian, as the comparisons above are
    at_ += filled_ >> 3;
    bits_ >>= filled_ & ~7;
    filled_ &= 7;
  }
  void finish_byte() {
    if (filled_ > 0) ++at_;
    filled_ = 0;
    bits_ = 0;
  }
  size_t size() const { return static_cast<size_t>(at_ - out_); }

 private:
  uint8_t* const out_;
  uint8_t* at_;
  uint64_t bits_ = 0;
  int filled_ = 0;  // less than 8 between calls
};

template <typename Word>
Word load(const uint8_t* bytes) {
  Word word;
  std::memcpy(&word, bytes, sizeof word);
  return word;
}

// Bytes from `begin` on that equal `byte`.
size_t run_length(std::span<const uint8_t> bytes, size_t begin, uint8_t byte) {
  const uint64_t eight = uint64_t{0x0101010101010101} * byte;
  const uint8_t* at = bytes.data() + begin;
  const uint8_t* const end = bytes.data() + bytes.size();
  for (; end - at >= 32; at += 32) {
    const uint64_t differ = (load<uint64_t>(at) ^ eight) | (load<uint64_t>(at + 8) ^ eight) |
                            (load<uint64_t>(at + 16) ^ eight) | (load<uint64_t>(at + 24) ^ eight);
    if (differ != 0) break;
  }
  while (at != end && *at == byte) ++at;
  return static_cast<size_t>(at - bytes.data()) - begin;
}

// Bytes, at most kLengthMax, that are equal from a and from b > a on.
size_t common_length(std::span<const uint8_t> bytes, size_t a, size_t b) {
  const size_t length_max = std::min(kLengthMax, bytes.size() - b);
  size_t length = 0;
  while (length + 8 <= length_max) {
    const uint64_t differ =
        load<uint64_t>(bytes.data() + a + length) ^ load<uint64_t>(bytes.data() + b + length);
    if (differ != 0) return length + static_cast<size_t>(std::countr_zero(differ)) / 8;
    length += 8;
  }
  while (length < length_max && bytes[a + length] == bytes[b + length]) ++length;
  return length;
}

// The first part of a repetition that has parts of kLengthMin to kLengthMax.
size_t first_part(size_t length) {
  if (length <= kLengthMax) return length;
  return length - kLengthMax < kLengthMin ? kLengthMax - kLengthMin : kLengthMax;
}

// The lengths of the codes of literals and distances, run-length encoded (3.2.7).
struct LengthRun {
  uint8_t symbol;  // a length; kLastAgain, kZeros3 or kZeros11
  uint8_t extra;   // the number of repetitions above the least
  uint8_t extra_bits;
};
constexpr uint8_t kLastAgain = 16, kZeros3 = 17, kZeros11 = 18;
constexpr std::array<uint8_t, 19> kLengthOrder = {16, 17, 18, 0, 8,  7, 9,  6, 10, 5,
                                                  11, 4,  12, 3, 13, 2, 14, 1, 15};

std::vector<LengthRun> run_lengths(std::span<const uint8_t> lengths) {
  std::vector<LengthRun> runs;
  for (size_t begin = 0, end = 0; begin < lengths.size(); begin = end) {
    const uint8_t length = lengths[begin];
    end = begin + run_length(lengths, begin, length);
    size_t left = end - begin;
    if (length != 0) {
      runs.push_back({length, 0, 0});
      --left;
    }
    while (left >= 3) {
      const size_t part = std::min<size_t>(left, length != 0 ? 6 : 138);
      if (length != 0) {
        runs.push_back({kLastAgain, static_cast<uint8_t>(part - 3), 2});
      } else if (part < 11) {
        runs.push_back({kZeros3, static_cast<uint8_t>(part - 3), 3});
      } else {
        runs.push_back({kZeros11, static_cast<uint8_t>(part - 11), 7});
      }
      left -= part;
    }
    runs.insert(runs.end(), left, {length, 0, 0});
  }
  return runs;
}

// The highest bit of each byte of a word that is not 0.
uint64_t high_bits(uint64_t word) {
  constexpr uint64_t kOthers = 0x7f7f7f7f7f7f7f7f;
  return (((word & kOthers) + kOthers) | word) & ~kOthers;
}

size_t used_length(std::span<const uint8_t> lengths, size_t least) {
  size_t length = lengths.size();
  while (length > least && lengths[length - 1] == 0) --length;
  return length;
}

}  // namespace

void Deflater::begin_steps(size_t bytes) {
  // Each step stands for a byte or more.
  if (steps_.size() < bytes) steps_.resize(bytes);
  step_count_ = 0;
  step_lengths_.fill(0);
}

// length: 0, or kLengthMin to kLengthMax.
void Deflater::add_step(size_t length, size_t literal) {
  steps_[step_count_++] = {static_cast<uint16_t>(length), static_cast<uint16_t>(literal)};
  ++step_lengths_[length];
  ++literal_counts_[literal];
}

// Adds steps for what one alone can't hold of a repetition. Returns the rest, which one can.
size_t Deflater::add_long_repeat(size_t length) {
  while (length > kLengthMax) {
    const size_t part = first_part(length);
    add_step(part, kNone);
    length -= part;
  }
  return length;
}

// repeated: bytes behind the last step that repeat; 0, or at least kLengthMin.
void Deflater::finish_steps(size_t repeated, size_t distance) {
  if (repeated > 0) add_step(add_long_repeat(repeated), kNone);
  static_assert(kNone == kEndOfBlock);
  literal_counts_[kEndOfBlock] = 1;
  for (size_t length = kLengthMin; length <= kLengthMax; ++length) {
    literal_counts_[kFirstLength + kLengthBuckets[length]] += step_lengths_[length];
    distance_counts_[distance_bucket(distance)] += step_lengths_[length];
  }
  write(distance);
}

void Deflater::find_runs(std::span<const uint8_t> bytes) {
  begin_steps(bytes.size());
  size_t repeated = 0;
  for (size_t at = 0; at < bytes.size();) {
    const uint8_t byte = bytes[at];
    const size_t length = run_length(bytes, at, byte);
    at += length;
    add_step(add_long_repeat(repeated), byte);
    repeated = length >= kRunMin ? length - 1 : 0;
    for (size_t i = 1; i + repeated < length; ++i) add_step(0, byte);
  }
  finish_steps(repeated, 1);
}

void Deflater::find_rows(std::span<const uint8_t> bytes, size_t row_bytes) {
  VOXELD_CHECK(row_bytes > 0 && row_bytes <= kDistanceMax, "deflate: a row is too long");
  begin_steps(bytes.size());
  size_t done = std::min(row_bytes, bytes.size());  // bytes that steps stand for
  for (size_t i = 0; i < done; ++i) add_step(0, bytes[i]);
  // The bytes from `done` to `differing` repeat those above.
  const auto add = [&](size_t differing) {
    size_t repeated = differing - done;
    if (repeated > 0 && repeated < kLengthMin) {
      for (; repeated > 0; --repeated) add_step(0, bytes[differing - repeated]);
    } else if (repeated > kLengthMax) {
      repeated = add_long_repeat(repeated);
    }
    add_step(repeated, bytes[differing]);
    done = differing + 1;
  };
  size_t at = done;
  for (; at + 8 <= bytes.size(); at += 8) {
    const uint8_t* const row = bytes.data() + at;
    uint64_t differ = high_bits(load<uint64_t>(row) ^ load<uint64_t>(row - row_bytes));
    for (; differ != 0; differ &= differ - 1) {
      add(at + static_cast<size_t>(std::countr_zero(differ)) / 8);
    }
  }
  for (; at < bytes.size(); ++at) {
    if (bytes[at] != bytes[at - row_bytes]) add(at);
  }
  size_t repeated = bytes.size() - done;
  if (repeated < kLengthMin) {
    for (; repeated > 0; --repeated) add_step(0, bytes[bytes.size() - repeated]);
  }
  finish_steps(repeated, row_bytes);
}

void Deflater::add_literal(uint8_t byte) {
  tokens_.push_back({byte, 0});
  ++literal_counts_[byte];
}

// length: at least kLengthMin.
void Deflater::add_repeat(size_t length, size_t distance) {
  while (length > 0) {
    const size_t part = first_part(length);
    tokens_.push_back({static_cast<uint16_t>(part), static_cast<uint16_t>(distance)});
    ++literal_counts_[kFirstLength + kLengthBuckets[part]];
    ++distance_counts_[distance_bucket(distance)];
    length -= part;
  }
}

void Deflater::find_anywhere(std::span<const uint8_t> bytes) {
  tokens_.clear();
  last_.fill(0);
  for (size_t at = 0; at < bytes.size();) {
    if (bytes[at] == 0) {
      const size_t length = run_length(bytes, at, 0);
      if (length >= kRunMin) {
        add_literal(0);
        add_repeat(length - 1, 1);
        at += length;
        continue;
      }
    }
    if (at + kHashedBytes <= bytes.size()) {
      const auto key = load<uint32_t>(bytes.data() + at);
      uint32_t& last = last_[key * 2654435761u >> (32 - kHashBits)];  // 2^32 / golden ratio
      const size_t before = last;
      last = static_cast<uint32_t>(at + 1);
      if (before != 0 && at + 1 - before <= kDistanceMax &&
          load<uint32_t>(bytes.data() + before - 1) == key) {
        const size_t length = common_length(bytes, before - 1, at);
        add_repeat(length, at + 1 - before);
        at += length;
        continue;
      }
    }
    add_literal(bytes[at++]);
  }
  literal_counts_[kEndOfBlock] = 1;
  write(0);
}

std::span<const uint8_t> Deflater::block(std::span<const uint8_t> bytes, const Repeats& repeats) {
  VOXELD_CHECK(bytes.size() <= kBlockBytesMax, "deflate: a block is too long");
  literal_counts_.fill(0);
  distance_counts_.fill(0);
  switch (repeats.kind) {
    case Repeats::kRuns:
      find_runs(bytes);
      break;
    case Repeats::kRows:
      find_rows(bytes, repeats.row_bytes);
      break;
    case Repeats::kAnywhere:
      find_anywhere(bytes);
      break;
  }
  return out_;
}

// only_distance: of all repetitions; 0: they have distances of their own.
void Deflater::write(size_t only_distance) {
  std::array<uint8_t, kLiteralCodes> literal_lengths{};
  std::array<uint8_t, kDistanceCodes> distance_lengths{};
  huffman_lengths(literal_counts_, kCodeBitsMax, literal_lengths);
  huffman_lengths(distance_counts_, kCodeBitsMax, distance_lengths);
  std::array<uint16_t, kLiteralCodes> literal_codes{};
  std::array<uint16_t, kDistanceCodes> distance_codes{};
  huffman_codes(literal_lengths, literal_codes);
  huffman_codes(distance_lengths, distance_codes);

  const size_t literals = used_length(literal_lengths, kFirstLength);
  const size_t distances = used_length(distance_lengths, 1);
  std::vector<uint8_t> lengths(literal_lengths.begin(),
                               literal_lengths.begin() + static_cast<ptrdiff_t>(literals));
  lengths.insert(lengths.end(), distance_lengths.begin(),
                 distance_lengths.begin() + static_cast<ptrdiff_t>(distances));
  const std::vector<LengthRun> runs = run_lengths(lengths);
  std::array<uint32_t, kLengthOrder.size()> run_counts{};
  for (const LengthRun& run : runs) ++run_counts[run.symbol];
  std::array<uint8_t, kLengthOrder.size()> run_code_lengths{};
  std::array<uint16_t, kLengthOrder.size()> run_codes{};
  huffman_lengths(run_counts, 7, run_code_lengths);
  huffman_codes(run_code_lengths, run_codes);
  size_t ordered = kLengthOrder.size();
  while (ordered > 4 && run_code_lengths[kLengthOrder[ordered - 1]] == 0) --ordered;

  // The length is known before a bit is written.
  uint64_t bits = 3 + 5 + 5 + 4 + 3 * ordered;
  for (const LengthRun& run : runs) bits += run_code_lengths[run.symbol] + run.extra_bits;
  for (size_t i = 0; i < kLiteralCodes; ++i) {
    const int extra = i < kFirstLength || i >= kFirstLength + kLengthCodes
                          ? 0
                          : kLengths[i - kFirstLength].extra_bits;
    bits += uint64_t{literal_counts_[i]} * (literal_lengths[i] + extra);
  }
  for (size_t i = 0; i < kDistanceCodes; ++i) {
    bits += uint64_t{distance_counts_[i]} * (distance_lengths[i] + kDistances[i].extra_bits);
  }
  constexpr std::array<uint8_t, 4> kEmptyStored = {0, 0, 0xff, 0xff};
  const size_t bytes = (bits + 3 + 7) / 8 + kEmptyStored.size();
  out_.resize(bytes + BitWriter::kSlack);

  BitWriter writer(out_.data());
  writer.put(0, 1);  // not the last block
  writer.put(2, 2);  // with codes of its own
  writer.put(literals - kFirstLength, 5);
  writer.put(distances - 1, 5);
  writer.put(ordered - 4, 4);
  for (size_t i = 0; i < ordered; ++i) writer.put(run_code_lengths[kLengthOrder[i]], 3);
  for (const LengthRun& run : runs) {
    writer.put(run_codes[run.symbol], run_code_lengths[run.symbol]);
    writer.put(run.extra, run.extra_bits);
  }

  // Codes with their extra bits in one word.
  struct Code {
    uint64_t bits = 0;
    int count = 0;

    Code then(const Code& other) const { return {bits | other.bits << count, count + other.count}; }
  };
  const auto distance_code = [&](size_t distance) -> Code {
    const size_t bucket = distance_bucket(distance);
    const uint64_t extra = distance - kDistances[bucket].base;
    return {distance_codes[bucket] | extra << distance_lengths[bucket],
            distance_lengths[bucket] + kDistances[bucket].extra_bits};
  };
  // With the only distance.
  std::array<Code, kLengthMax + 1> length_codes{};
  const Code only = only_distance == 0 ? Code{} : distance_code(only_distance);
  for (size_t length = kLengthMin; length <= kLengthMax; ++length) {
    const size_t bucket = kLengthBuckets[length];
    const size_t symbol = kFirstLength + bucket;
    const uint64_t extra = length - kLengths[bucket].base;
    const Code code = {literal_codes[symbol] | extra << literal_lengths[symbol],
                       literal_lengths[symbol] + kLengths[bucket].extra_bits};
    length_codes[length] = code.then(only);
  }
  std::array<Code, kLiterals + 1> literals_or_none{};
  for (size_t i = 0; i < kLiterals; ++i) {
    literals_or_none[i] = {literal_codes[i], literal_lengths[i]};
  }
  if (only_distance != 0) {
    for (const Step& step : std::span(steps_).first(step_count_)) {
      const Code code = length_codes[step.length].then(literals_or_none[step.literal]);
      writer.put(code.bits, code.count);  // at most 49 bits
    }
  } else {
    for (const Token& token : tokens_) {
      const Code code = token.distance == 0
                            ? literals_or_none[token.length]
                            : length_codes[token.length].then(distance_code(token.distance));
      writer.put(code.bits, code.count);
    }
  }
  writer.put(literal_codes[kEndOfBlock], literal_lengths[kEndOfBlock]);
  // An empty stored block begins in this byte and ends with one.
  writer.put(0, 3);
  writer.finish_byte();
  VOXELD_CHECK(writer.size() + kEmptyStored.size() == bytes, "deflate: the length is wrong");
  std::ranges::copy(kEmptyStored, out_.begin() + static_cast<ptrdiff_t>(writer.size()));
  out_.resize(bytes);
}

std::span<const uint8_t> Deflater::stream_end() {
  static constexpr std::array<uint8_t, 2> kLastAndEmpty = {3, 0};
  return kLastAndEmpty;
}

}  // namespace voxeld
