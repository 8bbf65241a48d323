// The tenant and rights in whose name a request acts.
#pragma once

#include <string>
#include <utility>

namespace voxeld {

// Assets, jobs, frames, sequences, grids and results belong to the tenant that made them; for
// others they do not exist. There is no default: every call that reads or changes them says for
// whom, and only http/access turns a key into a Caller.
class Caller {
 public:
  // One that the key ring admitted. An admin sees what every tenant has; what it makes is its own.
  static Caller tenant(std::string name, bool is_admin) { return {std::move(name), is_admin}; }
  // A client of a daemon without keys: the tenant "".
  static Caller open() { return {"", false}; }
  // Sees nothing and owns nothing; no tenant can have this name.
  static Caller nobody() { return {"-", false}; }
  // The daemon itself: task server, recovery.
  static Caller daemon() { return {"", true}; }

  // Owns what this caller makes.
  const std::string& tenant() const { return tenant_; }
  bool sees_all() const { return sees_all_; }

 private:
  Caller(std::string tenant, bool sees_all) : tenant_(std::move(tenant)), sees_all_(sees_all) {}
  std::string tenant_;
  bool sees_all_;
};

}  // namespace voxeld
