// Which files the command line sends along with a mesh.
#include "client/cli/bundle.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <thread>

#include "tests/unit/client/client_test_tools.h"
#include "tests/unit/client/scripted_server.h"

namespace voxeld::cli {
namespace {

namespace fs = std::filesystem;
using client::error_of;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::vector<std::string> paths_of(const fs::path& mesh) {
  std::vector<std::string> paths;
  for (const ReferencedFile& file : referenced_files(mesh)) paths.push_back(file.path);
  return paths;
}

class Bundle : public ::testing::Test {
 protected:
  Bundle()
      : outer_(fs::temp_directory_path() / ("unit_client-bundle-" + std::to_string(getpid()))) {
    fs::create_directories(folder());
  }
  ~Bundle() override { fs::remove_all(outer_); }
  fs::path folder() const { return outer_ / "meshes"; }
  fs::path put(const std::string& name, const std::string& text = "x") const {
    const fs::path path = folder() / name;
    fs::create_directories(path.parent_path());
    std::ofstream(path, std::ios::binary) << text;
    return path;
  }

  fs::path outer_;
};

TEST_F(Bundle, an_obj_gives_its_materials_and_their_textures) {
  put("a.mtl", "newmtl m\nKd 1 1 1\nmap_Kd skin.png\nmap_d mask.png\n");
  put("skin.png");
  put("mask.png");
  put("unrelated.png");
  EXPECT_THAT(paths_of(put("a.obj", "mtllib a.mtl\nv 0 0 0\n")),
              ElementsAre("a.mtl", "skin.png", "mask.png"));
}

TEST_F(Bundle, options_before_the_name_of_a_texture_are_skipped) {
  put("a.mtl",
      "map_Kd -s 1 2 3 -o 0.5 one.png\n"
      "map_Kd -clamp on -mm 0 1 two.png\n"
      "map_Bump -bm 1.0 three.png\n");
  for (const char* name : {"one.png", "two.png", "three.png"}) put(name);
  EXPECT_THAT(paths_of(put("a.obj", "mtllib a.mtl\n")),
              ElementsAre("a.mtl", "one.png", "two.png", "three.png"));
}

TEST_F(Bundle, names_may_hold_blanks_also_after_options) {
  put("my materials.mtl", "map_Kd the skin.png\nmap_Kd -s 1 1 1 the other skin.png\n");
  put("the skin.png");
  put("the other skin.png");
  EXPECT_THAT(paths_of(put("a b.obj", "mtllib my materials.mtl\n")),
              ElementsAre("my materials.mtl", "the skin.png", "the other skin.png"));
}

TEST_F(Bundle, the_longest_name_that_exists_counts) {
  put("a.mtl", "map_Kd the skin.png\n");
  put("the skin.png");
  put("skin.png");
  EXPECT_THAT(paths_of(put("a.obj", "mtllib a.mtl\n")), ElementsAre("a.mtl", "the skin.png"));
}

TEST_F(Bundle, one_mtllib_line_may_name_several_files) {
  put("a.mtl", "map_Kd a.png\n");
  put("b.mtl", "map_Kd b.png\n");
  put("a.png");
  put("b.png");
  EXPECT_THAT(paths_of(put("a.obj", "mtllib a.mtl b.mtl\n")),
              ElementsAre("a.mtl", "b.mtl", "a.png", "b.png"));
}

TEST_F(Bundle, lines_may_end_with_cr_and_lf_and_be_indented_with_tabs) {
  put("a.mtl", "newmtl m\r\n\tmap_Kd\tskin.png \r\n\r\n");
  put("skin.png");
  EXPECT_THAT(paths_of(put("a.obj", "# text\r\n mtllib \t a.mtl \r\nv 0 0 0\r\n")),
              ElementsAre("a.mtl", "skin.png"));
}

TEST_F(Bundle, comments_behind_names_do_not_count) {
  put("my lib.mtl", "map_Kd -clamp on one.png # of the skin\nmap_Kd #2.png\n");
  put("b.mtl");
  put("one.png");
  put("#2.png");
  EXPECT_THAT(paths_of(put("a.obj", "mtllib my lib.mtl # first\nmtllib b.mtl\t#last\n")),
              ElementsAre("my lib.mtl", "b.mtl", "one.png", "#2.png"));
}

TEST_F(Bundle, files_are_read_as_the_daemon_reads_them) {
  const auto utf16 = [](std::string_view text) {
    std::string wide = "\xff\xfe";
    for (const char c : text) wide.append({c, '\0'});
    return wide;
  };
  put("a.mtl", utf16("newmtl m\r\nmap_Kd one.png\r\n"));
  put("b.mtl", "\xef\xbb\xbfmap_Kd two.png\rmap_d three.png\r");
  for (const char* name : {"one.png", "two.png", "three.png"}) put(name);
  EXPECT_THAT(paths_of(put("a.obj", "\xef\xbb\xbfmtllib a.mtl\rmtllib b.mtl\rv 0 0 0\r\x1a")),
              ElementsAre("a.mtl", "b.mtl", "one.png", "two.png", "three.png"));
}

TEST_F(Bundle, backslashes_in_names_are_slashes) {
  put("sub/a.mtl", "map_Kd tex\\skin.png\n");
  put("tex/skin.png");
  EXPECT_THAT(paths_of(put("a.obj", "mtllib sub\\a.mtl\n")),
              ElementsAre("sub/a.mtl", "tex/skin.png"));
}

TEST_F(Bundle, keywords_of_materials_are_read_in_any_case) {
  put("a.mtl", "MAP_KD a.png\nmap_kd b.png\n");
  put("a.png");
  put("b.png");
  EXPECT_THAT(paths_of(put("a.OBJ", "mtllib a.mtl\n")), ElementsAre("a.mtl", "a.png", "b.png"));
}

// As a bundle on the daemon does (FileNames).
TEST_F(Bundle, files_are_found_in_another_case_folder_or_on_another_machine_s_disk) {
  put("wall.mtl",
      "map_Kd Textures\\BRICK.PNG\nmap_Kd C:\\Users\\me\\Skin.png\n"
      "map_Kd -clamp on /home/me/my moss.png\nmap_Kd bark.png\nmap_Kd leaf.png\n");
  put("textures/brick.png");
  put("textures/deep/skin.png");
  put("my moss.png");
  for (const char* name : {"Bark.png", "BARK.png", "oak/leaf.png", "elm/leaf.png"}) put(name);
  put(".hidden/leaf.png");
  EXPECT_THAT(
      paths_of(put("a.obj", "mtllib Wall.MTL\n")),
      ElementsAre("wall.mtl", "textures/brick.png", "textures/deep/skin.png", "my moss.png"));
  put("sub/b.mtl");
  EXPECT_THAT(paths_of(put("b.obj", "mtllib none.mtl D:\\y\\B.mtl sub/b.mtl\n")),
              ElementsAre("sub/b.mtl"));
}

TEST_F(Bundle, files_are_found_in_a_legacy_encoding) {
  put("\xb2\xc4.mtl", "map_Kd D:\\\xcf\xee\\\xcc\xf9\xcd\xbc.png\n");  // all in GBK
  put("贴图.png");
  put("\x95\x5c.png");  // 表 in Shift-JIS, with a backslash
  EXPECT_THAT(paths_of(put("a.obj", "mtllib \xb2\xc4.mtl\n")),
              ElementsAre("\xb2\xc4.mtl", "贴图.png"));
  put("b.mtl", "map_Kd \x95\x5c.png\n");
  EXPECT_THAT(paths_of(put("b.obj", "mtllib b.mtl\n")), ElementsAre("b.mtl", "\x95\x5c.png"));
}

TEST_F(Bundle, a_ply_gives_its_textures) {
  for (const char* name : {"my skin.png", "a_0.png", "tex/b.jpg", "c.png"}) put(name);
  EXPECT_THAT(paths_of(put("a.ply",
                           "ply\r\nformat binary_little_endian 1.0\r\n"
                           "comment TextureFile my skin.png \r\n"
                           "comment  texturefile\t<this>_0.png\r\n"
                           "comment TextureFile C:\\scan\\B.JPG\r\n"
                           "comment TextureFile\r\ncomment c.png\r\nend_header\r\n"
                           "comment TextureFile c.png\n")),
              ElementsAre("my skin.png", "a_0.png", "tex/b.jpg"));
}

TEST_F(Bundle, a_glb_gives_its_files) {
  put("skin.png");
  const std::string json = R"({"images":[{"uri":"skin.png"},{"bufferView":0}]})";
  std::string glb = "glTF" + std::string("\2\0\0\0\0\0\0\0", 8);
  glb += static_cast<char>(json.size());
  glb += std::string("\0\0\0JSON", 7) + json + "rest";
  EXPECT_THAT(paths_of(put("a.glb", glb)), ElementsAre("skin.png"));
  glb[14] = 1;  // longer than the file
  EXPECT_THAT(paths_of(put("a.glb", glb)), IsEmpty());
}

TEST_F(Bundle, several_libraries_with_folders_and_blanks_are_separated) {
  for (const char* name : {"a.mtl", "sub/b.mtl", "my own.mtl", "plain"}) put(name);
  EXPECT_THAT(paths_of(put("a.obj",
                           "mtllib a.mtl sub/b.mtl\nmtllib C:\\My Files\\my own.MTL "
                           "plain # of mine.mtl\n")),
              ElementsAre("a.mtl", "sub/b.mtl", "my own.mtl", "plain"));
}

TEST_F(Bundle, comments_and_lines_without_a_name_give_nothing) {
  put("a.mtl", "# map_Kd skin.png\nmap_Kd\nmap_Kd -s 1 1 1\nmap_Kd \r\n");
  put("skin.png");
  EXPECT_THAT(paths_of(put("a.obj", "#mtllib b.mtl\nmtllib\nmtllib a.mtl\n")),
              ElementsAre("a.mtl"));
}

TEST_F(Bundle, a_file_that_is_named_twice_comes_once) {
  put("a.mtl", "map_Kd skin.png\nmap_Kd ./skin.png\nmap_Ka tex/../skin.png\n");
  put("skin.png");
  EXPECT_THAT(paths_of(put("a.obj", "mtllib a.mtl\nmtllib a.mtl\n")),
              ElementsAre("a.mtl", "skin.png"));
}

TEST_F(Bundle, names_that_lead_outside_are_left_out) {
  std::ofstream(outer_ / "secret.png") << "x";
  const std::string secret = (outer_ / "secret.png").string();
  put("sub/x");
  put("a.mtl", "map_Kd ../secret.png\nmap_Kd sub/../../secret.png\nmap_Kd " + secret +
                   "\nmap_Kd ..\\secret.png\nmap_Kd /etc/passwd\nmap_Kd ..\nmap_Kd .\n");
  EXPECT_THAT(paths_of(put("a.obj", "mtllib a.mtl\nmtllib ../secret.png\n")), ElementsAre("a.mtl"));
  const fs::path gltf = put("a.gltf", R"({"images":[{"uri":"../secret.png"},)"
                                      R"({"uri":"%2e%2e/secret.png"},{"uri":"..%2Fsecret.png"},)"
                                      R"({"uri":")" +
                                          secret + R"("},{"uri":"file://)" + secret + R"("}]})");
  EXPECT_THAT(paths_of(gltf), IsEmpty());
}

