// Text files as programs leave them: marks, line ends, and what follows the last line.
#include <gmock/gmock.h>

#include <functional>

#include "proto/text/text_file.h"
#include "tests/unit/base/points_passed.h"
#include "tests/unit/scene/scene_test_util.h"
#include "tests/unit/scene/zip_maker.h"

namespace voxeld {
namespace {

// One square or triangle in each format that is text.
const std::pair<const char*, std::string> kTextFiles[] = {
    {"a.obj", "# a square\nv 0 0 0\nv 1 0 \\\n0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n"},
    {"a.off",
     "OFF\n# a square\n4 1 0\n0 0 0 255 0 0\n1 0 0 0 0 0\n1 1 0 0 0 0\n0 1 0 0 0 0\n"
     "4 0 1 2 3\n"},
    {"a.stl",
     "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
     "endloop\nendfacet\nendsolid a\n"},
    {"a.md5mesh",
     "MD5Version 10\ncommandline \"\"\njoints {\n\"root\" -1 ( 0 0 0 ) ( 0 0 0 )\n}\n"
     "mesh {\n// a triangle\nnumverts 3\nvert 0 ( 0 0 ) 0 1\nvert 1 ( 0 0 ) 1 1\n"
     "vert 2 ( 0 0 ) 2 1\nnumtris 1\ntri 0 0 1 2\nnumweights 3\n"
     "weight 0 0 1 ( 0 0 0 )\nweight 1 0 1 ( 1 0 0 )\nweight 2 0 1 ( 0 1 0 )\n}\n"}};

std::string replaced(std::string text, std::string_view from, std::string_view to) {
  for (size_t at = text.find(from); at != text.npos; at = text.find(from, at + to.size())) {
    text.replace(at, from.size(), to);
  }
  return text;
}

// `text`: code units below 256.
std::string utf16(std::string_view text, bool big_endian) {
  std::string out = big_endian ? "\xfe\xff" : "\xff\xfe";
  for (const char c : text) {
    out += big_endian ? '\0' : c;
    out += big_endian ? c : '\0';
  }
  return out;
}

using Rewrite = std::function<std::string(const std::string&)>;
const std::pair<const char*, Rewrite> kRewrites[] = {
    {"UTF-8 mark", [](const std::string& text) { return "\xef\xbb\xbf" + text; }},
    {"UTF-16 LE", [](const std::string& text) { return utf16(text, false); }},
    {"UTF-16 BE", [](const std::string& text) { return utf16(text, true); }},
    {"UTF-16 LE with CRLF and ^Z",
     [](const std::string& text) { return utf16(replaced(text, "\n", "\r\n") + "\x1a", false); }},
    {"CR alone", [](const std::string& text) { return replaced(text, "\n", "\r"); }},
    {"CR alone in the first line",
     [](const std::string& text) { return std::string(text).replace(text.find('\n'), 1, "\r"); }},
    {"CRLF", [](const std::string& text) { return replaced(text, "\n", "\r\n"); }},
    {"NUL at the end", [](const std::string& text) { return text + '\0'; }},
    {"^Z at the end", [](const std::string& text) { return text + '\x1a'; }},
    {"^Z and padding",
     [](const std::string& text) { return text + "\r\n\x1a" + std::string(700, '\0'); }},
    {"NUL behind a last line without its end",
     [](const std::string& text) { return text.substr(0, text.size() - 1) + '\0'; }}};

TEST(TextFile, every_format_is_read_whatever_its_marks_and_line_ends) {
  for (const auto& [name, text] : kTextFiles) {
    const auto plain = test::load_text(name, text);
    ASSERT_TRUE(plain) << name << ": " << plain.error().message();
    for (const auto& [what, rewrite] : kRewrites) {
      for (const char* filename : {name, ""}) {
        SCOPED_TRACE(std::string(name) + " as \"" + filename + "\", " + what);
        const auto scene = test::load_text(filename, rewrite(text));
        ASSERT_TRUE(scene) << scene.error().message();
        EXPECT_EQ(scene->format, plain->format);
        EXPECT_EQ(scene->parts[0].positions, plain->parts[0].positions);
        EXPECT_EQ(scene->parts[0].indices, plain->parts[0].indices);
        EXPECT_EQ(scene->parts[0].colors, plain->parts[0].colors);
        EXPECT_EQ(scene->warnings.size(), plain->warnings.size());
      }
    }
  }
}

TEST(TextFile, material_files_are_read_whatever_their_marks_and_line_ends) {
  for (const auto& [what, rewrite] : kRewrites) {
    SCOPED_TRACE(what);
    test::MapBundle bundle;
    bundle.add("a.mtl", rewrite("newmtl red\nKd 1 0 0\n"));
    const auto scene = load_obj(
        "a.obj", test::bytes_of("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n"),
        bundle, {.decode_images = false});
    ASSERT_TRUE(scene) << scene.error().message();
    EXPECT_EQ(scene->materials.at(0).base_color, glm::vec4(1, 0, 0, 1));
    EXPECT_THAT(scene->warnings, testing::IsEmpty());
    const std::string zip =
        test::ZipMaker()
            .add("a.md5mesh",
                 replaced(kTextFiles[3].second, "numverts", "shader \"skin\"\nnumverts"))
            .add("a.mtr", rewrite("skin\n{\ndiffusemap \xc3\xa9.png\n}\n"))
            .add(std::string(what).starts_with("UTF-16") ? "\xc3\x83\xc2\xa9.png" : "\xc3\xa9.png",
                 "")
            .add("other.png", "")
            .bytes();
    const auto skinned = test::load_text("a.zip", zip);
    ASSERT_TRUE(skinned) << skinned.error().message();
    EXPECT_THAT(skinned->missing_files, testing::IsEmpty());
  }
}

TEST(TextFile, characters_of_utf16_beyond_the_first_plane_are_preserved) {
  const auto part_name = [](std::string name) {
    const auto scene = test::load_text("a.obj", utf16("v 0 0 0\nv 1 0 0\nv 0 1 0\no ", false) +
                                                    name + utf16("\nf 1 2 3\n", false).substr(2));
    EXPECT_TRUE(scene) << scene.error().message();
    return scene ? scene->parts[0].name : "";
  };
  EXPECT_EQ(part_name(std::string("\x3d\xd8\x00\xde", 4)), "\xf0\x9f\x98\x80");
  EXPECT_EQ(part_name("\xac\x20"), "\xe2\x82\xac");
  EXPECT_EQ(part_name("\x3d\xd8"), "\xef\xbf\xbd") << "half of a pair";
}

TEST(TextFile, its_conversion_can_be_cancelled) {
  const auto points = [](const std::string& text) {
    std::string storage;
    return test::points_passed([&] { (void)plain_text(test::bytes_of(text), storage); });
  };
  constexpr size_t kMebi = size_t{1} << 20;
  EXPECT_GE(points(utf16(std::string(kMebi, 'x'), false)), 15);
  EXPECT_GE(points("x" + std::string(kMebi, '\0')), 15) << "NUL at the end";
  EXPECT_GE(points(std::string(16 * kMebi, 'x')), 15) << "looked through for CR";
  EXPECT_GE(points("\r" + std::string(16 * kMebi, 'x')), 30) << "copied, too";
}

TEST(TextFile, lines_of_errors_are_those_that_an_editor_shows) {
  for (const char* end : {"\n", "\r\n", "\r"}) {
    const auto scene = test::load_text("a.obj", replaced("v 0 0 0\nv 1 0 0\n\nv 0 1\n", "\n", end));
    EXPECT_EQ(test::message_of(scene), "a.obj line 4: vertex: expected at least 3 numbers, got 2");
  }
}

TEST(TextFile, a_nul_inside_the_text_is_refused) {
  EXPECT_EQ(test::message_of(test::load_text("a.obj", std::string("v 0 0 0\n\0\nv 1 0 0\n", 18))),
            "a.obj line 2: not an OBJ statement: expected a keyword such as v or f, got "
            "\"\\x00\"");
}

}  // namespace
}  // namespace voxeld
