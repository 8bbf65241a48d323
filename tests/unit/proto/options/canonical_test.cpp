#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>

#include "proto/options/options.h"
#include "tests/folders.h"

namespace voxeld {
namespace {

using Json = nlohmann::json;

constexpr const char* kIdentity = "1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1";
constexpr OptionScope kScopes[] = {OptionScope::kVoxelize, OptionScope::kRenderMesh,
                                   OptionScope::kRenderGrid, OptionScope::kExport};

std::string canonical(const OptionPairs& pairs, OptionScope scope) {
  const auto options = parse_options(pairs, scope);
  EXPECT_TRUE(options) << (options ? "" : options.error().message());
  return options ? canonical_json(*options, scope) : "";
}
std::string canonical_of_json(std::string_view text, OptionScope scope) {
  const auto options = parse_options(Json::parse(text), scope);
  EXPECT_TRUE(options) << text << (options ? "" : options.error().message());
  return options ? canonical_json(*options, scope) : "";
}

Error refused(std::string_view text, OptionScope scope = OptionScope::kVoxelize) {
  const auto options = parse_options(Json::parse(text), scope);
  EXPECT_FALSE(options) << text;
  return options ? Error{} : options.error();
}

TEST(CanonicalOptions, spell_out_every_default_in_a_fixed_order) {
  EXPECT_EQ(canonical({}, OptionScope::kVoxelize),
            R"({"size":128,"padding":0,"up":"y","rule":"touch","fill":"surface",)"
            R"("color":"average","pipeline":"auto","format":"native","codec":"fast",)"
            R"("axes":"zyx","dtype":"uint8","palette":255})");
  EXPECT_EQ(canonical({}, OptionScope::kExport),
            R"({"format":"native","codec":"fast","axes":"zyx","dtype":"uint8","palette":255})");
  EXPECT_EQ(canonical({}, OptionScope::kRenderGrid),
            R"({"width":512,"height":512,"style":"voxel","projection":"perspective",)"
            R"("azimuth":30,"elevation":20,"zoom":1,"occlusion":"yes","shadow":"yes",)"
            R"("ground":"yes","samples":"auto","renderer":"auto"})");
}

OptionPairs pairs_of_query(const std::string& query) {
  OptionPairs pairs;
  std::istringstream parts(query);
  for (std::string part; std::getline(parts, part, '&');) {
    const size_t equals = part.find('=');
    pairs.emplace_back(part.substr(0, equals), part.substr(equals + 1));
  }
  return pairs;
}

// Random requests with every option, each with its canonical text: "SCOPE QUERY<tab>JSON". Names of
// stored results are made from such texts, so a changed line loses the results of its request;
// VOXELD_RENEW=1 writes the texts anew where that is wanted.
TEST(CanonicalOptions, random_requests_give_the_recorded_text) {
  const std::map<std::string, OptionScope> scopes = {{"voxelize", OptionScope::kVoxelize},
                                                     {"render", OptionScope::kRenderMesh},
                                                     {"render-grid", OptionScope::kRenderGrid},
                                                     {"export", OptionScope::kExport}};
  const auto path = test::source_dir() / "tests/unit/proto/options/canonical.txt";
  std::ifstream file(path);
  std::string renewed;
  const bool renews = std::getenv("VOXELD_RENEW") != nullptr;
  size_t count = 0;
  for (std::string line; std::getline(file, line); ++count) {
    const size_t space = line.find(' '), tab = line.find('\t');
    ASSERT_LT(space, tab) << line;
    const OptionScope scope = scopes.at(line.substr(0, space));
    const std::string query = line.substr(space + 1, tab - space - 1);
    const std::string text = canonical(pairs_of_query(query), scope);
    renewed += line.substr(0, tab + 1) + text + "\n";
    EXPECT_TRUE(renews || text == line.substr(tab + 1)) << line << "\nis now " << text;
    EXPECT_EQ(canonical_of_json(text, scope), text) << query;
  }
  EXPECT_EQ(count, 48u);
  file.close();
  if (renews) std::ofstream(path) << renewed;
}

TEST(CanonicalOptions, fills_name_their_sign_and_shells_their_thickness) {
  EXPECT_NE(canonical({{"fill", "solid"}}, OptionScope::kVoxelize)
                .find(R"("fill":"solid","sign":"auto","interior":"none","color")"),
            std::string::npos);
  const std::string shell =
      canonical({{"fill", "shell"}, {"sign", "flood"}}, OptionScope::kVoxelize);
  EXPECT_NE(shell.find(R"("fill":"shell","sign":"flood","thickness":1,"interior":"none","color")"),
            std::string::npos);
  EXPECT_EQ(canonical_of_json(shell, OptionScope::kVoxelize), shell);
}

TEST(CanonicalOptions, the_unit_of_distances_is_named_where_it_is_not_voxels) {
  const std::string plain = canonical({{"fill", "band"}}, OptionScope::kVoxelize);
  EXPECT_EQ(canonical({{"fill", "band"}, {"distance", "voxels"}}, OptionScope::kVoxelize), plain);
  EXPECT_EQ(plain.find("\"distance\""), std::string::npos);
  const std::string world =
      canonical({{"fill", "band"}, {"distance", "world"}}, OptionScope::kVoxelize);
  EXPECT_NE(world.find(R"("distance":"world")"), std::string::npos);
  EXPECT_EQ(canonical_of_json(world, OptionScope::kVoxelize), world);
}

TEST(CanonicalOptions, palettes_are_named_by_their_colours) {
  const std::string named =
      canonical({{"format", "vox"}, {"palette", "bw"}, {"mirror", "z,x"}, {"crop", "yes"}},
                OptionScope::kExport);
  EXPECT_TRUE(named.ends_with(R"("palette":"#000000,#ffffff","crop":"yes","mirror":["x","z"]})"))
      << named;
  EXPECT_EQ(
      canonical(
          {{"format", "vox"}, {"palette", "000000,FFFFFF"}, {"mirror", "x,z"}, {"crop", "yes"}},
          OptionScope::kExport),
      named);
  EXPECT_EQ(canonical_of_json(named, OptionScope::kExport), named);
}

TEST(CanonicalOptions, changes_of_voxels_are_named_where_they_are_set) {
  const std::string named = canonical({{"format", "vox"},
                                       {"keep", "largest"},
                                       {"hollow", "2"},
                                       {"erode", "0"},
                                       {"remap", "7:1,2:3"}},
                                      OptionScope::kExport);
  EXPECT_TRUE(named.ends_with(R"("keep":"1","hollow":2,"neighbors":"6","remap":"2:3,7:1"})"))
      << named;
  EXPECT_EQ(canonical_of_json(named, OptionScope::kExport), named);
}

TEST(CanonicalOptions, blocks_and_dither_are_named_where_they_are_set_and_the_version_of_schems) {
  const std::string plain = canonical({{"format", "schem"}}, OptionScope::kExport);
  EXPECT_TRUE(plain.ends_with(R"("palette":255,"schem_version":2})")) << plain;
  EXPECT_EQ(canonical({{"format", "schem"}, {"dither", "none"}}, OptionScope::kExport), plain);
  const std::string full =
      canonical({{"format", "schem"}, {"blocks", "wool,concrete"}, {"dither", "error"}},
                OptionScope::kExport);
  EXPECT_TRUE(full.ends_with(
      R"("palette":255,"blocks":["concrete","wool"],"dither":"error","schem_version":2})"))
      << full;
  EXPECT_EQ(canonical_of_json(full, OptionScope::kExport), full);
}

TEST(CanonicalOptions, levels_and_regions_are_named_in_every_scope_that_takes_them) {
  for (const OptionScope scope : kScopes) {
    const std::string text =
        canonical({{"level", "2"}, {"level_rule", "any"}, {"region", "0,0,0,9,8,7"}}, scope);
    EXPECT_NE(text.find(R"("level":2,"level_rule":"any","region":[0,0,0,9,8,7]})"),
              std::string::npos);
    EXPECT_EQ(canonical_of_json(text, scope), text);
    EXPECT_EQ(canonical({{"level", "0"}, {"level_rule", "any"}}, scope), canonical({}, scope));
    // An image may be of a coarser level than that of the request.
    EXPECT_NE(canonical({{"level_rule", "majority"}}, scope).find(R"("level_rule":"majority")"),
              std::string::npos);
  }
}

TEST(CanonicalOptions, bands_and_distances_name_their_sign) {
  const std::string band = canonical({{"fill", "band"}}, OptionScope::kVoxelize);
  EXPECT_NE(band.find(R"("fill":"band","sign":"auto","thickness":3,"color")"), std::string::npos);
  EXPECT_EQ(canonical_of_json(band, OptionScope::kVoxelize), band);
  const std::string bare =
      canonical({{"fill", "band"}, {"channels", "occupancy"}}, OptionScope::kVoxelize);
  EXPECT_EQ(bare.find("sign"), std::string::npos);
  EXPECT_EQ(canonical_of_json(bare, OptionScope::kVoxelize), bare);
  const std::string surface = canonical({{"channels", "distance"}}, OptionScope::kVoxelize);
  EXPECT_NE(surface.find(R"("sign":"auto")"), std::string::npos);
  EXPECT_NE(surface.find(R"("channels":["occupancy","distance"])"), std::string::npos);
  EXPECT_EQ(canonical_of_json(surface, OptionScope::kVoxelize), surface);
}

TEST(CanonicalOptions, a_default_that_is_spelled_out_changes_nothing) {
  for (const OptionScope scope : kScopes) {
    const std::string text = canonical({}, scope);
    const Json defaults = Json::parse(text);
    for (const auto& [name, value] : defaults.items()) {
      EXPECT_EQ(canonical_of_json(Json{{name, value}}.dump(), scope), text) << name;
    }
  }
}

TEST(CanonicalOptions, two_spellings_of_a_request_give_the_same_bytes) {
  struct Case {
    OptionPairs first, second;
    OptionScope scope;
  };
  const std::vector<Case> cases = {
      {{{"up", "z"}, {"size", "9"}}, {{"size", "9"}, {"up", "z"}}, OptionScope::kVoxelize},
      {{{"size", "007"}}, {{"size", "7"}}, OptionScope::kVoxelize},
      {{{"voxel_size", "0.5"}}, {{"voxel_size", "5e-1,.5,0.50"}}, OptionScope::kVoxelize},
      {{{"bounds", "-0,0,0,1,1,1e1"}}, {{"bounds", "0,0.0,0,+1,1,10"}}, OptionScope::kVoxelize},
      {{{"channels", "normal,color"}},
       {{"channels", "color,occupancy,normal,color"}},
       OptionScope::kVoxelize},
      {{{"cache", "no"}, {"filename", "a.obj"}}, {}, OptionScope::kVoxelize},
      {{{"background", "ABCDEF"}}, {{"background", "#abcdefff"}}, OptionScope::kRenderGrid},
      {{{"background", "transparent"}}, {{"background", "#00000000"}}, OptionScope::kRenderGrid},
      {{{"azimuth", "4.5e1"}}, {{"azimuth", "45"}}, OptionScope::kRenderGrid},
  };
  for (const auto& [first, second, scope] : cases) {
    EXPECT_EQ(canonical(first, scope), canonical(second, scope));
  }
}

TEST(CanonicalOptions, two_requests_that_differ_give_other_bytes) {
  const std::vector<OptionPairs> requests = {
      {},
      {{"size", "127"}},
      {{"dims", "128,128,128"}},
      {{"voxel_size", "1"}},
      {{"voxel_size", "1,1,2"}},
      {{"padding", "1"}},
      {{"bounds", "0,0,0,1,1,1"}},
      {{"up", "z"}},
      {{"units", "m"}},
      {{"transform", kIdentity}},
      {{"color", "none"}},
      {{"color", "dominant"}},
      {{"color", "nearest"}},
      {{"channels", "occupancy"}},
      {{"channels", "color"}},
      {{"channels", "normal"}},
      {{"channels", "material"}},
      {{"channels", "coverage"}},
      {{"channels", "label"}},
      {{"channels", "label"}, {"labels", "node"}},
      {{"channels", "label"}, {"labels", "material"}},
      {{"channels", "label"}, {"labels", "group"}},
      {{"pipeline", "raster"}},
      {{"format", "npy"}},
      {{"format", "npy"}, {"layout", "sparse"}},
      {{"format", "glb"}},
      {{"format", "glb"}, {"mesh", "faces"}},
      {{"format", "ply"}, {"mesh", "faces"}},
      {{"format", "mha"}},
      {{"format", "mha"}, {"channel", "color"}},
      {{"format", "nii"}, {"channel", "color"}},
      {{"format", "glb"}, {"mesh", "instances"}},
      {{"format", "glb"}, {"compress", "meshopt"}},
      {{"format", "schem"}},
      {{"format", "schem"}, {"schem_version", "3"}},
      {{"format", "zarr"}, {"zarr_version", "2"}},
      {{"format", "schem"}, {"dither", "bayer"}},
      {{"format", "schem"}, {"blocks", "stone"}},
      {{"format", "schem"}, {"blocks", "minecraft:stone"}},
      {{"format", "litematic"}},
      {{"format", "nbt"}},
      {{"format", "vdb"}},
      {{"format", "nvdb"}},
      {{"format", "slices"}},
      {{"format", "slices"}, {"layout", "atlas"}},
      {{"format", "raw"}, {"channel", "color"}},
      {{"format", "raw"}, {"dtype", "float32"}},
      {{"format", "vox"}},
      {{"format", "vox"}, {"dither", "error"}},
      {{"axes", "xyz"}},
      {{"dtype", "bool"}},
      {{"palette", "254"}},
      {{"level", "1"}},
      {{"level", "1"}, {"level_rule", "majority"}},
      {{"alpha", "cut"}},
      {{"region", "0,0,0,1,1,1"}},
  };
  std::set<std::string> texts;
  for (const OptionPairs& pairs : requests) texts.insert(canonical(pairs, OptionScope::kVoxelize));
  EXPECT_EQ(texts.size(), requests.size());
}

TEST(CanonicalOptions, are_options_that_give_the_same_canonical_text) {
  const std::vector<OptionPairs> grids = {
      {{"dims", "3,40,500"}, {"bounds", "0.1,-1e-7,1e20,0.2,3,2e20"}, {"padding", "1"}},
      {{"voxel_size", "0.1,0.30000000000000004,1e-9"}, {"units", "ft"}, {"color", "shaded"}},
      {{"transform", "0.1,0,0,7,0,1e-30,0,0,0,0,123456789.125,0,0,0,0,1"}, {"channels", "normal"}},
      {{"channels", "label,color"}, {"labels", "group"}},
      {{"format", "npz"}, {"layout", "sparse"}, {"dtype", "float32"}},
      {{"format", "obj"}, {"mesh", "smooth"}},
      {{"format", "glb"}, {"mesh", "instances"}, {"compress", "meshopt"}},
      {{"format", "glb"}},
      {{"format", "nrrd"}, {"channel", "label"}, {"channels", "label"}},
      {{"format", "nii"}},
      {{"format", "vox"}, {"dither", "bayer"}},
      {{"format", "schem"}, {"blocks", "red_wool,minecraft:stone,end"}, {"schem_version", "3"}},
  };
  for (const OptionPairs& pairs : grids) {
    const std::string text = canonical(pairs, OptionScope::kVoxelize);
    EXPECT_EQ(canonical_of_json(text, OptionScope::kVoxelize), text);
  }
  const std::string image = canonical({{"matrix", kIdentity},
                                       {"section", "1,0.1,0,-1e-5"},
                                       {"zoom", "0.1"},
                                       {"style", "iso"},
                                       {"shadow", "yes"}},
                                      OptionScope::kRenderGrid);
  EXPECT_EQ(canonical_of_json(image, OptionScope::kRenderGrid), image);
}

TEST(JsonOptions, numbers_texts_and_lists_mean_the_same) {
  for (const std::string_view text :
       {R"({"dims": [3, 4, 5], "padding": 1})", R"({"dims": "3,4,5", "padding": "1"})",
        R"({"padding": 1.0, "dims": [3.0, 4, 5]})"}) {
    EXPECT_EQ(canonical_of_json(text, OptionScope::kVoxelize),
              canonical({{"dims", "3,4,5"}, {"padding", "1"}}, OptionScope::kVoxelize));
  }
  EXPECT_EQ(canonical_of_json(R"({"voxel_size": 0.1})", OptionScope::kVoxelize),
            canonical({{"voxel_size", "0.1"}}, OptionScope::kVoxelize));
  EXPECT_EQ(canonical_of_json(R"({"channels": ["color", "normal"]})", OptionScope::kVoxelize),
            canonical({{"channels", "color,normal"}}, OptionScope::kVoxelize));
  const auto no_cache = parse_options(Json::parse(R"({"cache": false})"), OptionScope::kVoxelize);
  ASSERT_TRUE(no_cache);
  EXPECT_FALSE(no_cache->use_cache);
}

TEST(CanonicalOptions, have_one_type_each_whatever_way_they_came_in) {
  const std::string text = R"({"size": "96", "thickness": "2.5", "fill": "shell",)"
                           R"( "bounds": "0,0,0,1,1,1e1", "channels": "normal"})";
  const std::string typed = R"({"size": 96, "thickness": 2.5, "fill": "shell",)"
                            R"( "bounds": [0,0,0,1,1,10], "channels": ["normal"]})";
  const std::string canonical_text = canonical_of_json(text, OptionScope::kVoxelize);
  EXPECT_EQ(canonical_of_json(typed, OptionScope::kVoxelize), canonical_text);
  const Json echoed = Json::parse(canonical_text);
  EXPECT_EQ(echoed["size"], 96);
  EXPECT_EQ(echoed["thickness"], 2.5);
  EXPECT_EQ(echoed["bounds"], Json({0, 0, 0, 1, 1, 10}));
  EXPECT_EQ(echoed["channels"], Json({"occupancy", "normal"}));
  const Json several =
      Json::parse(canonical({{"animation", "2"}, {"times", "0,0.5"}}, OptionScope::kVoxelize));
  EXPECT_EQ(several["animation"], "2");
  EXPECT_EQ(several["times"], Json({0, 0.5}));
  EXPECT_EQ(Json::parse(canonical({{"samples", "2"}}, OptionScope::kRenderGrid))["samples"], "2");
}

TEST(CanonicalOptions, tell_rules_apart) {
  const std::string touch = canonical({}, OptionScope::kVoxelize);
  EXPECT_EQ(canonical({{"rule", "touch"}}, OptionScope::kVoxelize), touch);
  for (const std::string rule : {"thin", "center"}) {
    std::string expected = touch;
    expected.replace(expected.find("touch"), 5, rule);
    EXPECT_EQ(canonical({{"rule", rule}}, OptionScope::kVoxelize), expected);
    EXPECT_EQ(canonical_of_json(R"({"rule": ")" + rule + "\"}", OptionScope::kVoxelize), expected);
  }
}

TEST(JsonOptions, values_of_other_types_are_refused) {
  for (const std::string_view value : {"null", "{}", "[]", "[null]", "[[3,4,5]]"}) {
    const Error error = refused("{\"dims\": " + std::string(value) + "}");
    EXPECT_EQ(error.code, ErrorCode::kInvalidOption) << value;
    EXPECT_EQ(error.detail, "dims") << value;
  }
  EXPECT_EQ(refused(R"({"size": null})").message(), "size: expected a text or a number, got null");
  EXPECT_EQ(refused(R"({"size": [9]})").message(), "size: expected a text or a number, got array");
  EXPECT_EQ(refused(R"({"fill": {}})").message(), "fill: expected a text or a number, got object");
  EXPECT_EQ(refused(R"({"dims": 3})").message(),
            "dims: expected a list of numbers, or a text, got number");
  EXPECT_EQ(refused(R"({"filename": 3})").message(), "filename: expected a text, got number");
  EXPECT_EQ(refused(R"({"animation": 0.5})").message(),
            "animation: expected a text or a number, got number");
  EXPECT_EQ(refused("[1]").message(), "options: expected an object, got array");
  EXPECT_EQ(refused(R"({"size": 1e300})").message(),
            "size: expected an integer from 1 to 16384, got \"1e+300\"");
  EXPECT_EQ(refused(R"({"size": true})").message(),
            "size: expected a text or a number, got boolean");
}

TEST(JsonOptions, nothing_in_a_list_is_passed_over) {
  EXPECT_EQ(refused(R"({"dims": [3, 4, 5, [6]]})").message(),
            "dims: expected a list of numbers, or a text, got array");
  EXPECT_EQ(refused(R"({"channels": ["color", {}]})").message(),
            "channels: expected a list of words, or a text, got array");
  EXPECT_EQ(refused(R"({"channels": ["", "color"]})").got, "\",color\"");
  EXPECT_EQ(refused(R"({"dims": [3, "4", 5]})").message(),
            "dims: expected a list of numbers, or a text, got array");
}

}  // namespace
}  // namespace voxeld