TEST_F(Bundle, files_that_are_missing_or_empty_and_folders_are_left_out) {
  put("sub/x");
  put("empty.png", "");
  put("empty.mtl", "");
  put("a.mtl", "map_Kd missing.png\nmap_Kd sub\nmap_Kd empty.png\n");
  EXPECT_THAT(paths_of(put("a.obj", "mtllib a.mtl other.mtl empty.mtl\n")), ElementsAre("a.mtl"));
  put("empty.mtr", "");
  put("empty.md5anim", "");
  EXPECT_THAT(paths_of(put("a.md5mesh", "mesh {\nshader \"empty\"\n}\n")), IsEmpty());
}

TEST_F(Bundle, a_gltf_gives_buffers_and_images_with_percent_encoded_names) {
  put("my mesh.bin");
  put("tex/bäume.png");
  put("50%.png");
  put("a+b.png");
  const fs::path mesh = put("a.gltf", R"({"buffers":[{"uri":"my%20mesh.bin"},{"byteLength":3}],
    "images":[{"uri":"tex/b%C3%A4ume.png"},{"uri":"50%.png"},{"uri":"a+b.png"},
              {"uri":"data:image/png;base64,AAAA"},{"bufferView":1},{"uri":"my%20mesh.bin"}]})");
  EXPECT_THAT(paths_of(mesh), ElementsAre("my mesh.bin", "tex/bäume.png", "50%.png", "a+b.png"));
}

