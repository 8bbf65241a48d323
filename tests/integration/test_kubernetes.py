"""docker/kubernetes without a cluster: fields by schema, names that belong together, the pod's commands."""
import copy
import http.client
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

import jsonschema
import yaml

from harness import BIN, HANG_SECONDS, ROOT

FOLDER = ROOT / "docker/kubernetes"
SCHEMAS = yaml.safe_load((pathlib.Path(__file__).parent / "kubernetes_schemas.yaml").read_text())
UNITS = {"G": 10**9, "Gi": 1 << 30}
# Bytes that the daemon means by G.
GIB = 1 << 30


def load(name):
    return yaml.safe_load((FOLDER / name).read_text())


def problems(name, document):
    """The file, the place in it and what is wrong, of each error."""
    kind = document.get("kind")
    if kind not in SCHEMAS["kinds"]:
        return [f"{name}: kind: {kind!r} is not one of {sorted(SCHEMAS['kinds'])}"]
    schema = {"$defs": SCHEMAS["$defs"], **SCHEMAS["kinds"][kind]}
    errors = jsonschema.Draft202012Validator(schema).iter_errors(document)
    return sorted(f"{name}: {'.'.join(map(str, error.absolute_path)) or kind}: {error.message}"
                  for error in errors)


def merged(base, patch):
    """Kubernetes' strategic merge, of the lists that patches here have: items with one name are one."""
    if isinstance(base, dict) and isinstance(patch, dict):
        return {key: merged(base[key], patch[key]) if key in base and key in patch
                else base.get(key, patch.get(key)) for key in {**base, **patch}}
    if isinstance(base, list) and all("name" in item for item in base + patch):
        patches = {item["name"]: item for item in patch}
        kept = [merged(item, patches.pop(item["name"], {})) for item in base]
        return kept + list(patches.values())
    return patch


