"""Observability: metrics, traces, log lines that belong together, timings."""
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

from harness import BIN, Daemon, DaemonTest, wait_until

TRACE = "4bf92f3577b34da6a3ce929d0e0e4736"
PARENT = f"00-{TRACE}-00f067aa0ba902b7-01"
NAME = r"[a-zA-Z_:][a-zA-Z0-9_:]*"
LABEL = r'[a-zA-Z_][a-zA-Z0-9_]*="(?:[^"\\\n]|\\["\\n])*"'
SAMPLE = re.compile(rf"({NAME})(?:\{{({LABEL}(?:,{LABEL})*)\}})? (\S+)")


def parse_metrics(text):
    """{name: [(labels, value)]} of the text format 0.0.4; refuses what is not in it."""
    assert text.endswith("\n")
    types, helps, samples, current = {}, set(), {}, None
    for line in text.splitlines():
        if match := re.fullmatch(rf"# HELP ({NAME}) (.+)", line):
            assert match[1] not in helps, line
            helps.add(match[1])
        elif match := re.fullmatch(rf"# TYPE ({NAME}) (counter|gauge|histogram|summary|untyped)", line):
            assert match[1] not in types, line
            types[match[1]] = match[2]
            current = match[1]
        else:
            match = SAMPLE.fullmatch(line)
            assert match, line
            base = match[1]
            if types[current] == "histogram":
                base = re.sub(r"_(bucket|sum|count)$", "", base)
            assert base == current, line
            labels = dict(re.findall(r'([a-zA-Z_][a-zA-Z0-9_]*)="((?:[^"\\]|\\.)*)"', match[2] or ""))
            samples.setdefault(match[1], []).append((labels, float(match[3])))
            if types[current] == "counter":
                assert current.endswith("_total") and float(match[3]) >= 0, line
    assert helps == set(types)
    for name, kind in types.items():
        if kind == "histogram":
            check_histogram(name, samples)
    return samples


def check_histogram(name, samples):
    counts = {tuple(sorted(labels.items())): value for labels, value in samples[name + "_count"]}
    for key, count in counts.items():
        buckets = [(float(labels["le"]), value) for labels, value in samples[name + "_bucket"]
                   if tuple(sorted(item for item in labels.items() if item[0] != "le")) == key]
        assert buckets == sorted(buckets) and buckets[-1] == (float("inf"), count), (name, key)
        assert [value for _, value in buckets] == sorted(value for _, value in buckets), (name, key)