TEST_F(Bundle, a_gltf_that_is_broken_names_nothing) {
  for (const char* text :
       {"", "{", "[]", "7", R"({"images":7})", R"({"images":{"uri":"a.png"}})",
        R"({"images":[7,null,{"uri":7},{"uri":""},{"uri":"%"},{"uri":"%zz"},{"uri":"."}]})"}) {
    put("a.png");
    EXPECT_THAT(paths_of(put("a.gltf", text)), IsEmpty()) << text;
  }
}

TEST_F(Bundle, an_md5mesh_gives_materials_and_the_images_of_its_shaders) {
  for (const char* name : {"Body.png", "head_d.tga", "eye.jpg", "unrelated.png", "notes.txt"}) {
    put(name);
  }
  put("skins.mtr", "models/eyes\n{\n  diffusemap models/eye.tga\n}\n");
  EXPECT_THAT(paths_of(put("a.md5mesh",
                           "MD5Version 10\nmesh {\n\tshader \"body.tga\"\n}\nmesh {\n"
                           "\tshader \"models\\x\\head\"\n}\n")),
              ElementsAre("skins.mtr", "Body.png", "eye.jpg", "head_d.tga"));
}

TEST_F(Bundle, other_meshes_and_missing_ones_name_nothing) {
  put("a.mtl");
  EXPECT_THAT(paths_of(put("a.ply", "mtllib a.mtl\n")), IsEmpty());
  EXPECT_THAT(paths_of(put("a.glb", "mtllib a.mtl\n")), IsEmpty());
  EXPECT_THAT(paths_of(folder() / "missing.obj"), IsEmpty());
}

