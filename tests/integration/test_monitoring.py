"""docker/prometheus and docker/grafana against promtool, and against the metrics of a running daemon. A Prometheus that
scrapes it is in long/test_monitoring_rates.py."""
import json
import re
import subprocess
import unittest

import yaml

from harness import ROOT, TenantsDaemon, wait_until
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


def work(service, size):
    """A job of each tenant that is done, and one that fails."""
    for tenant in service.tenants.values():
        asset = tenant.upload(service.fixtures / "sample.ply")
        job = tenant.submit(kind="voxelize", asset=asset, options={"size": size})
        assert tenant.wait(job)["state"] == "done"
        bad = tenant.post(f"/v1/voxelize?filename=a.ply&size={size}", b"ply\nnonsense")
        assert bad.status == 422, bad.body


class Exposed(unittest.TestCase):
    """The metrics of a daemon with two tenants, their jobs, an error and a crashed worker."""

    def missing(self):
        """(where, name, label) of each metric and label of the queries that the daemon does not expose."""
        daemon = self.service.daemon
        exposed = parse_metrics(daemon.request("GET", "/metrics", port=daemon.admin_port).body.decode())
        missing = []
        for where, text in queries():
            for name, matchers in SELECTOR.findall(text):
                if name in HARDWARE:
                    continue
                if name not in exposed:
                    missing.append((where, name, None))
                    continue
                labels = set().union(*(row[0] for row in exposed[name])) | ADDED_LABELS
                missing += [(where, name, label) for label in re.findall(r"(\w+)\s*[!=]", matchers)
                            if label not in labels]
        return missing

    def test_each_metric_and_label_of_the_queries_is_exposed(self):
        self.service = TenantsDaemon({"lab": 3, "shop": 1})
        self.addCleanup(self.service.close)
        work(self.service, 24)
        self.service.daemon.kill_worker()
        work(self.service, 26)
        wait_until(lambda: not self.missing(), self.missing)  # responses come before they are counted
        seen = {name for _, text in queries() for name, _ in SELECTOR.findall(text)}
        self.assertGreater(len(seen), 25)
        known = (ROOT / "server/jobs/README.md").read_text()
        for name in HARDWARE:
            self.assertIn(f"`{name}", known)


if __name__ == "__main__":
    unittest.main()
