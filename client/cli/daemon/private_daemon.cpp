#include "client/cli/daemon/private_daemon.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <thread>
#include <vector>

#include "client/include/voxeld/client.h"

namespace voxeld::cli {
namespace {

namespace fs = std::filesystem;
using client::Error;
using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr const char* kTenant = "local";  // of the key
constexpr auto kLook = 3ms;               // pause between two looks at a file or a lock
// A daemon that ends closes its data within seconds; one that starts may probe broken drivers.
constexpr auto kStartTimeMax = 60s;
constexpr auto kRequestTimeMax = 10s;  // of a request that asks whether the daemon responds

Error file_error(const fs::path& path) {
  return Error("file", 0, path.string() + ": " + std::strerror(errno));
}

class Fd {
 public:
  explicit Fd(int fd) : fd_(fd) {}
  Fd(Fd&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  Fd& operator=(Fd&&) = delete;
  ~Fd() { close(); }
  void close() {
    if (fd_ >= 0) ::close(fd_);
    fd_ = -1;
  }
  int get() const { return fd_; }
  bool valid() const { return fd_ >= 0; }

 private:
  int fd_;
};

// Waits a moment; throws when stopped, or with `late` after the deadline.
void wait_a_moment(Clock::time_point deadline, const std::stop_token& stop, const Error& late) {
  if (stop.stop_requested()) throw Error("interrupted", 0, "stopped by the caller");
  if (Clock::now() > deadline) throw late;
  std::this_thread::sleep_for(kLook);
}

std::string read_text(int fd) {
  std::string text;
  std::array<char, 4096> buffer{};
  ssize_t count = 0;
  while ((count = ::read(fd, buffer.data(), buffer.size())) > 0) {
    text.append(buffer.data(), static_cast<size_t>(count));
  }
  return text;
}

// Makes the folder for its user alone. Throws if others may have put files there.
void prepare(const fs::path& folder) {
  std::error_code failed;
  fs::create_directories(folder.parent_path(), failed);
  if (!failed && ::mkdir(folder.c_str(), 0700) != 0 && errno != EEXIST) throw file_error(folder);
  struct stat info {};
  if (failed || ::stat(folder.c_str(), &info) != 0) throw file_error(folder);
  if (!S_ISDIR(info.st_mode) || info.st_uid != ::geteuid() ||
      (info.st_mode & (S_IWGRP | S_IWOTH)) != 0) {
    throw Error("file", 0, folder.string() + " holds the data of the private daemon",
                "a folder that only its user can write to",
                "one of uid " + std::to_string(info.st_uid) + " with other rights; remove it");
  }
  if ((info.st_mode & (S_IRWXG | S_IRWXO)) != 0 && ::chmod(folder.c_str(), 0700) != 0) {
    throw file_error(folder);
  }
}

// --- the running daemon

// An address file that its daemon holds a lock on.
class Address {
 public:
  // nullopt: no daemon serves here.
  static std::optional<Address> read(const fs::path& folder) {
    Fd fd(::open((folder / "address").c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW));
    if (!fd.valid() || ::flock(fd.get(), LOCK_SH | LOCK_NB) == 0) return std::nullopt;
    const auto object = nlohmann::json::parse(read_text(fd.get()), nullptr, false);
    if (!object.is_object()) return std::nullopt;
    return Address(std::move(fd), object.value("url", ""), object.value("pid", 0));
  }
  const std::string& url() const { return url_; }
  int pid() const { return pid_; }
  // The daemon removes the file before it looks a last time whether a request has come.
  bool is_there() const {
    struct stat info {};
    return ::fstat(fd_.get(), &info) == 0 && info.st_nlink > 0;
  }