TEST_F(Bundle, a_mesh_in_the_working_folder_is_found_without_a_folder_in_its_name) {
  put("a.mtl");
  put("a.obj", "mtllib a.mtl\n");
  const fs::path before = fs::current_path();
  fs::current_path(folder());
  const auto names = paths_of("a.obj");
  fs::current_path(before);
  EXPECT_THAT(names, ElementsAre("a.mtl"));
}

TEST_F(Bundle, a_mesh_that_names_nothing_is_sent_as_it_is) {
  EXPECT_EQ(MeshSource::open(put("a.obj", "v 0 0 0\n")).source().filename(), "a.obj");
  EXPECT_EQ(MeshSource::open(put("a.ply")).source().filename(), "a.ply");
  EXPECT_EQ(MeshSource::open("-").source().filename(), "");
}

TEST_F(Bundle, a_mesh_that_names_itself_is_sent_once) {
  EXPECT_EQ(MeshSource::open(put("a.obj", "mtllib a.obj\n")).source().filename(), "a.obj");
  EXPECT_EQ(MeshSource::open(put("b.obj", "mtllib B.OBJ\n")).source().filename(), "b.obj");
  const fs::path gltf = put("a.gltf", R"({"buffers":[{"uri":"a.gltf"}]})");
  EXPECT_EQ(MeshSource::open(gltf).source().filename(), "a.gltf");
}

constexpr const char* kMd5Mesh =
    "MD5Version 10\njoints {\n\t\"hip\" -1 ( 0 0 0 ) ( 0 0 0 )\t// root\n  \"leg\" 0\n}\n";

TEST_F(Bundle, an_md5mesh_gives_the_animations_of_its_joints) {
  put("walk.md5anim", "hierarchy {\n  \"leg\" 1 0 0\n  \"hip\" -1 0 0\n}\n");
  put("run.MD5ANIM", "numFrames 2\nhierarchy {\n\"hip\" -1\n\"leg\" 0\n}\nbounds {\n}\n");
  put("other.md5anim", "hierarchy {\n\"hip\" -1\n\"arm\" 0\n}\n");
  put("more.md5anim", "hierarchy {\n\"hip\" -1\n\"leg\" 0\n\"arm\" 0\n}\n");
  put("broken.md5anim", "hierarchy {\n\"hip\n");
  EXPECT_THAT(paths_of(put("a.md5mesh", kMd5Mesh)), ElementsAre("run.MD5ANIM", "walk.md5anim"));
}

