// Which tasks a worker process may run after others.
//
// A worker parses the files of users. A process that a hostile file has taken over belongs to its
// uploader from then on, and would see the inputs of every later task. Isolation bounds who
// can be harmed: with kTenant a process that has had a task of one tenant never gets one of
// another, with kTask each process gets one task. Processes that have had none, `fresh` ones, are
// kept in reserve, so that a change of tenants does not wait for the start of a process.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace voxeld {

enum class WorkerIsolation { kNone, kTenant, kTask };

// "none", "tenant" or "task"; nullopt for another name.
std::optional<WorkerIsolation> worker_isolation_of(std::string_view name);

// Fresh processes of a device beside those that run its tasks, `workers_per_device` at a time.
int reserve_of(WorkerIsolation isolation, int workers_per_device);

// The tenants whose tasks a worker process has had.
class WorkerPast {
 public:
  // A task of the tenant; its input is `input_tenant`'s, another one's where an admin asked.
  void add(std::string_view tenant, std::string_view input_tenant);
  bool is_fresh() const { return !tenant_; }
  // Whether it may run such a task now. A task on another tenant's input takes a fresh process, and
  // is its last one.
  bool may_run(WorkerIsolation isolation, std::string_view tenant,
               std::string_view input_tenant) const;
  // Whether there is a tenant whose tasks it may run, now or ever.
  bool is_used_up(WorkerIsolation isolation) const;

 private:
  std::optional<std::string> tenant_;  // the only one so far
  bool is_mixed_ = false;              // it has read files of several
};

}  // namespace voxeld
