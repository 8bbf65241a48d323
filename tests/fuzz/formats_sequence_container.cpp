// The container of a sequence. The first byte selects what the rest is: a container; one whose
// length in the header is corrected, so that later checks are reached; frames of a small scene that
// must be decoded again; or the container of a grid, whose streams become a frame.
// Seeds: the containers of write_sequence_sample DIR, each after a zero byte; a small one is in
// corpus/fuzz_sequence_container. The containers of write_sample DIR, each after a byte 3.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "proto/container/grid_streams.h"
#include "server/base/check.h"
#include "tests/unit/formats/sample_frames.h"

namespace {

using Bytes = std::span<const uint8_t>;
using voxeld::SequenceReader;

constexpr size_t kFramesRead = 16;

// A sequence that was read can be written, and is then the same.
void write_again(const SequenceReader& reader,
                 const std::vector<std::vector<voxeld::SparseTile>>& frames) {
  auto writer = voxeld::SequenceWriter::open(reader.header(), reader.fps());
  VOXELD_CHECK(writer.ok(), "a header that is read can be written");
  std::vector<uint8_t> out = writer->front();
  for (size_t i = 0; i < frames.size(); ++i) {
    const auto bytes = writer->add(reader.time_s(i), frames[i]);
    VOXELD_CHECK(bytes.ok(), "a frame that is read can be written");
    out.insert(out.end(), bytes->begin(), bytes->end());
  }
  const auto end = writer->finish();
  VOXELD_CHECK(end.ok(), "frames that are read can be written");
  out.insert(out.end(), end->index.begin(), end->index.end());
  std::copy(end->header.begin(), end->header.end(), out.begin());
  const auto again = SequenceReader::open(out);
  VOXELD_CHECK(again.ok(), "what is written can be read");
  for (size_t i = 0; i < frames.size(); ++i) {
    const auto tiles = again->decode_frame(i);
    VOXELD_CHECK(tiles.ok() && *tiles == frames[i], "a frame comes back");
  }
}

void container(Bytes bytes) {
  const auto reader = SequenceReader::open(bytes);
  if (!reader) {
    VOXELD_CHECK(reader.error().code == voxeld::ErrorCode::kBadRequest, "input is a bad request");
    return;
  }
  std::vector<std::vector<voxeld::SparseTile>> frames;
  voxeld::RawStreams streams;
  for (size_t i = 0; i < std::min(reader->frame_count(), kFramesRead); ++i) {
    auto tiles = reader->decode_frame(i, &streams);
    const auto alone = reader->decode_frame(i);
    VOXELD_CHECK(tiles.ok() == alone.ok(), "a frame is read alone as after others");
    if (!tiles) {
      VOXELD_CHECK(tiles.error().code == voxeld::ErrorCode::kBadRequest, "input is a bad request");
      return;
    }
    VOXELD_CHECK(*tiles == *alone, "a frame is the same alone and after others");
    frames.push_back(*std::move(tiles));
  }
  write_again(*reader, frames);
}

void container_of_its_length(Bytes bytes) {
  std::vector<uint8_t> fixed(bytes.begin(), bytes.end());
  const uint64_t length = fixed.size();
  if (length >= voxeld::kSequenceHeaderBytes) {
    std::memcpy(fixed.data() + 96, &length, sizeof length);
  }
  container(fixed);
}

// Four bytes a voxel: frame, x, y, z; attributes are made from them.
void cells(Bytes bytes) {
  std::vector<std::vector<voxeld::test::TestVoxel>> voxels(8);
  for (; bytes.size() >= 4; bytes = bytes.subspan(4)) {
    auto& voxel = voxels[bytes[0] % voxels.size()].emplace_back();
    voxel.cell = {bytes[1], bytes[2] * 2, bytes[3] / 8};
    voxel.color = {bytes[1], bytes[2], bytes[3], 255};
    voxel.label = bytes[1];
  }
  std::vector<voxeld::Grid> grids;
  for (const auto& frame : voxels) {
    grids.push_back(voxeld::test::grid_of({256, 512, 32}, frame, {.color = true, .label = true}));
  }
  const auto written = voxeld::test::sequence_bytes(grids);
  VOXELD_CHECK(written.ok(), "frames can be written");
  const auto reader = SequenceReader::open(*written);
  VOXELD_CHECK(reader.ok(), "what is written can be read");
  for (size_t i = grids.size(); i-- > 0;) {
    const auto tiles = reader->decode_frame(i);
    VOXELD_CHECK(tiles.ok() && *tiles == grids[i].tiles, "a frame comes back");
  }
}

// A frame whose streams are taken over: what can be decoded must come back, and what is refused can
// not be decoded.
void stored(Bytes bytes) {
  const auto reader = voxeld::GridReader::open(bytes);
  if (!reader || reader->header().codecs != voxeld::StreamCodecs()) return;
  std::vector<voxeld::StoredTile> tiles;
  for (size_t i = 0; i < reader->tile_count(); ++i) {
    tiles.push_back(voxeld::stored_tile(bytes, *reader, i));
  }
  auto writer = voxeld::SequenceWriter::open(reader->header(), 24);
  VOXELD_CHECK(writer.ok() && writer->begin_frame(0), "a header that is read can be written");
  std::vector<uint8_t> out = writer->front();
  const auto added = writer->add_stored(tiles);
  const auto decoded = reader->decode_tiles();
  if (!added) {
    VOXELD_CHECK(added.error().code == voxeld::ErrorCode::kBadRequest, "input is a bad request");
    VOXELD_CHECK(!decoded, "what is refused cannot be decoded");
    return;
  }
  writer->end_frame();
  const auto end = writer->finish();
  VOXELD_CHECK(end.ok(), "a frame can be written");
  out.insert(out.end(), added->begin(), added->end());
  out.insert(out.end(), end->index.begin(), end->index.end());
  std::copy(end->header.begin(), end->header.end(), out.begin());
  const auto again = SequenceReader::open(out);
  VOXELD_CHECK(again.ok(), "what is written can be read");
  const auto back = again->decode_frame(0);
  VOXELD_CHECK(back.ok() == decoded.ok(), "a frame is read as its container");
  if (back) VOXELD_CHECK(*back == *decoded, "a frame comes back");
}

void stored_of_its_length(Bytes bytes) {
  std::vector<uint8_t> fixed(bytes.begin(), bytes.end());
  const uint64_t length = fixed.size();
  if (length >= voxeld::kGridHeaderBytes) std::memcpy(fixed.data() + 96, &length, sizeof length);
  stored(fixed);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  const Bytes rest(data + 1, size - 1);
  switch (data[0] % 5) {
    case 0:
      container(rest);
      break;
    case 1:
      container_of_its_length(rest);
      break;
    case 2:
      cells(rest);
      break;
    case 3:
      stored(rest);
      break;
    default:
      stored_of_its_length(rest);
  }
  return 0;
}
