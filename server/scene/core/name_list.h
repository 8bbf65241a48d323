// Numbers the meshes, nodes and groups of a file in the order in which surfaces first use them.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace voxeld {

// Fills one of Scene's lists of names. The key distinguishes two entries in the file, because their
// names may be equal.
template <typename Key>
class NameList {
 public:
  // `names` is cleared, and must outlive the last call.
  explicit NameList(std::vector<std::string>& names) : names_(names) { names_.clear(); }

  // The index of `key`. A new key is added and named name().
  template <typename Name>
  uint32_t index_of(const Key& key, const Name& name) {
    const auto [found, is_new] = indices_.try_emplace(key, static_cast<uint32_t>(names_.size()));
    if (is_new) names_.push_back(name());
    return found->second;
  }

 private:
  std::vector<std::string>& names_;
  std::map<Key, uint32_t> indices_;
};

}  // namespace voxeld
