// A binary range coder: codes bits into bytes at the cost that their probabilities imply.
//
// Nigel Martin, "Range encoding: an algorithm for removing redundancy from a digitised message"
// (1979), for two symbols. Carries are held back until they are known, as in LZMA's coder. Unlike
// there, probabilities have 16 bits, and the first byte, which would always be zero, is omitted.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace voxeld {

inline constexpr uint32_t kProbabilityBits = 16;
// The range stays at or above this value, so the part of any probability is never empty.
inline constexpr uint32_t kRangeMin = 1u << 24;

// Appends to `bytes`, which must outlive the encoder.
class RangeEncoder {
 public:
  explicit RangeEncoder(std::vector<uint8_t>& bytes) : bytes_(bytes) {}

  // `one` is the probability that `bit` is set, in 1/65536: 1..65535. Returns `bit`.
  bool code(bool bit, uint32_t one) {
    const auto bound = static_cast<uint32_t>(uint64_t{range_} * one >> kProbabilityBits);
    if (bit) {
      range_ = bound;
    } else {
      low_ += bound;
      range_ -= bound;
    }
    while (range_ < kRangeMin) {
      range_ <<= 8;
      shift_out();
    }
    return bit;
  }

  // Writes the bytes that are held back. Call it once, last.
  void finish() {
    for (int i = 0; i < 5; ++i) shift_out();
  }

  // Exists so that both coders have the same interface; an encoder never runs out.
  static bool exhausted() { return false; }

 private:
  // Moves the top byte of low_ out, or holds it back while a carry could still change it.
  void shift_out() {
    if (low_ < 0xff000000u || low_ >= uint64_t{1} << 32) {
      const auto carry = static_cast<uint8_t>(low_ >> 32);
      if (has_held_) bytes_.push_back(static_cast<uint8_t>(held_ + carry));
      for (; held_ff_count_ > 0; --held_ff_count_) {
        bytes_.push_back(static_cast<uint8_t>(0xff + carry));
      }
      held_ = static_cast<uint8_t>(low_ >> 24);
      has_held_ = true;
    } else {
      ++held_ff_count_;
    }
    low_ = (low_ & 0x00ffffffu) << 8;
  }

  std::vector<uint8_t>& bytes_;
  uint64_t low_ = 0;  // 33 bits: the lowest is the carry
  uint32_t range_ = ~uint32_t{0};
  size_t held_ff_count_ = 0;
  uint8_t held_ = 0;
  bool has_held_ = false;  // false only before the first byte
};

// Reads what RangeEncoder wrote, given the same probabilities.
class RangeDecoder {
 public:
  // `bytes` must outlive the decoder.
  explicit RangeDecoder(std::span<const uint8_t> bytes) : bytes_(bytes) {
    for (int i = 0; i < 4; ++i) code_ = code_ << 8 | next_byte();
  }

  // The first argument exists so that both coders have the same interface.
  bool code(bool /*bit*/, uint32_t one) {
    const auto bound = static_cast<uint32_t>(uint64_t{range_} * one >> kProbabilityBits);
    const bool bit = code_ < bound;
    if (bit) {
      range_ = bound;
    } else {
      code_ -= bound;
      range_ -= bound;
    }
    while (range_ < kRangeMin) {
      range_ <<= 8;
      code_ = code_ << 8 | next_byte();
    }
    return bit;
  }

  // Whether more bytes were needed than there are; bits read since then mean nothing.
  bool exhausted() const { return exhausted_; }
  // Whether the bytes are used up exactly, as they are after an encoder's last bit.
  bool at_end() const { return !exhausted_ && at_ == bytes_.size(); }

 private:
  uint32_t next_byte() {
    if (at_ < bytes_.size()) return bytes_[at_++];
    exhausted_ = true;
    return 0;
  }

  std::span<const uint8_t> bytes_;
  size_t at_ = 0;
  uint32_t range_ = ~uint32_t{0};
  uint32_t code_ = 0;
  bool exhausted_ = false;
};

}  // namespace voxeld
