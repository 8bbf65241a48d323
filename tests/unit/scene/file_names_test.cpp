#include "proto/file_names/file_names.h"

#include <gtest/gtest.h>

#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/file_names/text_encodings.h"

namespace voxeld {
namespace {

TEST(FileNames, normalizing_resolves_dots_and_backslashes) {
  EXPECT_EQ(normalized_name("a/b.png"), "a/b.png");
  EXPECT_EQ(normalized_name(".\\a\\.\\b.png"), "a/b.png");
  EXPECT_EQ(normalized_name("a//b/../c.png"), "a/c.png");
}

TEST(FileNames, names_that_leave_the_bundle_are_none) {
  for (const char* name :
       {"", ".", "/etc/passwd", "\\x", "C:\\a.png", "c:a", "..", "../a", "a/../../b"}) {
    EXPECT_EQ(normalized_name(name), std::nullopt) << name;
  }
}

TEST(FileNames, percent_decoding_leaves_broken_sequences) {
  EXPECT_EQ(percent_decoded("my%20file%2e%"), "my file.%");
  EXPECT_EQ(percent_decoded("100%zz%4"), "100%zz%4");
}

struct Match {
  const char* reference;
  const char* found;  // nullptr: none
  const char* guess = "";
};

void expect_matches(const std::vector<std::string>& names, std::string_view from,
                    std::initializer_list<Match> matches) {
  const FileNames files(names);
  for (const Match& match : matches) {
    SCOPED_TRACE(match.reference);
    const auto found = files.resolve(match.reference, from);
    ASSERT_EQ(found.has_value(), match.found != nullptr);
    if (!found) continue;
    EXPECT_EQ(names[found->index], match.found);
    EXPECT_EQ(found->guess, match.guess);
  }
}

constexpr const char* kCase = "the same name in another case";
constexpr const char* kFolder = "the same name in another folder";
constexpr const char* kPathEnd = "the end of the path";
constexpr const char* kBytes = "the same bytes, which are not UTF-8";

TEST(FileNames, references_are_found_in_the_documented_order) {
  expect_matches({"skin.png", "models/skin.png", "models/Tex/Wood.PNG", "models/a b.png",
                  "50%25.png", "other/only.jpg", "models/x/deep.png"},
                 "models/cow.obj",
                 {{"skin.png", "models/skin.png"},              // the folder of the file first
                  {"../skin.png", "skin.png"},                  // and up from it
                  {"models/skin.png", "models/skin.png"},       // then from the top
                  {".\\Tex\\Wood.PNG", "models/Tex/Wood.PNG"},  // Windows
                  {"tex/wood.png", "models/Tex/Wood.PNG", kCase},
                  {"a%20b.png", "models/a b.png"},  // URI
                  {"50%25.png", "50%25.png"},       // as written before decoded
                  {"C:\\Users\\me\\only.JPG", "other/only.jpg", kPathEnd},  // somebody's disk
                  {"/home/me/deep.png", "models/x/deep.png", kPathEnd},
                  {"deep.png", "models/x/deep.png", kFolder},
                  {"../../../skin.png", "models/skin.png", kPathEnd},
                  {"\"skin.png\"", "models/skin.png"},
                  {" skin.png ", "models/skin.png"},
                  {"none.png", nullptr},
                  {"", nullptr},
                  {"..", nullptr},
                  {"models/", nullptr},
                  {"C:", nullptr},
                  {"data:image/png;base64,skin.png", nullptr}});
}

TEST(FileNames, of_several_files_the_nearest_is_taken_and_else_none) {
  expect_matches({"a/skin.png", "b/skin.png", "m/tex/skin.png", "m/oak/wood.png", "m/elm/wood.png",
                  "Bark.png", "BARK.png", "x/moss.png", "x/MOSS.png"},
                 "m/tree.obj",
                 {{"D:\\skin.png", "m/tex/skin.png", kPathEnd},  // the only one below the mesh
                  {"D:\\b\\skin.png", "b/skin.png", kPathEnd},   // more parts of the path
                  {"D:\\trees\\elm\\wood.png", "m/elm/wood.png", kPathEnd},
                  {"D:\\wood.png", nullptr},
                  {"BARK.png", "BARK.png"},
                  {"bark.png", nullptr},
                  {"/moss.png", "x/moss.png", kPathEnd}});  // one in the same case
}

TEST(FileNames, names_in_a_legacy_encoding_are_found_by_their_bytes_or_by_reading_them) {
  // "贴图", "ソ表" (whose second bytes are backslashes), "Körper" in code pages of DOS and Windows.
  const std::string gbk = "\xcc\xf9\xcd\xbc.png", sjis = "\x83\x5c\x95\x5c.png";
  const std::string dos = "K\x94rper.png", windows = "K\xf6rper.png";
  expect_matches({"a.obj", gbk}, "a.obj",
                 {{gbk.c_str(), gbk.c_str(), kBytes},
                  {"贴图.png", gbk.c_str(), "read as GBK"},
                  {"%E8%B4%B4%E5%9B%BE.png", gbk.c_str(), "read as GBK"},
                  {"D:\\项目\\贴图.PNG", gbk.c_str(), "the end of the path, read as GBK"},
                  {"图贴.png", nullptr}});
  expect_matches({"a.obj", "贴图.png"}, "a.obj", {{gbk.c_str(), "贴图.png", "read as GBK"}});
  expect_matches(
      {"a.obj", sjis}, "a.obj",
      {{sjis.c_str(), sjis.c_str(), kBytes}, {"ソ表.png", sjis.c_str(), "read as Shift-JIS"}});
  expect_matches({"a.obj", dos}, "a.obj",
                 {{windows.c_str(), dos.c_str(), "read as CP1252 and CP850"},
                  {"Körper.png", dos.c_str(), "read as CP850"}});
  // The mesh's folder is read, too.
  const std::string folder = "\xcc\xf9/", inside = folder + gbk;
  expect_matches({folder + "a.obj", inside, gbk}, folder + "a.obj",
                 {{"贴图.png", inside.c_str(), "read as GBK"}});
}

// As clients send them in a bundle.
TEST(FileNames, legacy_names_that_were_read_as_cp437_are_found_by_their_bytes) {
  const auto letters = [](const std::string& name) { return utf8_from(kCp437, name).value(); };
  // Two characters of GBK whose bytes are one letter of CP437 in two cases.
  const std::string lower = "\xb0\xa4.png", upper = "\xb0\xa5.png";
  std::vector<std::string> names = {"a.obj", letters(lower), letters(upper)};
  for (int i = 0; i < 300; ++i) names.push_back(letters("tex/" + std::to_string(i) + lower));
  expect_matches(names, "a.obj",
                 {{lower.c_str(), names[1].c_str(), kBytes},
                  {upper.c_str(), names[2].c_str(), kBytes},
                  {("D:\\me\\299" + lower).c_str(), names.back().c_str(), kPathEnd}});
  const FileNames files(names);
  for (int i = 0; i < 300; ++i) {
    const auto found = files.resolve("tex/" + std::to_string(i) + lower, "a.obj");
    ASSERT_TRUE(found) << i;
    EXPECT_EQ(found->index, static_cast<size_t>(i) + 3);
  }
}

TEST(FileNames, letters_of_another_unicode_form_or_case_are_found) {
  constexpr const char* kForm = "the same name in another case or Unicode form";
  // "ü" and "가" of one character and of several, as macOS has them in names of files.
  const std::string latin = "u\u0308bung.png", hangul = "x/\u1100\u1161.png";
  expect_matches({"m/a.obj", "m/" + latin, hangul}, "m/a.obj",
                 {{"\u00fcbung.png", ("m/" + latin).c_str(), kForm},
                  {"%C3%BCbung.png", ("m/" + latin).c_str(), kForm},
                  {"D:\\m\\\u00dcBUNG.PNG", ("m/" + latin).c_str(), kPathEnd},
                  {"../x/\uac00.png", hangul.c_str(), kForm},
                  {"\u00f6bung.png", nullptr}});
  // As written before folded; of several that are equal then, none.
  expect_matches(
      {"\u00fc.png", "u\u0308.png", "\u00d6.png", "O\u0308.png"}, "",
      {{"\u00fc.png", "\u00fc.png"}, {"u\u0308.png", "u\u0308.png"}, {"\u00f6.png", nullptr}});
  expect_matches({"stra\u00dfe.png"}, "",
                 {{"STRASSE.png", nullptr}, {"STRA\u1e9eE.png", "stra\u00dfe.png", kForm}});
}

TEST(FileNames, an_encoding_must_read_all_names_and_two_must_not_disagree) {
  // 0x80 is no character of Shift-JIS, so the first name is not read as it.
  const std::string sjis = "\x95\x5c.png";
  expect_matches({sjis, "\x80.png"}, "", {{"表.png", nullptr}});
  // 0xe4 is ä in CP1252, and 0x84 in CP850: both of these are "ä" in one of them.
  expect_matches({"\x84.png", "\xe4.png"}, "", {{"ä.png", nullptr}});
}

TEST(FileNames, more_references_than_the_limit_are_not_tried_in_all_encodings) {
  const FileNames files({"\x95\x5c.png"});
  for (int i = 0; i < 1000; ++i) EXPECT_FALSE(files.resolve(std::to_string(i), "")) << "ASCII";
  for (int i = 0; i < 255; ++i) EXPECT_FALSE(files.resolve("é" + std::to_string(i), ""));
  EXPECT_TRUE(files.resolve("表.png", ""));
  EXPECT_FALSE(files.resolve("C:\\表.png", ""));
  EXPECT_TRUE(files.resolve("表.png", "")) << "it is known";
}

TEST(FileNames, every_encoding_reads_its_own_characters) {
  struct Case {
    const char* encoding;
    const char* bytes;
    const char* text;
  };
  const Case cases[] = {
      {"GBK", "\xb2\xc4\xd6\xca", "材质"},  {"Shift-JIS", "\xb1\x95\x5c", "ｱ表"},
      {"Big5", "\xa7\xf7\xbd\xe8", "材質"}, {"EUC-KR", "\xc0\xe7\xc1\xfa", "재질"},
      {"CP1252", "\x80\xdf", "€ß"},         {"CP850", "\xe1\x9d", "ßØ"},
      {"CP437", "\xe1\x9d", "ß¥"},          {"CP1250", "\xb3\xf3", "łó"},
      {"CP852", "\x88\xa2", "łó"},          {"CP1251", "\xca\xee", "Ко"},
      {"CP866", "\x8a\xae", "Ко"}};
  for (size_t i = 0; i < kTextEncodingCount; ++i) {
    EXPECT_EQ(cases[i].encoding, kTextEncodings[i]);
    EXPECT_EQ(utf8_from(i, cases[i].bytes), cases[i].text) << cases[i].encoding;
    EXPECT_EQ(utf8_from(i, "a\\1"), "a\\1");
  }
  // Halves of pairs, and bytes without a character.
  EXPECT_EQ(utf8_from(0, "\xb2"), std::nullopt);
  EXPECT_EQ(utf8_from(0, "\xb2 "), std::nullopt);
  EXPECT_EQ(utf8_from(0, "\xff"), std::nullopt);
  EXPECT_EQ(utf8_from(4, "\x81"), std::nullopt);
}

}  // namespace
}  // namespace voxeld
