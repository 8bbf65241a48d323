// The contract of every implementation of ObjectStore, tested through the interface only. A new
// implementation adds a row to kKinds.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "server/base/disk/file.h"
#include "server/base/sha256.h"
#include "server/store/blob_store.h"
#include "server/store/object_store.h"
#include "tests/unit/base/temporary_dir.h"
#include "tests/unit/store/memory_store.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;
using Ids = std::vector<std::string>;
using Bytes = std::vector<uint8_t>;

struct Kind {
  const char* name;
  std::unique_ptr<ObjectStore> (*open)(const fs::path& dir);
  // Changes what is stored of a blob behind the store's back.
  void (*damage)(ObjectStore& store, std::string_view id);
};

std::unique_ptr<ObjectStore> open_files(const fs::path& dir) {
  return std::make_unique<BlobStore>(BlobStore::open(dir).value());
}

void damage_file(ObjectStore& store, std::string_view id) {
  const fs::path file = dynamic_cast<BlobStore&>(store).path_of(id);
  std::ofstream(file, std::ios::binary) << "damaged";
}

std::unique_ptr<ObjectStore> open_memory(const fs::path&) {
  return std::make_unique<testing::MemoryStore>();
}

void damage_memory(ObjectStore& store, std::string_view id) {
  dynamic_cast<testing::MemoryStore&>(store).damage(id);
}

constexpr Kind kKinds[] = {{"files", open_files, damage_file},
                           {"memory", open_memory, damage_memory}};

Bytes object_bytes(std::string_view text) {
  return {text.begin(), text.end()};
}

class ObjectStoreTest : public ::testing::TestWithParam<Kind> {
 protected:
  BlobInfo put(std::string_view text) {
    auto writer = store_->begin(1 << 20);
    EXPECT_TRUE(writer && writer->append(object_bytes(text)));
    return writer->finish().value();
  }
  // Without a pin.
  std::string put_free(std::string_view text) { return put(text).id; }
  fs::path file(std::string_view text) {
    fs::path path = dir_.path() / ("output" + std::to_string(++files_));
    std::ofstream(path, std::ios::binary) << text;
    return path;
  }

  testing::TemporaryDir dir_;
  std::unique_ptr<ObjectStore> store_ = GetParam().open(dir_.path() / "data");
  int files_ = 0;
};

TEST_P(ObjectStoreTest, pieces_are_stored_under_the_hash_of_all_bytes) {
  auto writer = store_->begin(6);
  ASSERT_TRUE(writer);
  for (const std::string_view piece : {"ab", "", "cdef"}) {
    ASSERT_TRUE(writer->append(object_bytes(piece)));
  }
  EXPECT_EQ(writer->bytes(), 6);
  EXPECT_FALSE(store_->stat(sha256_id("abcdef"))) << "it is stored before finish()";
  const auto info = writer->finish();
  ASSERT_TRUE(info) << info.error().message();
  EXPECT_EQ(info->id, sha256_id("abcdef"));
  EXPECT_EQ(info->bytes, 6);
  EXPECT_EQ(store_->stat(info->id)->bytes, 6);
  EXPECT_EQ(store_->verified(info->id)->bytes, 6);
  EXPECT_TRUE(store_->is_usable(info->id));
  EXPECT_EQ(read_blob(*store_, info->id).value(), object_bytes("abcdef"));
}

TEST_P(ObjectStoreTest, an_empty_blob_is_a_blob) {
  const std::string id = put_free("");
  EXPECT_EQ(id, sha256_id(""));
  EXPECT_EQ(store_->stat(id)->bytes, 0);
  EXPECT_EQ(read_blob(*store_, id).value(), Bytes());
  EXPECT_EQ(fs::file_size(store_->local_file(id).value()), 0u);
}

TEST_P(ObjectStoreTest, more_than_the_announced_bytes_are_refused) {
  auto writer = store_->begin(4);
  ASSERT_TRUE(writer && writer->append(object_bytes("abcd")));
  const Status more = writer->append(object_bytes("e"));
  ASSERT_FALSE(more);
  EXPECT_EQ(more.error().code, ErrorCode::kPayloadTooLarge);
  EXPECT_EQ(store_->list().value(), Ids());
}

TEST_P(ObjectStoreTest, of_an_abandoned_writer_nothing_stays) {
  {
    auto writer = store_->begin(100);
    ASSERT_TRUE(writer && writer->append(object_bytes("abc")));
  }
  EXPECT_EQ(store_->list().value(), Ids());
  EXPECT_TRUE(store_->take_suspects().empty());
}

