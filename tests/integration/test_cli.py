"""The CLI voxel, as a person or a script uses it."""
import contextlib
import io
import json
import os
import pathlib
import signal
import socket
import subprocess
import tempfile
import threading
import unittest
import zipfile

import numpy as np

from harness import BIN, DaemonTest, wait_until


class Cli(DaemonTest):
    def setUp(self):
        self.directory = tempfile.TemporaryDirectory()
        self.dir = pathlib.Path(self.directory.name)

    def tearDown(self):
        self.directory.cleanup()

    def voxel(self, *arguments, stdin=None, url=None, **variables):
        return subprocess.run([BIN / "voxel", *map(str, arguments)], input=stdin, capture_output=True,
                              env={**os.environ, "VOXELD_URL": url or self.daemon.url, **variables}, timeout=120)

    def test_format_by_extension(self):
        for name, magic in (("a.npy", b"\x93NUMPY"), ("a.npz", b"PK"), ("a.vox", b"VOX ")):
            done = self.voxel(self.fixtures / "sample.ply", "-o", self.dir / name, "--size", 32)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual(done.stdout, b"")
            self.assertTrue((self.dir / name).read_bytes().startswith(magic))

    def test_volumes_and_points_by_extension(self):
        for name, magic in (("a.vti", b"<?xml"), ("a.nrrd", b"NRRD0004"), ("a.mha", b"ObjectType"),
                            ("a.nii.gz", b"\x1f\x8b"), ("a.b.NII.GZ", b"\x1f\x8b"), ("a.binvox", b"#binvox 1"),
                            ("a.csv", b"x,y,z,px"), ("a.pcd", b"# .PCD v0.7"), ("a.qb", b"\1\1\0\0")):
            done = self.voxel(self.fixtures / "sample.ply", "-o", self.dir / name, "--size", 32)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertTrue((self.dir / name).read_bytes().startswith(magic), name)
        done = self.voxel(self.fixtures / "sample.ply", "-o", self.dir / "color.nrrd", "--size", 32, "--channel", "color")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn(b"kinds: RGBA-color", (self.dir / "color.nrrd").read_bytes())
        for name in ("a.nii", "a.gz", ".nii.gz"):
            done = self.voxel(self.fixtures / "sample.ply", "-o", self.dir / name, "--size", 32)
            self.assertEqual(done.returncode, 2, (name, done.stderr))
            self.assertIn(b".nii.gz", done.stderr)

    def test_pipes(self):
        done = self.voxel("-", "-o", "-", "--format", "npy", "--size", 16, "--filename", "a.ply",
                          stdin=self.fixture("sample.ply"))
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(max(np.load(io.BytesIO(done.stdout)).shape), 16)
        named = subprocess.run(["bash", "-c", '"$0" <(cat "$1") --format npy --size 16 --url "$2"', BIN / "voxel",
                                self.fixtures / "sample.ply", self.daemon.url], capture_output=True, timeout=120)
        self.assertEqual((named.returncode, named.stdout), (0, done.stdout), named.stderr)
        os.mkfifo(self.dir / "a.ply")
        done = self.voxel(self.dir / "a.ply", self.fixtures / "worm" / "walk.md5anim", "-o", "-")
        self.assertEqual((done.returncode, done.stderr), (
            1, f"voxel: {self.dir}/a.ply: a pipe cannot be sent together with other files\n".encode()))

    def test_blocks_by_extension(self):
        for name in ("a.schem", "a.litematic", "A.NBT"):
            done = self.voxel(self.fixtures / "sample.glb", "-o", self.dir / name, "--size", 24, "--blocks",
                              "concrete,minecraft:stone", "--dither", "bayer")
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual((self.dir / name).read_bytes()[:2], b"\x1f\x8b")
        done = self.voxel(self.fixtures / "sample.glb", "-o", self.dir / "b.schem", "--size", 24, "--blocks", "wol")
        self.assertNotEqual(done.returncode, 0)
        self.assertIn(b"did you mean 'wool'?", done.stderr)

    def test_render(self):
        done = self.voxel("render", self.fixtures / "sample.glb", "-o", self.dir / "a.png",
                          "--size", 32, "--width", 64, "--height", 64)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertTrue((self.dir / "a.png").read_bytes().startswith(b"\x89PNG"))

    def test_an_animation_in_every_format(self):
        for name, magic in (("a.vox", b"VOX \xc8"), ("a.npz", b"PK"), ("a.voxs", b"VOXSEQ")):
            done = self.voxel(self.fixtures / "worm.md5.zip", "--animation", "walk", "--frames", "1..3",
                              "-o", self.dir / name, "--size", 24)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertTrue((self.dir / name).read_bytes().startswith(magic))
        self.assertEqual(np.load(self.dir / "a.npz")["occupancy"].shape[0], 3)
        info = json.loads(self.voxel("info", self.dir / "a.voxs", "--json").stdout)
        self.assertEqual(len(info["frames"]), 3)
        self.assertEqual(max(info["dims"]), 24)
        text = self.voxel("info", self.dir / "a.voxs").stdout.decode()
        self.assertIn("frames      3, ", text)

    def test_images_of_frames_and_of_a_turntable(self):
        worm, small = self.fixtures / "worm.md5.zip", ("--size", 24, "--width", 48, "--height", 48)
        for name, magic, *options in (
                ("one.png", b"\x89PNG", "--animation", 0, "--frame", 2),
                ("all.gif", b"GIF89a", "--animation", 0),
                ("all.apng", b"\x89PNG", "--animation", 0, "--frames", "0..2"),
                ("sheet.png", b"\x89PNG", "--animation", 0, "--image", "sheet", "--columns", 3),
                ("around.gif", b"GIF89a", "--turntable", 4)):
            done = self.voxel("render", worm, "-o", self.dir / name, *small, *options)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertTrue((self.dir / name).read_bytes().startswith(magic), name)
        self.assertIn(b"acTL", (self.dir / "all.apng").read_bytes())

    def test_a_stored_sequence_is_drawn(self):
        done = self.voxel(self.fixtures / "worm.md5.zip", "--animation", "walk", "--size", 24,
                          "-o", self.dir / "a.voxs", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        sequence = json.loads(done.stdout)["job"]["result"]["sequence"]
        done = self.voxel("render", "--sequence", sequence, "-o", self.dir / "a.gif", "--width", 48,
                          "--height", 48)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertTrue((self.dir / "a.gif").read_bytes().startswith(b"GIF89a"))

    def test_animations_beside_a_mesh_go_with_it(self):
        with zipfile.ZipFile(self.fixtures / "worm.md5.zip") as archive:
            archive.extractall(self.dir)
        mesh = next(self.dir.rglob("*.md5mesh"))
        found = self.voxel("info", mesh, "--json")
        self.assertEqual(found.returncode, 0, found.stderr)
        names = [animation["name"] for animation in json.loads(found.stdout)["animations"]]
        self.assertEqual(sorted(names), ["walk", "wave"])
        elsewhere = self.dir / "elsewhere"
        elsewhere.mkdir()
        for path in list(self.dir.rglob("*.md5anim")):
            path.rename(elsewhere / path.name)
        named = self.voxel("info", mesh, elsewhere / "wave.md5anim", "--json")
        names = [animation["name"] for animation in json.loads(named.stdout)["animations"]]
        self.assertEqual(names, ["wave"])

    def test_names_of_outputs_that_do_not_fit_are_a_mistake(self):
        for arguments, text in ((("a.ply", "-o", "a.voxs"), b"a .voxs holds an animation's frames"),
                                (("a.zip", "--animation", 0, "-o", "a.voxg"), b"frames go to a .voxs, not a .voxg"),
                                (("render", "--sequence", "x", "--grid", "y"), b"one of a mesh file"),
                                (("a.ply", "--frames", "3..1", "-o", "a.vox"), b"FIRST..LAST")):
            done = self.voxel(*arguments)
            self.assertEqual(done.returncode, 2, arguments)
            self.assertIn(text, done.stderr, arguments)

    def test_info_jobs_and_json(self):
        done = self.voxel(self.fixtures / "sample.ply", "-o", self.dir / "a.voxg", "--size", 32, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(max(json.loads(done.stdout)["meta"]["dims"]), 32)
        info = self.voxel("info", self.dir / "a.voxg", "--json")
        self.assertEqual(max(json.loads(info.stdout)["dims"]), 32)
        self.assertEqual(self.voxel("info", self.fixtures / "sample.glb").returncode, 0)
        jobs = self.voxel("jobs", "--json")
        self.assertEqual(jobs.returncode, 0, jobs.stderr)
        self.assertTrue(json.loads(jobs.stdout)["jobs"])

    def test_priority_and_deadline(self):
        sample = self.fixtures / "sample.ply"
        done = self.voxel(sample, "-o", self.dir / "a.voxg", "--size", 31, "--priority", 7, "--deadline", 1000)
        self.assertEqual(done.returncode, 0, done.stderr)
        job, = [job for job in self.daemon.get("/v1/jobs").json()["jobs"] if job["priority"] == 7]
        self.assertAlmostEqual(job["deadline_at_ms"] - job["created_ms"], 1e6, delta=1000)
        done = self.voxel(sample, "-o", self.dir / "b.voxg", "--size", 16384, "--channels", "occupancy",
                          "--cache", "no", "--deadline", 0.001)
        self.assertEqual(done.returncode, 6, done.stderr)
        self.assertIn(b"deadline", done.stderr)

    def test_exit_codes(self):
        sample = self.fixtures / "sample.ply"
        out = self.dir / "a.npy"
        self.assertEqual(self.voxel("--nonsense").returncode, 2)
        self.assertEqual(self.voxel(sample, "-o", out, "--size", "many").returncode, 2)
        (self.dir / "bad.obj").write_text("v 1 2\nf 1 2 3\n")
        bad = self.voxel(self.dir / "bad.obj", "-o", out)
        self.assertEqual(bad.returncode, 3)
        self.assertIn(b"line 1", bad.stderr)
        self.assertEqual(self.voxel(sample, "-o", out, "--voxel-size", "1e-7").returncode, 4)
        self.assertEqual(self.voxel(sample, "-o", out, url="http://127.0.0.1:9").returncode, 5)
        self.assertFalse(out.exists())

    def test_hosts_of_no_proxy_are_asked_without_the_proxy(self):
        with socket.create_server(("127.0.0.1", 0)) as proxy:
            proxy.settimeout(0)
            done = self.voxel("jobs", "--timeout", 5, url="http://voxels.invalid", no_proxy="a.example,voxels.invalid",
                              http_proxy=f"http://127.0.0.1:{proxy.getsockname()[1]}")
            self.assertIn(b"voxels.invalid: the name of the host is not known", done.stderr)
            with self.assertRaises(BlockingIOError):
                proxy.accept()

    def test_a_signal_ends_a_command_that_has_nothing_to_cancel_at_once(self):
        with socket.create_server(("127.0.0.1", 0)) as silent:
            silent.settimeout(60)
            process = subprocess.Popen([BIN / "voxel", "ls", "--url", f"http://127.0.0.1:{silent.getsockname()[1]}"],
                                       stdin=subprocess.DEVNULL)
            self.addCleanup(process.kill)
            with silent.accept()[0] as connection:
                self.assertTrue(connection.recv(4))
                process.send_signal(signal.SIGTERM)
                self.assertEqual(process.wait(60), 130)

    def test_an_interrupt_that_is_ignored_has_no_effect(self):
        with socket.create_server(("127.0.0.1", 0)) as server:
            server.settimeout(60)
            url = f"http://127.0.0.1:{server.getsockname()[1]}"
            process = subprocess.Popen(["sh", "-c", 'trap "" INT; exec "$@"', "sh", BIN / "voxel", "ls", "--url", url],
                                       stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
            self.addCleanup(process.kill)
            with server.accept()[0] as connection:
                self.assertTrue(connection.recv(65536))
                process.send_signal(signal.SIGINT)
                connection.sendall(b'HTTP/1.1 200 OK\r\nContent-Length: 14\r\n\r\n{"results":[]}')
                self.assertEqual(process.wait(60), 0)

    def test_a_signal_ends_the_wait_for_a_pipe(self):
        for name in ("-", "a.ply"):
            with self.subTest(name), socket.create_server(("127.0.0.1", 0)) as silent:
                silent.settimeout(60)
                os.mkfifo(self.dir / "a.ply")
                descriptor = os.open(self.dir / "a.ply", os.O_RDWR)
                self.addCleanup(os.close, descriptor)
                process = subprocess.Popen([BIN / "voxel", name, "-o", "a.vox", "--url",
                                            f"http://127.0.0.1:{silent.getsockname()[1]}"], stdin=descriptor,
                                           cwd=self.dir)
                self.addCleanup(process.kill)
                os.write(descriptor, b"ply\n")
                with silent.accept()[0] as connection:
                    self.assertTrue(connection.recv(4))
                    process.send_signal(signal.SIGTERM)
                    self.assertEqual(process.wait(60), 130)
                (self.dir / "a.ply").unlink()
                self.assertEqual(list(self.dir.iterdir()), [])

    def test_a_signal_ends_the_wait_for_who_reads_the_output(self):
        # The grid is more than a pipe takes.
        command = [BIN / "voxel", self.fixtures / "sample.ply", "--size", "100", "--format", "npy", "--url",
                   self.daemon.url, "-o"]
        with subprocess.Popen([*command, "-"], stdout=subprocess.PIPE) as process:
            self.addCleanup(process.kill)
            self.assertEqual(process.stdout.read(1), b"\x93")
            process.send_signal(signal.SIGTERM)
            self.assertEqual(process.wait(60), 130)
        os.mkfifo(self.dir / "fifo")
        with subprocess.Popen([*command, self.dir / "fifo"]) as process:
            self.addCleanup(process.kill)
            wait_until(lambda: len(os.listdir(f"/proc/{process.pid}/task")) > 1, "it looks for signals")
            process.send_signal(signal.SIGTERM)
            self.assertEqual(process.wait(60), 130)

    def test_output_to_a_stdout_that_is_closed_is_a_failure(self):
        job = json.loads(self.voxel(self.fixtures / "sample.ply", "--size", 20, "-o", self.dir / "a.vox",
                                    "--json").stdout)["job"]["id"]
        done = subprocess.run(["sh", "-c", '"$@" >&-', "sh", BIN / "voxel", "jobs", job, "-o", "-", "--url",
                               self.daemon.url], stderr=subprocess.PIPE, timeout=120)
        self.assertEqual((done.returncode, done.stderr), (1, b"voxel: stdout cannot be written: Bad file descriptor\n"))

    def test_a_server_that_does_not_speak_http_is_told_from_a_url_of_another_protocol(self):
        with socket.create_server(("127.0.0.1", 0)) as other:
            def answer():
                with contextlib.suppress(OSError):
                    while True:
                        with other.accept()[0] as connection:
                            connection.sendall(b"SSH-2.0-OpenSSH\r\n")
                            connection.recv(1000)
            threading.Thread(target=answer, daemon=True).start()
            url = f"http://127.0.0.1:{other.getsockname()[1]}"
            done = self.voxel("whoami", url=url)
        self.assertEqual((done.returncode, done.stderr.decode()),
                         (5, f"voxel: {url}: the server does not speak HTTP\n"))

    def test_output_that_a_full_disk_loses_is_a_failure(self):
        for arguments in (("--help",), ("generate", "man"), ("formats",), ("whoami",)):
            with self.subTest(arguments), open("/dev/full", "wb") as full:
                done = subprocess.run([BIN / "voxel", *arguments], stdout=full, stderr=subprocess.PIPE, timeout=120,
                                      env={**os.environ, "VOXELD_URL": self.daemon.url})
                self.assertEqual(done.returncode, 1, done.stderr)
                self.assertRegex(done.stderr, rb"voxel: stdout cannot be written(: No space left on device)?\n")

    def test_help_names_every_option(self):
        text = self.voxel("--help").stdout.decode() + self.voxel("render", "--help").stdout.decode()
        for flag in ("--size", "--dims", "--voxel-size", "--padding", "--bounds", "--color",
                     "--channels", "--pipeline", "--format", "--azimuth", "--section",
                     "--animation", "--frames", "--fps", "--image", "--turntable", "--sequence"):
            self.assertIn(flag, text)


if __name__ == "__main__":
    unittest.main()
