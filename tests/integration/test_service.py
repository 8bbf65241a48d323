"""The daemon under the system call filter of its systemd unit, as a user without capabilities."""
import os
import pathlib
import shutil
import tempfile
import unittest

from harness import BIN, DEVICES, ROOT, Daemon, make_fixtures, oracle

UNIT = ROOT / "docker/debian/voxeld.service.in"
NOBODY = 65534
SECCOMP_FILTER = "2"


class ServiceDaemon(Daemon):
    """One of a copy that others may run: the checkout may lie where they cannot read."""

    def __init__(self, folder, **kw):
        shutil.copy(BIN / "voxeld", folder)
        self.program = [ROOT / "docker/as-service", UNIT, folder / "voxeld"]
        data_dir = folder / "data"
        data_dir.mkdir()
        if os.geteuid() == 0:
            os.chown(data_dir, NOBODY, NOBODY)
        super().__init__(data_dir=str(data_dir), **kw)


def status_of(pid):
    lines = pathlib.Path(f"/proc/{pid}/status").read_text().splitlines()
    return {name: value.strip() for name, value in (line.split(":", 1) for line in lines)}


@unittest.skipUnless(os.geteuid() == 0, "needs root, to give up capabilities and run as nobody")
class Service(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="voxeld-service-"))
        self.folder.chmod(0o755)
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        make_fixtures(self.folder / "fixtures")

    def look_at(self, daemon, mesh):
        gateway = status_of(daemon.process.pid)
        self.assertEqual(gateway["Seccomp"], SECCOMP_FILTER)
        self.assertEqual((int(gateway["CapEff"], 16), int(gateway["CapBnd"], 16)), (0, 0))
        workers = daemon.request("GET", "/readyz", port=daemon.admin_port).json()["workers"]
        self.assertEqual({worker["sandbox"] for worker in workers}, {"full"})
        status = daemon.wait(daemon.submit(kind="voxelize", asset=daemon.upload(mesh),
                                           options={"size": 40}))
        self.assertEqual(status["state"], "done", status)
        self.assertEqual(status["result"]["meta"]["voxel_count"], oracle(mesh, 40)[1])
        image = daemon.post("/v1/render?size=40&width=100&height=80&filename=sample.ply",
                              mesh.read_bytes())
        self.assertEqual(image.body[:8], b"\x89PNG\r\n\x1a\n", image.body[:200])
        frames = daemon.post("/v1/voxelize?size=16&fps=4&animation=walk&filename=worm.md5.zip",
                             (self.folder / "fixtures/worm.md5.zip").read_bytes())
        self.assertEqual(frames.status, 200, frames.body[:300])

    def test_every_device_works_under_the_units_filter(self):
        for device in DEVICES:
            with self.subTest(device):
                folder = self.folder / device
                folder.mkdir()
                daemon = ServiceDaemon(folder, device=device)
                try:
                    self.look_at(daemon, self.folder / "fixtures/sample.ply")
                finally:
                    daemon.stop()


if __name__ == "__main__":
    unittest.main()