class Observability(DaemonTest):
    device = "llvmpipe"

    def metrics(self):
        response = self.daemon.request("GET", "/metrics", port=self.daemon.admin_port)
        self.assertTrue(response.headers["Content-Type"].startswith("text/plain; version=0.0.4"))
        return parse_metrics(response.body.decode())

    def log_lines(self, *parts):
        with open(self.daemon.log.name, encoding="utf-8", errors="replace") as file:
            return [line for line in file if all(part in line for part in parts)]

    def value(self, samples, name, **labels):
        found = [value for have, value in samples.get(name, []) if labels.items() <= have.items()]
        self.assertEqual(len(found), 1, (name, labels, samples.get(name)))
        return found[0]

    def test_metrics_have_their_labels_and_can_be_read(self):
        asset = self.daemon.upload(self.fixtures / "sample.ply")
        job = self.daemon.submit(kind="voxelize", asset=asset, options={"size": 24})
        self.assertEqual(self.daemon.wait(job)["state"], "done")
        bad = self.daemon.post("/v1/voxelize?filename=a.ply", b"ply\nnonsense")
        self.assertEqual(bad.status, 422)

        def counted():
            samples = self.metrics()
            outcomes = {labels.get("outcome") for labels, _ in samples.get("voxeld_jobs_total", [])}
            return samples if {"done", "failed"} <= outcomes else None
        samples = wait_until(counted, "both jobs are counted")  # a moment after the responses
        self.assertGreaterEqual(
            self.value(samples, "voxeld_jobs_total", tenant="", kind="voxelize", outcome="done"), 1)
        self.assertGreaterEqual(
            self.value(samples, "voxeld_jobs_total", tenant="", kind="voxelize", outcome="failed"), 1)
        for stage in ("parse", "voxelize", "encode", "store"):
            self.assertGreaterEqual(self.value(samples, "voxeld_stage_seconds_count", stage=stage,
                                               device="llvmpipe"), 1)
        self.assertGreater(self.value(samples, "voxeld_worker_memory_bytes", device="llvmpipe"), 1e6)
        self.assertEqual(self.value(samples, "voxeld_build_info"), 1)
        self.assertGreater(self.value(samples, "voxeld_http_bytes_total", direction="in"), 100)
        # Routes are patterns: no id of anything is a label.
        for rows in samples.values():
            for labels, _ in rows:
                for text in labels.values():
                    self.assertNotRegex(text, r"j-[0-9a-f]{8}|sha256-[0-9a-f]{8}")

    def test_bytes_and_jobs_count_by_tenant(self):
        data = tempfile.mkdtemp(prefix="voxeld-test-")
        made = subprocess.run([BIN / "voxeld", "keys", "add", "lab", "--data", data], check=True,
                              capture_output=True, text=True).stdout
        daemon = Daemon(device="cpu", data_dir=data)
        try:
            lab = daemon.holding(re.search(r"vxk_\S+", made)[0])
            lab.upload(self.fixtures / "sample.ply")

            def counted():
                samples = parse_metrics(daemon.request("GET", "/metrics", port=daemon.admin_port).body.decode())
                return [value for labels, value in samples.get("voxeld_http_bytes_total", [])
                        if labels == {"direction": "in", "tenant": "lab"}]
            bytes_in = wait_until(counted, "the upload is counted")  # a moment after its response
            self.assertEqual(bytes_in, [(self.fixtures / "sample.ply").stat().st_size])
        finally:
            daemon.stop()
            shutil.rmtree(data, ignore_errors=True)
            pathlib.Path(data + ".log").unlink()

    def test_a_restart_of_a_worker_is_counted(self):
        def restarts():
            return self.metrics().get("voxeld_worker_restarts_total", [({}, 0)])[0][1]
        before = restarts()
        self.daemon.kill_worker()
        wait_until(lambda: restarts() != before, "the restart is counted")
        samples = self.metrics()
        self.assertEqual(
            self.value(samples, "voxeld_worker_restarts_total", device="llvmpipe"), before + 1)

    def test_a_trace_is_continued_returned_and_stored_with_the_job(self):
        asset = self.daemon.upload(self.fixtures / "sample.ply")
        response = self.daemon.post(
            "/v1/jobs", b'{"kind":"voxelize","asset":"%s","options":{"size":20,"cache":"no"}}'
            % asset.encode(), headers={"Content-Type": "application/json", "traceparent": PARENT,
                                       "X-Request-Id": "order-66"})
        self.assertIn(response.status, (200, 202), response.body)
        returned = response.headers["traceresponse"]
        self.assertRegex(returned, rf"^00-{TRACE}-[0-9a-f]{{16}}-01$")
        self.assertNotEqual(returned, PARENT)
        job = response.json()["id"]
        self.assertEqual(self.daemon.wait(job)["state"], "done")
        # One job from the request to the worker and back.
        for text in ("job submitted", "job starts", "task done", "job ended"):
            lines = wait_until(lambda text=text: self.log_lines(text, job), f"the line of {text}")
            self.assertEqual(len(lines), 1, (text, lines))
            self.assertIn(f"trace={TRACE}", lines[0])
            self.assertIn("request=order-66", lines[0])
        self.assertTrue(self.log_lines("[worker llvmpipe]", f"trace={TRACE}"))
        lines = wait_until(lambda: self.log_lines("] request id=order-66", f"trace={TRACE}"), "the line of the request")
        self.assertEqual(len(lines), 1, lines)

    def test_an_invalid_traceparent_starts_a_new_trace(self):
        for header in ("", "00-" + "0" * 32 + "-00f067aa0ba902b7-01", PARENT.upper(), PARENT + "-x",
                       "ff" + PARENT[2:], "nonsense"):
            headers = {"traceparent": header} if header else {}
            response = self.daemon.get("/v1/jobs", headers=headers)
            match = re.fullmatch(r"00-([0-9a-f]{32})-([0-9a-f]{16})-00",
                                 response.headers["traceresponse"])
            self.assertTrue(match, header)
            self.assertNotEqual(match[1], TRACE)

    def test_a_trusted_proxy_tells_the_address_of_its_client(self):
        daemon = Daemon(device="cpu", arguments=["--trusted-proxy", "127.0.0.1"])
        self.addCleanup(daemon.stop)
        for each, peer in ((daemon, "192.0.2.7"), (self.daemon, "127.0.0.1")):
            response = each.get("/v1/me", headers={"X-Forwarded-For": "198.51.100.1, 192.0.2.7"})
            logged = re.compile(rf"request id={response.headers['X-Request-Id']} .*peer={re.escape(peer)} ")
            wait_until(lambda: logged.search(each.log_tail(1 << 20)), f"a request of {peer} is logged")

    def test_problems_name_their_trace(self):
        for path in ("/v1/jobs/j-" + "0" * 32, "/v1/nothing", "/v1/jobs?limit=0"):
            response = self.daemon.get(path, headers={"traceparent": PARENT})
            self.assertGreaterEqual(response.status, 400)
            self.assertEqual(response.json()["trace_id"], TRACE, path)

    def test_timings_stand_on_results_states_and_images(self):
        one_shot = self.daemon.post("/v1/voxelize?size=26&filename=sample.ply",
                                    self.fixture("sample.ply"))
        asset = self.daemon.upload(self.fixtures / "sample.ply")
        job = self.daemon.submit(kind="voxelize", asset=asset, options={"size": 22})
        status = self.daemon.wait(job)
        state = self.daemon.get(f"/v1/jobs/{job}")
        image = self.daemon.get(
            f"/v1/grids/{status['result']['grid']}/render.png?width=32&height=32")
        export = self.daemon.get(f"/v1/grids/{status['result']['grid']}?format=npy")
        for response, stages in ((one_shot, ("queue", "upload", "parse", "voxelize", "encode")),
                                 (state, ("queue", "parse", "voxelize", "encode")),
                                 (image, ("queue", "render", "encode")),
                                 (export, ("queue", "encode"))):
            self.assertEqual(response.status, 200, response.body[:200])
            timing = response.headers["Server-Timing"]
            for stage in stages:
                self.assertRegex(timing, rf"(^|, ){stage};dur=\d+\.\d+")


if __name__ == "__main__":
    unittest.main()