// Another user may have made the folder. Its links must not reach files outside of it.
TEST_F(Bundle, symbolic_links_out_of_the_folder_are_not_followed) {
  std::ofstream(outer_ / "secret.png") << "SECRET";
  std::ofstream(outer_ / "secret.mtl") << "map_Kd skin.png\n";
  std::ofstream(outer_ / "secret.mtr") << "skin.png\n";
  fs::create_directory(outer_ / "elsewhere");
  std::ofstream(outer_ / "elsewhere" / "b.png") << "SECRET";
  put("skin.png");
  fs::create_symlink("../secret.png", folder() / "near.png");
  fs::create_symlink(outer_ / "secret.png", folder() / "absolute.png");
  fs::create_symlink("near.png", folder() / "chain.png");
  fs::create_symlink("../elsewhere", folder() / "textures");
  fs::create_symlink("../secret.mtl", folder() / "linked.mtl");
  fs::create_symlink("../secret.mtr", folder() / "linked.mtr");
  put("a.mtl", "map_Kd near.png\nmap_Kd absolute.png\nmap_Kd chain.png\nmap_Kd textures/b.png\n");
  EXPECT_THAT(paths_of(put("a.obj", "mtllib a.mtl\nmtllib linked.mtl\n")), ElementsAre("a.mtl"));
  EXPECT_THAT(paths_of(put("a.gltf", R"({"images": [{"uri": "near.png"},
                  {"uri": "textures/b.png"}, {"uri": "textures%2Fb.png"}]})")),
              IsEmpty());
  EXPECT_THAT(paths_of(put("a.md5mesh", "mesh {\nshader \"near\"\n}\n")), IsEmpty());
}

TEST_F(Bundle, symbolic_links_within_the_folder_are_followed) {
  put("textures/skin.png");
  fs::create_symlink("textures/skin.png", folder() / "skin.png");
  put("a.mtl", "map_Kd skin.png\n");
  EXPECT_THAT(paths_of(put("a.obj", "mtllib a.mtl\n")), ElementsAre("a.mtl", "skin.png"));
  // The folder itself may be reached by one.
  fs::create_directory_symlink(folder(), outer_ / "link");
  EXPECT_THAT(paths_of(outer_ / "link" / "a.obj"), ElementsAre("a.mtl", "skin.png"));
}

TEST_F(Bundle, blanks_around_the_uri_of_a_gltf_do_not_count) {
  put("mesh.bin");
  EXPECT_THAT(paths_of(put("a.gltf", R"({"buffers": [{"uri": " mesh.bin\t"}]})")),
              ElementsAre("mesh.bin"));
}

TEST_F(Bundle, a_folder_is_no_mesh) {
  const client::Error error = error_of([&] { MeshSource::open(folder()); });
  EXPECT_EQ(error.code(), "file");
  EXPECT_THAT(error.what(), HasSubstr("is a folder, expected a mesh file"));
}

// Uploads the mesh to a daemon that gives the ids sha256-0, sha256-1, … to what it gets, at most 5.
std::vector<test::Asked> uploaded(const MeshSource& mesh) {
  std::vector<test::CannedResponse> script;
  for (const char* id : {"0", "1", "2", "3", "4"}) {
    script.push_back(test::json_response(R"({"id":"sha256-)" + std::string(id) + R"("})"));
  }
  test::ScriptedServer server(script);
  const std::string asset = client::Client(server.url()).upload(mesh.source());
  EXPECT_EQ(asset, "sha256-" + std::to_string(server.asked().size() - 1));
  return server.asked();
}

TEST_F(Bundle, a_pipe_whose_writer_is_gone_before_a_server_is_found_is_read_to_its_end) {
  const std::string pipe = folder() / "pipe.obj";
  for (const std::string text : {"v 0 0 0\n", ""}) {
    ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
    std::jthread writer([&] { std::ofstream(pipe) << text; });
    const std::shared_ptr<const int> opened = await_stream(pipe, {});
    writer.join();
    std::filesystem::remove(pipe);
    const auto asked = uploaded(MeshSource::open(pipe, {}, {}, opened));
    ASSERT_EQ(asked.size(), 1u);
    EXPECT_EQ(asked[0].target, "/v1/assets?filename=pipe.obj");
    EXPECT_EQ(asked[0].body, text);
  }
}

