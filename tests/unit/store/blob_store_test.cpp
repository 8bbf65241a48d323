#include "server/store/blob_store.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "server/base/disk/file.h"
#include "server/base/sha256.h"
#include "tests/unit/base/temporary_dir.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;

std::span<const uint8_t> span_of(std::string_view text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), text.size()};
}

class BlobStoreTest : public ::testing::Test {
 protected:
  BlobStore open() {
    auto store = BlobStore::open(dir_.path() / "data");
    EXPECT_TRUE(store) << store.error().message();
    return *std::move(store);
  }
  BlobInfo put(BlobStore& store, std::string_view text) {
    auto writer = store.begin(1 << 20);
    EXPECT_TRUE(writer);
    EXPECT_TRUE(writer->append(span_of(text)));
    auto info = writer->finish();
    EXPECT_TRUE(info) << info.error().message();
    return *info;
  }
  size_t temporary_files() {
    size_t count = 0;
    for ([[maybe_unused]] const auto& entry : fs::directory_iterator(dir_.path() / "data/tmp")) {
      ++count;
    }
    return count;
  }
  testing::TemporaryDir dir_;
};

TEST_F(BlobStoreTest, bytes_written_in_pieces_are_stored_under_their_hash) {
  BlobStore store = open();
  auto writer = store.begin(100);
  ASSERT_TRUE(writer);
  ASSERT_TRUE(writer->append(span_of("ab")));
  ASSERT_TRUE(writer->append(span_of("c")));
  EXPECT_EQ(writer->bytes(), 3);
  const auto info = writer->finish();
  ASSERT_TRUE(info) << info.error().message();
  EXPECT_EQ(info->id, sha256_id("abc"));
  EXPECT_EQ(info->bytes, 3);
  EXPECT_EQ(store.path_of(info->id), dir_.path() / "data/blobs/ba" / info->id);
  EXPECT_EQ(read_file(store.path_of(info->id)).value(), (std::vector<uint8_t>{'a', 'b', 'c'}));
  EXPECT_EQ(store.stat(info->id).value().bytes, 3);
  EXPECT_EQ(temporary_files(), 0u);
}

TEST_F(BlobStoreTest, the_same_bytes_twice_are_one_blob) {
  BlobStore store = open();
  const BlobInfo first = put(store, "twice"), second = put(store, "twice");
  EXPECT_EQ(first.id, second.id);
  EXPECT_EQ(first.bytes, second.bytes);
  EXPECT_EQ(store.list().value(), std::vector<std::string>{sha256_id("twice")});
  EXPECT_EQ(temporary_files(), 0u);
}

TEST_F(BlobStoreTest, the_same_bytes_are_written_again_and_who_reads_the_old_file_reads_on) {
  BlobStore store = open();
  const std::string id = put(store, "twice").id;
  const auto reader = MappedFile::open(store.path_of(id));
  ASSERT_TRUE(reader);
  const auto inode = [&] {
    struct stat info {};
    EXPECT_EQ(::stat(store.path_of(id).c_str(), &info), 0);
    return info.st_ino;
  };
  const auto before = inode();
  put(store, "twice");
  EXPECT_NE(inode(), before);  // no shortcut whose time could be measured
  EXPECT_EQ(reader->bytes()[0], 't');
  EXPECT_EQ(reader->bytes().size(), 5u);
}

TEST_F(BlobStoreTest, folders_are_made_beforehand) {
  BlobStore store = open();
  size_t folders = 0;
  for ([[maybe_unused]] const auto& entry : fs::directory_iterator(store.root() / "blobs")) {
    ++folders;
  }
  EXPECT_EQ(folders, 256u);
}

TEST_F(BlobStoreTest, what_was_stored_stays_until_nobody_holds_its_pin) {
  BlobStore store = open();
  auto first = std::make_optional(put(store, "pinned"));
  auto second = std::make_optional(put(store, "pinned"));
  const std::string id = first->id;
  EXPECT_EQ(store.remove(id).error().code, ErrorCode::kConflict);
  first.reset();
  EXPECT_EQ(store.remove(id).error().code, ErrorCode::kConflict);
  EXPECT_TRUE(store.stat(id));
  EXPECT_TRUE(store.take_suspects().empty());
  second.reset();
  EXPECT_EQ(store.take_suspects(), std::set{id});
  EXPECT_TRUE(store.take_suspects().empty()) << "each once";
  store.suspect("sha256-told");
  store.suspect("sha256-told");
  EXPECT_EQ(store.take_suspects(), std::set<std::string>{"sha256-told"});
  EXPECT_TRUE(store.remove(id));
  EXPECT_EQ(store.remove(id).error().code, ErrorCode::kNotFound);
}

