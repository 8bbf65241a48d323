"""Requests that a web page can make a browser send: DNS rebinding, other origins, and CORS for allowed origins."""
import json
import unittest

from harness import Daemon, DaemonTest, TenantsDaemon

MESH = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
FOREIGN = ("https://evil.example", "http://localhost:3000", "https://127.0.0.1.evil.example", "null", "")
APP = "https://app.example.org"


def exposed(response):
    return {name: value for name, value in response.headers.items()
            if name.lower().startswith("access-control-")}


class Open(DaemonTest):
    """A daemon on loopback without keys, as `voxeld serve` starts it."""
    device = "cpu"
    arguments = ("--public-host", "Voxels.Example.org,other.example", "--cors-origin", APP)

    def ask(self, method, path, headers, body=None, admin=False):
        return self.daemon.request(method, path, body=body, headers=headers,
                                   port=self.daemon.admin_port if admin else None)

    def attack(self, headers):
        """status of each thing that a page would like to do, by its name."""
        mine = self.daemon.upload(self.fixtures / "sample.ply")
        job = {"kind": "voxelize", "asset": mine, "options": {"size": 8}}
        statuses = {
            "upload": self.ask("POST", "/v1/assets?filename=a.obj", headers, MESH).status,
            "voxelize": self.ask("POST", "/v1/voxelize?size=8&filename=a.obj", headers, MESH).status,
            "job": self.ask("POST", "/v1/jobs", {"Content-Type": "application/json", **headers},
                            json.dumps(job)).status,
            "list": self.ask("GET", "/v1/jobs", headers).status,
            "read": self.ask("GET", f"/v1/assets/{mine}", headers).status,
            "specification": self.ask("GET", "/openapi.json", headers).status,
            "nothing": self.ask("GET", "/v1/nothing", headers).status,
            "metrics": self.ask("GET", "/metrics", headers, admin=True).status,
            "readyz": self.ask("GET", "/readyz", headers, admin=True).status,
            "delete": self.ask("DELETE", f"/v1/assets/{mine}", headers).status,
        }
        return statuses

    def assert_all_forbidden(self, headers):
        statuses = self.attack(headers)
        self.assertEqual(statuses, dict.fromkeys(statuses, 403), headers)

    def assert_all_served(self, headers):
        statuses = self.attack(headers)
        self.assertEqual({name: status for name, status in statuses.items() if status // 100 != 2}, {"nothing": 404},
                         headers)

    def test_a_name_that_was_rebound_to_loopback_is_refused(self):
        for host in ("evil.example", f"evil.example:{self.daemon.port}", "127.0.0.1.evil.example",
                     "localhost.evil.example", "127.evil.example", "192.0.2.7", "0.0.0.0", ""):
            with self.subTest(host):
                self.assert_all_forbidden({"Host": host})
                # The page that was loaded under that name is of the same origin, for the browser.
                self.assert_all_forbidden({"Host": host, "Origin": f"http://{host}",
                                           "Sec-Fetch-Site": "same-origin"})
        problem = self.assert_problem(self.ask("GET", "/", {"Host": "evil.example"}), 403, "forbidden",
                                      "needs no API key", "--public-host", "evil.example")
        self.assertEqual(problem["got"], '"evil.example"')

    def test_pages_of_other_origins_are_refused(self):
        for origin in FOREIGN:
            with self.subTest(origin):
                self.assert_all_forbidden({"Origin": origin})
        # Requests of a browser for an image, a script or a link have no Origin.
        self.assert_all_forbidden({"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "no-cors"})
        self.assert_problem(self.ask("GET", "/v1/jobs", {"Origin": "https://evil.example"}), 403,
                            "forbidden", "another origin", "--cors-origin", "https://evil.example")
        for headers in ({"Origin": "https://evil.example"}, {"Sec-Fetch-Site": "cross-site"}):
            self.assertEqual(self.ask("GET", "/", headers).status, 200, "a link to the start page works")

    def test_a_preflight_of_another_origin_is_refused(self):
        preflight = self.ask("OPTIONS", "/v1/jobs", {"Origin": "https://evil.example",
                                                     "Access-Control-Request-Method": "POST"})
        self.assertEqual((preflight.status, exposed(preflight)), (403, {}))

    def test_the_machines_own_user_is_served_under_every_name_of_his(self):
        port = self.daemon.port
        for host in ("localhost", f"localhost:{port}", "LOCALHOST", "127.0.0.1", f"127.0.0.1:{port}", "127.8.8.8",
                     "[::1]", f"[::1]:{port}", "voxels.example.org", f"other.example:{port}"):
            with self.subTest(host):
                self.assert_all_served({"Host": host})
                self.assert_all_served({"Host": host, "Origin": f"http://{host.lower()}",
                                        "Sec-Fetch-Site": "same-origin"})
        # Behind a proxy that ends TLS; a link that the user typed or clicked.
        self.assert_all_served({"Host": "voxels.example.org", "Origin": "https://voxels.example.org"})
        for site in ("none", "same-origin", "same-site"):
            self.assertEqual(self.ask("GET", "/v1/jobs", {"Sec-Fetch-Site": site}).status, 200)

    def test_an_allowed_origin_may_call_and_read(self):
        self.assert_all_served({"Origin": APP, "Sec-Fetch-Site": "cross-site"})
        response = self.ask("GET", "/v1/jobs", {"Origin": APP})
        self.assertEqual(response.headers["Access-Control-Allow-Origin"], APP)

    def test_jobs_come_as_json(self):
        job = json.dumps({"kind": "voxelize", "asset": self.daemon.upload(self.fixtures / "sample.ply"),
                          "options": {"size": 8}})
        # The three types that a form or a page may send without a preflight, and none.
        for kind in ("text/plain", "application/x-www-form-urlencoded", "multipart/form-data; boundary=x",
                     "application/jsonp", "application/octet-stream", None):
            with self.subTest(kind):
                response = self.ask("POST", "/v1/jobs", {"Content-Type": kind} if kind else {}, job)
                self.assert_problem(response, 415, "unsupported-media-type", "application/json", kind or '""')
        for kind in ("application/json", "Application/JSON; charset=utf-8"):
            self.assertIn(self.ask("POST", "/v1/jobs", {"Content-Type": kind}, job).status, (200, 202))


class WithKeys(unittest.TestCase):
    """CORS for those origins that the operator names, and for no others."""

    def test_an_allow_list_that_is_exact_and_told_to_caches(self):
        with TenantsDaemon({"lab": 1}, arguments=("--cors-origin", APP, "--cors-origin",
                                                  "http://localhost:3000")) as daemons:
            lab = daemons.tenants["lab"]
            for origin in (APP, "http://localhost:3000"):
                self.check_allowed(daemons.daemon, lab, origin)
            for origin in ("https://evil.example", APP + ".evil.example", "http://app.example.org",
                           APP + ":444", "null", "http://localhost:3001"):
                with self.subTest(origin):
                    self.check_foreign(daemons.daemon, lab, origin)
            # Without an Origin the response has Vary too, because it differs with one.
            self.assertEqual(lab.get("/v1/jobs").headers["Vary"], "Origin")
            self.assertEqual(lab.get("/openapi.json").headers["Vary"], "Origin")

    def check_allowed(self, anyone, lab, origin):
        preflight = anyone.request("OPTIONS", "/v1/jobs", headers={
            "Origin": origin, "Access-Control-Request-Method": "POST",
            "Access-Control-Request-Headers": "authorization,content-type"})
        self.assertEqual(preflight.status, 204)
        self.assertEqual(preflight.headers["Access-Control-Allow-Origin"], origin)
        self.assertEqual(preflight.headers["Vary"], "Origin")
        self.assertIn("POST", preflight.headers["Access-Control-Allow-Methods"].split(", "))
        wanted = preflight.headers["Access-Control-Allow-Headers"].lower().split(", ")
        self.assertLessEqual({"authorization", "content-type", "prefer", "range", "if-none-match"}, set(wanted))
        self.assertNotIn("Access-Control-Allow-Credentials", preflight.headers)
        response = lab.get("/v1/jobs", headers={"Origin": origin})
        self.assertEqual((response.status, response.headers["Access-Control-Allow-Origin"]), (200, origin))
        self.assertEqual(response.headers["Vary"], "Origin")
        self.assertIn("X-Voxeld-Meta", response.headers["Access-Control-Expose-Headers"].split(", "))
        self.assertNotIn("*", str(exposed(response)) + str(exposed(preflight)))
        # The page may read why it was refused, too.
        refused = anyone.get("/v1/jobs", headers={"Origin": origin})
        self.assertEqual((refused.status, refused.headers["Access-Control-Allow-Origin"]), (401, origin))

    def check_foreign(self, anyone, lab, origin):
        preflight = anyone.request("OPTIONS", "/v1/jobs", headers={
            "Origin": origin, "Access-Control-Request-Method": "POST"})
        self.assertEqual((preflight.status, exposed(preflight)), (403, {}))
        response = lab.get("/v1/jobs", headers={"Origin": origin})
        # A request with a key is served; a browser does not let the page read it.
        self.assertEqual((response.status, exposed(response)), (200, {}))
        self.assertEqual(response.headers["Vary"], "Origin")

    def test_without_the_flag_no_page_may_read_anything(self):
        with TenantsDaemon({"lab": 1}) as daemons:
            response = daemons.tenants["lab"].get("/v1/jobs", headers={"Origin": APP})
            self.assertEqual((response.status, exposed(response)), (200, {}))
            # With keys any name will do: a rebound page has none.
            self.assertEqual(daemons.tenants["lab"].get("/v1/jobs", headers={"Host": "evil.example"}).status, 200)
            # But for the admin port, which never asks for one.
            self.assertEqual(daemons.daemon.request("GET", "/metrics", headers={"Host": "evil.example"},
                                                    port=daemons.daemon.admin_port).status, 403)
            self.check_foreign_links(daemons)

    def check_foreign_links(self, daemons):
        """Links are made for other people's pages and mails."""
        lab = daemons.tenants["lab"]
        job = lab.submit(kind="voxelize", asset=lab.upload(daemons.fixtures / "sample.ply"), options={"size": 8})
        self.assertEqual(lab.wait(job)["state"], "done")
        link = lab.post(f"/v1/jobs/{job}/share").json()["url"]
        self.assertEqual(daemons.daemon.get(link, headers={"Sec-Fetch-Site": "cross-site"}).status, 200)


class Addresses(unittest.TestCase):
    def test_a_listener_for_all_addresses_is_called_by_any_and_by_no_foreign_name(self):
        daemon = Daemon(device="cpu", listen="0.0.0.0:0", arguments=("--allow-remote",))
        self.addCleanup(daemon.stop)
        for host, status in (("192.0.2.7:8080", 200), ("[2001:db8::7]", 200), ("localhost", 200),
                             ("evil.example", 403), ("0.0.0.0", 403), ("[::]:80", 403)):
            with self.subTest(host):
                self.assertEqual(daemon.get("/v1/jobs", headers={"Host": host}).status, status)
        # The admin port of the same daemon is on loopback.
        self.assertEqual(daemon.request("GET", "/livez", headers={"Host": "192.0.2.7"},
                                        port=daemon.admin_port).status, 403)


if __name__ == "__main__":
    unittest.main()