TEST_F(Bundle, a_mesh_with_files_is_sent_as_a_bundle_of_them) {
  put("my a.mtl", "map_Kd tex/bäume.png\n");
  put("tex/bäume.png", "PNG");
  const auto asked = uploaded(MeshSource::open(put("the a.obj", "mtllib my a.mtl\n")));
  ASSERT_EQ(asked.size(), 4u);
  EXPECT_EQ(asked[0].target, "/v1/assets?filename=the%20a.obj");
  EXPECT_EQ(asked[1].target, "/v1/assets?filename=my%20a.mtl");
  EXPECT_EQ(asked[2].target, "/v1/assets?filename=tex%2Fb%C3%A4ume.png");
  EXPECT_EQ(asked[2].body, "PNG");
  EXPECT_EQ(asked[3].header("content-type"), "application/vnd.voxeld.bundle+json");
  EXPECT_EQ(asked[3].body, R"({"files":[{"asset":"sha256-0","name":"the a.obj"},)"
                           R"({"asset":"sha256-1","name":"my a.mtl"},)"
                           R"({"asset":"sha256-2","name":"tex/bäume.png"}]})");
}

TEST_F(Bundle, a_texture_that_the_daemon_has_is_not_sent_again) {
  put("a.mtl", "map_Kd skin.png\n");
  put("skin.png", std::string(size_t{1} << 16, 'p'));
  test::ScriptedServer server({test::json_response(R"({"id":"sha256-0"})"),
                               test::json_response(R"({"id":"sha256-1"})"),
                               test::json_response(R"({"id":"sha256-p","filename":"old.png"})"),
                               test::json_response(R"({"id":"sha256-3"})")});
  client::Client(server.url()).upload(MeshSource::open(put("a.obj", "mtllib a.mtl\n")).source());
  ASSERT_EQ(server.asked().size(), 4u);
  EXPECT_THAT(server.lines()[2], ::testing::MatchesRegex("GET /v1/assets/sha256-.*brief=1"));
  EXPECT_THAT(server.asked()[3].body, HasSubstr(R"({"asset":"sha256-p","name":"skin.png"})"));
}

TEST_F(Bundle, names_that_are_not_utf8_or_have_backslashes_are_sent_as_names_that_match) {
  put("K\xf6rper.mtl", "map_Kd tex\\skin.png\n");
  put("tex\\skin.png");
  const auto asked = uploaded(MeshSource::open(put("a.obj", "mtllib K\xf6rper.mtl\n")));
  ASSERT_EQ(asked.size(), 4u);
  EXPECT_THAT(asked[3].body, HasSubstr(R"("name":"K÷rper.mtl")"));  // as CP437
  EXPECT_THAT(asked[3].body, HasSubstr(R"("name":"tex/skin.png")"));
}

TEST_F(Bundle, a_file_is_sent_under_the_reading_of_its_name_that_was_found) {
  const std::string gbk = "\xcc\xf9\xcd\xbc.png";  // 贴图
  const auto names = [&](const std::string& materials) {
    std::vector<std::string> list;
    put("a.mtl", materials);
    for (const ReferencedFile& file : referenced_files(put("a.obj", "mtllib a.mtl\n"))) {
      list.push_back(file.name);
    }
    return list;
  };
  put("tex/" + gbk);
  EXPECT_THAT(names("map_Kd D:\\x\\贴图.png\n"), ElementsAre("a.mtl", "tex/贴图.png"));
  EXPECT_THAT(names("map_Kd " + gbk + "\n"), ElementsAre("a.mtl", "tex/╠∙═╝.png"));  // as CP437
  EXPECT_THAT(names("map_Kd tex/" + gbk + "\nmap_Kd 贴图.PNG\n"),
              ElementsAre("a.mtl", "tex/贴图.png"));
  EXPECT_THAT(names("map_Kd 贴图.png\nmap_Kd tex/" + gbk + "\n"),
              ElementsAre("a.mtl", "tex/贴图.png"));
  fs::remove(folder() / "tex" / gbk);
  put("K\x94rper.png");  // in CP850, the reference in CP1252
  EXPECT_THAT(names("map_Kd K\xf6rper.png\n"), ElementsAre("a.mtl", "Körper.png"));
  put("贴图.png");
  EXPECT_THAT(names("map_Kd " + gbk + "\n"), ElementsAre("a.mtl", "贴图.png"));
}

