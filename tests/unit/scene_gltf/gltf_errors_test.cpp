// Errors of broken glTF files: one table of {change, exact message}.
#include <gtest/gtest.h>

#include <cctype>
#include <functional>
#include <limits>

#include "tests/unit/scene_gltf/gltf_builder.h"

namespace voxeld {
namespace {

struct Case {
  const char* what;
  std::function<void(GltfBuilder&)> change;
  const char* outcome;
};

class GltfErrors : public ::testing::TestWithParam<Case> {};

TEST_P(GltfErrors, say_what_where_expected_and_got) {
  GltfBuilder builder = square();
  GetParam().change(builder);
  EXPECT_EQ(outcome(builder.load()), GetParam().outcome);
}

const Case kSchemaCases[] = {
    {"no version", [](GltfBuilder& b) { b.json.erase("asset"); },
     "malformed-mesh: a.gltf asset.version: the file does not say its version: expected \"2.0\", "
     "got nothing"},
    {"glTF 1", [](GltfBuilder& b) { b.json["asset"]["version"] = "1.0"; },
     "unsupported-feature: a.gltf asset.version: version of glTF: expected 2.0, got \"1.0\""},
    {"newer glTF", [](GltfBuilder& b) { b.json["asset"]["minVersion"] = "2.1"; },
     "unsupported-feature: a.gltf asset.minVersion: version of glTF: expected 2.0, got \"2.1\""},
    {"required extension",
     [](GltfBuilder& b) { b.json["extensionsRequired"] = Json::array({"MPEG_media"}); },
     "unsupported-feature: a.gltf: the file requires the glTF extension \"MPEG_media\": expected "
     "extensions that voxeld reads: KHR_draco_mesh_compression, KHR_materials_*, "
     "KHR_mesh_quantization, KHR_texture_transform, EXT_mesh_gpu_instancing, "
     "EXT_meshopt_compression, EXT_texture_webp, got \"MPEG_media\""},
    {"array of a wrong type", [](GltfBuilder& b) { b.json["accessors"] = 3; },
     "malformed-mesh: a.gltf accessors: wrong value: expected an array, got 3"},
    {"element of a wrong type", [](GltfBuilder& b) { b.json["nodes"][0] = "x"; },
     "malformed-mesh: a.gltf nodes[0]: wrong value: expected an object, got \"x\""},
    {"negative index", [](GltfBuilder& b) { b.json["accessors"][0]["bufferView"] = -1; },
     "malformed-mesh: a.gltf accessors[0].bufferView: wrong value: expected an index of one of 2 "
     "bufferViews, got -1"},
    {"index too large", [](GltfBuilder& b) { b.json["nodes"][0]["mesh"] = 7; },
     "malformed-mesh: a.gltf nodes[0].mesh: wrong value: expected an index of one of 1 meshes, "
     "got 7"},
    {"index of 33 bits", [](GltfBuilder& b) { b.json["nodes"][0]["mesh"] = int64_t{1} << 32; },
     "malformed-mesh: a.gltf nodes[0].mesh: wrong value: expected an index of one of 1 meshes, "
     "got 4294967296"},
    {"attribute index", [](GltfBuilder& b) { b.attributes()["POSITION"] = 9; },
     "malformed-mesh: a.gltf meshes[0].primitives[0].attributes.POSITION: wrong value: expected "
     "an index of one of 2 accessors, got 9"},
    {"missing member", [](GltfBuilder& b) { b.json["accessors"][0].erase("count"); },
     "malformed-mesh: a.gltf accessors[0].count: is missing: expected an integer, got nothing"},
    {"negative offset", [](GltfBuilder& b) { b.json["bufferViews"][0]["byteOffset"] = -4; },
     "malformed-mesh: a.gltf bufferViews[0].byteOffset: wrong value: expected an integer from 0 "
     "to 2^53, got -4"},
    {"matrix of 3",
     [](GltfBuilder& b) {
       b.json["nodes"][0]["matrix"] = {1, 2, 3};
     },
     "malformed-mesh: a.gltf nodes[0].matrix: wrong count of numbers: expected 16, got 3"},
    {"hostile attribute name", [](GltfBuilder& b) { b.attributes()["\n"] = "x"; },
     "malformed-mesh: a.gltf meshes[0].primitives[0].attributes.\"\\x0a\": wrong value: expected "
     "an index of one of 2 accessors, got \"x\""},
};

const Case kRangeCases[] = {
    {"huge count", [](GltfBuilder& b) { b.json["accessors"][0]["count"] = 4'000'000'000; },
     "malformed-mesh: a.gltf accessors[0].count: elements of POSITION: expected at most "
     "600000000, got 4000000000"},
    {"count beyond the view", [](GltfBuilder& b) { b.json["accessors"][0]["count"] = 5; },
     "malformed-mesh: a.gltf accessors[0]: the elements lie outside of bufferViews[0]: expected "
     "at most 48 bytes, got 60 bytes from byte 0"},
    {"offset beyond the view",
     [](GltfBuilder& b) { b.json["accessors"][0]["byteOffset"] = int64_t{1} << 52; },
     "malformed-mesh: a.gltf accessors[0]: the elements lie outside of bufferViews[0]: expected "
     "at most 48 bytes, got 48 bytes from byte 4503599627370496"},
    {"view beyond the buffer",
     [](GltfBuilder& b) { b.json["bufferViews"][0]["byteLength"] = 1000; },
     "malformed-mesh: a.gltf bufferViews[0]: the range lies outside of buffers[0]: expected at "
     "most 60 bytes, got 1000 bytes from byte 0"},
    {"stride below an element", [](GltfBuilder& b) { b.json["bufferViews"][0]["byteStride"] = 8; },
     "malformed-mesh: a.gltf accessors[0]: byteStride is smaller than an element: expected at "
     "least 12, got 8"},
    {"odd stride", [](GltfBuilder& b) { b.json["bufferViews"][0]["byteStride"] = 7; },
     "malformed-mesh: a.gltf accessors[0]: byteStride is smaller than an element: expected at "
     "least 12, got 7"},
    {"long stride", [](GltfBuilder& b) { b.json["bufferViews"][0]["byteStride"] = 256; },
     "malformed-mesh: a.gltf bufferViews[0].byteStride: wrong value: expected 4 to 252, got 256"},
    {"unknown type", [](GltfBuilder& b) { b.json["accessors"][0]["type"] = "VEC5"; },
     "malformed-mesh: a.gltf accessors[0].type: wrong value: expected SCALAR, VEC2, VEC3, VEC4, "
     "MAT2, MAT3 or MAT4, got \"VEC5\""},
    {"unknown component type",
     [](GltfBuilder& b) { b.json["accessors"][0]["componentType"] = 5127; },
     "malformed-mesh: a.gltf accessors[0].componentType: component type of POSITION: expected "
     "5126, 5120, 5121, 5122 or 5123, got 5127"},
    {"index into nothing", [](GltfBuilder& b) { b.primitive()["material"] = 0; },
     "malformed-mesh: a.gltf meshes[0].primitives[0].material: wrong value: expected none, as "
     "there are no materials, got 0"},
    {"buffer shorter than said",
     [](GltfBuilder& b) {
       b.json["buffers"] = Json::array({Json{{"byteLength", 100}, {"uri", "data:,abc"}}});
     },
     "malformed-mesh: a.gltf buffers[0]: the data is shorter than byteLength: expected 100 bytes, "
     "got 3 bytes"},
    {"buffer that is not there",
     [](GltfBuilder& b) {
       b.json["buffers"] = Json::array({Json{{"byteLength", 60}, {"uri", "gone.bin"}}});
     },
     "malformed-mesh: a.gltf buffers[0].uri: the buffer's file is not in the upload: expected a "
     "zip with the mesh and its files, got \"gone.bin\""},
    {"buffer without data",
     [](GltfBuilder& b) {
       b.json["buffers"] = Json::array({Json{{"byteLength", 60}}});
     },
     "malformed-mesh: a.gltf buffers[0].uri: the buffer has no data: expected a uri, got nothing"},
    {"broken base64",
     [](GltfBuilder& b) {
       b.json["buffers"] = Json::array({Json{{"byteLength", 60}, {"uri", "data:x/y;base64,A*AA"}}});
     },
     "malformed-mesh: a.gltf buffers[0].uri: broken data URI: expected base64, got "
     "\"data:x/y;base64,A*AA\""},
    {"sparse index",
     [](GltfBuilder& b) {
       const int view = b.add_view({9, 0, 0, 0});
       const int values = b.add_view(Bytes(12));
       b.json["accessors"][0]["sparse"] =
           Json{{"count", 1},
                {"indices", {{"bufferView", view}, {"componentType", 5121}}},
                {"values", {{"bufferView", values}}}};
     },
     "malformed-mesh: a.gltf accessors[0].sparse.indices: index out of range: expected 0 to 3, "
     "got 9"},
    {"sparse accessor of nothing",
     [](GltfBuilder& b) {
       b.json["accessors"][0].erase("bufferView");
       b.json["accessors"][0]["count"] = 500'000'000;
       b.json["accessors"][0]["sparse"] =
           Json{{"count", 0},
                {"indices", {{"bufferView", 0}, {"componentType", 5121}}},
                {"values", {{"bufferView", 0}}}};
     },
     "malformed-mesh: a.gltf accessors[0].count: elements of POSITION without a bufferView: "
     "expected at most 16777216, got 500000000"},
    {"sparse accessors of many bytes",
     [](GltfBuilder& b) {
       const Json none{{"count", 0},
                       {"indices", {{"bufferView", 0}, {"componentType", 5121}}},
                       {"values", {{"bufferView", 0}}}};
       b.json["accessors"][0]["sparse"] = none;
       b.json["accessors"].push_back(
           Json{{"componentType", 5126}, {"count", 1 << 24}, {"type", "MAT4"}, {"sparse", none}});
       b.json["skins"] = Json::array({Json{{"joints", {0}}, {"inverseBindMatrices", 2}}});
       b.json["nodes"][0]["skin"] = 0;
       b.attributes()["JOINTS_0"] = b.add_u16(std::vector<uint16_t>(16), "VEC4");
       b.attributes()["WEIGHTS_0"] = b.add_floats(std::vector<float>(16, 0.25f), "VEC4");
     },
     "malformed-mesh: a.gltf accessors[2].sparse: bytes of all sparse accessors: expected at most "
     "1073741824, got more"},
};

const Case kMeshCases[] = {
    {"no positions", [](GltfBuilder& b) { b.attributes().erase("POSITION"); },
     "empty-mesh: a.gltf: the mesh is empty: expected at least one triangle, got 1 primitives "
     "without POSITION"},
    {"index out of range",
     [](GltfBuilder& b) {
       b.primitive()["indices"] = b.add_u16({0, 1, 4});
     },
     "malformed-mesh: a.gltf meshes[0].primitives[0].indices: index out of range: expected 0 to 3, "
     "got 4"},
    {"two corners",
     [](GltfBuilder& b) {
       b.primitive()["indices"] = b.add_u16({0, 1});
     },
     "empty-mesh: a.gltf: the mesh is empty: expected at least one triangle, got no whole "
     "triangle"},
    {"float indices",
     [](GltfBuilder& b) {
       b.primitive()["indices"] = b.add_floats({0, 1, 2}, "SCALAR");
     },
     "malformed-mesh: a.gltf accessors[2].componentType: component type of indices: expected "
     "5121, 5123 or 5125, got 5126"},
    {"positions of two",
     [](GltfBuilder& b) {
       b.attributes()["POSITION"] = b.add_floats({0, 1, 2, 3}, "VEC2");
     },
     "malformed-mesh: a.gltf accessors[2].type: components of POSITION: expected 3, got 2"},
    {"normals of another count",
     [](GltfBuilder& b) {
       b.attributes()["NORMAL"] = b.add_floats({0, 0, 1}, "VEC3");
     },
     "malformed-mesh: a.gltf meshes[0].primitives[0].NORMAL: elements of the attribute: expected "
     "4 as POSITION, got 1"},
    {"unknown mode", [](GltfBuilder& b) { b.primitive()["mode"] = 7; },
     "malformed-mesh: a.gltf meshes[0].primitives[0].mode: unknown mode: expected 0 to 6, got 7"},
    {"NaN",
     [](GltfBuilder& b) {
       b.attributes()["POSITION"] = b.add_floats(
           {0, 0, 0, 1, 0, 0, 0, std::numeric_limits<float>::quiet_NaN(), 0, 1, 1, 0}, "VEC3");
     },
     "malformed-mesh: a.gltf meshes[0].primitives[0].attributes.POSITION: vertex 2 is at no "
     "finite place: expected coordinates of at most 1e30 in size"},
    {"infinite node",
     [](GltfBuilder& b) {
       b.json["nodes"][0]["scale"] = {1e300, 1e300, 1e300};
     },
     "malformed-mesh: a.gltf meshes[0].primitives[0].attributes.POSITION: vertex 1 is at no "
     "finite place: expected coordinates of at most 1e30 in size"},
    {"points alone", [](GltfBuilder& b) { b.primitive()["mode"] = 0; },
     "empty-mesh: a.gltf: the mesh is empty: expected at least one triangle, got 1 primitives of "
     "points or lines"},
    {"no mesh", [](GltfBuilder& b) { b.json["nodes"][0].erase("mesh"); },
     "empty-mesh: a.gltf: the mesh is empty: expected at least one triangle, got no node with a "
     "mesh in the scene"},
    {"empty scene", [](GltfBuilder& b) { b.json["scenes"][0]["nodes"] = Json::array(); },
     "empty-mesh: a.gltf: the mesh is empty: expected at least one triangle, got no node with a "
     "mesh in the scene"},
    {"cycle",
     [](GltfBuilder& b) {
       b.json["nodes"] = Json::parse(R"([{"mesh": 0, "children": [1]}, {"children": [0]}])");
     },
     "malformed-mesh: a.gltf nodes[0]: the node stands in a cycle: expected a tree"},
    {"own child", [](GltfBuilder& b) { b.json["nodes"][0]["children"] = {0}; },
     "malformed-mesh: a.gltf nodes[0]: the node stands in a cycle: expected a tree"},
    {"two parents",
     [](GltfBuilder& b) {
       b.json["nodes"] = Json::parse(R"([{"children": [2]}, {"children": [2]}, {"mesh": 0}])");
     },
     "malformed-mesh: a.gltf nodes[2]: the node has two parents: expected a tree, got nodes[0] "
     "and nodes[1]"},
    {"deep tree",
     [](GltfBuilder& b) {
       b.json["nodes"] = Json::array();
       for (int i = 1; i <= 600; ++i) b.json["nodes"].push_back(Json{{"children", {i}}});
       b.json["nodes"].push_back(Json{{"mesh", 0}});
     },
     "malformed-mesh: a.gltf nodes[512]: depth of the node tree: expected at most 512, got 513"},
    {"joint out of range",
     [](GltfBuilder& b) {
       b.attributes()["JOINTS_0"] = b.add_u16(std::vector<uint16_t>(16, 1), "VEC4");
       b.attributes()["WEIGHTS_0"] = b.add_floats(std::vector<float>(16, 0.25f), "VEC4");
       b.json["skins"] = Json::array({Json{{"joints", {0}}}});
       b.json["nodes"][0]["skin"] = 0;
     },
     "malformed-mesh: a.gltf meshes[0].primitives[0].JOINTS: joint out of range: expected 0, "
     "got 1.000000 at vertex 0"},
};

std::string name_of(const ::testing::TestParamInfo<Case>& info) {
  std::string name;
  for (const char c : std::string_view(info.param.what)) name += std::isalnum(c) ? c : '_';
  return name;
}

INSTANTIATE_TEST_SUITE_P(schema, GltfErrors, ::testing::ValuesIn(kSchemaCases), name_of);
INSTANTIATE_TEST_SUITE_P(ranges, GltfErrors, ::testing::ValuesIn(kRangeCases), name_of);
INSTANTIATE_TEST_SUITE_P(meshes, GltfErrors, ::testing::ValuesIn(kMeshCases), name_of);

TEST(GltfJson, errors_name_the_byte) {
  EXPECT_EQ(outcome(load_text("{\"asset\": }")),
            "malformed-mesh: a.gltf byte 11: not JSON: syntax error while parsing value - "
            "unexpected '}'; expected '[', '{', or a literal");
  EXPECT_EQ(outcome(load_text("[1]")),
            "malformed-mesh: a.gltf: the JSON is no object: expected {\"asset\": …}, got array");
  EXPECT_EQ(outcome(load_text("[")),
            "malformed-mesh: a.gltf byte 2: not JSON: syntax error while parsing value - "
            "unexpected end of input; expected '[', '{', or a literal");
  // The parser's versions differ in the rest.
  EXPECT_EQ(outcome(load_text("")).substr(0, 41), "malformed-mesh: a.gltf byte 1: not JSON: ");
  EXPECT_EQ(outcome(load_text("{\"asset\":{\"version\":\"2.0\",\"x\":1e999}}")),
            "malformed-mesh: a.gltf: not JSON: number overflow parsing '1e999'");
}

TEST(GltfJson, text_that_is_not_utf8_does_not_reach_the_response) {
  const std::string message = outcome(load_text("{\"asset\": \"\xff\xfe\"}"));
  EXPECT_NE(message, "ok");
  for (const char c : message) EXPECT_TRUE(c >= 0x20 && c < 0x7f) << message;
}

TEST(GltfJson, depth_is_refused_before_any_recursion) {
  const std::string deep(100'000, '[');
  EXPECT_EQ(outcome(load_text("{\"extras\":" + deep)),
            "malformed-mesh: a.gltf byte 137: depth of the JSON: expected at most 128, got 129");
  // Brackets in strings do not count.
  GltfBuilder builder = triangle();
  builder.json["asset"]["generator"] = deep + "\"" + deep;
  EXPECT_EQ(outcome(builder.load()), "ok");
}

TEST(GltfJson, values_are_counted_before_any_is_stored) {
  std::string many = "{\"extras\":[0";
  for (int i = 0; i < 8'000'000; ++i) many += ",0";
  EXPECT_EQ(outcome(load_text(many + "]}")).substr(0, 45),
            "malformed-mesh: a.gltf byte 16000006: values ");
}

TEST(GltfJson, arrays_of_too_many_elements_are_refused) {
  GltfBuilder builder = triangle();
  std::string text = builder.text();
  std::string many = "\"materials\":[{}";
  for (int i = 0; i < 262'144; ++i) many += ",{}";
  text.insert(1, many + "],");
  EXPECT_EQ(outcome(load_text(text)),
            "malformed-mesh: a.gltf materials: elements: expected at most 262144, got 262145");
}

}  // namespace
}  // namespace voxeld
