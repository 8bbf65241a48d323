//   0   "glTF", u32 2, u32 bytes of the file
//   12  u32 bytes, "JSON", text, padded with blanks to 4 bytes
//   ..  u32 bytes, "BIN\0", arrays, each padded with zeros to 4 bytes
//
// Compressed arrays lie in buffer 0, the chunk. Their views refer to buffer 1, which has no bytes:
// it is the buffer that a reader without the extension would need.
#include "server/formats/mesh/glb_file.h"

#include <meshoptimizer.h>

#include <array>
#include <cstring>
#include <limits>
#include <string>
#include <string_view>
#include <utility>

#include "server/base/cancel_point.h"
#include "server/base/parallel.h"

namespace voxeld::mesh {
namespace {

using nlohmann::json;

constexpr uint64_t kFileBytesMax = std::numeric_limits<uint32_t>::max();
constexpr size_t kPadding = 4;
constexpr size_t kHeaderBytes = 12, kChunkHeaderBytes = 8;
constexpr int kTargetVertices = 34962, kTargetIndices = 34963;
constexpr const char* kMeshopt = "EXT_meshopt_compression";
// Versions of the encodings that the extension specifies.
constexpr int kVertexVersion = 0, kIndexVersion = 1;

uint64_t padded(uint64_t bytes) {
  return (bytes + kPadding - 1) / kPadding * kPadding;
}

void put_u32(std::vector<uint8_t>& out, uint64_t value) {
  for (int i = 0; i < 4; ++i) out.push_back(static_cast<uint8_t>(value >> (8 * i)));
}

void put_text(std::vector<uint8_t>& out, std::string_view text) {
  out.insert(out.end(), text.begin(), text.end());
}

template <typename Index>
std::vector<uint8_t> compressed_indices(const std::vector<uint8_t>& bytes, size_t vertices) {
  std::vector<Index> indices(bytes.size() / sizeof(Index));
  std::memcpy(indices.data(), bytes.data(), bytes.size());
  std::vector<uint8_t> out(meshopt_encodeIndexBufferBound(indices.size(), vertices));
  out.resize(meshopt_encodeIndexBuffer(out.data(), out.size(), indices.data(), indices.size()));
  return out;
}

}  // namespace

int GlbBuffer::add(MeshRows rows, size_t element_bytes, Use use, json accessor) {
  accessor["bufferView"] = arrays_.size();
  accessors_.push_back(std::move(accessor));
  arrays_.push_back({std::move(rows), element_bytes, use});
  return static_cast<int>(arrays_.size()) - 1;
}

void GlbBuffer::compress(Array& array) const {
  std::vector<uint8_t> bytes(array.rows.bytes());
  parallel_for(array.rows.piece_count(), [&](size_t i) {
    cancel_point();
    array.rows.fill(i,
                    std::span(bytes).subspan(array.rows.piece_begin(i), array.rows.piece_bytes(i)));
  });
  const size_t elements = bytes.size() / array.element_bytes;
  if (array.use == Use::kIndices) {
    const size_t vertices = elements;  // an upper limit, which only sizes a buffer
    array.compressed = array.element_bytes == sizeof(uint16_t)
                           ? compressed_indices<uint16_t>(bytes, vertices)
                           : compressed_indices<uint32_t>(bytes, vertices);
    return;
  }
  array.compressed.resize(meshopt_encodeVertexBufferBound(elements, array.element_bytes));
  array.compressed.resize(meshopt_encodeVertexBuffer(array.compressed.data(),
                                                     array.compressed.size(), bytes.data(),
                                                     elements, array.element_bytes));
}

uint64_t GlbBuffer::stored_bytes(const Array& array) const {
  return is_compressed_ ? array.compressed.size() : array.rows.bytes();
}

void GlbBuffer::describe(json& document) {
  if (is_compressed_) {
    meshopt_encodeVertexVersion(kVertexVersion);
    meshopt_encodeIndexVersion(kIndexVersion);
    parallel_for(arrays_.size(), [&](size_t i) { compress(arrays_[i]); });
  }
  json views = json::array();
  uint64_t plain_bytes = 0;  // of the buffer that compressed arrays stand for
  for (const Array& array : arrays_) {
    const uint64_t bytes = array.rows.bytes();
    json view = {{"buffer", is_compressed_ ? 1 : 0},
                 {"byteOffset", is_compressed_ ? plain_bytes : bytes_},
                 {"byteLength", bytes}};
    if (array.use == Use::kVertices) {
      view["target"] = kTargetVertices;
      view["byteStride"] = array.element_bytes;
    }
    if (array.use == Use::kIndices) view["target"] = kTargetIndices;
    if (is_compressed_) {
      view["extensions"][kMeshopt] = {
          {"buffer", 0},
          {"byteOffset", bytes_},
          {"byteLength", stored_bytes(array)},
          {"byteStride", array.element_bytes},
          {"count", bytes / array.element_bytes},
          {"mode", array.use == Use::kIndices ? "TRIANGLES" : "ATTRIBUTES"}};
    }
    views.push_back(std::move(view));
    bytes_ += padded(stored_bytes(array));
    plain_bytes += padded(bytes);
  }
  document["buffers"] = json::array({{{"byteLength", bytes_}}});
  if (is_compressed_) {
    json plain = {{"byteLength", plain_bytes}};
    plain["extensions"][kMeshopt] = {{"fallback", true}};
    document["buffers"].push_back(std::move(plain));
    document["extensionsUsed"].push_back(kMeshopt);
    document["extensionsRequired"].push_back(kMeshopt);
  }
  document["bufferViews"] = std::move(views);
  document["accessors"] = accessors_;
}

Status GlbBuffer::write(const json& document, OutputFile& file) const {
  std::string text = document.dump(-1, ' ', false, json::error_handler_t::replace);
  text.resize(padded(text.size()), ' ');
  const bool has_chunk = bytes_ > 0;
  const uint64_t bytes =
      kHeaderBytes + kChunkHeaderBytes + text.size() + (has_chunk ? kChunkHeaderBytes + bytes_ : 0);
  if (bytes > kFileBytesMax) {
    return Error{ErrorCode::kGridTooLarge, "glb: too many faces for the file's 32-bit length",
                 "at most " + std::to_string(kFileBytesMax) + " bytes", std::to_string(bytes)};
  }
  std::vector<uint8_t> head;
  put_text(head, "glTF");
  put_u32(head, 2);
  put_u32(head, bytes);
  put_u32(head, text.size());
  put_text(head, "JSON");
  put_text(head, text);
  if (has_chunk) {
    put_u32(head, bytes_);
    put_text(head, std::string_view("BIN\0", 4));
  }
  VOXELD_TRY(file.append(head));
  for (const Array& array : arrays_) {
    VOXELD_TRY(is_compressed_ ? file.append(array.compressed) : append_pieces(file, array.rows));
    const std::array<uint8_t, kPadding> zeros{};
    const uint64_t stored = stored_bytes(array);
    VOXELD_TRY(file.append(std::span(zeros).first(padded(stored) - stored)));
  }
  return {};
}

}  // namespace voxeld::mesh