 private:
  Address(Fd fd, std::string url, int pid) : fd_(std::move(fd)), url_(std::move(url)), pid_(pid) {}
  Fd fd_;
  std::string url_;
  int pid_;
};

enum class Answer { kServes, kEnds, kRefusesKey };

// Asks the daemon for anything.
Answer ask(const Address& address, const std::string& key) {
  client::Settings settings;
  settings.url = address.url();
  settings.key = key;
  settings.retries = 0;
  settings.timeout = kRequestTimeMax;
  try {
    (void)client::Client(settings).whoami_json();
  } catch (const Error& error) {
    if (error.code() == "unauthorized") return Answer::kRefusesKey;
    if (error.code() != "timeout") return Answer::kEnds;
    throw Error("unreachable", 0,
                "the private daemon at " + address.url() + " does not respond; kill " +
                    std::to_string(address.pid()) + " ends it");
  }
  return address.is_there() ? Answer::kServes : Answer::kEnds;
}

std::string read_key(const fs::path& folder) {
  const Fd fd(::open((folder / "key").c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW));
  std::string key = fd.valid() ? read_text(fd.get()) : "";
  while (!key.empty() && (key.back() == '\n' || key.back() == '\r')) key.pop_back();
  return key;
}

struct Found {
  Answer answer = Answer::kEnds;  // kEnds also if there is none
  PrivateDaemon daemon;
};

Found find(const fs::path& folder) {
  Found found;
  if (const auto address = Address::read(folder)) {
    found.daemon = {address->url(), read_key(folder)};
    found.answer = ask(*address, found.daemon.key);
  }
  return found;
}

// --- start

bool is_program(const fs::path& path) {
  std::error_code failed;
  return fs::is_regular_file(path, failed) && ::access(path.c_str(), X_OK) == 0;
}

// The voxeld beside this program, else the one in PATH.
fs::path find_program() {
  std::error_code failed;
  const fs::path own = fs::read_symlink("/proc/self/exe", failed).parent_path();
  if (!failed && is_program(own / "voxeld")) return own / "voxeld";
  const char* path = std::getenv("PATH");
  std::istringstream folders(path != nullptr ? path : "");
  for (std::string folder; std::getline(folders, folder, ':');) {
    if (!folder.empty() && is_program(fs::path(folder) / "voxeld")) {
      return fs::absolute(fs::path(folder) / "voxeld");
    }
  }
  throw Error("unreachable", 0,
              "no daemon serves here, and there is no program voxeld in " + own.string() +
                  " or PATH to start one: install voxeld, or name a server with --url or "
                  "VOXELD_URL");
}

// Holds the lock under which daemons are started.
Fd lock_start(const fs::path& folder, Clock::time_point deadline, const std::stop_token& stop) {
  const fs::path path = folder / "starting";
  Fd fd(::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600));
  if (!fd.valid()) throw file_error(path);
  while (::flock(fd.get(), LOCK_EX | LOCK_NB) != 0) {
    wait_a_moment(deadline, stop,
                  Error("unreachable", 0,
                        "another voxel starts the private daemon and does not "
                        "end: it holds a lock on " +
                            path.string()));
  }
  return fd;
}

// A daemon that ends still has its data for a moment.
void wait_for_data(const fs::path& folder, Clock::time_point deadline,
                   const std::stop_token& stop) {
  const Fd fd(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!fd.valid()) throw file_error(folder);
  while (::flock(fd.get(), LOCK_SH | LOCK_NB) != 0) {
    wait_a_moment(deadline, stop,
                  Error("unreachable", 0,
                        folder.string() +
                            " is in use by a daemon that voxel did not start or that does not end; "
                            "its process is in " +
                            (folder / "lock").string()));
  }
}

// Attributes of a program to start, in a session of its own: a terminal's Ctrl-C does not reach it.
class Spawn {
 public:
  Spawn() {
    posix_spawn_file_actions_init(&files_);
    posix_spawnattr_init(&attributes_);
    sigset_t none;
    sigemptyset(&none);  // voxel has blocked some: see Interrupt
    posix_spawnattr_setsigmask(&attributes_, &none);
    posix_spawnattr_setflags(&attributes_,
                             static_cast<short>(POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSID));
    posix_spawn_file_actions_addopen(&files_, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  }
  ~Spawn() {
    posix_spawn_file_actions_destroy(&files_);
    posix_spawnattr_destroy(&attributes_);
  }
  Spawn(const Spawn&) = delete;
  Spawn& operator=(const Spawn&) = delete;

  // stdout goes to `out`, stderr to `err`.
  pid_t run(const fs::path& program, std::vector<std::string> arguments, int out, int err) {
    posix_spawn_file_actions_adddup2(&files_, out, STDOUT_FILENO);
    posix_spawn_file_actions_adddup2(&files_, err, STDERR_FILENO);
    posix_spawn_file_actions_addclosefrom_np(&files_, STDERR_FILENO + 1);
    std::string name = program.string();
    std::vector<char*> argv = {name.data()};
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    pid_t pid = 0;
    const int failed =
        ::posix_spawn(&pid, name.c_str(), &files_, &attributes_, argv.data(), environ);
    if (failed != 0) {
      throw Error("unreachable", 0, name + " cannot be started: " + std::strerror(failed));
    }
    return pid;
  }

 private:
  posix_spawn_file_actions_t files_{};
  posix_spawnattr_t attributes_{};
};

Fd open_log(const fs::path& folder) {
  const fs::path path = folder / "daemon.log";
  Fd fd(
      ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_APPEND | O_CLOEXEC | O_NOFOLLOW, 0600));
  if (!fd.valid()) throw file_error(path);
  return fd;
}

Error start_error(const fs::path& folder) {
  std::ifstream log(folder / "daemon.log");
  std::string last;
  for (std::string line; std::getline(log, line);) {
    if (!line.empty()) last = line;
  }
  constexpr std::string_view kPrefix = "voxeld: ";
  if (last.starts_with(kPrefix)) last.erase(0, kPrefix.size());
  return Error(
      "unreachable", 0,
      "the private daemon did not start: " + last + " (" + (folder / "daemon.log").string() + ")");
}

// Makes a key by `voxeld keys add`, which prints it.
void make_key(const fs::path& program, const fs::path& folder) {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) throw file_error(folder);
  const Fd reading(ends[0]);
  Fd writing(ends[1]);
  const Fd log = open_log(folder);
  const pid_t pid = Spawn().run(program, {"keys", "add", kTenant, "--data", folder.string()},
                                writing.get(), log.get());
  writing.close();
  const std::string key = read_text(reading.get());
  int status = 0;
  while (::waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  if (status != 0 || key.empty()) throw start_error(folder);
  const fs::path path = folder / "key", temporary = folder / "key.new";
  ::unlink(temporary.c_str());
  const Fd file(
      ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600));
  if (!file.valid() ||
      ::write(file.get(), key.data(), key.size()) != static_cast<ssize_t>(key.size()) ||
      ::rename(temporary.c_str(), path.c_str()) != 0) {
    throw file_error(path);
  }
}

pid_t start(const fs::path& program, const fs::path& folder) {
  const Fd log = open_log(folder);
  // Other settings are those of the VOXELD_ variables. A cache need not keep what it can compute.
  return Spawn().run(
      program,
      {"serve", "--listen", "127.0.0.1:0", "--admin-listen", "none", "--data", folder.string(),
       "--address-file", (folder / "address").string(), "--exit-when-idle",
       std::to_string(kPrivateIdleSeconds), "--store-bytes-max", "4G", "--keep-results-days", "7",
       "--keep-assets-days", "7", "--keep-jobs-days", "30"},
      log.get(), log.get());
}

// Called under the lock of lock_start().
PrivateDaemon start_and_wait(const fs::path& folder, Clock::time_point deadline,
                             const std::stop_token& stop) {
  const fs::path program = find_program();
  wait_for_data(folder, deadline, stop);
  if (read_key(folder).empty() || !fs::exists(folder / "keys")) make_key(program, folder);
  const pid_t pid = start(program, folder);
  for (bool has_new_key = false;;) {
    Found found = find(folder);
    if (found.answer == Answer::kServes) {
      found.daemon.is_new = true;
      return found.daemon;
    }
    if (found.answer == Answer::kRefusesKey && !has_new_key) {
      make_key(program, folder);
      has_new_key = true;
    }
    if (::waitpid(pid, nullptr, WNOHANG) == pid) throw start_error(folder);
    wait_a_moment(deadline, stop, start_error(folder));
  }
}

}  // namespace

fs::path private_daemon_folder() {
  const auto absolute = [](const char* name) {
    const char* value = std::getenv(name);
    return value != nullptr && *value == '/' ? fs::path(value) : fs::path();
  };
  if (const fs::path cache = absolute("XDG_CACHE_HOME"); !cache.empty()) return cache / "voxeld";
  if (const fs::path home = absolute("HOME"); !home.empty()) return home / ".cache" / "voxeld";
  throw Error("file", 0, "there is no folder for a private daemon: set HOME or XDG_CACHE_HOME");
}

PrivateDaemon use_private_daemon(const std::stop_token& stop) {
  const fs::path folder = private_daemon_folder();
  prepare(folder);
  Found found = find(folder);
  if (found.answer == Answer::kServes) return found.daemon;
  const auto deadline = Clock::now() + kStartTimeMax;
  const Fd lock = lock_start(folder, deadline, stop);
  found = find(folder);  // of the voxel that had the lock before
  if (found.answer == Answer::kRefusesKey) {
    make_key(find_program(), folder);
    found = find(folder);
  }
  if (found.answer == Answer::kServes) return found.daemon;
  return start_and_wait(folder, deadline, stop);
}

}  // namespace voxeld::cli