class Manifests(unittest.TestCase):
    def setUp(self):
        self.set = load("base/statefulset.yaml")
        self.pod = self.set["spec"]["template"]["spec"]
        self.container = self.pod["containers"][0]
        self.settings = load("base/settings.yaml")["data"]

    def test_each_file_fits_its_schema(self):
        files = sorted(path.relative_to(FOLDER) for path in FOLDER.rglob("*.yaml"))
        self.assertGreater(len(files), 6)
        for name in files:
            self.assertEqual(problems(name, load(name)), [])

    def test_a_wrong_field_is_refused_with_its_place(self):
        cases = [
            (("spec", "template", "spec", "containers", 0, "readynessProbe"), {},
             "s: spec.template.spec.containers.0: Additional properties are not allowed "
             "('readynessProbe' was unexpected)"),
            (("spec", "template", "spec", "containers", 0, "ports", 0, "containerPort"), "8080",
             "s: spec.template.spec.containers.0.ports.0.containerPort: '8080' is not of type 'integer'"),
            (("spec", "template", "spec", "containers", 0, "resources", "limits", "memory"), "8GB",
             "s: spec.template.spec.containers.0.resources.limits.memory: '8GB' does not match "),
            (("spec", "template", "spec", "securityContext", "runAsUser"), 0,
             "s: spec.template.spec.securityContext.runAsUser: 0 is less than the minimum of 1"),
            (("spec", "replica"), 1,
             "s: spec: Additional properties are not allowed ('replica' was unexpected)"),
            (("apiVersion",), "apps/v1beta1", "s: apiVersion: 'apps/v1' was expected"),
            (("kind",), "StatefullSet", "s: kind: 'StatefullSet' is not one of ["),
        ]
        for path, value, expected in cases:
            document = copy.deepcopy(self.set)
            holder = document
            for step in path[:-1]:
                holder = holder[step]
            holder[path[-1]] = value
            found = problems("s", document)
            self.assertEqual(len(found), 1, found)
            self.assertTrue(found[0].startswith(expected), found[0])

    def test_each_file_is_one_of_its_kustomization(self):
        for folder in (FOLDER / "base", FOLDER / "nvidia"):
            listed = yaml.safe_load((folder / "kustomization.yaml").read_text())
            names = set(listed["resources"]) | {patch["path"] for patch in listed.get("patches", [])}
            self.assertEqual(names - {"../base"},
                             {path.name for path in folder.glob("*.yaml")} - {"kustomization.yaml"})
        base = load("base/kustomization.yaml")
        self.assertEqual(base["namespace"], load("base/namespace.yaml")["metadata"]["name"])
        for container in self.pod["containers"] + self.pod["initContainers"]:
            self.assertEqual(container["image"], base["images"][0]["name"])

    def test_names_and_ports_meet(self):
        labels = self.set["spec"]["template"]["metadata"]["labels"]
        service, policy = load("base/service.yaml"), load("base/networkpolicy.yaml")
        for selected in (service["spec"]["selector"], policy["spec"]["podSelector"]["matchLabels"],
                         self.set["spec"]["selector"]["matchLabels"]):
            self.assertEqual(selected, labels)
        self.assertEqual(self.set["spec"]["serviceName"], service["metadata"]["name"])
        ports = {port["name"]: port["containerPort"] for port in self.container["ports"]}
        self.assertEqual(service["spec"]["ports"][0]["targetPort"], "http")
        self.assertEqual([rule["ports"][0]["port"] for rule in policy["spec"]["ingress"]],
                         ["http", "admin"])
        for probe in ("startupProbe", "livenessProbe", "readinessProbe"):
            self.assertEqual(self.container[probe]["httpGet"]["port"], "admin")
        self.assertEqual(self.settings["VOXELD_LISTEN"], f"0.0.0.0:{ports['http']}")
        self.assertEqual(self.settings["VOXELD_ADMIN_LISTEN"], f"0.0.0.0:{ports['admin']}")
        annotations = self.set["spec"]["template"]["metadata"]["annotations"]
        self.assertEqual(annotations["prometheus.io/port"], str(ports["admin"]))
        self.assertEqual(self.container["envFrom"][0]["configMapRef"]["name"],
                         load("base/settings.yaml")["metadata"]["name"])
        volumes = {volume["name"] for volume in self.pod["volumes"]}
        volumes |= {claim["metadata"]["name"] for claim in self.set["spec"]["volumeClaimTemplates"]}
        for container in self.pod["containers"] + self.pod["initContainers"]:
            for mount in container["volumeMounts"]:
                self.assertIn(mount["name"], volumes)

    def test_settings_are_options_of_the_daemon(self):
        help_text = subprocess.run([BIN / "voxeld", "serve", "--help"], check=True,
                                   capture_output=True, text=True).stdout
        gpu = load("nvidia/gpu.yaml")["spec"]["template"]["spec"]["containers"][0]["env"]
        known = re.findall(r"\(Env:(\w+)\)", help_text)
        for name in [*self.settings, *(each["name"] for each in gpu)]:
            self.assertIn(name, known)

    def test_results_are_evicted_before_the_volume_is_full(self):
        claim = self.set["spec"]["volumeClaimTemplates"][0]["spec"]["resources"]["requests"]["storage"]
        volume = int(claim.removesuffix("Gi")) * UNITS["Gi"]
        store = int(self.settings["VOXELD_STORE_BYTES_MAX"].removesuffix("G")) * GIB
        self.assertLessEqual(store, 0.85 * volume)

    def test_the_overlay_adds_a_gpu(self):
        patch = load("nvidia/gpu.yaml")
        self.assertEqual(patch["metadata"]["name"], self.set["metadata"]["name"])
        self.assertEqual(patch["metadata"]["namespace"], load("base/namespace.yaml")["metadata"]["name"])
        whole = merged(self.set, patch)
        self.assertEqual(problems("nvidia", whole), [])
        pod = whole["spec"]["template"]["spec"]
        self.assertEqual(len(pod["containers"]), 1)
        self.assertEqual(pod["containers"][0]["resources"]["limits"],
                         {"memory": "8Gi", "nvidia.com/gpu": "1"})
        self.assertEqual(pod["containers"][0]["env"], [{"name": "VOXELD_DEVICE", "value": "egl:0"}])
        self.assertEqual(pod["containers"][0]["image"], "voxeld")
        self.assertEqual(pod["securityContext"], self.pod["securityContext"])


