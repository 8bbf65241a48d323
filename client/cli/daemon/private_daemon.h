// The private daemon of a user: a voxeld that voxel starts where none serves, and that ends when
// idle. Its data is in $XDG_CACHE_HOME/voxeld (~/.cache/voxeld), mode 0700:
//
//   address     URL and pid (voxeld serve --address-file), locked by the daemon while it serves
//   key         the API key (mode 0600), which no other user of the machine can read
//   starting    locked by the voxel that starts the daemon
//   daemon.log  what the last one has written
//
// It listens on a free port of loopback. Another user who took that port after a crash would get
// the key; therefore a request is sent only while the daemon holds the lock on its address.
#pragma once

#include <filesystem>
#include <stop_token>
#include <string>

namespace voxeld::cli {

struct PrivateDaemon {
  std::string url, key;
  bool is_new = false;  // started by this call
};

// An idle daemon ends after this time.
inline constexpr int kPrivateIdleSeconds = 60;

// $XDG_CACHE_HOME/voxeld, else $HOME/.cache/voxeld. Throws client::Error "file" without either.
std::filesystem::path private_daemon_folder();

// Finds the user's daemon or starts one; it serves requests for at least kPrivateIdleSeconds from
// now on. Throws client::Error: "unreachable" if there is no program voxeld or it does not start,
// "file" for a folder that other users may write to, "interrupted".
PrivateDaemon use_private_daemon(const std::stop_token& stop);

}  // namespace voxeld::cli