TEST_F(BlobStoreTest, a_writer_that_is_dropped_leaves_nothing) {
  BlobStore store = open();
  {
    auto writer = store.begin(100);
    ASSERT_TRUE(writer);
    ASSERT_TRUE(writer->append(span_of("half of an upl")));
    BlobWriter moved = *std::move(writer);
    EXPECT_EQ(temporary_files(), 1u);
  }
  EXPECT_EQ(temporary_files(), 0u);
  EXPECT_TRUE(store.list().value().empty());
}

TEST_F(BlobStoreTest, what_a_killed_process_left_in_tmp_goes_at_the_next_open) {
  {
    BlobStore store = open();
    ASSERT_TRUE(write_file(store.root() / "tmp/blob-abc123", span_of("torn")));
  }
  open();
  EXPECT_EQ(temporary_files(), 0u);
}

TEST_F(BlobStoreTest, bytes_over_the_cap_are_refused_with_the_cap) {
  BlobStore store = open();
  auto writer = store.begin(4);
  ASSERT_TRUE(writer);
  ASSERT_TRUE(writer->append(span_of("1234")));
  const Status refused = writer->append(span_of("5"));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kPayloadTooLarge);
  EXPECT_EQ(refused.error().message(),
            "the upload is too large: expected at most 4 bytes, got at least 5");
}

TEST_F(BlobStoreTest, a_torn_file_under_a_blobs_name_is_replaced_by_the_whole_one) {
  BlobStore store = open();
  const BlobInfo whole = put(store, "whole content");
  ASSERT_TRUE(write_file(store.path_of(whole.id), span_of("whole")));
  put(store, "whole content");
  EXPECT_EQ(store.stat(whole.id).value().bytes, 13);
}

TEST_F(BlobStoreTest, a_finished_file_is_adopted) {
  BlobStore store = open();
  const fs::path file = dir_.path() / "result.npy";
  ASSERT_TRUE(write_file(file, span_of("result")));
  const auto info = store.adopt(file);
  ASSERT_TRUE(info) << info.error().message();
  EXPECT_EQ(info->id, sha256_id("result"));
  EXPECT_FALSE(fs::exists(file));
  ASSERT_TRUE(write_file(file, span_of("result")));
  EXPECT_EQ(store.adopt(file).value().id, info->id);
  EXPECT_FALSE(fs::exists(file));
}

TEST_F(BlobStoreTest, links_and_devices_are_not_adopted) {
  BlobStore store = open();
  const fs::path link = dir_.path() / "link";
  fs::create_symlink("/etc/hostname", link);
  EXPECT_FALSE(store.adopt(link));
  const fs::path pipe = dir_.path() / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_EQ(store.adopt(pipe).error().detail, "pipe is not a regular file");
}

TEST_F(BlobStoreTest, text_that_is_not_an_id_never_becomes_a_path) {
  BlobStore store = open();
  for (const std::string_view text :
       {"", "../../etc/passwd", "sha256-", "sha256-../../../../etc/passwd", "SHA256-00"}) {
    const auto found = store.stat(text);
    ASSERT_FALSE(found) << text;
    EXPECT_EQ(found.error().code, ErrorCode::kNotFound);
    EXPECT_EQ(store.remove(text).error().code, ErrorCode::kNotFound);
    EXPECT_EQ(store.path_of(text), dir_.path() / "data/blobs/no-such-blob");
  }
}

TEST_F(BlobStoreTest, a_removed_blob_is_not_found) {
  BlobStore store = open();
  const std::string id = put(store, "short life").id;
  ASSERT_TRUE(store.remove(id));
  EXPECT_EQ(store.stat(id).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(store.remove(id).error().code, ErrorCode::kNotFound);
}

TEST_F(BlobStoreTest, threads_that_store_the_same_bytes_do_not_disturb_each_other) {
  BlobStore store = open();
  std::vector<std::thread> threads;
  for (int t = 0; t < 8; ++t) {
    threads.emplace_back([&] {
      for (int i = 0; i < 20; ++i) {
        const std::string text = "content " + std::to_string(i);
        const BlobInfo info = put(store, text);
        EXPECT_EQ(info.id, sha256_id(text));
        EXPECT_TRUE(store.stat(info.id));
      }
    });
  }
  for (auto& thread : threads) thread.join();
  EXPECT_EQ(store.list().value().size(), 20u);
  EXPECT_EQ(store.bytes(), 10 * 9 + 10 * 10) << "each content once";
  EXPECT_EQ(temporary_files(), 0u);
}

TEST_F(BlobStoreTest, free_space_is_known) {
  EXPECT_GT(open().disk().free_bytes().value(), 0);
}

}  // namespace
}  // namespace voxeld
