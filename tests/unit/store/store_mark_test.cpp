#include "server/store/store_mark.h"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <limits>
#include <string>

#include "tests/unit/base/temporary_dir.h"

namespace voxeld {
namespace {

const StoreMark kMark{"0123456789abcdef0123456789abcdef", 42, 7, 8};
constexpr const char* kText =
    "voxeld store 1\nid 0123456789abcdef0123456789abcdef\ngeneration 0000000000000000042\n"
    "kept_ms 0000000000000000007\nwall_ms 0000000000000000008\n";

std::string text_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

TEST(StoreMark, its_bytes_are_pinned_and_read_back) {
  EXPECT_EQ(store_mark_text(kMark), kText);
  EXPECT_EQ(parse_store_mark(kText, "mark").value(), kMark);
  const StoreMark last{kMark.id, std::numeric_limits<int64_t>::max(), 0, 0};
  EXPECT_EQ(parse_store_mark(store_mark_text(last), "mark").value(), last);
  const StoreMark fresh = new_store_mark();
  EXPECT_EQ(parse_store_mark(store_mark_text(fresh), "mark").value(), fresh);
  EXPECT_NE(new_store_mark(), fresh);
}

TEST(StoreMark, every_truncation_extra_byte_and_changed_byte_outside_of_its_values_is_refused) {
  const std::string text = kText;
  for (size_t bytes = 0; bytes < text.size(); ++bytes) {
    EXPECT_FALSE(parse_store_mark(text.substr(0, bytes), "mark")) << bytes;
  }
  EXPECT_FALSE(parse_store_mark(text + "\n", "mark"));
  for (size_t at = 0; at < text.size(); ++at) {
    std::string changed = text;
    changed[at] = '~';
    EXPECT_FALSE(parse_store_mark(changed, "mark")) << at;
  }
  EXPECT_EQ(parse_store_mark("voxeld", "/data/blobs/mark").error().message(),
            "/data/blobs/mark: expected \"voxeld store 1\", an id of 32 hex digits, and generation,"
            " kept_ms and wall_ms of 19 digits, got 6 bytes");
}

TEST(StoreMark, the_file_keeps_the_highest_generation) {
  const testing::TemporaryDir dir;
  const auto path = dir.path() / "mark";
  EXPECT_EQ(StoreMarkFile::open(path).value(), nullptr);
  {
    const auto file = StoreMarkFile::create(path, kMark).value();
    file->raise_generation(44);
    file->raise_generation(43);
    EXPECT_EQ(file->mark().generation, 44);
  }
  EXPECT_EQ(parse_store_mark(text_of(path), "mark").value().generation, 44);
  const auto file = StoreMarkFile::open(path).value();
  EXPECT_EQ(file->mark(), (StoreMark{kMark.id, 44, 7, 8}));
  file->note_clock(100, 200);
  file->raise_generation(45);
  EXPECT_EQ(parse_store_mark(text_of(path), "mark").value().generation, 45);
  std::ofstream(path) << "other bytes";
  EXPECT_FALSE(StoreMarkFile::open(path));
}

}  // namespace
}  // namespace voxeld
