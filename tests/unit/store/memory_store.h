// An ObjectStore in memory, which shows that the interface does not need files: only local_file()
// writes one. Nothing survives it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "server/base/thread_annotations.h"
#include "server/store/object_store.h"
#include "tests/unit/base/temporary_dir.h"

namespace voxeld::testing {

class MemoryStore final : public ObjectStore {
 public:
  MemoryStore();
  using ObjectStore::adopt;
  using ObjectStore::begin;
  Result<BlobWriter> begin(int64_t bytes_max, Durability durability) override;
  Result<BlobInfo> adopt(const std::filesystem::path& file, Durability durability) override;
  Status sync() override { return {}; }
  Result<BlobInfo> stat(std::string_view id) const override;
  Result<BlobInfo> verified(std::string_view id) const override;
  bool is_usable(std::string_view id) const override;
  Result<std::unique_ptr<BlobReader>> read(std::string_view id, int64_t offset,
                                           int64_t bytes) const override;
  Result<std::filesystem::path> local_file(std::string_view id) const override;
  Result<std::vector<std::string>> list() const override;
  Status remove(std::string_view id) override;
  std::set<std::string> take_suspects() override;
  void suspect(std::string id) override;
  // Changes the first byte of what is stored.
  void damage(std::string_view id);

 private:
  using Bytes = std::shared_ptr<const std::vector<uint8_t>>;
  struct State {
    Mutex mutex;
    std::map<std::string, Bytes, std::less<>> blobs GUARDED_BY(mutex);
    std::multiset<std::string, std::less<>> pins GUARDED_BY(mutex);
    std::set<std::string> suspects GUARDED_BY(mutex);
  };
  class Sink;
  static BlobInfo put(const std::shared_ptr<State>& state, std::string id,
                      std::vector<uint8_t> bytes);
  Result<Bytes> find(std::string_view id) const;

  TemporaryDir files_;  // of local_file()
  std::shared_ptr<State> state_;
};

}  // namespace voxeld::testing
