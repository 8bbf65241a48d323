// Writes Khronos' KTX 2.0: one 3D texture with one level, compressed by Zstandard.
//
//     0  identifier, 12 bytes
//    12  u32 vkFormat, typeSize, width, height, depth, layers 0, faces 1, levels 1, scheme 2
//    48  u32 offset and length of the descriptor, u32 offset and length of keys and values,
//        u64 offset and length of global data, which there is none of
//    80  u64 offset of the level, u64 its length, u64 its length without compression
//   104  data format descriptor (Khronos Data Format 1.3): u32 length, a basic block
//     ..  keys and values, each u32 length, key, 0, value, 0, zeros up to a multiple of 4
//     ..  the level: one zstd frame of the texels, x fastest, then y, then z
//
//   channel          VkFormat                  a sampler reads
//   occupancy        9    R8_UNORM             0 or 1
//   color            43   R8G8B8A8_SRGB        linear colour; alpha 0 where there is none
//   normal           38   R8G8B8A8_SNORM       the unit normal; alpha 1 where there is one
//   material, label  74   R16_UINT             the id, 0: none
//   distance         100  R32_SFLOAT           world units; voxels as in volume_array.h
//   coverage         9    R8_UNORM             0 to 1
//
// KTXorientation is "ruo": x to the right, y up, z towards the viewer. Keys of voxeld: channel,
// meta (JSON), origin (the min corner), units, voxel_size.
// The specification: https://registry.khronos.org/KTX/specs/2.0/ktxspec.v2.html
#include <zstd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "proto/thread_pool.h"
#include "server/base/cancel_point.h"
#include "server/formats/formats.h"
#include "server/formats/images/sample_words.h"
#include "server/formats/output_file.h"
#include "server/formats/volume/volume_array.h"
#include "server/formats/volume/volume_facts.h"

namespace voxeld::images {
namespace {

constexpr std::array<uint8_t, 12> kKtx2Identifier = {0xab, 'K',  'T',  'X',  ' ',  '2',
                                                     '0',  0xbb, '\r', '\n', 0x1a, '\n'};
constexpr size_t kKtx2DescriptorAt = 104;  // after the header and the index of one level
constexpr size_t kKtx2LevelIndexAt = 80;
constexpr uint32_t kKtx2Zstandard = 2;
constexpr int kKtx2ZstdLevel = 1;
constexpr size_t kKtx2BatchPieces = 8;  // in memory twice

// The qualifiers of a sample's type in a descriptor, and the letters that VkFormat calls them.
enum class Numbers { kUnorm, kSrgb, kSnorm, kUint, kFloat };

struct TexelFormat {
  uint32_t vk_format;
  Numbers numbers;
  uint32_t sample_bytes, samples;

  uint32_t bytes() const { return sample_bytes * samples; }
};

TexelFormat texel_format(std::optional<Channel> channel) {
  if (!channel) return {9, Numbers::kUnorm, 1, 1};
  switch (channel_info(*channel).kind) {
    case ChannelKind::kColor:
      return {43, Numbers::kSrgb, 1, 4};
    case ChannelKind::kVector:
      return {38, Numbers::kSnorm, 1, 4};
    case ChannelKind::kId:
      return {74, Numbers::kUint, 2, 1};
    case ChannelKind::kDistance:
      return {100, Numbers::kFloat, 4, 1};
    case ChannelKind::kFraction:
      break;
  }
  return {9, Numbers::kUnorm, 1, 1};
}

class Ktx2Bytes {
 public:
  template <typename T>
  Ktx2Bytes& put(T value) {
    for (size_t i = 0; i < sizeof value; ++i) {
      bytes_.push_back(static_cast<uint8_t>(value >> (8 * i)));
    }
    return *this;
  }
  Ktx2Bytes& add(std::span<const uint8_t> bytes) {
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
    return *this;
  }
  Ktx2Bytes& pad(size_t multiple) {
    bytes_.resize((bytes_.size() + multiple - 1) / multiple * multiple);
    return *this;
  }
  const std::vector<uint8_t>& bytes() const { return bytes_; }
  uint32_t size() const { return static_cast<uint32_t>(bytes_.size()); }