TEST_F(Bundle, files_whose_names_no_bundle_may_have_are_left_out) {
  const std::string deep = std::string(200, 'd') + "/" + std::string(100, 'n') + ".png";
  std::string materials;
  for (const std::string& name : std::vector<std::string>{deep, "a:b.png", "1:b.png", "a\x01.png",
                                                          "..\\x.png", "\x95\x5c/y.png", "z.png"}) {
    put(name);
    materials += "map_Kd " + name + "\n";
  }
  put("a.mtl", materials);
  put("1:m.obj", "mtllib a.mtl\n");
  const auto asked = uploaded(MeshSource::open(folder() / "1:m.obj"));
  ASSERT_EQ(asked.size(), 5u);
  EXPECT_EQ(asked[4].body, R"({"files":[{"asset":"sha256-0","name":"mesh.obj"},)"
                           R"({"asset":"sha256-1","name":"a.mtl"},)"
                           R"({"asset":"sha256-2","name":"ò/y.png"},)"  // 表 in Shift-JIS, as CP437
                           R"({"asset":"sha256-3","name":"z.png"}]})");
  const std::string beside = put("1:walk.md5anim");
  EXPECT_EQ(error_of([&] { MeshSource::open(put("a.ply"), std::vector{beside}); }).what(),
            beside + ": no file of a bundle may have this name");
}

TEST_F(Bundle, two_files_of_one_name_are_sent_as_one) {
  put("tex\\a.png", "first");
  put("tex/a.png", "second");
  put("a.mtl", "map_Kd tex%2Fa.png\nmap_Kd tex/a.png\n");
  const auto asked = uploaded(MeshSource::open(put("a.obj", "mtllib a.mtl\n")));
  ASSERT_EQ(asked.size(), 4u);
  EXPECT_EQ(asked[2].body, "first");
}

TEST_F(Bundle, files_beside_the_mesh_are_sent_under_their_own_names) {
  const std::string mesh = put("a.md5mesh", kMd5Mesh);
  const std::string dance = put("moves/dance.md5anim", "hierarchy {\n}\n");
  const auto asked = uploaded(MeshSource::open(mesh, std::vector{dance}));
  ASSERT_EQ(asked.size(), 3u);
  EXPECT_EQ(asked[1].target, "/v1/assets?filename=dance.md5anim");
  EXPECT_THAT(asked[2].body, HasSubstr(R"({"asset":"sha256-1","name":"dance.md5anim"})"));
}

TEST_F(Bundle, a_file_that_is_named_twice_is_sent_as_the_command_line_says) {
  put("walk.md5anim", "hierarchy {\n\"hip\" -1\n\"leg\" 0\n}\n");
  const std::string mesh = put("a.md5mesh", kMd5Mesh);
  const std::string other = put("b/walk.md5anim", "other");
  const auto asked = uploaded(MeshSource::open(mesh, std::vector{other}));
  ASSERT_EQ(asked.size(), 3u);
  EXPECT_EQ(asked[1].target, "/v1/assets?filename=walk.md5anim");
  EXPECT_EQ(asked[1].body, "other");
}

TEST_F(Bundle, a_missing_mesh_with_files_beside_it_is_named) {
  const std::string mesh = folder() / "no.md5mesh", walk = put("walk.md5anim");
  const client::Error error = error_of([&] { MeshSource::open(mesh, std::vector{walk}); });
  EXPECT_EQ(error.code(), "file");
  EXPECT_EQ(error.what(), mesh + ": No such file or directory");
}

TEST_F(Bundle, a_texture_that_cannot_be_read_is_left_out) {
  if (geteuid() == 0) GTEST_SKIP() << "root reads every file";
  put("a.mtl", "map_Kd skin.png\n");
  fs::permissions(put("skin.png"), fs::perms::none);
  EXPECT_THAT(paths_of(put("a.obj", "mtllib a.mtl\n")), ElementsAre("a.mtl"));
}

TEST_F(Bundle, files_beside_the_mesh_must_be_there_and_have_names_of_their_own) {
  const std::string mesh = put("a.ply"), same = put("b/a.ply");
  const std::vector<std::string> missing = {(fs::path(folder()) / "no.md5anim").string()};
  const std::string empty = put("empty.md5anim", "");
  EXPECT_EQ(error_of([&] { MeshSource::open(mesh, std::vector{empty}); }).what(),
            empty + ": is empty");
  EXPECT_THAT(error_of([&] { MeshSource::open(mesh, missing); }).what(),
              HasSubstr("no.md5anim: is no file that can be read"));
  EXPECT_THAT(error_of([&] { MeshSource::open(mesh, std::vector{same}); }).what(),
              HasSubstr("another file of the command line has this name"));
  EXPECT_EQ(error_of([&] { MeshSource::open("-", std::vector{mesh}); }).code(), "file");
}

}  // namespace
}  // namespace voxeld::cli
