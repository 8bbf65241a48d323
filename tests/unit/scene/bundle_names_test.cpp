#include "server/scene/core/bundle_names.h"

#include <gtest/gtest.h>

#include <vector>

namespace voxeld {
namespace {

TEST(BundleNames, normalizing_resolves_dots_and_backslashes) {
  EXPECT_EQ(normalized_name("a/b.png"), "a/b.png");
  EXPECT_EQ(normalized_name(".\\a\\.\\b.png"), "a/b.png");
  EXPECT_EQ(normalized_name("a//b/../c.png"), "a/c.png");
}

TEST(BundleNames, names_that_leave_the_bundle_are_none) {
  for (const char* name :
       {"", ".", "/etc/passwd", "\\x", "C:\\a.png", "c:a", "..", "../a", "a/../../b"}) {
    EXPECT_EQ(normalized_name(name), std::nullopt) << name;
  }
}

TEST(BundleNames, percent_decoding_leaves_broken_sequences) {
  EXPECT_EQ(percent_decoded("my%20file%2e%"), "my file.%");
  EXPECT_EQ(percent_decoded("100%zz%4"), "100%zz%4");
}

TEST(BundleNames, references_are_found_in_the_documented_order) {
  const std::vector<std::string> names = {
      "skin.png",  "models/skin.png", "models/Tex/Wood.PNG", "models/a b.png",
      "50%25.png", "other/only.jpg",  "models/x/deep.png"};
  struct Case {
    const char* reference;
    const char* found;  // nullptr: none
  };
  const Case cases[] = {
      {"skin.png", "models/skin.png"},                // the folder of the file first
      {"../skin.png", "skin.png"},                    // and up from it
      {"models/skin.png", "models/skin.png"},         // then from the top
      {".\\Tex\\Wood.PNG", "models/Tex/Wood.PNG"},    // Windows
      {"tex/wood.png", "models/Tex/Wood.PNG"},        // any case
      {"a%20b.png", "models/a b.png"},                // URI
      {"50%25.png", "50%25.png"},                     // as written before decoded
      {"C:\\Users\\me\\only.JPG", "other/only.jpg"},  // somebody's disk: the base name
      {"/home/me/deep.png", "models/x/deep.png"},
      {"../../../skin.png", "skin.png"},
      {"\"skin.png\"", "models/skin.png"},
      {" skin.png ", "models/skin.png"},
      {"none.png", nullptr},
      {"", nullptr},
      {"..", nullptr},
      {"models/", nullptr},
      {"data:image/png;base64,skin.png", nullptr}};
  for (const Case& c : cases) {
    const auto found = resolve_reference(names, c.reference, "models/cow.obj");
    ASSERT_EQ(found.has_value(), c.found != nullptr) << c.reference;
    if (found) {
      EXPECT_EQ(names[*found], c.found) << c.reference;
    }
  }
}

}  // namespace
}  // namespace voxeld