@unittest.skipUnless(os.geteuid() == 0, "needs root, to run commands as the pod's user")
class Pod(unittest.TestCase):
    """The commands of the pod as its user, on a folder as kubelet mounts a volume with fsGroup."""

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="voxeld-pod-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        self.folder.chmod(0o755)
        self.pod = load("base/statefulset.yaml")["spec"]["template"]["spec"]
        self.user = self.pod["securityContext"]["runAsUser"]
        self.volume, self.secret = self.folder / "volume", self.folder / "secret"
        self.volume.mkdir()
        os.chown(self.volume, 0, self.pod["securityContext"]["fsGroup"])
        self.volume.chmod(0o2775)
        shutil.copy(BIN / "voxeld", self.folder)
        self.key = subprocess.run([BIN / "voxeld", "keys", "add", "lab", "--data", self.secret],
                                  check=True, capture_output=True, text=True).stdout.strip()
        # Kubelet mounts secrets for the group to read.
        self.secret.chmod(0o755)
        os.chown(self.secret / "keys", 0, self.pod["securityContext"]["fsGroup"])
        (self.secret / "keys").chmod(0o640)

    def here(self, text):
        return text.replace("/var/lib/voxeld", str(self.volume)).replace(
            "/etc/voxeld-keys", str(self.secret))

    def as_user(self, command, **kw):
        return subprocess.Popen(command, user=self.user, group=self.user, extra_groups=[],
                                cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                text=True, **kw)

    def initialize(self):
        container = self.pod["initContainers"][0]
        process = self.as_user([self.here(part) for part in container["command"] + container["args"]])
        _, errors = process.communicate(timeout=60)
        self.assertEqual((process.returncode, errors), (0, ""))

    def start(self, **changes):
        settings = {name: self.here(value) for name, value in load("base/settings.yaml")["data"].items()}
        settings.update(changes, HOME=str(self.volume), PATH="/usr/bin:/bin", VOXELD_DEVICE="cpu")
        # Any free ports; the address is what counts.
        process = self.as_user([self.folder / "voxeld", "serve", "--listen", "0.0.0.0:0",
                                "--admin-listen", "0.0.0.0:0"], env=settings)
        self.addCleanup(process.communicate)
        self.addCleanup(process.kill)
        return process

    def status(self, port, path, host, key=None):
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=HANG_SECONDS)
        headers = {"Host": host} | ({"Authorization": f"Bearer {key}"} if key else {})
        try:
            connection.request("GET", path, headers=headers)
            return connection.getresponse().status
        finally:
            connection.close()

    def test_the_daemon_starts_with_the_keys_of_the_secret(self):
        for _ in range(2):  # also with what the first start left
            self.initialize()
            process = self.start()
            line = process.stdout.readline()
            ready = re.match(r"ready http://0\.0\.0\.0:(\d+) admin=http://0\.0\.0\.0:(\d+)", line)
            self.assertTrue(ready, line or process.stderr.read())
            port, admin = map(int, ready.groups())
            # Kubelet probes the pod's address; clients come by the service's name.
            for probe in ("startupProbe", "livenessProbe", "readinessProbe"):
                path = self.pod["containers"][0][probe]["httpGet"]["path"]
                self.assertEqual(self.status(admin, path, "10.42.0.7:8081"), 200, path)
            self.assertEqual(self.status(port, "/v1/me", "voxeld.voxeld.svc"), 401)
            self.assertEqual(self.status(port, "/v1/me", "voxeld.voxeld.svc", self.key), 200)
            process.terminate()
            self.assertEqual(process.wait(HANG_SECONDS), 0)

    def test_the_volume_itself_cannot_be_the_data_directory(self):
        self.initialize()
        process = self.start(VOXELD_DATA=str(self.volume))
        _, errors = process.communicate(timeout=60)
        self.assertNotEqual(process.returncode, 0)
        self.assertIn("no write permission for group and others", errors)


if __name__ == "__main__":
    unittest.main()
