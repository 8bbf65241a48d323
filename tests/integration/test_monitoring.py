"""docker/prometheus and docker/grafana against Prometheus, and against the metrics of a running daemon."""
import http.client
import json
import pathlib
import re
import socket
import subprocess
import tempfile
import time
import unittest
import urllib.parse

import yaml

from harness import ROOT, TenantsDaemon
from test_observability import parse_metrics

RULES = ROOT / "docker/prometheus/alerts.yaml"
RULE_TESTS = ROOT / "docker/prometheus/alerts_test.yaml"
CONFIG = ROOT / "docker/prometheus/prometheus.yaml"
DASHBOARD = json.loads((ROOT / "docker/grafana/voxeld.json").read_text())
# Metrics that a machine without such a GPU does not have.
HARDWARE = {"voxeld_gpu_memory_bytes"}
SELECTOR = re.compile(r"\b((?:voxeld|process)_[a-z0-9_]+)(?:\{([^}]*)\})?")
# Added by Prometheus, or by the dashboard's variables.
ADDED_LABELS = {"job", "instance"}


def alerts():
    return [rule for group in yaml.safe_load(RULES.read_text())["groups"] for rule in group["rules"]]


def panels():
    return [panel for panel in DASHBOARD["panels"] if panel["type"] != "row"]


def queries():
    """(where it stands, PromQL) of each alert and each panel."""
    for rule in alerts():
        yield rule["alert"], rule["expr"]
    for panel in panels():
        for target in panel["targets"]:
            yield panel["title"], target["expr"]


def promtool(*arguments):
    done = subprocess.run(["promtool", *map(str, arguments)], capture_output=True, text=True,
                          cwd=RULES.parent)
    return done.returncode, done.stdout + done.stderr


class Files(unittest.TestCase):
    def test_promtool_accepts_rules_and_configuration(self):
        for arguments in (("check", "rules", RULES), ("check", "config", CONFIG),
                          ("test", "rules", RULE_TESTS)):
            status, output = promtool(*arguments)
            self.assertEqual(status, 0, output)
            self.assertIn("SUCCESS", output)

    def test_each_alert_has_a_case_in_which_it_fires(self):
        fires = {case["alertname"] for test in yaml.safe_load(RULE_TESTS.read_text())["tests"]
                 for case in test["alert_rule_test"] if case["exp_alerts"]}
        self.assertEqual(fires, {rule["alert"] for rule in alerts()})

    def test_each_alert_says_what_and_what_to_do(self):
        for rule in alerts():
            self.assertIn(rule["labels"]["severity"], ("critical", "warning", "info"), rule)
            self.assertIn("{{ $labels.instance }}", rule["annotations"]["summary"])
            self.assertGreater(len(rule["annotations"]["description"]), 20, rule)

    def test_dashboard_can_be_imported_with_any_datasource(self):
        variables = {each["name"]: each for each in DASHBOARD["templating"]["list"]}
        self.assertEqual(variables["datasource"]["type"], "datasource")
        self.assertNotIn("id", DASHBOARD)  # of one Grafana
        ids = [panel["id"] for panel in DASHBOARD["panels"]]
        self.assertEqual(len(ids), len(set(ids)))
        for panel in panels():
            for holder in (panel, *panel["targets"], variables["instance"]):
                self.assertEqual(holder["datasource"],
                                 {"type": "prometheus", "uid": "${datasource}"}, panel["title"])
            self.assertTrue(panel["description"].endswith("."), panel["title"])
            self.assertTrue(panel["fieldConfig"]["defaults"]["unit"], panel["title"])
            for target in panel["targets"]:
                self.assertIn('instance=~"$instance"', target["expr"], panel["title"])

    def test_panels_do_not_overlap(self):
        taken = {}
        for panel in DASHBOARD["panels"]:
            place = panel["gridPos"]
            self.assertLessEqual(place["x"] + place["w"], 24, panel["title"])
            for x in range(place["x"], place["x"] + place["w"]):
                for y in range(place["y"], place["y"] + place["h"]):
                    self.assertNotIn((x, y), taken, f"{panel['title']} and {taken.get((x, y))}")
                    taken[x, y] = panel["title"]


