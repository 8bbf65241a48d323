"""The CLI voxel with several files, with names of outputs, and what it prints for people."""
import json
import os
import pathlib
import pty
import re
import shutil
import signal
import stat
import subprocess
import tempfile
import time
import unittest
import zipfile

from harness import BIN, HANG_SECONDS, DaemonTest, wait_until

CANCEL_SECONDS = 10  # voxel waits no longer for the response to a cancellation


class CliFiles(DaemonTest):
    device = "cpu"

    def setUp(self):
        self.directory = tempfile.TemporaryDirectory()
        self.dir = pathlib.Path(self.directory.name)
        self.environment = {**os.environ, "VOXELD_URL": self.daemon.url}

    def tearDown(self):
        self.directory.cleanup()

    def voxel(self, *arguments):
        return subprocess.run([BIN / "voxel", *map(str, arguments)], capture_output=True, text=True,
                              env=self.environment, timeout=120, stdin=subprocess.DEVNULL)

    def on_a_terminal(self, *arguments):
        """The status, and what a terminal shows of stderr."""
        leader, follower = pty.openpty()
        process = subprocess.Popen([BIN / "voxel", *map(str, arguments)], env=self.environment,
                                   stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=follower)
        os.close(follower)
        text = b""
        while True:
            try:
                piece = os.read(leader, 65536)
            except OSError:
                break
            if not piece:
                break
            text += piece
        os.close(leader)
        process.stdout.close()
        return process.wait(60), text.decode()

    def meshes(self, *names):
        paths = []
        for name in names:
            paths.append(self.dir / name)
            shutil.copy(self.fixtures / ("sample" + pathlib.Path(name).suffix), paths[-1])
        return paths

    def assert_usage(self, text, *arguments):
        done = self.voxel(*arguments)
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertIn(text, done.stderr)

    # --- many files

    def test_each_mesh_becomes_a_file_of_the_folder(self):
        meshes = self.meshes("a.ply", "b.glb")
        out = self.dir / "made" / "here"
        done = self.voxel(*meshes, "--out-dir", out, "--format", "vox", "--size", 16)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(sorted(path.name for path in out.iterdir()),
                         ["a.vox", "b.vox"])
        for path in out.iterdir():
            self.assertTrue(path.read_bytes().startswith(b"VOX "))
        images = self.voxel("render", *meshes[:2], "--out-dir", out, "--size", 16, "--width", 32, "--height", 32)
        self.assertEqual(images.returncode, 0, images.stderr)
        self.assertTrue((out / "b.png").read_bytes().startswith(b"\x89PNG"))

    def test_a_file_that_fails_does_not_stop_the_others(self):
        meshes = self.meshes("a.ply", "c.ply")
        bad = self.dir / "b.obj"
        bad.write_text("v 1 2\nf 1 2 3\n")
        out = self.dir / "out"
        done = self.voxel(meshes[0], bad, meshes[1], "--out-dir", out, "--size", 16, "--format", "npy")
        self.assertEqual(done.returncode, 7)
        self.assertEqual(sorted(path.name for path in out.iterdir()), ["a.npy", "c.npy"])
        lines = done.stderr.splitlines()
        self.assertIn(f"voxel: {bad}: ", lines[-2])
        self.assertIn("line 1", lines[-2])
        self.assertEqual(lines[-1], "voxel: 1 of 3 files failed")
        alone = self.voxel(bad, "--out-dir", out)
        self.assertEqual(alone.returncode, 3)
        report = json.loads(self.voxel(meshes[0], bad, "--out-dir", out, "--size", 16, "--json").stdout)
        self.assertEqual([file.get("output") for file in report["files"]], [str(out / "a.voxg"), None])
        self.assertEqual(report["files"][1]["error"]["code"], "malformed-mesh")
        self.assertEqual(max(report["files"][0]["meta"]["dims"]), 16)

    def test_inputs_that_cannot_be_a_batch_are_refused(self):
        a, b = self.meshes("a.ply", "a.glb")
        self.assert_usage(f"{a} and {b} would both go to {self.dir}/out/a.voxg", a, b, "--out-dir",
                          self.dir / "out")
        self.assert_usage(f"{b}: is a second mesh; --out-dir DIR makes a file of each", a, b, "-o",
                          self.dir / "a.vox")
        self.assert_usage(f"{b}: is a second mesh; voxel info describes one", "info", a, b)
        self.assert_usage("b.voxs: is a second mesh", "info", "a.voxs", "b.voxs")
        upper = self.dir / "B.STL"
        shutil.copy(b, upper)
        self.assert_usage(f"{upper}: is a second mesh", a, upper, "-o", self.dir / "a.vox")
        self.assert_usage("stdin has no name", "-", "--out-dir", self.dir / "out")
        self.assertFalse((self.dir / "out").exists())

    def test_a_mesh_of_the_call_is_not_overwritten(self):
        mesh, = self.meshes("a.ply")
        before = mesh.read_bytes()
        (self.dir / "same").symlink_to(self.dir)
        self.assert_usage("is a mesh of this call and would be lost", mesh, "--out-dir", self.dir / "same",
                          "--format", "ply", "--size", 8)
        self.assert_usage(f"{self.dir}/same/a.ply is an input and would be lost", mesh, "-o",
                          self.dir / "same/a.ply", "--size", 8)
        self.assertEqual(mesh.read_bytes(), before)

    def test_what_fails_around_the_files_of_a_batch_is_told(self):
        mesh, other = self.meshes("a.ply", "b.ply")
        (self.dir / "out" / "b.voxg").mkdir(parents=True)
        done = self.voxel(mesh, other, "--out-dir", self.dir / "out", "--size", 8)
        self.assertEqual(done.returncode, 7, done.stderr)
        self.assertIn(f"voxel: {other}: ", done.stderr)
        self.environment["VOXELD_KEY"] = "vxk_a\r"
        self.assert_usage("the API key holds characters that no key has", mesh, "--out-dir", self.dir / "out")

    def test_a_part_that_a_process_of_the_same_number_left_is_no_obstacle(self):
        mesh, = self.meshes("a.ply")
        script = 'echo >"$1.part-$$"; exec "$2" "$3" -o "$1" --size 8'
        done = subprocess.run(["sh", "-c", script, "sh", self.dir / "a.vox", BIN / "voxel", mesh], capture_output=True,
                              env=self.environment, timeout=120)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertTrue((self.dir / "a.vox").read_bytes().startswith(b"VOX "))

    def test_the_longest_name_of_a_file_is_written(self):
        mesh, = self.meshes("a.ply")
        path = self.dir / ("a" * 251 + ".vox")
        self.assertEqual(self.voxel(mesh, "-o", path, "--size", 8).returncode, 0)
        self.assertTrue(path.read_bytes().startswith(b"VOX "))

    def test_an_empty_file_is_bad_input(self):
        (self.dir / "a.ply").touch()
        self.assertEqual(self.voxel(self.dir / "a.ply", "-o", self.dir / "a.vox").returncode, 3)

    def test_a_file_that_is_replaced_keeps_its_rights(self):
        mesh, = self.meshes("a.ply")
        for mode in (0o600, 0o664):
            path = self.dir / f"{mode}.vox"
            path.touch()
            path.chmod(mode)
            self.assertEqual(self.voxel(mesh, "-o", path, "--size", 8).returncode, 0)
            self.assertEqual((stat.S_IMODE(path.stat().st_mode), path.read_bytes()[:4]), (mode, b"VOX "))

    def test_what_is_told_goes_into_no_file_without_stderr(self):
        for i in range(8):
            (self.dir / f"{i}.obj").write_text(f"mtllib none.mtl\nv 0 0 0\nv {i + 1} 0 0\nv 0 1 0\nf 1 2 3\n")
        arguments = [BIN / "voxel", *sorted(self.dir.glob("*.obj")), "--format", "vox", "--size", "30", "--out-dir"]
        for folder, closed in (("a", ""), ("b", " 2>&-")):
            done = subprocess.run(["sh", "-c", '"$@"' + closed, "sh", *arguments, self.dir / folder],
                                  env=self.environment, timeout=120)
            self.assertEqual(done.returncode, 0)
        for path in (self.dir / "a").iterdir():
            self.assertEqual((self.dir / "b" / path.name).read_bytes(), path.read_bytes())

    def test_a_link_stays_a_link_to_the_output(self):
        mesh, = self.meshes("a.ply")
        (self.dir / "far").mkdir()
        (self.dir / "far/a.vox").write_bytes(b"old")
        (self.dir / "b.vox").symlink_to("far/a.vox")
        self.assertEqual(self.voxel(mesh, "-o", self.dir / "b.vox", "--size", 8).returncode, 0)
        self.assertTrue((self.dir / "b.vox").is_symlink())
        (self.dir / "c.vox").symlink_to("far/c.vox")  # which is not there yet
        self.assertEqual(self.voxel(mesh, "-o", self.dir / "c.vox", "--size", 8).returncode, 0)
        self.assertTrue((self.dir / "c.vox").is_symlink())
        self.assertTrue((self.dir / "far/c.vox").is_file())
        self.assertTrue((self.dir / "far/a.vox").read_bytes().startswith(b"VOX "))

    def test_options_before_the_command_count(self):
        mesh, = self.meshes("a.ply")
        done = self.voxel("--size", 9, "render", mesh, "-o", self.dir / "a.png", "--width", 16, "--height", 16,
                          "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(json.loads(done.stdout)["job"]["options"]["size"], 9)
        self.assert_usage("--size: is no option of voxel jobs", "--size", 9, "jobs")

    def test_progress_and_results_of_all_files_are_seen_on_a_terminal(self):
        status, text = self.on_a_terminal(*self.meshes("a.ply", "b.ply"), "--out-dir", self.dir / "out",
                                          "--size", 16, "--format", "vox")
        self.assertEqual(status, 0, text)
        for name in ("a.vox", "b.vox"):
            self.assertRegex(text, rf"{self.dir}/out/{name}: \d+ x \d+ x \d+ cells, [\d,]+ voxels, "
                                   r"[\d.]+ k?B, [\d.]+ s\r\n")

    def test_an_interrupt_cancels_all_jobs_and_leaves_no_part_of_a_file(self):
        self.interrupt(signal.SIGINT, "abcdef")

    def test_the_end_of_the_terminal_cancels_the_job(self):
        self.interrupt(signal.SIGHUP, "a")

    def interrupt(self, number, letters):
        meshes = [self.dir / f"{letter}.obj" for letter in letters]
        for mesh in meshes:
            shutil.copy(self.fixtures / "sheets.obj", mesh)
        out = self.dir / "out"
        slow = ["--size", "16384", "--channels", "occupancy", "--cache", "no"]

        def states():
            """The state of each job, by its id."""
            listed = json.loads(self.voxel("jobs", "--json", "--limit", 1000).stdout)["jobs"]
            return {job["id"]: job["state"] for job in listed}

        def jobs(*wanted):
            return [job for job, state in states().items() if state in wanted]
        for is_last in (False, False, True):
            before = states()
            process = subprocess.Popen([BIN / "voxel", *meshes, "--out-dir", out, *slow],
                                       env=self.environment, stdin=subprocess.DEVNULL,
                                       stderr=subprocess.PIPE, text=True)
            try:
                wait_until(lambda: jobs("running"), states)
                begin = time.monotonic()
                process.send_signal(number)
                _, stderr = process.communicate(timeout=HANG_SECONDS)
            finally:
                process.kill()
            self.assertEqual(process.returncode, 130, stderr)
            self.assertEqual(stderr.splitlines()[-1], "voxel: stopped by the caller")
            self.assertEqual(list(out.iterdir()), [])
            if is_last or time.monotonic() - begin < CANCEL_SECONDS:
                break
            for job in jobs("running", "queued"):
                self.daemon.cancel(job)
        wait_until(lambda: not jobs("running", "queued"), states)
        self.assertEqual({state for job, state in states().items() if job not in before}, {"cancelled"})

    def test_a_dry_run_makes_nothing(self):
        before = len(json.loads(self.voxel("jobs", "--json", "--limit", 1000).stdout)["jobs"])
        done = self.voxel(*self.meshes("a.ply"), "--size", 100, "--dry-run")
        self.assertEqual(done.returncode, 0, done.stderr)
        head, row = done.stdout.splitlines()
        self.assertEqual(head.split(), ["INPUT", "TIME", "RANGE", "RESULT", "MEMORY", "START", "LEARNED",
                                        "FROM"])
        self.assertRegex(row, r"a\.ply +[\d.]+ s +[\d.]+ s to [\d.]+ s +[\d.]+ k?M?B +[\d.]+ [kMG]?B")
        estimate = json.loads(self.voxel(self.dir / "a.ply", "--size", 100, "--dry-run", "--json").stdout)
        self.assertGreater(estimate["estimates"][0]["estimate"]["seconds"], 0)
        jobs = json.loads(self.voxel("jobs", "--json", "--limit", 1000).stdout)["jobs"]
        self.assertEqual(len(jobs), before)

    def test_a_dry_run_of_several_files_tells_of_each(self):
        files = (self.dir / "gone.ply", *self.meshes("a.ply"), self.dir / "missing.ply")
        options = ("--size", 100, "--dry-run", "--out-dir", self.dir / "out")
        done = self.voxel(*files, *options)
        self.assertEqual(done.returncode, 7, done.stderr)
        rows = done.stdout.splitlines()[1:]
        self.assertRegex(rows[0], r"gone\.ply +file$")
        self.assertRegex(rows[1], r"a\.ply +[\d.]+ s +[\d.]+ s to ")
        self.assertRegex(rows[2], r"missing\.ply +file$")
        lines = done.stderr.splitlines()
        self.assertEqual(lines[-1], "voxel: 2 of 3 files failed")
        self.assertIn("gone.ply: ", lines[-3])
        estimates = json.loads(self.voxel(*files, *options, "--json").stdout)["estimates"]
        self.assertEqual([sorted(one.keys() & {"error", "estimate"}) for one in estimates],
                         [["error"], ["estimate"], ["error"]])
        self.assertFalse((self.dir / "out").exists())

    # --- files that a mesh names

    SQUARE = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3 4/4\n"

    @staticmethod
    def texture(red, green, blue):
        """A TGA of one pixel."""
        return bytes((0, 0, 2, *[0] * 9, 1, 0, 1, 0, 24, 0, blue, green, red))

    def put(self, **files):
        for name, content in files.items():
            path = self.dir / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)

    def colors(self, mesh):
        """The colours of the voxels, and what stderr says."""
        done = self.voxel(mesh, "-o", self.dir / "out.xyz", "--size", 8)
        self.assertEqual(done.returncode, 0, done.stderr)
        lines = (self.dir / "out.xyz").read_text().splitlines()
        return {tuple(map(int, line.split()[3:])) for line in lines}, done.stderr

    def test_textures_under_other_names_are_sent_and_found(self):
        self.put(**{"wall.obj": b"mtllib Wall.MTL\n" + self.SQUARE,
                    "wall.mtl": b"newmtl m\nmap_Kd C:\\Users\\me\\Textures\\BRICK.TGA\n",
                    "textures/brick.tga": self.texture(255, 0, 0), "textures/other.tga": self.texture(0, 0, 255)})
        colors, said = self.colors(self.dir / "wall.obj")
        self.assertEqual(colors, {(255, 0, 0)})
        self.assertIn("Wall.MTL, named by wall.obj: wall.mtl is taken for it (the same name in another case)", said)
        self.assertIn('C:\\Users\\me\\Textures\\BRICK.TGA, named by material "m": textures/brick.tga is taken for it '
                      "(the end of the path)", said)

    def test_a_reader_of_stdout_that_ends_is_told(self):
        mesh, = self.meshes("a.ply")
        reading, writing = os.pipe()
        os.close(reading)
        self.addCleanup(os.close, writing)
        done = subprocess.run([BIN / "voxel", mesh, "-o", "-", "--size", "8"], stdout=writing, text=True,
                              stderr=subprocess.PIPE, stdin=subprocess.DEVNULL, timeout=120, env=self.environment)
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertIn("voxel: stdout cannot be written: Broken pipe", done.stderr)

    def test_names_in_a_legacy_encoding_are_found_on_disk_and_in_zips(self):
        name = "\u8d34\u56fe.tga"
        mesh = b"mtllib a.mtl\n" + self.SQUARE
        library = b"newmtl m\nmap_Kd " + name.encode("gbk") + b"\n"
        self.put(**{"a.obj": mesh, "a.mtl": library, name: self.texture(0, 255, 0)})
        colors, said = self.colors(self.dir / "a.obj")
        self.assertEqual(colors, {(0, 255, 0)})
        self.assertIn(f"{name} is taken for it (read as GBK)", said)
        (self.dir / name).rename(self.dir / os.fsdecode(name.encode("gbk")))
        for material in (library, library.replace(name.encode("gbk"), name.encode())):
            self.put(**{"a.mtl": material})
            self.assertEqual(self.colors(self.dir / "a.obj")[0], {(0, 255, 0)}, material)
        for material, reading in ((library, "the same bytes, which are not UTF-8"),
                                  (library.replace(name.encode("gbk"), name.encode()), "read as GBK")):
            with zipfile.ZipFile(self.dir / "b.zip", "w") as archive:
                archive.writestr("a.obj", mesh)
                archive.writestr("a.mtl", material)
                archive.writestr("XXXX.tga", self.texture(0, 0, 255))
            data = (self.dir / "b.zip").read_bytes()
            (self.dir / "b.zip").write_bytes(data.replace(b"XXXX.tga", name.encode("gbk")))
            colors, said = self.colors(self.dir / "b.zip")
            self.assertEqual(colors, {(0, 0, 255)})
            self.assertIn(reading, said)

    def test_names_on_disk_that_are_not_utf8_or_have_backslashes_or_differ_in_case_are_found(self):
        self.put(**{"a.obj": b"mtllib K\xf6rper.mtl\n" + self.SQUARE,
                    os.fsdecode(b"K\xf6rper.mtl"):
                    b"newmtl n\nmap_Kd Skin.tga\nnewmtl o\nmap_Kd skin.tga\nnewmtl m\nmap_Kd tex\\skin.tga\n",
                    "tex\\skin.tga": self.texture(0, 255, 0), "Skin.tga": self.texture(255, 0, 0),
                    "skin.tga": self.texture(0, 0, 255)})
        colors, said = self.colors(self.dir / "a.obj")
        self.assertEqual(colors, {(0, 255, 0)}, said)

    def test_names_of_macos_whose_letters_are_decomposed_are_found_on_disk_and_in_zips(self):
        files = {"a.obj": "mtllib \u00fc.mtl\n".encode() + self.SQUARE,
                 "u\u0308.mtl": "newmtl m\nmap_Kd \uac00.tga\n".encode(), "\u1100\u1161.tga": self.texture(0, 255, 0)}
        self.put(**files)
        with zipfile.ZipFile(self.dir / "b.zip", "w") as archive:
            for name, data in files.items():
                archive.writestr(name, data)
        for mesh in ("a.obj", "b.zip"):
            colors, said = self.colors(self.dir / mesh)
            self.assertEqual(colors, {(0, 255, 0)}, mesh)
            self.assertIn("\u1100\u1161.tga is taken for it (the same name in another case or Unicode form)", said)

    def test_empty_files_are_left_out_and_named(self):
        self.put(**{"a.obj": b"mtllib empty.mtl\nmtllib a.mtl\n" + self.SQUARE,
                    "a.mtl": b"newmtl m\nmap_Kd empty.tga\n", "empty.tga": b"", "empty.mtl": b""})
        said = self.colors(self.dir / "a.obj")[1]
        self.assertIn("empty.mtl", said)
        self.assertIn("empty.tga", said)

    def test_files_whose_names_no_bundle_may_have_are_left_out(self):
        names = {"a:b.tga": b"a:b.tga", "n\x01.tga": b"n\x01.tga", "..\\x.tga": b"..\\x.tga"}
        self.put(**{"a.obj": b"mtllib a.mtl\n" + self.SQUARE, **dict.fromkeys(names, self.texture(0, 255, 0)),
                    "a.mtl": b"".join(b"newmtl %d\nmap_Kd %s\n" % each for each in enumerate(names.values()))
                    + b"newmtl m\nmap_Kd \x95\\/skin.tga\n", os.fsdecode(b"\x95\\/skin.tga"): self.texture(255, 0, 0)})
        colors, said = self.colors(self.dir / "a.obj")
        self.assertEqual(colors, {(255, 0, 0)}, said)

    def test_the_textures_of_a_ply_are_sent(self):
        self.put(**{"scan.ply": b"ply\nformat ascii 1.0\ncomment TextureFile <this> skin.tga\nelement vertex 3\n"
                                b"property float x\nproperty float y\nproperty float z\nproperty float s\n"
                                b"property float t\nelement face 1\nproperty list uchar int vertex_indices\n"
                                b"end_header\n0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2\n",
                    "scan skin.tga": self.texture(10, 20, 30)})
        self.assertEqual(self.colors(self.dir / "scan.ply")[0], {(10, 20, 30)})

    # --- names of outputs

    def test_a_result_is_converted_to_what_the_name_says(self):
        mesh, = self.meshes("a.ply")
        done = self.voxel(mesh, "-o", self.dir / "a.voxg", "--size", 16, "--json")
        job = json.loads(done.stdout)["job"]
        for name, magic in (("r.voxg", b"VOXGRID"), ("r.vox", b"VOX "), ("r.npz", b"PK"), ("r.npy", b"\x93NUMPY")):
            done = self.voxel("jobs", job["id"], "-o", self.dir / name)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertTrue((self.dir / name).read_bytes().startswith(magic), name)
        self.assertEqual((self.dir / "r.voxg").read_bytes(), (self.dir / "a.voxg").read_bytes())
        self.assert_usage(f"an image of it is made by voxel render --grid {job['result']['grid']} -o ",
                          "jobs", job["id"], "-o", self.dir / "r.png")
        self.assert_usage("the job made a single grid: expected a name that ends in .voxg", "jobs", job["id"],
                          "-o", self.dir / "r.voxs")
        self.assert_usage("the job's result cannot go to this file", "jobs", job["id"], "-o",
                          self.dir / "r.jpg")

    def test_a_converted_result_has_the_voxels_of_its_job(self):
        mesh, = self.meshes("a.ply")
        options = ("--size", 16, "--fill", "solid", "--region", "2,0,1,14,8,15", "--level", 1, "--mirror", "x,z",
                   "--keep", 2, "--erode", 1, "--neighbors", 6, "--crop", "yes", "--palette", "bw")
        self.assertEqual(self.voxel(mesh, "-o", self.dir / "c.qb", *options).returncode, 0)
        # A container of the selection is the job's grid; any other result leaves the whole as that.
        for name, codec in (("a.vox", "fast"), ("a.voxg", "fast"), ("b.voxg", "small")):
            with self.subTest(name):
                done = self.voxel(mesh, "-o", self.dir / name, *options, "--codec", codec, "--json")
                self.assertEqual(done.returncode, 0, done.stderr)
                job = json.loads(done.stdout)["job"]["id"]
                self.assertEqual(self.voxel("jobs", job, "-o", self.dir / "b.qb").returncode, 0)
                self.assertEqual((self.dir / "b.qb").read_bytes(), (self.dir / "c.qb").read_bytes())

    def test_an_image_goes_only_to_a_name_of_images(self):
        mesh, = self.meshes("a.ply")
        done = self.voxel("render", mesh, "-o", self.dir / "a.png", "--size", 16, "--width", 32, "--height", 32,
                          "--json")
        job = json.loads(done.stdout)["job"]["id"]
        self.assertEqual(self.voxel("jobs", job, "-o", self.dir / "b.png").returncode, 0)
        self.assertTrue((self.dir / "b.png").read_bytes().startswith(b"\x89PNG"))
        self.assertEqual(self.voxel("jobs", job, "-o", self.dir / "b.gif").returncode, 2)
        self.assert_usage("voxel without render makes grids", "render", mesh, "-o", self.dir / "a.vox")
        self.assert_usage("voxel render makes images", mesh, "-o", self.dir / "a.png")
        self.assert_usage("expected a name that ends in", mesh, "-o", self.dir / "a.jpg", "--format", "native")

    def test_a_result_is_neither_mixed_with_json_nor_cancelled(self):
        self.assert_usage("stdout carries the JSON", "jobs", "j-1", "-o", "-", "--json")
        self.assert_usage("--cancel excludes --output", "jobs", "j-1", "-o", self.dir / "a.vox", "--cancel")

    # --- suggestions

    def test_the_near_miss_is_suggested(self):
        mesh, = self.meshes("a.ply")
        self.assert_usage("neither a command nor a file; did you mean render?", "rendr", mesh, "-o", "x.png")
        self.assert_usage("voxel does not take --siez; did you mean --size?", mesh, "--siez", 12, "-o", "x.vox")
        self.assert_usage("it is an option of voxel render", mesh, "--azimuth", 12, "-o", "x.vox")
        self.assert_usage("it is an option of voxel without render", "render", mesh, "--format", "vox")

    # --- for people

    def test_info_of_a_mesh_and_of_a_grid(self):
        mesh, = self.meshes("a.ply")
        text = self.voxel("info", mesh).stdout
        for line in (r"format +ply", r"triangles +[\d,]+", r"bounds +\S+ x \S+ x \S+, from .* to .*",
                     r"surface +(not )?watertight", r"asset +sha256-[0-9a-f]{64}"):
            self.assertRegex(text, rf"(?m)^{line}")
        self.voxel(mesh, "-o", self.dir / "a.voxg", "--size", 16)
        text = self.voxel("info", self.dir / "a.voxg").stdout
        for line in (r"size        \d+ x \d+ x \d+ cells", r"voxel size  \S+", r"voxels      \d+",
                     r"file        [\d.]+ k?B"):
            self.assertRegex(text, rf"(?m)^{line}$")

    def test_names_in_a_file_do_not_change_the_terminal(self):
        self.put(**{"a.obj": b"mtllib a.mtl\n" + self.SQUARE.replace(b"usemtl m", b"usemtl \x1b]0;m\x07"),
                    "a.mtl": b"newmtl \x1b]0;m\x07\n"})
        done = self.voxel("info", self.dir / "a.obj")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("?]0;m?", done.stdout)
        self.assertNotRegex(done.stdout + done.stderr, "[\x00-\x09\x0b-\x1f\x7f]")

    def test_names_of_files_do_not_change_the_terminal(self):
        mesh, = self.meshes("a.ply")
        out = self.dir / "o\x1b]0;m\x07"
        status, text = self.on_a_terminal(mesh, self.dir / "no\x1b[2J.ply", "--out-dir", out, "--size", 8)
        self.assertEqual(status, 7, text)
        self.assertIn(f"{self.dir}/o?]0;m?/a.voxg: ", text)
        self.assertIn(f"voxel: {self.dir}/no?[2J.ply: ", text)
        self.assertNotIn("\x1b]", text)
        self.assertNotIn("\x1b[2J", text)

    def test_lists_have_ages_sizes_and_names(self):
        mesh, = self.meshes("named.ply")
        self.voxel(mesh, "-o", self.dir / "a.vox", "--size", 24)
        head, first = self.voxel("jobs").stdout.splitlines()[:2]
        self.assertEqual(head.split(), ["ID", "AGE", "STATE", "KIND", "SIZE", "RESULT", "FILE"])
        self.assertRegex(first, r"^j-[0-9a-f]{32} +\d+ s  done +voxelize +24  [\d.]+ k?B +named\.ply$")
        head, first = self.voxel("ls", "assets").stdout.splitlines()[:2]
        self.assertEqual(head.split(), ["ID", "AGE", "SIZE", "FILE"])
        self.assertRegex(first, r"^sha256-[0-9a-f]{64} +\d+ (s|min) +[\d.]+ [kM]?B  \S+$")

    # --- documents

    def test_documents_name_every_command_and_option(self):
        page = self.voxel("generate", "man").stdout
        bash = self.voxel("generate", "bash").stdout
        zsh = self.voxel("generate", "zsh").stdout
        for name in ("render", "info", "formats", "jobs", "top", "share", "ls", "rm", "whoami", "generate"):
            self.assertIn(f".SS voxel {name}", page)
            self.assertIn(f"    {name})", bash)
            self.assertIn(f"    {name}) _arguments", zsh)
        shown = self.voxel("--help").stdout + self.voxel("render", "--help").stdout
        flags = set(re.findall(r"^ +(?:-\w, *)?(--[a-z][a-z-]*)", shown, re.M))
        self.assertLessEqual({"--out-dir", "--azimuth", "--level-rule", "--no-local"}, flags)
        for flag in flags:
            self.assertIn(flag.replace("-", "\\-"), page)
            self.assertIn(flag, bash)
            self.assertIn(f"'{flag}[", zsh)

    def test_bash_completes_commands_options_and_values(self):
        script = self.dir / "completion"
        script.write_text(self.voxel("generate", "bash").stdout)

        def complete(*words):
            line = " ".join(f"'{word}'" for word in ("voxel", *words))
            code = (f"source {script}; COMP_WORDS=({line}); COMP_CWORD={len(words)}; _voxel; "
                    'printf "%s\\n" "${COMPREPLY[@]}"')
            done = subprocess.run(["bash", "-c", code], capture_output=True, text=True, check=True, cwd=self.dir)
            self.assertEqual(done.stderr, "")
            return done.stdout.split()

        self.assertEqual(complete("rend"), ["render"])
        self.assertEqual(complete("render", "--azi"), ["--azimuth"])
        self.assertEqual(complete("a.ply", "--fill", "s"), ["surface", "solid", "shell"])
        self.assertEqual(complete("ls", "gr"), ["grids"])
        self.assertIn("completion", complete("info", "comp"))

    @unittest.skipUnless(shutil.which("groff"), "groff is not installed")
    def test_the_manual_page_is_correct_troff(self):
        page = self.voxel("generate", "man").stdout
        done = subprocess.run(["groff", "-man", "-ww", "-Tutf8", "-z"], input=page, capture_output=True, text=True)
        self.assertEqual(done.stderr, "")


if __name__ == "__main__":
    unittest.main()
