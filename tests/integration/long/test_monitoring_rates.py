"""Series for the dashboard and the alerts of a Prometheus with the shipped configuration that scrapes a daemon."""
import http.client
import json
import pathlib
import re
import socket
import subprocess
import tempfile
import unittest
import urllib.parse

import yaml

import test_monitoring
from harness import HANG_SECONDS, TenantsDaemon, wait_until


class Prometheus:
    """A server with the shipped configuration that scrapes `target` each second."""

    def __init__(self, target):
        self.directory = tempfile.TemporaryDirectory()
        folder = pathlib.Path(self.directory.name)
        config = yaml.safe_load(test_monitoring.CONFIG.read_text())
        config["global"] = {"scrape_interval": "1s", "evaluation_interval": "1s"}
        config["rule_files"] = [str(test_monitoring.RULES)]
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
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=HANG_SECONDS)
        try:
            connection.request("GET", f"{path}?{urllib.parse.urlencode(parameters)}")
            body = json.loads(connection.getresponse().read())
        finally:
            connection.close()
        assert body["status"] == "success", body
        return body["data"]

    def query(self, text):
        return self.get("/api/v1/query", query=text)["result"]

    def wait_for_scrapes(self, count):
        def has_scraped():
            assert self.process.poll() is None, self.log_text()
            try:
                found = self.query('count_over_time(up{job="voxeld"}[1h])')
            except OSError:
                return False
            return found and int(found[0]["value"][1]) >= count
        wait_until(has_scraped, self.log_text)

    def log_text(self):
        self.log.seek(0)
        return self.log.read()

    def close(self):
        self.process.terminate()
        self.process.wait(HANG_SECONDS)
        self.log.close()
        self.directory.cleanup()


class Running(unittest.TestCase):
    """A daemon with two tenants, their jobs, an error and a crashed worker, and a Prometheus."""

    @classmethod
    def setUpClass(cls):
        service = TenantsDaemon({"lab": 3, "shop": 1})
        cls.addClassCleanup(service.close)
        cls.prometheus = Prometheus(f"127.0.0.1:{service.daemon.admin_port}")
        cls.addClassCleanup(cls.prometheus.close)
        test_monitoring.work(service, 24)
        service.daemon.kill_worker()
        cls.prometheus.wait_for_scrapes(3)
        test_monitoring.work(service, 26)
        cls.prometheus.wait_for_scrapes(6)

    def test_each_panel_shows_something(self):
        for panel in test_monitoring.panels():
            for target in panel["targets"]:
                text = target["expr"].replace("$__rate_interval", "1m").replace("$instance", ".+")
                self.assertNotIn("$", text)
                found = self.prometheus.query(text)
                if not test_monitoring.HARDWARE & {name for name, _ in test_monitoring.SELECTOR.findall(text)}:
                    self.assertTrue(found, f"{panel['title']}: {text}")
                for label in re.findall(r"{{(\w+)}}", target["legendFormat"]):
                    for series in found:
                        self.assertIn(label, series["metric"], panel["title"])

    def test_no_alert_is_raised_for_a_daemon_in_health(self):
        rules = [rule for group in self.prometheus.get("/api/v1/rules")["groups"]
                 for rule in group["rules"]]
        self.assertEqual(len(rules), len(test_monitoring.alerts()))
        for rule in rules:
            self.assertEqual((rule["name"], rule["health"], rule.get("lastError", "")),
                             (rule["name"], "ok", ""))
            self.assertNotEqual(rule["state"], "firing", rule)


if __name__ == "__main__":
    unittest.main()
