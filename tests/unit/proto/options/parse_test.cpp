#include "proto/options/table.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string>

#include "tests/unit/proto/options/parsed_options.h"

namespace voxeld {
namespace {

using test::parsed;

constexpr const char* kIdentity = "1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1";

OptionScope scope_of(std::string_view name) {
  const Option* const option = find_option(name);
  EXPECT_NE(option, nullptr) << name;
  return option && option->applies_to(OptionScope::kVoxelize) ? OptionScope::kVoxelize
                                                              : OptionScope::kRenderGrid;
}

Error refused(const OptionPairs& pairs, OptionScope scope) {
  const auto options = parse_options(pairs, scope);
  EXPECT_FALSE(options) << pairs[0].first << "=" << pairs[0].second;
  return options ? Error{} : options.error();
}

// Values at the ends of what each option takes, and values just outside.
struct OptionCase {
  std::vector<std::string> good, bad;
  std::string expected;  // of the error for each bad one
};

std::vector<std::string> names_of_formats() {
  std::vector<std::string> names;
  for (const FormatInfo& info : output_formats()) names.emplace_back(info.name);
  return names;
}

const std::map<std::string, OptionCase>& cases() {
  static const std::string kDims = "three integers from 1 to 16384, as in 64,128,32";
  static const std::string kVoxel = "one positive number, or three as in 0.1,0.1,0.2";
  static const std::string kBlocks =
      "names of blocks or of groups: concrete, terracotta, wool, planks, stone, deepslate, "
      "blackstone, sandstone, nether, end, prismarine, quartz, mineral, copper, earth, plant";
  static const std::string kPalette =
      "1 to 255, colours as in #1a1c2c,#f4f4f4, or bw | gray4 | rgb8 | zx15 | gray16 | sepia16 | "
      "cga16 | html16 | cpc27 | gray64 | ega64 | minecraft | websafe216 | xterm240 | magicavoxel | "
      "rgb332";
  static const std::string kColor = "#rrggbb | #rrggbbaa | transparent";
  static const std::map<std::string, OptionCase> all = {
      {"size",
       {{"1", "128", "16384"},
        {"0", "16385", "-1", "1.5", "1e2", "0x10", " 1", "1 ", "", "+1", "99999999999"},
        "an integer from 1 to 16384"}},
      {"dims",
       {{"1,1,1", "16384,16384,16384", "64,128,32"},
        {"0,1,1", "1,16385,1", "1,1", "1,1,1,1", "1,,1", "1,1,a", "", "1;1;1"},
        kDims}},
      {"voxel_size",
       {{"0.5", "1e-9", "1,2,3", "+0.5", "1e30"},
        {"0", "-1", "1,2", "1,2,0", "1,2,3,4", "nan", "inf", "1e999", "+-1", "++1", "0x1p3", ""},
        kVoxel}},
      {"padding", {{"0", "1", "63"}, {"-1", "513", "", "1.0"}, "an integer from 0 to 512"}},
      {"up", {{"y", "z"}, {"x", "Y", "", "yz"}, "y | z"}},
      {"units", {{"m", "cm", "mm", "in", "ft"}, {"km", "", "M"}, "m | cm | mm | in | ft"}},
      {"rule", {{"touch", "thin", "center"}, {"thick", ""}, "touch | thin | center | none"}},
      {"fill",
       {{"surface", "solid", "shell", "band"}, {"full", ""}, "surface | solid | shell | band"}},
      {"sign", {{}, {"even", ""}, "auto | parity | nonzero | majority | flood | winding"}},
      {"interior", {{}, {"all", ""}, "none | nearest"}},
      {"thickness", {{}, {"0.99", "256.1", "nan", ""}, "a number from 1 to 256"}},
      {"variant",
       {{"0", "beach", std::string(255, 'n')},
        {"", std::string("a\0b", 3), "\xff"},
        "a name or number: 1 to 255 bytes of UTF-8 without NUL"}},
      {"threshold", {{"0", "-3.5", "1e30"}, {"1e31", "nan", ""}, "a number from -1e+30 to 1e+30"}},
      {"color",
       {{"average", "nearest", "dominant", "shaded", "axis", "none"},
        {"red", ""},
        "average | nearest | dominant | shaded | axis | none"}},
      {"channels",
       {{"occupancy", "color", "normal", "color,normal,occupancy", "color,color",
         "material,label,coverage"},
        {"", "alpha", "color,", "color normal"},
        "a list of occupancy, color, normal, material, label, distance and coverage"}},
      {"labels", {{}, {"meshes", ""}, "mesh | node | material | group"}},
      {"distance", {{}, {"metres", ""}, "voxels | world"}},
      {"pipeline",
       {{"auto", "raster", "compute", "cpu"}, {"gpu", ""}, "auto | raster | compute | cpu"}},
      {"format", {names_of_formats(), {"stl", ""}, format_names(" | ")}},
      {"codec", {{"fast", "small"}, {"best", ""}, "fast | small"}},
      {"layout", {{"dense"}, {"packed", ""}, "dense | sparse | atlas"}},
      {"axes", {{"zyx", "xyz"}, {"yxz", ""}, "zyx | xyz"}},
      {"dtype", {{"uint8", "bool", "float32"}, {"float64", ""}, "uint8 | bool | float32"}},
      {"palette",
       {{"1", "255", "cga16", "#1A1c2c", "1a1c2c,#f4f4f4"},
        {"0", "256", "", "-1", "1.5", "0255", "cga", "#1a1c2", "1a1c2c0"},
        kPalette}},
      {"mesh", {{}, {"quads", ""}, "faces | greedy | smooth | instances"}},
      {"channel",
       {{},
        {"alpha", "", "color,normal"},
        "occupancy | color | normal | material | label | distance | coverage"}},
      {"compress", {{"none"}, {"zip", ""}, "none | meshopt"}},
      {"blocks", {{}, {"", "0", "chest_of_drawers"}, kBlocks}},
      {"dither", {{"none"}, {"yes", ""}, "none | bayer | error"}},
      {"schem_version", {{}, {"1", "4", ""}, "an integer from 2 to 3"}},
      {"zarr_version", {{}, {"1", "4", ""}, "an integer from 2 to 3"}},
      {"keep",
       {{"largest", "0", "1", "1000000"},
        {"1000001", "", "-1", "1.5", "all"},
        "largest, or 0 (all) to 1000000"}},
      {"dilate", {{"0", "64"}, {"-1", "65", "", "1.5"}, "an integer from 0 to 64"}},
      {"erode", {{"0", "64"}, {"-1", "65", "", "1.5"}, "an integer from 0 to 64"}},
      {"hollow", {{"0", "64"}, {"-1", "65", "", "1.5"}, "an integer from 0 to 64"}},
      {"neighbors", {{}, {"7", "", "faces"}, "6 | 18 | 26"}},
      {"remap",
       {{},
        {"", "1", "1:", ":1", "0:1", "1:0", "65536:1", "1:65536", "1:2,", "1:2:3"},
        "FROM:TO,... of labels from 1 to 65535"}},
      {"crop", {{"yes", "no"}, {"true", ""}, "yes | no"}},
      {"mirror", {{"x", "z,x", "x,y,z"}, {"", "xz", "w", "x,,y", "none"}, "a list of x, y and z"}},
      {"level", {{"0", "14"}, {"-1", "15", "", "1.5"}, "an integer from 0 to 14"}},
      {"level_rule", {{"any", "majority"}, {"most", ""}, "any | majority"}},
      {"alpha", {{"auto", "keep", "cut"}, {"yes", ""}, "auto | keep | cut"}},
      {"region",
       {{"0,0,0,1,1,1", "1,2,3,16384,16383,4"},
        {"", "0,0,0,1,1", "0,0,0,1,1,1,1", "-1,0,0,1,1,1", "0,0,0,1,1,16385", "0,0,1,1,1,1",
         "0,0,0,0.5,1,1"},
        "x0,y0,z0,x1,y1,z1: integers from 0 to 16384, each minimum below its maximum"}},
      {"width", {{"1", "4096"}, {"0", "4097", "", "1.0"}, "an integer from 1 to 4096"}},
      {"height", {{"1", "4096"}, {"0", "4097", "", "-5"}, "an integer from 1 to 4096"}},
      {"projection",
       {{"perspective", "orthographic"}, {"fisheye", ""}, "perspective | orthographic"}},
      {"azimuth",
       {{"-3600", "0", "3600", "1e2", "+45.5"},
        {"3600.001", "-3600.001", "nan", "", "ten"},
        "a number from -3600 to 3600"}},
      {"elevation", {{"-90", "90", "0.25"}, {"90.01", "-90.01", "inf"}, "a number from -90 to 90"}},
      {"zoom", {{"0.01", "1", "1000"}, {"0.0099", "1000.1", "0"}, "a number from 0.01 to 1000"}},
      {"background",
       {{"#000000", "#FFffFF", "a1b2c3", "#a1b2c3d4", "transparent"},
        {"#fff", "#gggggg", "#12345", "#1234567", "", "#", "#+1+2+3", "#-1-2-3", "white"},
        kColor}},
      {"style",
       {{"voxel", "smooth", "clay", "iso"},
        {"phong", "", "Voxel"},
        "voxel | smooth | clay | iso | blueprint"}},
      {"ground", {{"yes", "no"}, {"grass", ""}, "yes | no"}},
      {"exposure", {{"1", "2.5", "16"}, {"0.99", "16.1", "auto", ""}, "a number from 1 to 16"}},
      {"occlusion", {{"yes", "no"}, {"1", "true", ""}, "yes | no"}},
      {"shadow", {{"yes", "no"}, {"soft", ""}, "yes | no"}},
      {"samples", {{"auto", "1", "4"}, {"0", "5", "", "1.5"}, "auto, or 1 to 4"}},
      {"renderer", {{"auto", "gl", "cpu"}, {"opengl", ""}, "auto | gl | cpu"}},
      {"animation",
       {{"0", "walk", "Survey animation", std::string(255, 'n'), "\xc3\xa9"},
        {"", std::string("a\0b", 3), "\xff", "caf\xe9"},
        "a name or number: 1 to 255 bytes of UTF-8 without NUL"}},
      {"time", {{"0", "86400", "1.25"}, {"-0.1", "86401", "nan", ""}, "a number from 0 to 86400"}},
      {"frames",
       {{"0", "12", "0..0", "0..4095", "100..4195"},
        {"", "-1", "1..", "..1", "2..1", "0...1", "0..1..2", "1,2", "0-3", "a..b", "1.5",
         "0..2147483648"},
        "FIRST..LAST, or one number: integers from 0 on, the first not above the last"}},
      {"fps",
       {{"0.01", "1000", "23.976"}, {"0", "1000.1", "-24", ""}, "a number from 0.01 to 1000"}},
      {"times",
       {{"0", "0,0.5,1.25", "86400", "1e-3,2e-3"},
        {"", "0,", "0,0", "1,0.5", "-1,0", "0,86400.5", "0;1", "nan"},
        "T0,T1,…: seconds from 0 to 86400, each above the one before it"}},
      {"root_motion", {{}, {"drop", ""}, "keep | strip"}},
      {"image", {{"png", "gif", "apng", "sheet"}, {"jpg", ""}, "png | gif | apng | sheet"}},
      {"frame", {{"0", "4095"}, {"-1", "4096", "", "1.5"}, "an integer from 0 to 4095"}},
      {"turntable", {{}, {"0", "1", "361", ""}, "an integer from 2 to 360"}},
      {"rate", {{}, {"0", "0.09", "100.1", ""}, "a number from 0.1 to 100"}},
      {"columns", {{}, {"0", "4097", ""}, "an integer from 1 to 4096"}},
      {"cache", {{"yes", "no"}, {"true", "1", ""}, "yes | no"}},
  };
  return all;
}

TEST(Options, every_value_at_the_ends_of_a_range_is_taken) {
  for (const auto& [name, one] : cases()) {
    for (const std::string& value : one.good) {
      const auto options = parse_options(OptionPairs{{name, value}}, scope_of(name));
      EXPECT_TRUE(options) << name << "=" << value << ": " << options.error().message();
    }
  }
}

TEST(Options, every_value_outside_is_refused_with_expected_and_got) {
  for (const auto& [name, one] : cases()) {
    for (const std::string& value : one.bad) {
      const Error error = refused({{name, value}}, scope_of(name));
      EXPECT_EQ(error.code, ErrorCode::kInvalidOption) << name;
      EXPECT_EQ(error.message(), name + ": expected " + one.expected + ", got \"" + value + "\"");
    }
  }
}

TEST(Options, every_option_of_the_table_has_its_cases_here) {
  const std::set<std::string> elsewhere = {"bounds", "transform", "matrix", "section", "filename"};
  for (const Option& option : option_table()) {
    const std::string name(option.name);
    EXPECT_TRUE(cases().contains(name) != elsewhere.contains(name)) << name;
    EXPECT_FALSE(form_text(option).empty()) << name;
    EXPECT_FALSE(option.help.empty()) << name;
  }
}

TEST(Options, lists_of_numbers_take_exactly_as_many_finite_numbers_as_they_need) {
  struct Case {
    std::string name, good;
    int count;
  };
  for (const auto& [name, good, count] :
       {Case{"bounds", "-1,-2,-3,1,2,3", 6}, Case{"transform", kIdentity, 16},
        Case{"matrix", kIdentity, 16}, Case{"section", "0,1,0,-0.5", 4}}) {
    const OptionScope scope = scope_of(name);
    EXPECT_TRUE(parse_options(OptionPairs{{name, good}}, scope)) << name;
    const std::string n = std::to_string(count);
    for (const std::string& wrong : {good + ",1", good.substr(good.find(',') + 1), std::string()}) {
      const Error error = refused({{name, wrong}}, scope);
      EXPECT_EQ(error.code, ErrorCode::kInvalidOption);
      EXPECT_EQ(error.message(), name + ": expected " + n + " numbers, got \"" + wrong + "\"");
    }
    for (const std::string number : {"nan", "inf", "-inf", "1e999", "1e-999", "", "1x", " 1"}) {
      const std::string wrong = number + good.substr(good.find(','));
      EXPECT_EQ(refused({{name, wrong}}, scope).message(),
                name + ": expected " + n + " finite numbers, got \"" + wrong + "\"");
    }
  }
}

TEST(Options, bounds_without_a_volume_are_refused) {
  for (const std::string value : {"0,0,0,0,1,1", "0,0,0,1,0,1", "0,0,0,1,1,0", "1,0,0,0,1,1"}) {
    EXPECT_EQ(refused({{"bounds", value}}, OptionScope::kVoxelize).message(),
              "bounds: expected x0,y0,z0,x1,y1,z1 with each minimum below its maximum, got \"" +
                  value + "\"");
  }
}

TEST(Options, a_column_major_or_projective_transform_is_refused) {
  for (const std::string value :
       {"1,0,0,0,0,1,0,0,0,0,1,0,5,6,7,1", "1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,2"}) {
    EXPECT_EQ(refused({{"transform", value}}, OptionScope::kVoxelize).message(),
              "transform: expected 16 numbers, row-major: the last four are 0,0,0,1, got \"" +
                  value + "\"");
  }
}

TEST(Options, a_section_plane_without_a_normal_is_refused) {
  EXPECT_EQ(refused({{"section", "0,0,-0,1"}}, OptionScope::kRenderGrid).message(),
            "section: expected a,b,c,d with a normal a,b,c other than 0, got \"0,0,-0,1\"");
}

TEST(Options, a_filename_takes_255_bytes_without_nul) {
  EXPECT_EQ(parsed({{"filename", std::string(255, 'a')}}, OptionScope::kVoxelize).filename.size(),
            255u);
  const Error error = refused({{"filename", std::string(256, 'a')}}, OptionScope::kVoxelize);
  EXPECT_EQ(error.message(), "filename: expected at most 255 bytes, got 256");
  EXPECT_EQ(refused({{"filename", std::string("a\0b", 3)}}, OptionScope::kVoxelize).code,
            ErrorCode::kInvalidOption);
}

TEST(Options, labels_say_something_only_of_channel_label) {
  const auto options =
      parsed({{"channels", "label"}, {"labels", "group"}}, OptionScope::kVoxelize).voxelize;
  EXPECT_TRUE(options.names(Channel::kLabel));
  EXPECT_FALSE(options.names(Channel::kMaterial));
  EXPECT_EQ(options.labels, LabelKind::kGroup);
  EXPECT_EQ(parsed({{"channels", "label"}}, OptionScope::kVoxelize).voxelize.labels,
            LabelKind::kMesh);
  EXPECT_EQ(refused({{"labels", "node"}}, OptionScope::kVoxelize).message(),
            "labels: expected channel label with it, got \"channels without it\"");
}

TEST(Options, values_reach_their_fields) {
  const RequestOptions grid = parsed({{"dims", "3,4,5"},
                                      {"bounds", "0,0,0,1,2,3"},
                                      {"padding", "1"},
                                      {"up", "z"},
                                      {"units", "mm"},
                                      {"transform", kIdentity},
                                      {"color", "axis"},
                                      {"channels", "normal"},
                                      {"pipeline", "compute"},
                                      {"format", "npz"},
                                      {"axes", "xyz"},
                                      {"dtype", "float32"},
                                      {"palette", "7"},
                                      {"level", "3"},
                                      {"level_rule", "majority"},
                                      {"region", "1,2,3,4,5,6"},
                                      {"cache", "no"},
                                      {"filename", "a.ply"}},
                                     OptionScope::kVoxelize);
  const PlacementOptions& placement = grid.voxelize.placement;
  EXPECT_EQ(placement.dims, (std::array<int, 3>{3, 4, 5}));
  EXPECT_EQ(placement.bounds, (std::array<double, 6>{0, 0, 0, 1, 2, 3}));
  EXPECT_EQ(placement.padding, 1);
  EXPECT_EQ(placement.up, UpAxis::kZ);
  EXPECT_EQ(placement.units, "mm");
  EXPECT_TRUE(placement.transform);
  EXPECT_EQ(grid.voxelize.color, ColorMode::kAxis);
  EXPECT_TRUE(grid.voxelize.names(Channel::kNormal));
  EXPECT_FALSE(grid.voxelize.names(Channel::kColor));
  EXPECT_EQ(grid.voxelize.pipeline, PipelineChoice::kCompute);
  EXPECT_EQ(grid.output.format, Format::kNpz);
  EXPECT_EQ(grid.output.axes, AxisOrder::kXyz);
  EXPECT_EQ(grid.output.dtype, DType::kFloat32);
  EXPECT_EQ(grid.output.palette_max, 7);
  EXPECT_EQ(grid.output.level, 3);
  EXPECT_EQ(grid.output.level_rule, LevelRule::kMajority);
  EXPECT_EQ(grid.output.region, (std::array<int, 6>{1, 2, 3, 4, 5, 6}));
  EXPECT_FALSE(grid.use_cache);
  EXPECT_EQ(grid.filename, "a.ply");
  EXPECT_EQ(parsed({{"voxel_size", "0.5"}}, OptionScope::kVoxelize).voxelize.placement.voxel_size,
            (std::array<double, 3>{0.5, 0.5, 0.5}));
}

TEST(Options, images_values_reach_their_fields) {
  const RenderOptions render = parsed({{"width", "640"},
                                       {"height", "480"},
                                       {"projection", "orthographic"},
                                       {"azimuth", "-45"},
                                       {"elevation", "10.5"},
                                       {"zoom", "2"},
                                       {"background", "#01020304"},
                                       {"style", "iso"},
                                       {"occlusion", "yes"},
                                       {"shadow", "yes"},
                                       {"ground", "yes"},
                                       {"exposure", "3"},
                                       {"section", "1,0,0,-2"}},
                                      OptionScope::kRenderGrid)
                                   .render;
  EXPECT_EQ(render.width, 640);
  EXPECT_EQ(render.height, 480);
  EXPECT_EQ(render.projection, Projection::kOrthographic);
  EXPECT_EQ(render.azimuth_deg, -45);
  EXPECT_EQ(render.elevation_deg, 10.5);
  EXPECT_EQ(render.zoom, 2);
  EXPECT_EQ(render.background, (std::array<uint8_t, 4>{1, 2, 3, 4}));
  EXPECT_EQ(render.style, Style::kIso);
  EXPECT_TRUE(render.occlusion);
  EXPECT_TRUE(render.shadow);
  EXPECT_TRUE(render.ground);
  EXPECT_EQ(render.exposure, 3);
  EXPECT_EQ(render.section, (std::array<double, 4>{1, 0, 0, -2}));
}

TEST(Options, a_style_has_defaults_that_the_request_may_replace) {
  const auto of = [](const OptionPairs& pairs) {
    return parsed(pairs, OptionScope::kRenderGrid).render;
  };
  const RenderOptions voxel = of({}), smooth = of({{"style", "smooth"}});
  EXPECT_EQ(voxel.style, Style::kVoxel);
  EXPECT_TRUE(voxel.occlusion && voxel.shadow && voxel.ground);
  EXPECT_FALSE(smooth.occlusion || smooth.shadow || smooth.ground);
  EXPECT_FALSE(voxel.background.has_value());
  const RenderOptions iso = of({{"azimuth", "10"}, {"style", "iso"}, {"occlusion", "no"}});
  EXPECT_EQ(iso.projection, Projection::kOrthographic);
  EXPECT_EQ(iso.azimuth_deg, 10);
  EXPECT_NEAR(std::tan(iso.elevation_deg * std::acos(-1.0) / 180), std::sqrt(0.5), 1e-12);
  EXPECT_FALSE(iso.occlusion);
  EXPECT_EQ(of({{"style", "blueprint"}}).projection, Projection::kOrthographic);
  // A gradient would take most of a GIF's colours.
  EXPECT_EQ(of({{"image", "gif"}, {"turntable", "8"}}).background,
            (std::array<uint8_t, 4>{255, 255, 255, 255}));
}

TEST(Options, a_blueprint_takes_no_light_and_clay_no_exposure) {
  const auto detail = [](const OptionPairs& pairs) {
    return refused(pairs, OptionScope::kRenderGrid).message();
  };
  EXPECT_EQ(detail({{"style", "blueprint"}, {"shadow", "yes"}}),
            "style: expected another style with shadow, got \"blueprint\"");
  EXPECT_EQ(detail({{"style", "blueprint"}, {"exposure", "2"}}),
            "style: expected another style with exposure, got \"blueprint\"");
  EXPECT_EQ(detail({{"style", "clay"}, {"exposure", "2"}}),
            "exposure: expected style voxel, smooth or iso with it, got \"clay\"");
}

TEST(Options, unknown_names_are_refused_with_the_nearest_one) {
  const Error error = refused({{"siez", "1"}}, OptionScope::kVoxelize);
  EXPECT_EQ(error.code, ErrorCode::kUnknownOption);
  EXPECT_EQ(error.message(), "unknown option 'siez'; did you mean 'size'?");
  EXPECT_EQ(refused({{"voxelsize", "1"}}, OptionScope::kVoxelize).detail,
            "unknown option 'voxelsize'; did you mean 'voxel_size'?");
  EXPECT_EQ(refused({{"resolution", "1"}}, OptionScope::kVoxelize).message(),
            "unknown option 'resolution': expected one of region, animation, root_motion, …");
  // The name is echoed in part, whatever its length.
  EXPECT_EQ(refused({{std::string(1000, 'x'), "1"}}, OptionScope::kExport).detail,
            "unknown option '" + std::string(40, 'x') + "'");
}

TEST(Options, each_scope_takes_its_own_options_alone) {
  const std::string of_mesh =
      "size dims voxel_size padding bounds up units transform rule fill sign thickness interior "
      "color channels labels distance variant threshold pipeline animation time frames fps times "
      "root_motion ";
  const std::string of_output =
      "format codec layout axes dtype palette mesh channel compress blocks dither schem_version "
      "zarr_version ";
  const std::string of_selection = "level level_rule region alpha ";
  const std::string of_grid = "keep dilate erode hollow neighbors remap crop mirror ";
  const std::string of_image =
      "width height style projection azimuth elevation zoom matrix background occlusion shadow "
      "ground exposure samples renderer section image frame turntable rate columns ";
  const std::map<OptionScope, std::string> expected = {
      {OptionScope::kVoxelize, of_mesh + of_output + of_selection + of_grid},
      {OptionScope::kRenderMesh, of_mesh + of_selection + of_image},
      {OptionScope::kRenderGrid, "frames " + of_selection + of_image},
      {OptionScope::kExport, "frames " + of_output + of_selection + of_grid},
  };
  for (const auto& [scope, names] : expected) {
    std::string taken;
    for (const Option& option : option_table()) {
      const auto options = parse_options(OptionPairs{{std::string(option.name), "?"}}, scope);
      if (!options && options.error().code == ErrorCode::kUnknownOption) continue;
      taken += std::string(option.name) + " ";
    }
    EXPECT_EQ(taken, names + "cache filename ");
  }
  const Error error = refused({{"width", "5"}}, OptionScope::kVoxelize);
  EXPECT_EQ(error.message(), "option 'width' does not apply to this request");
}

TEST(Options, sign_and_thickness_need_a_fill_that_they_apply_to) {
  for (const char* sign : {"auto", "parity", "nonzero", "majority", "flood", "winding"}) {
    EXPECT_TRUE(
        parse_options(OptionPairs{{"fill", "solid"}, {"sign", sign}}, OptionScope::kVoxelize));
    EXPECT_TRUE(
        parse_options(OptionPairs{{"sign", sign}, {"fill", "shell"}}, OptionScope::kVoxelize));
    EXPECT_EQ(refused({{"sign", sign}}, OptionScope::kVoxelize).message(),
              "sign: expected fill solid or shell or channel distance with it, got \"surface\"");
  }
  EXPECT_EQ(
      refused({{"fill", "shell"}, {"channels", "coverage"}}, OptionScope::kVoxelize).message(),
      "channels: expected fill surface or solid with coverage, got \"shell\"");
  EXPECT_EQ(
      refused({{"fill", "solid"}, {"sign", "flood"}, {"channels", "coverage"}},
              OptionScope::kVoxelize)
          .message(),
      "sign: expected parity, nonzero, majority, winding or auto with coverage, got \"flood\"");
  for (const char* thickness : {"1", "256", "2.5"}) {
    EXPECT_TRUE(parse_options(OptionPairs{{"fill", "shell"}, {"thickness", thickness}},
                              OptionScope::kVoxelize));
    EXPECT_EQ(
        refused({{"fill", "solid"}, {"thickness", thickness}}, OptionScope::kVoxelize).message(),
        "thickness: expected fill shell or band with it, got \"solid\"");
  }
  const VoxelizeOptions shell =
      parsed({{"fill", "shell"}, {"sign", "flood"}, {"thickness", "2.5"}}, OptionScope::kVoxelize)
          .voxelize;
  EXPECT_EQ(shell.fill, Fill::kShell);
  EXPECT_EQ(shell.sign, Sign::kFlood);
  EXPECT_EQ(shell.thickness, 2.5);
}

TEST(Options, layout_sparse_needs_a_format_of_arrays_and_has_no_order_of_axes) {
  for (const OptionScope scope : {OptionScope::kVoxelize, OptionScope::kExport}) {
    for (const char* format : {"npy", "npz"}) {
      EXPECT_EQ(parsed({{"layout", "sparse"}, {"format", format}}, scope).output.layout,
                ArrayLayout::kSparse);
      EXPECT_EQ(
          refused({{"layout", "sparse"}, {"format", format}, {"axes", "xyz"}}, scope).message(),
          "axes: expected zyx, or layout dense, got \"xyz\"");
    }
    EXPECT_EQ(refused({{"layout", "sparse"}, {"format", "vox"}}, scope).message(),
              "layout: expected format npy or npz with it, got \"vox\"");
    EXPECT_EQ(refused({{"layout", "sparse"}}, scope).message(),
              "layout: expected format npy or npz with it, got \"native\"");
    EXPECT_EQ(parsed({{"layout", "atlas"}, {"format", "slices"}}, scope).output.layout,
              ArrayLayout::kAtlas);
    EXPECT_EQ(refused({{"layout", "atlas"}, {"format", "npz"}}, scope).message(),
              "layout: expected format slices with atlas, got \"npz\"");
    EXPECT_EQ(refused({{"layout", "sparse"}, {"format", "slices"}}, scope).message(),
              "layout: expected format npy or npz with it, got \"slices\"");
  }
}

TEST(Options, mesh_needs_a_format_of_meshes) {
  for (const OptionScope scope : {OptionScope::kVoxelize, OptionScope::kExport}) {
    for (const char* format : {"glb", "ply", "obj"}) {
      EXPECT_EQ(parsed({{"format", format}}, scope).output.mesh, MeshSurface::kGreedy);
      EXPECT_EQ(parsed({{"mesh", "faces"}, {"format", format}}, scope).output.mesh,
                MeshSurface::kFaces);
    }
    EXPECT_EQ(refused({{"mesh", "greedy"}, {"format", "vox"}}, scope).message(),
              "mesh: expected format glb, ply or obj with it, got \"vox\"");
    EXPECT_EQ(refused({{"mesh", "faces"}}, scope).message(),
              "mesh: expected format glb, ply or obj with it, got \"native\"");
    EXPECT_EQ(refused({{"mesh", "instances"}, {"format", "ply"}}, scope).message(),
              "mesh: expected format glb with instances, got \"ply\"");
    EXPECT_EQ(refused({{"compress", "meshopt"}, {"format", "obj"}}, scope).message(),
              "compress: expected format glb with it, got \"obj\"");
    EXPECT_EQ(parsed({{"compress", "meshopt"}, {"format", "glb"}}, scope).output.compress,
              MeshCompression::kMeshopt);
  }
}

TEST(Options, channel_needs_a_format_of_one_array) {
  for (const OptionScope scope : {OptionScope::kVoxelize, OptionScope::kExport}) {
    for (const char* format : {"nrrd", "mha", "nii", "ktx2", "raw", "slices"}) {
      EXPECT_EQ(parsed({{"format", format}}, scope).output.channel, std::nullopt);
      EXPECT_EQ(parsed({{"format", format}, {"channel", "occupancy"}}, scope).output.channel,
                std::nullopt);
      EXPECT_EQ(parsed({{"channel", "color"}, {"format", format}}, scope).output.channel,
                Channel::kColor);
    }
    EXPECT_EQ(refused({{"channel", "color"}, {"format", "vti"}}, scope).message(),
              "channel: expected format nrrd, mha, nii, ktx2, raw or slices with it, got \"vti\"");
    EXPECT_EQ(
        refused({{"channel", "occupancy"}}, scope).message(),
        "channel: expected format nrrd, mha, nii, ktx2, raw or slices with it, got \"native\"");
  }
}

TEST(Options, channel_is_one_that_the_grid_may_have) {
  const auto with = [](const OptionPairs& more) {
    OptionPairs pairs = {{"format", "nrrd"}};
    pairs.insert(pairs.end(), more.begin(), more.end());
    return pairs;
  };
  constexpr OptionScope kMade = OptionScope::kVoxelize;
  EXPECT_EQ(refused(with({{"channel", "label"}}), kMade).message(),
            "channel: expected channels with label, got \"label\"");
  EXPECT_EQ(refused(with({{"channel", "distance"}}), kMade).message(),
            "channel: expected channels with distance, got \"distance\"");
  EXPECT_EQ(
      refused(with({{"channel", "color"}, {"channels", "occupancy,normal"}}), kMade).message(),
      "channel: expected channels with color, got \"color\"");
  EXPECT_TRUE(parse_options(with({{"channel", "label"}, {"channels", "label"}}), kMade));
  EXPECT_TRUE(parse_options(with({{"channel", "distance"}, {"fill", "band"}}), kMade));
  // The worker knows the channels of a stored grid.
  EXPECT_TRUE(parse_options(with({{"channel", "label"}}), OptionScope::kExport));
}

TEST(Options, changes_of_voxels_need_what_they_change) {
  for (const OptionScope scope : {OptionScope::kVoxelize, OptionScope::kExport}) {
    EXPECT_EQ(refused({{"neighbors", "26"}}, scope).message(),
              "neighbors: expected keep, dilate, erode or hollow with it, got \"none of them\"");
    EXPECT_EQ(parsed({{"neighbors", "26"}, {"keep", "3"}}, scope).output.neighbors,
              Neighbors::kCorners);
  }
  EXPECT_EQ(refused({{"fill", "band"}, {"dilate", "1"}}, OptionScope::kVoxelize).message(),
            "dilate: expected channels without distance, got \"distance\"");
  EXPECT_EQ(refused({{"remap", "1:2"}}, OptionScope::kVoxelize).message(),
            "remap: expected channels with label, got \"channels without it\"");
  EXPECT_EQ(refused({{"remap", "4:2,1:2,4:3"}}, OptionScope::kExport).message(),
            "remap: expected each label once before a colon, got \"4 more than once\"");
  std::string many = "1:1";
  for (int i = 2; i <= 64; ++i) many += "," + std::to_string(i) + ":1";
  EXPECT_EQ(parsed({{"remap", many}}, OptionScope::kExport).output.remap.size(), 64u);
  EXPECT_EQ(refused({{"remap", many + ",65:1"}}, OptionScope::kExport).message(),
            "remap: expected at most 64 changes, got \"65\"");
}

TEST(Options, blocks_dither_and_versions_need_formats_that_use_them) {
  for (const OptionScope scope : {OptionScope::kVoxelize, OptionScope::kExport}) {
    for (const char* format : {"schem", "litematic", "nbt"}) {
      const OutputOptions output =
          parsed({{"format", format}, {"blocks", "wool"}, {"dither", "bayer"}}, scope).output;
      EXPECT_EQ(output.blocks, std::vector<std::string>{"wool"});
      EXPECT_EQ(output.dither, Dither::kBayer);
    }
    EXPECT_EQ(parsed({{"format", "vox"}, {"dither", "error"}}, scope).output.dither,
              Dither::kError);
    EXPECT_EQ(parsed({{"format", "schem"}, {"schem_version", "3"}}, scope).output.schem_version, 3);
    EXPECT_EQ(refused({{"blocks", "wool"}, {"format", "vox"}}, scope).message(),
              "blocks: expected format schem, litematic or nbt with it, got \"vox\"");
    EXPECT_EQ(
        refused({{"dither", "bayer"}, {"format", "glb"}}, scope).message(),
        "dither: expected format vox, schem, litematic or nbt, or colours as palette with it, "
        "got \"glb\"");
    EXPECT_EQ(
        parsed({{"format", "glb"}, {"dither", "bayer"}, {"palette", "bw"}}, scope).output.dither,
        Dither::kBayer);
    EXPECT_EQ(refused({{"schem_version", "3"}, {"format", "litematic"}}, scope).message(),
              "schem_version: expected format schem with it, got \"litematic\"");
    EXPECT_EQ(parsed({{"format", "zarr"}, {"zarr_version", "2"}}, scope).output.zarr_version, 2);
    EXPECT_EQ(refused({{"zarr_version", "2"}, {"format", "npz"}}, scope).message(),
              "zarr_version: expected format zarr with it, got \"npz\"");
  }
}

TEST(Options, palettes_are_colours_each_once_in_their_order) {
  const OutputOptions output =
      parsed({{"format", "vox"}, {"palette", "#0A0b0c,ffffff,0a0b0C"}}, OptionScope::kExport)
          .output;
  EXPECT_EQ(output.palette, (std::vector<PaletteColor>{{10, 11, 12}, {255, 255, 255}}));
  EXPECT_EQ(parsed({{"palette", "000016"}}, OptionScope::kVoxelize).output.palette,
            (std::vector<PaletteColor>{{0, 0, 22}}));
  EXPECT_TRUE(parsed({{"palette", "16"}}, OptionScope::kVoxelize).output.palette.empty());
  EXPECT_EQ(refused({{"palette", "#000000,#00000g"}}, OptionScope::kVoxelize).message(),
            "palette, colour 2: expected #rrggbb, got \"#00000g\"");
  std::string many = "000000";
  for (int i = 0; i < 256; ++i) many += ",000000";
  EXPECT_EQ(refused({{"palette", many}}, OptionScope::kVoxelize).message(),
            "palette: expected at most 256 colours, got \"257\"");
  EXPECT_EQ(refused({{"palette", many + std::string(300, '0')}}, OptionScope::kVoxelize).message(),
            "palette: expected at most 2048 bytes, got 2098");
}

TEST(Options, palettes_need_formats_that_hold_colours) {
  for (const char* format :
       {"native", "npz", "xyz", "glb", "ply", "obj", "vti", "csv", "pcd", "qb", "vox"}) {
    EXPECT_EQ(parsed({{"format", format}, {"palette", "cga16"}}, OptionScope::kExport)
                  .output.palette.size(),
              16u);
  }
  EXPECT_TRUE(parse_options(OptionPairs{{"format", "nii"}, {"channel", "color"}, {"palette", "bw"}},
                            OptionScope::kExport));
  const auto error = [](const std::string& format, const std::string& palette) {
    return refused({{"format", format}, {"palette", palette}}, OptionScope::kExport).message();
  };
  EXPECT_EQ(error("nii", "bw"), "palette: expected channel color with it, got \"occupancy\"");
  EXPECT_EQ(error("npy", "bw"),
            "palette: expected a format that holds colours with it, got \"npy\"");
  EXPECT_EQ(error("binvox", "bw"),
            "palette: expected a format that holds colours with it, got \"binvox\"");
  EXPECT_EQ(error("bt", "bw"), "palette: expected a format that holds colours with it, got \"bt\"");
  EXPECT_EQ(error("inp", "bw"),
            "palette: expected a format that holds colours with it, got \"inp\"");
  EXPECT_EQ(error("nbt", "bw"), "palette: expected blocks instead in this format, got \"nbt\"");
  EXPECT_EQ(error("vox", "rgb332"), "palette: expected at most 255 colours of a vox, got \"256\"");
}

TEST(Options, names_of_blocks_have_one_form) {
  const auto blocks = [](const std::string& text) {
    return parsed({{"format", "schem"}, {"blocks", text}}, OptionScope::kExport).output.blocks;
  };
  using Names = std::vector<std::string>;
  EXPECT_EQ(blocks("wool,concrete,wool"), (Names{"concrete", "wool"}));
  EXPECT_EQ(blocks("red_wool,minecraft:dirt,concrete"), (Names{"concrete", "red_wool", "dirt"}));
  EXPECT_EQ(blocks("red_wool,wool"), Names{"wool"});
  EXPECT_EQ(blocks("stone"), Names{"stone"});  // the group
  EXPECT_EQ(blocks("minecraft:stone"), Names{"minecraft:stone"});
  EXPECT_EQ(blocks("minecraft:stone,stone"), Names{"stone"});
  const Error error =
      refused({{"format", "schem"}, {"blocks", "wool,concreet"}}, OptionScope::kExport);
  EXPECT_EQ(error.code, ErrorCode::kInvalidOption);
  EXPECT_TRUE(error.expected.ends_with("plant; did you mean 'concrete'?")) << error.expected;
  EXPECT_EQ(error.got, "\"concreet\"");
}

TEST(Options, an_option_is_given_once) {
  EXPECT_EQ(refused({{"size", "5"}, {"up", "y"}, {"size", "5"}}, OptionScope::kVoxelize).message(),
            "size: expected to be given once, got it twice");
}

TEST(Options, size_dims_and_voxel_size_exclude_each_other) {
  const std::pair<std::string, std::string> size{"size", "5"}, dims{"dims", "5,5,5"},
      voxel_size{"voxel_size", "1"};
  for (const OptionPairs& pairs :
       {OptionPairs{size, dims}, OptionPairs{size, voxel_size}, OptionPairs{dims, voxel_size}}) {
    const Error error = refused(pairs, OptionScope::kVoxelize);
    EXPECT_EQ(error.code, ErrorCode::kInvalidOption);
    EXPECT_EQ(error.message(),
              "size, dims and voxel_size exclude each other: expected at most one of them, got 2");
  }
  EXPECT_EQ(refused({size, dims, voxel_size}, OptionScope::kVoxelize).got, "3");
}

TEST(Options, rule_none_needs_something_else_than_a_surface) {
  for (const OptionPairs& pairs :
       {OptionPairs{{"rule", "none"}}, OptionPairs{{"rule", "none"}, {"fill", "surface"}}}) {
    const Error error = refused(pairs, OptionScope::kVoxelize);
    EXPECT_EQ(error.code, ErrorCode::kInvalidOption);
    EXPECT_EQ(error.message(),
              "rule: expected touch, thin or center where fill is surface, got \"none\"");
  }
}

TEST(Options, padding_leaves_room_also_in_the_default_size) {
  EXPECT_EQ(refused({{"size", "8"}, {"padding", "4"}}, OptionScope::kVoxelize).message(),
            "padding: expected less than half of size 8, got \"4\"");
  EXPECT_TRUE(parse_options(OptionPairs{{"size", "9"}, {"padding", "4"}}, OptionScope::kVoxelize));
  EXPECT_EQ(refused({{"padding", "64"}}, OptionScope::kVoxelize).message(),
            "padding: expected less than half of size 128, got \"64\"");
  EXPECT_EQ(refused({{"dims", "64,9,8"}, {"padding", "4"}}, OptionScope::kVoxelize).message(),
            "padding: expected less than half of each of dims, got \"4\"");
  EXPECT_TRUE(
      parse_options(OptionPairs{{"voxel_size", "1"}, {"padding", "512"}}, OptionScope::kVoxelize));
}

TEST(Options, formats_have_names_media_types_and_extensions) {
  for (const Format format : {Format::kNative, Format::kNpy, Format::kNpz, Format::kVox}) {
    EXPECT_EQ(format_from_name(format_name(format)), format);
    EXPECT_TRUE(format_extension(format).starts_with('.'));
    EXPECT_NE(format_media_type(format).find('/'), std::string_view::npos);
  }
  EXPECT_FALSE(format_from_name("stl"));
}

TEST(Options, interior_applies_to_solids_and_shells) {
  const auto solid = parsed({{"fill", "solid"}, {"interior", "nearest"}}, OptionScope::kVoxelize);
  EXPECT_EQ(solid.voxelize.interior, Interior::kNearest);
  EXPECT_EQ(parsed({{"fill", "shell"}}, OptionScope::kVoxelize).voxelize.interior, Interior::kNone);
  EXPECT_EQ(refused({{"interior", "nearest"}}, OptionScope::kVoxelize).message(),
            "interior: expected fill solid or shell with it, got \"surface\"");
  EXPECT_EQ(refused({{"fill", "band"}, {"interior", "none"}}, OptionScope::kVoxelize).message(),
            "interior: expected fill solid or shell with it, got \"band\"");
  EXPECT_EQ(
      parsed({{"fill", "solid"}, {"rule", "none"}, {"interior", "nearest"}}, OptionScope::kVoxelize)
          .voxelize.interior,
      Interior::kNearest);
}

TEST(Options, distances_have_a_sign_and_bands_have_distances) {
  const auto surface =
      parsed({{"channels", "occupancy,distance"}, {"sign", "parity"}}, OptionScope::kVoxelize);
  EXPECT_TRUE(surface.voxelize.names(Channel::kDistance));
  EXPECT_EQ(surface.voxelize.sign, Sign::kParity);
  EXPECT_EQ(parsed({{"fill", "band"}, {"sign", "winding"}}, OptionScope::kVoxelize).voxelize.sign,
            Sign::kWinding);
  EXPECT_EQ(refused({{"fill", "band"}, {"channels", "occupancy"}, {"sign", "winding"}},
                    OptionScope::kVoxelize)
                .message(),
            "sign: expected fill solid or shell or channel distance with it, got \"band\"");
}

TEST(Options, the_unit_of_distances_needs_distances) {
  for (const OptionPairs& pairs :
       {OptionPairs{{"fill", "band"}}, OptionPairs{{"channels", "distance"}}}) {
    OptionPairs asked = pairs;
    EXPECT_EQ(parsed(asked, OptionScope::kVoxelize).voxelize.distance, DistanceUnit::kVoxels);
    asked.emplace_back("distance", "world");
    EXPECT_EQ(parsed(asked, OptionScope::kVoxelize).voxelize.distance, DistanceUnit::kWorld);
  }
  for (const OptionPairs& pairs :
       {OptionPairs{{"distance", "world"}},
        OptionPairs{{"distance", "voxels"}, {"fill", "band"}, {"channels", "color"}}}) {
    EXPECT_EQ(refused(pairs, OptionScope::kVoxelize).message(),
              "distance: expected channel distance with it, got \"channels without it\"");
  }
}

TEST(Options, a_band_is_three_voxels_to_each_side) {
  EXPECT_EQ(parsed({{"fill", "band"}}, OptionScope::kVoxelize).voxelize.thickness, 3.0);
  EXPECT_EQ(parsed({{"fill", "shell"}}, OptionScope::kVoxelize).voxelize.thickness, 1.0);
  EXPECT_EQ(
      parsed({{"fill", "band"}, {"thickness", "7.5"}}, OptionScope::kVoxelize).voxelize.thickness,
      7.5);
}

}  // namespace
}  // namespace voxeld