TEST_P(ObjectStoreTest, a_writer_can_be_moved) {
  auto first = store_->begin(100);
  ASSERT_TRUE(first && first->append(object_bytes("ab")));
  BlobWriter second(*std::move(first));
  ASSERT_TRUE(second.append(object_bytes("c")));
  EXPECT_EQ(second.finish()->id, sha256_id("abc"));
}

TEST_P(ObjectStoreTest, a_file_is_taken_over) {
  const fs::path output = file("output");
  const auto info = store_->adopt(output);
  ASSERT_TRUE(info) << info.error().message();
  EXPECT_EQ(info->id, sha256_id("output"));
  EXPECT_FALSE(fs::exists(output));
  EXPECT_EQ(read_blob(*store_, info->id).value(), object_bytes("output"));
}

TEST_P(ObjectStoreTest, what_is_no_plain_file_is_not_taken_over) {
  const fs::path secret = file("secret"), link = dir_.path() / "link";
  fs::create_symlink(secret, link);
  EXPECT_FALSE(store_->adopt(link));
  EXPECT_FALSE(store_->adopt(dir_.path()));
  EXPECT_FALSE(store_->adopt(dir_.path() / "missing"));
  EXPECT_TRUE(fs::exists(secret));
  EXPECT_EQ(store_->list().value(), Ids());
}

TEST_P(ObjectStoreTest, equal_bytes_are_one_blob) {
  put("abc");
  put("abc");
  ASSERT_TRUE(store_->adopt(file("abc")));
  EXPECT_EQ(store_->list().value(), Ids({sha256_id("abc")}));
}

TEST_P(ObjectStoreTest, ranges_are_streams) {
  std::string text;
  for (int i = 0; i < 10000; ++i) text += std::to_string(i);
  const std::string id = put_free(text);
  const auto size = static_cast<int64_t>(text.size());
  for (const auto& [offset, bytes] : std::vector<std::pair<int64_t, int64_t>>{
           {0, size}, {0, 0}, {size, 0}, {1, 1}, {4095, 4098}, {size - 1, 1}, {17, size - 17}}) {
    auto reader = store_->read(id, offset, bytes);
    ASSERT_TRUE(reader) << reader.error().message();
    std::string got;
    Bytes piece(1000);
    while (const size_t count = (*reader)->read(piece).value()) {
      got.append(piece.begin(), piece.begin() + static_cast<std::ptrdiff_t>(count));
      if (count < piece.size()) break;
    }
    EXPECT_EQ(got, text.substr(static_cast<size_t>(offset), static_cast<size_t>(bytes)));
    EXPECT_EQ((*reader)->read(piece).value(), 0u) << "after the end";
  }
}

TEST_P(ObjectStoreTest, ranges_outside_the_blob_are_refused) {
  const std::string id = put_free("abc");
  constexpr int64_t kMax = std::numeric_limits<int64_t>::max();
  for (const auto& [offset, bytes] : std::vector<std::pair<int64_t, int64_t>>{
           {0, 4}, {4, 0}, {3, 1}, {-1, 1}, {1, -1}, {kMax, 1}, {1, kMax}, {kMax, kMax}}) {
    const auto reader = store_->read(id, offset, bytes);
    ASSERT_FALSE(reader) << offset << " " << bytes;
    EXPECT_EQ(reader.error().code, ErrorCode::kBadRequest);
  }
}

TEST_P(ObjectStoreTest, a_reader_outlives_its_blob) {
  const std::string id = put_free("abc");
  const auto reader = store_->read(id, 0, 3);
  ASSERT_TRUE(reader && store_->remove(id));
  Bytes bytes(3);
  EXPECT_EQ((*reader)->read(bytes).value(), 3u);
  EXPECT_EQ(bytes, object_bytes("abc"));
}

TEST_P(ObjectStoreTest, a_local_file_has_the_bytes_and_is_named_by_the_id) {
  const std::string id = put_free("abc");
  const auto path = store_->local_file(id);
  ASSERT_TRUE(path) << path.error().message();
  EXPECT_EQ(path->filename(), id);
  EXPECT_EQ(read_file(*path).value(), object_bytes("abc"));
}

