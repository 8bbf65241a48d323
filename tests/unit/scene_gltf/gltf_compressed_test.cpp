// Files whose data is compressed: EXT_meshopt_compression and KHR_draco_mesh_compression, made here
// with the encoders of both libraries.
#include <draco/compression/encode.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "tests/unit/scene_gltf/gltf_builder.h"

namespace voxeld {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

constexpr uint32_t kSide = 12;  // vertices along a side of the surface

// A wavy surface with two triangles for each cell.
struct Surface {
  std::vector<float> positions, uvs;
  std::vector<uint8_t> colors;
  std::vector<uint32_t> indices;
  size_t vertex_count() const { return positions.size() / 3; }
};

Surface surface() {
  Surface out;
  for (uint32_t y = 0; y < kSide; ++y) {
    for (uint32_t x = 0; x < kSide; ++x) {
      const auto fx = static_cast<float>(x), fy = static_cast<float>(y);
      out.positions.insert(out.positions.end(), {fx, fy, std::sin(fx) * 0.75f + 0.1f * fy});
      out.uvs.insert(out.uvs.end(), {fx / kSide, fy / kSide});
      out.colors.insert(out.colors.end(), {static_cast<uint8_t>(x * 20), static_cast<uint8_t>(y),
                                           static_cast<uint8_t>(200 - y), 255});
    }
  }
  for (uint32_t y = 0; y + 1 < kSide; ++y) {
    for (uint32_t x = 0; x + 1 < kSide; ++x) {
      const uint32_t a = y * kSide + x, b = a + 1, c = a + kSide, d = c + 1;
      out.indices.insert(out.indices.end(), {a, b, c, c, b, d});
    }
  }
  return out;
}

// The corners of every triangle, from the smallest on in the same turn: encoders rotate triangles,
// and renumber and reorder what they may.
using Corners = std::array<std::array<double, 3>, 3>;
std::vector<Corners> triangles_of(const Scene& scene) {
  std::vector<Corners> out;
  for (const MeshPart& part : scene.parts) {
    for (size_t i = 0; i + 2 < part.indices.size(); i += 3) {
      Corners corners;
      for (size_t c = 0; c < 3; ++c) {
        const glm::dvec3& p = part.positions[part.indices[i + c]];
        corners[c] = {p.x, p.y, p.z};
      }
      std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
      out.push_back(corners);
    }
  }
  std::sort(out.begin(), out.end());
  return out;
}

GltfBuilder plain(const Surface& from) {
  GltfBuilder builder;
  builder.attributes()["POSITION"] = builder.add_floats(from.positions, "VEC3");
  builder.primitive()["indices"] =
      builder.add_accessor(bytes_of(from.indices), 5125, "SCALAR", from.indices.size());
  return builder;
}

// --- meshopt

struct Stream {
  std::string mode;
  size_t count = 0, stride = 0;
  std::string filter = {};
};

// Replaces the data of `accessor` by `stream`; its view then is one of a buffer without data.
void compress(GltfBuilder& builder, int accessor, const Bytes& stream, const Stream& kind,
              const char* extension = "EXT_meshopt_compression") {
  const int compressed = builder.add_view(stream);
  Json& view =
      builder.json["bufferViews"][builder.json["accessors"][accessor]["bufferView"].get<int>()];
  const Json from = builder.json["bufferViews"][compressed];
  builder.json["bufferViews"].erase(compressed);
  Json& to = view["extensions"][extension];
  to = Json{{"buffer", 0},
            {"byteOffset", from["byteOffset"]},
            {"byteLength", from["byteLength"]},
            {"byteStride", kind.stride},
            {"count", kind.count},
            {"mode", kind.mode}};
  if (!kind.filter.empty()) to["filter"] = kind.filter;
  view["buffer"] = 1;
  view["byteOffset"] = 0;
  view["byteLength"] = kind.stride * kind.count;
}

Bytes vertex_stream(const void* data, size_t count, size_t stride) {
  meshopt_encodeVertexVersion(0);
  Bytes out(meshopt_encodeVertexBufferBound(count, stride));
  out.resize(meshopt_encodeVertexBuffer(out.data(), out.size(), data, count, stride));
  return out;
}

Bytes triangle_stream(const Surface& from) {
  meshopt_encodeIndexVersion(1);
  Bytes out(meshopt_encodeIndexBufferBound(from.indices.size(), from.vertex_count()));
  out.resize(
      meshopt_encodeIndexBuffer(out.data(), out.size(), from.indices.data(), from.indices.size()));
  return out;
}

Bytes index_stream(const Surface& from) {
  Bytes out(meshopt_encodeIndexSequenceBound(from.indices.size(), from.vertex_count()));
  out.resize(meshopt_encodeIndexSequence(out.data(), out.size(), from.indices.data(),
                                         from.indices.size()));
  return out;
}

// Accessor 0: positions, 1: indices.
GltfBuilder meshopt(const Surface& from, const char* index_mode = "TRIANGLES") {
  GltfBuilder builder = plain(from);
  const bool are_triangles = std::string(index_mode) == "TRIANGLES";
  compress(builder, 0, vertex_stream(from.positions.data(), from.vertex_count(), 12),
           {"ATTRIBUTES", from.vertex_count(), 12});
  compress(builder, 1, are_triangles ? triangle_stream(from) : index_stream(from),
           {index_mode, from.indices.size(), 4});
  builder.json["extensionsUsed"] = {"EXT_meshopt_compression"};
  builder.json["extensionsRequired"] = {"EXT_meshopt_compression"};
  return builder;
}

// As a GLB, whose second buffer has no data.
Result<Scene> load_with_fallback(const GltfBuilder& builder) {
  GltfBuilder copy = builder;
  const Bytes bin = copy.bin;
  FakeBundle bundle;
  bundle.files["a.bin"] = bin;
  copy.json["buffers"] =
      Json::array({Json{{"byteLength", bin.size()}, {"uri", "a.bin"}},
                   Json{{"byteLength", 1 << 20},
                        {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}}});
  return copy.load(&bundle);
}

TEST(MeshoptGltf, every_mode_gives_the_triangles_of_the_plain_file) {
  const Surface from = surface();
  const auto expected = triangles_of(*plain(from).load());
  ASSERT_EQ(expected.size(), 2u * (kSide - 1) * (kSide - 1));
  for (const char* mode : {"TRIANGLES", "INDICES"}) {
    const auto scene = load_with_fallback(meshopt(from, mode));
    ASSERT_EQ(outcome(scene), "ok") << mode;
    EXPECT_EQ(triangles_of(*scene), expected) << mode;
    EXPECT_THAT(warnings(*scene), IsEmpty()) << mode;
  }
}

TEST(MeshoptGltf, the_newer_name_of_the_extension_is_read_too) {
  const Surface from = surface();
  GltfBuilder builder = plain(from);
  compress(builder, 0, vertex_stream(from.positions.data(), from.vertex_count(), 12),
           {"ATTRIBUTES", from.vertex_count(), 12}, "KHR_meshopt_compression");
  const auto scene = load_with_fallback(builder);
  ASSERT_EQ(outcome(scene), "ok");
  EXPECT_EQ(triangles_of(*scene), triangles_of(*plain(from).load()));
}

TEST(MeshoptGltf, filters_are_undone) {
  const Surface from = surface();
  std::vector<float> normals, padded_positions;
  for (size_t i = 0; i < from.vertex_count(); ++i) {
    const float angle = static_cast<float>(i) * 0.1f;
    normals.insert(normals.end(), {std::cos(angle), std::sin(angle), 0.0f, 0.0f});
  }
  std::vector<int8_t> octahedral(from.vertex_count() * 4);
  meshopt_encodeFilterOct(octahedral.data(), from.vertex_count(), 4, 8, normals.data());
  std::vector<uint32_t> exponential(from.positions.size());
#if MESHOPTIMIZER_VERSION >= 200
  meshopt_encodeFilterExp(exponential.data(), from.vertex_count(), 12, 20, from.positions.data(),
                          meshopt_EncodeExpSharedVector);
#else
  meshopt_encodeFilterExp(exponential.data(), from.vertex_count(), 12, 20, from.positions.data());
#endif
  GltfBuilder builder = plain(from);
  const int normal =
      builder.add_accessor(Bytes(octahedral.size()), 5120, "VEC3", from.vertex_count());
  builder.json["accessors"][normal]["normalized"] = true;
  builder.json["bufferViews"].back()["byteStride"] = 4;
  builder.attributes()["NORMAL"] = normal;
  compress(builder, normal, vertex_stream(octahedral.data(), from.vertex_count(), 4),
           {"ATTRIBUTES", from.vertex_count(), 4, "OCTAHEDRAL"});
  compress(builder, 0, vertex_stream(exponential.data(), from.vertex_count(), 12),
           {"ATTRIBUTES", from.vertex_count(), 12, "EXPONENTIAL"});
  const auto scene = load_with_fallback(builder);
  ASSERT_EQ(outcome(scene), "ok");
  const auto expected = plain(from).load();
  const MeshPart &part = scene->parts[0], &wanted = expected->parts[0];
  ASSERT_EQ(part.indices, wanted.indices);
  for (size_t i = 0; i < part.positions.size(); ++i) {
    EXPECT_LT(glm::distance(part.positions[i], wanted.positions[i]), 1e-4) << i;
  }
  for (size_t corner = 0; corner < part.indices.size(); ++corner) {
    const uint32_t vertex = from.indices[corner];
    const glm::vec3 normal_of_file(normals[4 * vertex], normals[4 * vertex + 1], 0.0f);
    EXPECT_LT(glm::distance(glm::vec3(part.normals[part.indices[corner]]), normal_of_file), 0.02f);
  }
}

TEST(MeshoptGltf, errors_name_the_view) {
  const std::string where = "a.gltf bufferViews[0].extensions.EXT_meshopt_compression: ";
  const auto expect = [&](const std::function<void(Json&)>& change, const std::string& error) {
    GltfBuilder builder = meshopt(surface());
    change(builder.json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"]);
    EXPECT_EQ(outcome(load_with_fallback(builder)), error);
  };
  const std::string malformed = "malformed-mesh: " + where,
                    unread = "unsupported-feature: " + where;
  expect([](Json& e) { e["mode"] = "LINES"; },
         unread + "mode: expected ATTRIBUTES, TRIANGLES or INDICES, got \"LINES\"");
  expect([](Json& e) { e["filter"] = "COLOR"; },
         unread + "filter: expected NONE, OCTAHEDRAL, QUATERNION or EXPONENTIAL, got \"COLOR\"");
  expect([](Json& e) { e["filter"] = "QUATERNION"; },
         malformed + "byteStride of filter QUATERNION: expected a multiple of 8 up to 8, got 12");
  expect([](Json& e) { e["byteStride"] = 10; },
         malformed + "byteStride of mode ATTRIBUTES: expected a multiple of 4 up to 256, got 10");
  expect([](Json& e) { e["byteStride"] = 0; },
         malformed + "byteStride of mode ATTRIBUTES: expected a multiple of 4 up to 256, got 0");
  expect([](Json& e) { e["mode"] = "TRIANGLES"; },
         malformed + "byteStride of mode TRIANGLES: expected a multiple of 2 up to 4, got 12");
  expect([](Json& e) { e["count"] = 143; },
         malformed + "count times byteStride: expected 1728 as byteLength of the view, got 1716");
  expect([](Json& e) { e["byteLength"] = 50; }, malformed + "the stream is damaged");
  expect([](Json& e) { e["byteLength"] = 5; },
         malformed +
             "the stream is too short for its count: expected at least 24 bytes, got 5 "
             "bytes");
  expect([](Json& e) { e["byteOffset"] = 1 << 30; },
         malformed + "the range lies outside of buffers[0]: expected at most " +
             std::to_string(meshopt(surface()).bin.size()) + " bytes, got " +
             std::to_string(vertex_stream(surface().positions.data(), 144, 12).size()) +
             " bytes from byte 1073741824");
  expect([](Json& e) { e.erase("mode"); },
         "malformed-mesh: a.gltf bufferViews[0].extensions.EXT_meshopt_compression.mode: is "
         "missing: expected a string, got nothing");
}

TEST(MeshoptGltf, a_count_without_the_bytes_for_it_allocates_nothing) {
  GltfBuilder builder = meshopt(surface());
  Json& view = builder.json["bufferViews"][0];
  view["byteLength"] = 12'000'000'000;
  view["extensions"]["EXT_meshopt_compression"]["count"] = 1'000'000'000;
  EXPECT_THAT(outcome(load_with_fallback(builder)),
              HasSubstr("bytes of all compressed data, decoded: expected at most 4294967296"));
  view["byteLength"] = 3'600'000'000;
  view["extensions"]["EXT_meshopt_compression"]["count"] = 300'000'000;
  EXPECT_THAT(outcome(load_with_fallback(builder)),
              HasSubstr("the stream is too short for its count: expected at least 56250000 bytes"));
}

TEST(MeshoptGltf, a_view_without_the_extension_has_no_data_in_such_a_buffer) {
  GltfBuilder builder = meshopt(surface());
  builder.json["bufferViews"][0].erase("extensions");
  EXPECT_EQ(outcome(load_with_fallback(builder)),
            "malformed-mesh: a.gltf buffers[1]: only views with EXT_meshopt_compression have data "
            "here: expected a view with the extension, got a view without it");
}

TEST(MeshoptGltf, a_newer_stream_is_named) {
  GltfBuilder builder = meshopt(surface());
  const size_t at =
      builder.json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"]["byteOffset"];
  builder.bin[at] = 0xaf;
  EXPECT_EQ(outcome(load_with_fallback(builder)),
            "unsupported-feature: a.gltf bufferViews[0].extensions.EXT_meshopt_compression: "
            "version of the stream: expected one that libmeshoptimizer reads, got first byte 175");
}

// --- Draco

struct DracoStream {
  Bytes bytes;
  std::map<std::string, int> ids;
  size_t point_count = 0;
};

DracoStream draco_stream(const Surface& from, int method, int position_bits) {
  draco::Mesh mesh;
  const auto points = static_cast<uint32_t>(from.vertex_count());
  mesh.set_num_points(points);
  mesh.SetNumFaces(from.indices.size() / 3);
  for (uint32_t i = 0; i < mesh.num_faces(); ++i) {
    mesh.SetFace(draco::FaceIndex(i), {draco::PointIndex(from.indices[3 * i]),
                                       draco::PointIndex(from.indices[3 * i + 1]),
                                       draco::PointIndex(from.indices[3 * i + 2])});
  }
  const auto add = [&](draco::GeometryAttribute::Type type, draco::DataType data_type,
                       bool normalized, const auto& values) {
    using T = std::decay_t<decltype(values[0])>;
    const auto components = static_cast<int8_t>(values.size() / points);
    draco::GeometryAttribute attribute;
    attribute.Init(type, nullptr, static_cast<uint8_t>(components), data_type, normalized,
                   static_cast<int64_t>(sizeof(T)) * components, 0);
    const int id = mesh.AddAttribute(attribute, true, points);
    for (uint32_t i = 0; i < points; ++i) {
      mesh.attribute(id)->SetAttributeValue(draco::AttributeValueIndex(i),
                                            &values[size_t{i} * static_cast<size_t>(components)]);
    }
    return static_cast<int>(mesh.attribute(id)->unique_id());
  };
  DracoStream out;
  out.ids["POSITION"] =
      add(draco::GeometryAttribute::POSITION, draco::DT_FLOAT32, false, from.positions);
  out.ids["TEXCOORD_0"] =
      add(draco::GeometryAttribute::TEX_COORD, draco::DT_FLOAT32, false, from.uvs);
  out.ids["COLOR_0"] = add(draco::GeometryAttribute::COLOR, draco::DT_UINT8, true, from.colors);
  draco::Encoder encoder;
  encoder.SetEncodingMethod(method);
  encoder.SetSpeedOptions(method == draco::MESH_SEQUENTIAL_ENCODING ? 10 : 3, 3);
  if (position_bits > 0) {
    encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, position_bits);
  }
  encoder.SetTrackEncodedProperties(true);
  draco::EncoderBuffer buffer;
  EXPECT_TRUE(encoder.EncodeMeshToBuffer(mesh, &buffer).ok());
  out.bytes.assign(buffer.data(), buffer.data() + buffer.size());
  out.point_count = encoder.num_encoded_points();
  return out;
}

// Accessors 0 to 2: positions, texture coordinates and colours; 3: indices.
GltfBuilder draco_file(const Surface& from, const DracoStream& stream) {
  GltfBuilder builder;
  const int view = builder.add_view(stream.bytes);
  Json& accessors = builder.json["accessors"];
  const auto add = [&](const char* name, int component_type, const char* type) {
    builder.attributes()[name] = accessors.size();
    accessors.push_back(
        Json{{"componentType", component_type}, {"count", stream.point_count}, {"type", type}});
  };
  add("POSITION", 5126, "VEC3");
  add("TEXCOORD_0", 5126, "VEC2");
  add("COLOR_0", 5121, "VEC4");
  builder.primitive()["indices"] = accessors.size();
  accessors.push_back(
      Json{{"componentType", 5123}, {"count", from.indices.size()}, {"type", "SCALAR"}});
  builder.primitive()["extensions"]["KHR_draco_mesh_compression"] =
      Json{{"bufferView", view}, {"attributes", stream.ids}};
  builder.json["extensionsUsed"] = {"KHR_draco_mesh_compression"};
  builder.json["extensionsRequired"] = {"KHR_draco_mesh_compression"};
  return builder;
}

GltfBuilder sequential() {
  const Surface from = surface();
  return draco_file(from, draco_stream(from, draco::MESH_SEQUENTIAL_ENCODING, 0));
}

GltfBuilder edgebreaker() {
  const Surface from = surface();
  return draco_file(from, draco_stream(from, draco::MESH_EDGEBREAKER_ENCODING, 16));
}

TEST(DracoGltf, without_quantization_the_triangles_are_those_of_the_plain_file) {
  const auto scene = sequential().load();
  ASSERT_EQ(outcome(scene), "ok");
  EXPECT_THAT(warnings(*scene), IsEmpty());
  EXPECT_EQ(triangles_of(*scene), triangles_of(*plain(surface()).load()));
}

TEST(DracoGltf, with_edgebreaker_and_quantization_they_are_close_to_them) {
  const auto scene = edgebreaker().load();
  ASSERT_EQ(outcome(scene), "ok");
  ASSERT_EQ(scene->triangle_count(), 2 * (kSide - 1) * (kSide - 1));
  // Each vertex of the file is found by its cell, with its colour.
  std::vector<int> found(size_t{kSide} * kSide);
  const MeshPart& part = scene->parts[0];
  const Surface from = surface();
  for (size_t i = 0; i < part.positions.size(); ++i) {
    const glm::dvec3& p = part.positions[i];
    const auto vertex = static_cast<size_t>(std::lround(p.y) * kSide + std::lround(p.x));
    ASSERT_LT(vertex, found.size());
    ++found[vertex];
    const glm::dvec3 wanted(from.positions[3 * vertex], from.positions[3 * vertex + 1],
                            from.positions[3 * vertex + 2]);
    EXPECT_LT(glm::distance(p, wanted), 1e-3) << vertex;
    for (int c = 0; c < 4; ++c) {
      EXPECT_FLOAT_EQ(part.colors[i][c],
                      static_cast<float>(from.colors[4 * vertex + static_cast<size_t>(c)]) / 255.0f)
          << vertex;
    }
  }
  EXPECT_EQ(std::count(found.begin(), found.end(), 1), kSide * kSide);
}

TEST(DracoGltf, two_nodes_and_two_primitives_share_a_stream) {
  GltfBuilder builder = sequential();
  Json& primitives = builder.json["meshes"][0]["primitives"];
  const Json first = primitives[0];
  primitives.push_back(first);
  builder.json["nodes"].push_back(Json{{"mesh", 0}, {"translation", {0, 0, 5}}});
  builder.json["scenes"][0]["nodes"] = {0, 1};
  const auto scene = builder.load();
  ASSERT_EQ(outcome(scene), "ok");
  EXPECT_EQ(scene->triangle_count(), 4 * 2 * (kSide - 1) * (kSide - 1));
}

TEST(DracoGltf, errors_say_what_the_accessors_and_the_stream_have) {
  const std::string where = "a.gltf meshes[0].primitives[0].extensions.KHR_draco_mesh_compression";
  const auto expect = [&](const std::function<void(GltfBuilder&)>& change,
                          const std::string& error) {
    GltfBuilder builder = sequential();
    change(builder);
    EXPECT_EQ(outcome(builder.load()), error);
  };
  const std::string malformed = "malformed-mesh: " + where;
  expect([](GltfBuilder& b) { b.json["accessors"][3]["count"] = 3; },
         malformed + ": triangles of the Draco stream: expected 1 as the accessors have, got 242");
  expect([](GltfBuilder& b) { b.json["accessors"][0]["count"] = 143; },
         malformed + ": points of the Draco stream: expected 143 as the accessors have, got 144");
  expect([](GltfBuilder& b) { b.json["accessors"][2]["count"] = 145; },
         "malformed-mesh: a.gltf accessors[2].count: elements of the Draco stream: expected 144, "
         "got 145");
  expect([](GltfBuilder& b) { b.json["accessors"][3]["count"] = 728; },
         "malformed-mesh: a.gltf accessors[3].count: elements of the Draco stream: expected 726, "
         "got 728");
  expect([](GltfBuilder& b) { b.json["accessors"][2]["type"] = "VEC3"; },
         malformed +
             ".attributes.COLOR_0: components of the attribute: expected 3 as the accessor "
             "has, got 4");
  expect(
      [](GltfBuilder& b) {
        b.primitive()["extensions"]["KHR_draco_mesh_compression"]["attributes"]["COLOR_0"] = 7;
      },
      malformed +
          ".attributes.COLOR_0: the Draco stream has no such attribute: expected 3 "
          "attributes, got 7");
  expect([](GltfBuilder& b) { b.primitive()["mode"] = 5; },
         "unsupported-feature: a.gltf meshes[0].primitives[0].mode: mode of a primitive with a "
         "Draco stream: expected 4 (triangles), got 5");
  expect([](GltfBuilder& b) { b.primitive().erase("indices"); },
         "malformed-mesh: a.gltf meshes[0].primitives[0]: a Draco stream stands for indices and "
         "POSITION: expected both, got one is missing");
  expect([](GltfBuilder& b) { b.bin[0] = 'X'; }, malformed + ": the data is no Draco stream");
  expect([](GltfBuilder& b) { b.bin[6] = 1; },
         "unsupported-feature: " + where +
             ": version of the Draco bitstream: expected 2.2, got "
             "2.1");
  expect([](GltfBuilder& b) { b.bin[7] = 0; },
         malformed + ": geometry of the Draco stream: expected a mesh, got a point cloud");
  expect([](GltfBuilder& b) { b.json["bufferViews"][0]["byteLength"] = 11; },
         malformed + ": the Draco stream is cut off");
}

TEST(DracoGltf, counts_that_only_the_stream_claims_are_refused_before_it_is_decoded) {
  GltfBuilder builder = edgebreaker();
  // A stream of a few bytes: edgebreaker, standard traversal, 1 point and 2^28 triangles.
  const Bytes claims = {'D', 'R', 'A', 'C', 'O',  2,    2,    1,    1,
                        0,   0,   0,   1,   0x80, 0x80, 0x80, 0x80, 0x01};
  std::copy(claims.begin(), claims.end(), builder.bin.begin());
  EXPECT_THAT(outcome(builder.load()),
              HasSubstr("triangles of the Draco stream: expected 242 as the accessors have, got "
                        "268435456"));
}

// No damage may crash the decoders or this program; most is noticed.
TEST(CompressedGltf, damaged_streams_are_errors_or_other_geometry) {
  for (const auto& [name, builder] :
       {std::pair("sequential", sequential()), std::pair("edgebreaker", edgebreaker()),
        std::pair("meshopt", meshopt(surface()))}) {
    int refused = 0;
    for (size_t at = 0; at < builder.bin.size(); at += 1 + at / 64) {
      for (const int change : {0x01, 0x80, 0xff}) {
        GltfBuilder damaged = builder;
        damaged.bin[at] = static_cast<uint8_t>(damaged.bin[at] ^ change);
        const auto scene = load_with_fallback(damaged);
        if (scene) continue;
        ++refused;
        EXPECT_THAT(outcome(scene),
                    testing::AnyOf(StartsWith("malformed-mesh"), StartsWith("unsupported-feature"),
                                   StartsWith("empty-mesh")));
      }
    }
    EXPECT_GT(refused, 0) << name;
    for (size_t bytes = 0; bytes < builder.bin.size(); bytes += 1 + bytes / 32) {
      GltfBuilder cut = builder;
      Json& view = cut.json["bufferViews"][0];
      Json& length = view.contains("extensions")
                         ? view["extensions"]["EXT_meshopt_compression"]["byteLength"]
                         : view["byteLength"];
      if (length.get<size_t>() <= bytes) break;
      length = bytes;
      EXPECT_FALSE(load_with_fallback(cut)) << name << " cut to " << bytes << " bytes";
    }
  }
}

}  // namespace
}  // namespace voxeld
