#include "client/cli/commands/dry_run.h"

#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "client/cli/bundle.h"
#include "client/cli/commands/batch.h"
#include "client/cli/terminal/human.h"
#include "client/cli/terminal/report.h"
#include "client/include/voxeld/client.h"

namespace voxeld::cli {
namespace {

using Json = nlohmann::json;

// The estimate of a job on the mesh, or on what is stored.
Json estimate_of(client::Client& daemon, const Arguments& arguments, const std::string& input,
                 const std::stop_token& stop) {
  const bool is_render = arguments.command == Arguments::Command::kRender;
  const std::string kind = is_render ? "render" : "voxelize";
  client::Options options = arguments.options;
  if (input.empty()) {
    const client::Input stored = {"", arguments.grid, arguments.sequence};
    return parsed(daemon.estimate_json(kind, stored, options, stop));
  }
  const MeshSource mesh = MeshSource::open(input, arguments.beside, stop, arguments.pipe);
  const std::string asset = daemon.upload(mesh.source(), {}, stop);
  if (!mesh.source().filename().empty() && !options.has("filename")) {
    options.set("filename", mesh.source().filename());
  }
  return parsed(daemon.estimate_json(kind, client::Input::of_asset(asset), options, stop));
}

void add_row(const std::string& name, const Json& response, Table& table) {
  const Json estimate = response.value("estimate", Json::object());
  const auto number = [&](const char* member) { return estimate.value(member, 0.0); };
  if (response.value("cached", false)) {
    table.add({name, "0 s", "the result is stored"});
    return;
  }
  const auto wait_ms = response.value("expected_start_ms", std::int64_t{0}) - unix_now_ms();
  const auto learned = estimate.value("learned_from", std::int64_t{0});
  table.add({name, seconds_text(number("seconds")),
             seconds_text(number("seconds_low")) + " to " + seconds_text(number("seconds_high")),
             bytes_text(static_cast<std::int64_t>(number("result_bytes"))),
             bytes_text(static_cast<std::int64_t>(number("host_bytes"))),
             wait_ms < 100 ? "now" : "in " + seconds_text(static_cast<double>(wait_ms) / 1000.0),
             learned == 0 ? "a guess" : count_text(learned) + " jobs"});
}

}  // namespace

void run_dry_run(const Arguments& arguments, const std::stop_token& stop) {
  client::Client daemon(settings_of(arguments));
  Table table("lrlrrll");
  table.add({"INPUT", "TIME", "RANGE", "RESULT", "MEMORY", "START", "LEARNED FROM"});
  Json estimates = Json::array();
  const auto estimate = [&](const std::string& input) {
    Json response = estimate_of(daemon, arguments, input, stop);
    const std::string name = input.empty() ? arguments.grid + arguments.sequence : input;
    add_row(name, response, table);
    response["input"] = name;
    estimates.push_back(std::move(response));
  };
  std::vector<std::optional<client::Error>> errors(arguments.batch.size());
  for (size_t i = 0; i < arguments.batch.size(); ++i) {
    const std::string& input = arguments.batch[i].input;
    try {
      estimate(input);
    } catch (const client::Error& error) {
      if (stop.stop_requested()) throw;
      errors[i] = error;
      table.add({input, error.code()});
      estimates.push_back(
          {{"input", input}, {"error", {{"code", error.code()}, {"message", error.what()}}}});
    }
  }
  if (arguments.batch.empty()) estimate(arguments.input);
  if (arguments.json) {
    print_json({{"estimates", estimates}});
  } else {
    std::fputs(table.text().c_str(), stdout);
  }
  tell_failures(arguments, errors);
}

}  // namespace voxeld::cli