class Prometheus:
    """A server with the shipped configuration that scrapes `target` each second."""

    def __init__(self, target):
        self.directory = tempfile.TemporaryDirectory()
        folder = pathlib.Path(self.directory.name)
        config = yaml.safe_load(CONFIG.read_text())
        config["global"] = {"scrape_interval": "1s", "evaluation_interval": "1s"}
        config["rule_files"] = [str(RULES)]
        config["scrape_configs"][0]["static_configs"][0]["targets"] = [target]
        (folder / "prometheus.yaml").write_text(yaml.safe_dump(config))
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.log = open(folder / "log", "w+", encoding="utf-8")
        self.process = subprocess.Popen(
            ["prometheus", f"--config.file={folder}/prometheus.yaml",
             f"--storage.tsdb.path={folder}/data", f"--web.listen-address=127.0.0.1:{self.port}"],
            stdout=self.log, stderr=self.log)

    def get(self, path, **parameters):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=30)
        try:
            connection.request("GET", f"{path}?{urllib.parse.urlencode(parameters)}")
            body = json.loads(connection.getresponse().read())
        finally:
            connection.close()
        assert body["status"] == "success", body
        return body["data"]

    def query(self, text):
        return self.get("/api/v1/query", query=text)["result"]

    def wait_for_scrapes(self, count, seconds=60):
        deadline = time.monotonic() + seconds
        while True:
            try:
                found = self.query('count_over_time(up{job="voxeld"}[1h])')
                if found and int(found[0]["value"][1]) >= count:
                    return
            except OSError:
                pass
            assert time.monotonic() < deadline and self.process.poll() is None, self.log_text()
            time.sleep(0.2)

    def log_text(self):
        self.log.seek(0)
        return self.log.read()

    def close(self):
        self.process.terminate()
        self.process.wait(30)
        self.log.close()
        self.directory.cleanup()


class Running(unittest.TestCase):
    """A daemon with two tenants, their jobs, an error and a crashed worker, and a Prometheus."""

    @classmethod
    def setUpClass(cls):
        cls.service = TenantsDaemon({"lab": 3, "shop": 1})
        cls.addClassCleanup(cls.service.close)
        daemon = cls.service.daemon
        cls.prometheus = Prometheus(f"127.0.0.1:{daemon.admin_port}")
        cls.addClassCleanup(cls.prometheus.close)
        cls.work(24)
        daemon.kill_worker()
        cls.prometheus.wait_for_scrapes(3)
        cls.work(26)
        cls.prometheus.wait_for_scrapes(6)
        text = daemon.request("GET", "/metrics", port=daemon.admin_port).body.decode()
        cls.exposed = parse_metrics(text)

    @classmethod
    def work(cls, size):
        for tenant in cls.service.tenants.values():
            asset = tenant.upload(cls.service.fixtures / "sample.ply")
            job = tenant.submit(kind="voxelize", asset=asset, options={"size": size})
            assert tenant.wait(job)["state"] == "done"
            bad = tenant.post(f"/v1/voxelize?filename=a.ply&size={size}", b"ply\nnonsense")
            assert bad.status == 422, bad.body

    def test_each_metric_and_label_of_the_queries_is_exposed(self):
        seen = set()
        for where, text in queries():
            for name, matchers in SELECTOR.findall(text):
                seen.add(name)
                if name in HARDWARE:
                    continue
                self.assertIn(name, sorted(self.exposed), where)
                labels = set().union(*(row[0] for row in self.exposed[name])) | ADDED_LABELS
                for label in re.findall(r"(\w+)\s*[!=]", matchers):
                    self.assertIn(label, labels, f"{where}: {name}")
        self.assertGreater(len(seen), 25)
        known = (ROOT / "server/jobs/README.md").read_text()
        for name in HARDWARE:
            self.assertIn(f"`{name}", known)

    def test_each_panel_shows_something(self):
        for panel in panels():
            for target in panel["targets"]:
                text = target["expr"].replace("$__rate_interval", "1m").replace("$instance", ".+")
                self.assertNotIn("$", text)
                found = self.prometheus.query(text)
                if not HARDWARE & {name for name, _ in SELECTOR.findall(text)}:
                    self.assertTrue(found, f"{panel['title']}: {text}")
                for label in re.findall(r"{{(\w+)}}", target["legendFormat"]):
                    for series in found:
                        self.assertIn(label, series["metric"], panel["title"])

    def test_no_alert_is_raised_for_a_daemon_in_health(self):
        rules = [rule for group in self.prometheus.get("/api/v1/rules")["groups"]
                 for rule in group["rules"]]
        self.assertEqual(len(rules), len(alerts()))
        for rule in rules:
            self.assertEqual((rule["name"], rule["health"], rule.get("lastError", "")),
                             (rule["name"], "ok", ""))
            self.assertNotEqual(rule["state"], "firing", rule)


if __name__ == "__main__":
    unittest.main()
