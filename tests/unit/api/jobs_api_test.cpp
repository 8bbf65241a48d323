// Jobs over HTTP: long polls, event streams, and what is refused at the limits.
#include <gtest/gtest.h>

#include <set>
#include <string>
#include <vector>

#include "server/api/resources/jobs/job_responses.h"
#include "server/process/memory_reserve.h"
#include "tests/unit/api/api_server_fixture.h"
#include "tests/unit/jobs/lists.h"

namespace voxeld::api {
namespace {

class JobsApi : public ServerTest {
 protected:
  bool requests_waiting(int count) {
    const std::string line = "{what=\"waiting\"} " + std::to_string(count) + "\n";
    return comes_true([&] { return admin("/metrics").body.find(line) != std::string::npos; });
  }
};

TEST_F(JobsApi, a_draining_daemon_refuses_new_work_as_shutting_down_and_is_not_ready) {
  const std::string job = "/v1/jobs/" + submit();
  FakeWorker worker = connect_worker();
  ASSERT_TRUE(comes_true([&] { return admin("/readyz").status == 200; }));
  jobs_->drain();
  const HttpResponse refused = post_job();
  EXPECT_EQ(refused.status, 503);
  EXPECT_EQ(refused.code(), "shutting-down");
  EXPECT_EQ(refused.detail(), "the daemon is shutting down; try again");
  EXPECT_EQ(refused.header("retry-after"), "2");
  EXPECT_EQ(request("POST", "/v1/voxelize", "", "mesh").code(), "shutting-down");
  EXPECT_EQ(get(job).status, 200) << "what exists can still be looked at";
  const HttpResponse ready = admin("/readyz");
  EXPECT_EQ(ready.status, 503);
  EXPECT_EQ(json(ready).value("ready", true), false);
  EXPECT_EQ(json(ready).value("reason", ""), "the daemon is shutting down");
  EXPECT_EQ(admin("/livez").status, 200);
}

TEST_F(JobsApi, while_memory_is_short_new_work_is_refused_and_the_rest_goes_on) {
  const std::string id = submit();
  hold_memory_reserve(size_t{1} << 62);  // which nobody has
  const HttpResponse refused = post_job();
  EXPECT_EQ(refused.status, 503);
  EXPECT_EQ(refused.code(), "queue-full");
  EXPECT_EQ(refused.header("retry-after"), "2");
  EXPECT_EQ(get("/v1/jobs/" + id).status, 200);
  EXPECT_EQ(request("DELETE", "/v1/jobs/" + id).status, 200);
  hold_memory_reserve(1024);
  EXPECT_EQ(post_job().status, 202);
  hold_memory_reserve(0);
}

TEST_F(JobsApi, delete_cancels_a_job_and_removes_one_that_had_ended_if_told_so) {
  const std::string id = submit(), remove = "/v1/jobs/" + id + "?ended=remove";
  for (const std::string& path : {remove, "/v1/jobs/" + id, "/v1/jobs/" + id}) {
    const HttpResponse cancelled = request("DELETE", path);
    EXPECT_EQ(cancelled.status, 200);
    EXPECT_EQ(json(cancelled).value("state", ""), "cancelled");
    EXPECT_EQ(get("/v1/jobs/" + id).status, 200);
  }
  const HttpResponse removed = request("DELETE", remove);
  EXPECT_EQ(removed.status, 200);
  EXPECT_EQ(json(removed).value("state", ""), "cancelled") << "as it was last";
  for (const char* path : {"", "/events", "/result"}) {
    EXPECT_EQ(get("/v1/jobs/" + id + path).status, 404) << path;
  }
  EXPECT_EQ(request("DELETE", remove).status, 404);
}

TEST_F(JobsApi, a_query_with_another_word_than_its_parameter_has_is_refused_and_does_nothing) {
  const std::string asset = "/v1/assets/" + post_asset(), job = "/v1/jobs/" + submit();
  const auto expect_refused = [&](const HttpResponse& refused, const std::string& name,
                                  const std::string& expected, const std::string& got) {
    EXPECT_EQ(refused.status, 400) << name;
    EXPECT_EQ(refused.code(), "invalid-option") << name;
    EXPECT_EQ(refused.detail(), name);
    EXPECT_EQ(json(refused).value("expected", ""), expected) << name;
    EXPECT_EQ(json(refused).value("got", "none"), "\"" + got + "\"") << name;
  };
  expect_refused(request("DELETE", job + "?ended=Remove"), "ended", "remove", "Remove");
  EXPECT_EQ(json(get(job)).value("state", ""), "queued");
  ASSERT_EQ(json(request("DELETE", job)).value("state", ""), "cancelled");
  expect_refused(request("DELETE", job + "?ended=keep"), "ended", "remove", "keep");
  EXPECT_EQ(get(job).status, 200);
  const std::string body =
      R"({"kind":"voxelize","asset":")" + asset.substr(asset.rfind('/') + 1) + R"("})";
  expect_refused(request("POST", "/v1/jobs?dry_run=yes", "", body), "dry_run", "0 | 1", "yes");
  EXPECT_EQ(json(get("/v1/jobs"))["jobs"].size(), 1u);
  expect_refused(get(asset + "?brief=true"), "brief", "0 | 1", "true");
}

TEST_F(JobsApi, a_job_is_sent_with_its_place_and_polled_with_its_version) {
  const HttpResponse sent = post_job();
  EXPECT_EQ(sent.status, 202);
  EXPECT_EQ(sent.header("location"), "/v1/jobs/" + json(sent).value("id", ""));
  EXPECT_EQ(sent.header("retry-after"), "1");
  const HttpResponse status = get(sent.header("location"));
  EXPECT_EQ(status.status, 200);
  EXPECT_EQ(status.header("etag"), sent.header("etag"));
  EXPECT_EQ(json(status).value("state", ""), "queued");
  const std::string tag = sent.header("etag");
  EXPECT_TRUE(tag.starts_with("W/\"")) << "expected times change without a new version";
  for (const std::string& known : {tag, tag.substr(2), "\"x\", " + tag, std::string("*")}) {
    EXPECT_EQ(get(sent.header("location"), "If-None-Match: " + known + "\r\n").status, 304)
        << known;
  }
  EXPECT_EQ(get(sent.header("location"), "If-None-Match: \"x\"\r\n").status, 200);
}

TEST_F(JobsApi, a_poll_that_waits_ends_with_the_job) {
  const std::string path = "/v1/jobs/" + submit();
  HttpClient client(server_->port());
  ASSERT_TRUE(client.send_get(path, "Prefer: wait=60\r\n"));
  FakeWorker worker = connect_worker();
  const auto task = worker.claim();
  ASSERT_TRUE(task && worker.complete(*task, "bytes"));
  const auto response = client.receive();
  ASSERT_TRUE(response);
  EXPECT_EQ(json(*response).value("state", ""), "done");
}

TEST_F(JobsApi, a_poll_for_the_next_change_ends_with_it) {
  const HttpResponse sent = post_job();
  HttpClient client(server_->port());
  ASSERT_TRUE(client.send_get(sent.header("location"),
                              "Prefer: wait=60\r\nIf-None-Match: " + sent.header("etag") + "\r\n"));
  FakeWorker worker = connect_worker();
  const auto task = worker.claim();
  ASSERT_TRUE(task);
  const auto response = client.receive();
  ASSERT_TRUE(response);
  EXPECT_EQ(response->status, 200);
  EXPECT_EQ(json(*response).value("state", ""), "running");
  EXPECT_NE(response->header("etag"), sent.header("etag"));
}

TEST_F(JobsApi, a_poll_that_missed_a_change_does_not_wait_for_the_next_one) {
  const HttpResponse sent = post_job();
  FakeWorker worker = connect_worker();
  ASSERT_TRUE(worker.claim());  // it runs now, which the client does not know
  HttpClient client(server_->port());
  ASSERT_TRUE(client.send_get(sent.header("location"),
                              "Prefer: wait=60\r\nIf-None-Match: " + sent.header("etag") + "\r\n"));
  ASSERT_TRUE(client.readable(kPatienceSeconds / 2)) << "less than it would wait";
  EXPECT_EQ(json(*client.receive()).value("state", ""), "running");
}

TEST_F(JobsApi, stopping_does_not_wait_for_a_request_that_waits) {
  HttpClient client(server_->port());
  ASSERT_TRUE(
      client.send("POST /v1/voxelize?size=16 HTTP/1.1\r\nHost: h\r\n"
                  "Content-Length: 4\r\n\r\nmesh"));
  ASSERT_TRUE(requests_waiting(1));
  server_->stop(0);  // would last for an hour
  EXPECT_TRUE(client.receive_to_end());
}

TEST_F(JobsApi, a_long_poll_returns_when_the_daemon_stops) {
  const HttpResponse sent = post_job();
  HttpClient client(server_->port());
  ASSERT_TRUE(client.send_get(sent.header("location"), "Prefer: wait=60\r\n"));
  ASSERT_TRUE(requests_waiting(1));
  server_->stop(3600);
  const auto response = client.receive();
  ASSERT_TRUE(response);
  EXPECT_EQ(json(*response).value("state", ""), "queued");
}

TEST_F(JobsApi, waits_are_clamped_and_nonsense_is_no_wait) {
  const auto seconds = [](const std::string& prefer) {
    Request request;
    request.head.headers["Prefer"] = prefer;
    return preferred_wait_seconds(request);
  };
  EXPECT_EQ(seconds("wait=7"), 7);
  EXPECT_EQ(seconds("respond-async, wait=7"), 7);
  EXPECT_EQ(seconds("wait=61"), limits::kPreferWaitSecondsMax);
  EXPECT_EQ(seconds("wait=99999999999999999999"), limits::kPreferWaitSecondsMax);
  EXPECT_EQ(seconds("wait=-1"), 0);
  EXPECT_EQ(seconds("wait=soon"), 0);
  EXPECT_EQ(seconds(""), 0);
}

TEST_F(JobsApi, a_one_shot_job_is_cancelled_when_its_client_leaves) {
  HttpClient client(server_->port());
  ASSERT_TRUE(
      client.send("POST /v1/voxelize?size=16 HTTP/1.1\r\nHost: h\r\n"
                  "Content-Length: 4\r\n\r\nmesh"));
  ASSERT_TRUE(comes_true([&] { return jobs_->queued_jobs() == 1; }));
  client.close();
  EXPECT_TRUE(comes_true([&] {
    return testing::jobs_of(*jobs_, Caller::open(), 1, JobState::kCancelled).size() == 1;
  }));
}

TEST_F(JobsApi, a_one_shot_job_returns_its_result) {
  HttpClient client(server_->port());
  ASSERT_TRUE(
      client.send("POST /v1/voxelize?size=16 HTTP/1.1\r\nHost: h\r\n"
                  "Content-Length: 4\r\n\r\nmesh"));
  FakeWorker worker = connect_worker();
  const auto task = worker.claim();
  ASSERT_TRUE(task && worker.complete(*task, "voxels"));
  const auto response = client.receive();
  ASSERT_TRUE(response);
  EXPECT_EQ(response->status, 200);
  EXPECT_EQ(response->body, "voxels");
  EXPECT_EQ(response->header("x-voxeld-job"), task->id);
}

TEST_F(JobsApi, uploads_over_the_limit_are_payload_too_large_with_and_without_a_length) {
  ApiServerConfig config;
  config.upload_bytes_max = 10;
  start(config);
  EXPECT_EQ(request("POST", "/v1/assets", "", "0123456789").status, 201);
  EXPECT_EQ(request("POST", "/v1/assets", "", "0123456789x").code(), "payload-too-large");
  HttpClient client(server_->port());
  ASSERT_TRUE(
      client.send("POST /v1/assets HTTP/1.1\r\nHost: h\r\nTransfer-Encoding: chunked\r\n\r\n"
                  "6\r\n012345\r\n6\r\n012345\r\n"));
  EXPECT_EQ(client.receive().value_or(HttpResponse{}).code(), "payload-too-large");
}

TEST_F(JobsApi, uploads_of_another_kind_or_of_nothing_are_refused) {
  EXPECT_EQ(request("POST", "/v1/assets", "Content-Type: multipart/form-data\r\n", "x").code(),
            "unsupported-media-type");
  EXPECT_EQ(request("POST", "/v1/assets").detail(), "the body is empty");
  EXPECT_EQ(request("POST", "/v1/jobs", "", "{").code(), "bad-request");
}

class Events : public ServerTest {
 protected:
  // A stream whose head has arrived with `status`.
  HttpClient subscribe(const std::string& job, int status, const std::string& lines = "") {
    HttpClient client(server_->port());
    EXPECT_TRUE(client.send_get("/v1/jobs/" + job + "/events", lines));
    const auto head = client.receive_head();
    EXPECT_EQ(head ? head->status : 0, status);
    return client;
  }
};

TEST_F(Events, a_stream_has_each_change_and_ends_with_the_job) {
  const std::string job = submit();
  HttpClient client(server_->port());
  ASSERT_TRUE(client.send_get("/v1/jobs/" + job + "/events"));
  FakeWorker worker = connect_worker();
  const auto task = worker.claim();
  ASSERT_TRUE(task && worker.complete(*task, "bytes"));
  const HttpResponse stream = client.receive().value_or(HttpResponse{});
  EXPECT_EQ(stream.header("content-type"), "text/event-stream");
  EXPECT_EQ(stream.header("connection"), "close");
  const std::string& text = stream.body;
  EXPECT_EQ(text.substr(0, 4), "id: ");
  EXPECT_EQ(text.substr(text.size() - 2), "\n\n");
  const size_t queued = text.find(R"("state":"queued")"), done = text.find(R"("state":"done")");
  EXPECT_LT(queued, done);
  EXPECT_NE(done, std::string::npos) << text;
}

TEST_F(Events, a_change_is_sent_while_the_stream_waits) {
  const std::string job = submit();
  HttpClient client = subscribe(job, 200);
  EXPECT_NE(client.receive_some().find(R"("state":"queued")"), std::string::npos);
  FakeWorker worker = connect_worker();
  ASSERT_TRUE(worker.claim());
  EXPECT_NE(client.receive_some().find(R"("state":"running")"), std::string::npos);
}

TEST_F(Events, a_stream_goes_on_after_the_last_event_that_the_client_saw) {
  const std::string job = submit();
  HttpClient first = subscribe(job, 200);
  const std::string seen = first.receive_some();
  const size_t at = seen.find("id: ") + 4;
  const std::string last = seen.substr(at, seen.find('\n', at) - at);
  ASSERT_EQ(request("DELETE", "/v1/jobs/" + job).status, 200);
  const HttpResponse second = get("/v1/jobs/" + job + "/events", "Last-Event-ID: " + last + "\r\n");
  EXPECT_EQ(second.body.find("id: " + last + "\n"), std::string::npos) << second.body;
  EXPECT_NE(second.body.find(R"("state":"cancelled")"), std::string::npos) << second.body;
}

TEST_F(Events, a_stream_ends_whole_when_the_daemon_stops) {
  HttpClient client = subscribe(submit(), 200);
  client.receive_some();
  server_->stop(3600);  // would be the time of the test, too
  EXPECT_TRUE(client.receive_to_end()) << "ended by its last chunk, not cut";
}

TEST_F(Events, after_the_last_event_of_a_job_there_is_no_content) {
  const std::string job = "/v1/jobs/" + submit();
  ASSERT_EQ(request("DELETE", job).status, 200);
  const HttpResponse events = get(job + "/events");
  EXPECT_EQ(events.status, 200);
  const std::string last = events.body.substr(events.body.rfind("id: ") + 4);
  const std::string seen = last.substr(0, last.find('\n'));
  EXPECT_EQ(get(job + "/events", "Last-Event-ID: " + seen + "\r\n").status, 204);
}

TEST_F(Events, an_event_id_that_is_none_is_a_bad_request) {
  const std::string path = "/v1/jobs/" + submit() + "/events";
  EXPECT_EQ(get(path, "Last-Event-ID: x\r\n").code(), "bad-request");
  EXPECT_EQ(get("/v1/jobs/j-0/events").code(), "not-found");
}

TEST_F(JobsApi, a_list_is_read_page_by_page) {
  std::vector<std::string> ids;
  for (int i = 0; i < 5; ++i) ids.insert(ids.begin(), submit());
  std::vector<std::string> seen;
  std::string after;
  int pages = 0;
  do {
    const auto page = json(get("/v1/jobs?state=queued&limit=2&after=" + after));
    for (const auto& job : page["jobs"]) {
      seen.push_back(job.value("id", ""));
      EXPECT_EQ(job["queue_position"], 6 - static_cast<int>(seen.size()));
    }
    after = page.value("next", "");
    ++pages;
  } while (!after.empty());
  EXPECT_EQ(seen, ids);
  EXPECT_EQ(pages, 3);
  const HttpResponse refused = get("/v1/jobs?after=j-0");
  EXPECT_EQ(refused.status, 400);
  EXPECT_EQ(refused.code(), "invalid-option");
  EXPECT_EQ(json(refused)["expected"], "the `next` of an earlier page of this list");
  EXPECT_EQ(json(get("/v1/jobs?other=1"))["expected"], "limit, after, state");
}

TEST_F(JobsApi, a_list_goes_on_after_a_job_whose_record_was_deleted) {
  const std::string older = submit(), newer = submit();
  const auto first = json(get("/v1/jobs?limit=1"));
  ASSERT_EQ(first["jobs"][0]["id"], newer);
  request("DELETE", "/v1/jobs/" + newer);
  request("DELETE", "/v1/jobs/" + newer + "?ended=remove");
  ASSERT_EQ(get("/v1/jobs/" + newer).code(), "not-found");
  const auto second = json(get("/v1/jobs?limit=1&after=" + first.value("next", "")));
  ASSERT_EQ(second["jobs"].size(), 1u);
  EXPECT_EQ(second["jobs"][0]["id"], older);
}

TEST_F(JobsApi, the_queue_has_memory_and_storage_for_the_only_tenant_and_for_admins) {
  FakeWorker worker = connect_worker();
  const HttpResponse response = get("/v1/queue");
  const auto open = json(response);
  ASSERT_TRUE(open.contains("store") && !open["devices"].empty()) << response.body;
  EXPECT_GE(open["devices"][0].value("memory_bytes", -1), 0);
  EXPECT_GE(open["store"].value("bytes", -1), 0);
  EXPECT_GT(open["store"].value("disk_bytes", 0.0), open["store"].value("disk_free_bytes", 0.0));
  ApiKey admin;
  admin.is_admin = true;
  const std::string lab = bearer(add_key("lab")), boss = bearer(add_key("boss", admin));
  const auto seen = json(get("/v1/queue", lab));
  EXPECT_FALSE(seen.contains("store"));
  EXPECT_FALSE(seen["devices"][0].contains("memory_bytes"));
  EXPECT_TRUE(json(get("/v1/queue", boss)).contains("store"));
}

TEST_F(JobsApi, the_queue_is_read_page_by_page_running_jobs_first) {
  std::vector<std::string> ids;
  for (int i = 0; i < 5; ++i) ids.push_back(submit());
  FakeWorker worker = connect_worker();
  ASSERT_TRUE(worker.claim());
  std::vector<std::string> seen;
  std::string after;
  int pages = 0;
  do {
    const auto page = json(get("/v1/queue?limit=2&after=" + after));
    EXPECT_EQ(page["queued"], 4);
    EXPECT_EQ(page["running"], 1);
    for (const auto& job : page["jobs"]) {
      EXPECT_EQ(job["state"], seen.empty() ? "running" : "queued");
      seen.push_back(job.value("id", ""));
    }
    after = page.value("next", "");
    ++pages;
  } while (!after.empty());
  EXPECT_EQ(seen, ids);
  EXPECT_EQ(pages, 3);
  for (const char* bad : {"x", "running", "done.j-0", "queued.j-0", "queued."}) {
    EXPECT_EQ(get(std::string("/v1/queue?after=") + bad).code(), "invalid-option") << bad;
  }
  EXPECT_EQ(get("/v1/queue?limti=2").detail(), "unknown parameter 'limti'; did you mean 'limit'?");
}

TEST_F(JobsApi, accept_chooses_the_format_of_a_voxelization) {
  FakeWorker worker = connect_worker();
  const auto format_of = [&](const std::string& query, const std::string& accept) {
    HttpClient client(server_->port());
    EXPECT_TRUE(client.send("POST /v1/voxelize?cache=no" + query + " HTTP/1.1\r\nHost: h\r\n" +
                            accept + "Content-Length: 4\r\n\r\nmesh"));
    const auto task = worker.claim();
    EXPECT_TRUE(task && worker.complete(*task, "grid"));
    const auto response = client.receive();
    const auto options = nlohmann::json::parse(task ? task->options_json : "{}");
    return options.value("format", "") + " " + response.value_or(HttpResponse{}).header("vary");
  };
  EXPECT_EQ(format_of("", ""), "native Accept");
  EXPECT_EQ(format_of("", "Accept: */*\r\n"), "native Accept");
  EXPECT_EQ(format_of("", "Accept: application/x-npz\r\n"), "npz Accept");
  EXPECT_EQ(format_of("", "Accept: text/x-xyz;q=0.5, model/*\r\n"), "vox Accept");
  EXPECT_EQ(format_of("&animation=0", "Accept: application/zip\r\n"), "xyz Accept");
  EXPECT_EQ(format_of("&format=npy", "Accept: application/x-npz\r\n"), "npy ");
}

TEST_F(JobsApi, a_voxelization_that_accepts_no_type_is_refused_with_all_types) {
  const HttpResponse refused = request("POST", "/v1/voxelize", "Accept: image/png\r\n", "mesh");
  EXPECT_EQ(refused.status, 406);
  EXPECT_EQ(refused.code(), "not-acceptable");
  EXPECT_EQ(refused.header("vary"), "Accept");
  EXPECT_EQ(json(refused)["expected"],
            "one of application/vnd.voxeld.grid, application/x-npy, application/x-npz, "
            "model/x-magicavoxel-vox, text/x-xyz, model/gltf-binary, model/ply, model/obj, "
            "application/x-vti, application/x-nrrd, application/x-metaimage, "
            "application/x-nifti, application/x-binvox, text/csv, application/x-pcd, "
            "model/x-qubicle-qb, application/x-schem, application/x-litematic, "
            "application/x-nbt, application/x-zarr+zip, application/x-vdb, application/x-nvdb, "
            "application/x-octomap-bt, application/x-ldraw, application/x-vtu, "
            "application/x-abaqus-inp, image/ktx2, application/x-raw+zip, "
            "application/x-png-slices+zip");
  const HttpResponse moving = request("POST", "/v1/voxelize?animation=0",
                                      "Accept: application/vnd.voxeld.grid\r\n", "mesh");
  EXPECT_EQ(json(moving)["expected"],
            "one of application/vnd.voxeld.sequence, application/x-npy, application/x-npz, "
            "model/x-magicavoxel-vox, application/zip, application/x-zarr+zip");
  EXPECT_EQ(json(get("/v1/assets"))["assets"].size(), 0u) << "refused before the upload";
}

TEST_F(JobsApi, assets_are_read_page_by_page_and_of_one_time_by_id) {
  std::set<std::string> ids;
  for (int i = 0; i < 5; ++i) ids.insert(post_asset("mesh " + std::to_string(i)));
  std::vector<std::string> seen;
  std::string after;
  do {
    const auto page = json(get("/v1/assets?limit=2&after=" + after));
    for (const auto& asset : page["assets"]) seen.push_back(asset.value("id", ""));
    after = page.value("next", "");
  } while (!after.empty());
  EXPECT_EQ(seen.size(), 5u);
  EXPECT_EQ(std::set(seen.begin(), seen.end()), ids);
  for (const char* cursor : {"x", "1", "1.2", "-1.a.b"}) {
    EXPECT_EQ(get("/v1/assets?after=" + std::string(cursor)).code(), "invalid-option") << cursor;
  }
  // The next one would be below all numbers.
  const std::string job = "/v1/jobs/" + submit();
  for (const std::string& list :
       {std::string("/v1/jobs"), std::string("/v1/grids"), job + "/frames"}) {
    EXPECT_EQ(get(list + "?after=9223372036854775807").code(), "invalid-option") << list;
  }
}

TEST_F(JobsApi, long_texts_of_a_job_are_left_to_its_own_page) {
  std::string times = "0";
  for (int i = 1; i < 4096; ++i) times += "," + std::to_string(i) + ".5";
  const HttpResponse sent = request("POST", "/v1/jobs", "",
                                    R"({"kind":"voxelize","asset":")" + post_asset() +
                                        R"(","options":{"animation":0,"times":[)" + times + "]}}");
  ASSERT_EQ(sent.status, 202) << sent.body;
  const auto row = json(get("/v1/jobs"))["jobs"][0];
  EXPECT_EQ(row["left_out"], std::vector<std::string>{"options"});
  EXPECT_FALSE(row.contains("options"));
  EXPECT_LT(row.dump().size(), 2000u);
  const HttpResponse whole = get(sent.header("location"));
  const auto list = nlohmann::json::parse("[" + times + "]");
  EXPECT_EQ(json(whole)["options"]["times"], list);
  EXPECT_EQ(whole.header("etag"), sent.header("etag"));
  EXPECT_EQ(json(sent)["options"]["times"], list);
  for (const char* what : {"cancelled", "removed"}) {
    const HttpResponse last = request("DELETE", sent.header("location") + "?ended=remove");
    ASSERT_EQ(last.status, 200) << what;
    EXPECT_EQ(json(last)["options"]["times"], list) << what;
  }
  EXPECT_EQ(get(sent.header("location")).status, 404);
}

}  // namespace
}  // namespace voxeld::api
