#include <gmock/gmock.h>

#include <cmath>

#include "server/scene/md5/animation.h"
#include "server/scene/md5/load.h"
#include "server/scene/md5/materials.h"
#include "tests/unit/base/points_passed.h"
#include "tests/unit/scene/scene_test_util.h"
#include "tests/unit/scene/zip_maker.h"

namespace voxeld {
namespace {

using test::bytes_of;
using test::message_of;
using test::ZipMaker;

// Two joints and a triangle; `mesh` stands for what is in the braces of mesh { }.
std::string mesh_file(const std::string& mesh, const std::string& joints =
                                                   "\"root\" -1 ( 0 0 0 ) ( 0 0 0 )\n"
                                                   "\"arm\" 0 ( 0 0 2 ) ( 0 0 0.70710678 )\n") {
  return "MD5Version 10\ncommandline \"\"\nnumJoints 2\nnumMeshes 1\njoints {\n" + joints +
         "}\nmesh {\n" + mesh + "}\n";
}

const std::string kMd5Triangle =
    "shader \"skin\"\nnumverts 3\n"
    "vert 0 ( 0 0 ) 0 1\nvert 1 ( 1 0 ) 1 1\nvert 2 ( 0 1 ) 2 2\n"
    "numtris 1\ntri 0 0 1 2\nnumweights 4\n"
    "weight 0 0 1 ( 1 0 0 )\nweight 1 1 1 ( 1 0 0 )\n"
    "weight 2 0 0.25 ( 0 4 0 )\nweight 3 1 0.75 ( 0 4 0 )\n";

std::string mesh_message(const std::string& text) {
  return message_of(parse_md5_mesh("a.md5mesh", text));
}

void expect_near(const glm::dvec3& a, const glm::dvec3& b) {
  EXPECT_LT(glm::length(a - b), 1e-6) << a.x << " " << a.y << " " << a.z;
}

TEST(Md5Mesh, vertices_are_weighted_places_in_turned_joints) {
  const auto mesh = parse_md5_mesh("a.md5mesh", mesh_file(kMd5Triangle));
  ASSERT_TRUE(mesh) << mesh.error().message();
  ASSERT_EQ(mesh->joints.size(), 2u);
  EXPECT_EQ(mesh->joints[1].name, "arm");
  EXPECT_EQ(mesh->joints[1].parent, 0);
  EXPECT_TRUE(mesh->warnings.empty());
  const auto positions = md5_positions(mesh->parts.at(0), mesh->joints);
  // A quarter turn around z whose w is not positive takes x to -y and y to x.
  expect_near(positions.at(0), {1, 0, 0});
  expect_near(positions.at(1), {0, -1, 2});
  expect_near(positions.at(2), glm::dvec3(0, 4, 0) * 0.25 + glm::dvec3(4, 0, 2) * 0.75);
}

TEST(Md5Mesh, each_vertex_and_triangle_can_be_cancelled) {
  const auto mesh = parse_md5_mesh("a.md5mesh", mesh_file(kMd5Triangle));
  ASSERT_TRUE(mesh) << mesh.error().message();
  const Md5Part& part = mesh->parts.at(0);
  const auto positions = md5_positions(part, mesh->joints);
  EXPECT_GE(test::points_passed([&] { (void)md5_positions(part, mesh->joints); }), 3);
  EXPECT_GE(test::points_passed([&] { (void)md5_normals(positions, part.indices); }), 1 + 3);
}

TEST(Md5Lexer, blanks_comments_and_words_of_any_length_can_be_cancelled) {
  constexpr size_t kMebi = size_t{1} << 20;
  const std::string letters(kMebi, 'x');
  for (const std::string& text : {std::string(kMebi, ' '), "//" + std::string(16 * kMebi, 'x'),
                                  "/*" + letters + "*/", "\"" + letters + "\"", letters}) {
    const auto read = [&] { EXPECT_TRUE(Md5Lexer("a.md5mesh", text).next().ok()); };
    EXPECT_GE(test::points_passed(read), 15) << text.substr(0, 3);
  }
}

TEST(Md5Mesh, a_part_takes_the_room_of_its_vertices) {
  const auto mesh = parse_md5_mesh("a.md5mesh", mesh_file(kMd5Triangle));
  ASSERT_TRUE(mesh) << mesh.error().message();
  const MeshPart part = md5_mesh_part(mesh->parts.at(0), mesh->joints);
  EXPECT_EQ(part.positions.size(), 3u);
  EXPECT_EQ(part.positions.capacity(), 3u);
  EXPECT_EQ(part.uvs.capacity(), 3u);
}

TEST(Md5Mesh, comments_blanks_and_quotes_are_taken_as_the_game_takes_them) {
  const auto plain = parse_md5_mesh("a.md5mesh", mesh_file(kMd5Triangle));
  const auto odd = parse_md5_mesh(
      "b.md5mesh",
      "/* a\n b */MD5Version//x\r\n10 commandline \"c:\\dir\\ -x\"\r\nnumMeshes\t1\r\n"
      "mesh{ // skin\r\n name \"body\" shader skin\n numverts 3 vert 0(-0 0)0 1 vert 1(1 .0)1 1"
      " vert 2(0 1e0)2 2 numtris 1/**/tri 0 0 1 2\r\nnumweights 4 weight 0 0 1(1 0 0)weight 1 1 "
      "1(1 0 0)"
      "weight 2 0 2.5e-1(0 4 0)weight 3 1 .75(0 +4 0)}"
      "numJoints 2 joints{\"root\"-1(0 0 0)(0 0 0)\"arm\"\t0(0 0 2)(0 0 0.70710678)}");
  ASSERT_TRUE(odd) << odd.error().message();
  EXPECT_EQ(odd->parts.at(0).name, "body");
  EXPECT_EQ(odd->parts.at(0).shader, "skin");
  EXPECT_EQ(odd->parts.at(0).indices, plain->parts.at(0).indices);
  EXPECT_EQ(md5_positions(odd->parts.at(0), odd->joints),
            md5_positions(plain->parts.at(0), plain->joints));
}

TEST(Md5Mesh, the_textbook_keywords_are_read) {
  std::string text = mesh_file(kMd5Triangle);
  for (const auto& [from, to] : {std::pair{"numJoints", "numberOfJoints"},
                                 {"numMeshes", "numberOfMeshes"},
                                 {"numtris", "numberOfTriangles"},
                                 {"tri 0", "triangle 0"},
                                 {"numverts", "numberOfVertices"},
                                 {"numweights", "numberOfWeights"}}) {
    text.replace(text.find(from), std::string(from).size(), to);
  }
  EXPECT_EQ(mesh_message(text), "ok");
}

TEST(Md5Mesh, numbers_put_entries_in_order_where_each_is_there_once) {
  std::string text = mesh_file(kMd5Triangle);
  const auto sorted = parse_md5_mesh("a.md5mesh", text);
  const std::string first = "vert 0 ( 0 0 ) 0 1\n", second = "vert 1 ( 1 0 ) 1 1\n";
  text.replace(text.find(first), first.size() + second.size(), second + first);
  const auto shuffled = parse_md5_mesh("a.md5mesh", text);
  ASSERT_TRUE(shuffled) << shuffled.error().message();
  EXPECT_TRUE(shuffled->warnings.empty());
  EXPECT_EQ(md5_positions(shuffled->parts.at(0), shuffled->joints),
            md5_positions(sorted->parts.at(0), sorted->joints));
  text.replace(text.find("vert 1"), 6, "vert 7");
  const auto gaps = parse_md5_mesh("a.md5mesh", text);
  ASSERT_TRUE(gaps) << gaps.error().message();
  ASSERT_EQ(gaps->warnings.size(), 1u);
  EXPECT_EQ(gaps->warnings[0].code, "wrong-numbers");
  expect_near(md5_positions(gaps->parts.at(0), gaps->joints).at(0), {0, -1, 2});
}

TEST(Md5Mesh, counts_at_the_head_may_lie) {
  std::string text = mesh_file(kMd5Triangle);
  text.replace(text.find("numJoints 2"), 11, "numJoints 7");
  text.replace(text.find("numMeshes 1"), 11, "numMeshes 0");
  const auto mesh = parse_md5_mesh("a.md5mesh", text);
  ASSERT_TRUE(mesh) << mesh.error().message();
  ASSERT_EQ(mesh->warnings.size(), 2u);
  EXPECT_EQ(mesh->warnings[0].detail, "a.md5mesh: numJoints says 7, the file has 2");
  EXPECT_EQ(mesh->warnings[1].detail, "a.md5mesh: numMeshes says 0, the file has 1");
}

TEST(Md5Mesh, each_error_names_its_line) {
  const auto with = [](const std::string& from, const std::string& to) {
    std::string text = mesh_file(kMd5Triangle);
    const size_t at = text.find(from);
    EXPECT_NE(at, text.npos) << from;
    return mesh_message(text.replace(at, from.size(), to));
  };
  EXPECT_EQ(with("MD5Version 10", "MD5Version 6"),
            "a.md5mesh line 1: MD5Version 6: expected MD5Version 10, got 6");
  EXPECT_EQ(with("MD5Version 10", "MD5Version ten"),
            "a.md5mesh line 1: MD5Version: expected 10, got \"ten\"");
  EXPECT_EQ(with("\"arm\" 0", "\"arm\" 1"),
            "a.md5mesh line 7: parent of joint \"arm\": expected -1 or the number of a joint "
            "before it, 0, got \"1\"");
  EXPECT_EQ(
      with("\"root\" -1", "\"root\" 0"),
      "a.md5mesh line 6: parent of joint \"root\": expected -1, as no joint is before it, got "
      "\"0\"");
  EXPECT_EQ(with("( 0 0 2 )", "( 0 0 nan )"),
            "a.md5mesh line 7: position of a joint: expected a finite number, got \"nan\"");
  EXPECT_EQ(with("( 0 0 0.70710678 )", "( 0 0 2 )"),
            "a.md5mesh line 7: orientation of a joint: expected x, y, z of a unit quaternion, got "
            "length 2.000000");
  EXPECT_EQ(with("( 0 0 2 )", "0 0 2 )"),
            "a.md5mesh line 7: position of a joint: expected (, got \"0\"");
  EXPECT_EQ(with("numverts 3", "numverts 4"),
            "a.md5mesh line 15: vert 3 of 4 is missing: expected vert, got \"numtris\"");
  EXPECT_EQ(
      with("numverts 3", "numverts 2"),
      "a.md5mesh line 14: more entries than were announced: expected 2 of vert, got \"vert\"");
  EXPECT_EQ(with("numverts 3", "numverts 100000000"),
            "a.md5mesh line 11: truncated: numverts 100000000: expected at least 1400000000 bytes, "
            "got 193 bytes left");
  EXPECT_EQ(
      with("vert 2 ( 0 1 ) 2 2", "vert 2 ( 0 1 ) 2 0"),
      "a.md5mesh line 14: number of weights: expected a whole number from 1 to 256, got \"0\"");
  EXPECT_EQ(with("vert 2 ( 0 1 ) 2 2", "vert 2 ( 0 1 ) 3 2"),
            "a.md5mesh line 22, mesh 0: vert 2 has a weight that is not there: expected 0..3, "
            "got 4");
  EXPECT_EQ(with("numweights 4\n"
                 "weight 0 0 1 ( 1 0 0 )\nweight 1 1 1 ( 1 0 0 )\n"
                 "weight 2 0 0.25 ( 0 4 0 )\nweight 3 1 0.75 ( 0 4 0 )\n",
                 ""),
            "a.md5mesh line 17, mesh 0: vert 0 has a weight that is not there: expected none, as "
            "there are no weights, got 0");
  EXPECT_EQ(with("tri 0 0 1 2", "tri 0 0 1 3"),
            "a.md5mesh line 22, mesh 0: tri 0 has a vertex that is not there: expected 0..2, "
            "got 3");
  EXPECT_EQ(with("weight 3 1", "weight 3 2"),
            "a.md5mesh mesh 0: weight 3 has a joint that is not there: expected 0..1, got 2");
  EXPECT_EQ(with("shader \"skin\"", "shader \"skin"),
            "a.md5mesh line 10: a string without an end: expected \", got \"skin\"");
  EXPECT_EQ(with("shader", "/* shader"),
            "a.md5mesh line 10: a comment without an end: expected */, got the end of the file");
  EXPECT_EQ(with("shader", "colour"),
            "a.md5mesh line 10: unknown keyword: expected name, shader, numverts, numtris, "
            "numweights or }, got \"colour\"");
  EXPECT_EQ(mesh_message("MD5Version 10\njoints { }\n"),
            "a.md5mesh: no joints: expected joints { … }");
}

std::string anim_file(const std::string& frames, const std::string& components = "3") {
  return "MD5Version 10\ncommandline \"\"\nnumFrames 2\nnumJoints 2\nframeRate 10\n"
         "numAnimatedComponents " +
         components +
         "\nhierarchy {\n\"root\" -1 5 0\n\"arm\" 0 32 2\n}\n"
         "bounds {\n( 0 0 0 ) ( 1 1 1 )\n}\n"
         "baseframe {\n( 1 2 3 ) ( 0 0 0 )\n( 0 0 2 ) ( 0 0 0 )\n}\n" +
         frames;
}

const std::string kFrames = "frame 0 {\n10 30 0\n}\nframe 1 {\n20 40 0.70710678\n}\n";

TEST(Md5Anim, flags_say_which_numbers_a_frame_has) {
  const auto anim = parse_md5_anim("a.md5anim", anim_file(kFrames));
  ASSERT_TRUE(anim) << anim.error().message();
  EXPECT_EQ(anim->frame_count, 2u);
  EXPECT_DOUBLE_EQ(anim->duration(), 0.1);
  const auto first = md5_local_pose(*anim, 0.0);
  expect_near(first[0].position, {10, 2, 30});
  expect_near(first[1].position, {0, 0, 2});
  const auto last = md5_local_pose(*anim, 99.0);
  expect_near(last[0].position, {20, 2, 40});
  expect_near(last[1].orientation * glm::dvec3(1, 0, 0), {0, -1, 0});
  const auto model = md5_model_pose(*anim, last);
  expect_near(model[1].position, {20, 2, 42});
}

TEST(Md5Anim, between_frames_places_go_straight_and_turns_go_round) {
  const auto anim = parse_md5_anim("a.md5anim", anim_file(kFrames));
  ASSERT_TRUE(anim) << anim.error().message();
  const auto half = md5_local_pose(*anim, 0.05);
  expect_near(half[0].position, {15, 2, 35});
  // Half of a quarter turn is an eighth.
  const double r = std::sqrt(0.5);
  expect_near(half[1].orientation * glm::dvec3(1, 0, 0), {r, -r, 0});
}

TEST(Md5Anim, frames_without_numbers_are_the_base_frame) {
  const std::string text =
      "MD5Version 10 numFrames 2 numJoints 1 frameRate 24 numAnimatedComponents 0 "
      "hierarchy { \"root\" -1 0 0 } baseframe { ( 1 2 3 ) ( 0 0 0 ) } frame 0 { } frame 1{}";
  const auto anim = parse_md5_anim("a.md5anim", text);
  ASSERT_TRUE(anim) << anim.error().message();
  expect_near(md5_local_pose(*anim, 0.02)[0].position, {1, 2, 3});
}

TEST(Md5Anim, frames_may_stand_in_any_order) {
  const std::string swapped = "frame 1 {\n20 40 0.70710678\n}\nframe 0 {\n10 30 0\n}\n";
  const auto anim = parse_md5_anim("a.md5anim", anim_file(swapped));
  ASSERT_TRUE(anim) << anim.error().message();
  expect_near(md5_local_pose(*anim, 0.0)[0].position, {10, 2, 30});
}

TEST(Md5Anim, each_error_names_its_line) {
  const auto message = [](const std::string& text) {
    return message_of(parse_md5_anim("a.md5anim", text));
  };
  EXPECT_EQ(message(anim_file("frame 0 {\n1 2\n}\n")),
            "a.md5anim line 20: frame 0 ends after 2 numbers: expected 3 numbers, got \"}\"");
  EXPECT_EQ(message(anim_file("frame 0 {\n1 2 3 4\n}\n")),
            "a.md5anim line 19: frame 0 of 3 numbers: expected }, got \"4\"");
  EXPECT_EQ(message(anim_file("frame 0 {\n1 2 3\n}\nframe 0 {\n1 2 3\n}\n")),
            "a.md5anim: a frame is there twice: expected frames 0 to 1, each once, got frame 0");
  EXPECT_EQ(message(anim_file("frame 1 {\n1 2 3\n}\n")),
            "a.md5anim: frames are missing: expected frame 0, got frame 1");
  EXPECT_EQ(message(anim_file("frame 0 {\n1 2 3\n}\nframe 2 {\n1 2 3\n}\n")),
            "a.md5anim: frames are missing: expected frames 0 to 1, each once, got frame 2");
  EXPECT_EQ(message(anim_file(kFrames, "2")),
            "a.md5anim: joint \"arm\" has components beyond a frame's: expected "
            "numAnimatedComponents of 3 at least, got 2");
  EXPECT_EQ(message(anim_file("")), "a.md5anim: no frames: expected frame 0");
  std::string slow = anim_file(kFrames);
  slow.replace(slow.find("frameRate 10"), 12, "frameRate 0");
  EXPECT_EQ(message(slow),
            "a.md5anim line 5: frameRate: expected frames per second, above 0, got \"0\"");
}

TEST(Md5Match, joints_agree_by_name_and_parent_whatever_their_order) {
  const auto anim = parse_md5_anim("b.md5anim", anim_file(kFrames));
  ASSERT_TRUE(anim) << anim.error().message();
  const auto joint = [](const char* name, int parent) { return Md5Joint{name, parent, {}, {}}; };
  const auto message = [&](const std::vector<Md5Joint>& joints) {
    return message_of(match_md5_joints("a.md5mesh", joints, "b.md5anim", *anim));
  };
  EXPECT_EQ(message({joint("root", -1), joint("arm", 0)}), "ok");
  EXPECT_EQ(message({joint("root", -1), joint("leg", 0)}),
            "b.md5anim does not fit a.md5mesh: joints that only the mesh has: expected the mesh's "
            "joints, got \"leg\"");
  EXPECT_EQ(message({joint("root", -1)}),
            "b.md5anim does not fit a.md5mesh: joints that only the animation has: expected the "
            "mesh's joints, got \"arm\"");
  EXPECT_EQ(message({joint("root", -1), joint("arm", -1)}),
            "b.md5anim does not fit a.md5mesh: joints with other parents: expected the parents of "
            "the mesh, got \"arm\"");
  EXPECT_EQ(message({joint("root", -1), joint("arm", 0), joint("arm", 0)}),
            "b.md5anim does not fit a.md5mesh: joints of the mesh with one name: expected names "
            "once, got \"arm\"");
}

TEST(Md5Materials, the_diffuse_image_of_a_material_is_found) {
  const auto images = parse_mtr(
      "// skins\ntable sinus { { 0, 1 } }\n"
      "models/A\\skin\n{\n noselfshadow\n diffusemap models/a/skin_d.tga\n bumpmap "
      "addnormals(models/a/skin_local.tga, heightmap(models/a/skin_h.tga, 4))\n}\n"
      "material glow { { blend specularmap map s.tga } { blend diffusemap map "
      "makealpha( g.png ) alphaTest .5 } }\n"
      "broken { diffusemap");
  EXPECT_THAT(images,
              testing::UnorderedElementsAre(testing::Pair("models/a/skin", "models/a/skin_d.tga"),
                                            testing::Pair("glow", "g.png")));
}

TEST(Md5Materials, shaders_find_files_by_material_extension_and_base_name) {
  const auto found = [](std::vector<std::pair<std::string, std::string>> files,
                        std::string_view shader) {
    ZipMaker zip;
    for (const auto& [name, content] : files) zip.add(name, content);
    const std::string bytes = zip.bytes();
    const auto bundle = zip_bundle(bytes_of(bytes));
    return Md5Images(**bundle, "models/x.md5mesh").find(shader).value_or("none");
  };
  EXPECT_EQ(found({{"skin.png", ""}}, "skin.png"), "skin.png");
  EXPECT_EQ(found({{"textures/Skin.TGA", ""}}, "models\\monsters\\skin"), "textures/Skin.TGA");
  EXPECT_EQ(found({{"skin_d.jpg", ""}}, "C:\\game\\skin.tga"), "skin_d.jpg");
  EXPECT_EQ(
      found({{"a.mtr", "models/skin { diffusemap other.tga }"}, {"other.png", ""}}, "models/Skin"),
      "other.png");
  EXPECT_EQ(found({{"a.txt", ""}}, "skin"), "none");
}

TEST(Md5Scene, stands_up_and_faces_outwards) {
  const auto scene = test::load_text("a.md5mesh", mesh_file(kMd5Triangle));
  ASSERT_TRUE(scene) << scene.error().message();
  test::expect_consistent(*scene);
  EXPECT_EQ(scene->format, "md5mesh");
  const MeshPart& part = scene->parts.at(0);
  EXPECT_EQ(part.name, "skin");
  EXPECT_EQ(test::origins_of(*scene), std::vector<std::string>{"skin | skin | "});
  expect_near(part.positions[1], {0, 2, 1});
  EXPECT_EQ(part.indices, (std::vector<uint32_t>{0, 2, 1}));
  const glm::dvec3 face =
      glm::cross(part.positions[2] - part.positions[0], part.positions[1] - part.positions[0]);
  ASSERT_EQ(part.normals.size(), part.positions.size());
  for (const glm::vec3& normal : part.normals) {
    EXPECT_NEAR(glm::dot(glm::dvec3(normal), glm::normalize(face)), 1.0, 1e-6);
  }
  ASSERT_EQ(scene->missing_files.size(), 1u);
  EXPECT_EQ(scene->missing_files[0].name, "skin");
}

// As an OBJ that names no texture.
TEST(Md5Scene, the_only_image_of_a_zip_is_taken_where_no_shader_finds_one) {
  const auto with = [](const std::vector<const char*>& images) {
    test::ZipMaker zip;
    zip.add("a.md5mesh", mesh_file(kMd5Triangle));
    for (const char* image : images) zip.add(image, "x");
    const std::string bytes = zip.add("__MACOSX/._t.png", "").bytes();
    auto scene = test::load_text("a.zip", bytes);
    EXPECT_TRUE(scene) << scene.error().message();
    return *std::move(scene);
  };
  const Scene one = with({"textures/Guard.PNG"});
  ASSERT_EQ(one.warnings.size(), 1u);
  EXPECT_EQ(one.warnings[0].code, "assumed-texture");
  EXPECT_EQ(one.warnings[0].detail,
            "a.md5mesh names no texture of the upload; textures/Guard.PNG, its only image, is "
            "used");
  EXPECT_THAT(one.missing_files, testing::IsEmpty());
  EXPECT_EQ(one.materials.at(0).name, "skin");
  ASSERT_EQ(one.materials.at(0).image, 0);
  EXPECT_EQ(one.images.at(0).name, "textures/Guard.PNG");
  EXPECT_TRUE(one.has_colors());
  EXPECT_EQ(with({"a.png", "b.png"}).missing_files.at(0).name, "skin");
  EXPECT_EQ(with({}).warnings.at(0).code, "missing-texture");
  const Scene named = with({"skin.tga"});
  EXPECT_THAT(named.warnings, testing::IsEmpty());
  EXPECT_EQ(named.images.at(0).name, "skin.tga");
}

TEST(Md5Scene, the_first_word_identifies_a_mesh_and_an_animation_is_not_one) {
  EXPECT_TRUE(test::load_text("", mesh_file(kMd5Triangle)));
  const std::string anim = anim_file(kFrames);
  const std::string as_textbook =
      std::string(anim).replace(anim.find("numFrames"), 9, "numberOfFrames");
  for (const auto& [name, text] : {std::pair<const char*, std::string>{"walk.md5anim", anim},
                                   {"WALK.MD5ANIM", "?"},
                                   {"", anim},
                                   {"", "\xef\xbb\xbf" + as_textbook},
                                   {"walk.txt", anim}}) {
    const auto scene = test::load_text(name, text);
    EXPECT_EQ(message_of(scene),
              (*name == '\0' ? "the upload" : std::string(name)) +
                  ": an MD5 animation, which moves a mesh and has no surface of its own: expected "
                  "a bundle or zip of it with its md5mesh, got an animation alone");
    EXPECT_EQ(scene.error().code, ErrorCode::kUnsupportedMedia);
  }
}

}  // namespace
}  // namespace voxeld
