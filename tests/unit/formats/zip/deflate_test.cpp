// Streams of Deflater, read by zlib.
#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "server/formats/output_file.h"
#include "server/formats/zip/deflate.h"
#include "server/formats/zip/deflate_stream.h"
#include "server/formats/zip/huffman.h"

namespace voxeld {
namespace {

using Bytes = std::vector<uint8_t>;

constexpr std::array kAllRepeats = {Repeats::runs(), Repeats::anywhere(), Repeats::rows(1),
                                    Repeats::rows(12), Repeats::rows(32768)};

Repeats repeats_for(size_t cell_bytes) {
  return cell_bytes == 1 ? Repeats::runs() : Repeats::anywhere();
}

// The raw stream's content; empty, with a failure, if it is not one that ends with its last byte.
Bytes inflated(const Bytes& stream, size_t bytes_max) {
  Bytes out(bytes_max + 1);
  z_stream z{};
  EXPECT_EQ(inflateInit2(&z, -15), Z_OK);
  z.next_in = const_cast<Bytef*>(stream.data());
  z.avail_in = static_cast<uInt>(stream.size());
  z.next_out = out.data();
  z.avail_out = static_cast<uInt>(out.size());
  EXPECT_EQ(inflate(&z, Z_FINISH), Z_STREAM_END) << (z.msg != nullptr ? z.msg : "");
  EXPECT_EQ(z.avail_in, 0u) << "bytes after the end";
  out.resize(z.total_out);
  inflateEnd(&z);
  return out;
}

// One stream of blocks of these lengths, the last one with the rest.
Bytes deflated(const Bytes& raw, const Repeats& repeats, const std::vector<size_t>& lengths = {}) {
  Deflater deflater;
  Bytes stream;
  size_t begin = 0;
  const auto add = [&](size_t length) {
    const auto block = deflater.block(std::span(raw).subspan(begin, length), repeats);
    stream.insert(stream.end(), block.begin(), block.end());
    begin += length;
  };
  for (const size_t length : lengths) add(length);
  add(raw.size() - begin);
  const auto end = Deflater::stream_end();
  stream.insert(stream.end(), end.begin(), end.end());
  return stream;
}

// Cells of `cell_bytes` of which one in `sparsity` is not zero, with `values` different bytes.
Bytes cells(unsigned seed, size_t bytes, size_t cell_bytes, unsigned sparsity, unsigned values) {
  std::mt19937 random(seed);
  Bytes raw(bytes);
  for (size_t i = 0; i < bytes; i += cell_bytes) {
    if (random() % sparsity != 0) continue;
    for (size_t c = i; c < std::min(i + cell_bytes, bytes); ++c) {
      raw[c] = static_cast<uint8_t>(random() % values);
    }
  }
  return raw;
}

TEST(Deflate, zlib_reads_what_it_writes) {
  unsigned seed = 0;
  for (const size_t bytes : {0, 1, 2, 3, 4, 5, 31, 32, 33, 257, 258, 259, 260, 1000, 70000}) {
    for (const size_t cell_bytes : {1, 3, 4, 16}) {
      for (const unsigned sparsity : {1, 2, 10, 100, 10000}) {
        for (const unsigned values : {1, 2, 3, 200, 256}) {
          const Bytes raw = cells(++seed, bytes, cell_bytes, sparsity, values);
          for (const Repeats& repeats : kAllRepeats) {
            ASSERT_EQ(inflated(deflated(raw, repeats), bytes), raw)
                << bytes << " bytes, cells of " << cell_bytes << ", one of " << sparsity << ", "
                << values << " values, search " << repeats.kind;
          }
        }
      }
    }
  }
}

TEST(Deflate, runs_of_every_length_survive) {
  Bytes raw;
  for (size_t length = 1; length < 1100; ++length) {
    raw.insert(raw.end(), length, static_cast<uint8_t>(length % 3));
    raw.push_back(7);
  }
  for (const Repeats& repeats : kAllRepeats) {
    EXPECT_EQ(inflated(deflated(raw, repeats), raw.size()), raw);
  }
}

TEST(Deflate, a_table_of_coords_takes_little_more_than_its_lowest_bytes) {
  std::vector<int32_t> rows;
  for (int32_t i = 0; i < 30000; ++i) rows.insert(rows.end(), {i % 700, i / 700, 3});
  Bytes raw(rows.size() * sizeof(int32_t));
  std::memcpy(raw.data(), rows.data(), raw.size());
  const Bytes stream = deflated(raw, Repeats::rows(12));
  EXPECT_EQ(inflated(stream, raw.size()), raw);
  EXPECT_LT(stream.size(), rows.size() / 3 * 2);
}

TEST(Deflate, repetitions_at_every_distance_survive) {
  // Two copies of random bytes, further and further apart, and beyond the reach of a reference.
  std::mt19937 random(1);
  for (size_t distance = 1; distance <= 40000; distance += 1 + distance / 3) {
    Bytes raw(distance);
    for (uint8_t& byte : raw) byte = static_cast<uint8_t>(1 + random() % 255);
    const size_t again = std::min<size_t>(distance, 300);
    raw.reserve(distance + again);
    raw.insert(raw.end(), raw.begin(), raw.begin() + static_cast<ptrdiff_t>(again));
    const Bytes stream = deflated(raw, Repeats::anywhere());
    ASSERT_EQ(inflated(stream, raw.size()), raw) << distance;
    // Random bytes take 8 bits and the codes a few hundred bytes; the copy takes next to nothing.
    if (distance <= 32768) {
      EXPECT_LT(stream.size(), distance + distance / 50 + 250) << distance;
    }
  }
}

TEST(Deflate, blocks_are_joined_to_one_stream) {
  const Bytes raw = cells(5, 100000, 4, 20, 256);
  EXPECT_EQ(inflated(deflated(raw, Repeats::anywhere(), {0, 1, 5, 32768, 0, 40000}), raw.size()),
            raw);
}

TEST(Deflate, an_empty_stream_has_no_block_but_the_last) {
  const auto end = Deflater::stream_end();
  EXPECT_EQ(inflated({end.begin(), end.end()}, 0), Bytes());
}

TEST(Deflate, a_megabyte_of_zeros_takes_a_bit_more_than_two_bits_for_258_bytes) {
  const Bytes stream = deflated(Bytes(size_t{1} << 20), Repeats::runs());
  EXPECT_LT(stream.size(), (size_t{1} << 20) / 258 / 4 + 100);
}

TEST(Deflate, is_no_longer_than_zlib_at_its_fastest_on_sparse_cells) {
  for (const size_t cell_bytes : {1, 4}) {
    const Bytes raw = cells(9, size_t{1} << 20, cell_bytes, 50, cell_bytes == 1 ? 2 : 256);
    z_stream z{};
    ASSERT_EQ(deflateInit2(&z, 1, Z_DEFLATED, -15, 8, Z_DEFAULT_STRATEGY), Z_OK);
    Bytes fast(deflateBound(&z, static_cast<uLong>(raw.size())));
    z.next_in = const_cast<Bytef*>(raw.data());
    z.avail_in = static_cast<uInt>(raw.size());
    z.next_out = fast.data();
    z.avail_out = static_cast<uInt>(fast.size());
    EXPECT_EQ(deflate(&z, Z_FINISH), Z_STREAM_END);
    EXPECT_LE(deflated(raw, repeats_for(cell_bytes)).size(), z.total_out);
    deflateEnd(&z);
  }
}

TEST(Deflate, random_bytes_grow_by_little) {
  const Bytes raw = cells(3, size_t{1} << 16, 1, 1, 256);
  for (const Repeats& repeats : kAllRepeats) {
    EXPECT_LT(deflated(raw, repeats).size(), raw.size() + raw.size() / 50);
  }
}

// Kraft's sum in units of 2^-15: 2^15 for a complete code.
uint32_t kraft(const Bytes& lengths) {
  uint32_t sum = 0;
  for (const uint8_t length : lengths) sum += length == 0 ? 0 : 1u << (15 - length);
  return sum;
}

TEST(DeflateStream, first_bytes_may_be_known_last) {
  std::mt19937 random(5);
  Bytes all(200'000);
  for (uint8_t& byte : all) byte = static_cast<uint8_t>(random() % 7);
  for (const size_t first : {0, 1, 1000, 65535, 65536, 150'000, 200'000}) {
    OutputFile file = OutputFile::in_memory();
    DeflateStream stream(file, DeflateStream::Frame::kZlib);
    ASSERT_TRUE(stream.begin_without(first));
    ASSERT_TRUE(stream.add(std::span(all).subspan(first)));
    ASSERT_TRUE(stream.finish(std::span(all).first(first)));
    const Bytes bytes = file.take_bytes();
    Bytes back(all.size());
    uLongf length = back.size();
    ASSERT_EQ(uncompress(back.data(), &length, bytes.data(), bytes.size()), Z_OK) << first;
    EXPECT_EQ(length, all.size());
    EXPECT_EQ(back, all);
  }
}

TEST(Huffman, codes_are_complete_and_no_longer_than_allowed) {
  // Fibonacci's numbers have the longest codes of all.
  std::vector<uint32_t> counts = {1, 1};
  while (counts.size() < 40) counts.push_back(counts.end()[-1] + counts.end()[-2]);
  for (const int length_max : {6, 7, 15}) {
    Bytes lengths(counts.size());
    huffman_lengths(counts, length_max, lengths);
    EXPECT_EQ(kraft(lengths), 1u << 15) << length_max;
    EXPECT_LE(*std::ranges::max_element(lengths), length_max);
    EXPECT_TRUE(std::ranges::is_sorted(lengths, std::ranges::greater())) << "rarer ones are longer";
  }
}

TEST(Huffman, few_symbols_have_complete_codes) {
  for (const std::vector<uint32_t>& counts :
       {std::vector<uint32_t>{0, 0, 0}, {5, 0, 0}, {0, 5, 0}, {0, 0, 5}, {0, 2, 3}}) {
    Bytes lengths(counts.size());
    huffman_lengths(counts, 15, lengths);
    EXPECT_EQ(kraft(lengths), 1u << 15);
    for (size_t i = 0; i < counts.size(); ++i) {
      if (counts[i] != 0) {
        EXPECT_EQ(lengths[i], 1);
      }
    }
  }
}

TEST(Huffman, lengths_are_the_best_where_none_is_cut) {
  const std::vector<uint32_t> counts = {45, 13, 12, 16, 9, 5};  // Cormen et al., 16.3
  Bytes lengths(counts.size());
  huffman_lengths(counts, 15, lengths);
  EXPECT_EQ(lengths, (Bytes{1, 3, 3, 3, 4, 4}));
}

}  // namespace
}  // namespace voxeld