 private:
  std::vector<uint8_t> bytes_;
};

// A sample of the descriptor: where its bits are, what they are, and the values of -1 or 0 and 1.
void put_sample(Ktx2Bytes& out, const TexelFormat& format, uint32_t number) {
  constexpr uint8_t kAlpha = 15, kLinear = 0x10, kSigned = 0x40, kFloatBits = 0x80;
  const auto bits = static_cast<uint8_t>(8 * format.sample_bytes);
  auto type = static_cast<uint8_t>(number == 3 ? kAlpha : number);  // red, green, blue: 0, 1, 2
  uint32_t lower = 0, upper = UINT8_MAX;
  switch (format.numbers) {
    case Numbers::kUnorm:
      break;
    case Numbers::kSrgb:
      if (number == 3) type |= kLinear;
      break;
    case Numbers::kSnorm:
      type |= kSigned;
      lower = std::bit_cast<uint32_t>(int32_t{-INT8_MAX});
      upper = INT8_MAX;
      break;
    case Numbers::kUint:
      upper = 1;
      break;
    case Numbers::kFloat:
      type |= kSigned | kFloatBits;
      lower = std::bit_cast<uint32_t>(-1.0F);
      upper = std::bit_cast<uint32_t>(1.0F);
      break;
  }
  out.put(static_cast<uint16_t>(bits * number)).put(static_cast<uint8_t>(bits - 1)).put(type);
  out.put(uint32_t{0}).put(lower).put(upper);
}

// One basic block. It describes the texels of a compressed level as they are without compression.
void put_descriptor(Ktx2Bytes& out, const TexelFormat& format) {
  constexpr uint16_t kVersion = 2;
  constexpr uint8_t kRgbsda = 1, kBt709 = 1, kLinear = 1, kSrgb = 2, kStraightAlpha = 0;
  const auto block_bytes = static_cast<uint16_t>(24 + 16 * format.samples);
  out.put(uint32_t{4} + block_bytes).put(uint32_t{0}).put(kVersion).put(block_bytes);
  out.put(kRgbsda).put(kBt709);
  out.put(format.numbers == Numbers::kSrgb ? kSrgb : kLinear).put(kStraightAlpha);
  out.put(uint32_t{0}).put(uint64_t{format.bytes()});  // 1x1x1x1 texels, bytes of 8 planes
  for (uint32_t i = 0; i < format.samples; ++i) put_sample(out, format, i);
}

void put_value(Ktx2Bytes& out, std::string_view key, std::string_view value) {
  out.put(static_cast<uint32_t>(key.size() + value.size() + 2));
  out.add(volume::text_bytes(key)).put(uint8_t{0});
  out.add(volume::text_bytes(value)).put(uint8_t{0}).pad(4);
}

// Keys in the order of their bytes, as readers may search them.
void put_values(Ktx2Bytes& out, const Grid& grid, std::optional<Channel> channel) {
  const std::string units = volume::units_of(grid);
  put_value(out, "KTXorientation", "ruo");
  put_value(out, "KTXwriter", "voxeld");
  put_value(out, "voxeld.channel", volume::array_name(channel));
  put_value(out, "voxeld.meta", grid.meta.text());
  put_value(out, "voxeld.origin", volume::vector_text(grid.spec.origin_world));
  if (!units.empty()) put_value(out, "voxeld.units", units);
  put_value(out, "voxeld.voxel_size", volume::vector_text(grid.spec.voxel_size));
}

// All bytes before the level, whose length is not known yet.
std::vector<uint8_t> ktx2_head(const Grid& grid, std::optional<Channel> channel,
                               const TexelFormat& format) {
  Ktx2Bytes descriptor, values;
  put_descriptor(descriptor, format);
  put_values(values, grid, channel);
  const auto values_at = static_cast<uint32_t>(kKtx2DescriptorAt + descriptor.size());
  const glm::ivec3 dims = grid.spec.dims;
  Ktx2Bytes out;
  out.add(kKtx2Identifier).put(format.vk_format).put(format.sample_bytes);
  for (int axis = 0; axis < 3; ++axis) out.put(static_cast<uint32_t>(dims[axis]));
  out.put(uint32_t{0}).put(uint32_t{1}).put(uint32_t{1}).put(kKtx2Zstandard);
  out.put(static_cast<uint32_t>(kKtx2DescriptorAt)).put(descriptor.size());
  out.put(values_at).put(values.size()).put(uint64_t{0}).put(uint64_t{0});
  out.put(uint64_t{values_at} + values.size()).put(uint64_t{0});
  out.put(static_cast<uint64_t>(grid.spec.cell_count()) * format.bytes());
  return out.add(descriptor.bytes()).add(values.bytes()).bytes();
}

// The samples of a channel as texels.
class TexelPieces {
 public:
  TexelPieces(const Grid& grid, std::optional<Channel> channel)
      : channel_(channel),
        array_(grid, channel, OutputOptions{}),
        type_(volume::array_type(channel, OutputOptions{})) {}

  size_t piece_count() const { return array_.piece_count(); }

  // Replaces the texels by those of a piece. Thread-safe.
  void fill(size_t piece, std::vector<uint8_t>& texels) const {
    texels.resize(array_.piece_bytes(piece));
    array_.fill(piece, texels);
    if (!channel_) {
      to_full_range(texels, texels.data());
    } else if (type_.components == 3) {
      add_alpha(texels);
    }
  }