TEST_P(ObjectStoreTest, ids_of_no_blob_are_not_found) {
  put("abc");
  const Ids ids = {"",
                   "abc",
                   "sha256-",
                   "../blobs",
                   sha256_id("other"),
                   sha256_id("abc") + "/",
                   "sha256-" + std::string(64, 'A')};
  for (const std::string& id : ids) {
    EXPECT_EQ(store_->stat(id).error().code, ErrorCode::kNotFound) << id;
    EXPECT_EQ(store_->verified(id).error().code, ErrorCode::kNotFound) << id;
    EXPECT_FALSE(store_->is_usable(id)) << id;
    EXPECT_EQ(store_->read(id, 0, 0).error().code, ErrorCode::kNotFound) << id;
    EXPECT_EQ(store_->local_file(id).error().code, ErrorCode::kNotFound) << id;
    EXPECT_EQ(store_->remove(id).error().code, ErrorCode::kNotFound) << id;
  }
}

TEST_P(ObjectStoreTest, damage_is_found_before_reading) {
  const std::string id = put_free("abcdefg"), other = put_free("other");
  ASSERT_TRUE(store_->verified(id));
  GetParam().damage(*store_, id);
  const auto found = store_->verified(id);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().code, ErrorCode::kGone);
  EXPECT_FALSE(store_->is_usable(id));
  EXPECT_TRUE(store_->verified(other));
  // The same bytes mend it.
  put("abcdefg");
  EXPECT_TRUE(store_->verified(id));
  EXPECT_TRUE(store_->is_usable(id));
}

TEST_P(ObjectStoreTest, the_list_is_in_order_and_follows_removals) {
  Ids ids;
  for (const char* text : {"a", "b", "c", "d", "e", "f", "g"}) ids.push_back(put_free(text));
  std::sort(ids.begin(), ids.end());
  EXPECT_EQ(store_->list().value(), ids);
  ASSERT_TRUE(store_->remove(ids[3]));
  ids.erase(ids.begin() + 3);
  EXPECT_EQ(store_->list().value(), ids);
  EXPECT_FALSE(store_->stat(sha256_id("missing")));
}

TEST_P(ObjectStoreTest, a_pinned_blob_stays_until_the_last_pin_goes) {
  auto first = std::make_unique<BlobInfo>(put("abc"));
  auto second = std::make_unique<BlobInfo>(put("abc"));
  const std::string id = first->id;
  EXPECT_EQ(store_->remove(id).error().code, ErrorCode::kConflict);
  first.reset();
  EXPECT_EQ(store_->remove(id).error().code, ErrorCode::kConflict);
  EXPECT_TRUE(store_->take_suspects().empty());
  second.reset();
  EXPECT_EQ(store_->take_suspects(), std::set<std::string>{id});
  EXPECT_TRUE(store_->take_suspects().empty()) << "each once";
  EXPECT_TRUE(store_->remove(id));
  EXPECT_FALSE(store_->stat(id));
}

TEST_P(ObjectStoreTest, a_pin_outlives_the_store) {
  const auto info = std::make_unique<BlobInfo>(put("abc"));
  store_.reset();
  EXPECT_EQ(info->id, sha256_id("abc"));
}

TEST_P(ObjectStoreTest, suspects_are_told_once) {
  store_->suspect("b");
  store_->suspect("a");
  store_->suspect("a");
  EXPECT_EQ(store_->take_suspects(), (std::set<std::string>{"a", "b"}));
  EXPECT_TRUE(store_->take_suspects().empty());
}

TEST_P(ObjectStoreTest, threads_may_put_read_and_remove_the_same_blob) {
  constexpr int kRounds = 15;
  std::atomic<int> wrong{0};
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&, i] {
      for (int round = 0; round < kRounds; ++round) {
        const BlobInfo info = put("shared");
        // It is pinned, so whatever the others do, it is there.
        const auto bytes = read_blob(*store_, info.id);
        if (!bytes || *bytes != object_bytes("shared")) ++wrong;
        const std::string own = put_free(std::to_string(i) + " " + std::to_string(round));
        if (!store_->remove(own)) ++wrong;
        const Status removed = store_->remove(info.id);
        if (removed || removed.error().code != ErrorCode::kConflict) ++wrong;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(wrong, 0);
  EXPECT_EQ(store_->list().value(), Ids({sha256_id("shared")}));
}

INSTANTIATE_TEST_SUITE_P(Kinds, ObjectStoreTest, ::testing::ValuesIn(kKinds),
                         [](const auto& param) { return std::string(param.param.name); });

}  // namespace
}  // namespace voxeld
