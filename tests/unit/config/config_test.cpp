#include "server/config.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdlib>
#include <string>
#include <vector>

namespace voxeld {
namespace {

Command parse(std::vector<const char*> arguments) {
  arguments.insert(arguments.begin(), "voxeld");
  return parse_command_line(static_cast<int>(arguments.size()), arguments.data());
}

// Sets a variable for one test.
class Variable {
 public:
  Variable(const char* name, const char* value) : name_(name) { ::setenv(name, value, 1); }
  ~Variable() { ::unsetenv(name_); }

 private:
  const char* name_;
};

TEST(Config, without_arguments_serve_listens_on_loopback_with_a_state_directory) {
  Variable state("XDG_STATE_HOME", "/state");
  const auto config = std::get<ServeConfig>(parse({}));
  EXPECT_EQ(config.listen, "127.0.0.1:8080");
  EXPECT_EQ(config.admin_listen, "127.0.0.1:8081");
  EXPECT_EQ(config.data_dir, "/state/voxeld");
  EXPECT_EQ(config.devices, std::vector<std::string>{"auto"});
  EXPECT_FALSE(config.allow_remote);
  EXPECT_FALSE(config.admin_allow_remote);
}

TEST(Config, devices_are_shared_fairly_by_three_workers_each_unless_told_otherwise) {
  const auto config = std::get<ServeConfig>(parse({}));
  EXPECT_EQ(config.workers_per_device, 3);
  EXPECT_TRUE(config.is_fair);
  EXPECT_EQ(config.memory_bytes_max, 0);
  const Variable workers("VOXELD_WORKERS_PER_DEVICE", "5");
  const auto other = std::get<ServeConfig>(parse({"--scheduler", "fifo", "--memory-max", "1500M"}));
  EXPECT_EQ(other.workers_per_device, 5);
  EXPECT_FALSE(other.is_fair);
  EXPECT_EQ(other.memory_bytes_max, int64_t{1500} << 20);
  EXPECT_EQ(std::get<ExitCommand>(parse({"--scheduler", "lottery"})).status, 64);
  EXPECT_EQ(std::get<ExitCommand>(parse({"--workers-per-device", "0"})).status, 64);
}

TEST(Config, flags_without_a_subcommand_are_those_of_serve) {
  EXPECT_EQ(std::get<ServeConfig>(parse({"--listen", "127.0.0.1:9"})).listen, "127.0.0.1:9");
}

TEST(Config, devices_come_repeated_or_with_commas) {
  const std::vector<std::string> both = {"egl:0", "llvmpipe"};
  EXPECT_EQ(std::get<ServeConfig>(parse({"serve", "--device", "egl:0,llvmpipe"})).devices, both);
  EXPECT_EQ(
      std::get<ServeConfig>(parse({"serve", "--device", "egl:0", "--device", "llvmpipe"})).devices,
      both);
}

TEST(Config, doctor_calibrates_the_named_devices_in_the_data_directory_of_serve) {
  Variable data("VOXELD_DATA", "/state/elsewhere");
  const auto plain = std::get<DoctorCommand>(parse({"doctor"}));
  EXPECT_FALSE(plain.calibrate);
  EXPECT_EQ(plain.data_dir, "/state/elsewhere");
  EXPECT_EQ(plain.sandbox, "auto");
  EXPECT_EQ(std::get<DoctorCommand>(parse({"doctor", "--sandbox", "require"})).sandbox, "require");
  const auto calibrate = std::get<DoctorCommand>(
      parse({"doctor", "--calibrate", "--data", "/d", "--device", "cpu,llvmpipe"}));
  EXPECT_TRUE(calibrate.calibrate);
  EXPECT_EQ(calibrate.data_dir, "/d");
  EXPECT_EQ(calibrate.devices, (std::vector<std::string>{"cpu", "llvmpipe"}));
  EXPECT_EQ(std::get<ExitCommand>(parse({"doctor", "--device", "cpu"})).status, 64);
}

TEST(Config, variables_stand_in_for_flags_and_flags_win) {
  Variable listen("VOXELD_LISTEN", "127.0.0.1:1");
  Variable device("VOXELD_DEVICE", "osmesa");
  Variable bytes("VOXELD_UPLOAD_BYTES_MAX", "2M");
  EXPECT_EQ(std::get<ServeConfig>(parse({"serve"})).listen, "127.0.0.1:1");
  EXPECT_EQ(std::get<ServeConfig>(parse({"serve"})).devices, std::vector<std::string>{"osmesa"});
  EXPECT_EQ(std::get<ServeConfig>(parse({"serve"})).upload_bytes_max, 2 << 20);
  EXPECT_EQ(std::get<ServeConfig>(parse({"serve", "--listen", "127.0.0.1:2"})).listen,
            "127.0.0.1:2");
}

TEST(Config, public_hosts_and_cors_origins_are_lists_of_valid_values) {
  const auto config = std::get<ServeConfig>(
      parse({"--public-host", "a.example,b.example", "--public-host", "c", "--cors-origin",
             "https://app.example", "--cors-origin", "http://localhost:3000"}));
  EXPECT_EQ(config.public_hosts, (std::vector<std::string>{"a.example", "b.example", "c"}));
  EXPECT_EQ(config.cors_origins,
            (std::vector<std::string>{"https://app.example", "http://localhost:3000"}));
  for (const char* host : {"a:80", "http://a", "*", "a b", "", "a/b"}) {
    EXPECT_EQ(std::get<ExitCommand>(parse({"--public-host", host})).status, 64) << host;
  }
  for (const char* origin : {"*", "null", "app.example", "https://app.example/", "ftp://a", ""}) {
    EXPECT_EQ(std::get<ExitCommand>(parse({"--cors-origin", origin})).status, 64) << origin;
  }
}

TEST(Config, the_log_level_goes_by_name) {
  EXPECT_EQ(std::get<ServeConfig>(parse({"serve", "--log-level", "debug"})).log_level,
            log::Level::kDebug);
  EXPECT_EQ(log_level_name(log::Level::kWarn), "warn");
  EXPECT_EQ(std::get<ExitCommand>(parse({"serve", "--log-level", "loud"})).status, 64);
}

TEST(Config, the_other_commands_take_their_arguments) {
  const auto worker =
      std::get<WorkerCommand>(parse({"worker", "--gateway", "unix:/s", "--device", "osmesa"}));
  EXPECT_EQ(worker.gateway, "unix:/s");
  EXPECT_EQ(worker.device, "osmesa");
  EXPECT_TRUE(std::get<DoctorCommand>(parse({"doctor", "--json"})).json);
  EXPECT_EQ(std::get<ProbeDeviceCommand>(parse({"probe-device", "--device", "egl:1"})).device,
            "egl:1");
  EXPECT_EQ(
      std::get<ProbeDeviceCommand>(parse({"probe-device", "--device", "egl:1", "--sandbox", "off"}))
          .sandbox,
      "off");
  const auto test = std::get<TestDeviceCommand>(
      parse({"test-device", "--device", "egl:0", "--data", "/d", "--skip", "solid", "--skip",
             "images", "--shader-dir", "/s"}));
  EXPECT_EQ(test.device, "egl:0");
  EXPECT_EQ(test.data_dir, "/d");
  EXPECT_EQ(test.shader_dir, "/s");
  EXPECT_EQ(test.skipped, (std::vector<std::string>{"solid", "images"}));
  EXPECT_TRUE(std::holds_alternative<VersionCommand>(parse({"version"})));
  EXPECT_TRUE(std::holds_alternative<VersionCommand>(parse({"--version"})));
}

TEST(Config, unknown_arguments_exit_with_the_usage_status_and_help_with_0) {
  EXPECT_EQ(std::get<ExitCommand>(parse({"dance"})).status, 64);
  EXPECT_EQ(std::get<ExitCommand>(parse({"serve", "--lisen", "x"})).status, 64);
  EXPECT_EQ(std::get<ExitCommand>(parse({"worker"})).status, 64);
  EXPECT_EQ(std::get<ExitCommand>(parse({"serve", "--upload-bytes-max", "-1"})).status, 64);
  EXPECT_EQ(std::get<ExitCommand>(parse({"--help"})).status, 0);
  EXPECT_EQ(std::get<ExitCommand>(parse({"serve", "--help"})).status, 0);
}

TEST(Config, times_that_a_clock_or_a_calendar_cannot_hold_are_refused) {
  EXPECT_EQ(std::get<ExitCommand>(parse({"--drain-seconds", "1e10"})).status, 64);
  EXPECT_EQ(std::get<ServeConfig>(parse({"--drain-seconds", "86400"})).drain_seconds, 86400);
  for (const char* flag :
       {"--keep-results-days", "--keep-assets-days", "--keep-jobs-days", "--keep-orphans-days"}) {
    EXPECT_EQ(std::get<ExitCommand>(parse({flag, "500000"})).status, 64) << flag;
    EXPECT_TRUE(std::holds_alternative<ServeConfig>(parse({flag, "365000"}))) << flag;
  }
}

TEST(Config, times_are_numbers_and_the_error_says_from_where_to_where) {
  for (const char* flag :
       {"--drain-seconds", "--part-seconds", "--job-seconds-max", "--exit-when-idle",
        "--keep-results-days", "--keep-assets-days", "--keep-jobs-days", "--keep-orphans-days"}) {
    for (const char* value : {"nan", "-nan", "NAN", "inf", "-inf", "-1", "soon"}) {
      EXPECT_EQ(std::get<ExitCommand>(parse({flag, value})).status, 64) << flag << " " << value;
    }
    EXPECT_TRUE(std::holds_alternative<ServeConfig>(parse({flag, "0.5"}))) << flag;
    ::testing::internal::CaptureStderr();
    parse({flag, "nan"});
    const std::string text = ::testing::internal::GetCapturedStderr();
    EXPECT_NE(text.find(std::string(flag) + ": expected a number from 0 to "), std::string::npos)
        << text;
    EXPECT_NE(text.find(", got nan"), std::string::npos) << text;
  }
}

TEST(Config, a_variable_of_a_list_has_several_values) {
  const Variable proxies("VOXELD_TRUSTED_PROXY", "10.0.0.1,10.0.0.2");
  const Variable hosts("VOXELD_PUBLIC_HOST", "a.example,b.example");
  const auto config = std::get<ServeConfig>(parse({}));
  EXPECT_EQ(config.trusted_proxies, (std::vector<std::string>{"10.0.0.1", "10.0.0.2"}));
  EXPECT_EQ(config.public_hosts, (std::vector<std::string>{"a.example", "b.example"}));
}

TEST(Config, a_variable_is_checked_as_its_flag_is) {
  for (const auto& [name, value, said] :
       {std::array{"VOXELD_JOB_SECONDS_MAX", "nan", "--job-seconds-max: expected a number from 0"},
        std::array{"VOXELD_WORKERS_PER_DEVICE", "0", "--workers-per-device: Value 0 not in range"},
        std::array{"VOXELD_SCHEDULER", "lottery", "--scheduler: Check lottery value in"},
        std::array{"VOXELD_PUBLIC_HOST", "a:80", "--public-host: expected a host name"}}) {
    const Variable variable(name, value);
    ::testing::internal::CaptureStderr();
    const Command command = parse({});
    EXPECT_THAT(::testing::internal::GetCapturedStderr(), ::testing::HasSubstr(said));
    ASSERT_TRUE(std::holds_alternative<ExitCommand>(command)) << name;
    EXPECT_EQ(std::get<ExitCommand>(command).status, 64) << name;
  }
}

TEST(Config, keys_are_added_listed_and_revoked_in_a_data_directory) {
  Variable data("VOXELD_DATA", "/state/elsewhere");
  using Action = KeysCommand::Action;
  const auto add = std::get<KeysCommand>(parse({"keys", "add", "lab"}));
  EXPECT_EQ(add.action, Action::kAdd);
  EXPECT_EQ(add.tenant, "lab");
  EXPECT_EQ(add.data_dir, "/state/elsewhere");
  EXPECT_FALSE(add.is_admin);
  EXPECT_FALSE(add.weight);  // stays what the tenant has
  EXPECT_EQ(add.expires, "");
  const auto all = std::get<KeysCommand>(parse(
      {"keys", "add", "boss", "--admin", "--expires", "30d", "--weight", "5", "--data", "/d"}));
  EXPECT_TRUE(all.is_admin);
  EXPECT_EQ(all.expires, "30d");
  EXPECT_EQ(all.weight, 5);
  EXPECT_EQ(all.data_dir, "/d");
  const auto list = std::get<KeysCommand>(parse({"keys", "list", "--json", "--data", "/d"}));
  EXPECT_EQ(list.action, Action::kList);
  EXPECT_TRUE(list.json);
  EXPECT_EQ(list.data_dir, "/d");
  const auto revoke = std::get<KeysCommand>(parse({"keys", "revoke", "abcdefgh"}));
  EXPECT_EQ(revoke.action, Action::kRevoke);
  EXPECT_EQ(revoke.id, "abcdefgh");
  for (const std::vector<const char*>& wrong : {std::vector<const char*>{"keys"},
                                                {"keys", "add"},
                                                {"keys", "revoke"},
                                                {"keys", "delete"},
                                                {"keys", "add", "lab", "--weight", "0"},
                                                {"keys", "add", "lab", "--weight", "1001"},
                                                {"keys", "list", "lab"}}) {
    EXPECT_EQ(std::get<ExitCommand>(parse(wrong)).status, 64);
  }
}

TEST(Config, other_addresses_than_loopback_need_keys_or_a_flag_and_the_error_says_why) {
  for (const char* address : {"127.0.0.1:8080", "127.1.2.3:0", "localhost:80", "[::1]:8080"}) {
    EXPECT_TRUE(check_listen_address("--listen", address, false, Guard::kNoKeys)) << address;
  }
  for (const char* address :
       {"0.0.0.0:8080", "[::]:8080", "127.evil.example:80", "192.168.0.1:80", "example.org:80"}) {
    const Status refused = check_listen_address("--listen", address, false, Guard::kNoKeys);
    ASSERT_FALSE(refused) << address;
    EXPECT_NE(refused.error().detail.find("there are no API keys"), std::string::npos);
    EXPECT_NE(refused.error().detail.find("voxeld keys add"), std::string::npos);
    EXPECT_NE(refused.error().detail.find("--allow-remote"), std::string::npos);
    EXPECT_TRUE(check_listen_address("--listen", address, true, Guard::kNoKeys));
    EXPECT_TRUE(check_listen_address("--listen", address, false, Guard::kKeys));
    const Status admin = check_listen_address("--admin-listen", address, false, Guard::kNone);
    ASSERT_FALSE(admin) << address;
    EXPECT_NE(admin.error().detail.find("needs no API key: pass --admin-allow-remote"),
              std::string::npos);
    EXPECT_TRUE(check_listen_address("--admin-listen", address, true, Guard::kNone));
  }
}

TEST(Config, a_listen_address_is_a_host_and_a_port) {
  const auto checked = [](const char* address) {
    return check_listen_address("--listen", address, true, Guard::kKeys);
  };
  EXPECT_EQ(checked("8080").error().message(),
            "--listen: expected HOST:PORT, such as 127.0.0.1:8080 or [::1]:8080, and a port up to "
            "65535, got 8080");
  for (const char* wrong :
       {"", ":8080", "127.0.0.1", "127.0.0.1:", "127.0.0.1:http", "::1", "::1:8080", "[::1]",
        "[::1]:", "127.0.0.1:65536", "127.0.0.1:-1", "127.0.0.1:99999", "127.0.0.1:80 "}) {
    EXPECT_FALSE(checked(wrong)) << wrong;
  }
  for (const char* right : {"127.0.0.1:0", "[::1]:65535", "[fe80::1%eth0]:80", "gpu:8080"}) {
    EXPECT_TRUE(checked(right)) << right;
  }
}

}  // namespace
}  // namespace voxeld