 private:
  // From three samples to four in place, the last cell first.
  static void add_alpha(std::vector<uint8_t>& texels) {
    const size_t cells = texels.size() / 3;
    texels.resize(4 * cells);
    for (size_t i = cells; i > 0;) {
      if (i >= kVectorGroup && all_zero_vectors(&texels[3 * (i - kVectorGroup)])) {
        i -= kVectorGroup;
        std::memset(&texels[4 * i], 0, 4 * kVectorGroup);
        continue;
      }
      --i;
      const uint8_t x = texels[3 * i], y = texels[3 * i + 1], z = texels[3 * i + 2];
      const auto alpha = static_cast<uint8_t>((x | y | z) == 0 ? 0 : INT8_MAX);
      const std::array<uint8_t, 4> texel = {x, y, z, alpha};
      std::memcpy(&texels[4 * i], texel.data(), texel.size());
    }
  }

  std::optional<Channel> channel_;
  volume::VolumeArray array_;
  volume::ArrayType type_;
};

// One zstd frame that says its length.
class ZstdFrame {
 public:
  ZstdFrame(OutputFile& file, uint64_t raw_bytes)
      : file_(file), context_(ZSTD_createCCtx()), out_(ZSTD_CStreamOutSize()) {
    ZSTD_CCtx_setParameter(context_.get(), ZSTD_c_compressionLevel, kKtx2ZstdLevel);
    ZSTD_CCtx_setParameter(context_.get(), ZSTD_c_checksumFlag, 1);
    ZSTD_CCtx_setPledgedSrcSize(context_.get(), raw_bytes);
  }

  Status add(std::span<const uint8_t> bytes) { return run(bytes, ZSTD_e_continue); }
  Status finish() { return run({}, ZSTD_e_end); }

 private:
  struct Free {
    void operator()(ZSTD_CCtx* context) const { ZSTD_freeCCtx(context); }
  };

  Status run(std::span<const uint8_t> bytes, ZSTD_EndDirective directive) {
    ZSTD_inBuffer in = {bytes.data(), bytes.size(), 0};
    size_t left = 0;  // to be flushed, at least
    do {
      ZSTD_outBuffer out = {out_.data(), out_.size(), 0};
      left = ZSTD_compressStream2(context_.get(), &out, &in, directive);
      if (ZSTD_isError(left) != 0) {
        return Error{ErrorCode::kInternal, std::string("zstd: ") + ZSTD_getErrorName(left), "", ""};
      }
      VOXELD_TRY(file_.append(std::span(out_).first(out.pos)));
    } while (directive == ZSTD_e_end ? left != 0 : in.pos != in.size);
    return {};
  }

  OutputFile& file_;
  std::unique_ptr<ZSTD_CCtx, Free> context_;
  std::vector<uint8_t> out_;
};

// One task of all threads compresses a batch while the others make the next one.
Status append_texels(OutputFile& file, const TexelPieces& array, uint64_t raw_bytes) {
  using Batch = std::vector<std::vector<uint8_t>>;
  ZstdFrame frame(file, raw_bytes);
  Batch made(kKtx2BatchPieces), next(kKtx2BatchPieces);
  size_t made_count = 0;
  const auto add_made = [&]() -> Status {
    for (size_t i = 0; i < made_count; ++i) VOXELD_TRY(frame.add(made[i]));
    return {};
  };
  for (size_t begin = 0; begin < array.piece_count(); begin += kKtx2BatchPieces) {
    const size_t count = std::min(kKtx2BatchPieces, array.piece_count() - begin);
    Status added;
    ThreadPool::shared().for_each(count + 1, [&](size_t i) {
      cancel_point();  // on the calling thread
      if (i == 0) {
        added = add_made();
      } else {
        array.fill(begin + i - 1, next[i - 1]);
      }
    });
    VOXELD_TRY(added);
    std::swap(made, next);
    made_count = count;
  }
  VOXELD_TRY(add_made());
  return frame.finish();
}

}  // namespace
}  // namespace voxeld::images

namespace voxeld {

Status encode_ktx2(const Grid& grid, const OutputOptions& options, OutputFile& file) {
  using namespace images;
  const TexelFormat format = texel_format(options.channel);
  VOXELD_TRY(file.append(ktx2_head(grid, options.channel, format)));
  const uint64_t level_at = file.size();
  VOXELD_TRY(append_texels(file, TexelPieces(grid, options.channel),
                           static_cast<uint64_t>(grid.spec.cell_count()) * format.bytes()));
  const auto length = Ktx2Bytes().put(file.size() - level_at).bytes();
  return file.replace(kKtx2LevelIndexAt + sizeof(uint64_t), length);
}

}  // namespace voxeld
